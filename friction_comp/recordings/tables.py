# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads CSV, Parquet and npz files as recordings.

One principle: **a table is read as if its rows were messages**. Each block of rows becomes the same
tracks as those of a rosbag2 recording, so that checking, streaming, refinement and evaluation work
on tables without changes.
"""

from __future__ import annotations

from collections.abc import Iterator
import csv
import gzip
from pathlib import Path
import re
from typing import Any, IO
import zipfile

import numpy as np

from friction_comp.columns import assign, Assignment, Layout, TABLES
from friction_comp.errors import InputError, one_line
from friction_comp.recordings.scan import Scan, Track
from friction_comp.recordings.storage import unreadable
from friction_comp.topics import TOPICS

# Rows in memory at once: 20 MB for ten columns.
_BLOCK = 250_000
# Topics of the other signals of a table.
_TOPICS = {'load': 'interaction_wrench', 'temperature': 'motor_temperature',
           'command': 'current_command', 'direction': 'direction'}
Columns = dict[str, np.ndarray]


def is_table(path: Path) -> bool:
    """Return whether a file is, by its name, a table."""
    return path.name.lower().endswith(TABLES)


class TableScanner:
    """Reads a table block by block; the counterpart of `friction_comp.recordings.scan.Scanner`.

    Parameters
    ----------
    path : Path
    layout : Layout, optional
        Columns and units given by the user.
    joint : str, optional
        Keep only this joint's values.
    block : int
        Rows per block.
    """

    def __init__(self, path: Path, layout: Layout | None = None, joint: str | None = None,
                 block: int = _BLOCK) -> None:
        self.path = path
        self.stores: dict[str, Any] = {}
        self.progress = 0.0
        self._joint = joint
        self._block = block
        self._rows = 0
        self._tracks: list[Track] = []
        self._notes: list[str] = []
        try:
            self._table = _open(path)
        except OSError as error:
            raise InputError(f'{path}: cannot be read: {error.strerror or error}') from None
        self._use = assign(self._table.names, layout, str(path))
        self._notes += self._use.notes

    def batches(self) -> Iterator[_Block]:
        """Read the table, and yield after each block."""
        wanted = [column.name for column in self._use.columns]
        try:
            for columns, share in self._table.blocks(wanted, self._block):
                size = len(columns[wanted[0]])
                if size:
                    self._tracks.append(
                        _joint_state_track(columns, self._use, self._rows, self._joint))
                    self._tracks += _other_tracks(columns, self._use, self._rows)
                    self._rows += size
                    self.progress = share
                    yield _Block()
        except InputError:
            raise
        except (OSError, EOFError, ValueError, zipfile.BadZipFile) as error:
            raise unreadable(self.path, one_line(error)) from None
        if not self._rows:
            raise InputError(f'{self.path}: holds no row below its header')

    def finish(self) -> Scan:
        """Return what was read since the beginning, or since the last call."""
        topics: dict[str, list[Track]] = {}
        for track in self._tracks:
            topics.setdefault(track.topic, []).append(track)
        self._tracks = []
        return Scan(self.path, [_concatenate(parts) for parts in topics.values()],
                    {topic: (TOPICS[parts[0].signal], self._rows)
                     for topic, parts in topics.items()},
                    list(self._notes), effort_is_current=self._use.effort_is_current)


class _Block:
    """Tells that joint states have been read, like the stores of `Scanner`."""

    signal = 'joint_states'


def _joint_state_track(columns: Columns, use: Assignment, first: int, joint: str | None) -> Track:
    """Return a block's joint states."""
    time = columns[use.time.name]
    # Rows without a time get NaN values, and are omitted later.
    finite = np.isfinite(time)
    stamp = np.zeros(len(time), dtype=np.int64)
    scaled = use.time.factor * 1e9 * time
    valid = finite & (np.abs(np.where(finite, scaled, 0.0)) < 9e18)
    stamp[valid] = np.round(scaled[valid]).astype(np.int64)
    values = {}
    for name in use.joints:
        if joint not in (None, name) and name:
            continue
        states = np.full((len(time), 3), np.nan)
        for k, signal in enumerate(('position', 'velocity', 'effort')):
            column = use.of(signal, name)
            if column is not None:
                states[:, k] = column.factor * columns[column.name]
        states[~valid] = np.nan
        values[name] = states
    if not valid.all():
        # They get the time of their neighbour, so that it is no jump of the clock.
        index = np.maximum.accumulate(np.where(valid, np.arange(len(valid)), -1))
        stamp = np.where(index >= 0, stamp[index.clip(0)], stamp[np.argmax(valid)])
    order = first + np.arange(len(time))
    return Track('joint_states', 'joint_states', stamp, stamp, order, use.joints, values)


