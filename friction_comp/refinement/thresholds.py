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
    200, 'samples', 'fewest in motion; with less, little but Coulomb and viscous friction shows')
REST = Threshold(
    0.1, 's', 'shortest rest; slow motion within this time of a rest is presliding')
PRESLIDING_SPEED = Threshold(
    0.05, 'of the top speed', 'faster motion near a rest is not presliding')
ROWS = Threshold(
    16000, 'rows', 'most samples searched: pieces from everywhere')
REGIMES = Threshold(
    16, 'regimes', 'of motion, each of which is left out of a fit: enough for statistics')
PASSED_AGAIN = Threshold(
    0.4, 'of the motion', 'must be at places that were passed before: only there can predictions '
    'of what was not fitted be wrong about position')
ONE_MOTION = Threshold(
    0.85, "of the speed's variance", 'told by place and direction: more is one motion, repeated')
# Bandwidth and lag.
EQUIVALENT = Threshold(
    0.005, 'of the error', 'less is ignored: the wider bandwidth or sharper transition is used')
ENCODER_STEPS = Threshold(
    2.0, 'times the acceleration', 'that steps of the encoder may make of it: a wider bandwidth '
    'shows these more than the motion, and what a controller makes of them')
LAG_SHARE = Threshold(
    0.2, 'of the squared error', 'smallest gain of a lag, which blurs and may replace effects')
LONGEST_LAG = Threshold(
    0.15, 's', 'longer than that of any drive with a current controller')
# The search.
LEAST_SHARE = Threshold(
    0.02, 'of the squared error', 'smallest gain of an effect; less may only correct another one')
STANDARD_ERRORS = Threshold(
    2.0, 'standard errors', 'smallest gain over regimes that were not fitted')
SHORTLIST = Threshold(
    6, 'effects', 'compared by regimes that were not fitted: those that explain most')
# Reversals.
REVERSALS = Threshold(
    6, 'reversals', 'fewest from which friction at rest is read: three in each direction')
REVERSAL_SAMPLES = Threshold(
    6, 'samples', 'fewest from a turn until friction has changed')
REVERSAL_SPREAD = Threshold(
    0.4, 'of the distance', 'largest standard deviation of presliding')
BREAKAWAY_SPREAD = Threshold(
    0.1, 'of the level', 'largest standard deviation of breakaway: what a law leaves to the gear')
# The verdict.
GROWTH = Threshold(
    1.5, 'times', 'the error where it was fitted: more in motion that was not is said')
LEAST_STRENGTH = Threshold(
    0.03, 'of the residual variance', 'weaker dependences on a variable are not reported')
UNEXPLAINED = Threshold(
    0.4, 'of the residual variance',
    'explained by one variable, or of the error of a constant: the model lacks something')
USELESS_ERROR = Threshold(
    0.9, 'of the error of a constant', 'with a larger error elsewhere, a constant predicts as well')
INSEPARABLE = Threshold(
    0.95, 'rank correlation', 'of two variables throughout: the recording does not tell them apart')


def table() -> list[tuple[str, float, str, str]]:
    """Return the name, value, unit and reason of each threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
