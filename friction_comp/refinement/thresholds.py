# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Every threshold of refinement in one table: its value, its unit, and why it is what it is.

Most were set on simulated drives. Some were chosen with measured drives in view, so that these are
no independent check of them: the share that tells a controller (a BLDC under speed control), the
share that a lag must take (UR10e joint 2, EMPS), and how broad a transition may be (UR10e joint 1).
"""

from __future__ import annotations


class Threshold(float):
    """A number with a unit and a reason.

    Parameters
    ----------
    value : float
    unit : str
        Empty for a share or a count.
    reason : str
    """

    unit: str
    reason: str

    def __new__(cls, value: float, unit: str, reason: str) -> Threshold:
        """Make a number that knows what it is."""
        made = super().__new__(cls, value)
        made.unit, made.reason = unit, reason
        return made


# What an effect has to show before it is named.
ALPHA = Threshold(0.01, '', 'chance of any wrong effect in a step, over all candidates together')
EXPECTED = Threshold(
    0.1, '', 'chance that what every drive has is allowed: that it is there is no question, only '
    'whether this recording tells how large; it has to carry over like everything else')
LEAST_SHARE = Threshold(
    0.04, 'of the held-out loss', 'an effect that lowers the error by less than a fiftieth may be '
    'a base that is not quite of the right shape')
LEAST_SIZE = Threshold(
    0.003, 'of the signal', 'no drive is known as well as that')
MOST_EFFECTS = Threshold(10, 'effects', 'more than any drive was seen to need')
ADJUSTED = Threshold(3, 'candidates', 'the best few have all constants adjusted together')
PAIR_ROUNDS = Threshold(3, 'steps', 'pairs are looked for while few effects were found singly')
REVISIONS = Threshold(3, 'rounds', 'exchange and deletion settle in one or two')
EXCHANGE = Threshold(
    0.8, 'of the gain', 'what explains clearly less where it is fitted cannot take the place')

PARTS = Threshold(
    12, 'parts', 'long enough to differ, many enough to be counted')
CARRY_OVER = Threshold(
    0.1, 'over the number of effects', 'chance that an effect helps in as many parts that it was '
    'not fitted to without being there')

IN_DOUBT = Threshold(
    0.3, 'of the loss', 'what explains more than this cannot be made up for by other constants')

SAME_LAG = Threshold(
    1.5, 'times', 'a lag of the drive does not change with how velocity is had of position')

# Physics.
LARGEST = Threshold(
    3.0, 'times the largest current', 'an effect larger than this cancels another one of its size')
PASSIVE = Threshold(
    0.02, 'of the largest friction', 'noise of an average over a range of speeds')
SPEED_RANGES = Threshold(8, 'ranges', 'enough to see where along the speeds friction would push')

# What stays without a name.
CLEARLY_ABOVE_NOISE = Threshold(
    1.5, 'times the noise', 'a residual of this size holds something that is no noise')
FAR = Threshold(15.0, 'standard deviations', 'larger errors count as if they were of this size')
LEAST_LOUD = Threshold(0.15, 'of the noise', 'what stays below is not worth a word')
LARGE = Threshold(
    0.2, 'of the remaining variance', 'a dependence this strong may bend what else is fitted')
STAND_IN = Threshold(
    0.25, 'of the loss', 'while something large has no name, an effect that lowers the loss by '
    'less is likely a stand-in')
PRODUCT = Threshold(
    0.9, 'of the loss', 'a product of variables has to do clearly better than effects with names')
PRODUCT_ROUNDS = Threshold(3, 'steps', 'what is largest shows early')
ASYMMETRY = Threshold(
    0.1, 'of Coulomb friction', 'plateaus of Eq. 6 that differ by less are drawn as they are')

# Splitting.
RUN_GAP = Threshold(
    0.5, 's', 'two stretches this far apart are runs of their own, in one file or in two')
RUN_STEPS = Threshold(20.0, 'sample times', 'a gap of fewer is a message or two lost')

# Saturation.
FEWEST_AT_END = Threshold(
    0.01, 'of the samples', 'a heap at an end of the signal that is worth a word')
ASKS_FOR_MORE = Threshold(
    0.1, 'of that heap', 'where next to none asks for more, nothing is cut off')
FOLLOWS = Threshold(
    0.3, '', 'slope of the current over what the motion asks for, where it is cut off')

# Controller.
CONTROL_LAW = Threshold(
    0.8, 'of the variance', 'current that falls with the speed error as closely as this is a '
    'controller at work; where friction, inertia and load explain it as closely, with the signs of '
    'a drive, it tells of the drive all the same')
CONTROL_DELAY = Threshold(
    6, 'samples', 'a sampled controller answers within a few samples')
CONTROL_WINDOW = Threshold(
    0.2, 's', 'what is slower may be a change of the reference')
FEW_LEVELS = Threshold(50, 'levels', 'a controller asks for a new value every time')
OPEN_LOOP = Threshold(
    0.5, 'of the samples', 'current that does not change while the joint moves')

# Trust.
TRUST_NOISE = Threshold(
    2.0, 'times the noise', 'the model misses half of what could be known')
TRUST_R2 = Threshold(0.8, '', 'less of the current explained is no model of the drive')
TRUST_LEFT = Threshold(
    0.1, 'of the remaining variance', 'a dependence without a name that a reader should know of')
AS_ONE = Threshold(
    0.99, 'of the variance', "of a joint's position that follows from those of other joints: which "
    'of them asks for what is then not told')
ELSEWHERE = Threshold(
    2.0, 'times', 'what other joints ask is told worse in postures that were not fitted than at '
    'times that were not, so that it does not hold beyond the recorded ones; chosen on sixteen '
    'joints of public arms')
AT_ODDS = Threshold(
    0.05, '', 'shares by which position and recorded velocity may disagree')


def table() -> list[tuple[str, float, str, str]]:
    """Return name, value, unit and reason of every threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
