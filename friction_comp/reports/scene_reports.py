# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages of the demo's further scenes: two joints with reversals, and a drive that changes."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.evaluation.intervals import Interval, mean_interval
from friction_comp.reports.evaluation_report import add_evaluation
from friction_comp.reports.evaluation_words import compared_peaks, with_interval
from friction_comp.reports.figures import COLOURS, new_figure, styled, thin
from friction_comp.reports.html import number, Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.evaluation.outcome import Evaluation
    from friction_comp.evaluation.repetitions import Repetition
    from friction_comp.samples import Samples


def two_joints_report(evaluations: list[Evaluation], shown: dict[str, Samples],
                      exercise: Path) -> Report:
    """Return the page on an exercise of several joints.

    Parameters
    ----------
    evaluations : list of Evaluation
        One a joint.
    shown : dict of str to Samples
        One recording of the exercise by joint, on one time base.
    exercise : Path
    """
    page = Report('Two joints that turn round on the way',
                  f'Exercise {exercise.name}: each direction announced by itself')
    tiles = []
    words = []
    for one in evaluations:
        compared, peaks = one.compared('peak_torque'), compared_peaks(one)
        if compared is None or peaks is None:
            continue
        tiles.append((f'{peaks[0]} → {peaks[1]} N·m', f'{one.joint}, peak'))
        change = round(100 * (compared[1] / compared[0] - 1))
        words.append(f'the {one.joint} {"at least " if one.is_bound else ""}'
                     f'**{abs(change)} %** {"more" if change > 0 else "less"}')
    page.verdict("With each joint's direction announced as it changes, setting it in motion and "
                 'turning it round takes of the person at its peak: '
                 f'{", ".join(words) or "not known"} than with kinetic friction compensated '
                 'alone.')
    page.numbers(tiles)
    page.figure(exercise_figure(shown), 'What was shown to the person (dashed), where the joints '
                'went, and the direction announced for each (shaded: blue positive, orange '
                'negative).')
    for one in evaluations:
        page.heading(f'The {one.joint}')
        add_evaluation(page, one)
    return page


@styled
def exercise_figure(shown: dict[str, Samples], seconds: float = 16.0) -> Figure:
    """Draw positions and announced directions of the first s, one joint above the other."""
    figure, axes = new_figure(len(shown), 1, width=8.4, height=2.2, sharex=True, squeeze=False)
    for below, (joint, samples) in zip(axes[:, 0], shown.items()):
        part = samples.take(samples.time <= samples.time[0] + seconds)
        if part.reference_position is not None:
            below.plot(*thin(part.time, np.degrees(part.reference_position)), '--',
                       color=COLOURS['grey'], linewidth=1.0)
        below.plot(*thin(part.time, np.degrees(part.position)), color=COLOURS['green'])
        for sign, colour in ((1, 'blue'), (-1, 'orange')):
            if part.direction is not None:
                below.fill_between(part.time, 0, 1, where=part.direction == sign, alpha=0.15,
                                   color=COLOURS[colour], linewidth=0,
                                   transform=below.get_xaxis_transform())
        below.set_ylabel(f'{joint} (deg)')
    axes[-1, 0].set_xlabel('time (s)')
    return figure


def stages_of(evaluation: Evaluation, marks: dict[str, float], count: int
              ) -> dict[str, list[Repetition]]:
    """Return the repetitions at first, at the warning, and after the refined model was loaded.

    Parameters
    ----------
    evaluation : Evaluation
    marks : dict
        'warned' and 'loaded', s since the exercise began.
    count : int
        Movements each way in a stage.
    """
    every = sorted(evaluation.repetitions, key=lambda r: r.begin)
    # What was active is known from the compensator itself; the marks are a second late.
    first = every[0].help.model
    before = [r for r in every if r.help.model == first]
    after = [r for r in every if r.help.model != first]
    # In the last of them the refined model may have been loaded already.
    before = before[:-1] if after and len(before) > 2 * count else before
    late = [r for r in before if r.begin >= marks['warned']] or before
    return {'at first': before[:2 * count], 'model no longer fits': late[-2 * count:],
            'refined model': after[:2 * count]}


def effort(part: list[Repetition], figure: str = 'rms_torque') -> Interval:
    """Return mean and interval of a figure of repetitions.

    Parameters
    ----------
    part : list of Repetition
    figure : str
        By its name in `FIGURES`; the person's RMS torque by default.
    """
    return mean_interval([r.figures[figure] for r in part if figure in r.figures])


