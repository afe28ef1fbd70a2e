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
         f'with the links ({unit})', 'mass of the link (kg)', 'URDF (kg)'],
        [[row['joint'], row['current_per_torque'], row['held_out_rmse_without'],
          row['held_out_rmse'], row['mass'], row['mass_urdf']] for row in arm['rigid_bodies']],
        'Errors on stretches not fitted, before any further effect was looked for.')
    if arm['notes']:
        page.text('\n'.join(f'- {line}' for line in arm['notes']))
