# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Describes an evaluation in sentences, in plain language and in technical terms."""

from __future__ import annotations

from dataclasses import replace
import math
from typing import NamedTuple

from friction_comp.evaluation.compare import Comparison, Interval
from friction_comp.evaluation.conditions import Condition, Evaluation
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.number_text import number


class _Peaks(NamedTuple):
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

    @property
    def order(self) -> str:
        """What the order of the repetitions leaves open."""
        return '' if self.test is None or self.test.in_turn or not self.test.pairs else (
            ' One was recorded after the other: what else changed in between counts, too. '
            'Record them in turn to be sure.')

    @property
    def in_words(self) -> list[str]:
        return [f'**{torque} N·m**'.replace('**> ', 'more than **') for torque in self.torques]


def _peaks(evaluation: Evaluation) -> _Peaks | None:
    torques, change = evaluation.compared('peak_torque'), evaluation.reduction('peak_torque')
    pair = evaluation.pair()
    if torques is None or change is None or pair is None:
        return None
    test = next((c for c in evaluation.comparisons if c.figure == 'peak_torque'
                 and (c.first, c.second) == pair), None)
    before, after = (peak_text(torque, evaluation.stuck(condition))
                     for torque, condition in zip(torques, pair))
    return _Peaks(pair, (before, after), _change_in_words(change, *(
        bool(evaluation.stuck(condition)) for condition in pair)), torques[1] - torques[0], test)


def _change_in_words(change: float, first_is_bound: bool, second_is_bound: bool) -> str:
    """Return by how much less the second torque is, each of which may be a lower bound."""
    words = f'**{abs(100 * change):.0f} % {"less" if change >= 0 else "more"}**'
    if first_is_bound and second_is_bound:
        return f'{words}, of torques that did not always suffice'
    if first_is_bound or second_is_bound:
        return f'at {"least" if first_is_bound == (change >= 0) else "most"} {words}'
    return words


def compared_peaks(evaluation: Evaluation) -> tuple[str, str] | None:
    """Return the peak torques without and with the announced direction as text, N·m."""
    peaks = _peaks(evaluation)
    return peaks and peaks.torques


def plain_names(pair: tuple[Compensation, Compensation]) -> tuple[str, str]:
    """Return titles of the two compared conditions without technical terms."""
    return ('No help' if pair[0].law == 'none' else 'Direction unknown', 'Direction known')


def plain_verdict(evaluation: Evaluation) -> str:
    """Return the result in plain language; '' where there is nothing to compare."""
    peaks = _peaks(evaluation)
    if peaks is None:
        return ''
    without = 'without help' if peaks.pair[0].law == 'none' else 'when it does not'
    before, after = peaks.in_words
    chance = '' if peaks.are_told_apart else (
        f' Whether this is so is not known: {peaks.test.untested}.'
        if peaks.test is not None and peaks.test.untested else
        ' This may be chance, or have come with time; record more to be sure.')
    return (f'When the robot knows the direction, the person needs {after} to set the joint '
            f'in motion, and {before} {without}: {peaks.change}.{chance}{peaks.order}')


