# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files of tables as columns of numbers: what NumPy, SciPy, h5py and pyarrow give, by name.

Matrices have columns NAME_1 and so on, lists in cells NAME[0], groups and structs a point, as in
``log.joint.q``. Arrays of another length than most, or than those that are named, are left out.
"""

from __future__ import annotations

import codecs
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
import csv
import io
from itertools import islice
from pathlib import Path
import re
from typing import Any

import numpy as np

from friction_comp.errors import InputError, one_line
from friction_comp.files import (
    check_input,
    check_unpacked,
    library_for,
    open_input,
    parse_json,
    read_text,
    unpacked,
)
from friction_comp.tables.columns import other_unit, parse_unit, read_name

Columns = dict[str, np.ndarray]
TABLES = ('.csv', '.csv.gz', '.tsv', '.txt', '.dat', '.parquet', '.npz', '.npy', '.mat', '.h5',
          '.hdf5', '.json', '.jsonl')
"""Suffixes of table files."""
# Most values of the used columns, which take 8 bytes each; the longest line, in characters; rows
# that are parsed at once, and lines in which the header is looked for.
_MOST_VALUES, _LONGEST, _ROWS, _FIRST = 60_000_000, 4_000_000, 100_000, 200
_MISSING = {'', '-', 'nan', 'na', 'n/a', 'null', 'none'}
_NUMBER = re.compile(r'\s*[-+]?(\d[\d.,]*|[.,]\d+)(e[-+]?\d+)?\s*', re.IGNORECASE)
# ISO 8601, and a time of the day.
_DATE = re.compile(r'\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d+)?)?)?|\d\d:\d\d:\d\d(\.\d+)?|nan')
_LIST = re.compile(r'\s*[\[(](.*)[\])]\s*', re.DOTALL)


def is_table(path: Path) -> bool:
    """Return whether a file is a table, or several files one, judging by the name."""
    return path.name.lower().endswith(TABLES)


def parts_of(path: Path) -> list[Path]:
    """Return the files of a table: several if their names are joined by a plus."""
    parts = [Path(part) for part in str(path).split('+')]
    return parts if len(parts) > 1 and all(map(is_table, parts)) else [path]


class Table:
    """A table: the `names` of its columns, of which those that are wanted are read as floats.

    Raises InputError if the file, or what it holds, is no table. `notes` say what is left out. The
    columns may also be those of a data `frame`. Of arrays, those as long as the `named` ones are
    used, or else as most.
    """

    def __init__(self, path: Path, named: Sequence[str] = (), frame: Any = None) -> None:
        self.path, self.notes = path, list[str]()
        self._text: _Text | None = None
        parts, name = parts_of(path), path.name.lower()
        load = next((own for suffix, own in _LOADERS.items() if name.endswith(suffix)), None)
        with _readable(path):
            if frame is not None:
                found: Any = {str(own): frame[own] for own in getattr(frame, 'columns', frame)}
            elif len(parts) > 1:
                found = _joined(parts)
            elif load:
                found = load(check_input(path))
            else:
                self._text = _Text(path)
                self.names, self.notes = [*self._text.places], self._text.notes
                return
            columns = dict(_flat('', found))
        lengths = Counter(map(len, columns.values()))
        size = next((len(columns[name]) for name in named if name in columns), max(
            lengths, key=lambda length: (lengths[length], length), default=0))
        self._columns = {name: own for name, own in columns.items() if len(own) == size}
        self.names = [*self._columns]
        if left := [name for name in columns if name not in self._columns]:
            self.notes.append(f'{", ".join(left[:9])}: left out, not of {size} values')
        if not self.names:
            raise InputError(f'{path}: holds no table of numbers; objects of MATLAB and workbooks '
                             'are saved as CSV first')

    def read(self, wanted: Sequence[str]) -> Columns:
        """Return columns as floats of one length, dates in s."""
        with _readable(self.path):
            if self._text:
                return self._text.read(list(dict.fromkeys(wanted)))
            return {name: to_numbers(self._columns[name], name, self.path) for name in wanted}


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Turn any error, as libraries raise for damaged files, into one that names the file."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f'{path}: not a readable table: {one_line(error)}') from None


class _Text:
    """A text file with a row a line; header, separator and decimal mark are those of its lines."""

    def __init__(self, path: Path) -> None:
        self.path, self.notes = path, list[str]()
        first = list(islice(self._lines(), _FIRST))
        if not first:
            raise InputError(f'{path}: is empty')
        late = first[3 * len(first) // 4]
        self._mark = next((mark for mark in '\t;,' if mark in late), None)
        rows = list(self._rows(iter(first)))
        late_row = rows[3 * len(rows) // 4]
        # The names stand above the first row with numbers where rows have them, and are as many.
        own = [k for k, cell in enumerate(late_row) if _is_number(cell)]
        begin = self._skip = next((k for k, row in enumerate(rows) if len(row) > max(
            own, default=0) and all(_is_number(row[i]) or _is_missing(row[i]) for i in own) and any(
                _is_number(row[i]) for i in own)), len(rows))
        above = [row[0].split() if len(row) == 1 else [cell.strip() for cell in row]
                 for row in rows[:begin]]
        body, width = rows[begin:], _width(late_row)
        names = above[-1] if above and _width(above[-1]) >= width else [
            str(k + 1) for k in range(max(map(_width, rows[begin:]), default=0))]
        units = [name.strip('[]()- ') for name in names]
        known = [bool(parse_unit(unit) or other_unit(unit)) for unit in units]
        if begin > 1 and len(above[-2]) == len(names) and 2 * sum(known) >= len(
                [*filter(None, units)]) > 0:
            # A line of units below the names; one that is not known is asked for.
            names = [f'{name} [{unit}{"" if one else "?"}]' if unit else name
                     for name, unit, one in zip(above[-2], units, known)]
        count = Counter(filter(None, names))
        if doubled := [name for name in count if count[name] > 1]:
            self.notes.append('left out, since several columns have this name: '
                              + ', '.join(map(repr, doubled)))
        # Column, and place in its lists, of each name.
        self.places: dict[str, tuple[int, int | None]] = {}
        for k, name in enumerate(names):
            items = next((found for row in body[:20] if k < len(row) and (
                found := _items(row[k]))), [])
            if count[name] == 1:
                self.places.update({f'{name}[{i}]': (k, i) for i in range(len(items))})
                self.places.update({} if items else {name: (k, None)})
        cells = [cell for row in body for cell in row if _NUMBER.fullmatch(cell)] if (
            self._mark != ',') else []
        # A comma that does not separate is a decimal one.
        self._comma = any(',' in cell for cell in cells) and not any('.' in cell for cell in cells)
        if self._comma and all(re.fullmatch(r'\s*[-+]?[1-9]\d{0,2}(,\d{3})+\s*', cell)
                               for cell in cells if ',' in cell):
            raise InputError(f'{path}: is the comma in numbers such as '
                             f'{next(cell for cell in cells if "," in cell)} a decimal mark, or of '
                             'thousands? Write them with points, or without it')

    def _lines(self) -> Iterator[str]:
        """Yield the lines that are neither empty nor comments, but for those before the rows."""
        with open_input(self.path) as file:
            stream: Any = io.BufferedReader(io.BytesIO(b''.join(unpacked(self.path, file)))) if (
                self.path.name.lower().endswith('.gz')) else file
            head = stream.peek(1)
            wide = head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            if b'\0' in head and not wide:
                raise InputError(f'{self.path}: not a text file')
            text = io.TextIOWrapper(stream, encoding='utf-16' if wide else 'utf-8-sig',
                                    errors='replace', newline='')
            begun = False
            while line := text.readline(_LONGEST):
                if len(line) == _LONGEST:
                    raise InputError(f'{self.path}: a line has more than {_LONGEST} characters')
                begun = begun or bool(re.match(r'\s*[-+\d.]', line))
                # numpy.savetxt writes the header as a comment.
                line = line if begun else line.lstrip('#% ')
                if line.strip() and line[0] not in '#%' and line.strip().lower()[:-1] != 'sep=':
                    yield line

    def _rows(self, lines: Iterator[str]) -> Iterator[list[str]]:
        """Yield the cells of each row; a quoted cell may hold separators and ends of lines."""
        return (line.split() for line in lines) if self._mark is None else csv.reader(
            lines, delimiter=self._mark, skipinitialspace=True)

    def read(self, wanted: list[str]) -> Columns:
        rows, size, parts = islice(self._rows(self._lines()), self._skip, None), 0, []
        while cells := list(islice(rows, _ROWS)):
            size += len(cells)
            _check_size(self.path, size, len(wanted))
            parts.append([self._numbers([row[k] if k < len(row) else '' for row in cells], i, name)
                          for name, (k, i) in ((name, self.places[name]) for name in wanted)])
        return dict(zip(wanted, map(np.concatenate, zip(*parts)))) if parts else {
            name: np.empty(0) for name in wanted}

    def _numbers(self, cells: list[str], item: int | None, name: str) -> np.ndarray:
        if item is not None:
            cells = [items[item] if item < len(items := _items(cell)) else '' if items else cell
                     for cell in cells]
        elif self._comma:
            cells = [cell.replace(',', '.') for cell in cells]
        with suppress(ValueError):
            return np.fromiter(map(float, cells), float, len(cells))
        return to_numbers(np.array(cells, dtype=object), name, self.path)


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell)) or bool(_items(cell)) or cell.strip(' +-').lower() in (
        'nan', 'inf')


def _items(cell: str) -> list[str]:
    """Return the numbers of a list as Python or NumPy prints it, as text; empty if it is none."""
    match = _LIST.fullmatch(cell) if '[' in cell or '(' in cell else None
    items = match[1].replace(',', ' ').split() if match else []
    return items if all(_NUMBER.fullmatch(item) or item == 'nan' for item in items) else []


def _is_missing(cell: str) -> bool:
    return cell.strip().lower() in _MISSING


def _width(cells: Sequence[str]) -> int:
    """Return the number of cells without the empty ones at the end."""
    return max((k for k, cell in enumerate(cells, 1) if cell.strip()), default=0)


def _check_size(path: Path, rows: int, columns: int) -> None:
    if rows * columns > _MOST_VALUES:
        raise InputError(f'{path}: more than {_MOST_VALUES:,} values in {columns} columns: give a '
                         'part of it at a time')


def to_numbers(values: np.ndarray, name: str, where: object) -> np.ndarray:
    """Return a column as floats, ISO 8601 dates in s since 1970, times of the day since midnight.

    Raises InputError if its values are none of these.
    """
    if values.dtype.kind in 'OSU':
        texts = ['nan' if value is None or _is_missing(str(value)) else str(value).strip()
                 for value in values.ravel()]
        with suppress(ValueError):
            return np.array(texts, dtype=float)
        plain = [text.removesuffix('Z').replace(',', '.') for text in texts]
        if not all(_DATE.fullmatch(text) for text in plain):
            wrong = next(text for text in texts if not re.fullmatch(r'[-+.\dEe]+|nan|inf', text))
            hint = ', nor a date such as 2026-03-04T09:59:50.5' * (read_name(name).signal == 'time')
            raise InputError(f'{where}: column {name!r}: {wrong!r} is not a number{hint}')
        values = np.array([np.datetime64('NaT' if text == 'nan' else text if '-' in text
                                         else f'1970-01-01T{text}', 'ns') for text in plain])
    if values.dtype.kind == 'm':
        return values / np.timedelta64(1, 's')
    if values.dtype.kind == 'M':
        return np.where(np.isnat(values), np.nan, values.astype('M8[ns]').astype(np.int64) * 1e-9)
    return values.astype(float)


def _flat(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield named columns of nested mappings, structs, arrays and lists of records."""
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        for key in value[0]:
            yield from _flat(key, [row.get(key) for row in value if isinstance(row, Mapping)])
        return
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f'{name}.{key}'.lstrip('.'), inner)
        return
    try:
        array = np.asarray(value)
    except ValueError:
        return      # rows of different lengths
    if array.dtype.names:
        for key in array.dtype.names:
            own = array[key]
            yield from _flat(f'{name}.{key}'.lstrip('.'), own.item() if own.size == 1 else
                             own.squeeze())
    elif array.dtype.kind in 'biufmM' or (array.dtype.kind in 'OU' and array.ndim == 1):
        array = array.ravel() if array.ndim == 2 and 1 in array.shape else array
        if array.ndim == 2:
            # A row for each time: there are more times than joints.
            array = array if array.shape[0] >= array.shape[1] else array.T
            yield from ((f'{name}_{k + 1}'.lstrip('_'), column)
                        for k, column in enumerate(array.T))
        elif array.ndim == 1:
            yield name or '1', array


