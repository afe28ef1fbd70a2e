# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds recordings on disk, and opens rosbag2 recordings and tables in the same way."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
import math
from os import PathLike
from pathlib import Path

from friction_comp.errors import InputError, os_errors_name
from friction_comp.recordings.scan import read_bag, Scan
from friction_comp.recordings.storage import AnyPath, is_storage, METADATA
from friction_comp.tables.columns import Layout
from friction_comp.tables.table_files import is_table, parts_of, TABLES
from friction_comp.tables.table_recording import TableRecording

Progress = Callable[[float], None]
Recording = Scan | TableRecording
"""A bag or a table: its joints, those moved with one, and the samples of one."""

# Number of messages in which each joint occurs at least once, even with several publishers.
_FIRST_MESSAGES = 200
# What to do with other files: sheets have formulas and notes, and bags of ROS 1 other messages.
_WORKBOOK = 'a workbook: save its sheet as CSV, and give that file'
_OTHERS = {**dict.fromkeys(('.xlsx', '.xlsm', '.xls', '.ods'), _WORKBOOK),
           '.bag': 'a bag of ROS 1: rosbags-convert --src {} --dst {}'}


def part_of(progress: Progress | None, index: int, count: int) -> Progress:
    """Return a function that reports one recording's progress as a part of that of all."""
    def report(share: float) -> None:
        if progress:
            progress((index + share) / count)
    return report


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
        if is_storage(path) or is_table(path):
            yield path
    elif not path.is_dir():
        raise InputError(f'{path}: not a regular file')
    elif (path / METADATA).is_file():
        yield path
    else:
        for child in sorted(path.iterdir()):
            # A hidden folder may be an unfinished recording. Tables in folders are results rather
            # than recordings.
            if not child.name.startswith('.') and (child.is_dir() or is_storage(child)):
                yield from _expand(child)


def open_recording(path: AnyPath, joint: str | None = None, layout: Layout | None = None,
                   progress: Progress | None = None, first: float = math.inf) -> Recording:
    """Return a bag's content or a table; `joint` may name a topic of joint states of any name.

    Of a bag, only the beginning is read until there are `first` joint states.
    """
    path = Path(path)
    if is_table(path) and not path.is_dir():
        return TableRecording(path, layout)
    layout = layout or Layout()
    units = layout.of_states
    if (layout.columns or layout.units or layout.rate or layout.stiffness) and not units:
        raise InputError(f'{path}: --columns, --rate, --stiffness, and units of other signals than '
                         'position, velocity and effort, which is in N·m, N or A, describe tables, '
                         'and this is none: the tool convert makes one')
    return read_bag(path, joint, units, progress or (lambda share: None), first)


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
    recording = open_recording(path, layout=layout, first=_FIRST_MESSAGES)
    return [*recording.joints] if isinstance(recording, Scan) else recording.choices


@dataclass(frozen=True)
class Piece:
    """One joint of one recording, or the whole recording where the joint is None."""

    path: Path
    joint: str | None
    layout: Layout | None = None

    def __str__(self) -> str:
        return str(self.path)


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
            pieces.extend(Piece(path, name or None, layout) for name in names)
    return pieces, failures
