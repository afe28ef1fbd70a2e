# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is told of a recorded drive, and its refinement from recordings.

What follows from what is told are the drive, its limit and its unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import errors_name, InputError
from friction_comp.tables.columns import Layout, unit_of as unit_named

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.refinement import RefineResult
    from friction_comp.samples import RecordingInfo, Samples


@dataclass(frozen=True)
class Given:
    """What is told of the recordings of a joint; all of it is optional."""

    joint: str | None = None
    model: Path | None = None  # to start from
    torque_constant: float | None = None
    gear_ratio: float | None = None
    figures: str | None = None  # unit of the figures in the report
    layout: Layout = field(default_factory=Layout)  # of a table
    of_table: dict[str, Any] = field(default_factory=dict)  # its arguments, for the model file


def drive_of(given: Given, model: FrictionModel | None) -> Drive:
    """Return the model's drive, in which given constants replace its own, or a drive of these.

    Without a model and constants, the effort of the recordings is taken as current.
    """
    constants: dict[str, Any] = {name: value for name, value in (
        ('torque_constant', given.torque_constant), ('gear_ratio', given.gear_ratio))
        if value is not None}
    if model is not None:
        return replace(model.drive, **constants)
    if len(constants) == 1:
        raise InputError('--torque-constant and --gear-ratio belong together: give 1 for the one '
                         'that effort already contains')
    return Drive(**{'torque_constant': 1.0, 'gear_ratio': 1.0, **constants})


def with_current_limit(given: Given, drive: Drive, recorded: list[Samples]
                       ) -> tuple[Drive, dict[str, str]]:
    """Return the drive with its current limit, and a note on the origin of the limit.

    It is that of the model given, else the largest current that lasted, which the drive has
    withstood.
    """
    largest = max(map(_largest_lasting_current, recorded), default=0.0)
    if given.model or not largest > 0.0:
        return drive, {}
    return (replace(drive, current_limit=float(f'{largest:.4g}')),
            {'current_limit': 'the largest current that lasted in the recordings'})


def _largest_lasting_current(samples: Samples) -> float:
    """Return the largest magnitude of running medians, A; 0 where no current is finite."""
    size = np.abs(samples.current[np.isfinite(samples.current)])
    # Over 0.05 s, which removes single wrong samples.
    half = max(round(0.025 / max(samples.sample_time, 1e-6)), 1)
    if len(size) <= 2 * half:
        return float(np.median(size)) if size.size else 0.0
    windows = np.lib.stride_tricks.sliding_window_view(size, 2 * half + 1)[::max(half // 2, 1)]
    return float(np.median(windows, axis=1).max())


def unit_of(given: Given, model: FrictionModel | None, infos: Sequence[RecordingInfo] = ()) -> str:
    """Return the unit of the fitted signal: A if the drive is known, else that of the effort.

    The user's comes first, then the drive's, the recordings', and that in the name of the column.
    """
    if model is not None and not (given.figures or given.torque_constant or given.gear_ratio):
        return str(model.notes.get('unit', 'A'))
    recorded = next((info.effort_unit for info in infos if info.effort_unit), '')
    if recorded and not given.figures:
        return recorded
    return figures_unit(given, any(info.effort_is_current for info in infos),
                        any(info.linear for info in infos))


def figures_unit(given: Given, in_ampere: bool, linear: bool) -> str:
    """Return the unit without a model; `linear` is whether positions are lengths."""
    if given.figures:
        return str(given.figures)
    if given.torque_constant is not None or given.gear_ratio is not None or in_ampere:
        return 'A'
    text = given.layout.units.get('effort', 'N' if linear else 'N·m')
    unit = unit_named('effort', text)
    # A unit that is no torque, such as 0.1 %, is kept as it is.
    return text if unit is None else {'torque': 'N·m', 'force': 'N', 'current': 'A'}[unit.dimension]


def refine_recordings(given: Given, paths: Sequence[Path],
                      show: Callable[..., None] = lambda *_: None) -> RefineResult:
    """Refine a model on recordings of one joint together.

    `show` is called with the share 0..1 that is done and a description.
    """
    from friction_comp.recordings.reader import LIMIT, read_recording_with_info

    joint, model = given.joint, None
    if given.model:
        from friction_comp.model.friction_model import FrictionModel
        from friction_comp.recordings.reader import find_recordings, recorded_joints, without_topic

        first = find_recordings(paths)[0]
        model = FrictionModel.load(given.model, joint and without_topic(first, joint))
        if not joint and model.joint in recorded_joints(first, given.layout):
            joint = model.joint
    drive = drive_of(given, model)
    recordings = read_recording_with_info(
        paths, joint, drive.torque_per_current,
        lambda share: show(0.2 * share, 'reading'), given.layout, limit=LIMIT)
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
    read: dict[tuple[str, str], list[Samples]] = {}
    for samples, info in recordings:
        columns = [one for one in info.assumed if not (given.figures and 'N·m' in one)]
        if columns and len(samples) > 1:
            read.setdefault((', '.join(columns), 'm' if info.linear else 'rad'), []).append(samples)
    return [f'{columns} (position covers {max(np.ptp(one.position) for one in own):.3g} {unit}; '
            f'rows are {1e3 * own[0].sample_time:.3g} ms apart); --unit gives others'
            for (columns, unit), own in read.items()]


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
    from friction_comp.recordings.reader import without_compensation

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
