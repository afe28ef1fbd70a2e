# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Text tables as spreadsheets, loggers and laboratory programs write them.

The encoding, the lines above the header, the separator and the decimal mark are found in the file.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator, Sequence
import csv
from functools import lru_cache
import gzip
import io
from itertools import islice
from pathlib import Path
import re
from typing import Any, IO

import numpy as np

from friction_comp.column_names import OTHER_UNITS, read_name
from friction_comp.column_values import date_in_seconds, NOT_A_SIGNAL
from friction_comp.errors import InputError
from friction_comp.files import open_input
from friction_comp.recordings.item_names import with_items
from friction_comp.recordings.table_base import Columns, Table
from friction_comp.units import parse_unit

_COMMENTS = ('#', '%')
# Lines in which the header is looked for, and bytes by which the encoding is told.
_FIRST_LINES, _FIRST_BYTES = 200, 65536
# Lines of the longest quoted cell, a cell in quotes, and one that begins with a quote at the end.
_LONGEST_CELL = 50
_QUOTED, _UNFINISHED = re.compile(r'"[^"]*"'), re.compile(r'(^|[,;\t])\s*"[^"]*$')

_LIST = re.compile(r'\[.*\]|\(.*,.*\)')
_Place = tuple[int, int | None]     # a column, and which item of its lists


