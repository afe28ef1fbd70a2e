# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds recordings on disk, and reads them as samples: bags and tables in the same way.

Of long or many recordings, a few samples at a time are averaged, all signals over the same ones, so
that they are filtered alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import reduce
import math
from os import PathLike
from pathlib import Path
from typing import NamedTuple, TYPE_CHECKING, TypeAlias

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError, os_errors_name
from friction_comp.files import AnyPath
from friction_comp.recordings import BAGS, METADATA
from friction_comp.samples import JointStates, RecordingInfo, Samples
from friction_comp.tables.columns import Layout, STATES, unit_of
from friction_comp.tables.table_files import is_table, parts_of, TABLES
from friction_comp.tables.table_recording import TableRecording

if TYPE_CHECKING:
    from friction_comp.recordings.bag import Bag

    Recording: TypeAlias = Bag | TableRecording

Progress = Callable[[float], None]

# Number of messages in which each joint occurs at least once, even with several publishers.
_FIRST_MESSAGES = 200
# What to do with other files.
_OTHERS = {
    **dict.fromkeys(('.xlsx', '.xlsm', '.xls', '.ods'), 'a workbook: save its sheet as CSV'),
    '.bag': 'a bag of ROS 1: rosbags-convert --src {} --dst {}'}
LIMIT = 400_000
"""Most samples of one fit: about 600 MB of working memory, ten times most recordings."""


def find_recordings(paths: AnyPath | Sequence[AnyPath]) -> list[Path]:
    """Return the recordings at paths, and in folders at any depth in the order of their names.

    Tables are recordings only if `paths` name them, several joined by a plus as one. Raises
    InputError if a path does not exist or has no recording.
    """
    unique: dict[Path, Path] = {}
    given = list(map(Path, [paths] if isinstance(paths, (str, PathLike)) else paths))
    for path in given:
        with os_errors_name(path, 'cannot be read: '):
            if not all(part.exists() for part in parts_of(path)):
                raise InputError(f'{path}: no such file or folder')
            recordings = list(_expand(path))
        if not recordings:
            kind = 'no recording in this folder; tables must be named' if path.is_dir() else (
                _OTHERS.get(path.suffix.lower(), 'not a recording (a rosbag2 folder, an .mcap file '
                            f'or a table is needed: {", ".join(TABLES)})'))
            raise InputError(f'{path}: {kind.format(path, path.with_suffix(""))}')
        for recording in recordings:
            unique.setdefault(recording.resolve(), recording)
    if not unique:
        raise InputError('no recording given')
    return list(unique.values())


def find_recording(path: AnyPath) -> Path:
    """Return the only recording at a path; raises InputError if there are none or several."""
    recordings = find_recordings(path)
    if len(recordings) != 1:
        raise InputError(f'{path}: contains {len(recordings)} recordings, expected one')
    return recordings[0]


def size_of(path: Path) -> int:
    """Return the size of a recording, a file or a folder, in bytes."""
    files = path.rglob('*') if path.is_dir() else parts_of(path)
    return sum(file.stat().st_size for file in files if file.is_file())


def _expand(path: Path) -> Iterator[Path]:
    if all(part.is_file() for part in parts_of(path)):
        if path.name.endswith(BAGS) or is_table(path):
            yield path
    elif not path.is_dir():
        raise InputError(f'{path}: not a regular file')
    elif (path / METADATA).is_file():
        yield path
    else:
        for child in sorted(path.iterdir()):
            # A hidden folder may be an unfinished recording. Tables in folders are results rather
            # than recordings.
            if not child.name.startswith('.') and (child.is_dir() or child.name.endswith(BAGS)):
                yield from _expand(child)


def open_recording(path: AnyPath, joint: str | None = None, layout: Layout | None = None,
                   first: float = math.inf) -> Recording:
    """Return a bag or a table: its joints, those moved with one, and the samples of one.

    `joint` may name a topic of joint states of any name. Of a bag, only the beginning is read until
    there are `first` joint states.
    """
    path = Path(path)
    if is_table(path) and not path.is_dir():
        return TableRecording(path, layout)
    # A table needs none of it.
    from friction_comp.recordings.bag import Bag

    layout = layout or Layout()
    units = {signal: unit for signal, text in layout.units.items() if signal in STATES
             and (unit := unit_of(signal, text)) is not None}
    if len(units) < len(layout.units) or layout.columns or layout.rate or layout.stiffness:
        raise InputError(f'{path}: --columns, --rate, --stiffness, and units of other signals than '
                         'position, velocity and effort, which is in N·m, N or A, describe tables, '
                         'and this is none: the tool convert makes one')
    return Bag(path, joint, units, first)


