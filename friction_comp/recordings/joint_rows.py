# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables whose rows are those of several joints, one after the other, as a bus is logged.

A column then says whose row it is: a name, or the number of a motor.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import re

import numpy as np

from friction_comp.column_names import read_name
from friction_comp.recordings.table_base import Labels, Table

# Words of a column that says whose row it is; those that may say something else are not believed
# alone.
_JOINT = {'joint', 'motor', 'actuator', 'servo', 'axis', 'drive'}
_ANY = {'name', 'id', 'node', 'device', 'can', 'leg', 'limb', 'side', 'finger'}
_NUMBER = {'no', 'nr', 'num', 'number', 'index', 'idx'}
# The most joints of a robot.
_MOST = 64
# Fewest rows with the time of the row before, and most with the time and the text of another, as
# shares of all rows, where a text tells rows of one time apart.
_SHARED, _ALIKE = 0.4, 0.02
_NUMERAL = r'[-+.\de]+'


def column_of_joints(table: Table, used: Sequence[str], time: str | None) -> str | None:
    """Return the column that says whose row each row is, and label it; None if there is none.

    A text beside the word joint, or one like it, is believed. Other values may be those of a state
    or of a trial: they are believed if they change from row to row, as on a bus, or if the time
    begins anew with each; of a column with another name, texts that tell rows of one time apart.
    `used` are the columns of signals, `time` is that of the time.
    """
    last, times = list[str](), () if time is None else (time,)
    for name in table.names:
        words = {word.lower() for word in re.findall(r'[^\W\d_]+', name)}
        if name in used or read_name(name).signal:
            continue
        if not words & (_JOINT | _ANY) or words - _JOINT - _ANY - _NUMBER:
            last.append(name)
        elif table.is_labelled(
                name, partial(_is_of_joints, bool(words & _JOINT)), *times):
            return name
    if time is None or not last:
        return None
    first, = table.first_rows(time)
    if np.count_nonzero(np.diff(first) == 0.0) < _SHARED * len(first):
        return None
    return next((name for name in last if table.is_labelled(name, _tells_apart, time)), None)


def _tells_apart(labels: Labels, codes: np.ndarray, time: np.ndarray) -> bool:
    """Return whether values are texts, few of which are alike in rows of one time."""
    if not 1 < len(labels.names) <= _MOST or any(
            re.fullmatch(_NUMERAL, text) for text in labels.names):
        return False
    pairs = np.column_stack((time, codes))[np.isfinite(time) & np.isfinite(codes)]
    return len(np.unique(pairs, axis=0)) > (1.0 - _ALIKE) * len(codes)


def _is_of_joints(says_joint: bool, labels: Labels, codes: np.ndarray,
                  time: np.ndarray | None = None) -> bool:
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
