# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An evaluation in words for readers who do not know compensation laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_comp.reports.html import number

if TYPE_CHECKING:
    from friction_comp.evaluation.conditions import Evaluation
    from friction_comp.evaluation.repetitions import Help


def plain_names(two: tuple[Help, Help]) -> tuple[str, str]:
    """Return what a person without training calls two conditions, at the head of a picture."""
    return ('No help' if two[0].law == 'none' else 'Direction unknown', 'Direction known')


def plain_verdict(evaluation: Evaluation) -> str:
    """Return in one sentence what the person felt; '' where there is nothing to compare."""
    compared, change, two = (evaluation.compared('peak_torque'), evaluation.peak_reduction,
                             evaluation.pair())
    if compared is None or change is None or two is None:
        return ''
    without = 'without help' if two[0].law == 'none' else 'when it does not know it'
    more = 'more than ' if evaluation.stuck(two[0]) else ''
    after = 'more than ' if evaluation.stuck(two[1]) else ''
    least = 'at least ' if evaluation.is_bound else ''
    words = (f'When the robot knows the direction, the person needs {after}'
             f'**{number(compared[1])} N·m** to set the joint in motion, and {more}'
             f'**{number(compared[0])} N·m** {without}: {least}**{abs(100 * change):.0f} % '
             f'{"less" if change >= 0 else "more"}**')
    test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                 and (c.first, c.second) == two), None)
    if test is not None and test.sure:
        return f'{words}.'
    return f'{words}. So few repetitions may be chance; more of them would tell.'


def plain_tiles(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the three numbers that matter: without, with, and starts that nobody wanted."""
    compared, two = evaluation.compared('peak_torque'), evaluation.pair()
    if compared is None or two is None:
        return []
    first, second = (
        f'{"> " if evaluation.stuck(known) else ""}{number(value)}\u00a0N·m'
        for value, known in zip(compared, two))
    starts = sum(c.false_starts for c in evaluation.conditions)
    return [(first, 'to set the joint in motion ' + (
        'without help' if two[0].law == 'none' else 'when the direction is not known')),
        (second, 'to set it in motion when the robot knows the direction'),
        (str(starts), 'times the joint started by itself')]
