# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Eq. 6 and a model's effects in compiled code, made of their own formulas.

`LiveTerm` evaluates an effect in Python, which starts at once. This takes a second to compile and
then costs a fraction of a microsecond: worth it where thousands of runs are simulated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import math
from typing import Any

from numba import float64, njit, types
import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.live_term import SHARPEST_LIVE
from friction_comp.model.effects.scene import Signals
from friction_comp.model.sigmoid import kinetic_current

SIGNATURE = float64(
    float64, float64, float64, float64, float64, types.Array(float64, 1, 'C'))
"""Of the function: time, position, velocity, temperature, load, memory; returns A."""

compiled_kinetic_current = njit(cache=True)(kinetic_current)
"""Eq. 6 for compiled code."""

_BEGAN, _START, _TIME, _POSITION, _STATES = range(5)


def memory_size(effects: Sequence[Effect]) -> int:
    """Return how many numbers a run has to keep for the function; they begin as zeros."""
    return _STATES + len(effects)


def compiled_current(effects: Sequence[Effect]) -> Callable[..., float]:
    """Return a compiled function that sums the current of effects for one sample.

    Parameters
    ----------
    effects : sequence of Effect
        Those that are not fed back are left out.

    Returns
    -------
    callable
        ``function(time, position, velocity, temperature, load, memory)`` in A, of the type
        `SIGNATURE`. `memory` is an ndarray of shape (`memory_size`,) that belongs to one run and
        changes in place. Signals that are not known may be NaN: effects that need them then add
        NaN, as in a recording that lacks them.
    """
    total = _nothing
    for place, effect in enumerate(effects):
        if not effect.not_fed_back:
            total = _with(total, effect, _STATES + place)
    return _with_clock(total)


@njit
def _nothing(time: float, position: float, velocity: float, temperature: float, load: float,
             began: bool, memory: np.ndarray) -> float:
    return 0.0


def _with(rest: Any, effect: Effect, place: int) -> Any:
    """Return a compiled function that adds an effect to others."""
    values = effect.live_constants(effect.values)
    c, gains = effect.Constants(**values), tuple(float(value) for value in effect.coefficients)
    transition = float(values.get('transition', 0.0))
    columns, remembers, fades = njit(effect.columns), effect.sees_history, effect.fades_at_rest
    step = effect.step if remembers else _keep
    start = float(effect.start(0.0, c))

    @njit
    def total(time: float, position: float, velocity: float, temperature: float, load: float,
              began: bool, memory: np.ndarray) -> float:
        side = math.tanh(velocity / transition) if transition > 0.0 else 0.0
        if remembers:
            if began:
                memory[place] = step(memory[place], max(0.0, time - memory[_TIME]),
                                     position - memory[_POSITION], velocity, c)
            else:
                memory[place] = start
        x = Signals(time - memory[_START], position, velocity, 0.0, load, temperature, side,
                    memory[place], math.nan, math.nan)
        value = 0.0
        parts = columns(x, c)
        for k in range(len(gains)):
            value += gains[k] * parts[k]
        if fades:
            value *= abs(math.tanh(velocity / SHARPEST_LIVE))
        return value + rest(time, position, velocity, temperature, load, began, memory)
    return total


@njit
def _keep(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    return state


def _with_clock(total: Any) -> Any:
    @njit(SIGNATURE)
    def function(time: float, position: float, velocity: float, temperature: float, load: float,
                 memory: np.ndarray) -> float:
        began = memory[_BEGAN] > 0.0
        if not began or time < memory[_START]:
            memory[_START] = time
        value = total(time, position, velocity, temperature, load, began, memory)
        memory[_BEGAN], memory[_TIME], memory[_POSITION] = 1.0, time, position
        return value
    return function
