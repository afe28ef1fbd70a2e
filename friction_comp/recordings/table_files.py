# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files of tables: their columns by name, read in blocks of rows.

A file is text, or holds arrays, whose columns are columns, and numbers, which hold for all rows.
Several files with a signal each, such as ``q.txt`` and ``tau.txt``, are one table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, takewhile
import json
from pathlib import Path
import re
from typing import Any

import numpy as np

from friction_comp.column_names import read_name
from friction_comp.errors import InputError
from friction_comp.files import library_for
from friction_comp.layout import column_called, Layout, TABLES
from friction_comp.recordings.csv_file import Csv
from friction_comp.recordings.hdf5_file import fault_of_objects, Hdf5, is_hdf5, one_length
from friction_comp.recordings.item_names import with_items
from friction_comp.recordings.row_groups import EPISODE
from friction_comp.recordings.table_base import Columns, Table


def is_table(path: Path) -> bool:
    """Return whether a file is a table, or several files one, judging by the name."""
    return path.name.lower().endswith(TABLES) or bool(parts_of(path))


def open_table(path: Path) -> Table:
    """Return the reader of a table; raises InputError if it is none."""
    parts = parts_of(path)
    if parts:
        return Arrays(path, _joined(parts))
    name = path.name.lower()
    if name.endswith('.parquet'):
        return Parquet(path)
    if is_hdf5(path):
        return Hdf5(path)
    for suffix, load in _LOADERS.items():
        if name.endswith(suffix):
            return Arrays(path, load(path))
    return Csv(path)


def of_one_clock(table: Table, layout: Layout, where: str) -> list[str]:
    """Return a table's columns that are as long as those the user named, which share a clock.

    A log may hold signals of several clocks.
    """
    named = [column_called(name, table.names, where) for name in layout.columns.values()]
    if not named or not isinstance(table, (Arrays, Hdf5)):
        return table.names
    sizes = table.sizes(table.names)
    own = {sizes.get(name, 1) for name in named}
    # The lengths of states and of inputs belong together.
    alike = {1, max(own), *(own & {max(own) - 1})}
    return [name for name in table.names if sizes.get(name, 1) in alike or name in named]


def with_parts(paths: Sequence[Path]) -> list[Path]:
    """Return paths with tables of one signal each as one, which `parts_of` takes apart."""
    groups: dict[Path, list[Path]] = {}
    for path in paths:
        if path.is_file() and path.name.lower().endswith(TABLES):
            groups.setdefault(path.parent, []).append(path)
    whole = []
    for folder, files in groups.items():
        names = _names(files)
        groups[folder] = files = [file for file in files if read_name(names[file]).signal]
        readings = [read_name(names[file]) for file in files]
        if (len({reading.signal for reading in readings}) > 1
                and len(set(readings)) == len(files) and all(map(_one_signal, files))):
            whole.append(folder)
    result: dict[Path, None] = {}
    for path in paths:
        group = groups.get(path.parent, [])
        merged = path.parent in whole and path in group
        result[path.parent / ('{' + ','.join(file.name for file in group) + '}')
               if merged else path] = None
    return list(result)


def parts_of(path: Path) -> list[Path]:
    """Return the files of a table in several files; empty if it is in one."""
    match = re.fullmatch(r'\{(.*)\}', path.name)
    return [path.parent / name for name in match[1].split(',')] if match else []


def _stem(path: Path) -> str:
    return path.name.split('.')[0]


def _names(files: Sequence[Path]) -> dict[Path, str]:
    """Return the name of each file's signal: where its own is none, without what all begin with."""
    words = [_stem(file).split('_') for file in files]
    common = len(list(takewhile(lambda same: len(set(same)) == 1, zip(*words))))
    return {file: _stem(file) if read_name(_stem(file)).signal or len(files) == 1
            else '_'.join(own[common:]) for file, own in zip(files, words)}


def _one_signal(path: Path) -> bool:
    """Return whether no two columns of a file name different signals, but for its time."""
    signals = {read_name(name).signal for name in open_table(path).names}
    return len(signals - {''}) <= 1 or len(signals - {'', 'time'}) <= 1


