# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An evaluation in words, for the terminal and for pages: the same in both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import math
from typing import NamedTuple

from friction_comp.evaluation.compare import Comparison, Interval
from friction_comp.evaluation.conditions import Condition, Evaluation
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.number_text import number


class Peaks(NamedTuple):
    """The two compared conditions, their peak torques and the change as text, and the test."""

    pair: tuple[Compensation, Compensation]
    torques: tuple[str, str]  # N·m
    change: str
    difference: float  # second less first, N·m
    test: Comparison | None

    @property
    def are_told_apart(self) -> bool:
        """Whether the difference is significant, and of the size that was tested."""
        test = self.test
        half = test.without_drift.half if test else None
        return (test is not None and test.significant and half is not None
                and abs(self.difference - test.without_drift.mean) <= half)


def peaks_of(evaluation: Evaluation) -> Peaks | None:
    """Return the peak torques that are reported first; None where there is nothing to compare."""
    torques, change = evaluation.compared('peak_torque'), evaluation.reduction('peak_torque')
    pair = evaluation.pair()
    if torques is None or change is None or pair is None:
        return None
    test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                 and (c.first, c.second) == pair), None)
    stuck = [bool(evaluation.stuck(condition)) for condition in pair]
    before, after = map(peak_text, torques, stuck)
    return Peaks(pair, (before, after), _change(change, *stuck), torques[1] - torques[0], test)


def _change(change: float, first_is_bound: bool, second_is_bound: bool) -> str:
    """Return by how much less the second torque is, each of which may be a lower bound."""
    words = f'**{abs(100 * change):.0f} % {"less" if change >= 0 else "more"}**'
    if first_is_bound and second_is_bound:
        return f'{words}, of torques that did not always suffice'
    if first_is_bound or second_is_bound:
        return f'at {"least" if first_is_bound == (change >= 0) else "most"} {words}'
    return words


def verdict(evaluation: Evaluation) -> str:
    """Return what the direction is worth, how sure that is, and what to do about it."""
    peaks = peaks_of(evaluation)
    if peaks is None:
        return _nothing_to_compare(evaluation)
    before, after = (f'{"more than " * text.startswith("> ")}**{text.lstrip("> ")} N·m**'
                     for text in peaks.torques)
    first, second = peaks.pair
    without, laws = 'without help', ('', '')
    if first.law != 'none':
        without = 'when it does not'
        # Laws and models only where they differ, too.
        if replace(first, announced=1) != second:
            plain, helped = (f' ({" · ".join(evaluation.names_of(one)[1:]) or "an unknown law"})'
                             for one in peaks.pair)
            laws = plain, helped
    text = (f'When the robot knows the direction{laws[1]}, the person needs {after} to set the '
            f'joint in motion, and {before} {without}{laws[0]}: {peaks.change}.')
    test = peaks.test
    if test is not None and test.untested:
        text += f' Whether this is so is not known: {test.untested}.'
    elif not peaks.are_told_apart:
        text += ' This may be chance, or have come with time; record more to be sure.'
    if test is not None and test.pairs and not test.in_turn:
        text += (' One was recorded after the other: what else changed in between counts, too. '
                 'Record them in turn to be sure.')
    return text


def _nothing_to_compare(evaluation: Evaluation) -> str:
    if evaluation.measured:
        return ('The effect of announcing the direction is unknown: no movement was recorded both '
                'with it (d = ±1) and without (d = 0, or no compensation).')
    unused = list(dict.fromkeys(note for note in evaluation.notes
                                if 'interaction_wrench' in note and note.endswith(': not used')))
    known = ('**The back-driving torque is not known.** ' + '; '.join(unused) + '.' if unused
             else '**The back-driving torque was not measured.**')
    return (f'{known} Position, current and reference show when the joint started, but not how '
            'much torque the person needed.')


