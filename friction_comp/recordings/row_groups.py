# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables whose rows are those of several joints or episodes, one after the other.

A column then says whose row it is, as where a bus is logged: a name, or the number of a motor; or
which episode it is of. What lies between two episodes is no motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import re

import numpy as np

from friction_comp.column_names import read_name
from friction_comp.recordings.table_base import Labels, Table

# Words of a column that names the joint of each row. Those of `_ANY` may mean something else, so
# that the values have to change like joints.
_JOINT = {'joint', 'motor', 'actuator', 'servo', 'axis', 'drive'}
_ANY = {'name', 'id', 'node', 'device', 'can', 'leg', 'limb', 'side', 'finger'}
_NUMBER = {'no', 'nr', 'num', 'number', 'index', 'idx'}
# Words of a column, or of a group, that says which episode rows are of.
_EPISODE = {'episode', 'episodes', 'demo', 'demos', 'trial', 'trajectory', 'traj', 'rollout'}
EPISODE = 'episode'
# Fewest rows in an episode, and how far apart episodes are set, s.
_FEWEST, _APART = 10, 1.0
# The most joints of a robot.
_MOST = 64
# A text names the joint of a row if at least this share of rows have the time of the row before,
# and at most that share have the time and the text of another row.
_SHARED, _ALIKE = 0.4, 0.02
_NUMERAL = r'[-+.\de]+'


def _words_in(name: str) -> set[str]:
    return {word.lower() for word in re.findall(r'[^\W\d_]+', name)}


def column_of_joints(table: Table, used: Sequence[str], time: str | None) -> str | None:
    """Return the column that says whose row each row is, and label it; None if there is none.

    A text beside the word joint, or one like it, is believed. Other values may be those of a state
    or of a trial: they are believed if they change from row to row, as on a bus, or if the time
    begins anew with each; of a column with another name, texts that tell rows of one time apart.
    `used` are the columns of signals, `time` is that of the time.
    """
    last, times = list[str](), () if time is None else (time,)
    for name in table.names:
        words = _words_in(name)
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
    """Return whether values name joints: few texts, or changes in most rows or with new times."""
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


def is_episode(name: str) -> bool:
    """Return whether a name is that of an episode, or of the column that tells it."""
    words = _words_in(name)
    return bool(words & _EPISODE) and not words - _EPISODE - _NUMBER - {'id'}


def column_of_episodes(table: Table, used: list[str]) -> str | None:
    """Return the column with the episode of each row, and label it; None without one.

    `used` are the columns of signals. Episodes do not change at every few rows.
    """
    def holds(_: Labels, numbers: np.ndarray) -> bool:
        return bool(np.count_nonzero(np.diff(numbers)) * _FEWEST < len(numbers))

    return next((name for name in table.names if is_episode(name) and name not in used
                 and table.is_labelled(name, holds)), None)


class Episodes:
    """Sets the rows of episodes apart in time, block by block."""

    def __init__(self) -> None:
        self._number, self._time, self._later = np.nan, np.nan, 0.0

    def apart(self, number: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return times, s, that go on with a pause where another episode begins."""
        time = np.where(np.isfinite(time), time, np.nan)
        step = np.diff(time, prepend=self._time)
        change = np.diff(number, prepend=self._number)
        begins = np.isfinite(change) & (change != 0.0) & (step < _APART)
        later = self._later + np.cumsum(np.where(begins, _APART - step, 0.0))
        self._number, self._time, self._later = number[-1], time[-1], float(later[-1])
        return np.asarray(time + later)
