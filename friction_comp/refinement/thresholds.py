# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The thresholds of refinement in one table: value, unit and reason."""

from __future__ import annotations


class Threshold(float):
    """A number with a unit and a reason.

    Parameters
    ----------
    value : float
    unit : str
        Empty for a share.
    reason : str
    """

    unit: str
    reason: str

    def __new__(cls, value: float, unit: str, reason: str) -> Threshold:
        """Create a number with a unit and a reason."""
        threshold = super().__new__(cls, value)
        threshold.unit, threshold.reason = unit, reason
        return threshold


FEWEST_SAMPLES = Threshold(
    200, 'samples', 'fewer in motion distinguish Coulomb from viscous friction and little else')
ROWS = Threshold(
    16000, 'rows', 'so many averages are searched, taken at 100 Hz or more')
BLOCKS = Threshold(
    16, 'blocks', 'long enough to differ, and enough of them for statistics')
EQUIVALENT = Threshold(
    0.005, 'of the error', 'settings whose errors differ by less are equivalent: the wider '
    'bandwidth and the sharper transition are used')
LEAST_SHARE = Threshold(
    0.02, 'of the squared error', 'an effect that removes less may only correct the shape of '
    'another term')
STANDARD_ERRORS = Threshold(
    2.0, 'standard errors', 'of the gain over blocks that were not fitted')
OWN_SHARE = Threshold(
    0.01, 'of its size', 'that no other term repeats: with less, coefficients cancel')
MOST_EFFECTS = Threshold(
    14, 'effects', 'more than any drive was seen to need')
SEARCHES = Threshold(
    40, 'searches', 'on resampled blocks: the standard error of a share of one half is 8 %')
NAMED_SHARE = Threshold(
    0.6, 'of the searches', 'must choose an effect before it is named')
LAG_ERROR = Threshold(
    0.8, 'of the squared error', 'must remain at most with a lag: it blurs, as the '
    'differentiation of positions does, so that it may stand in for other effects')
GROWTH = Threshold(
    1.3, 'times', 'the error in thirds that were not fitted; above it, only the recording itself '
    'supports the model there')
UNEXPLAINED = Threshold(
    0.4, 'of the residual variance', 'depends on one variable: the model lacks something')
UNEXPLAINED_CURRENT = Threshold(
    0.4, 'of the current', 'remains in motion: the current depends on something that was not '
    'recorded')
USELESS_ERROR = Threshold(
    0.9, 'of the current', 'is the error to expect elsewhere: zero would predict about as well')
SAME_LOAD = Threshold(
    0.02, 'of the coefficient', 'of the load: the largest difference from -1/(k_t·n) before the '
    'torque constant is called wrong')
FOLLOWED_VARIANCE = Threshold(
    0.99, 'of the variance', "of a joint's position is explained by the other joints' positions: "
    'they move as one')
PUSHING_ERROR = Threshold(
    0.5, 'of the squared error', "remains where friction may push: the current is no drive's "
    'response to its motion')


def table() -> list[tuple[str, float, str, str]]:
    """Return the name, value, unit and reason of each threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