def plain_tiles(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the torque without and with help and the number of false starts."""
    peaks = _peaks(evaluation)
    if peaks is None:
        return []
    starts = sum(c.false_starts for c in evaluation.conditions)
    return [(f'{peaks.torques[0]} N·m', 'to set the joint in motion ' + (
        'without help' if peaks.pair[0].law == 'none' else 'when the direction is not known')),
        (f'{peaks.torques[1]} N·m', 'to set it in motion when the robot knows the direction'),
        (str(starts), 'times the joint started by itself')]


def summary(evaluation: Evaluation) -> str:
    """Return a summary of the trials in technical terms, the verdict first."""
    return f'{verdict(evaluation)} {remarks(evaluation)}'


def remarks(evaluation: Evaluation) -> str:
    """Return sentences on movements that failed and false starts."""
    sentences = []
    for condition in dict.fromkeys(c.compensation for c in evaluation.conditions):
        if stuck := evaluation.stuck(condition):
            count = sum(r.compensation == condition for r in evaluation.repetitions)
            sentences.append(f'With {evaluation.label(condition)} the joint did not move in '
                             f'{stuck} of {count} movements.')
    starts = sum(c.false_starts for c in evaluation.conditions)
    sentences.append(
        'The joint never started by itself.' if not starts else
        f'**In {starts} repetitions the joint started by itself.** Lower '
        '`breakaway_gain` or identify again.' if evaluation.measured
        else f'In {starts} repetitions the joint started early, by itself or pushed.')
    against = sum(c.repetitions for c in evaluation.conditions if c.compensation.announced < 0)
    if against:
        sentences.append(f'{against} movements went against the announced direction; they are '
                         'listed separately.')
    return ' '.join(sentences)


def verdict(evaluation: Evaluation) -> str:
    """Return the effect of announcing the direction, in technical terms."""
    peaks = _peaks(evaluation)
    if peaks is None:
        if not evaluation.measured:
            unused = list(dict.fromkeys(
                note for note in evaluation.notes
                if 'interaction_wrench' in note and note.endswith(': not used')))
            return (('**The back-driving torque is not known.** ' + '; '.join(unused) + '. '
                     if unused else '**The back-driving torque was not measured.** ')
                    + 'Position, current and reference show when the joint started, but not how '
                    'much torque the person needed.')
        return ('The effect of announcing the direction is unknown: no movement was recorded both '
                'with it (d = ±1) and without (d = 0, or no compensation). All comparisons are '
                'below.')
    (first, second), (before, after) = peaks.pair, peaks.in_words
    plain, assisted = 'without (d = 0)', 'the direction announced (d = ±1)'
    if replace(first, announced=1) != second:
        plain_label, label = (' · '.join(evaluation.names_of(condition)[1:])
                              or 'a law that was not recorded' for condition in peaks.pair)
        plain, assisted = f'with {plain_label}', f'the direction announced (d = ±1, {label})'
    text = (f'With {assisted} it took {after} to set the joint in motion instead of '
            f'{before} {plain}: {peaks.change}')
    return f'{text}{_certainty(peaks)}.{peaks.order}'


def _certainty(peaks: _Peaks) -> str:
    test = peaks.test
    if test is None or test.p_value is None:
        return f', which was not tested: {test.untested}' if test else ', which was not tested'
    p_value = p_value_text(test.p_value)
    if peaks.are_told_apart:
        return f', a significant difference ({p_value}, {test.pairs} pairs)'
    difference = test.without_drift
    if difference.half is not None and abs(difference.mean) > difference.half:
        return (f'; beside a steady change over the session, the difference is '
                f'{with_interval(difference)} N·m, among all comparisons with {p_value} '
                f'({test.pairs} pairs)')
    return f', which may be chance ({p_value}, {test.pairs} pairs)'


def condition_line(condition: Condition) -> str:
    """Return one condition as a line for the terminal."""
    figures = [f'{FIGURES[name][0]} {figure_text(condition, name)} {FIGURES[name][1]}'.strip()
               for name in ('peak_torque', 'rms_torque', 'residual_current', 'onset')
               if name in condition.figures]
    count = f'{condition.repetitions} repetition{"s" if condition.repetitions > 1 else ""}'
    if condition.stuck:
        count += f', in {condition.stuck} the joint did not move'
    return (f'{condition.compensation.label}, {condition.movement} movement ({count}): '
            f'{", ".join(figures)}')


def figure_text(condition: Condition, name: str) -> str:
    """Return a measure of a condition with its interval, or a bound where the joint was stuck."""
    text = with_interval(condition.figures.get(name))
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def peak_text(torque: float, stuck: int) -> str:
    """Return a peak torque in N·m as text, as a bound where the joint was stuck."""
    return f'{"> " if stuck else ""}{number(torque)}'


def heading(name: str) -> str:
    """Return the title and unit of a measure, one of the keys of `FIGURES`."""
    title, unit = FIGURES[name]
    return f'{title} ({unit})' if unit else title


def with_interval(value: Interval | None) -> str:
    """Return a mean ± half its interval, with as many digits as are significant."""
    if value is None:
        return '–'
    half = value.half
    if half is None:
        return number(value.mean)
    size = max(abs(value.mean), half)
    if not size:
        return '0'
    # As many decimals as the interval justifies, but no more than four digits in total.
    most = 3 - math.floor(math.log10(size))
    wanted = 1 - math.floor(math.log10(half)) if half > 0 else most
    places = max(min(wanted, most), 0)
    mean = f'{value.mean:.{places}f}'.replace('-', '\u2212')
    half_text = f'{half:.{places}f}' if half == 0 or half >= 0.5 * 10.0 ** -places else (
        f'<\u202f{10.0 ** -places:.{places}f}')
    # No line break between a number and its interval.
    return f'{mean}\u00a0±\u00a0{half_text}'


def p_value_text(p_value: float | None) -> str:
    """Return a p-value as text, a dash where there is none."""
    if p_value is None:
        return '–'
    return ('p < 0.001' if p_value < 0.001 else f'p = {p_value:.2g}').replace(' ', '\u00a0')


def nonbreaking_label(evaluation: Evaluation, condition: Compensation) -> str:
    """Return a condition's label with line breaks allowed only before the model."""
    names = [name.replace(' ', '\u00a0') for name in evaluation.names_of(condition)]
    return ' '.join(['\u00a0·\u00a0'.join(names[:2]), *names[2:]])
