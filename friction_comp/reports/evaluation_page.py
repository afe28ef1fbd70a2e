# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What an evaluation says, on the terminal and on its page: verdict, movements, tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
import math
from typing import NamedTuple

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.conditions import Comparison, Condition, Evaluation, FEWEST, Interval
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.number_text import aligned, number
from friction_comp.reports.figures import (
    band,
    COLOURS,
    curve,
    INK,
    legend,
    panels,
    shade_waiting,
    styled,
    zero,
)
from friction_comp.reports.html import Report, value, without_marks

_MOST_RECORDINGS = 12
_SIGNS = {'positive': '+', 'negative': '−'}
# Measures of a condition in the order of a table's columns, with short titles.
_COLUMNS = {'peak_torque': 'peak (N·m)', 'rms_torque': 'RMS (N·m)', 'onset': 'delay (s)',
            'residual_current': 'current missing (A)'}


class Peaks(NamedTuple):
    """The peak torques of the two compared conditions, and their difference as text."""

    pair: tuple[Compensation, Compensation]
    torques: tuple[str, str]  # with unit and name, for a page
    are_bounds: tuple[bool, bool]
    change: str
    difference: float  # second less first, N·m
    test: Comparison

    @property
    def are_told_apart(self) -> bool:
        """Whether the difference is significant, and of the size that was tested."""
        half = self.test.without_drift.half
        return (self.test.significant and half is not None
                and abs(self.difference - self.test.without_drift.mean) <= half)

    def texts(self) -> list[str]:
        """Return the torques as text, each as a bound where the joint was stuck."""
        return ['> ' * bound + text for text, bound in zip(self.torques, self.are_bounds)]


def peaks_of(evaluation: Evaluation) -> Peaks | None:
    """Return the peak torques that are reported first; None where there is nothing to compare."""
    test, change = evaluation.comparison('peak_torque'), evaluation.reduction('peak_torque')
    if test is None or change is None:
        return None
    pair, torques = (test.first, test.second), (test.mean_first, test.mean_second)
    first, second = (bool(evaluation.stuck(condition)) for condition in pair)
    shown = tuple(value(f'peak of {evaluation.joint}: {evaluation.label(condition)}',
                        f'{number(torque)} N·m') for condition, torque in zip(pair, torques))
    text = f'**{abs(100 * change):.0f} % {"less" if change >= 0 else "more"}**'
    if first and second:
        text += ', of torques that did not always suffice'
    elif first or second:
        text = f'at {"least" if first == (change >= 0) else "most"} {text}'
    return Peaks(pair, (shown[0], shown[1]), (first, second), text, test.difference, test)


def verdict(evaluation: Evaluation) -> str:
    """Return what the direction is worth, how sure that is, and what to do about it."""
    peaks = peaks_of(evaluation)
    if peaks is None:
        return _nothing_to_compare(evaluation)
    before, after = ('more than ' * bound + f'**{text}**'
                     for text, bound in zip(peaks.torques, peaks.are_bounds))
    first, second = peaks.pair
    without, laws = 'without help', ('', '')
    if first.law != 'none':
        without = 'else'
        # Laws and models only where they differ, too.
        if replace(first, announced=1) != second:
            plain, helped = (f' ({" · ".join(evaluation.names_of(one)[1:]) or "an unknown law"})'
                             for one in peaks.pair)
            laws = plain, helped
    test = peaks.test
    untested = test.untested
    # Of what is not judged is said what was, not what is.
    text = (f'When the robot {"knew" if untested else "knows"} the direction{laws[1]}, the person '
            f'{"needed" if untested else "needs"} {after} to set the joint in motion, and {before} '
            f'{without}{laws[0]}: {peaks.change}.')
    if untested:
        text += f' That is not judged: {untested}.'
    elif not peaks.are_told_apart:
        text += ' This may be chance, or have come with time; record more to be sure.'
    if test.pairs and not test.in_turn:
        text += (' One was recorded after the other: what else changed in between counts, too. '
                 'Record them in turn to be sure.')
    return text


def _nothing_to_compare(evaluation: Evaluation) -> str:
    if evaluation.measured:
        return ('The effect of announcing the direction is unknown: no movement was recorded both '
                'with it (d = ±1) and without (d = 0, or no compensation) under the same law.')
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
    return sentences


def condition_rows(evaluation: Evaluation, names: Sequence[str]) -> Iterator[list[str]]:
    """Yield condition, movement, number of repetitions, and the named measures with intervals."""
    for one in evaluation.conditions:
        yield [evaluation.label(one.compensation), _SIGNS[one.movement], str(one.repetitions),
               *(measure_text(one, name) for name in names)]


