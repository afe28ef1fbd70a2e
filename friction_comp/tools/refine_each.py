# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``refine --each``: refines many recordings and joints separately."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from functools import partial
import os
from pathlib import Path
import time
from typing import Any

from friction_comp.attempts import Failure
from friction_comp.beside import interrupts_deferred
from friction_comp.errors import errors_name, InputError
from friction_comp.files import encodable, to_yaml
from friction_comp.tools.common import output_folder, progress, to_json
from friction_comp.tools.recorded_drive import drive_of, folder_name, layout_of, limited, unit_of
from friction_comp.tools.workers import for_workers, workers


@dataclass(frozen=True)
class Part:
    """One joint of one recording, and the folder for what is found of it."""

    path: Path
    joint: str | None
    folder: str

    def __str__(self) -> str:
        return str(self.path)


@dataclass(frozen=True)
class RefinedPart:
    """What was found: the report, the files by their names, and what it took."""

    report: dict[str, Any]
    files: dict[str, str]
    seconds: float


def refine_each(arguments: Namespace) -> int:
    """Refine each joint of each recording; write a folder for each, and one page on all.

    What is found is written as it comes, each folder whole or not at all: an interrupt, or a
    recording that cannot be used, costs no other.

    Parameters
    ----------
    arguments : Namespace
        Of the tool.

    Returns
    -------
    int
        0; 130 when it was interrupted.

    Raises
    ------
    InputError
        If no recording can be used, or an argument or the output cannot.
    """
    if arguments.urdf:
        raise InputError('--each and --urdf exclude each other: the links are fitted once for all')
    from friction_comp.reports.each_report import each_report

    arguments = for_workers(arguments)
    begin = time.monotonic()
    with progress('reading') as report:
        parts, failures = _parts(arguments)
        work = partial(_refined, arguments)
        rows: dict[int, dict[str, Any]] = {}
        interrupted = False
        try:
            with workers(arguments, len(parts)) as run:
                for index, outcome in run(work, parts) if parts else ():
                    part = parts[index]
                    if isinstance(outcome, Failure):
                        failures.append(outcome.reason)
                    else:
                        # What is written is counted.
                        with interrupts_deferred():
                            rows[index] = _kept(arguments.output, part, outcome)
                    done = len(rows) + len(failures)
                    report(done / len(parts), f'{done} of {len(parts)}: {part}')
        except KeyboardInterrupt:
            interrupted = True
        if not rows and not interrupted:
            raise InputError(failures[0])
        missing = len(parts) - len(rows) if interrupted else 0
        content = {
            'recordings': [rows[index] for index in sorted(rows)], 'failed': sorted(failures),
            'not_done': missing, 'seconds': time.monotonic() - begin}
        if rows:
            with output_folder(arguments.output) as folder:
                (folder / 'report.json').write_text(to_json(content), encoding='utf-8')
                each_report(content).save(folder / 'report.html')
    if arguments.json:
        print(to_json(content), end='')
        return 130 if interrupted else 0
    _print(content)
    if rows:
        print(arguments.output / 'report.html')
    return 130 if interrupted else 0


def _parts(arguments: Namespace) -> tuple[list[Part], list[str]]:
    """Return the parts that are refined separately, and why some recordings cannot be."""
    from friction_comp.recordings import find_recordings, recorded_joints

    recordings = find_recordings(arguments.recordings)
    above = Path(os.path.commonpath([path.absolute().parent for path in recordings]))
    parts: list[Part] = []
    failures = []
    taken: set[str] = set()
    for path in recordings:
        try:
            joints: list[str | None] = [arguments.joint] if arguments.joint else [
                *recorded_joints(path, layout_of(arguments))]
        except InputError as error:
            failures.append(str(error))
            continue
        name = '_'.join(path.absolute().relative_to(above).with_suffix('').parts)
        for joint in joints or [None]:
            folder = folder_name(f'{name}_{joint}' if len(joints) > 1 else name)
            while folder in taken:
                folder += '_'
            taken.add(folder)
            parts.append(Part(path, joint or None, folder))
    return parts, failures


def _refined(arguments: Namespace, part: Part) -> RefinedPart:
    """Refine one part, in whichever process this runs."""
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.recordings.condense import read_condensed
    from friction_comp.refinement import refine
    from friction_comp.reports.refinement_report import refinement_report

    begin = time.monotonic()
    model = FrictionModel.load(arguments.model, part.joint) if arguments.model else None
    drive = drive_of(arguments, model)
    (samples, info), = read_condensed(
        part.path, part.joint, drive.torque_constant, drive.gear_ratio,
        layout=layout_of(arguments))
    unit = unit_of(arguments, model, [info])
    drive, limit = limited(arguments, drive, [samples])
    with errors_name(f'{part.path}: {info.joint or "the joint"}'):
        result = refine([samples], model, drive, unit=unit)
    result.report['warnings'].extend(f'{info.path}: {note}' for note in info.notes)
    name = str(part.path)
    result.model.notes = {**result.model.notes, 'refined_from': [name], 'unit': unit, **limit}
    return RefinedPart(result.report, {
        'report.json': to_json(result.report), 'model.yaml': to_yaml(result.model.to_dict()),
        'report.html': refinement_report(result, [name]).html()}, time.monotonic() - begin)


def _kept(output: Path, part: Part, refined: RefinedPart) -> dict[str, Any]:
    """Write what was found of a part, and return its row of the page on all."""
    with output_folder(output / part.folder) as folder:
        for name, text in refined.files.items():
            (folder / name).write_text(encodable(text), encoding='utf-8')
    report = refined.report
    return {
        'recording': str(part.path), 'joint': report['joint'], 'folder': part.folder,
        'unit': report['unit'], 'samples': report['samples'], 'verdict': report['verdict'],
        'before': report['before']['held_out_rmse'], 'after': report['after']['held_out_rmse'],
        'noise_floor': report['noise_floor'],
        'effects': [{'name': effect['name'], 'variable': effect['variable']}
                    for effect in report['effects']],
        'unexplained': [entry['variable'] for entry in report['unexplained']],
        'seconds': refined.seconds}


def _print(content: dict[str, Any]) -> None:
    from friction_comp.reports.each_report import verdict
    from friction_comp.reports.html import number

    print(verdict(content).replace('**', ''))
    for row in content['recordings']:
        effects = ', '.join(effect['name'] for effect in row['effects']) or 'nothing'
        print(f"{row['folder']}: {number(row['before'])} → {number(row['after'])} {row['unit']}, "
              f"{row['verdict']}; found: {effects}")
    for reason in content['failed']:
        print(f'left out: {reason}')
