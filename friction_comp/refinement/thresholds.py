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
    16000, 'rows', 'most averages searched; four times as many if they are at 100 Hz')
BLOCKS = Threshold(
    16, 'blocks', 'long enough to differ, and enough of them for statistics')
REGIONS = Threshold(
    3, 'regions', 'of posture, if several joints moved')
POSTURES = Threshold(
    6, 'regions', 'of posture, each of which a whole search does without: with fewer, what is left '
    'out is unlike all others, and what it says depends on how they are drawn')
# Bandwidth, lag and transition.
EQUIVALENT = Threshold(
    0.005, 'of the error', 'less is ignored: the wider bandwidth or sharper transition is used')
LOWER_ERROR = Threshold(
    0.97, 'of the error', 'limit for trying another bandwidth, with the effects found')
LAG_ERROR = Threshold(
    0.8, 'of the squared error', 'limit for accepting a lag, which blurs and may replace effects')
LONGEST_LAG = Threshold(
    0.15, 's', 'longer than that of any drive with a current controller')
ENCODER_STEPS = Threshold(
    2.0, 'times the acceleration', 'that steps of the encoder may make of it: a wider bandwidth '
    'shows these more than the motion, and what a controller makes of them')
LAG_STEP = Threshold(
    0.01, 's', 'change of the lag, over which intervals take its effect')
LATE_VELOCITY = Threshold(
    2.0, 'samples', 'a velocity that is later than the position is filtered, and not used')
NEAR_LIMIT = Threshold(
    0.05, 's', 'beside samples at a limit of the current, only those with low noise are below it')
SAME_MOTION_ERROR = Threshold(
    1.02, 'times', 'the smallest squared error in motion: below it, starts and stops decide')
# The search.
LEAST_SHARE = Threshold(
    0.02, 'of the squared error', 'smallest gain of an effect; less may only correct another one')
STANDARD_ERRORS = Threshold(
    2.0, 'standard errors', 'smallest gain over held-out blocks')
STAYS = Threshold(
    0.5, 'of both gains', 'is enough for an effect to stay in a fit')
OWN_SHARE = Threshold(
    0.01, 'of its size', 'that no other term repeats: with less, coefficients cancel')
SHORTLIST = Threshold(
    6, 'effects', 'compared by held-out blocks: those that explain most of the fitted ones')
PASSED_AGAIN = Threshold(
    0.5, 'of the motion', 'must be at places that were passed twice: only there can predictions of '
    'what was not fitted be wrong about position')
# Names.
SEARCHES = Threshold(
    40, 'searches', 'on resampled blocks: the standard error of a share of one half is 8 %')
NAMED_SHARE = Threshold(
    0.6, 'of the searches', 'must choose an effect before it is named')
NAMING_ERROR = Threshold(
    1.1, 'times the error', 'that leaving out a weight beside a URDF may cost')
# Reversals.
REVERSALS = Threshold(
    6, 'reversals', 'fewest from which friction at rest is read: three in each direction')
REVERSAL_SAMPLES = Threshold(
    6, 'samples', 'fewest from a turn until friction has changed')
REVERSAL_TIME = Threshold(
    0.05, 's', 'shortest time for this: a delay or filter of the current makes faster ones longer')
REVERSAL_COUNTS = Threshold(
    2, 'steps of position', 'shortest presliding that an encoder resolves')
REVERSAL_SPREAD = Threshold(
    0.4, 'of the distance', 'largest standard deviation of presliding')
BREAKAWAY_SPREAD = Threshold(
    0.1, 'of the level', 'largest standard deviation of breakaway: what a law leaves to the gear')
LONGEST_PRESLIDING = Threshold(
    5e-3, 'rad', 'usual geared joints have 0.1 to 3 mrad: what is longer is a spring or backlash')
# The verdict.
GROWTH = Threshold(
    1.3, 'times', 'the held-out error: limit for thirds that were not fitted')
LEAST_STRENGTH = Threshold(
    0.03, 'of the residual variance', 'weaker dependences on a variable are not reported')
UNEXPLAINED = Threshold(
    0.4, 'of the residual variance',
    'explained by one variable, or of the error of a constant: the model lacks something')
ABOVE_NOISE = Threshold(
    10.0, 'times the noise', 'a larger error is due to something not recorded')
USELESS_ERROR = Threshold(
    0.9, 'of the error of a constant', 'with a larger error elsewhere, a constant predicts as well')
SAME_LOAD = Threshold(
    0.02, 'of -1/(k_t·n)', 'if the load coefficient deviates by more, the torque constant is wrong')
ONE_LOAD = Threshold(
    1.5, 'times', 'the smallest load: what it does cannot be told from offset and friction below')
FEWEST_STEPS = Threshold(
    10, 'positions', 'of the encoder: between fewer, no velocity is known')
IMPOSSIBLE = Threshold(
    2.0, 'times the largest current', 'more Coulomb friction than an effect of temperature, say, '
    'may leave to others: what cancels it is none')
UNCERTAIN = Threshold(
    0.2, 'of a number', 'half an interval that is larger is said in words')
WRITTEN_ERROR = Threshold(
    1.5, 'times', "the fit's error: limit for the model as it is written")
FOLLOWED_VARIANCE = Threshold(
    0.99, 'of the variance', "of a joint's position follows from the others': they move as one")
PUSHING_ERROR = Threshold(
    0.5, 'of the squared error', 'with less if friction may push, the current is a response')
DOES_AS_COMMANDED = Threshold(
    0.95, 'correlation', 'of measured and commanded current: above it no other controller acts')
WARMED_WITH_TIME = Threshold(
    0.95, 'rank correlation', 'of time and temperature: above it they cannot be distinguished')
SPED_WITH_TIME = Threshold(
    0.9, 'rank correlation', 'of time and speed: above it drift may be friction over velocity')
SWEPT = Threshold(
    0.4, 'rank correlation', 'of time and speed or acceleration, beside an effect of time: above '
    'it, as in a sweep of frequency, it may be a dependence on them')
INSEPARABLE = Threshold(
    0.97, 'rank correlation', 'of another variable with the one found: it may be the cause')
CORRELATED = Threshold(
    0.8, 'rank correlation', 'of two coefficients over resampled blocks: the pair is reported')


def table() -> list[tuple[str, float, str, str]]:
    """Return the name, value, unit and reason of each threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
