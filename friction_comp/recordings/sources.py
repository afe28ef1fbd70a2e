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
from friction_comp.recordings.storage import AnyPath, is_split_recording, is_storage, METADATA
from friction_comp.tables.columns import Layout, STATES
from friction_comp.tables.table_files import is_table, parts_of, TABLES
from friction_comp.tables.table_recording import TableRecording

Progress = Callable[[float], None]

# Number of messages in which each joint occurs at least once, even with several publishers.
_FIRST_MESSAGES = 200
# Files of spreadsheets, which hold several sheets, formulas and notes.
_WORKBOOKS = ('.xlsx', '.xlsm', '.xls', '.ods')


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
            kind = 'not a recording (a rosbag2 folder, an .mcap file or a table is needed: ' \
                f'{", ".join(TABLES)})'
            if path.is_dir():
                kind = 'no recording in this folder' + _tables_in(path)
            elif path.suffix.lower() in _WORKBOOKS:
                kind = 'a workbook: save its sheet as CSV, and give that file'
            raise InputError(f'{path}: {kind}')
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


def _tables_in(folder: Path) -> str:
    table = next((file for file in sorted(folder.rglob('*'))
                  if is_table(file) and file.is_file()), None)
    if table is None:
        return ''
    depth = len(table.relative_to(folder).parts) - 1
    pattern = folder.joinpath(*['*'] * depth, f'*{table.suffix}')
    return f'; tables must be named, for instance with {pattern}'


def _expand(path: Path) -> Iterator[Path]:
    if all(part.is_file() for part in parts_of(path)):
        if is_storage(path) or is_table(path):
            yield path
    elif not path.is_dir():
        raise InputError(f'{path}: not a regular file')
    elif (path / METADATA).is_file() or is_split_recording(path):
        yield path
    else:
        for child in sorted(path.iterdir()):
            # A hidden folder may be an unfinished recording. Tables in folders are results rather
            # than recordings.
            if not child.name.startswith('.') and (child.is_dir() or is_storage(child)):
                yield from _expand(child)


def open_recording(path: AnyPath, joint: str | None = None, layout: Layout | None = None,
                   others: bool = True, progress: Progress | None = None, first: float = math.inf
                   ) -> Scan | TableRecording:
    """Return a bag's content or a table: of all joints or `joint`, with `others` if wanted.

    Of a bag, only the beginning is read until there are `first` joint states.
    """
    path = Path(path)
    if is_table(path) and not path.is_dir():
        return TableRecording(path, layout)
    layout = layout or Layout()
    units = layout.of_states
    if (layout.columns or layout.units or layout.rate) and not units:
        if {*layout.units} <= {*STATES} and not (
                layout.columns or layout.rate or layout.stiffness):
            raise InputError(f'{path}: joint states have effort in N·m, N or A, not in '
                             f'{layout.units["effort"]}; the unit alone, as in refine --unit V, '
                             'is that of the figures')
        raise InputError(f'{path}: --columns, --rate, and units of other signals than position, '
                         'velocity and effort describe tables, and this is none')
    if layout.stiffness:
        raise InputError(f'{path}: --stiffness and --damping need a table: convert the recording '
                         'with the tool convert')
    return read_bag(path, joint, others, units, progress or (lambda share: None), first)


def without_topic(path: AnyPath, joint: str | None) -> str | None:
    """Return the name of a recording's joint that may be given as /TOPIC/NAME."""
    path = Path(path)
    if not (joint or '').startswith('/') or (is_table(path) and not path.is_dir()):
        return joint
    return read_bag(path, joint, first=_FIRST_MESSAGES).chosen(joint)[1]


def recorded_joints(path: AnyPath, layout: Layout | None = None) -> list[str]:
    """Return the joints in a recording's first joint states, '' for one without a name.

    Those in several topics are /TOPIC/NAME. If the layout names the columns of one joint, it is
    that joint only. Raises InputError if the recording cannot be read.
    """
    return open_recording(path, layout=layout, first=_FIRST_MESSAGES).choices


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
    found = find_recordings([Path(path) for path in paths])
    for index, path in enumerate(found):
        own = layout and layout.of_recording(index, len(found))
        try:
            names = [joint] if joint is not None else recorded_joints(path, own) or ['']
        except InputError as error:
            failures.append(str(error))
        else:
            pieces.extend(Piece(path, name or None, own) for name in names)
    return pieces, failures
