# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines a model on recordings of one joint, and writes what was found to a folder."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.errors import errors_name, InputError
from friction_comp.files import output_folder
from friction_comp.recorded_drive.given import drive_of, Given, unit_of, with_current_limit
from friction_comp.results import write_report

if TYPE_CHECKING:
    from friction_comp.refinement import RefineResult
    from friction_comp.samples import RecordingInfo, Samples


def refine_to_folder(given: Given, paths: Sequence[Path], output: Path, command: str,
                     show: Callable[..., None]) -> RefineResult:
    """Refine a model; write report.json, report.html with the command, and model.yaml."""
    result = refine_recordings(given, paths, show)
    show(0.9, 'writing')
    from friction_comp.reports.refinement_page import refinement_page

    page = refinement_page(result, list(map(str, paths)), output)
    with output_folder(output) as folder:
        write_report(folder, result.content(), page, command)
        result.model.save(folder / 'model.yaml')
    return result


def refine_recordings(given: Given, paths: Sequence[Path],
                      show: Callable[..., None] = lambda *_: None) -> RefineResult:
    """Refine a model on recordings of one joint together.

    `show` is called with the share 0..1 that is done and a description.
    """
    from friction_comp.recordings.reader import read_condensed

    joint, model = given.joint, None
    if given.model:
        from friction_comp.model.friction_model import FrictionModel
        from friction_comp.recordings.reader import find_recordings, recorded_joints, without_topic

        first = find_recordings(paths)[0]
        model = FrictionModel.load(given.model, joint and without_topic(first, joint))
        if not joint and model.joint in recorded_joints(first, given.layout):
            joint = model.joint
    drive = drive_of(given, model)
    recordings = read_condensed(
        paths, joint, drive.torque_per_current,
        lambda share: show(0.2 * share, 'reading'), given.layout)
    if model and given.model:
        model.check_joint(recordings[0][1].joint, given.model)
    unit = unit_of(given, model, [info for _, info in recordings])
    usable, = showing_friction({joint or '': recordings}).values()
    recorded = [samples for samples, _ in usable]
    if idle := model is None and _idle(given, recorded):
        unit = 'N·m'
    drive, limit = with_current_limit(given, drive, recorded)
    # Only now: importing the search takes longer than reading most recordings, and an unusable one
    # is refused at once.
    from friction_comp.refinement import Origin, refine

    # Without its constants, a drive does not tell how much current a recorded load takes.
    known = (model or given.torque_constant or given.gear_ratio or unit in ('N·m', 'N') or idle)
    origin = Origin(unit, bool(known), notes_on(recordings, idle), assumed_in(given, recordings), {
        'refined_from': [str(path) for path in paths], **given.of_table, **limit,
        **({'position_unit': 'm'} if any(info.linear for _, info in recordings) else {})})
    with errors_name(f'{paths[0]}: {joint}' if joint else paths[0]):
        return refine(
            recorded, model, drive, origin=origin,
            progress=lambda share, name: show(0.2 + 0.7 * share, name))


def notes_on(recordings: Iterable[tuple[Samples, RecordingInfo]], idle: bool = False) -> list[str]:
    """Return the notes on recordings as warnings of a report; `idle` is that of the motor."""
    paths: dict[str, list[Path]] = {}
    for _, info in recordings:
        for note in info.notes:
            paths.setdefault(note, []).append(info.path)
    return [f'{own[0]}{f" and {len(own) - 1} more" * (len(own) > 1)}: {note}'
            for note, own in paths.items()] + [
        'the motor was idle: friction is what the load (torque sensor) overcame, in N·m'] * idle


def assumed_in(given: Given, recordings: Iterable[tuple[Samples, RecordingInfo]]) -> list[str]:
    """Return the units of tables that are taken for granted, with what tells against them."""
    spans: dict[tuple[str, bool], float] = {}
    steps: dict[tuple[str, bool], list[float]] = {}
    for samples, info in recordings:
        columns = [one for one in info.assumed if not (given.figures and 'N·m' in one)]
        if not columns or len(samples) < 2:
            continue
        key = ', '.join(columns), info.linear
        spans[key] = max(float(np.ptp(samples.position)), spans.get(key, 0.0))
        steps.setdefault(key, []).append(samples.sample_time)
    return [f'{columns} (position covers {span:.3g} {"m" if linear else "rad"}'
            f'{"" if linear else _in_other_units(span)}; rows are '
            f'{_between(steps[columns, linear])} ms apart); --unit gives others'
            for (columns, linear), span in spans.items()]


def _in_other_units(span: float) -> str:
    """Return a range, rad, in turns, and what it is otherwise: a joint seldom turns so far."""
    return f', {span / 6.2832:.2g} turns' + (
        f', or {span / 57.296:.3g} rad if these are degrees, {6.2832 * span:.3g} if turns'
        if span > 6.2832 else '')


def _between(steps: list[float]) -> str:
    """Return the least and the largest of times, s, in ms; one if they are about the same."""
    least, largest = 1e3 * min(steps), 1e3 * max(steps)
    return f'{least:.3g} to ' * (largest > 1.05 * least) + f'{largest:.3g}'


def _idle(given: Given, recorded: Sequence[Samples]) -> bool:
    """Return whether the motor had no current and a load moved the joint: then the unit is N·m."""
    return (not given.torque_constant and not given.figures and all(
        samples.load is not None and not samples.current.any() for samples in recorded))


def showing_friction(recorded: Mapping[str, list[tuple[Samples, RecordingInfo]]]
                     ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Return what of the joints' recordings shows friction; raises InputError if nothing does.

    Unless all loads were recorded, it is what no compensation law drove. Joints of an arm keep the
    same recordings, since they are fitted together.
    """
    from friction_comp.recordings.joint_samples import without_compensation

    for parts in recorded.values():
        _check_loads((info.path, samples) for samples, info in parts)
    if all(samples.load is not None for parts in recorded.values() for samples, _ in parts):
        return dict(recorded)
    rest = {joint: [(without_compensation(samples, info), info) for samples, info in parts]
            for joint, parts in recorded.items()}
    kept = [all(len(samples) for samples, _ in parts) for parts in zip(*rest.values())]
    if not any(kept):
        path = next(iter(recorded.values()))[0][1].path
        raise InputError(
            f'{path}: a compensation law drove the motor, so the current shows its model and not '
            'the friction. Record the load (topic interaction_wrench), or move the joint by its '
            'motor without the compensator')
    return {joint: list(compress(parts, kept)) for joint, parts in rest.items()}


def _check_loads(recorded: Iterable[tuple[object, Samples]]) -> None:
    """Raise InputError if only some recordings (name, samples) have a load: all would lose it."""
    names = {samples.load is not None: name for name, samples in recorded}
    if len(names) > 1:
        raise InputError(f'{names[True]}: has a load (interaction_wrench), and {names[False]} has '
                         'none: refine them separately')
