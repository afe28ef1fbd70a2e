# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The evaluation as a page: the note's Fig. 5, a table, and what they mean in plain words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friction_comp.reports.figures import band, new_figure, styled
from friction_comp.reports.html import number, Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.evaluation.conditions import Condition, Evaluation


@styled
def evaluation_figure(evaluation: Evaluation) -> Figure:
    """Draw trajectories above, torques below; the positive movement left, the negative right.

    Parameters
    ----------
    evaluation : Evaluation

    Returns
    -------
    matplotlib.figure.Figure
    """
    movements = [name for name in ('positive', 'negative')
                 if any(c.movement == name for c in evaluation.conditions)]
    figure, axes = new_figure(2, len(movements), width=8.4, height=2.5, sharex='col',
                              sharey='row', squeeze=False)
    for column, movement in enumerate(movements):
        above, below = axes[:, column]
        above.set_title(f'Movement in the {movement} direction')
        conditions = [c for c in evaluation.conditions if c.movement == movement]
        shown = next((c for c in conditions if c.reference is not None), None)
        if shown is not None and shown.reference is not None:
            above.plot(shown.time, np.degrees(shown.reference), '--', color='#87909a',
                       linewidth=1.0, label='shown to the person')
        for condition in conditions:
            colour = _colour(condition)
            label = f'{_condition_name(condition)}, n = {condition.repetitions}'
            band(above, condition.time, np.degrees(condition.position),
                 np.degrees(condition.position_std), colour, label)
            band(below, condition.time, condition.torque, condition.torque_std, colour, label)
        below.axhline(0.0, color='#87909a', linewidth=0.8)
        below.set_xlabel('time since the movement began [s]')
        above.legend(loc='best')
    axes[0, 0].set_ylabel('joint angle [deg]')
    axes[1, 0].set_ylabel('back-driving torque [N·m]')
    return figure


def add_evaluation(report: Report, evaluation: Evaluation) -> None:
    """Add figures, table and words of an evaluation to a report.

    Parameters
    ----------
    report : Report
    evaluation : Evaluation
    """
    report.numbers(_tiles(evaluation))
    report.text(summary(evaluation))
    report.figure(
        evaluation_figure(evaluation),
        'Trajectory and back-driving torque, average and standard deviation over the '
        "repetitions, synchronised at the start of the movement (style of the note's Fig. 5).")
    report.table(
        ['condition', 'movement', 'repetitions', 'peak |τ_b| [N·m]', '± [N·m]', 'peak at [s]',
         'RMS [N·m]', 'constant velocity [N·m]', 'false starts'],
        [[_condition_name(c), c.movement, c.repetitions, c.peak_torque, c.peak_torque_std,
          c.peak_time, c.rms_torque, c.mean_torque_constant_velocity, c.false_starts]
         for c in evaluation.conditions],
        'Torque that the person had to exert on the joint.')
    report.text(
        'The peak is that of the averaged torque, from 0.5 s before the movement until it slows '
        "down; the number behind ± is the standard deviation of the single repetitions' own "
        'peaks. RMS is '
        'taken over the movement, standstill not counted. The torque at constant velocity is '
        'positive where the person pushes the joint along, and negative where the joint pulls '
        'ahead. A false start is a repetition in which the joint set out during the standstill '
        'although nobody pushed it.')


def evaluation_report(evaluation: Evaluation, recordings: list[str]) -> Report:
    """Return the whole page of `evaluate`.

    Parameters
    ----------
    evaluation : Evaluation
    recordings : list of str
        The recordings' names.

    Returns
    -------
    Report
    """
    report = Report(
        f'Back-driving torque of {evaluation.joint or "the joint"}',
        f'{sum(c.repetitions for c in evaluation.conditions)} movements from '
        f'{len(recordings)} recording{"s" if len(recordings) > 1 else ""}')
    add_evaluation(report, evaluation)
    report.text('## Where this comes from')
    report.text('\n'.join(f'- recording `{name}`' for name in recordings))
    if evaluation.model:
        report.text(f'The model file that was active: `{evaluation.model}`.')
    if evaluation.notes:
        report.text('\n'.join(f'- {note}' for note in evaluation.notes))
    return report


def summary(evaluation: Evaluation) -> str:
    """Return in plain words what the trials show."""
    words = ['The back-driving torque is what a person must apply to move the joint; a perfectly '
             'backdrivable joint would ask for no more than its inertia.']
    compared, change = evaluation.compared('peak_torque'), evaluation.peak_reduction
    if compared is not None and change is not None:
        before, after = compared
        verb = 'less' if change >= 0 else 'more'
        words.append(
            f'With the direction announced (d = ±1) it took **{number(after)} N·m** to set the '
            f'joint in motion instead of **{number(before)} N·m** without (d = 0): '
            f'**{abs(100 * change):.0f} % {verb}**.')
    else:
        words.append('No movement was recorded both with d = 0 and with d = ±1, so nothing is '
                     'compared.')
    started = sum(c.false_starts for c in evaluation.conditions)
    words.append('The joint never started by itself.' if not started else
                 f'**In {started} repetitions the joint started by itself.** A lower '
                 '`breakaway_gain` or a new identification is called for.')
    against = [c for c in evaluation.conditions if c.direction != 0 and not c.assisted]
    if against:
        words.append(
            f'{sum(c.repetitions for c in against)} movements went against the direction '
            'announced; they are listed but not compared.')
    return ' '.join(words)


def _tiles(evaluation: Evaluation) -> list[tuple[str, str]]:
    tiles = []
    for name, group in (
            ('peak, direction not announced (d = 0)',
             [c for c in evaluation.conditions if c.direction == 0]),
            ('peak, direction announced (d = ±1)',
             [c for c in evaluation.conditions if c.assisted])):
        if group:
            tiles.append((f'{number(float(np.mean([c.peak_torque for c in group])))} N·m', name))
    for name, value in (('peak', evaluation.peak_reduction),
                        ('RMS torque', evaluation.rms_reduction)):
        if value is not None:
            tiles.append((f'{abs(100 * value):.0f} %',
                          f'{"lower" if value >= 0 else "higher"} {name} with d = ±1'))
    return tiles


def _condition_name(condition: Condition) -> str:
    if condition.direction == 0:
        return 'd = 0'
    name = f'd = {condition.direction:+d}'.replace('-', '\u2212')
    return name if condition.assisted else f'{name} (against)'


def _colour(condition: Condition) -> str:
    if condition.direction == 0:
        return 'blue'
    return 'orange' if condition.assisted else 'pink'
