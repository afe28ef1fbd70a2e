# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Describes an evaluation to readers who do not know compensation laws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_comp.reports.html import number

if TYPE_CHECKING:
    from friction_comp.evaluation.conditions import Evaluation
    from friction_comp.evaluation.repetitions import Help


def plain_names(pair: tuple[Help, Help]) -> tuple[str, str]:
    """Return titles of two conditions without technical terms."""
    return ('No help' if pair[0].law == 'none' else 'Direction unknown', 'Direction known')


def plain_verdict(evaluation: Evaluation) -> str:
    """Return the result for the person in a sentence; '' where there is nothing to compare."""
    torques, change, pair = (evaluation.compared('peak_torque'), evaluation.peak_reduction,
                             evaluation.pair())
    if torques is None or change is None or pair is None:
        return ''
    without = 'without help' if pair[0].law == 'none' else 'when it does not know it'
    more = 'more than ' if evaluation.stuck(pair[0]) else ''
    after = 'more than ' if evaluation.stuck(pair[1]) else ''
    least = 'at least ' if evaluation.is_bound else ''
    words = (f'When the robot knows the direction, the person needs {after}'
             f'**{number(torques[1])} N·m** to set the joint in motion, and {more}'
             f'**{number(torques[0])} N·m** {without}: {least}**{abs(100 * change):.0f} % '
             f'{"less" if change >= 0 else "more"}**')
    test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                 and (c.first, c.second) == pair), None)
    if test is not None and test.significant:
        return f'{words}.'
    return f'{words}. With so few repetitions this may be chance; record more to be sure.'


def plain_tiles(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the torque without and with help and the number of false starts."""
    torques, pair = evaluation.compared('peak_torque'), evaluation.pair()
    if torques is None or pair is None:
        return []
    first, second = (
        f'{"> " if evaluation.stuck(condition) else ""}{number(value)}\u00a0N·m'
        for value, condition in zip(torques, pair))
    starts = sum(c.false_starts for c in evaluation.conditions)
    return [(first, 'to set the joint in motion ' + (
        'without help' if pair[0].law == 'none' else 'when the direction is not known')),
        (second, 'to set it in motion when the robot knows the direction'),
        (str(starts), 'times the joint started by itself')]
