# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a whole arm."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.reports.each_report import errors_figure
from friction_comp.reports.html import Link, number, Report
from friction_comp.reports.refinement_report import effect_names

if TYPE_CHECKING:
    from friction_comp.refinement.whole_arm import ArmResult

# Largest ratio of an interval's ends up to which a current per torque counts as known.
_LARGEST_RATIO = 3.0


def arm_report(result: ArmResult, names: list[str], folders: dict[str, str]) -> Report:
    """Return the page on an `ArmResult`.

    `names` are those of the recordings, `folders` contain each joint's own page.
    """
    page = Report('What the friction models of an arm lacked', f'Refined on {", ".join(names)}')
    reports = {name: joint_result.report for name, joint_result in result.results.items()}
    unit = next(iter(reports.values()))['unit']
    errors = [{'before': report['before']['held_out_rmse'],
               'after': report['after']['held_out_rmse'], 'noise_floor': report['noise_floor']}
              for report in reports.values()]
    page.verdict(verdict(reports))
    page.table(
        ['joint', f'before ({unit})', f'after ({unit})', f'noise ({unit})', 'verdict', 'found'],
        [[Link(name, f'{folders[name]}/report.html'), *row.values(), report['verdict'],
          effect_names(report['effects'])]
         for (name, report), row in zip(reports.items(), errors)],
        'RMS of measured minus predicted on parts that were not fitted, by the initial model '
        'and by the refined one; each name links to the report on that joint.')
    page.figure(
        errors_figure([{'joint': name, **row} for name, row in zip(reports, errors)], unit),
        'The same on a logarithmic scale: the distance from the error after refinement to the '
        'noise is not explained yet.', 'Errors before and after, and the noise, of each joint')
    page.heading('What was found, joint by joint')
    for name, report in reports.items():
        page.heading(name, 3)
        lines = [f"{effect['in_words']}; with it the error is "
                 f"{number(effect['held_out_rmse'])} {unit}" for effect in report['effects']]
        lines += [f'Limits the verdict: {line}' for line in report['reasons']
                  if report['verdict'] != 'trust']
        page.bullets(lines or ['Nothing.'])
    _add_bodies(page, result, unit)
    return page


def verdict(reports: dict[str, dict[str, Any]]) -> str:
    """Return the verdicts on all joints in words."""
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


def _add_bodies(page: Report, result: ArmResult, unit: str) -> None:
    arm = result.report()
    page.heading('Weight and inertia of the links')
    page.text(
        f"The joints' torques show {arm['identifiable_parameters']} combinations of the links' "
        f"{10 * len(arm['joints'])} inertial parameters; the others stay as in the URDF. Only "
        'sums along the arm are certain: a mass that differs from the URDF may be compensated by '
        "its neighbour's, or by the current per torque where torque constants were not given.")
    page.table(
        ['joint', f'{unit} per N·m', f'friction and rotor alone ({unit})',
         f'with the links ({unit})'],
        [[row['joint'],
          _scale_text(row['current_per_torque'], row['intervals']['current_per_torque']),
          row['held_out_rmse_without'], row['held_out_rmse']] for row in arm['rigid_bodies']],
        'Current per torque with its 95 % interval; errors on parts not fitted, before any '
        'further effect was added.')
    page.table(
        ['link after joint', 'mass (kg)', 'URDF (kg)', 'told by the recording',
         'first moment x, y, z (kg·m)', 'told by the recording'],
        [[row['joint'], _with_interval(row['mass'], row['intervals']['mass']), row['mass_urdf'],
          _percent(row['told_by_recording']['mass']),
          '; '.join(_with_interval(value, bounds) for value, bounds in zip(
              row['first_moment'], row['intervals']['first_moment'])),
          ', '.join(_percent(value) for value in row['told_by_recording']['first_moment'])]
         for row in arm['rigid_bodies']],
        '95 % intervals are in brackets. "Told by the recording" is the share by which the '
        "recording reduces the uncertainty; below one half the number is the URDF's and has no "
        'interval. All ten parameters of each link are in report.json.')
    page.bullets(arm['notes'])


def _with_interval(value: float, bounds: list[float | None]) -> str:
    """Return a number with its interval if there is one."""
    if bounds[0] is None:
        return number(value)
    return f'{number(value)} ({number(bounds[0])} to {number(bounds[1])})'


def _scale_text(value: float, bounds: list[float | None]) -> str:
    """Return a current per torque as text, or that the recording does not determine it."""
    low, high = bounds
    if low is None or high is None or high > _LARGEST_RATIO * low:
        ends = '' if low is None else f' ({number(low)} to {number(high)})'
        return f'not told{ends}'
    return _with_interval(value, bounds)


def _percent(value: float) -> str:
    return f'{100.0 * value:.0f} %'
