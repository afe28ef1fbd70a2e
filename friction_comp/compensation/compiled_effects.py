# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a model's effects ask of the compensator, as one compiled function of a sample.

`EffectsHere` asks them in Python, which starts at once. This takes a second or two to compile and
then costs a fraction of a microsecond: worth it where thousands of runs are simulated. It is made
of the effects' own formulas.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
import math
from typing import Any

from numba import boolean, cfunc, float64, from_dtype, njit, types, void
import numpy as np

from friction_comp.compensation.effects_here import EffectsHere
from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.edges import between, ends_of
from friction_comp.model.effects.live_term import SHARPEST_LIVE
from friction_comp.model.effects.scene import CARRIES, Signals
from friction_comp.model.friction_model import FrictionModel

ASKED = np.dtype([(name, float) for name in (
    'forward', 'backward', 'carried', 'shift_positive', 'shift_negative')], align=True)
"""What effects ask for in A, as `effects_here.Asked` has it."""

SIGNATURE = void(float64, float64, float64, float64, boolean, types.Array(float64, 1, 'C'),
                 from_dtype(ASKED))
"""Of the function: time, position, speed, temperature, continuous, memory, asked."""

_BEGAN, _START, _TIME, _POSITION, _STATES = range(5)
_HERE = {'temperature'}


def memory_size(model: FrictionModel | None) -> int:
    """Return how many numbers a run has to keep for the function; they begin as zeros."""
    return _STATES + (0 if model is None else len(model.effects))


def compiled_effects(model: FrictionModel | None) -> Callable[..., None]:
    """Return a compiled function that says what a model's effects ask for, one sample at a time.

    Parameters
    ----------
    model : FrictionModel or None
        Effects that are not fed back are left out, and those that need more than this joint's own
        motion and temperature. None asks for nothing.

    Returns
    -------
    callable
        ``function(time, position, speed, temperature, continuous, memory, asked)`` of the type
        `SIGNATURE`, which compiled code takes as an argument. `memory` is an ndarray of shape
        (`memory_size`,) that belongs to one run, `asked` a record of `ASKED`; both change in
        place. `continuous` tells the continuous law from those that know no operator: the latter
        get the sum of all effects as `carried`.
    """
    if model is None:
        return _asking_nothing()
    here = EffectsHere(model, Effect.why_left_out)
    ask = _nothing
    for place, (effect, term) in enumerate(here.terms):
        if set(term.needs) <= _HERE:
            ask = _with(ask, effect, _STATES + place, here.places)
    return _with_clock(ask)


@cache
def _asking_nothing() -> Callable[..., None]:
    return _with_clock(_nothing)


@njit
def _nothing(time: float, position: float, speed: float, temperature: float, continuous: bool,
             dt: float, dq: float, began: bool, memory: np.ndarray, asked: Any) -> None:
    pass