def remarks(evaluation: Evaluation) -> list[str]:
    """Return sentences on movements that failed and false starts."""
    sentences = []
    for condition in dict.fromkeys(c.compensation for c in evaluation.conditions):
        if stuck := evaluation.stuck(condition):
            count = sum(r.compensation == condition for r in evaluation.repetitions)
            sentences.append(f'With {evaluation.label(condition)} the joint did not move in '
                             f'{stuck} of {count} movements.')
    if starts := sum(c.false_starts for c in evaluation.conditions):
        sentences.append(
            f'**In {starts} repetitions the joint started by itself.** Lower `breakaway_gain` or '
            'identify again.' if evaluation.measured
            else f'In {starts} repetitions the joint started early, by itself or pushed.')
    if against := sum(c.repetitions for c in evaluation.conditions
                      if c.compensation.announced < 0):
        sentences.append(f'{against} movements went against the announced direction; they are '
                         'listed separately.')
    return sentences


# Measures of a condition in the order of a table's columns, with short titles.
COLUMNS = {'peak_torque': 'peak (N·m)', 'rms_torque': 'RMS (N·m)', 'onset': 'delay (s)',
           'residual_current': 'current missing (A)'}


def condition_rows(evaluation: Evaluation, names: Sequence[str]) -> Iterator[list[str]]:
    """Yield condition, movement, number of repetitions, and the named measures with intervals."""
    for one in evaluation.conditions:
        yield [evaluation.label(one.compensation), '+' if one.movement == 'positive' else '−',
               str(one.repetitions), *(measure_text(one, name) for name in names)]


def known_columns(evaluation: Evaluation, most: int) -> list[str]:
    """Return the first measures of `COLUMNS` that are known of a condition."""
    return [name for name in COLUMNS if any(name in c.figures for c in evaluation.conditions)
            ][:most]


def terminal_lines(evaluation: Evaluation) -> list[str]:
    """Return what `evaluate` prints of a joint: a table, the verdict, and remarks."""
    names = known_columns(evaluation, 3)
    rows = [['condition', 'move', 'n', *(COLUMNS[name] for name in names)],
            *condition_rows(evaluation, names)]
    widths = [max(map(len, column)) for column in zip(*rows)]
    table = ['  '.join(f'{text:<{width}}' for text, width in zip(row, widths)).rstrip()
             for row in rows]
    said = [verdict(evaluation), *remarks(evaluation)]
    return [*table, '', *(line.replace('**', '').replace('`', '') for line in said)]


def measure_text(condition: Condition, name: str) -> str:
    """Return a measure of a condition with its interval, or a bound where the joint was stuck."""
    text = with_interval(condition.figures.get(name))
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def peak_text(torque: float, stuck: int | bool) -> str:
    """Return a peak torque in N·m as text, as a bound where the joint was stuck."""
    return f'{"> " if stuck else ""}{number(torque)}'


def heading(name: str) -> str:
    """Return the title and unit of a measure, one of the keys of `FIGURES`."""
    title, unit = FIGURES[name]
    return f'{title} ({unit})' if unit else title


def with_interval(found: Interval | None) -> str:
    """Return a mean ± half its interval, with as many digits as are significant."""
    if found is None:
        return '–'
    half = found.half
    if half is None:
        return number(found.mean)
    size = max(abs(found.mean), half)
    if not size:
        return '0'
    # As many decimals as the interval justifies, but no more than four digits in total.
    most = 3 - math.floor(math.log10(size))
    wanted = 1 - math.floor(math.log10(half)) if half > 0 else most
    places = max(min(wanted, most), 0)
    mean = f'{found.mean:.{places}f}'.replace('-', '\u2212')
    half_text = f'{half:.{places}f}' if half == 0 or half >= 0.5 * 10.0 ** -places else (
        f'<\u202f{10.0 ** -places:.{places}f}')
    # No line break between a number and its interval.
    return f'{mean}\u00a0±\u00a0{half_text}'


def p_value_text(p_value: float | None) -> str:
    """Return a p-value as text, a dash where there is none."""
    if p_value is None:
        return '–'
    return ('p < 0.001' if p_value < 0.001 else f'p = {p_value:.2g}').replace(' ', '\u00a0')
