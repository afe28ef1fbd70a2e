# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The steps of effects with memory, compiled, over all samples; imported for long recordings.

Importing the compiler takes as long as stepping through a million samples without it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit
import numpy as np

from friction_comp.model.effects.steps import backlash_step, dahl_step, rest_step

# One function for all kinds: compiled code is kept for functions that it names, not for arguments.
KINDS = ('hysteresis', 'backlash', 'rest_time')
_dahl, _backlash, _rest = (njit(cache=True)(step) for step in (dahl_step, backlash_step, rest_step))


class Memory(NamedTuple):
    """The constants of all steps, of which each reads its own."""

    distance: float = 1.0
    exponent: float = 1.0
    gap: float = 1.0
    time_constant: float = 1.0
    velocity: float = 1.0


@njit(cache=True)
def all_states(kind: int, time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
               begins: np.ndarray, start: np.ndarray, c: Any) -> np.ndarray:
    """Return the states at all samples, (N,), from those at the start of segments."""
    result = start.copy()
    for k in np.flatnonzero(~begins):
        before, dt, dq = result[k - 1], time[k] - time[k - 1], position[k] - position[k - 1]
        if kind == 0:
            result[k] = _dahl(before, dt, dq, velocity[k], c)
        elif kind == 1:
            result[k] = _backlash(before, dt, dq, velocity[k], c)
        else:
            result[k] = _rest(before, dt, dq, velocity[k], c)
    return result