def _numpy(path: Path) -> Any:
    try:
        # Packed arrays are read one by one, each no larger than the file could hold.
        if path.suffix.lower() == '.npz':
            import zipfile

            with zipfile.ZipFile(path) as file:
                check_unpacked(path, sum(item.file_size for item in file.infolist()),
                               path.stat().st_size)
        loaded = np.load(path, allow_pickle=False)
    except ValueError:
        # NumPy asks to trust whatever it does not know.
        raise InputError(f'{path}: not a NumPy file of numbers') from None
    return loaded if isinstance(loaded, np.ndarray) else dict(loaded)


def _mat(path: Path) -> Any:
    with open_input(path) as file:
        if b'HDF' in file.read(1024):
            return _hdf5(path)
    from scipy.io import loadmat

    return {name: value for name, value in loadmat(path, squeeze_me=True).items()
            if not name.startswith('__') and type(value).__name__ != 'MatlabOpaque'}


def _hdf5(path: Path) -> Columns:
    found: Columns = {}

    def add(name: str, item: Any) -> None:
        # Links are not visited; datasets in other files, and of MATLAB's objects, are left out.
        if getattr(item, 'dtype', None) is None or item.dtype.kind not in 'biuf' or (
                item.ndim > 2 or not item.size or '#' in name or item.external or item.is_virtual
                or 'MATLAB_object_decode' in item.attrs or (
                    item.ndim == 2 and min(item.shape) > 64)):
            return
        check_unpacked(path, item.size * item.dtype.itemsize, path.stat().st_size)
        _check_size(path, item.size, 1)
        found[name.replace('/', '.')] = item[()]
    with library_for(path, 'h5py', 'hdf5', 'HDF5 files').File(path, 'r') as file:
        file.visititems(add)
    return found


