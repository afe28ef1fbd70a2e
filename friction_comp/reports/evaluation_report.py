# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page of an evaluation: the verdict, the note's Fig. 5, tables and explanations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from matplotlib.figure import Figure
import numpy as np

from friction_comp.evaluation.compare import FEWEST, Interval
from friction_comp.evaluation.conditions import Evaluation
from friction_comp.evaluation.repetitions import Compensation, FIGURES
from friction_comp.number_text import number
from friction_comp.reports import evaluation_words as words
from friction_comp.reports.figures import band, COLOURS, INK, legend_below, new_figure, styled
from friction_comp.reports.html import Report

_MOST_COMPARISONS, _MOST_TILES, _MOST_RECORDINGS = 24, 5, 12
# Titles of the tables of conditions, and the measures in each; unknown ones are omitted.
_TABLES = (
    ('Torque and current', ('peak_torque', 'rms_torque', 'constant_velocity_torque',
                            'residual_current')),
    ('Timing', ('peak_time', 'onset')),
)
_EXPLANATIONS = {
    'peak_torque': (
        'The peak is the largest torque from the beginning of the movement until it slows down, or '
        'until the joint starts moving if that is later. A lower bound (>) is given if the joint '
        'did not move in some repetitions. RMS is over the movement without standstill. The torque '
        'at constant velocity is positive if the person pushes the joint, and negative if the '
        'joint pulls the person.'),
    'residual_current': (
        'The residual current is the RMS difference between the current that the model predicts '
        'for the movement and the commanded current. It is only as accurate as the model.')}


@styled
def evaluation_figure(evaluation: Evaluation) -> Figure:
    """Draw joint angles above and torques below, positive movements left and negative right."""
    movements = [name for name in ('positive', 'negative')
                 if any(c.movement == name for c in evaluation.conditions)]
    colours = _colours(evaluation)
    labels = ['joint angle (deg)', 'back-driving torque (N·m)'][:1 + evaluation.measured]
    figure, axes = new_figure(
        len(labels), len(movements), width=8.4, height=2.5, x='time since the movement began (s)',
        y=labels, sharex='col', sharey='row', squeeze=False)
    for column, movement in zip(axes.T, movements):
        column[0].set_title(f'Movement in the {movement} direction')
        conditions = [c for c in evaluation.conditions if c.movement == movement]
        for shown in [c for c in conditions if c.reference is not None][:1]:
            column[0].plot(shown.time, np.degrees(np.asarray(shown.reference)), '--',
                           color=INK, linewidth=1.0, label='shown to the person')
        for c in conditions:
            label = f'{evaluation.label(c.compensation)}, n = ' + ' + '.join(
                str(other.repetitions) for other in evaluation.conditions
                if other.compensation == c.compensation)
            curves = ((np.degrees(c.position), np.degrees(c.position_std)),
                      (c.torque, c.torque_std))
            for ax, (mean, spread) in zip(column, curves):
                band(ax, c.time, mean, spread, colours[c.compensation], label)
        if evaluation.measured:
            column[1].axhline(0.0, color=COLOURS['grey'], linewidth=0.8)
    handles = {label: handle for ax in axes[0] for handle, label in zip(
        *ax.get_legend_handles_labels())}
    legend_below(figure, min(2, max(len(handles), 1)), handles.values(), handles.keys())
    return figure


def add_evaluation(report: Report, evaluation: Evaluation, part: bool = False) -> None:
    """Add an evaluation to a report below its verdict; `part` if it is one of several."""
    level = 3 if part else 2
    simple = bool(words.plain_verdict(evaluation))
    tiles = words.plain_tiles(evaluation) if simple else _tiles(evaluation)
    if tiles:
        report.numbers(tiles)
    if simple:
        report.heading('In detail', level)
        report.text(words.summary(evaluation))
    elif part:
        report.text(words.remarks(evaluation))
    torque = ' and back-driving torque' if evaluation.measured else ''
    report.figure(
        evaluation_figure(evaluation),
        f'Trajectory{torque}, average and standard deviation over the repetitions, synchronised '
        "at the start of the movement (style of the note's Fig. 5).")
    report.heading('Conditions', level)
    _add_conditions(report, evaluation)
    if evaluation.comparisons:
        report.heading('Comparisons', level)
        _add_comparisons(report, evaluation)


def _add_conditions(report: Report, evaluation: Evaluation) -> None:
    # In the first table only.
    counts = ['n', 'false starts']
    for title, names in _TABLES:
        shown = [name for name in names if any(
            c.figures[name].mean != 0 for c in evaluation.conditions if name in c.figures)]
        if not shown:
            continue
        report.table(
            ['condition', '', *counts, *map(words.heading, shown)],
            [[words.nonbreaking_label(evaluation, c.compensation),
              '+' if c.movement == 'positive' else '\u2212',
              *[c.repetitions, f'{c.false_starts}\u00a0({_percent(c.false_start_share)})'][
                  :len(counts)], *(words.figure_text(c, name) for name in shown)]
             for c in evaluation.conditions],
            f'{title}: mean over the repetitions ± half its 95 % confidence interval, '
            f'{"on these days, " if len({r.day for r in evaluation.repetitions}) > 1 else ""}for '
            'movements in the positive (+) and negative (\u2212) direction.')
        counts = []
    known = {name for c in evaluation.conditions for name in c.figures}
    report.text(' '.join(text for name, text in _EXPLANATIONS.items() if name in known)
                + ' A false start is a repetition in which the joint started during the standstill'
                + (' without being pushed; in brackets, the 95 % interval of their share.'
                   if evaluation.measured else
                   '; without a torque sensor it is unknown whether it was pushed.'))