def _known_columns(evaluation: Evaluation) -> list[str]:
    return [name for name in _COLUMNS if any(name in c.figures for c in evaluation.conditions)]


def terminal_lines(evaluation: Evaluation) -> list[str]:
    """Return what `evaluate` prints of a joint: a table, the verdict, and remarks."""
    names = _known_columns(evaluation)[:3]
    rows = [['condition', 'move', 'n', *(_COLUMNS[name] for name in names)],
            *condition_rows(evaluation, names)]
    return [*aligned(rows), '', *map(without_marks, [verdict(evaluation), *remarks(evaluation)])]


def measure_text(condition: Condition, name: str) -> str:
    """Return a measure of a condition with its interval, or a bound where the joint was stuck."""
    text = with_interval(condition.figures.get(name))
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def with_interval(found: Interval | None) -> str:
    """Return a mean ± half its interval, with as many digits as are significant."""
    if found is None:
        return '–'
    if found.half is None:
        return number(found.mean)
    # As many decimals as the interval justifies, but no more than four.
    places = 4 if found.half <= 0.0 else min(max(1 - math.floor(math.log10(found.half)), 0), 4)
    # No line break between a number and its interval.
    return f'{found.mean:.{places}f}\u00a0±\u00a0{found.half:.{places}f}'.replace('-', '\u2212')


def evaluation_page(evaluations: Sequence[Evaluation], title: str = '') -> Report:
    """Return the page of `evaluate`, with one evaluation for each joint."""
    joints = ', '.join(evaluation.joint or 'the joint' for evaluation in evaluations)
    count = sum(len(evaluation.repetitions) for evaluation in evaluations)
    torque = any(evaluation.measured for evaluation in evaluations)
    recordings = list(dict.fromkeys(
        r.recording for evaluation in evaluations for r in evaluation.repetitions))
    page = Report(
        title or f'{"Back-driving torque" if torque else "Movements"} of {joints}',
        f'{count} movements from {len(recordings)} recording{"s" if len(recordings) > 1 else ""}')
    several = len(evaluations) > 1
    page.verdict('\n\n'.join((f'**{one.joint}.** ' if several else '') + verdict(one)
                             for one in evaluations))
    for evaluation in evaluations:
        if several:
            page.heading(f'Joint {evaluation.joint}')
        _add(page, evaluation)
    page.heading('Sources')
    listed = [f'recording `{name}`' for name in recordings[:_MOST_RECORDINGS]]
    if len(recordings) > _MOST_RECORDINGS:
        listed.append(f'{len(recordings) - _MOST_RECORDINGS} more, in `repetitions.csv`')
    listed += dict.fromkeys(f'model files that were active: `{evaluation.model}`'
                            for evaluation in evaluations if evaluation.model)
    page.bullets([*listed, *dict.fromkeys(
        note for evaluation in evaluations for note in evaluation.notes)])
    return page


def _add(page: Report, evaluation: Evaluation) -> None:
    peaks = peaks_of(evaluation)
    page.bullets(remarks(evaluation))
    if evaluation.measured:
        page.figure(_repetitions_figure(evaluation), 'Peak torque of each movement, in the order '
                    'in which they were recorded; filled in the positive, open in the negative '
                    'direction.')
    spread = '; bands: standard deviation over the repetitions' if any(
        c.repetitions >= FEWEST for c in evaluation.conditions) else ''
    page.figure(
        curves_figure(evaluation),
        f"Mean movement, from its begin (style of the note's Fig. 5){spread}." + (
            ' Shaded: the person waits at the target of the movement before, which is not counted.'
            if evaluation.measured else ''))
    names = _known_columns(evaluation)
    page.table(
        ['condition', 'move', 'n', *(_COLUMNS[name] for name in names), 'false starts'],
        [[*row, str(one.false_starts)] for row, one in zip(
            condition_rows(evaluation, names), evaluation.conditions)],
        'Mean over the repetitions' + (' ± half its 95 % interval' if spread else '')
        + ', for movements in the positive (+) and negative (−) direction. The peak is from the '
        'begin of the movement until it slows down, or until the joint moves; delay: until the '
        'joint moves; > where it did not always move.')
    if evaluation.comparisons:
        page.heading('Comparisons', 3)
        _add_comparisons(page, evaluation, peaks)


