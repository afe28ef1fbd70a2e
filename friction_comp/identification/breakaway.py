# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Breakaway currents of an identification, and their statistics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.friction_model import Breakaway


class SlideBegin(NamedTuple):
    """Where a joint breaks away on a ramp: time in s, measured current in A, position in rad."""

    time: float
    current: float
    position: float


@dataclass(frozen=True)
class BreakawayRecords:
    """Every breakaway of an identification; arrays of shape (M,), in order of time."""

    time: np.ndarray        # s
    current: np.ndarray     # A, negative in the negative direction
    position: np.ndarray    # rad
    direction: np.ndarray   # +1 or -1

    def __len__(self) -> int:
        return len(self.time)

    def currents(self, direction: int) -> np.ndarray:
        """Return the currents of one direction in A, signed."""
        return self.current[self.direction == direction]

    def statistics(self) -> Breakaway:
        """Return means, standard deviations and mean positions.

        Raises InputError if a direction has no breakaway.
        """
        values = {}
        for name, direction in (('positive', 1), ('negative', -1)):
            currents = self.currents(direction)
            if currents.size == 0:
                raise InputError(f'no breakaway in the {name} direction')
            values[f'{name}_mean'] = float(np.mean(currents))
            values[f'{name}_std'] = float(np.std(currents, ddof=1)) if currents.size > 1 else 0.0
            values[f'{name}_position'] = float(np.mean(self.position[self.direction == direction]))
        return Breakaway(**values)


def breakaway_records(begins: list[SlideBegin], directions: list[int]) -> BreakawayRecords:
    """Return the beginnings of slides, and their directions, as arrays."""
    time, current, position = np.array(begins, dtype=float).reshape(-1, 3).T
    return BreakawayRecords(time, current, position, np.array(directions, dtype=int))