def _json(path: Path) -> Any:
    text = read_text(path)
    if path.name.lower().endswith('.jsonl'):
        return [parse_json(line, path) for line in text.splitlines() if line.strip()]
    return parse_json(text, path)


def _parquet(path: Path) -> Columns:
    file = library_for(path, 'pyarrow.parquet', 'parquet', 'Parquet files'
                       ).parquet.ParquetFile(path)
    about, columns = file.metadata, dict[str, np.ndarray]()
    check_unpacked(path, sum(about.row_group(k).total_byte_size
                             for k in range(about.num_row_groups)), path.stat().st_size)
    _check_size(path, about.num_rows, about.num_columns)
    table = file.read()
    for name, column in zip(table.column_names, table.columns):
        if hasattr(column.type, 'value_type'):
            rows = [row or () for row in column.to_pylist()]
            columns.update({f'{name}[{k}]': np.array([
                row[k] if len(row) > k else np.nan for row in rows])
                for k in range(max(map(len, rows), default=0))})
        else:
            columns[name] = column.to_numpy()
    return columns


_LOADERS: dict[str, Callable[[Path], Any]] = {
    '.npz': _numpy, '.npy': _numpy, '.mat': _mat, '.h5': _hdf5, '.hdf5': _hdf5, '.json': _json,
    '.jsonl': _json, '.parquet': _parquet}