def wear_words(stages: dict[str, list[Repetition]], facts: dict[str, Any]) -> str:
    """Return in words what came of closing the loop live."""
    first, late, refined = (effort(part).mean for part in stages.values())
    starts = [effort(part, 'peak_torque').mean for part in stages.values()]
    return (f'The drive changed while it ran: the torque with which a person moves it rose from '
            f'**{number(first)}** to **{number(late)} N·m** RMS. The watch told so, and refinement '
            f'found in what was kept of the session: {", ".join(facts["found"])}. The model was '
            f'loaded into the running compensator: its error fell from '
            f'{number(1e3 * facts["error_before"])} to {number(1e3 * facts["error_after"])} mA on '
            f'data not fitted, and moving the joint takes **{number(refined)} N·m** now. Its peak '
            f'was {number(starts[0])}, {number(starts[1])} and is {number(starts[2])} N·m: the '
            'breakaway currents are measured by identification alone, and a changed drive should '
            'be identified again.')


def wear_report(evaluation: Evaluation, stages: dict[str, list[Repetition]],
                marks: dict[str, float], facts: dict[str, Any], samples: Samples,
                hidden: Path) -> Report:
    """Return the page on a drive that changed while it ran.

    Parameters
    ----------
    evaluation : Evaluation
        Of the whole session.
    stages : dict
        As `stages_of` returns them.
    marks : dict
    facts : dict
        What watch and refinement said.
    samples : Samples
        The session.
    hidden : Path
        What the simulated joint alone was given.
    """
    page = Report('A drive that changes, and a loop that is closed live',
                  'Watch, refine, load on trial, judge: without a restart')
    page.verdict(wear_words(stages, facts))
    page.numbers([(f'{with_interval(effort(part))} N·m',
                   f'{name}: RMS torque, {len(part)} movements')
                  for name, part in stages.items()])
    page.figure(session_figure(evaluation, marks, samples),
                'RMS torque of each movement by the model that was active, and the temperature '
                'of the motor. Lines: when the watch warned, and when the refined model was '
                'loaded.')
    page.heading('What was said')
    page.text('\n'.join(f'- {line}' for line in (
        f'the watch: {facts["warning"]}', f'refinement: {facts["message"]}',
        f'its verdict: {facts["verdict"]}', f'the watch afterwards: {facts["afterwards"]}')))
    page.text(f'The joint hides its change from all other nodes: `{hidden.name}` was given to the '
              'simulation alone. The model is on trial beside the one before for some minutes of '
              'movement, and is taken back if that one fits better.')
    page.heading('The whole session')
    add_evaluation(page, evaluation)
    return page


@styled
def session_figure(evaluation: Evaluation, marks: dict[str, float], samples: Samples) -> Figure:
    """Draw each movement's RMS torque over the session, and the temperature below."""
    rows = 1 if samples.temperature is None else 2
    figure, axes = new_figure(rows, 1, width=8.4, height=2.4, sharex=True, squeeze=False)
    above = axes[0, 0]
    models = list(dict.fromkeys(r.help.model for r in sorted(
        evaluation.repetitions, key=lambda r: r.begin)))
    for model, colour, marker in zip(models, ('orange', 'blue', 'green'), 'os^'):
        part = [r for r in evaluation.repetitions if r.help.model == model
                and 'rms_torque' in r.figures]
        above.plot([r.begin for r in part], [r.figures['rms_torque'] for r in part], marker,
                   color=COLOURS[colour], markersize=4.5,
                   label=('model at the start' if model == models[0] else 'refined model'))
    above.set_ylim(bottom=0.0)
    above.set_ylabel('RMS torque (N·m)')
    for below in axes[:, 0]:
        for at in marks.values():
            below.axvline(at, color=COLOURS['grey'], linewidth=0.9, linestyle=':')
    for name, at in marks.items():
        above.text(at, 1.0, f' {name}', transform=above.get_xaxis_transform(), va='top',
                   fontsize=8.5)
    if samples.temperature is not None:
        axes[1, 0].plot(*thin(samples.time, samples.temperature), color=COLOURS['red'])
        axes[1, 0].set_ylabel('motor (°C)')
    axes[-1, 0].set_xlabel('time (s)')
    figure.legend(loc='outside lower center', ncols=2)
    return figure
