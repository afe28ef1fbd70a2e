# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What all readers of tables have: columns by name, read in blocks of rows, as numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from friction_comp.column_values import to_numbers

Columns = dict[str, np.ndarray]
# Rows of a block, and those that are looked at to find out what a column says.
_ROWS = 250_000


class Labels:
    """Numbers the different values of a column, texts or numbers, in the order of their rows."""

    def __init__(self) -> None:
        self._codes: dict[str, int] = {}

    @property
    def names(self) -> list[str]:
        """The values as text, by number."""
        return list(self._codes)

    def code(self, value: str | float) -> float:
        """Return the number of one value; NaN if it is missing."""
        text = str(value).strip().strip('"\'')
        with suppress(ValueError):
            text = f'{float(text):g}'
        if text in ('', 'nan', 'None'):
            return float('nan')
        return float(self._codes.setdefault(text, len(self._codes)))

    def codes(self, values: np.ndarray) -> np.ndarray:
        """Return the numbers of all values, shape (N,)."""
        values = np.asarray(values)
        if values.dtype == object:
            values = values.astype(str)
        different, first, inverse = np.unique(values, return_index=True, return_inverse=True)
        codes = np.full(len(different), np.nan)
        for k in np.argsort(first):
            codes[k] = self.code(different[k])
        return codes[inverse]


class Table(ABC):
    """A file with columns of the given `names`; `path` names it in messages."""

    names: list[str]

    def __init__(self, path: Path) -> None:
        self.path = path
        self.doubled: list[str] = []    # names of several columns, which are left out
        self.labels: dict[str, Labels] = {}     # columns whose values are numbered
        self.notes: list[str] = []      # on what was left out in reading

    @abstractmethod
    def blocks(self, wanted: Sequence[str], rows: int) -> Iterator[tuple[Columns, float]]:
        """Yield blocks of columns and the share of the file that has been read."""

    def whole(self, names: Sequence[str]) -> Columns:
        """Return columns in memory."""
        blocks = [block for block, _ in self.blocks(names, _ROWS)]
        return {name: np.concatenate([np.empty(0), *(block[name] for block in blocks)])
                for name in names}

    def first_rows(self, *names: str) -> list[np.ndarray]:
        """Return the first rows of columns, none of an empty table."""
        block, _ = next(iter(self.blocks(names, _ROWS)), ({}, 1.0))
        return [block.get(name, np.empty(0)) for name in names]

    def is_labelled(self, name: str, holds: Callable[..., bool], *others: str) -> bool:
        """Number the values of a column, if that makes sense; return whether it does.

        `holds` says so of the labels of the first rows, their numbers, and the values of `others`.
        """
        labels = self.labels[name] = Labels()
        # Reading numbers the values.
        first = self.first_rows(name, *others)
        if not holds(labels, *first):
            del self.labels[name]
        return name in self.labels

    def numbers(self, values: np.ndarray, name: str) -> np.ndarray:
        """Return values of a column as floats: numbered, or as `to_numbers` converts them."""
        labels = self.labels.get(name)
        return labels.codes(values) if labels else to_numbers(values, name, self.path)
