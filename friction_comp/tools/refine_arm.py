# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine`` with a URDF: all joints of an arm."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from friction_comp.arm.fit import ArmResult, refine_arm
from friction_comp.errors import InputError
from friction_comp.files import output_folder, read_yaml, write_report
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import joints_of, write_arm
from friction_comp.recorded_drive.refine_recordings import (
    assumed_in,
    drive_of,
    notes_on,
    showing_friction,
    with_current_limit,
)
from friction_comp.recordings.reader import read_arm
from friction_comp.refinement import Origin
from friction_comp.reports.other_pages import arm_page
from friction_comp.reports.refinement_page import (
    refinement_page,
    refusal,
    step_lines,
    summary_lines,
)
from friction_comp.terminal import progress
from friction_comp.tools.common import folder_names, given_of


def refine_whole_arm(arguments: Namespace) -> int:
    """Refine the joints of an arm and write their reports and models; return 0.

    Each has a folder next to the files of the whole arm.
    """
    if arguments.figures not in (None, 'A', 'N·m', 'Nm'):
        raise InputError(f'--unit: with --urdf effort is in A or N·m, not in {arguments.figures}')
    given = arguments.torque_constant is not None or arguments.gear_ratio is not None
    models, known = _start_models(arguments), given_of(arguments)
    names = [str(path) for path in arguments.recordings]
    with progress('reading') as report:
        recordings = read_arm(
            arguments.recordings,
            lambda name: drive_of(known, models.get(name)).torque_per_current,
            lambda share: report(0.1 * share), known.layout)
        if '' in recordings:
            raise InputError(f'{names[0]}: names no joint: give its name in the URDF with --joint')
        unknown = [name for name in models if name not in recordings]
        if unknown:
            raise InputError(f'{arguments.model}: is of joint {unknown[0]!r}, but recorded are '
                             f'{", ".join(map(repr, recordings))}')
        recorded = {name: [samples for samples, _ in parts]
                    for name, parts in showing_friction(recordings).items()}
        drives, limits = {}, {}
        for name, parts in recorded.items():
            drives[name], limits[name] = with_current_limit(
                known, drive_of(known, models.get(name)), parts)
        in_ampere = given or models or arguments.figures == 'A' or any(
            info.effort_is_current for parts in recordings.values() for _, info in parts)
        origins = {name: Origin(
            warnings=notes_on(recordings[name]), assumed=assumed_in(known, recordings[name]),
            notes={'refined_from': names, 'urdf': str(arguments.urdf), **limits[name]})
            for name in recorded}
        try:
            result = refine_arm(
                recorded, arguments.urdf, drives, models, recorded if given else models,
                [arguments.joint] if arguments.joint else None,
                lambda share, word: report(0.1 + 0.8 * share, word), not in_ampere, origins)
        except InputError as error:
            # Name the recording, unless a file is named already.
            named = str(error).startswith((str(arguments.urdf), names[0]))
            raise InputError(f'{"" if named else f"{names[0]}: "}{error}') from None
        report(0.9, 'writing')
        with output_folder(arguments.output) as folder:
            _write(folder, result, names, arguments)
    print(*(f'note: {line}' for line in result.notes), *(
        line for name, one in result.results.items()
        for line in (f'{name}:', *summary_lines(one.report))),
        *step_lines(_next_steps(result, arguments.output / 'model.yaml')),
        arguments.output / 'report.html', sep='\n')
    return 0


def _next_steps(result: ArmResult, model: Path) -> list[tuple[str, str]]:
    record = dict.fromkeys(line for one in result.results.values()
                           for line in one.report.record_again)
    steps = [('record', line) for line in record]
    usable = [name for name, one in result.results.items()
              if one.report.verdict != 'record again']
    if usable:
        refused = [('compensate', f'{name} not with this file: {reason}') for name in usable
                   if (reason := refusal(result.results[name].model))]
        steps += [('check', f'python3 -m friction_comp predict OTHER --model {model} --joint '
                   f'{usable[0]} --output current.csv'), *(refused or [
                       ('compensate', f'joints [{", ".join(usable)}], and {model} for each in '
                        'model_files')])]
    return steps


def _start_models(arguments: Namespace) -> dict[str, FrictionModel]:
    if not arguments.model:
        return {}
    joints = joints_of(read_yaml(arguments.model))
    if joints is None:
        model = FrictionModel.load(arguments.model)
        model.check_joint(arguments.joint, arguments.model)
        joint = arguments.joint or model.joint
        if not joint:
            raise InputError(f'{arguments.model}: names no joint: give it with --joint')
        return {joint: model}
    return {name: FrictionModel.load(arguments.model, name) for name in joints}


def _write(folder: Path, result: ArmResult, names: list[str], arguments: Namespace) -> None:
    """Write the files of each joint, and those of the whole arm."""
    reports = {name: one.report.content() for name, one in result.results.items()}
    folders = dict(zip(reports, folder_names(reports)))
    for name, one in result.results.items():
        (folder / folders[name]).mkdir(exist_ok=True)
        write_report(folder / folders[name], reports[name], refinement_page(
            one, names, arguments.output / folders[name]), arguments.command)
        one.model.save(folder / folders[name] / 'model.yaml')
    whole = {'unit': next(iter(result.results.values())).report.unit, 'arm': result.report(),
             'joints': reports}
    write_report(folder, whole, arm_page(result, names, folders), arguments.command)
    write_arm(folder / 'model.yaml', {name: one.model for name, one in result.results.items()})
