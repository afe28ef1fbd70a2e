# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads CSV, Parquet and npz files as recordings.

The rows of a table are read as if they were messages: each block of rows becomes the same kind of
tracks as a rosbag2 recording, so that all other code works on tables without changes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
import gzip
import io
from itertools import islice
from pathlib import Path
import re
from typing import Any, IO

import numpy as np

from friction_comp.columns import assign, Assignment, Layout, TABLES, to_numbers
from friction_comp.errors import InputError
from friction_comp.files import write_atomically
from friction_comp.recordings.scan import Scan, Track
from friction_comp.recordings.storage import unreadable_on_error
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS

# Topic that corresponds to each column of a table besides the joint states and the reference.
_TOPICS = {'load': 'interaction_wrench', 'temperature': 'motor_temperature',
           'command': 'current_command', 'direction': 'direction'}
_SIGNALS = ('position', 'velocity', 'effort', 'command', 'direction', 'load', 'temperature',
            'reference_position', 'reference_velocity')
# Magnitude above which a number is no time, s: 64 bits hold no more in ns.
_LATEST = 9e9
Columns = dict[str, np.ndarray]


def is_table(path: Path) -> bool:
    """Return whether a file is a table, judging by its name."""
    return path.name.lower().endswith(TABLES)


class TableScanner:
    """Reads a table block by block; the counterpart of `MessageScanner`."""

    # A batch of 250,000 rows takes 20 MB for ten columns.
    def __init__(self, path: Path, layout: Layout | None = None, joint: str | None = None,
                 batch: int = 250_000) -> None:
        self.progress = 0.0
        self._path, self._joint, self._batch = path, joint, batch
        name = path.name.lower()
        kind = _Parquet if name.endswith('.parquet') else _Npz if name.endswith('.npz') else _Csv
        with unreadable_on_error(path):
            self._table: _Csv | _Parquet | _Npz = kind(path)
        self._use = assign(self._table.names, layout, str(path))

    def scans(self) -> Iterator[Scan]:
        """Yield a scan of each block of rows."""
        wanted = [column.name for column in self._use.columns]
        rows = 0
        with unreadable_on_error(self._path):
            for columns, share in self._table.blocks(wanted, self._batch):
                self.progress = share
                size = len(columns[wanted[0]])
                if size:
                    self._check_time(columns[self._use.time.name])
                    tracks = list(_tracks(columns, self._use, rows, self._joint))
                    rows += size
                    yield Scan(self._path, tracks,
                               {track.topic: (TOPICS[track.topic], rows) for track in tracks},
                               list(self._use.notes),
                               effort_is_current=self._use.effort_is_current)
        if not rows:
            raise InputError(f'{self._path}: has no row below its header')

    def _check_time(self, values: np.ndarray) -> None:
        """Raise InputError if no number in the column can be a time."""
        time = self._use.time
        finite = values[np.isfinite(values)]
        if not finite.size or (np.abs(time.factor * finite) < _LATEST).any():
            return
        raise InputError(
            f'{self._path}: column {time.name!r} holds values such as {finite[0]:.4g}, which are '
            f'no times in {time.unit}: its unit can be given, for instance --unit time=ns')


def _tracks(columns: Columns, use: Assignment, first: int, joint: str | None) -> Iterator[Track]:
    """Yield the tracks of a block of rows; `first` is the number of its first row."""
    stamp, valid = _stamps(use.time.factor * columns[use.time.name])
    order = first + np.arange(len(stamp))
    missing = np.full(len(stamp), np.nan)

    def read(signal: str, name: str) -> np.ndarray | None:
        column = use.of(signal, name)
        return None if column is None else column.factor * columns[column.name]

    def stack(name: str, *signals: str) -> np.ndarray:
        parts = [read(signal, name) for signal in signals]
        return np.column_stack([missing if values is None else values for values in parts])

    def track(topic: str, values: Columns) -> Track:
        return Track(topic, topic, stamp, stamp, order, use.joints, values)

    yield track('joint_states', {
        name: np.where(valid[:, None], stack(name, 'position', 'velocity', 'effort'), np.nan)
        for name in use.joints if joint in (None, name) or not name})
    for signal, topic in _TOPICS.items():
        values = {name: own[:, None] for name in use.joints
                  if (own := read(signal, name)) is not None}
        if values and topic in ('current_command', 'direction'):
            values = {'': np.hstack([values.get(name, missing[:, None]) for name in use.joints])}
        if values:
            yield track(topic, values)
    references = {name: stack(name, 'reference_position', 'reference_velocity')
                  for name in use.joints if use.of('reference_position', name) is not None}
    if references:
        yield track('reference', references)