def _joined(parts: Sequence[Path]) -> Columns:
    """Return the columns of files with a signal each, named after it, at the times of all."""
    tables = []
    for part in parts:
        table = Table(part)
        columns = table.read(table.names)
        own = [name for name in columns if not read_name(name).signal]
        stem = part.name.split('.')[0]
        tables.append({name if name not in own else f'{stem}_{name}' if len(own) > 1 else stem:
                       values for name, values in columns.items()})
    clocks = [next((name for name in table if read_name(name).signal == 'time'), '')
              for table in tables]
    times = [table[clock] for table, clock in zip(tables, clocks) if clock]
    if len(times) < len(tables) or all(np.array_equal(times[0], time) for time in times):
        return {name: values for table in reversed(tables) for name, values in table.items()}
    every, whole, begin = np.concatenate(times), dict[str, np.ndarray](), 0
    order = np.argsort(every, kind='stable')
    for columns, clock in zip(tables, clocks):
        rows = slice(begin, begin := begin + len(columns[clock]))
        for name in [own for own in columns if own != clock]:
            whole[name] = np.full(len(every), np.nan)
            whole[name][rows] = columns[name]
    return {name: values[order] for name, values in {clocks[0]: every, **whole}.items()}


def to_csv(columns: Mapping[str, np.ndarray], digits: int) -> str:
    """Return columns as CSV with some significant digits, the first, times in s, to the ns."""
    stream = io.StringIO()
    np.savetxt(stream, np.column_stack(list(columns.values())), delimiter=',', comments='',
               header=','.join(columns), fmt=['%.9f', *[f'%.{digits}g'] * (len(columns) - 1)])
    return stream.getvalue()