def without_topic(path: AnyPath, joint: str | None) -> str | None:
    """Return the name of a recording's joint that may be given as /TOPIC/NAME."""
    if not (joint or '').startswith('/'):
        return joint
    recording = open_recording(path, joint, first=_FIRST_MESSAGES)
    return joint if isinstance(recording, TableRecording) else recording.find(joint)[1]


def recorded_joints(path: AnyPath, layout: Layout | None = None) -> list[str]:
    """Return the joints in a recording's first joint states, '' for one without a name.

    Those in several topics are /TOPIC/NAME. If the layout names the columns of one joint, it is
    that joint only. Raises InputError if the recording cannot be read.
    """
    return open_recording(path, layout=layout, first=_FIRST_MESSAGES).choices


class Piece(NamedTuple):
    """One joint of one recording, or the whole recording where the joint is None."""

    path: Path
    joint: str | None


def pieces_of(paths: Sequence[str | Path], joint: str | None = None,
              layout: Layout | None = None) -> tuple[list[Piece], list[str]]:
    """Return the pieces that can be used, and the reasons why other recordings cannot.

    `paths` are recordings or folders of them, `layout` has the columns of tables.
    """
    pieces: list[Piece] = []
    failures: list[str] = []
    for path in find_recordings([Path(path) for path in paths]):
        try:
            names = [joint] if joint is not None else recorded_joints(path, layout) or ['']
        except InputError as error:
            failures.append(str(error))
        else:
            pieces.extend(Piece(path, name or None) for name in names)
    return pieces, failures


def read_recording(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                   torque_constant: float = 1.0, gear_ratio: float = 1.0,
                   progress: Progress | None = None, layout: Layout | None = None
                   ) -> list[Samples]:
    """Read recordings of one joint.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, .mcap files, tables (CSV, Parquet, npz), or folders of recordings that are
        no tables.
    joint : str, optional
        Name of the joint; required if a recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n: current is effort / (k_t · n).
    progress : callable, optional
        Called with the share 0..1 of all recordings that has been read.
    layout : Layout, optional
        Known columns and units of a table, of which others are told by their names; or units of
        position, velocity and effort in joint states.

    Returns
    -------
    list of Samples
        One per recording, each with `recording` set to its index. Time starts at the recording's
        first joint state. If a recording has several joints, `arm` is the motion of all.

    Raises
    ------
    InputError
        If a path, the joint, or a recording cannot be used; the text names it and says why.
    """
    return [samples for samples, _ in read_recording_with_info(
        paths, joint, Drive(torque_constant, gear_ratio).torque_per_current, progress, layout)]


def read_recording_with_info(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                             torque_per_current: float = 1.0, progress: Progress | None = None,
                             layout: Layout | None = None, limit: float = math.inf
                             ) -> list[tuple[Samples, RecordingInfo]]:
    """Return what `read_recording` does, with information on each recording.

    `torque_per_current` is k_t · n in N·m/A. More than about `limit` samples of all recordings
    together are averaged, and a note says so.
    """
    recordings, length = find_recordings(paths), 0
    sizes = [size_of(path) for path in recordings]
    read: dict[int, tuple[Samples, RecordingInfo]] = {}
    # By the largest one, it is known how many samples there are.
    for done, index in enumerate(sorted(range(len(sizes)), key=lambda k: -sizes[k])):
        recording = open_recording(recordings[index], joint, layout)
        samples, info = recording.samples(joint, torque_per_current)
        names = recording.siblings(joint)
        if len(names) > 1:
            samples = samples.with_(arm=_arm(samples, info, _usable_joints(recording, names)))
        if progress:
            progress((done + 1) / len(recordings))
        if not length:
            total = len(samples) * sum(sizes) / max(sizes[index], 1)
            length = max(math.ceil(total / limit), 1)
        kept = samples.with_(recording=np.full(len(samples), index)).averaged(length)
        if not len(kept):
            raise InputError(f'{info.path}: has too few samples of joint {info.joint!r}')
        if length > 1:
            info.stamps = info.rows = None
        read[index] = kept, info
    first = read[0][1]
    for index in range(len(recordings)):
        if (info := read[index][1]).joint != first.joint:
            raise InputError(f'{info.path}: contains joint {info.joint!r}, but {first.path} '
                             f'contains {first.joint!r}: name one with --joint')
    if length > 1:
        first.notes.append(f'the recordings are long: {length} samples at a time were averaged')
    return [read[index] for index in range(len(recordings))]