class Csv(Table):
    """A text file with one row per line; the separator is the most frequent one in its header."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._encoding = _encoding(path)
        with open_input(path) as file:
            lines = list(islice(_whole_rows(self._text(file)), _FIRST_LINES))
        if any('\0' in line for line in lines):
            raise InputError(f'{path}: not a text file')
        # Skip comments before the header; numpy.savetxt writes the header itself as a comment.
        header = _header_in(lines)
        head = lines[header] if header < len(lines) else ''
        if not head.strip():
            raise InputError(f'{path}: is empty')
        self._separator = _separator(head)
        rows = [_split(line, self._separator) for line in lines[header:] if _holds(line)]
        self.names = rows[0]
        self._skip = header + 1
        comment = self._names_in(lines[header - 1].lstrip('#% ')) if header else []
        is_row = _all_numbers(head) or _is_row(rows[0], rows[3 * len(rows) // 4])
        # A separator at the end of each line separates nothing.
        width = max(map(_width, rows if is_row else rows[:1]))
        fits = _width(comment) == width
        if is_row or (fits and any(read_name(name).signal for name in comment)
                      and not any(read_name(name).signal for name in self.names)):
            # Not a header: names are in the comment above it, otherwise columns are numbered.
            self.names = comment if fits else [str(k + 1) for k in range(width)]
            self._skip = header
        elif units := self._units_in(lines[header + 1:header + 2]):
            self.names = [f'{name} [{unit}]' if unit else name
                          for name, unit in zip(self.names, units)]
            self._skip += 1
        # Spreadsheets end lines with empty cells: a column without a name is none.
        named = [name for name in self.names if name]
        self.doubled = list(dict.fromkeys(name for name in named if named.count(name) > 1))
        self._index = self._places(rows[self._skip - header:])
        self.names = list(self._index)

    def _places(self, rows: Sequence[Sequence[str]]) -> dict[str, _Place]:
        """Return the columns by name, those whose cells are lists by the names of their items."""
        places: dict[str, _Place] = {}
        for k, name in enumerate(self.names):
            if name and name not in self.doubled:
                cells = [row[k] for row in rows if len(row) > k]
                count = next(filter(None, (len(_items_of(cell)) for cell in cells)), 0)
                names = with_items(name, count, self.path)
                places.update({item: (k, place) for place, item in enumerate(names)})
                if not count:
                    places[name] = k, None
        return places

    def _names_in(self, comment: str) -> list[str]:
        """Return names in a comment, which are often separated by space only."""
        names = _split(comment, self._separator)
        return names if len(names) > 1 else comment.split()

    def _units_in(self, lines: list[str]) -> list[str]:
        """Return the units in the line below the names; empty if it is not one of units.

        Not all need to be known: one that is not is marked, so that it is asked for.
        """
        cells = [cell.strip('[]()-') for cell in _split(lines[0], self._separator)] if lines else []
        units = [cell for cell in cells if cell]
        known = [unit for unit in units
                 if parse_unit(unit) is not None or unit.lower() in OTHER_UNITS]
        if (2 * len(known) < len(units) or not units or any(map(_all_numbers, units))
                or len(cells) != len(self.names)):
            return []
        return [f'{cell}?' if cell and cell not in known else cell for cell in cells]

    def _text(self, file: IO[bytes]) -> IO[str]:
        return io.TextIOWrapper(_opened(self.path, file), encoding=self._encoding,
                                errors='replace', newline='')

    def blocks(self, wanted: Sequence[str], rows: int) -> Iterator[tuple[Columns, float]]:
        size = self.path.stat().st_size
        with open_input(self.path) as file:
            # Kept, since it closes the file when it goes.
            plain = self._text(file)
            text = _whole_rows(plain)
            first_line = sum(1 for _ in islice(text, self._skip))
            while lines := list(islice(text, rows)):
                columns = self._parse(lines, wanted, first_line).T
                # The position in the file, which may be compressed.
                yield dict(zip(wanted, columns)), file.tell() / size
                first_line += len(lines)

    def _parse(self, lines: list[str], wanted: Sequence[str], first_line: int) -> np.ndarray:
        places = [self._index[name] for name in wanted]
        # A comma that does not separate is a decimal one.
        plain = lines if self._separator == ',' else [line.replace(',', '.') for line in lines]
        try:
            if any(item is not None for _, item in places):
                raise ValueError('lists')
            values = np.loadtxt(plain, delimiter=self._separator, ndmin=2, comments=None,
                                usecols=[column for column, _ in places])
        except ValueError:
            # Cells are missing or not numeric: parse slowly, with a clear error.
            return self._parse_each(lines, wanted, first_line)
        for place, name in enumerate(wanted):
            if name in self.labels and len(values):
                values[:, place] = self.labels[name].codes(values[:, place])
        return values

    def _parse_each(self, lines: list[str], wanted: Sequence[str], first_line: int) -> np.ndarray:
        last = max(self._index[name][0] for name in wanted)
        rows = []
        for k, line in enumerate(lines, first_line + 1):
            if _holds(line):
                cells = _split(line, self._separator)
                # The last line of a truncated file has fewer cells.
                rows.append([self._number(self._cell(cells, name), name, k)
                             if len(cells) > last else np.nan for name in wanted])
        return np.array(rows).reshape(len(rows), len(wanted))

    def _cell(self, cells: Sequence[str], name: str) -> str:
        """Return the text of a row's value; '' of a list that is shorter."""
        column, item = self._index[name]
        if item is None:
            return cells[column] if self._separator == ',' else cells[column].replace(',', '.')
        items = _items_of(cells[column])
        return items[item] if item < len(items) else '' if items else cells[column]

    def _number(self, cell: str, name: str, line: int) -> float:
        if name in self.labels:
            return self.labels[name].code(cell)
        if _is_missing(cell):
            return float('nan')
        try:
            return float(cell)
        except ValueError:
            pass
        try:
            return date_in_seconds(cell)
        except ValueError:
            hint = {'time': ', nor a date such as 2026-03-04T09:59:50.5 or 4.3.2026 09:59:50.5',
                    'direction': f': {NOT_A_SIGNAL}'}.get(read_name(name).signal, '')
            raise InputError(f'{self.path}: line {line}, column {name!r}: {cell!r} is not a number'
                             f'{hint}') from None


