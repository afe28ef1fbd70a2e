# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that people ask of a model, each computed from the model over its recorded rows.

Coulomb, viscous friction and offset are a straight line through what of friction depends on speed
alone, over the recorded speeds, with the sign change taken as sudden. For Eq. 6 alone these are its
own parameters; a hysteresis or backlash, whose friction the sigmoid then lacks, belongs to Coulomb
friction. What depends on position, load, temperature, time or rest stands beside the line, with its
size in the recorded motion: so Coulomb friction is that of a gear without load. What is printed,
exported and documented comes from here.
"""

from __future__ import annotations

from dataclasses import dataclass
import re
from typing import Any

import numpy as np

from friction_comp.model.effect import Effect, RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import LINE
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# What friction of a sliding joint may depend on to be part of the line.
OF_SPEED = ('velocity', 'direction', 'history')
# Effects that the numbers hold.
_HELD = ('inertia', 'hysteresis', 'backlash')


@dataclass(frozen=True)
class Beside:
    """An effect beside the line, or what the formula leaves out, with its size."""

    name: str
    size: float | None      # RMS in the recorded motion; None where its signal is not known
    unit: str


@dataclass(frozen=True)
class FrictionNumbers:
    """Friction of a joint that slides without load, and what belongs to it, in a model's unit."""

    offset: float | None  # part of Coulomb friction without motion in both directions
    coulomb: float          # sliding friction that does not depend on speed
    viscous: float          # what each rad/s adds
    inertia: float | None   # what each rad/s² takes
    transition: float       # speed over which friction changes its sign, rad/s
    shift: float            # speed at which it does, rad/s
    # With the mean of what the load adds to it in the recorded motion, where that is known.
    coulomb_with_load: float | None
    intervals: dict[str, list[float]]  # 95 %, those that the model holds
    # By direction, with what is held there; `friction` is half of what lies between them.
    breakaway: dict[str, Any] | None
    presliding: dict[str, float] | None  # distance and std, rad
    beside: list[Beside]    # the other effects
    unit: str               # of all numbers
    torque_per_current: float | None  # None where it is not known, as of counts
    inertia_holds: str      # what moved with the inertia
    formula: str            # of `FrictionModel.predict`, but for what is left out
    left_out: list[Beside]  # of the formula


def friction_of(model: FrictionModel) -> FrictionNumbers:
    """Return the numbers of a model in its unit of current, with the intervals that it holds.

    In one direction of motion, the offset is part of Coulomb friction.
    """
    unit, rows = model.unit, states_of(model)
    numbers: dict[str, Any] = {**line_of(model), 'inertia': inertia_of(model),
                               'transition': 2.0 / model.sigmoid.steepness}
    if model.recorded is not None and not model.recorded.in_both_directions:
        numbers['offset'] = None
    intervals = {name: list(ends) for name, value in numbers.items()
                 if value is not None and model.recorded is not None
                 and (ends := model.recorded.interval(name, value))}
    beside = {holds: [_beside(effect, rows, unit) for effect in model.effects
                      if effect.holds_on_another_day == holds and effect.name not in _HELD]
              for holds in (True, False)}
    late = [Beside('lag', float(lag), 's')] if (lag := model.settings.get('lag')) else []
    return FrictionNumbers(
        **numbers, shift=model.sigmoid.shift, intervals=intervals,
        coulomb_with_load=_with_load(model, numbers['coulomb'], rows),
        breakaway=breakaway_of(model), presliding=None if model.presliding is None else {
            name: value for name in ('distance', 'std')
            if (value := getattr(model.presliding, name)) is not None},
        beside=beside[True], unit=unit, torque_per_current=model.gain,
        inertia_holds=inertia_holds(model), formula=formula_of(model),
        left_out=[*beside[False], *late])


def states_of(model: FrictionModel) -> Samples:
    """Return the states of motion for which numbers hold: the recorded rows that the model keeps.

    A model without them has sweeps at its speeds in both directions, over its range of position,
    else over a turn.
    """
    rows = model.recorded.rows if model.recorded else {}
    if rows:
        known: dict[str, Any] = {name: np.array(values) for name, values in rows.items()}
        known.setdefault('time', np.arange(len(known['position']), dtype=float))
        return Samples(current=np.zeros(len(known['position'])), **known)
    low, high = (model.recorded.ranges.get('position') if model.recorded else None) or (
        model.position_limits or (-np.pi, np.pi))
    path, parts = np.linspace(low, high, 128), []
    for speed in speeds_of(model):
        for sign in (1.0, -1.0):
            parts.append(Samples(
                time=(path - low) / speed, position=path[::round(sign)], current=0.0 * path,
                velocity=sign * speed + 0.0 * path, acceleration=0.0 * path))
    return Samples.concatenate(parts)


def motion_in_words(model: FrictionModel) -> str:
    """Return in which motion sizes and losses hold."""
    if model.recorded is not None and model.recorded.rows:
        return 'the recorded motion'
    speeds = speeds_of(model)
    return f'sweeps at {speeds[0]:.2g} to {speeds[-1]:.3g} rad/s'


def speeds_of(model: FrictionModel) -> np.ndarray:
    """Return the speeds of a model in rad/s, ascending, shape (S,)."""
    if model.recorded is not None and model.recorded.speeds:
        return np.array(model.recorded.speeds)
    return np.arange(1, 13) / 12 * model.largest_speed(1.0)


