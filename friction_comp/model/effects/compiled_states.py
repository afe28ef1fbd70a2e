# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The steps of effects with memory, compiled, over all samples; imported for long recordings.

Importing the compiler takes as long as stepping through a million samples without it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
import numpy as np

from friction_comp.model.effects.steps import backlash_step, dahl_step, rest_step

_dahl, _backlash, _rest = (njit(cache=True)(step) for step in (dahl_step, backlash_step, rest_step))


# One function each: compiled code is kept for functions that it names, not for arguments.

@njit(cache=True)
def _dahl_states(time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 begins: np.ndarray, start: np.ndarray, c: Any) -> np.ndarray:
    states = start.copy()
    for k in np.flatnonzero(~begins):
        states[k] = _dahl(states[k - 1], 0.0, position[k] - position[k - 1], 0.0, c)
    return states


@njit(cache=True)
def _backlash_states(time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                     begins: np.ndarray, start: np.ndarray, c: Any) -> np.ndarray:
    states = start.copy()
    for k in np.flatnonzero(~begins):
        states[k] = _backlash(states[k - 1], 0.0, position[k] - position[k - 1], 0.0, c)
    return states


@njit(cache=True)
def _rest_states(time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                 begins: np.ndarray, start: np.ndarray, c: Any) -> np.ndarray:
    states = start.copy()
    for k in np.flatnonzero(~begins):
        states[k] = _rest(states[k - 1], time[k] - time[k - 1], position[k] - position[k - 1],
                          velocity[k], c)
    return states


STATES: dict[str, Callable[..., np.ndarray]] = {
    'hysteresis': _dahl_states, 'backlash': _backlash_states, 'rest_time': _rest_states}
"""By the effect's name: its states at all samples, (N,), from those at the start of segments."""
