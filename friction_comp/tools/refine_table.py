# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine`` on a table of steady states: means at constant speeds, without times."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from typing import Any

import numpy as np

from friction_comp.errors import errors_name, InputError
from friction_comp.identification.curves import fit_steady_states, SteadyStates
from friction_comp.recorded_drive.refine_recordings import drive_of, figures_unit
from friction_comp.refinement import thresholds
from friction_comp.reports.other_pages import steady_state_page, steady_state_rows
from friction_comp.reports.refinement_page import next_steps, Row, step_lines, table_lines
from friction_comp.statistics import rms
from friction_comp.tables.columns import Column, read_name
from friction_comp.tables.table_files import Table
from friction_comp.terminal import in_own_units
from friction_comp.tools.common import given_of, write_results

_OTHER_OPTIONS = ('model', 'urdf', 'each', 'stiffness', 'rate')


def refine_table(arguments: Namespace, columns: tuple[Column, Column]) -> int:
    """Fit friction to a table and write report.json, report.html and model.yaml; returns 0."""
    path, = arguments.recordings
    given = next((name for name in _OTHER_OPTIONS if getattr(arguments, name)), None)
    if given:
        raise InputError(f'{path}: holds neither time nor position, only means at constant speeds: '
                         f'--{given} needs a recording')
    velocity, effort = columns
    table = Table(path)
    read = table.read([velocity.name, effort.name])
    speeds, torques = (column.factor * read[column.name] for column in columns)
    if not len(speeds):
        raise InputError(f'{path}: has no row below its header')
    told = given_of(arguments)
    drive = drive_of(told, None)
    in_ampere = effort.dimension == 'current'
    unit = figures_unit(told, in_ampere, velocity.dimension == 'length/time')
    if effort.stated and not effort.dimension:
        unit = effort.unit
    with errors_name(path):
        fit = fit_steady_states(
            speeds, torques / (1.0 if in_ampere else drive.torque_per_current), drive)
    limit = float(f'{np.max(np.abs(fit.currents)):.4g}')
    linear = velocity.dimension == 'length/time'
    model = replace(
        fit.model, drive=replace(drive, current_limit=limit),
        joint=arguments.joint or velocity.joint or effort.joint,
        notes={'refined_from': [str(path)], 'unit': unit,
               **({'position_unit': 'm'} if linear else {}),
               'current_limit': 'the largest current of the table'})
    fit = replace(fit, model=model)
    loads = [name for name in table.names if name != effort.name
             and read_name(name).signal in ('load', 'link_torque')]
    report = in_own_units(_report(fit, unit, loads), linear)
    report['warnings'] += table.notes
    steps = next_steps(report['verdict'], report['record_again'], ['breakaway', 'presliding'],
                       arguments.output)
    page = steady_state_page(report, fit.model, fit.speeds, fit.currents, str(path), steps)
    write_results(arguments, report, page, fit.model)
    table_of = [Row('', 'friction', 'value', '95 % interval', ''), *steady_state_rows(report)]
    print(*in_own_units([
        f'{path}: {len(fit.speeds)} constant speeds', '',
        f"{report['verdict'].upper()}: {report['reasons'][0]}",
        *(f'  {line}' for line in report['reasons'][1:]), '', *table_lines(table_of), '',
        *(f'note: {line}' for line in report['warnings']), '', *step_lines([
            ('look', str(arguments.output / 'report.html')), *steps])], linear), sep='\n')
    return 0


def _report(fit: SteadyStates, unit: str, loads: list[str]) -> dict[str, Any]:
    signal = rms(fit.currents)
    low, high = fit.intervals['coulomb']
    pushes = high < 0.0
    # Whether a reason applies, the reason, and what to record.
    doubts = [(reason, record) for applies, reason, record in (
        (pushes, 'Friction would have to push: effort or velocity has the wrong sign, or the '
         'torque is that of a brake.',
         'the same with the sign of effort reversed (--unit effort=-1Nm)'),
        ('offset' not in fit.values, 'Motion was in one direction only: Coulomb friction cannot be '
         'distinguished from an offset.', 'move in both directions'),
        (low <= 0.0 <= high, 'Coulomb friction cannot be distinguished from zero.',
         'more and slower speeds'),
        (loads, f'{" and ".join(loads)}: not taken into account, so that what the joint carried '
         'counts as friction.', 'the joint without a load'),
        (fit.is_curved, f'The remaining error, {fit.fit_rmse:.2g} {unit} RMS, depends on the '
         'speed: friction has another form than Coulomb, viscous and Stribeck friction.',
         'a log of motion, in which refine finds other forms'),
        (fit.left_out_rmse > thresholds.UNEXPLAINED * signal,
         f'{fit.left_out_rmse:.2g} {unit} of {signal:.2g} {unit} remain unexplained.',
         'each speed several times, over the same range of positions')) if applies]
    found = [effect.name for effect in fit.model.effects]
    return {
        'unit': unit, 'joint': fit.model.joint, 'samples': len(fit.speeds),
        'held_out': 'each row, predicted by a fit to all others', 'signal_rms': signal,
        'before': {'model': 'Coulomb and viscous friction', 'held_out_rmse': fit.plain_rmse},
        'after': {'model': ' + '.join(['sigmoid of Eq. 6', *found]), 'fit_rmse': fit.fit_rmse,
                  'held_out_rmse': fit.left_out_rmse},
        'noise_floor': None,
        'effects': [{**effect.to_dict(), 'intervals': {}, 'chosen': None}
                    for effect in fit.model.effects],
        'friction': {**fit.values, 'intervals': fit.intervals},
        'unexplained': [], 'ambiguous': [],
        'verdict': 'record again' if pushes else 'trust in part' if doubts else 'trust',
        'reasons': [reason for reason, _ in doubts] or [
            'Each row of the table is predicted by the others.'],
        'record_again': [record for _, record in doubts],
        'warnings': ['inertia, weight and breakaway do not show in means at constant speeds'],
        'stopped_because': "Akaike's criterion prefers no further term"}