def _stamps(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Convert times in s to ns; also return which rows have a valid time.

    The other rows get the time of the row before, so that time does not jump.
    """
    valid = np.abs(time) < _LATEST
    stamp = np.zeros(len(time), dtype=np.int64)
    stamp[valid] = np.round(1e9 * time[valid]).astype(np.int64)
    if valid.any():
        index = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), -1))
        stamp = stamp[np.where(index >= 0, index, np.argmax(valid))]
    return stamp, valid


class _Csv:
    """A text file with one row per line; the separator is the most frequent one in its header."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with path.open('rb') as file:
            lines = list(islice(self._text(file), 200))
        if any('\0' in line for line in lines):
            raise InputError(f'{path}: not a text file')
        # Skip comments before the header; numpy.savetxt writes the header itself as a comment.
        header = next((k for k, line in enumerate(lines) if line.strip()
                     and not line.startswith('#')), len(lines))
        head = lines[header] if header < len(lines) else ''
        if not head.strip():
            raise InputError(f'{path}: is empty')
        self._separator = _separator(head)
        self.names = self._split(head)
        self._skip = header + 1
        if _all_numbers(head):
            # Not a header: names are in the comment above it, otherwise columns are numbered.
            comment = self._split(lines[header - 1].lstrip('# ')) if header else []
            fits = len(comment) == len(self.names)
            self.names = comment if fits else [str(k + 1) for k in range(len(self.names))]
            self._skip = header
        if len(set(self.names)) < len(self.names):
            duplicate = next(name for name in self.names if self.names.count(name) > 1)
            raise InputError(f'{path}: has two columns called {duplicate!r}')

    def _split(self, line: str) -> list[str]:
        if self._separator is None:
            return line.split()
        cells = next(csv.reader([line.rstrip('\r\n')], delimiter=self._separator), [])
        return [cell.strip() for cell in cells]

    def _text(self, file: IO[bytes]) -> IO[str]:
        """Return the text of the opened file."""
        compressed = self._path.name.lower().endswith('.gz')
        plain: Any = gzip.GzipFile(fileobj=file) if compressed else file
        return io.TextIOWrapper(plain, encoding='utf-8-sig', errors='replace', newline='')

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        """Yield blocks of columns and the share of the file that has been read."""
        indices = [self.names.index(name) for name in wanted]
        size = self._path.stat().st_size
        with self._path.open('rb') as file:
            text = self._text(file)
            first_line = sum(1 for _ in islice(text, self._skip))
            while lines := list(islice(text, rows)):
                columns = self._parse(lines, indices, first_line).T
                # The position in the file, which may be compressed.
                yield dict(zip(wanted, columns)), file.tell() / size
                first_line += len(lines)

    def _parse(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        """Return the selected cells, shape (rows, columns)."""
        if self._separator != ',':
            # A comma that does not separate is a decimal one.
            lines = [line.replace(',', '.') for line in lines]
        try:
            return np.loadtxt(lines, delimiter=self._separator, usecols=indices, ndmin=2,
                              comments=None)
        except ValueError:
            # Cells are missing or not numeric: parse slowly, with a clear error.
            return self._parse_each(lines, indices, first_line)

    def _parse_each(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        rows = []
        for k, line in enumerate(lines, first_line + 1):
            if line.strip() and not line.startswith('#'):
                cells = self._split(line)
                # The last line of a truncated file has fewer cells.
                complete = len(cells) > max(indices)
                rows.append([self._number(cells[index], index, k) if complete else np.nan
                             for index in indices])
        return np.array(rows).reshape(len(rows), len(indices))

    def _number(self, cell: str, index: int, line: int) -> float:
        if cell.lower() in ('', 'nan', 'na', 'null', 'none', '-'):
            return float('nan')
        try:
            return float(cell)
        except ValueError:
            raise InputError(f'{self._path}: line {line}, column {self.names[index]!r}: {cell!r} '
                             'is not a number') from None


def _separator(line: str) -> str | None:
    """Return the separator of a line, None for white space."""
    counts = {mark: line.count(mark) for mark in ('\t', ';', ',')}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else None


def _all_numbers(line: str) -> bool:
    return bool(re.fullmatch(r'[\s\d.,;+\-eEnaN]+', line)) and bool(re.search(r'\d', line))


class _Parquet:
    """A Parquet file, read with pyarrow."""

    def __init__(self, path: Path) -> None:
        self._file, self._path = _pyarrow(path).parquet.ParquetFile(path), path
        self.names: list[str] = list(self._file.schema_arrow.names)

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        read, total = 0, max(self._file.metadata.num_rows, 1)
        for batch in self._file.iter_batches(batch_size=rows, columns=list(dict.fromkeys(wanted))):
            read += batch.num_rows
            yield {name: to_numbers(batch.column(name).to_numpy(zero_copy_only=False), name,
                                    self._path) for name in wanted}, read / total


def _pyarrow(path: Path) -> Any:
    """Return the library for Parquet files; raises InputError if it is not installed."""
    try:
        import pyarrow.parquet
    except ModuleNotFoundError:
        raise InputError(f'{path}: Parquet files need pyarrow: pip install '
                         '"friction_comp[parquet]", or pip install pyarrow') from None
    return pyarrow


class _Npz:
    """A file of NumPy arrays; the columns of a 2-D array are called NAME_1 and so on."""

    def __init__(self, path: Path) -> None:
        self._columns: Columns = {}
        self._path = path
        with np.load(path, allow_pickle=False) as file:
            for name, values in file.items():
                if values.ndim == 1:
                    self._columns[name] = values
                elif values.ndim == 2:
                    self._columns.update({f'{name}_{k + 1}': column
                                          for k, column in enumerate(values.T)})
        self.names = list(self._columns)

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        sizes = {name: len(self._columns[name]) for name in wanted}
        size = sizes[wanted[0]]
        if set(sizes.values()) != {size}:
            raise InputError(f'{self._path}: its arrays differ in length: ' + ', '.join(
                f'{name} {count}' for name, count in sizes.items()))
        for first in range(0, size, rows):
            part = slice(first, first + rows)
            yield ({name: to_numbers(self._columns[name][part], name, self._path)
                    for name in wanted}, min((first + rows) / size, 1.0))


def table_of(joints: Sequence[Samples]) -> dict[str, np.ndarray]:
    """Return samples of joints on one time base as columns, such as ``elbow.position``.

    Their `current` must be the effort in N·m, as read with k_t = n = 1.
    """
    columns = {'time': joints[0].time}
    for samples in joints:
        prefix = f'{samples.joint}.' if samples.joint else ''
        for name in _SIGNALS:
            values = getattr(samples, 'current' if name == 'effort' else name)
            if values is not None:
                columns[prefix + name] = values
    return columns


def write_table(path: Path, joints: Sequence[Samples]) -> None:
    """Write the columns of `table_of` as CSV, Parquet or npz, depending on the file name.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    columns = table_of(joints)
    name = path.name.lower()
    stream = io.BytesIO()
    if name.endswith('.npz'):
        np.savez_compressed(stream, **columns)  # type: ignore[arg-type] # its allow_pickle
    elif name.endswith('.parquet'):
        arrow = _pyarrow(path)
        arrow.parquet.write_table(arrow.table(columns), stream)
    elif name.endswith('.csv'):
        stream.write((','.join(columns) + '\n').encode())
        np.savetxt(stream, np.column_stack(list(columns.values())), delimiter=',',
                   fmt=['%.9f', *['%.12g'] * (len(columns) - 1)])
    else:
        raise InputError(f'{path}: a table is .csv, .parquet or .npz')
    write_atomically(path, stream.getvalue())
