# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The reports on many recordings that were refined separately, and on a whole arm."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from friction_comp.arm.whole_arm import ArmResult
from friction_comp.fleet.population import Population
from friction_comp.number_text import interval_text, number
from friction_comp.refinement.result import RefinementReport
from friction_comp.reports.figures import COLOURS, curve, legend_below, new_figure, styled
from friction_comp.reports.fleet_report import add_fleet, fleet_verdict
from friction_comp.reports.html import Link, Report
from friction_comp.reports.refinement_report import effect_names

# Effects found in fewer than this share of a joint's recordings may be due to chance.
_REPEATABLE = 0.5
# Largest number of recordings that are named below a figure.
_MOST_LABELS = 16
_VERDICTS = ('trust', 'trust in part', 'record again')
# Ratio of the ends of its interval up to which a current per torque counts as determined.
_LARGEST_RATIO = 3.0


def verdict(content: dict[str, Any]) -> str:
    """Return the result of all recordings as sentences; `content` is that of report.json."""
    rows, failed, missing = content['recordings'], content['failed'], content['not_done']
    kinds = Counter(row['verdict'] for row in rows)
    counts = ', '.join(f'{name}: {kinds[name]}' for name in _VERDICTS if kinds[name])
    text = f'**{len(rows)} of {len(rows) + len(failed) + missing} refined** ({counts or "none"}).'
    reductions = [1.0 - row['after'] / row['before'] for row in rows
              if row['effects'] and row['before'] > 0]
    if reductions:
        low, middle, high = np.quantile(reductions, [0.25, 0.5, 0.75])
        text += (f' In {len(reductions)} an effect was found that the model lacked: there the '
                 f'error is {100 * middle:.0f} % less (median; in half of them {100 * low:.0f} to '
                 f'{100 * high:.0f} %).')
    elif rows:
        text += ' In none of them was an effect found that the model lacked.'
    if failed:
        text += f' **{len(failed)} could not be used**; the reasons are below.'
    if missing:
        text += f' **Interrupted: {missing} were not done.**'
    return text


def each_report(content: dict[str, Any], populations: Sequence[Population] = ()) -> Report:
    """Return the report from report.json; `populations` compare the units of a fleet by joint."""
    rows = content['recordings']
    joints = list(dict.fromkeys(row['joint'] for row in rows))
    page = Report('A fleet, unit by unit' if populations else
                  'What friction models lacked, recording by recording',
                  f'{len(rows)} refined separately; joints: {", ".join(joints)}')
    page.verdict('\n\n'.join([*map(fleet_verdict, populations), verdict(content)]))
    for population in populations:
        add_fleet(page, population)
    if populations:
        page.heading('Errors')
    for unit in dict.fromkeys(row['unit'] for row in rows):
        same_unit = sorted((row for row in rows if row['unit'] == unit),
                           key=lambda row: str(row['joint']))
        page.figure(_errors_figure(same_unit, unit), 'Error on data not fitted, before (open) and '
                    'after refinement (filled), and noise from sample to sample (line), on a '
                    'logarithmic scale; ordered by joint and recording.')
    page.heading('Effects, and how often they were found')
    page.table(['joint', 'effect', 'depends on', 'found in', 'of', 'repeatable'],
               _effect_rows(rows, joints))
    page.text('If an effect is found in only some recordings of a joint, either the others lack a '
              'movement that shows it (each report says what hardly varied), or it is not a '
              'property of the drive.')
    page.heading('Recording by recording')
    page.table(
        ['recording', 'joint', 'verdict', 'before', 'after', 'noise', 'unit', 'found',
         'unexplained'],
        [[Link(row['folder'], f"{row['folder']}/report.html") if row['page'] else row['folder'],
          row['joint'],
          row['verdict'], row['before'], row['after'], row['noise_floor'], row['unit'],
          effect_names(effect['name'] for effect in row['effects']),
          ', '.join(row['unexplained'])] for row in rows],
        'RMS of measured minus predicted on parts that were not fitted. The report and the model '
        'file of each recording are in its folder beside this page.')
    if content['failed']:
        page.heading('Not usable')
        page.bullets(content['failed'])
    return page


@styled
def _errors_figure(rows: list[dict[str, Any]], unit: str) -> Figure:
    """Draw the errors before and after refinement; rows must be grouped by joint."""
    figure, axes = new_figure(width=8.4, height=3.2, y=f'RMS error ({unit})')
    x = np.arange(len(rows))
    before, after, noise = (np.array([row[name] for row in rows], dtype=float)
                            for name in ('before', 'after', 'noise_floor'))
    axes.vlines(x, after, before, color=COLOURS['grey'], linewidth=0.8)
    curve(axes, x, before, 'orange', 'before', 'o', markerfacecolor='none', markersize=4)
    curve(axes, x, after, 'blue', 'after', 'o', markersize=4)
    axes.hlines(noise, x - 0.4, x + 0.4, color=COLOURS['green'], linewidth=1.2, label='noise')
    joints, begins, counts = np.unique([row['joint'] for row in rows], return_index=True,
                                       return_counts=True)
    for begin in sorted(begins)[1:]:
        axes.axvline(begin - 0.5, color=COLOURS['grey'], linewidth=0.6)
    if len(joints) > 1 or 'recording' not in rows[0]:
        axes.set_xticks(begins + 0.5 * (counts - 1), joints)
    elif len(rows) <= _MOST_LABELS:
        axes.set_xticks(x, [Path(row['recording']).name for row in rows],
                        rotation=30 if len(rows) > 4 else 0,
                        ha='right' if len(rows) > 4 else 'center')
    else:
        axes.set_xticks([])
        axes.set_xlabel('recordings, as in the table below')
    axes.set_yscale('log')
    legend_below(figure, 3)
    return figure


