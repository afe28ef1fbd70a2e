# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A model in the form of simulators and controllers: Coulomb, viscous, offset, inertia, spring.

The numbers are those of `friction_numbers`, as torques. What a form lacks of the model is listed
with its size, and its error is the torque that it misses in the recorded motion. Effects of the
links (weight, the rest of the arm) are left to the simulator's own bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import (
    friction_of,
    FrictionNumbers,
    LINKS,
    motion_in_words,
    near_standstill,
    OF_SPEED,
    speeds_of,
    states_of,
)
from friction_comp.model.measured import LINE
from friction_comp.samples import Samples
from friction_comp.statistics import rms

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
# Simulators take none below zero, and their ranges end there: one that draws from them would drive
# the joint with less.
_NEVER_NEGATIVE = ('coulomb', 'viscous', 'static', 'inertia', 'stiffness')
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
    # 95 % intervals by parameter, or of a population the range of further units.
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    ranges_are: str = ''    # what the ranges are

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
                name: (max(low, 0.0), high) if name in _NEVER_NEGATIVE else (low, high)
                for name, (low, high) in self.ranges.items()
                if name not in least and (high > 0.0 or name not in _NEVER_NEGATIVE)})


def torque_per_unit(model: FrictionModel) -> float:
    """Return the torque (or force) of one unit of a model's current.

    Raises InputError if its unit is no torque, force, or current with known constants.
    """
    gain = model.torque_per(model.unit)
    if gain is None:
        raise InputError(f'its unit is {model.unit}, ' + (
            'and no torque constant and gear ratio are known: refine with --torque-constant and '
            "--gear-ratio, or write them into the model's section drive" if model.unit == 'A' else
            'which is no torque, force or current: what belongs to it is no friction of a joint '
            'alone. Refine a recording of the torque or of the current'))
    return gain


def simulator_joint(model: FrictionModel, form: str) -> SimulatorJoint:
    """Return the numbers of a model for a form; raises InputError as `torque_per_unit`."""
    gain, numbers = torque_per_unit(model), friction_of(model)
    springs = [effect for effect in model.effects if effect.name == 'spring']
    static, static_is, ends = _static(model, numbers.coulomb)
    ranges, ranges_are = _ranges(model, numbers)
    # Units of a fleet do not vary by the interval of one.
    if ends and 'range_of_units' not in model.notes:
        ranges['static'] = ends
    found = {'coulomb': numbers.coulomb, 'viscous': numbers.viscous, 'static': static,
             'offset': numbers.offset or 0.0, 'inertia': numbers.inertia,
             'stiffness': sum(effect.coefficients[0] for effect in springs),
             'coulomb_with_load': numbers.coulomb_with_load}
    torques = {name: None if value is None else gain * value for name, value in found.items()}
    return SimulatorJoint(
        form, **torques,  # type: ignore[arg-type]
        transition=numbers.transition, rest=springs[0].values['position'] if springs else 0.0,
        motion=motion_in_words(model), unit='N' if model.is_linear else 'N·m', static_is=static_is,
        left_out=_left_out(model, numbers, form), table=_table(model, gain),
        ranges={name: (gain * low, gain * high) for name, (low, high) in ranges.items()},
        ranges_are=ranges_are)


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
    """Return what a form lacks of a model, with its size in the recorded motion."""
    keys, gain, motion, lines = KEYS[form], torque_per_unit(model), motion_in_words(model), []
    unit = 'N' if model.is_linear else 'N·m'
    held = {effect.name for effect in model.effects if effect.variable in OF_SPEED
            } if form == 'csv' else {'spring'} if 'stiffness' in keys else set()
    if numbers.coulomb_with_load is not None:
        lines.append('friction by load: Coulomb friction here is without load; its mean with load '
                     f'is {gain * numbers.coulomb_with_load:.4g} {unit} in {motion}')
    if 'offset' not in keys and numbers.offset:
        lines.append(f'offset {gain * numbers.offset:.3g} {unit}: no place for it in this form')
    if 'inertia' not in keys and numbers.inertia:
        lines.append(f'inertia {gain * numbers.inertia:.6g} kg·m²: ' + (
            'not in its formula' if form == 'tanh' else 'belongs to the links of this form'))
    for one in (*numbers.beside, *numbers.left_out):
        if one.name in held:
            continue
        scale, own_unit = (1.0, one.unit) if one.unit == 's' else (gain, unit)
        size = '' if one.size is None else f' {scale * one.size:.3g} {own_unit}' + (
            f' RMS in {motion}' if own_unit == unit else '')
        lines.append(f'{one.name.replace("_", " ")}{size}' + (
            ': belongs to the links and what they touch' if one.name in LINKS else ''))
    return lines


def _ranges(model: FrictionModel, numbers: FrictionNumbers
            ) -> tuple[dict[str, tuple[float, float]], str]:
    """Return ranges of numbers in the model's unit, by name, and what they are."""
    units = model.notes.get('range_of_units', {})
    if not units:
        found = {name: (ends[0], ends[1]) for name, ends in numbers.intervals.items()}
        return found, '95 % intervals of the fit' if found else ''
    # Effects that bend the straight line do not vary with it.
    bent = {name: getattr(numbers, name) - value for name, value in zip(LINE, model.sigmoid.line)
            if getattr(numbers, name) is not None}
    return {name: (bent.get(name, 0.0) + low, bent.get(name, 0.0) + high)
            for name, (low, high) in units.items() if name in bent or name == 'inertia'}, (
        f'where 95 % of further units lie, from {model.notes["units"]} units of a fleet')


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
    torque = torque_per_unit(model) * replace(model, arm=None, effects=kept).current(
        motion, sliding=True)
    size, error = rms(torque), rms(torque - joint.torque(motion))
    return error, error / size if size else 0.0
