# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --fleet``: fits one unit more, with the population of its type as prior."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace

from friction_comp.errors import errors_name, InputError
from friction_comp.fleet.new_unit import fit_new_unit
from friction_comp.fleet.population import read_fleet
from friction_comp.recorded_drive.given import drive_of, unit_of, with_current_limit
from friction_comp.recorded_drive.refine_recordings import showing_friction
from friction_comp.recordings.condense import read_condensed
from friction_comp.reports.fleet_report import new_unit_report, new_unit_verdict
from friction_comp.tools.common import print_results, write_results
from friction_comp.tools.refine_arguments import given_of


def refine_new_unit(arguments: Namespace) -> int:
    """Fit a unit with its population as prior; write report and model, and return 0."""
    found = read_fleet(arguments.fleet, arguments.joint)
    if len(found) > 1:
        raise InputError(f'{arguments.fleet}: has the joints '
                         f'{", ".join(one.joint for one in found)}: choose one with --joint')
    population = found[0]
    like = population.model
    given = given_of(arguments)
    drive = drive_of(given, like)
    recordings = read_condensed(
        arguments.recordings, arguments.joint, drive.torque_per_current, layout=given.layout)
    like.check_joint(recordings[0][1].joint, arguments.fleet)
    constants = arguments.torque_constant or arguments.gear_ratio
    # The effort of the fleet's recordings is in the unit of its file unless constants were given.
    unit = unit_of(given, None, [info for _, info in recordings]) if (
        drive.torque_per_current == 1.0 and not constants) else 'A'
    if unit != population.unit:
        raise InputError(f'{arguments.fleet}: is in {population.unit}, the recording in {unit}')
    usable, = showing_friction({arguments.joint or '': recordings}).values()
    recorded = [samples for samples, _ in usable]
    drive, limit = with_current_limit(given, drive, recorded)
    declared = bool(constants) or unit == 'N·m' or drive.torque_per_current != 1.0
    with errors_name(arguments.recordings[0]):
        new = fit_new_unit(recorded, population, drive, declared)
    model = replace(new.model, notes={
        'fleet': str(arguments.fleet), 'unit': unit, **limit,
        'refined_from': [str(path) for path in arguments.recordings]})
    content = {
        'joint': population.joint, 'unit': unit, 'units': len(population.units), 'out': new.out,
        'coefficients': [
            {'name': name, 'value': float(value), 'interval': ends,
             'population': mean, 'told_by_recording': float(told), 'p': float(p)}
            for name, value, ends, mean, told, p in zip(
                new.names, new.values, new.intervals.tolist(), population.prior.mean, new.told,
                new.p)],
        'held_out_rmse': {'population': new.population_error, 'recording_alone': new.alone_error,
                          'with_population': new.error}}
    write_results(arguments, content, new_unit_report(new, population), model)
    return print_results(arguments, content, [new_unit_verdict(new, population).replace('**', '')])