def _usable_joints(recording: Recording, names: Iterable[str],
                   torque_per_current: Callable[[str], float] = lambda joint: 1.0
                   ) -> dict[str, tuple[Samples, RecordingInfo]]:
    """Return the joints that are usable; the first one notes the others. InputError if none is."""
    read: dict[str, tuple[Samples, RecordingInfo]] = {}
    faults: list[InputError] = []
    wanted: list[str | None] = [*names] or [None]
    for name in wanted:
        try:
            entry = recording.samples(name, torque_per_current(name or ''))
        except InputError as error:
            # An arm is usable even if, for instance, its gripper has no effort.
            faults.append(error)
            continue
        if entry[1].joint in read:
            raise InputError(f'{recording.path}: joint {entry[1].joint!r} is in several topics: '
                             f'name one with --joint: {", ".join(recording.joints)}')
        read[entry[1].joint] = entry
    if not read:
        raise faults[-1]
    next(iter(read.values()))[1].notes[:0] = [f'left out: {fault}' for fault in faults]
    return read


def _arm(samples: Samples, info: RecordingInfo,
         joints: dict[str, tuple[Samples, RecordingInfo]]) -> JointStates:
    """Return the motion of all `joints`, interpolated to the times of one joint's `samples`."""
    positions, speeds = [], []
    for other, other_info in joints.values():
        # Topics may begin at different times.
        time = samples.time + (info.start - other_info.start)
        positions.append(np.interp(time, other.time, other.position))
        if other.velocity is not None:
            speeds.append(np.interp(time, other.time, other.velocity))
    return JointStates(tuple(joints), np.column_stack(positions),
                       np.column_stack(speeds) if len(speeds) == len(positions) else None)


def read_arm(paths: AnyPath | Sequence[AnyPath],
             torque_per_current: Callable[[str], float] = lambda joint: 1.0,
             progress: Progress | None = None, layout: Layout | None = None
             ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Read every joint with an effort, as `read_recording` does: an entry for each recording.

    `torque_per_current` returns k_t · n in N·m/A for a joint's name. The samples have the motion of
    all joints as `arm`. Raises InputError if a recording cannot be used, or their joints differ.
    """
    result: dict[str, list[tuple[Samples, RecordingInfo]]] = {}
    recordings = find_recordings(paths)
    for index, path in enumerate(recordings):
        recording = open_recording(path, layout=layout)
        joints = _usable_joints(recording, recording.joints, torque_per_current)
        if progress:
            progress((index + 1) / len(recordings))
        if result and set(joints) != set(result):
            name = sorted(set(joints) ^ set(result))[0]
            raise InputError(f'{path}: joint {name!r} is not in all recordings: an arm needs the '
                             'same joints in each')
        for name, (samples, info) in joints.items():
            samples = samples.with_(recording=np.full(len(samples), index),
                                    arm=_arm(samples, info, joints))
            result.setdefault(name, []).append((samples, info))
    return result


def read_joints(path: AnyPath, joint: str | None = None, layout: Layout | None = None
                ) -> tuple[list[Samples], RecordingInfo]:
    """Read one or all usable joints of one recording at the times at which all are usable.

    `current` is the effort in N·m, as with k_t = n = 1; the information is that of the first joint,
    with the notes on all. Raises InputError if the recording or a joint cannot be used.
    """
    path = find_recording(path)
    read = read_recording_with_info(path, joint, layout=layout) if joint is not None else [
        own for own, in read_arm(path, layout=layout).values()]
    first = read[0][1]
    # In µs since the first joint's start: joints of several topics may begin at different times.
    times = [np.round(1e6 * (samples.time + (info.start - first.start))) for samples, info in read]
    common = reduce(np.intersect1d, times)
    if not len(common):
        raise InputError(f'{path}: the joints {", ".join(info.joint for _, info in read)} never '
                         'have values together')
    joints = [samples.take(np.searchsorted(time, common))
              for (samples, _), time in zip(read, times)]
    first.notes = list(dict.fromkeys(note for _, info in read for note in info.notes))
    return [samples.with_(time=joints[0].time) for samples in joints], first


def without_compensation(samples: Samples, info: RecordingInfo) -> Samples:
    """Return the samples during which no compensation law drove the motor; note what is left out.

    Under a law the current follows its model: without the load, it says nothing about friction.
    """
    begins = [begin for begin, _ in info.activity]
    active = np.array([False, *(activity.state == 'active' and activity.law not in ('', 'none')
                                for _, activity in info.activity)])
    compensated = active[np.searchsorted(begins, samples.time, 'right')]
    if not compensated.any():
        return samples
    info.notes.append(
        f'{100.0 * compensated.mean():.0f} % of the samples left out: a compensation law drove the '
        'motor, and without the load its current does not show the friction')
    return samples.take(~compensated)