def _whole_rows(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines, those of a quoted cell that goes on in the next line as one."""
    begun: list[str] = []
    for line in lines:
        if not begun and '"' not in line:
            yield line
            continue
        begun.append(line)
        row = ' '.join(part.rstrip('\r\n') for part in begun)
        goes_on = _UNFINISHED.search(_QUOTED.sub('', row)) is not None
        if goes_on and len(begun) < _LONGEST_CELL:
            continue
        # A quote that does not end is a character.
        yield from begun if goes_on else [row + '\n']
        begun = []
    yield from begun


def _separator(line: str) -> str | None:
    """Return the separator of a line, None for white space."""
    counts = {mark: line.count(mark) for mark in ('\t', ';', ',')}
    best = max(counts, key=lambda mark: counts[mark])
    return best if counts[best] else None


def _holds(line: str) -> bool:
    """Return whether a line is neither empty nor a comment."""
    return bool(line.strip()) and not line.startswith(_COMMENTS)


def _width(cells: Sequence[str]) -> int:
    """Return the number of cells without the empty ones at the end."""
    return max((k for k, cell in enumerate(cells, 1) if cell), default=0)


def _is_missing(cell: str) -> bool:
    return cell.lower() in ('', 'nan', 'na', 'null', 'none', '-')


@lru_cache(maxsize=64)
def _items_of(cell: str) -> tuple[str, ...]:
    """Return the numbers of a list as Python or NumPy prints it, as text; empty if it is none."""
    if not _LIST.fullmatch(cell):
        return ()
    inner = cell[1:-1].strip(' ,')
    items = tuple(item.strip() for item in (inner.split(',') if ',' in inner else inner.split()))
    return items if all(_is_missing(item) or _all_numbers(item) for item in items) else ()


def _is_row(cells: Sequence[str], later: Sequence[str]) -> bool:
    """Return whether cells are of a row, not names: most are numbers, and texts are above texts."""
    def is_number(cell: str) -> bool:
        return _all_numbers(cell) or bool(_items_of(cell))

    texts = [k for k, cell in enumerate(cells) if not _is_missing(cell) and not is_number(cell)]
    return 2 * sum(map(is_number, cells)) > len(list(filter(None, cells))) and not any(
        is_number(later[k]) for k in texts if k < len(later))


def _all_numbers(line: str) -> bool:
    return bool(re.fullmatch(r'[\s\d.,;+\-eEnaN]+', line)) and bool(re.search(r'\d', line))


def _opened(path: Path, file: IO[bytes]) -> Any:
    """Return the plain bytes of an open file, which may be compressed."""
    return gzip.GzipFile(fileobj=file) if path.name.lower().endswith('.gz') else file


def _encoding(path: Path) -> str:
    """Return the encoding of a file: UTF-16, UTF-8 or, as spreadsheets on Windows write, cp1252.

    With a wrong one, the ° and µ of units would be lost.
    """
    with open_input(path) as file:
        first = _opened(path, file).read(_FIRST_BYTES)
    if first.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return 'utf-16'
    try:
        codecs.getincrementaldecoder('utf-8')().decode(first)
    except UnicodeDecodeError:
        return 'cp1252'
    return 'utf-8-sig'


def _header_in(lines: Sequence[str]) -> int:
    """Return the place of the header: the first line of names with as many cells as the rows.

    Above it, loggers write who measured what, and Excel the separator. It is the first line that is
    no comment where no line has as many.
    """
    places = [k for k, line in enumerate(lines) if _holds(line) and not re.fullmatch(
        'sep=.', line.strip(), re.IGNORECASE)]
    row = lines[places[3 * len(places) // 4]] if places else ''
    for k in places:
        mark = _separator(lines[k])
        cells = _split(lines[k], mark)
        if len(cells) == len(_split(row, mark)) > 1 and not any(map(_all_numbers, cells)):
            return k
    return next(iter(places), len(lines))


def _split(line: str, separator: str | None) -> list[str]:
    """Return the cells of a line; the separator is None for white space."""
    if separator is None:
        return line.split()
    cells = next(csv.reader([line.rstrip('\r\n')], delimiter=separator), [])
    return [cell.strip() for cell in cells]