def _other_tracks(columns: Columns, use: Assignment, first: int) -> Iterator[Track]:
    """Yield a block's other signals; stamps are those of the joint states."""
    states = _joint_state_track(columns, use, first, None)
    for signal, topic in _TOPICS.items():
        signals = {name: column.factor * columns[column.name] for name in use.joints
                   if (column := use.of(signal, name)) is not None}
        if not signals:
            continue
        if topic in ('current_command', 'direction'):
            values = {'': np.column_stack([signals.get(name, np.full(len(states.stamp), np.nan))
                                           for name in use.joints])}
        else:
            values = {name: each[:, None] for name, each in signals.items()}
        yield Track(topic, topic, states.receive, states.stamp, states.order, use.joints, values)
    references = {}
    for name in use.joints:
        column = use.of('reference_position', name)
        if column is not None:
            reference = np.full((len(states.stamp), 3), np.nan)
            reference[:, 0] = column.factor * columns[column.name]
            speed = use.of('reference_velocity', name)
            if speed is not None:
                reference[:, 1] = speed.factor * columns[speed.name]
            references[name] = reference
    if references:
        yield Track('reference', 'reference', states.receive, states.stamp, states.order,
                    use.joints, references)


def _concatenate(parts: list[Track]) -> Track:
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    stamp = np.concatenate([part.stamp for part in parts])
    return Track(
        first.topic, first.signal, stamp, stamp, np.concatenate([part.order for part in parts]),
        first.names,
        {key: np.concatenate([part.values[key] for part in parts]) for key in first.values})


def _open(path: Path) -> _Csv | _Parquet | _Npz:
    name = path.name.lower()
    if name.endswith('.parquet'):
        return _Parquet(path)
    if name.endswith('.npz'):
        return _Npz(path)
    return _Csv(path)


