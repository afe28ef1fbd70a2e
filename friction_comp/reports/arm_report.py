# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The page on a whole arm."""

from __future__ import annotations

from friction_comp.refinement.whole_arm import ArmResult
from friction_comp.reports.html import number, Report


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
    page.table(
        ['joint', f'before ({unit})', f'after ({unit})', f'noise ({unit})', 'found'],
        [[name, report['before']['held_out_rmse'], report['after']['held_out_rmse'],
          report['noise_floor'],
          ', '.join(effect['name'].replace('_', ' ') for effect in report['effects']) or 'nothing']
         for name, report in reports.items()],
        'RMS of measured minus predicted on stretches that were not fitted, by the start model '
        'and by the refined one.')
    for name, report in reports.items():
        found = '\n'.join(f"- {effect['in_words']} ({number(effect['held_out_rmse'])} {unit})"
                          for effect in report['effects'])
        page.heading(name)
        page.text(f'{found}\n\n' * bool(found) + f'The whole report: '
                  f'`{folders[name]}/report.html`.')
    _bodies(page, result, unit)
    return page


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
        [[row['joint'], _within(row['current_per_torque'], row['intervals']['current_per_torque']),
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


def _share(value: float) -> str:
    return f'{100.0 * value:.0f} %'
