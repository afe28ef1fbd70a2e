# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables whose rows are those of several joints, one after the other, as a bus is logged.

A column then says whose row it is: a name, or the number of a motor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import islice
import re
from typing import Protocol

import numpy as np

from friction_comp.column_names import read_name

# Words of a column that says whose row it is; those that may say something else are not believed
# alone.
_JOINT = {'joint', 'motor', 'actuator', 'servo', 'axis', 'drive'}
_ANY = {'name', 'id', 'node', 'device', 'can', 'leg', 'limb', 'side', 'finger'}
_NUMBER = {'no', 'nr', 'num', 'number', 'index', 'idx'}
# Rows that are looked at, and the most joints of a robot.
_ROWS, _MOST = 250_000, 64
# Fewest rows with the time of the row before, and most with the time and the text of another, as
# shares of all rows, where a text tells rows of one time apart.
_SHARED, _ALIKE = 0.4, 0.02
_NUMERAL = r'[-+.\de]+'


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
    begins anew with each; of a column with another name, texts that tell rows of one time apart.
    `used` are the columns of signals, `time` is that of the time.
    """
    last = list[str]()
    for name in table.names:
        words = {word.lower() for word in re.findall(r'[^\W\d_]+', name)}
        if name in used or read_name(name).signal:
            continue
        if not words & (_JOINT | _ANY) or words - _JOINT - _ANY - _NUMBER:
            last.append(name)
        elif _labelled(table, name, time, partial(_is_of_joints, bool(words & _JOINT))):
            return name
    if time is None or not last:
        return None
    block, _ = next(iter(table.blocks([time], _ROWS)), ({time: np.empty(0)}, 1.0))
    if np.count_nonzero(np.diff(block[time]) == 0.0) < _SHARED * len(block[time]):
        return None
    return next((name for name in last if _labelled(table, name, time, _tells_apart)), None)


def _labelled(table: Table, name: str, time: str | None, holds: Callable[
        [np.ndarray, Labels, np.ndarray | None], bool]) -> bool:
    """Number the values of a column, and return whether `holds` is true of them; else undo it."""
    labels = table.labels[name] = Labels()
    for block, _ in islice(table.blocks([name] if time is None else [name, time], _ROWS), 1):
        if holds(block[name], labels, block.get(time or '')):
            return True
    del table.labels[name]
    return False


def _tells_apart(codes: np.ndarray, labels: Labels, time: np.ndarray | None) -> bool:
    """Return whether values are texts, few of which are alike in rows of one time."""
    if time is None or not 1 < len(labels.names) <= _MOST or any(
            re.fullmatch(_NUMERAL, text) for text in labels.names):
        return False
    pairs = np.column_stack((time, codes))[np.isfinite(time) & np.isfinite(codes)]
    return len(np.unique(pairs, axis=0)) > (1.0 - _ALIKE) * len(codes)


def _is_of_joints(says_joint: bool, codes: np.ndarray, labels: Labels, time: np.ndarray | None
                  ) -> bool:
    count = len(labels.names)
    if not 0 < count <= min(_MOST, max(len(codes) // 2, 1)):
        return False
    numbered = all(re.fullmatch(_NUMERAL, text) for text in labels.names)
    if says_joint and not numbered:
        return True
    changed = np.flatnonzero(np.diff(codes))
    if count < 2 or not len(changed):
        return False
    anew = time is not None and bool((np.diff(time)[changed] < 0.0).all())
    return len(changed) > 0.5 * len(codes) or anew