class _Csv:
    """A text file with one row per line; the separator is the most frequent one in its header."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._stream() as stream:
            lines = [line for _, line in zip(range(200), stream)]
        if any('\0' in line for line in lines):
            raise InputError(f'{path}: not a text file')
        # Skip comments before the header; numpy.savetxt writes the header itself as a comment.
        size = next((k for k, line in enumerate(lines) if line.strip()
                     and not line.startswith('#')), len(lines))
        head = lines[size] if size < len(lines) else ''
        if _all_numbers(head) and size and _split(lines[size - 1].lstrip('# '), _separator(head)):
            commented = _split(lines[size - 1].lstrip('# '), _separator(head))
            size, head = (size - 1, lines[size - 1].lstrip('# ')) if len(commented) == len(
                _split(head, _separator(head))) else (size, head)
        if not head.strip():
            raise InputError(f'{path}: is empty')
        self._separator = _separator(head)
        self.names = [name.strip() for name in _split(head, self._separator)]
        self._skip = size + 1
        if _all_numbers(head):
            # Without a header, columns are named by their numbers.
            self.names, self._skip = [str(k + 1) for k in range(len(self.names))], size
        elif len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise InputError(f'{path}: has two columns called {twice!r}')

    def _stream(self) -> IO[str]:
        if self._path.name.lower().endswith('.gz'):
            return gzip.open(self._path, 'rt', encoding='utf-8-sig', errors='replace', newline='')
        return self._path.open(encoding='utf-8-sig', errors='replace', newline='')

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        """Yield blocks of columns and the share of the file that has been read."""
        indices = [self.names.index(name) for name in wanted]
        size = max(self._path.stat().st_size, 1)
        read = 0
        with self._stream() as stream:
            for _ in range(self._skip):
                stream.readline()
            first_line = self._skip
            while lines := [line for _, line in zip(range(rows), stream)]:
                read += sum(map(len, lines))
                yield dict(zip(wanted, self._parse(lines, indices, first_line).T)), min(
                    read / size, 1.0)
                first_line += len(lines)

    def _parse(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        """Return the selected cells, shape (rows, columns)."""
        if self._separator == ';' and ',' in lines[0]:
            lines = [line.replace(',', '.') for line in lines]
        try:
            return np.loadtxt(lines, delimiter=self._separator, usecols=indices, ndmin=2,
                              comments=None)
        except ValueError:
            # Cells are missing or not numeric: parse slowly, with a clear error.
            return self._parse_each(lines, indices, first_line)

    def _parse_each(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        rows = []
        for k, line in enumerate(lines):
            if not line.strip() or line.startswith('#'):
                continue
            cells = _split(line, self._separator)
            if len(cells) <= max(indices):
                # The last line of a truncated file.
                rows.append([np.nan] * len(indices))
                continue
            rows.append([self._number(cells[index], index, first_line + k + 1)
                         for index in indices])
        return np.array(rows).reshape(len(rows), len(indices))

    def _number(self, cell: str, index: int, line: int) -> float:
        text = cell.strip()
        if not text or text.lower() in ('nan', 'na', 'null', 'none', '-'):
            return float('nan')
        try:
            return float(text)
        except ValueError:
            raise InputError(f'{self._path}: line {line}, column {self.names[index]!r}: {text!r} '
                             'is not a number') from None


def _separator(line: str) -> str | None:
    """Return the separator of a line, None for white space."""
    counts = {mark: line.count(mark) for mark in ('\t', ';', ',')}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else None


def _split(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    return next(csv.reader([line.rstrip('\r\n')], delimiter=separator), [])


def _all_numbers(line: str) -> bool:
    return bool(re.fullmatch(r'[\s\d.,;+\-eEnaN]+', line)) and bool(re.search(r'\d', line))


class _Parquet:
    """A Parquet file, read with pyarrow."""

    def __init__(self, path: Path) -> None:
        try:
            from pyarrow import ArrowException
            from pyarrow.parquet import ParquetFile
        except ModuleNotFoundError:
            raise InputError(f'{path}: Parquet files need pyarrow: pip install '
                             '"friction_comp[parquet]", or pip install pyarrow') from None
        try:
            self._file = ParquetFile(path)
        except ArrowException as error:
            raise unreadable(path, str(error)) from None
        self._path = path
        self.names: list[str] = list(self._file.schema_arrow.names)

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        """Yield blocks of columns and the share of the file that has been read."""
        read, total = 0, max(self._file.metadata.num_rows, 1)
        for batch in self._file.iter_batches(batch_size=rows, columns=list(dict.fromkeys(wanted))):
            columns = {}
            for name in wanted:
                columns[name] = _numbers(batch.column(name).to_numpy(zero_copy_only=False),
                                         name, self._path)
            read += batch.num_rows
            yield columns, read / total


class _Npz:
    """A file of NumPy arrays; the columns of a 2-D array are called NAME_1 and so on."""

    def __init__(self, path: Path) -> None:
        self._columns: Columns = {}
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
        except (ValueError, EOFError, zipfile.BadZipFile, AttributeError, KeyError) as error:
            raise unreadable(path, str(error) or type(error).__name__) from None
        for name, values in arrays.items():
            if values.ndim == 1:
                self._columns[name] = _numbers(values, name, path)
            elif values.ndim == 2:
                self._columns.update({f'{name}_{k + 1}': _numbers(values[:, k], name, path)
                                      for k in range(values.shape[1])})
        self._path = path
        self.names = list(self._columns)

    def blocks(self, wanted: list[str], rows: int) -> Iterator[tuple[Columns, float]]:
        """Yield blocks of columns and the share that has been read."""
        sizes = {name: len(self._columns[name]) for name in wanted}
        size = sizes[wanted[0]]
        if set(sizes.values()) != {size}:
            raise InputError(f'{self._path}: its arrays differ in length: ' + ', '.join(
                f'{name} {count}' for name, count in sizes.items()))
        for first in range(0, size, rows):
            part = slice(first, first + rows)
            yield ({name: self._columns[name][part] for name in wanted},
                   min((first + rows) / size, 1.0))


def _numbers(values: np.ndarray, name: str, path: Path) -> np.ndarray:
    """Return a column as float; dates are converted to s."""
    if np.issubdtype(values.dtype, np.datetime64):
        return values.astype('datetime64[ns]').astype(np.int64) * 1e-9
    try:
        return values.astype(float)
    except (TypeError, ValueError):
        raise InputError(f'{path}: column {name!r} does not hold numbers') from None