def _joined(parts: Sequence[Path]) -> Columns:
    """Return the columns of tables of one signal each, at the times of one of them."""
    names = _names(parts)
    tables: list[Columns] = []
    for part in parts:
        table = open_table(part)
        own = [name for name in table.names if read_name(name).signal]
        number = {name: k + 1 for k, name in enumerate(n for n in table.names if n not in own)}
        tables.append({
            name if name in own else names[part] if len(table.names) == 1
            else f'{names[part]}_{number[name]}': values
            for name, values in table.whole(table.names).items()})
    columns = _by_time(tables)
    sizes = {len(values) for values in columns.values()}
    times = min(sizes)
    if len(sizes) != 2 or max(sizes) % times:
        return columns
    # Each vector was written with one number a line, its time only once.
    return dict(chain.from_iterable(
        [(name, values)] if len(values) == times else
        [(f'{name}_{k + 1}', values[k::len(values) // times])
         for k in range(len(values) // times)] for name, values in columns.items()))


def _by_time(tables: Sequence[Columns]) -> Columns:
    """Return the columns of tables; with other times each, a row has the values of one of them."""
    clocks = [next((name for name in table if read_name(name).signal == 'time'), '')
              for table in tables]
    times = [table.get(clock, np.empty(0)) for table, clock in zip(tables, clocks)]
    if not all(clocks) or all(np.array_equal(times[0], time) for time in times):
        return {name: values for table in tables for name, values in table.items()
                if name == max(clocks, key=bool) or name not in clocks}
    every = np.concatenate(times)
    order, ends = np.argsort(every, kind='stable'), np.cumsum([len(time) for time in times])
    sparse = {clocks[0]: every}
    for table, clock, end in zip(tables, clocks, ends):
        for name in table:
            if name != clock:
                sparse[name] = np.full(len(every), np.nan)
                sparse[name][end - len(table[name]):end] = table[name]
    return {name: values[order] for name, values in sparse.items()}


class Parquet(Table):
    """A Parquet file, read with pyarrow.

    The items of a column of lists are NAME[0] and so on, or have the names of `item_names`.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._file = pyarrow_of(path).parquet.ParquetFile(path)
        self._source: dict[str, tuple[str, int | None]] = {}
        first: Any = None
        for field in self._file.schema_arrow:
            if not hasattr(field.type, 'value_type'):
                self._source[field.name] = field.name, None
                continue
            if first is None:
                first = next(self._file.iter_batches(batch_size=1), None)
            items = first.column(field.name)[0].as_py() if first is not None else None
            self._source.update({name: (field.name, k) for k, name in enumerate(
                with_items(field.name, len(items or ()), path))})
        self.names = list(self._source)

    def blocks(self, wanted: Sequence[str], rows: int) -> Iterator[tuple[Columns, float]]:
        read, total = 0, max(self._file.metadata.num_rows, 1)
        sources = list(dict.fromkeys(self._source[name][0] for name in wanted))
        for batch in self._file.iter_batches(batch_size=rows, columns=sources):
            read += batch.num_rows
            yield {name: self._values(batch, name) for name in wanted}, read / total

    def _values(self, batch: Any, name: str) -> np.ndarray:
        source, item = self._source[name]
        values = batch.column(source).to_numpy(zero_copy_only=False)
        if item is not None:
            values = np.array([row[item] if row is not None and len(row) > item else np.nan
                               for row in values])
        return self.numbers(values, name)


def pyarrow_of(path: Path) -> Any:
    """Return the library for Parquet files; raises InputError if it is not installed."""
    return library_for(path, 'pyarrow.parquet', 'parquet', 'Parquet files')


class Arrays(Table):
    """Columns in memory."""

    def __init__(self, path: Path, columns: Columns) -> None:
        super().__init__(path)
        self._columns, self.names = columns, list(columns)

    def sizes(self, names: Sequence[str]) -> dict[str, int]:
        """Return how many values each column has, 1 for a number."""
        return {name: self._columns[name].size for name in names}

    def blocks(self, wanted: Sequence[str], rows: int) -> Iterator[tuple[Columns, float]]:
        size = one_length(self.sizes([name for name in wanted if self._columns[name].ndim]), self)
        for first in range(0, size, rows):
            part = slice(first, first + rows)
            yield ({name: self.numbers(np.broadcast_to(
                self._columns[name][:size] if self._columns[name].ndim else self._columns[name],
                size)[part], name)
                    for name in wanted}, min((first + rows) / size, 1.0))


def _flat(items: Iterable[tuple[str, Any]]) -> Columns:
    """Return columns from named arrays; those of a matrix are called NAME_1 and so on."""
    columns: Columns = {}
    for name, value in items:
        if isinstance(value, Mapping):
            columns.update({f'{name}.{inner}': column
                            for inner, column in _flat(value.items()).items()})
            continue
        if isinstance(value, list) and value and isinstance(value[0], Mapping):
            columns.update(_episodes(value) or _flat(
                (key, [row.get(key) for row in value]) for key in value[0]))
            continue
        if type(value).__name__ == 'MatlabOpaque':
            continue    # an object, as of symbols, whatever its fields are called
        try:
            values = np.asarray(value)
        except ValueError:
            continue    # rows of different lengths
        if values.dtype == object and values.size == 1 and isinstance(values.item(), np.ndarray):
            values = values.item()
        if values.dtype.names:
            columns.update(_flat(_fields(name, values)))
            continue
        if values.ndim == 2 and 1 in values.shape and max(values.shape) > 1:
            values = values.ravel()
        if values.ndim == 2:
            # A row for each time: there are more times than joints.
            values = values if values.shape[0] >= values.shape[1] else values.T
            columns.update({f'{name}_{k + 1}'.lstrip('_'): column
                            for k, column in enumerate(values.T)})
        elif values.ndim < 2:
            columns[name] = values
    return columns


def _fields(name: str, structs: np.ndarray) -> Iterator[tuple[str, Any]]:
    """Yield the fields of structs of MATLAB, which may be structs; of channels one each."""
    names = structs.dtype.names or ()
    above, _, own = name.rpartition('.')
    if {'Name', 'Data'} <= {*names} and (
            own == 'X' or any(map(np.size, structs['Name'].reshape(-1)))):
        for called, data in _channels(own, structs.reshape(-1)):
            yield f'{above}.{called}'.lstrip('.'), data
        return
    for field in names:
        values = structs[field]
        yield f'{name}.{field}', values.item() if structs.size == 1 else values.squeeze()


def _channels(name: str, structs: np.ndarray) -> Iterator[tuple[str, Any]]:
    """Yield the columns of structs with Name and Data, as dSPACE writes; times have no name.

    Of a name such as ``"Model Root"/"q"``, the last parts are used that tell the channels apart.
    """
    paths = [re.findall('[^"/]+', str(one)) if np.size(one) else [] for one in structs['Name']]
    longest = max(map(len, paths))
    for count in range(1, longest + 1):
        called = ['/'.join(path[-count:]) for path in paths]
        if len(set(called)) == len(paths):
            break
    else:
        called = [f'{name}_{k + 1}' for k in range(len(paths))] if longest else ['time']
    yield from zip(called, structs['Data'])


def _episodes(records: list[Any]) -> Columns:
    """Return columns of records that each hold the lists of a trial, and its number; else none.

    What differs in length, or is longer than there are records, is no vector of one time.
    """
    parts: dict[str, list[np.ndarray]] = {}
    for number, record in enumerate(records):
        lists = {key: np.asarray(value, dtype=float) for key, value in (
            record.items() if isinstance(record, Mapping) else ())
            if isinstance(value, list) and value and all(
                isinstance(item, (int, float)) for item in value)}
        longest = max(map(len, lists.values()), default=0)
        lists = {key: value for key, value in lists.items() if len(value) == longest}
        if not lists or (parts and set(lists) != set(parts) - {EPISODE}):
            return {}
        for key, value in {**lists, EPISODE: np.full(longest, number)}.items():
            parts.setdefault(key, []).append(value)
    lengths = {len(part) for part in parts.get(EPISODE, ())}
    if len(lengths) < 2 and max(lengths, default=0) <= len(records):
        return {}
    return {key: np.concatenate(values) for key, values in parts.items()}


def _load(path: Path) -> Any:
    try:
        return np.load(path, allow_pickle=False)
    except ValueError:
        # NumPy asks to trust whatever it does not know.
        raise InputError(f'{path}: not a NumPy file of numbers') from None


def _npz(path: Path) -> Columns:
    with _load(path) as file:
        return _flat(file.items())


def _npy(path: Path) -> Columns:
    values = _load(path)
    if values.dtype.names:
        return _flat((name, values[name]) for name in values.dtype.names)
    return _flat([('', values) if values.ndim == 2 else ('1', values)])


def _mat(path: Path) -> Columns:
    from scipy.io import loadmat
    from scipy.io.matlab import MatlabOpaque

    try:
        content = loadmat(path, struct_as_record=True, squeeze_me=True)
    except (IndexError, TypeError, ValueError):
        raise InputError(f'{path}: not a readable MATLAB file') from None
    objects = [name for name, value in content.items() if isinstance(value, MatlabOpaque)]
    columns = _flat((name, value) for name, value in content.items()
                    if not name.startswith('__') and name not in objects)
    if objects and not columns:
        raise InputError(f'{path}: {fault_of_objects(objects)}')
    return columns


def _json(path: Path) -> Columns:
    try:
        text = path.read_text(encoding='utf-8-sig')
        lines = path.name.lower().endswith('.jsonl')
        content = ([json.loads(line) for line in text.splitlines() if line.strip()] if lines
                   else json.loads(text))
    except ValueError as error:
        raise InputError(f'{path}: not a JSON file: {error}') from None
    if isinstance(content, list):
        content = {'rows': content}
    if not isinstance(content, dict):
        raise InputError(f'{path}: holds neither lists nor objects')
    # Texts, such as a remark, are no columns.
    return {name: values for name, values in _flat(content.items()).items()
            if values.ndim or values.dtype.kind in 'iuf'}


_LOADERS: dict[str, Callable[[Path], Columns]] = {
    '.npz': _npz, '.npy': _npy, '.mat': _mat, '.json': _json, '.jsonl': _json}
