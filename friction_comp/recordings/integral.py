# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The position of a drive that is logged with its velocity only."""

from __future__ import annotations

import numpy as np

from friction_comp.errors import InputError
from friction_comp.facts.timing import gap_length
from friction_comp.recordings.row_times import spread_rounded

# Longest usual time from row to row, s, over which a velocity tells a motion: between rows that are
# farther apart, a joint may start and stop.
_LONGEST = 0.5


class Integral:
    """Integrates velocities to positions, block by block of a table's rows."""

    def __init__(self) -> None:
        self._stamp = np.empty(0, dtype=np.int64)   # of the last row, ns; then its other values
        self._velocity = self._position = np.empty(0)

    def positions(self, stamp: np.ndarray, velocity: np.ndarray, where: str) -> np.ndarray:
        """Return the positions at stamps in ns, by the trapezoidal rule; each of shape (N,).

        There is no motion over gaps. Raises InputError if rows are too far apart.
        """
        known = np.flatnonzero(np.isfinite(velocity))
        order = known[np.argsort(stamp[known], kind='stable')]
        result = np.full(len(velocity), np.nan)
        if not len(order):
            return result
        ordered = np.concatenate((self._stamp, spread_rounded(stamp[order], velocity[order], [])))
        speed = np.concatenate((self._velocity, velocity[order]))
        # A clock that is set back tells no motion.
        step = np.maximum(1e-9 * np.diff(ordered), 0.0)
        usual = float(np.median(step)) if len(step) else 0.0
        if usual > _LONGEST:
            raise InputError(
                f'{where}: no column holds the position, and rows {usual:.3g} s apart do not show '
                'the motion between them; means at constant speeds are read without their times: '
                'leave out that column')
        moved = np.where(step > gap_length(step), 0.0, 0.5 * step * (speed[1:] + speed[:-1]))
        path = np.cumsum(np.concatenate((self._position if len(self._position) else [0.0], moved)))
        result[order] = path[len(ordered) - len(order):]
        self._stamp, self._velocity, self._position = ordered[-1:], speed[-1:], path[-1:]
        return result