def line_of(model: FrictionModel) -> dict[str, float]:
    """Return offset (A), Coulomb (A) and viscous friction (A·s/rad) of a sliding joint."""
    line, speeds = np.array(model.sigmoid.line), speeds_of(model)
    for effect in model.effects:
        if is_of_speed(type(effect)):
            line += line_by_coefficient(type(effect), effect.values, speeds) @ effect.coefficients
    return dict(zip(LINE, line.tolist()))


def is_of_speed(kind: type[Effect]) -> bool:
    """Return whether an effect is part of the line: friction that depends on speed alone."""
    return (kind.role == RESISTS and kind.variable in OF_SPEED and not kind.needs
            and not kind.fades_in_sliding and kind.holds_on_another_day)


def line_by_coefficient(kind: type[Effect], constants: dict[str, float], speeds: np.ndarray
                        ) -> np.ndarray:
    """Return offset, Coulomb and viscous friction of an effect's coefficients of 1, (3, M).

    The line is through its current at speeds in rad/s, (S,), in both directions.
    """
    if 'transition' in constants:
        # Every speed is beyond it.
        constants = {**constants, 'transition': 1e-9}
    velocity = np.concatenate((speeds, -np.asarray(speeds)))
    nothing = np.zeros(len(velocity))
    motion = Samples(time=nothing, position=nothing, current=nothing, velocity=velocity,
                     acceleration=nothing)
    base = np.column_stack((np.ones(len(velocity)), np.sign(velocity), velocity))
    return np.asarray(np.linalg.pinv(base) @ kind.matrix(motion, constants, sliding=True))


def inertia_of(model: FrictionModel) -> float | None:
    """Return the coefficient of the acceleration, A·s²/rad; None if it was not found."""
    return next((effect.coefficients[0] for effect in model.effects if effect.name == 'inertia'),
                None)


def inertia_holds(model: FrictionModel) -> str:
    """Return what moved with the inertia of a model."""
    if any(effect.name == 'rigid_body' for effect in model.effects):
        return 'the motor, without the links of the URDF'
    return 'the motor with all links that moved'


def near_standstill(model: FrictionModel, coulomb: float) -> float | None:
    """Return Coulomb with Stribeck friction, A; None if the model has no Stribeck friction."""
    heights = [effect.coefficients[0] for effect in model.effects if effect.name == 'stribeck']
    return coulomb + sum(heights) if heights else None


def breakaway_of(model: FrictionModel) -> dict[str, Any] | None:
    """Return breakaway by direction, and `friction` and `held`, which add up to them, A."""
    known = model.breakaway
    return None if known is None else {
        **{side: {what: getattr(known, f'{side}_{what}') for what in ('mean', 'std')}
           for side in ('positive', 'negative')}, 'friction': known.friction, 'held': known.held}


def _with_load(model: FrictionModel, coulomb: float, rows: Samples) -> float | None:
    by_load = [effect for effect in model.effects
               if effect.role == RESISTS and effect.variable == 'load']
    if not by_load or any(getattr(rows, name) is None for effect in by_load
                          for name in effect.needs):
        return None
    added = sum(effect.current(rows, sliding=True) for effect in by_load)
    return coulomb + float(np.mean(np.sign(np.asarray(rows.velocity)) * added))


def _beside(effect: Effect, rows: Samples, unit: str) -> Beside:
    """Return an effect with its size, of one that bends the line without the line."""
    # What follows a rest only, states of sliding do not show.
    if (effect.has_memory and effect.fades_in_sliding) or any(
            getattr(rows, name) is None for name in effect.needs):
        return Beside(effect.name, None, unit)
    current, velocity = effect.current(rows, sliding=True), np.asarray(rows.velocity)
    if is_of_speed(type(effect)):
        line = line_by_coefficient(type(effect), effect.values, np.unique(np.abs(velocity)))
        current = current - np.column_stack(
            (np.ones(len(velocity)), np.sign(velocity), velocity)) @ line @ effect.coefficients
    return Beside(effect.name, rms(current), unit)


def formula_of(model: FrictionModel) -> str:
    """Return the model as a formula, in its unit of current, with the units of what it names.

    Evaluated at the velocity v, acceleration dv/dt, position q and so on of a recording, it is
    `FrictionModel.predict` but for effects of one recording and a lag; beyond the recorded range,
    an effect keeps the value at its end.
    """
    offset, coulomb, viscous = model.sigmoid.line
    shift = f'(v {-model.sigmoid.shift:+.5g})' if model.sigmoid.shift else 'v'
    parts = [f'{coulomb:.5g}·tanh({shift}/{2.0 / model.sigmoid.steepness:.5g})',
             f'{viscous:+.5g}·v']
    parts += [f'{offset:+.5g}'] * bool(offset)
    effects = [effect for effect in model.effects if effect.holds_on_another_day]
    parts += [effect.formula() for effect in effects]
    text = re.sub(r' ([+-])(?=[\d.(])', r' \1 ', ' '.join(parts)).replace('(+', '(')
    meanings = {'·q|·\\(q|\\|q': 'q in rad', r'τ_b': 'τ_b: load in N·m',
                'τ_links': "τ_links: torque of the arm's links in N·m",
                'i_other_joints': 'i_other_joints: sum of the terms in section arm',
                r'\(T -': 'T in °C'}
    names = [model.unit, 'v in rad/s',
             *(said for name, said in meanings.items() if re.search(name, text)),
             *filter(None, (effect.state_formula() for effect in effects))]
    return f'{quantity_in(model.unit)} = {text}   [{", ".join(names)}]'


def quantity_in(unit: str) -> str:
    """Return what an effort in a unit is called: torque, current or effort."""
    return {'N·m': 'torque', 'A': 'current'}.get(unit, 'effort')
