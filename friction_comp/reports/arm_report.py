# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a whole arm."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.reports.figures import COLOURS, new_figure, styled
from friction_comp.reports.html import Link, number, Report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from friction_comp.refinement.whole_arm import ArmResult

# A current per torque whose interval is wider than by this factor is not known.
_TELLS = 3.0


def arm_report(result: ArmResult, names: list[str], folders: dict[str, str]) -> Report:
    """Return the page on an `ArmResult`.

    Parameters
    ----------
    result : ArmResult
    names : list of str
        Of the recordings.
    folders : dict of str to str
        Where each joint's own page is.

    Returns
    -------
    Report
    """
    page = Report('What the friction models of an arm lacked', f'Refined on {", ".join(names)}')
    reports = {name: one.report for name, one in result.results.items()}
    unit = next(iter(reports.values()))['unit']
    page.verdict(verdict(reports))
    page.table(
        ['joint', f'before ({unit})', f'after ({unit})', f'noise ({unit})', 'verdict', 'found'],
        [[Link(name, f'{folders[name]}/report.html'), report['before']['held_out_rmse'],
          report['after']['held_out_rmse'], report['noise_floor'], report['verdict'],
          ', '.join(effect['name'].replace('_', ' ') for effect in report['effects']) or 'nothing']
         for name, report in reports.items()],
        'RMS of measured minus predicted on stretches that were not fitted, by the start model '
        'and by the refined one; each name leads to the whole report on that joint.')
    page.figure(
        _errors(reports),
        'The same, as shares of the current in motion: what is left of the way from the start to '
        'the noise is not explained yet. The scale is logarithmic.',
        'Errors before and after, and the noise, of every joint')
    page.heading('What was found, joint by joint')
    for name, report in reports.items():
        page.heading(name, 3)
        lines = [f"- {effect['in_words']}; then {number(effect['held_out_rmse'])} {unit} are left"
                 for effect in report['effects']]
        lines += [f'- Why not more trust: {line}' for line in report['reasons']
                  if report['verdict'] != 'trust']
        page.text('\n'.join(lines or ['Nothing.']))
    _bodies(page, result, unit)
    return page


def verdict(reports: dict[str, dict[str, Any]]) -> str:
    """Return in words what came of all joints.

    Parameters
    ----------
    reports : dict of str to dict
        Joint to its report.
    """
    kinds: dict[str, list[str]] = {}
    for name, report in reports.items():
        kinds.setdefault(report['verdict'], []).append(name)
    less = [100.0 * (1.0 - report['after']['held_out_rmse'] / report['before']['held_out_rmse'])
            for report in reports.values() if report['before']['held_out_rmse'] > 0]
    words = '; '.join(f'**{kind}**: {", ".join(kinds[kind])}' for kind in (
        'trust', 'trust in part', 'record again') if kind in kinds)
    change = f' The error on data not fitted is {min(less):.0f} to {max(less):.0f} % less than ' \
             'before.' if less else ''
    return f'Verdict by joint: {words}.{change}'


@styled
def _errors(reports: dict[str, dict[str, Any]]) -> Figure:
    """Draw the errors of every joint as shares of its current, told apart by shape and colour."""
    from matplotlib.ticker import PercentFormatter

    figure, axes = new_figure(height=0.9 + 0.32 * len(reports))
    rows = range(len(reports))
    series = (
        ('before', 'o', 'grey', [one['before']['held_out_rmse'] for one in reports.values()]),
        ('after', 's', 'blue', [one['after']['held_out_rmse'] for one in reports.values()]),
        ('noise', '|', 'orange', [one['noise_floor'] for one in reports.values()]))
    signal = [max(one['signal_rms'], 1e-300) for one in reports.values()]
    for index, one in enumerate(zip(*(values for *_, values in series))):
        axes.plot([one[0] / signal[index], one[1] / signal[index]], [index, index],
                  color=COLOURS['grey'], linewidth=1.2, zorder=1)
    for label, marker, colour, values in series:
        axes.plot([value / whole for value, whole in zip(values, signal)], rows, marker,
                  color=COLOURS[colour], markersize=9 if marker != '|' else 13,
                  markeredgewidth=2.4 if marker == '|' else 0, label=label, linestyle='none')
    axes.set_xscale('log')
    axes.xaxis.set_major_formatter(PercentFormatter(1.0))
    axes.set_yticks(list(rows), list(reports))
    axes.set_ylim(len(reports) - 0.5, -0.5)
    axes.set_xlabel('error as a share of the RMS of the current in motion')
    axes.grid(visible=False, axis='y')
    axes.legend(loc='lower center', bbox_to_anchor=(0.5, 1.0), ncols=3)
    return figure


def _bodies(page: Report, result: ArmResult, unit: str) -> None:
    arm = result.report()
    page.heading('Weight and inertia of the links')
    page.text(
        f"The joints' torques show {arm['identifiable_parameters']} combinations of the links' "
        f"{10 * len(arm['joints'])} inertial parameters; what they do not show stays as the URDF "
        'has it. Only sums along the arm are known for sure: a mass that differs from the URDF may '
        'be made up for by its neighbour, and by the current per torque where torque constants '
        'were not given.')
    page.table(
        ['joint', f'{unit} per N·m', f'friction and rotor alone ({unit})',
         f'with the links ({unit})'],
        [[row['joint'], _scale(row['current_per_torque'], row['intervals']['current_per_torque']),
          row['held_out_rmse_without'], row['held_out_rmse']] for row in arm['rigid_bodies']],
        'Current per torque with its 95 % interval; errors on stretches not fitted, before any '
        'further effect was looked for.')
    page.table(
        ['link after joint', 'mass (kg)', 'URDF (kg)', 'told by the recording',
         'first moment x, y, z (kg·m)', 'told by the recording'],
        [[row['joint'], _within(row['mass'], row['intervals']['mass']), row['mass_urdf'],
          _share(row['told_by_recording']['mass']),
          '; '.join(_within(value, bounds) for value, bounds in zip(
              row['first_moment'], row['intervals']['first_moment'])),
          ', '.join(_share(value) for value in row['told_by_recording']['first_moment'])]
         for row in arm['rigid_bodies']],
        'In brackets 95 % intervals. What is told by the recording is the part of the uncertainty '
        "before that is gone; below half of it the number is the URDF's, and the recording gives "
        'no interval. All ten parameters of each link, inertias too, are in report.json.')
    if arm['notes']:
        page.text('\n'.join(f'- {line}' for line in arm['notes']))


def _within(value: float, bounds: list[float | None]) -> str:
    """Return a number with its interval, if it has one."""
    if bounds[0] is None:
        return number(value)
    return f'{number(value)} ({number(bounds[0])} to {number(bounds[1])})'


def _scale(value: float, bounds: list[float | None]) -> str:
    """Return a current per torque, or that the recording does not determine it."""
    low, high = bounds
    if low is None or high is None or high > _TELLS * low:
        ends = '' if low is None else f' ({number(low)} to {number(high)})'
        return f'not told{ends}'
    return _within(value, bounds)


def _share(value: float) -> str:
    return f'{100.0 * value:.0f} %'