@njit
def _keep(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    return state


def _value(effect: Effect) -> Any:
    """Return a compiled function that evaluates an effect on one side."""
    c = effect.Constants(**effect.live_constants(effect.values))
    gains = tuple(float(value) for value in effect.coefficients)
    columns, held = njit(effect.columns), njit(between)
    lowest, highest = ends_of(effect.valid_range, 'position')
    slowest, fastest = ends_of(effect.valid_range, 'velocity')
    coldest, warmest = ends_of(effect.valid_range, 'temperature')

    @njit
    def value(time: float, position: float, velocity: float, temperature: float, side: float,
              state: float) -> float:
        x = Signals(time, held(position, lowest, highest), held(velocity, slowest, fastest), 0.0,
                    math.nan, held(temperature, coldest, warmest), side, state, math.nan,
                    math.nan)
        parts, total = columns(x, c), 0.0
        for k in range(len(gains)):
            total += gains[k] * parts[k]
        return total
    return value


def _sides(effect: Effect) -> tuple[Any, Any]:
    """Return what `LiveTerm.update` and `LiveTerm.both_sides` are, compiled."""
    constants = effect.live_constants(effect.values)
    value, fades = _value(effect), effect.fades_at_rest
    c, transition = effect.Constants(**constants), float(constants.get('transition') or 0.0)
    up, down = float(effect.start(1.0, c)), float(effect.start(-1.0, c))

    @njit
    def update(time: float, position: float, velocity: float, temperature: float, state: float
               ) -> float:
        side = math.tanh(velocity / transition) if transition > 0.0 else 0.0
        found = value(time, position, velocity, temperature, side, state)
        if fades:
            found *= abs(math.tanh(velocity / SHARPEST_LIVE))
        return found

    @njit
    def both_sides(time: float, position: float, speed: float, temperature: float, state: float
                   ) -> tuple[float, float]:
        speed = abs(speed)
        return (value(time, position, speed, temperature, 1.0, up if up != 0.0 else state),
                value(time, position, -speed, temperature, -1.0, down if down != 0.0 else state))
    return update, both_sides


def _shift(effect: Effect, update: Any, both_sides: Any,
           places: tuple[float, float] | None) -> Any:
    """Return how much more a joint bears here than where its breakaway was measured, compiled."""
    known, carries = places is not None and not effect.sees_history, effect.role == CARRIES
    positive, negative = places or (0.0, 0.0)

    @njit
    def shift_from(place: float, sign: float, time: float, position: float, temperature: float
                   ) -> float:
        if carries:
            found = -sign * update(time, place, 0.0, temperature, 0.0)
        else:
            here = both_sides(time, position, 0.0, temperature, 0.0)
            there = both_sides(time, place, 0.0, temperature, 0.0)
            found = 0.5 * (here[0] - here[1] - there[0] + there[1])
        return found if math.isfinite(found) else 0.0

    @njit
    def shift(time: float, position: float, temperature: float, asked: Any) -> None:
        if known:
            asked.shift_positive += shift_from(positive, 1.0, time, position, temperature)
            asked.shift_negative += shift_from(negative, -1.0, time, position, temperature)
    return shift


def _with(rest: Any, effect: Effect, place: int, places: tuple[float, float] | None) -> Any:
    """Return a compiled function that adds what an effect asks for to what others do."""
    c = effect.Constants(**effect.live_constants(effect.values))
    update, both_sides = _sides(effect)
    shift, carries = _shift(effect, update, both_sides, places), effect.role == CARRIES
    turns = effect.turning() is not None
    remembers, first = effect.sees_history, float(effect.start(0.0, c))
    step = effect.step if remembers else _keep

    @njit
    def ask(time: float, position: float, speed: float, temperature: float, continuous: bool,
            dt: float, dq: float, began: bool, memory: np.ndarray, asked: Any) -> None:
        rest(time, position, speed, temperature, continuous, dt, dq, began, memory, asked)
        if remembers:
            memory[place] = step(memory[place], dt, dq, speed, c) if began else first
        state = memory[place]
        if continuous and turns:
            forward = backward = carried = 0.0
        elif continuous and not carries:
            forward, backward = both_sides(time, position, speed, temperature, state)
            carried = 0.0
        else:
            forward = backward = 0.0
            carried = update(time, position, speed, temperature, state)
        if math.isfinite(forward) and math.isfinite(backward) and math.isfinite(carried):
            asked.forward += forward
            asked.backward += backward
            asked.carried += carried
            shift(time, position, temperature, asked)
    return ask


def _with_clock(ask: Any) -> Callable[..., None]:
    @cfunc(SIGNATURE)
    def function(time: float, position: float, speed: float, temperature: float, continuous: bool,
                 memory: np.ndarray, asked: Any) -> None:
        began = memory[_BEGAN] > 0.0
        if not began or time < memory[_START]:
            memory[_START] = time
        asked.forward = asked.backward = asked.carried = 0.0
        asked.shift_positive = asked.shift_negative = 0.0
        ask(time - memory[_START], position, speed, temperature, continuous,
            max(0.0, time - memory[_TIME]), position - memory[_POSITION], began, memory, asked)
        memory[_BEGAN], memory[_TIME], memory[_POSITION] = 1.0, time, position
    return function
