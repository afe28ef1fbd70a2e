# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers that people ask of a model, each computed from the model over its recorded rows.

Coulomb, viscous friction and offset are a straight line through what of friction depends on speed
alone, over the recorded speeds, with the sign change taken as sudden. For Eq. 6 alone these are its
own parameters; a hysteresis or backlash, whose friction the sigmoid then lacks, belongs to Coulomb
friction. What depends on position, load, temperature, time or rest stands beside the line, with its
size in the recorded motion: so Coulomb friction is that of a gear without load. What is printed,
exported and documented comes from here.

A `SimulatorJoint` has them as torques in the form of a simulator or controller. What a form lacks
of the model is listed with its size, and its error is the torque that it misses in the recorded
motion. Effects of the links (weight, the rest of the arm) are left to the simulator's own bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import re
from typing import Any

import numpy as np

from friction_comp.model.effect import Effect, RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import LINE
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# rad/s, of a model that does not tell the speeds at which it was measured, and their number.
_TOP_SPEED, _SPEEDS = 1.0, 12
# Positions of sweeps, for a model that does not keep recorded rows.
_POINTS = 128
# A transition so short, rad/s, that every speed of the line is beyond it.
_SUDDEN = 1e-9
# What friction of a sliding joint may depend on to be part of the line.
OF_SPEED = ('velocity', 'direction', 'history')
# Effects that the numbers hold, and those of the links and of what they touch.
_HELD = ('inertia', 'hysteresis', 'backlash')
LINKS = ('gravity', 'rigid_body', 'other_joints', 'load_torque')


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
    path, parts = np.linspace(low, high, _POINTS), []
    for speed in speeds_of(model):
        for sign in (1.0, -1.0):
            parts.append(Samples(
                time=(path - low) / speed, position=path[::round(sign)], current=np.zeros(_POINTS),
                velocity=np.full(_POINTS, sign * speed), acceleration=np.zeros(_POINTS)))
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
    return np.arange(1, _SPEEDS + 1) / _SPEEDS * model.largest_speed(_TOP_SPEED)


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
        constants = {**constants, 'transition': _SUDDEN}
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


# Names of the numbers in each form; a form lacks those that it does not name.
KEYS = {
    'mujoco': {'coulomb': 'frictionloss', 'viscous': 'damping', 'inertia': 'armature',
               'stiffness': 'stiffness'},
    'urdf': {'coulomb': 'friction', 'viscous': 'damping'},
    'sdf': {'coulomb': 'friction', 'viscous': 'damping', 'stiffness': 'spring_stiffness'},
    'tanh': {'coulomb': 'Fc', 'viscous': 'Fv', 'offset': 'Fo'},
    'isaac': {'static': 'static_friction', 'coulomb': 'dynamic_friction',
              'viscous': 'viscous_friction', 'inertia': 'armature'},
    'csv': {'offset': 'torque (N·m)'},
    'json': {name: name for name in ('coulomb', 'coulomb_with_load', 'viscous', 'offset', 'static',
                                     'transition', 'inertia', 'stiffness', 'rest')}}
# Speeds of a table over which friction changes its sign, in units of the transition.
_TURNING = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0])


@dataclass(frozen=True)
class SimulatorJoint:
    """The numbers of a joint as torques in `unit`."""

    form: str
    coulomb: float          # N·m, without load
    viscous: float          # N·m·s/rad
    offset: float           # N·m
    static: float           # N·m, at breakaway if known, else near standstill
    transition: float       # rad/s over which friction changes sign
    inertia: float | None   # kg·m²
    stiffness: float        # of a spring, N·m/rad
    rest: float             # its rest position, rad
    coulomb_with_load: float | None     # N·m, the mean in the recorded motion
    unit: str               # N·m, or N of a linear axis
    motion: str             # in which sizes and losses hold
    static_is: str          # where the static friction is from
    left_out: list[str]     # what the form lacks, with its size or the reason
    table: tuple[np.ndarray, np.ndarray]    # speeds, ascending, and friction at each, N·m
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)    # 95 % intervals

    def torque(self, motion: Samples) -> np.ndarray:
        """Return the torque of the form in a motion, N·m, shape (N,), with its inertia."""
        keys, speed = KEYS[self.form], np.asarray(motion.velocity)
        if self.form == 'csv':
            return np.interp(speed, *self.table)
        sign = np.tanh(speed / self.transition) if self.form in ('tanh', 'json') else np.sign(speed)
        torque = self.coulomb * sign + self.viscous * speed + self.offset * ('offset' in keys)
        if self.inertia and 'inertia' in keys and motion.acceleration is not None:
            torque = torque + self.inertia * motion.acceleration
        return torque + self.stiffness * ('stiffness' in keys) * (motion.position - self.rest)

    def passive(self) -> SimulatorJoint:
        """Return the joint without negative numbers, which no simulator takes; `left_out` says so.

        Viscous friction is negative where friction falls with the speed.
        """
        least = {name: 0.0 for name in ('coulomb', 'viscous', 'stiffness')
                 if getattr(self, name) < 0.0}
        return replace(self, **least, left_out=[*self.left_out, *(  # type: ignore[arg-type]
            f'{name} {getattr(self, name):.4g}: simulators take none below zero, so it is 0 here'
            for name in least)], ranges={
                # One that draws from a range would drive the joint with less.
                name: (max(low, 0.0), high) for name, (low, high) in self.ranges.items()
                if high > 0.0 and name not in least})


