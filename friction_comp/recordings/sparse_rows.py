# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads rows that hold a value or two each, as they came, with empty cells for the other signals.

So logs of several topics are written as one table, and several files with times of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from friction_comp.recordings.time_base import at_times

# Share of the rows of the rarest signal that hold the others, too, where rows are whole.
_WHOLE = 0.5


def gathered(columns: Mapping[str, np.ndarray], time: np.ndarray,
             pairs: Sequence[tuple[str, str]], turns: Mapping[str, float]
             ) -> tuple[dict[str, np.ndarray], np.ndarray, str]:
    """Return columns, each of shape (T,), and times, s, of the rows that hold the rarest signal.

    Signals that these rows lack are interpolated. If effort and position of each of the `pairs` are
    mostly in the same rows, all are returned as they are. The third item is the rarest column, ''
    in that case. An effort comes before a position that is as rare, since its noise counts. `turns`
    holds the length of a turn of angles in the unit of the column; they stay wrapped around.
    """
    known = {name: np.isfinite(columns[name]) & np.isfinite(time)
             for pair in pairs for name in pair}
    if all((known[one] & known[other]).sum() > _WHOLE * min(known[one].sum(), known[other].sum())
           for one, other in pairs) or not all(values.any() for values in known.values()):
        return dict(columns), time, ''
    rarest = min(known, key=lambda name: int(known[name].sum()))
    at = np.sort(time[known[rarest]])
    return {name: _at(values, time, at, turns.get(name, 0.0))
            for name, values in columns.items()}, at, rarest


def _at(values: np.ndarray, time: np.ndarray, at: np.ndarray, turn: float) -> np.ndarray:
    """Return values at other times, NaN in gaps and beyond the ends; a single value is constant."""
    known = np.isfinite(values) & np.isfinite(time)
    order = np.argsort(time[known], kind='stable')
    if not len(order):
        return np.full(len(at), np.nan)
    own = time[known][order]
    beyond = (len(own) > 1) & ((at < own[0]) | (at > own[-1]))
    given = values[known][order]
    found = np.where(beyond, np.nan, at_times(at, own, given, turn=turn))
    if not turn:
        return found
    # Wrapped around as in the file: the batches in which it is read are unwrapped together, later.
    low = float(given.min())
    return np.where((found < low) | (found > given.max()), low + np.mod(found - low, turn), found)
