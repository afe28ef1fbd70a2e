# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Text tables as spreadsheets, loggers and laboratory programs write them.

The encoding, the lines above the header, the separator and the decimal mark are found in the file.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator, Sequence
import csv
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
from friction_comp.recordings.table_base import Columns, Table
from friction_comp.units import parse_unit

_COMMENTS = ('#', '%')
# Lines in which the header is looked for, and bytes by which the encoding is told.
_FIRST_LINES, _FIRST_BYTES = 200, 65536
# Lines of the longest quoted cell, a cell in quotes, and one that begins with a quote at the end.
_LONGEST_CELL = 50
_QUOTED, _UNFINISHED = re.compile(r'"[^"]*"'), re.compile(r'(^|[,;\t])\s*"[^"]*$')


class Csv(Table):
    """A text file with one row per line; the separator is the most frequent one in its header."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._encoding = _encoding(path)
        with path.open('rb') as file:
            lines = list(islice(_whole_rows(self._text(file)), _FIRST_LINES))
        if any('\0' in line for line in lines):
            raise InputError(f'{path}: not a text file')
        # Skip comments before the header; numpy.savetxt writes the header itself as a comment.
        header = _header_in(lines)
        head = lines[header] if header < len(lines) else ''
        if not head.strip():
            raise InputError(f'{path}: is empty')
        self._separator = _separator(head)
        self.names = _split(head, self._separator)
        self._skip = header + 1
        comment = self._names_in(lines[header - 1].lstrip('#% ')) if header else []
        fits = len(comment) == len(self.names)
        if _all_numbers(head) or (fits and any(read_name(name).signal for name in comment)
                                  and not any(read_name(name).signal for name in self.names)):
            # Not a header: names are in the comment above it, otherwise columns are numbered.
            self.names = comment if fits else [str(k + 1) for k in range(len(self.names))]
            self._skip = header
        elif units := self._units_in(lines[header + 1:header + 2]):
            self.names = [f'{name} [{unit}]' if unit else name
                          for name, unit in zip(self.names, units)]
            self._skip += 1
        # Spreadsheets end lines with empty cells: a column without a name is none.
        self._index = {name: k for k, name in enumerate(self.names) if name}
        named = [name for name in self.names if name]
        self.doubled = list(dict.fromkeys(name for name in named if named.count(name) > 1))
        self.names = [name for name in named if name not in self.doubled]

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
        indices = [self._index[name] for name in wanted]
        size = self.path.stat().st_size
        with self.path.open('rb') as file:
            # Kept, since it closes the file when it goes.
            plain = self._text(file)
            text = _whole_rows(plain)
            first_line = sum(1 for _ in islice(text, self._skip))
            while lines := list(islice(text, rows)):
                columns = self._parse(lines, indices, first_line).T
                # The position in the file, which may be compressed.
                yield dict(zip(wanted, columns)), file.tell() / size
                first_line += len(lines)

    def _parse(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        if self._separator != ',':
            # A comma that does not separate is a decimal one.
            lines = [line.replace(',', '.') for line in lines]
        try:
            values = np.loadtxt(lines, delimiter=self._separator, usecols=indices, ndmin=2,
                                comments=None)
        except ValueError:
            # Cells are missing or not numeric: parse slowly, with a clear error.
            return self._parse_each(lines, indices, first_line)
        for name, labels in self.labels.items():
            if self._index[name] in indices and len(values):
                place = indices.index(self._index[name])
                values[:, place] = labels.codes(values[:, place])
        return values

    def _parse_each(self, lines: list[str], indices: list[int], first_line: int) -> np.ndarray:
        rows = []
        for k, line in enumerate(lines, first_line + 1):
            if line.strip() and not line.startswith(_COMMENTS):
                cells = _split(line, self._separator)
                # The last line of a truncated file has fewer cells.
                complete = len(cells) > max(indices)
                rows.append([self._number(cells[index], index, k) if complete else np.nan
                             for index in indices])
        return np.array(rows).reshape(len(rows), len(indices))

    def _number(self, cell: str, index: int, line: int) -> float:
        for name, labels in self.labels.items():
            if self._index[name] == index:
                return labels.code(cell)
        if cell.lower() in ('', 'nan', 'na', 'null', 'none', '-'):
            return float('nan')
        try:
            return float(cell)
        except ValueError:
            pass
        try:
            return date_in_seconds(cell)
        except ValueError:
            name = next(name for name, place in self._index.items() if place == index)
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


def _all_numbers(line: str) -> bool:
    return bool(re.fullmatch(r'[\s\d.,;+\-eEnaN]+', line)) and bool(re.search(r'\d', line))


def _opened(path: Path, file: IO[bytes]) -> Any:
    """Return the plain bytes of an open file, which may be compressed."""
    return gzip.GzipFile(fileobj=file) if path.name.lower().endswith('.gz') else file


def _encoding(path: Path) -> str:
    """Return the encoding of a file: UTF-16, UTF-8 or, as spreadsheets on Windows write, cp1252.

    With a wrong one, the ° and µ of units would be lost.
    """
    with path.open('rb') as file:
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
    places = [k for k, line in enumerate(lines) if line.strip() and not line.startswith(_COMMENTS)
              and not re.fullmatch('sep=.', line.strip(), re.IGNORECASE)]
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