def simulator_joint(model: FrictionModel, form: str) -> SimulatorJoint:
    """Return the numbers of a model for a form; raises InputError without a torque."""
    gain, numbers = model.torque_per_unit(), friction_of(model)
    spring = next((effect for effect in model.effects if effect.name == 'spring'), None)
    static, static_is, ends = _static(model, numbers.coulomb)
    ranges = {**numbers.intervals, **({'static': ends} if ends else {})}
    found = {'coulomb': numbers.coulomb, 'viscous': numbers.viscous, 'static': static,
             'offset': numbers.offset or 0.0, 'inertia': numbers.inertia,
             'stiffness': spring.coefficients[0] if spring else 0.0,
             'coulomb_with_load': numbers.coulomb_with_load}
    torques = {name: None if value is None else gain * value for name, value in found.items()}
    return SimulatorJoint(
        form, **torques,  # type: ignore[arg-type]
        transition=numbers.transition, rest=spring.values['position'] if spring else 0.0,
        motion=motion_in_words(model), unit='N' if model.is_linear else 'N·m', static_is=static_is,
        left_out=_left_out(model, numbers, form), table=_table(model, gain),
        ranges={name: (gain * low, gain * high) for name, (low, high) in ranges.items()})


def _table(model: FrictionModel, gain: float) -> tuple[np.ndarray, np.ndarray]:
    """Return speeds in both directions, rad/s, ascending, and friction at each, N·m."""
    slow = _TURNING * 2.0 / model.sigmoid.steepness
    speeds = np.union1d(speeds_of(model), slow[slow < speeds_of(model).max()])
    v = np.concatenate((-speeds[::-1], speeds))
    kept = [effect for effect in model.effects if effect.variable in OF_SPEED
            and not effect.needs and not (effect.has_memory and effect.fades_in_sliding)]
    states = Samples(time=0.0 * v, position=0.0 * v, current=0.0 * v, velocity=v)
    return v, gain * replace(model, effects=kept, arm=None).current(states, sliding=True)


def _left_out(model: FrictionModel, numbers: FrictionNumbers, form: str) -> list[str]:
    """Return what a form lacks of a model."""
    keys, gain, lines = KEYS[form], model.torque_per_unit(), []
    unit = 'N' if model.is_linear else 'N·m'
    held = {effect.name for effect in model.effects if effect.variable in OF_SPEED
            } if form == 'csv' else {'spring'} if 'stiffness' in keys else set()
    if numbers.coulomb_with_load is not None:
        lines.append('friction by load: Coulomb friction here is without load; its mean with load '
                     f'is {gain * numbers.coulomb_with_load:.4g} {unit} in '
                     f'{motion_in_words(model)}')
    if 'offset' not in keys and numbers.offset:
        lines.append(f'offset {gain * numbers.offset:.3g} {unit}: no place for it in this form')
    if 'inertia' not in keys and numbers.inertia:
        lines.append(f'inertia {gain * numbers.inertia:.6g} kg·m²: ' + (
            'not in its formula' if form == 'tanh' else 'belongs to the links of this form'))
    return lines + [one.name.replace('_', ' ') + (
        '' if one.size is None else f' {one.size:.3g} s' if one.unit == 's' else
        f' {gain * one.size:.3g} {unit} RMS') + (
        ': belongs to the links and what they touch' if one.name in LINKS else '')
        for one in (*numbers.beside, *numbers.left_out) if one.name not in held]


def _static(model: FrictionModel, coulomb: float
            ) -> tuple[float, str, tuple[float, float] | None]:
    """Return the friction at breakaway or near standstill, A, where it is from, and its range."""
    if model.breakaway is not None:
        breakaway = model.breakaway.friction
        # Simulators refuse a static friction below the dynamic one.
        return (breakaway, 'measured breakaway', None) if breakaway >= coulomb else (
            coulomb, 'Coulomb friction: the measured breakaway is lower', None)
    value = near_standstill(model, coulomb)
    if value is None:
        return coulomb, 'Coulomb friction: breakaway was not measured', None
    ends = model.recorded.interval('static', value) if model.recorded is not None else None
    own = ends and (max(ends[0], coulomb), max(ends[1], coulomb))
    if ends and ends[0] <= coulomb:
        return coulomb, ('Coulomb friction: how much higher friction is near standstill, the '
                         'recording hardly tells'), own
    return max(value, coulomb), 'Coulomb with Stribeck friction', own


def loss_of(model: FrictionModel, joint: SimulatorJoint) -> tuple[float, float]:
    """Return what a form misses of the model's torque without links, where the joint slides.

    It is the RMS torque, N·m, and its share of the RMS of the model's torque.
    """
    motion = states_of(model)
    kept = [effect for effect in model.effects if effect.name not in LINKS
            and (effect.name != 'inertia' or joint.form not in ('tanh', 'csv'))
            and effect.holds_on_another_day
            and all(getattr(motion, name) is not None for name in effect.needs)]
    torque = model.torque_per_unit() * replace(model, arm=None, effects=kept).current(
        motion, sliding=True)
    size, error = rms(torque), rms(torque - joint.torque(motion))
    return error, error / size if size else 0.0
