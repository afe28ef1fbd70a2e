# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page of an evaluation: the verdict, every movement, the note's Fig. 5, and tables."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.compare import FEWEST
from friction_comp.evaluation.conditions import Evaluation
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.number_text import number
from friction_comp.reports import evaluation_words as words
from friction_comp.reports.figures import band, COLOURS, curve, INK, legend, panels, styled, zero
from friction_comp.reports.html import Report, value

_MOST_COMPARISONS, _MOST_RECORDINGS = 24, 12
_SIGNS = {'positive': 1, 'negative': -1}


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
    page.verdict('\n\n'.join((f'**{one.joint}.** ' if several else '') + _verdict(one)
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


def _name(evaluation: Evaluation, condition: Compensation) -> str:
    """Return the name of a condition's mean peak torque on the page."""
    return f'peak of {evaluation.joint}: {evaluation.label(condition)}'


def _peaks(evaluation: Evaluation, peaks: words.Peaks) -> list[str]:
    return [value(_name(evaluation, condition), f'{text} N·m')
            for condition, text in zip(peaks.pair, peaks.torques)]


def _verdict(evaluation: Evaluation) -> str:
    text, peaks = words.verdict(evaluation), words.peaks_of(evaluation)
    if peaks:
        for plain, named in zip(peaks.torques, _peaks(evaluation, peaks)):
            bare = plain.removeprefix('> ')
            text = text.replace(f'**{bare} N·m**', f'**{named.replace("> ", "")}**', 1)
    return text


def _add(page: Report, evaluation: Evaluation) -> None:
    peaks = words.peaks_of(evaluation)
    if peaks:
        starts = sum(c.false_starts for c in evaluation.conditions)
        without, known = _peaks(evaluation, peaks)
        page.numbers([
            (without, 'to set the joint in motion ' + (
                'without help' if peaks.pair[0].law == 'none'
                else 'when the direction is not known')),
            (known, 'when the robot knows the direction'),
            (str(starts), 'times the joint started by itself')])
    page.bullets(words.remarks(evaluation))
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
    names = words.known_columns(evaluation, 5)
    page.table(
        ['condition', '', 'n', *(words.COLUMNS[name] for name in names), 'false starts'],
        [[*row, str(one.false_starts)] for row, one in zip(
            words.condition_rows(evaluation, names), evaluation.conditions)],
        'Mean over the repetitions' + (' ± half its 95 % interval' if spread else '')
        + ', for movements in the positive (+) and negative (−) direction. The peak is from the '
        'begin of the movement until it slows down, or until the joint moves; delay: until the '
        'joint moves; > where it did not always move.')
    if evaluation.comparisons:
        page.heading('Comparisons', 3)
        _add_comparisons(page, evaluation)


def _add_comparisons(page: Report, evaluation: Evaluation) -> None:
    shown = sorted(evaluation.comparisons, key=lambda c: (
        list(FIGURES).index(c.figure), c.p_value is None, c.p_value or 0.0))[:_MOST_COMPARISONS]
    peaks = words.peaks_of(evaluation)
    rows = []
    for c in shown:
        means = [words.peak_text(mean, c.figure == 'peak_torque' and evaluation.stuck(condition))
                 for mean, condition in ((c.mean_first, c.first), (c.mean_second, c.second))]
        if peaks and c is peaks.test:
            # Elsewhere on the page they have their unit beside them.
            means = [value(_name(evaluation, condition), f'{text} N·m')
                     for condition, text in zip(peaks.pair, peaks.torques)]
        rows.append([words.heading(c.figure), evaluation.label(c.first),
                     evaluation.label(c.second), *means, number(c.difference),
                     words.with_interval(c.without_drift)
                     if c.without_drift.half is not None else '–',
                     words.p_value_text(c.p_value)])
    page.table(['measure', 'first', 'second', 'mean of first', 'mean of second', 'difference',
                'without drift', 'p'], rows,
               'Movements of the same day and direction. Without drift: the difference that is '
               'left beside a steady change over the session, with its 95 % interval; p is of '
               "Student's t, with Holm's correction for all comparisons of a measure.")
    page.bullets(dict.fromkeys(f'Not tested: {c.untested}.' for c in shown if c.untested))


def _colours(evaluation: Evaluation) -> dict[Compensation, str]:
    """Return a colour for each condition: by what is known of the direction, then others."""
    colours: dict[Compensation, str] = {}
    for condition in dict.fromkeys(c.compensation for c in evaluation.conditions):
        first = ('no help' if condition.law == 'none' else
                 'known' if condition.uses_direction and condition.announced > 0 else
                 'out' if condition.announced < 0 else 'unknown')
        free = [name for name in (first, 'other', 'refined', 'before', 'predicted')
                if name not in colours.values()]
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
        f'angle {"+" if name == "positive" else "−"} (deg)',
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
                zero(torque)
                torque.axvspan(min(float(c.time[0]), -0.1), 0.0, color=COLOURS['faint'],
                               alpha=0.25 / len(conditions), linewidth=0)
    legend(axes[0], 2)
    return figure
