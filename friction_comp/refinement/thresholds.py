# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The thresholds of refinement in one table: value, unit and reason."""

from __future__ import annotations


class Threshold(float):
    """A number with a unit, 'of ...' for a share, and a reason."""

    unit: str
    reason: str

    def __new__(cls, value: float, unit: str, reason: str) -> Threshold:
        """Create a number with a unit and a reason."""
        threshold = super().__new__(cls, value)
        threshold.unit, threshold.reason = unit, reason
        return threshold


# Which samples are fitted, and how they are grouped.
FEWEST_SAMPLES = Threshold(
    200, 'samples', 'fewer in motion distinguish Coulomb from viscous friction and little else')
REST = Threshold(
    0.1, 's', 'of rest at least, before and after which motion is presliding for as long')
PRESLIDING_SPEED = Threshold(
    0.05, 'of the top speed', 'above it, motion beside a rest is no presliding')
ROWS = Threshold(
    16000, 'rows', 'so many averages are searched, taken at 100 Hz or more')
BLOCKS = Threshold(
    16, 'blocks', 'long enough to differ, and enough of them for statistics')
REGIONS = Threshold(
    3, 'regions', 'of posture, where several joints moved')
# Bandwidth, lag and transition.
EQUIVALENT = Threshold(
    0.005, 'of the error', 'of difference at most: the wider bandwidth or sharper transition wins')
LOWER_ERROR = Threshold(
    0.97, 'of the error', 'at most, by the effects found, at a bandwidth that is tried next')
LAG_ERROR = Threshold(
    0.8, 'of the squared error', 'at most with a lag: it blurs, and may stand in for effects')
LONGEST_LAG = Threshold(
    0.15, 's', 'longer than that of any drive with a current controller')
SAME_MOTION_ERROR = Threshold(
    1.02, 'times', 'the least squared error in motion: starts and stops decide below it')
# The search.
LEAST_SHARE = Threshold(
    0.02, 'of the squared error', 'with less, an effect may only correct the shape of another')
STANDARD_ERRORS = Threshold(
    2.0, 'standard errors', 'of the gain over blocks that were not fitted')
STAYS = Threshold(
    0.5, 'of both', 'is enough for an effect to stay in a fit')
OWN_SHARE = Threshold(
    0.01, 'of its size', 'that no other term repeats: with less, coefficients cancel')
SHORTLIST = Threshold(
    6, 'effects', 'compared by held-out blocks: those that explain most of the fitted ones')
MOST_EFFECTS = Threshold(
    14, 'effects', 'more than any drive was seen to need')
# Names.
SEARCHES = Threshold(
    40, 'searches', 'on resampled blocks: the standard error of a share of one half is 8 %')
NAMED_SHARE = Threshold(
    0.6, 'of the searches', 'must choose an effect before it is named')
ALTERNATIVE_SHARE = Threshold(
    0.2, 'of the searches', 'choose another effect instead: it is reported as ambiguous')
# The verdict.
GROWTH = Threshold(
    1.3, 'times', 'the error at most in thirds that were not fitted, or the model ends there')
LEAST_STRENGTH = Threshold(
    0.03, 'of the residual variance', 'depends on one variable: less is not reported')
UNEXPLAINED = Threshold(
    0.4, 'of the residual variance', 'depends on one variable: the model lacks something')
UNEXPLAINED_CURRENT = Threshold(
    0.4, 'of the current', 'remains in motion: it depends on something that was not recorded')
USELESS_ERROR = Threshold(
    0.9, 'of the current', 'is the error to expect elsewhere: zero would predict about as well')
SAME_LOAD = Threshold(
    0.02, 'of -1/(k_t·n)', 'away from it, the load tells that the torque constant is wrong')
WRITTEN_ERROR = Threshold(
    1.5, 'times', "a fit's error at most, of the model as it is written")
FOLLOWED_VARIANCE = Threshold(
    0.99, 'of the variance', "of a joint's position follows from the others': they move as one")
PUSHING_ERROR = Threshold(
    0.5, 'of the squared error', 'remains where friction may push: no drive answers motion so')
WARMED_WITH_TIME = Threshold(
    0.95, 'rank correlation', 'of time and temperature, above which they cannot be told apart')
SPED_WITH_TIME = Threshold(
    0.9, 'rank correlation', 'of time and speed, above which drift may be friction over velocity')
INSEPARABLE = Threshold(
    0.97, 'rank correlation', 'with a variable that the residual depends on: it may be the other')
CORRELATED = Threshold(
    0.8, 'rank correlation', 'of two coefficients over resampled blocks: the pair is reported')
VELOCITY_RATIO = Threshold(
    1.2, 'times', 'the rate of position, above which the recorded velocity is called wrong')


def table() -> list[tuple[str, float, str, str]]:
    """Return the name, value, unit and reason of each threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