def _add_comparisons(page: Report, evaluation: Evaluation, peaks: Peaks | None) -> None:
    """Add a table for each pair of conditions."""
    shown = sorted(evaluation.comparisons, key=lambda c: list(FIGURES).index(c.figure))
    for first, second in list(dict.fromkeys((c.first, c.second) for c in shown))[:6]:
        own = [c for c in shown if (c.first, c.second) == (first, second)]
        tested = any(c.p_value is not None for c in own)
        rows = []
        for c in own:
            name, unit = FIGURES[c.figure]
            means = peaks.texts() if peaks and c is peaks.test else [
                '> ' * (c.figure == 'peak_torque' and evaluation.stuck(condition) > 0)
                + f'{number(mean)} {unit}' for mean, condition in (
                    (c.mean_first, first), (c.mean_second, second))]
            rows.append([name, *means,
                         f'{number(c.difference)} {unit}', *([
                             with_interval(c.without_drift), '\u2013' if c.p_value is None else
                             '< 0.001' if c.p_value < 0.001 else f'{c.p_value:.2g}'] * tested)])
        page.table(['', evaluation.label(first), evaluation.label(second), 'difference',
                    *['without drift', 'p'] * tested], rows,
                   'Movements of the same day and direction.' + (
                       ' Without drift: the difference that is left beside a steady change over '
                       "the session, with its 95 % interval; p is of Student's t, with Holm's "
                       'correction for all comparisons of a measure.') * tested)
    page.bullets(dict.fromkeys(f'Not tested: {c.untested}.' for c in shown if c.untested))


def _colours(evaluation: Evaluation) -> dict[Compensation, str]:
    """Return a colour for each condition: by what is known of the direction, then others."""
    colours: dict[Compensation, str] = {}
    for condition in dict.fromkeys(c.compensation for c in evaluation.conditions):
        first = ('no help' if condition.law == 'none' else
                 'known' if condition.uses_direction and condition.announced > 0 else
                 'out' if condition.announced < 0 else 'unknown')
        free = [name for name in (first, 'other', 'refined') if name not in colours.values()]
        colours[condition] = free[0] if free else 'faint'
    return colours


@styled
def _repetitions_figure(evaluation: Evaluation) -> Figure:
    """Draw the peak torque of each movement, in order of time."""
    ordered = sorted((r for r in evaluation.repetitions if 'peak_torque' in r.figures),
                     key=lambda r: r.place)
    colours = _colours(evaluation)
    figure, (axes,) = panels(['peak torque (N·m)'], 'movement', 1.8,
                             legend_rows=-(-len(colours) // 2))
    for condition, colour in colours.items():
        label = evaluation.label(condition)
        for sign, fill in ((1, COLOURS[colour]), (-1, 'none')):
            own = [(k + 1, r.figures['peak_torque']) for k, r in enumerate(ordered)
                   if r.compensation == condition and r.movement.sign == sign]
            if own:
                x, y = zip(*own)
                curve(axes, x, y, colour, label, 'o', markersize=5.5, markerfacecolor=fill)
                label = ''
    axes.set_ylim(bottom=0.0)
    legend(axes, 2)
    return figure


@styled
def curves_figure(evaluation: Evaluation) -> Figure:
    """Draw joint angles and torques over time, movements in the positive direction first."""
    movements = [name for name in _SIGNS if any(
        c.movement == name for c in evaluation.conditions)]
    labels = [label for name in movements for label in (
        f'angle {_SIGNS[name]} (deg)',
        *(['torque (N·m)'] if evaluation.measured else []))]
    colours, each = _colours(evaluation), len(labels) // len(movements)
    figure, axes = panels(
        labels, 'time since the movement began (s)', [1.3, 1.8] * len(movements)
        if evaluation.measured else 1.6, legend_rows=1 + len(colours) // 2)
    for k, movement in enumerate(movements):
        conditions = [c for c in evaluation.conditions if c.movement == movement]
        angle = axes[each * k]
        for shown in [c for c in conditions if c.reference is not None][:1]:
            angle.plot(shown.time, np.degrees(np.asarray(shown.reference)), '--', color=INK,
                       linewidth=1.0, label='shown to the person')
        for c in conditions:
            enough = float(c.repetitions >= FEWEST)
            colour, label = colours[c.compensation], evaluation.label(c.compensation)
            band(angle, c.time, np.degrees(c.position), enough * np.degrees(c.position_std),
                 colour, label)
            if evaluation.measured:
                torque = axes[each * k + 1]
                band(torque, c.time, c.torque, enough * c.torque_std, colour, label)
        if evaluation.measured:
            zero(axes[each * k + 1])
            shade_waiting(axes[each * k + 1], min(float(c.time[0]) for c in conditions))
    legend(axes[0], 2)
    return figure
