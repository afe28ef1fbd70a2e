# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What an evaluation says, on the terminal and on its page: verdict, movements, tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.conditions import Comparison, Condition, Evaluation, FEWEST
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.reports.figures import band, INK, legend, panels, shade_waiting, styled, zero
from friction_comp.reports.html import Report, value, without_marks
from friction_comp.terminal import aligned, interval_text, number

_MOST_RECORDINGS = 12
_SIGNS = {'positive': '+', 'negative': '−'}
# Measures of a condition in the order of a table's columns, with short titles.
_COLUMNS = {'peak_torque': 'peak (N·m)', 'rms_torque': 'RMS (N·m)', 'onset': 'delay (s)'}


def verdict(evaluation: Evaluation) -> str:
    """Return what the direction is worth, how sure that is, and what to do about it."""
    test, change = evaluation.comparison('peak_torque'), evaluation.reduction('peak_torque')
    if test is None or change is None:
        return _nothing_to_compare(evaluation)
    before, after = (text.replace('> ', 'more than ') for text in _compared(evaluation, test))
    first, second = (evaluation.stuck(condition) > 0 for condition in (test.first, test.second))
    text = (f'With the direction known ({evaluation.label(test.second)}) the person needed '
            f'**{after}** to set the joint in motion, and **{before}** without '
            f'({evaluation.label(test.first)}): ')
    if first != second:
        text += f'at {"least" if first == (change >= 0.0) else "most"} '
    text += f'**{abs(100 * change):.0f} % {"less" if change >= 0.0 else "more"}**.'
    if first and second:
        text += ' Neither torque always sufficed.'
    if test.untested:
        text += f' That is not judged: {test.untested}.'
    elif not test.significant:
        text += ' This may be chance; record more to be sure.'
    return text


def _compared(evaluation: Evaluation, test: Comparison) -> list[str]:
    """Return the means of a comparison as text, each as a bound where the joint was stuck."""
    name, unit = FIGURES[test.figure]
    return ['> ' * (test.figure == 'peak_torque' and evaluation.stuck(condition) > 0) + value(
        f'{name} of {evaluation.joint}: {evaluation.label(condition)}', f'{number(mean)} {unit}')
            for condition, mean in ((test.first, test.mean_first),
                                    (test.second, test.mean_second))]


def _nothing_to_compare(evaluation: Evaluation) -> str:
    if evaluation.measured:
        return ('The effect of announcing the direction is unknown: no movement was recorded both '
                'with it (d = ±1) and without (d = 0, or no compensation) under the same law.')
    unused = list(dict.fromkeys(note for note in evaluation.notes
                                if 'interaction_wrench' in note and note.endswith(': not used')))
    known = ('**The back-driving torque is not known.** ' + '; '.join(unused) + '.' if unused
             else '**The back-driving torque was not measured.**')
    return (f'{known} Position and reference show when the joint started, but not how much torque '
            'the person needed.')


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
    """Yield condition, movement, number of repetitions, and the named measures."""
    for one in evaluation.conditions:
        yield [evaluation.label(one.compensation), _SIGNS[one.movement], str(one.repetitions),
               *(measure_text(one, name) for name in names)]


def _known_columns(evaluation: Evaluation) -> list[str]:
    return [name for name in _COLUMNS if any(name in c.figures for c in evaluation.conditions)]


def terminal_lines(evaluation: Evaluation) -> list[str]:
    """Return what `evaluate` prints of a joint: a table, the verdict, and remarks."""
    names = _known_columns(evaluation)
    rows = [['condition', 'move', 'n', *(_COLUMNS[name] for name in names)],
            *condition_rows(evaluation, names)]
    return [*aligned(rows), '', *map(without_marks, [verdict(evaluation), *remarks(evaluation)])]


def measure_text(condition: Condition, name: str) -> str:
    """Return mean ± standard deviation of a measure, or a bound where the joint was stuck."""
    if name not in condition.figures:
        return '–'
    mean, std, count = condition.figures[name]
    # No line break between a number and its deviation.
    text = number(mean) + f'\u00a0±\u00a0{number(std, 2)}' * (count >= FEWEST)
    return f'>\u00a0{text}' if name == 'peak_torque' and condition.stuck else text


def evaluation_page(evaluations: Sequence[Evaluation]) -> Report:
    """Return the page of `evaluate`, with one evaluation for each joint."""
    joints = ', '.join(evaluation.joint or 'the joint' for evaluation in evaluations)
    count = sum(len(evaluation.repetitions) for evaluation in evaluations)
    torque = any(evaluation.measured for evaluation in evaluations)
    recordings = list(dict.fromkeys(
        r.recording for evaluation in evaluations for r in evaluation.repetitions))
    page = Report(
        f'{"Back-driving torque" if torque else "Movements"} of {joints}',
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
    page.bullets(remarks(evaluation))
    page.figure(
        curves_figure(evaluation),
        "Mean movement, from its beginning (style of the note's Fig. 5); bands: standard deviation "
        'over the repetitions.' + (
            ' Shaded: the person waits at the target of the movement before, which is not counted.'
            if evaluation.measured else ''))
    names = _known_columns(evaluation)
    page.table(
        ['condition', 'move', 'n', *(_COLUMNS[name] for name in names), 'false starts'],
        [[*row, str(one.false_starts)] for row, one in zip(
            condition_rows(evaluation, names), evaluation.conditions)],
        f'Mean over the repetitions ± their standard deviation, where there are {FEWEST}, for '
        'movements in the positive (+) and negative (−) direction. The peak is that from the '
        'beginning until the movement slows down, or the joint moves; delay: until it moves; '
        '> where it did not always move.')
    if evaluation.comparisons:
        first = evaluation.comparisons[0]
        page.table(
            ['', evaluation.label(first.first), evaluation.label(first.second), 'difference',
             '95 % in turn'],
            [[FIGURES[c.figure][0], *_compared(evaluation, c),
              f'{number(c.difference)} {FIGURES[c.figure][1]}',
              interval_text(c.interval) if c.interval else '–'] for c in evaluation.comparisons],
            'Movements of the same day and direction. In turn: from each run of movements under '
            'one condition to the next run under the other.')


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
            colour, label = colours[c.compensation], evaluation.label(c.compensation)
            band(angle, c.time, np.degrees(c.position), np.degrees(c.position_std), colour, label)
            if evaluation.measured:
                torque = axes[each * k + 1]
                band(torque, c.time, c.torque, c.torque_std, colour, label)
        if evaluation.measured:
            zero(axes[each * k + 1])
            shade_waiting(axes[each * k + 1], min(float(c.time[0]) for c in conditions))
    legend(axes[0], 2)
    return figure
