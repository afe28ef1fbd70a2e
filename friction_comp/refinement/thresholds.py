# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Every threshold of refinement in one table: value, unit and reason."""

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
        """Make a number with a unit and a reason."""
        made = super().__new__(cls, value)
        made.unit, made.reason = unit, reason
        return made


FEWEST = Threshold(200, 'samples', 'fewer in motion tell Coulomb from viscous friction and little '
                   'else')
ROWS = Threshold(16000, 'rows', 'averages of so many are searched; at 100 Hz or more')
BLOCKS = Threshold(16, 'blocks', 'long enough to differ, many enough to be counted')
SAME = Threshold(0.005, 'of the error', 'settings whose errors differ by less are as good as each '
                 'other: the wider bandwidth and the sharper transition are taken')
LEAST_SHARE = Threshold(0.02, 'of the squared error', 'an effect that takes away less may be a '
                        'base that is not quite of the right shape')
STANDARD_ERRORS = Threshold(2.0, 'standard errors', 'of the gain over blocks that were not fitted')
OWN = Threshold(0.01, 'of its size', 'that no other term repeats: with less, coefficients cancel')
MOST_EFFECTS = Threshold(14, 'effects', 'more than any drive was seen to need')
SEARCHES = Threshold(40, 'searches', 'on blocks drawn anew: a share of one half is known to 8 %')
NAMED = Threshold(0.6, 'of the searches', 'choose an effect before it is named')
LAG = Threshold(0.8, 'of the squared error', 'a lag has to leave less: it blurs, as the '
                'differentiation of positions does, so that it may stand in for other effects')
GROWS = Threshold(1.3, 'times', 'as large errors in thirds that were not fitted, and the '
                  'recording alone bears the model there')
UNEXPLAINED = Threshold(0.4, 'of the residual variance', 'that depends on one variable: '
                        'something is missing from the model')
EXPLAINS = Threshold(0.4, 'of the current', 'that is left in motion: something decides on the '
                     'current that was not recorded')
EXPLAINS_NOTHING = Threshold(0.9, 'of the current', 'to be expected as error elsewhere: zero '
                             'would be about as good')
SAME_LOAD = Threshold(0.02, 'of the coefficient', 'of the load by which it may differ from '
                      '-1/(k_t·n) before the torque constant is called wrong')
FOLLOWS = Threshold(0.99, 'of the variance', "of a joint's position that the other joints' "
                    'positions explain: they move as one')
PUSHES = Threshold(0.5, 'of the squared error', 'is left where friction may push: the current is '
                   "no drive's answer to its motion")


def table() -> list[tuple[str, float, str, str]]:
    """Return name, value, unit and reason of every threshold."""
    return [(name, float(value), value.unit, value.reason)
            for name, value in globals().items() if isinstance(value, Threshold)]