def _effect_rows(rows: list[dict[str, Any]], joints: list[str]) -> list[list[Any]]:
    table: list[list[Any]] = []
    for joint in joints:
        joint_rows = [row for row in rows if row['joint'] == joint]
        counts = Counter((effect['name'], effect['variable']) for row in joint_rows
                         for effect in {e['name']: e for e in row['effects']}.values())
        table.extend(
            [joint, name.replace('_', ' '), variable, count, len(joint_rows),
             'yes' if count > 1 and count >= _REPEATABLE * len(joint_rows) else 'no']
            for (name, variable), count in counts.most_common())
    return table or [['', 'none', '', None, len(rows), '']]


def arm_report(result: ArmResult, names: list[str], folders: dict[str, str]) -> Report:
    """Return the report; `names` are the recordings, `folders` those with each joint's page."""
    page = Report('What the friction models of an arm lacked', f'Refined on {", ".join(names)}')
    reports = {name: joint_result.report for name, joint_result in result.results.items()}
    unit = next(iter(reports.values())).unit
    errors = {name: (report.before.held_out_rmse, report.after.held_out_rmse, report.noise_floor)
              for name, report in reports.items()}
    page.verdict(_joint_verdicts(reports))
    page.table(
        ['joint', f'before ({unit})', f'after ({unit})', f'noise ({unit})', 'verdict', 'found'],
        [[Link(name, f'{folders[name]}/report.html'), *errors[name], report.verdict,
          effect_names(effect.name for effect in report.effects)]
         for name, report in reports.items()],
        'RMS of measured minus predicted on parts that were not fitted, by the initial model '
        'and by the refined one; each name links to the report on that joint.')
    page.figure(
        _errors_figure([dict(zip(('joint', 'before', 'after', 'noise_floor'), (name, *row)))
                        for name, row in errors.items()], unit),
        'The same on a logarithmic scale. What lies between the error after refinement and the '
        'noise is not explained yet.')
    page.heading('What was found, joint by joint')
    for name, report in reports.items():
        page.heading(name, 3)
        lines = [f'{effect.in_words}; with it the error is '
                 f'{number(effect.held_out_rmse)} {unit}' for effect in report.effects]
        lines += [f'Limits the verdict: {line}' for line in report.reasons
                  if report.verdict != 'trust']
        page.bullets(lines or ['Nothing.'])
    _add_links(page, result, unit)
    return page


def _joint_verdicts(reports: dict[str, RefinementReport]) -> str:
    """Return the verdicts on all joints as sentences."""
    kinds: dict[str, list[str]] = {}
    for name, report in reports.items():
        kinds.setdefault(report.verdict, []).append(name)
    less = [100.0 * (1.0 - report.after.held_out_rmse / report.before.held_out_rmse)
            for report in reports.values() if report.before.held_out_rmse > 0]
    listed = '; '.join(f'**{kind}**: {", ".join(kinds[kind])}' for kind in _VERDICTS
                       if kind in kinds)
    return f'Verdict by joint: {listed}.' + (
        f' The error on data not fitted is {min(less):.0f} to {max(less):.0f} % less than before.'
        if less else '')


def _add_links(page: Report, result: ArmResult, unit: str) -> None:
    arm = result.report()
    page.heading('Weight and inertia of the links')
    page.text(
        f"The joints' torques determine {arm['identifiable_parameters']} combinations of the "
        f"links' {10 * len(arm['joints'])} inertial parameters; the others stay as in the URDF. "
        'Only sums along the arm are certain: an error of one mass may be compensated by that of '
        'a neighbouring link, or by the current per torque where torque constants were not given.')
    page.table(
        ['joint', f'{unit} per N·m', f'friction and rotor alone ({unit})',
         f'with the links ({unit})'],
        [[row['joint'],
          _scale_text(row['current_per_torque'], row['intervals']['current_per_torque']),
          row['held_out_rmse_without'], row['held_out_rmse']] for row in arm['rigid_bodies']],
        'Current per torque with its 95 % interval, and errors on data not fitted, before any '
        'further effect was added.')
    page.table(
        ['link after joint', 'mass (kg)', 'URDF (kg)', 'from the recording',
         'first moment x, y, z (kg·m)', 'from the recording'],
        [[row['joint'], _with_interval(row['mass'], row['intervals']['mass']), row['mass_urdf'],
          _percent(row['told_by_recording']['mass']),
          '; '.join(_with_interval(value, bounds) for value, bounds in zip(
              row['first_moment'], row['intervals']['first_moment'])),
          ', '.join(_percent(value) for value in row['told_by_recording']['first_moment'])]
         for row in arm['rigid_bodies']],
        '95 % intervals are in brackets. "From the recording" is the share by which the '
        'recording reduces the uncertainty; below one half the value is that of the URDF and has '
        'no interval. All ten parameters of each link are in report.json.')
    page.bullets(arm['notes'])


def _with_interval(value: float, bounds: list[float | None]) -> str:
    return number(value) + ('' if bounds[0] is None else f' ({interval_text(bounds)})')


def _scale_text(value: float, bounds: list[float | None]) -> str:
    """Return a current per torque as text, or that the recording does not determine it."""
    low, high = bounds
    if low is None or high is None or high > _LARGEST_RATIO * low:
        return 'not determined' + ('' if low is None else f' ({interval_text(bounds)})')
    return _with_interval(value, bounds)


def _percent(value: float) -> str:
    return f'{100.0 * value:.0f} %'