def _add_comparisons(report: Report, evaluation: Evaluation) -> None:
    shown = sorted(evaluation.comparisons, key=lambda c: (
        list(FIGURES).index(c.figure), c.p_value is None, c.p_value or 0.0))
    shown = shown[:_MOST_COMPARISONS]
    report.table(
        ['measure', 'first condition', 'second condition', 'pairs', 'first mean', 'second mean',
         'difference', 'without drift', 'p'],
        [[words.heading(c.figure), words.nonbreaking_label(evaluation, c.first),
          words.nonbreaking_label(evaluation, c.second), c.pairs, *(
              words.peak_text(mean, evaluation.stuck(condition) * (c.figure == 'peak_torque'))
              for mean, condition in ((c.mean_first, c.first), (c.mean_second, c.second))),
          number(c.difference),
          words.with_interval(c.without_drift) if c.without_drift.half is not None else '–',
          words.p_value_text(c.p_value)] for c in shown],
        'A pair is a movement under each of the two conditions on the same day, in the same '
        'direction; means are over these.')
    omitted = len(evaluation.comparisons) - len(shown)
    report.text(
        'The comparisons are: each condition with no compensation; the direction announced with '
        'not announced, for the same model; and two models under the same law. '
        'Repetitions of a person are no independent draws: without drift, the difference is that '
        'which is left beside a steady change over the session, and its 95 % interval allows for '
        "neighbouring repetitions that are alike. p is of Student's t, with Holm's correction for "
        f'all comparisons of one measure; of fewer than {FEWEST} repetitions there is neither. '
        + ' '.join(f'Not tested, since {reason}.' for reason in dict.fromkeys(
            c.untested for c in shown if c.untested))
        + (f' {omitted} more are in `report.json`.' if omitted else ''))


def verdicts(evaluations: Sequence[Evaluation]) -> str:
    """Return the verdict on each of several joints, once for joints with the same verdict."""
    joints: dict[str, list[str]] = {}
    for evaluation in evaluations:
        text = words.plain_verdict(evaluation) or words.verdict(evaluation)
        joints.setdefault(text, []).append(evaluation.joint)
    return '\n\n'.join(f'**{", ".join(names)}.** {text}' for text, names in joints.items())


def evaluation_report(evaluations: Sequence[Evaluation], title: str = '', result: str = '',
                      begin: Callable[[Report], None] = lambda _: None) -> Report:
    """Return the page of `evaluate`, with one evaluation for each joint.

    A scene of the demo may change title and main result, and add with `begin` what comes first.
    """
    joints = ', '.join(evaluation.joint or 'the joint' for evaluation in evaluations)
    count = sum(len(evaluation.repetitions) for evaluation in evaluations)
    torque = any(evaluation.measured for evaluation in evaluations)
    recordings = list(dict.fromkeys(
        r.recording for evaluation in evaluations for r in evaluation.repetitions))
    report = Report(
        title or f'{"Back-driving torque" if torque else "Movements"} of {joints}',
        f'{count} movements from {len(recordings)} recording{"s" if len(recordings) > 1 else ""}')
    several = len(evaluations) > 1
    report.verdict(result or (verdicts(evaluations) if several else words.plain_verdict(
        evaluations[0]) or words.summary(evaluations[0])))
    begin(report)
    for evaluation in evaluations:
        if several:
            report.heading(f'Joint {evaluation.joint}')
        add_evaluation(report, evaluation, part=several)
    report.heading('Sources')
    listed = [f'recording `{name}`' for name in recordings[:_MOST_RECORDINGS]]
    if len(recordings) > _MOST_RECORDINGS:
        listed.append(f'and {len(recordings) - _MOST_RECORDINGS} more, all named in '
                      '`repetitions.csv`')
    listed += dict.fromkeys(f'model files that were active: `{evaluation.model}`'
                            for evaluation in evaluations if evaluation.model)
    listed += dict.fromkeys(note for evaluation in evaluations for note in evaluation.notes)
    report.bullets(listed)
    return report


def _tiles(evaluation: Evaluation) -> list[tuple[str, str]]:
    """Return the peak torque of each condition, for a page without a pair to compare."""
    conditions = dict.fromkeys(
        c.compensation for c in evaluation.conditions if c.compensation.announced >= 0)
    return [(f'{words.peak_text(peak, evaluation.stuck(condition))} N·m',
             f'peak, {words.nonbreaking_label(evaluation, condition)}') for condition in conditions
            if np.isfinite(peak := evaluation.mean_of('peak_torque', condition))][:_MOST_TILES]


def _percent(share: Interval) -> str:
    low, high = 100 * (share.low or 0.0), 100 * (share.high or 0.0)
    return f'{low:.0f}\u202f–\u202f{high:.0f}\u00a0%'


def _colours(evaluation: Evaluation) -> dict[Compensation, str]:
    """Return a colour for each condition, the same wherever the page shows it.

    Grey is without a direction, blue with it; orange is the person's torque.
    """
    plain, assisted = ['grey', 'violet', 'yellow', 'pink'], ['blue', 'green', 'red', 'violet']
    colours: dict[Compensation, str] = {}
    for condition in dict.fromkeys(c.compensation for c in evaluation.conditions):
        palette = ['pink', 'red'] if condition.announced < 0 else (
            assisted if condition.uses_direction else plain)
        used = sum(other.uses_direction == condition.uses_direction for other in colours)
        colours[condition] = palette[used % len(palette)]
    return colours
