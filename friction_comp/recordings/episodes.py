# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of several episodes, one after the other: what lies between two of them is no motion."""

from __future__ import annotations

import re

import numpy as np

from friction_comp.recordings.table_base import Labels, Table

# Words of a column, or of a group, that says which episode rows are of.
_WORDS = {'episode', 'episodes', 'demo', 'demos', 'trial', 'trajectory', 'traj', 'rollout'}
_NUMBER = {'no', 'nr', 'num', 'number', 'index', 'idx', 'id'}
EPISODE = 'episode'
# Fewest rows in an episode, and how far apart episodes are set, s.
_FEWEST, _APART = 10, 1.0


def is_episode(name: str) -> bool:
    """Return whether a name is that of an episode, or of the column that tells it."""
    words = {word.lower() for word in re.findall(r'[^\W\d_]+', name)}
    return bool(words & _WORDS) and not words - _WORDS - _NUMBER


def column_of_episodes(table: Table, used: list[str]) -> str | None:
    """Return the column that says which episode each row is of, and label it; None without one.

    `used` are the columns of signals. A column that changes at every few rows says something else.
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
