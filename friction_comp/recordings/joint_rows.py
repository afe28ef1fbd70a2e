# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables whose rows are those of several joints, one after the other, as a bus is logged.

A column then says whose row it is: a name, or the number of a motor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
import re
from typing import Protocol

import numpy as np

from friction_comp.column_names import read_name

# Words of a column that says whose row it is; those that may say something else are not believed
# alone.
_JOINT = {'joint', 'motor', 'actuator', 'servo', 'axis', 'drive'}
_ANY = {'name', 'id', 'node', 'device', 'can'}
_NUMBER = {'no', 'nr', 'num', 'number', 'index', 'idx'}
# Rows that are looked at, and the most joints of a robot.
_ROWS, _MOST = 250_000, 64


class Table(Protocol):
    """What all readers of tables have."""

    names: list[str]
    labels: dict[str, Labels]

    def blocks(self, wanted: Sequence[str], rows: int
               ) -> Iterator[tuple[dict[str, np.ndarray], float]]:
        """Yield blocks of columns."""


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


def column_of_joints(table: Table, used: Sequence[str], time: str | None) -> str | None:
    """Return the column that says whose row each row is, and label it; None if there is none.

    A text beside the word joint, or one like it, is believed. Other values may be those of a state
    or of a trial: they are believed if they change from row to row, as on a bus, or if the time
    begins anew with each. `used` are the columns of signals, `time` is that of the time.
    """
    for name in table.names:
        words = {word.lower() for word in re.findall(r'[^\W\d_]+', name)}
        if not words & (_JOINT | _ANY) or words - _JOINT - _ANY - _NUMBER or name in used or (
                read_name(name).signal):
            continue
        labels = table.labels[name] = Labels()
        wanted = [name] if time is None else [name, time]
        for block, _ in islice(table.blocks(wanted, _ROWS), 1):
            if _is_of_joints(block[name], labels, bool(words & _JOINT), block.get(time or '')):
                return name
        del table.labels[name]
    return None


def _is_of_joints(codes: np.ndarray, labels: Labels, says_joint: bool, time: np.ndarray | None
                  ) -> bool:
    count = len(labels.names)
    if not 0 < count <= min(_MOST, max(len(codes) // 2, 1)):
        return False
    numbered = all(re.fullmatch(r'[-+.\de]+', text) for text in labels.names)
    if says_joint and not numbered:
        return True
    changed = np.flatnonzero(np.diff(codes))
    if count < 2 or not len(changed):
        return False
    anew = time is not None and bool((np.diff(time)[changed] < 0.0).all())
    return len(changed) > 0.5 * len(codes) or anew
