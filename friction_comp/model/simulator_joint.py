# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A model in the form of simulators and controllers: Coulomb, viscous, offset, inertia, spring.

Each form is the sum of a few terms of a joint's velocity, acceleration and position. What it lacks
of the model is listed; its error is the torque that it misses in a motion: that of a recording, or
sweeps at the speeds of the model. Effects of the links (weight, the rest of the arm) are left to
the simulator's own bodies.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.effects.base import Effect
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import LINE
from friction_comp.model.sliding_friction import inertia_of, line_of, near_standstill, Sliding
from friction_comp.samples import Samples
from friction_comp.statistics import rms

LINKS = ('gravity', 'rigid_body', 'other_joints', 'load_torque')
"""Effects of the links and of what they touch."""
_OWN_ELEMENTS = ('inertia', 'spring')
_NEVER_NEGATIVE = ('coulomb', 'viscous', 'static', 'inertia', 'stiffness')
# Speeds of a table over which friction changes its sign, in units of the transition.
_TURNING = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0])
# Speed as a share of the top speed above which a joint slides.
_SLIDING = 0.02


@dataclass(frozen=True)
class SimulatorJoint:
    """The numbers of a joint, of one model or the means of several; torques in `unit`."""

    coulomb: float          # N·m
    viscous: float          # N·m·s/rad
    offset: float           # N·m
    static: float           # N·m, at breakaway if known, else near standstill
    transition: float       # rad/s over which friction changes sign
    inertia: float | None   # kg·m²
    stiffness: float        # of a spring, N·m/rad
    rest: float             # its rest position, rad
    unit: str               # N·m, or N of a linear axis
    static_is: str          # where the static friction is from
    left_out: list[str]     # effects that no form has, with the reason
    # 95 % intervals by parameter, or over several models the range of all of them.
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    ranges_are: str = ''    # what the ranges are

    def torque(self, motion: Samples, form: str) -> np.ndarray:
        """Return the torque of a form in a motion, N·m, shape (N,), with its inertia."""
        speed = np.asarray(motion.velocity)
        smooth = form in ('tanh', 'json')
        sign = np.tanh(speed / self.transition) if smooth else np.sign(speed)
        torque = self.coulomb * sign + self.viscous * speed
        torque = torque + (self.offset if smooth else 0.0)
        if form == 'tanh':
            return torque
        torque = torque + (self.inertia or 0.0) * np.asarray(motion.acceleration)
        return torque + (self.stiffness * (motion.position - self.rest)
                         if form in ('mujoco', 'sdf', 'json') else 0.0)

    def passive(self) -> SimulatorJoint:
        """Return the joint without negative numbers, which no simulator takes; `left_out` says so.

        Viscous friction is negative where friction falls with the speed. Ranges end at zero: a
        simulator that draws from them would drive the joint with less.
        """
        least = {name: 0.0 for name in ('coulomb', 'viscous', 'stiffness')
                 if getattr(self, name) < 0.0}
        return replace(self, **least, left_out=[*self.left_out, *(  # type: ignore[arg-type]
            f'{name} {getattr(self, name):.4g}: simulators take none below zero, so it is 0 here'
            for name in least)], ranges={
                name: (max(low, 0.0), high) if name in _NEVER_NEGATIVE else (low, high)
                for name, (low, high) in self.ranges.items()
                if name not in least and (high > 0.0 or name not in _NEVER_NEGATIVE)})


def cautions_of(models: Iterable[FrictionModel]) -> list[str]:
    """Return the reasons of the verdicts on models, and the assumptions, that refinement stored."""
    lines: dict[str, None] = {}
    for model in models:
        lines |= dict.fromkeys(f'Verdict of refine: {model.notes.get("verdict")}. {reason}'
                               for reason in model.notes.get('reasons', ()))
        lines |= dict.fromkeys(f'Taken for granted: {one}'
                               for one in model.notes.get('assumed', ()))
    return list(lines)


def simulator_joint(model: FrictionModel, top_speed: float | None = None) -> SimulatorJoint:
    """Return the numbers of a model; `top_speed` in rad/s replaces the speeds of its recording.

    Raises InputError if the model's unit is not a torque and cannot be converted to one.
    """
    unit = model.unit
    gain = model.torque_per(unit)
    if gain is None:
        raise InputError(
            f'its unit is {unit}, and no torque constant and gear ratio are known that make it a '
            'torque: refine with --torque-constant and --gear-ratio, or write them into the '
            "model's section drive")
    line, inertia = line_of(model, top_speed), inertia_of(model)
    springs = [effect for effect in model.effects if effect.name == 'spring']
    numbers = {**line, **({} if inertia is None else {'inertia': inertia})}
    ranges, ranges_are = _ranges(model, numbers)
    static, static_is, own = _static(model, line['coulomb'])
    # Units of a fleet do not vary by the interval of one.
    if own and 'range_of_units' not in model.notes:
        ranges['static'] = own
    _, left_out = joint_friction_only(model)
    return SimulatorJoint(
        coulomb=gain * line['coulomb'], viscous=gain * line['viscous'],
        offset=gain * line['offset'], static=gain * static, static_is=static_is,
        transition=2.0 / model.sigmoid.steepness,
        inertia=None if inertia is None else gain * inertia,
        stiffness=gain * sum(effect.coefficients[0] for effect in springs),
        rest=springs[0].values['position'] if springs else 0.0,
        unit='N' if model.is_linear else 'N·m', left_out=left_out,
        ranges={name: (gain * low, gain * high) for name, (low, high) in ranges.items()},
        ranges_are=ranges_are)


def _ranges(model: FrictionModel, numbers: dict[str, float]
            ) -> tuple[dict[str, tuple[float, float]], str]:
    """Return ranges of numbers in the model's unit, by name, and what they are."""
    units = model.notes.get('range_of_units', {})
    if not units:
        ends = {} if model.recorded is None else {
            name: model.recorded.interval(name, value) for name, value in numbers.items()}
        found = {name: (own[0], own[1]) for name, own in ends.items() if own}
        return found, '95 % intervals of the fit' if found else ''
    # Effects that bend the straight line do not vary with it.
    own = {**dict(zip(LINE, model.sigmoid.line)), 'inertia': numbers.get('inertia', 0.0)}
    return {name: (value + units[name][0] - own[name], value + units[name][1] - own[name])
            for name, value in numbers.items() if name in units}, (
        f'where 95 % of further units lie, from {model.notes["units"]} units of a fleet')


def of_several(joints: list[SimulatorJoint]) -> SimulatorJoint:
    """Return the means of several joints, and the ranges over all of them with their intervals."""
    if len(joints) == 1:
        return joints[0]
    if len({joint.unit for joint in joints}) > 1:
        raise InputError('some models are in N·m and some in N')
    names = [name for name in (*LINE, 'static', 'transition', 'inertia')
             if all(getattr(joint, name) is not None for joint in joints)]
    ranges = {}
    for name in names:
        ends = [joint.ranges.get(name, (getattr(joint, name),) * 2) for joint in joints]
        ranges[name] = min(low for low, _ in ends), max(high for _, high in ends)
    means = {name: float(np.mean([getattr(joint, name) for joint in joints])) for name in names}
    return replace(
        joints[0], **{'inertia': None, **means},  # type: ignore[arg-type] # its names are fields
        left_out=list(dict.fromkeys(line for joint in joints for line in joint.left_out)),
        ranges=ranges, ranges_are=f'smallest to largest of {len(joints)} models, with their '
                                  'intervals')


def _static(model: FrictionModel, coulomb: float
            ) -> tuple[float, str, tuple[float, float] | None]:
    """Return the friction at breakaway or near standstill, A, where it is from, and its range."""
    if model.breakaway is not None:
        breakaway = 0.5 * (model.breakaway.positive_mean - model.breakaway.negative_mean)
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


def joint_friction_only(model: FrictionModel, known: tuple[str, ...] = ('acceleration',)
                        ) -> tuple[FrictionModel, list[str]]:
    """Return the model with the friction that depends on known signals, and what is left out."""
    kept: list[Effect] = []
    left_out = []
    for effect in model.effects:
        unknown = [name for name in effect.needs if name not in known]
        if effect.name in LINKS:
            left_out.append(f'{effect.name}: belongs to the links and what they touch')
        elif effect.name in _OWN_ELEMENTS:
            continue
        elif unknown or not effect.holds_on_another_day:
            left_out.append(f'{effect.name}: depends on {unknown[0] if unknown else "time"}')
        else:
            kept.append(effect)
    return replace(model, effects=kept, arm=None), left_out


@dataclass(frozen=True)
class Loss:
    """The torque that a form misses of a model."""

    torque: float       # RMS, N·m
    share: float        # of the RMS of the model's torque
    motion: str         # in which motion


def loss_of(model: FrictionModel, joint: SimulatorJoint | FrictionTable, form: str,
            recorded: Samples | None = None) -> Loss:
    """Return what a form misses of the model's torque without links, where the joint slides.

    In the motion of a recording with velocity and acceleration, else in sweeps at the model's
    speeds. Friction alone is compared where the form is of friction alone.
    """
    gain = model.torque_per(model.unit) or 1.0
    has_inertia = form not in ('tanh', 'csv')
    kept = [effect for effect in model.effects if effect.name not in LINKS
            and (has_inertia or effect.name != 'inertia')]
    if recorded is None:
        motion, slides = Sliding.of(model).samples()
        # Sweeps have no load, temperature or time.
        kept = [effect for effect in kept if effect.holds_on_another_day
                and set(effect.needs) <= {'acceleration'}]
        words = (f'sweeps at {min(np.abs(np.asarray(motion.velocity))):.2g} to '
                 f'{max(np.asarray(motion.velocity)):.3g} rad/s')
    else:
        motion, words = recorded, 'the motion of the recording'
        speed = np.abs(np.asarray(motion.velocity))
        slides = speed > _SLIDING * speed.max()
        kept = [effect for effect in kept
                if all(getattr(motion, name) is not None for name in effect.needs)]
    torque = gain * replace(model, arm=None, effects=kept).current(motion)[slides]
    missed = torque - joint.torque(motion, form)[slides]
    size, error = rms(torque), rms(missed)
    return Loss(error, error / size if size else 0.0, words)


@dataclass(frozen=True)
class FrictionTable:
    """Friction torque over speed, position and load, without weight, spring and inertia."""

    names = ('velocity (rad/s)', 'position (rad)', 'load (N·m)', 'torque (N·m)')
    rows: np.ndarray        # (N, 4)

    @classmethod
    def of(cls, model: FrictionModel, loads: np.ndarray, top_speed: float | None = None
           ) -> FrictionTable:
        """Return a model's table; friction by load has the loads, shape (L,), N·m."""
        gain = model.torque_per(model.unit) or 1.0
        kept, _ = joint_friction_only(model, ('acceleration', 'load'))
        sliding = Sliding.of(model, top_speed)
        # Between the slowest sweeps, friction changes its sign.
        turning = _TURNING * 2.0 / model.sigmoid.steepness
        motion, late = replace(sliding, speeds=tuple(sorted({
            *sliding.speeds, *turning[turning < max(sliding.speeds)].tolist()}))).samples()
        if not any('load' in effect.needs for effect in kept.effects):
            loads = np.zeros(1)
        every = 2 if any(effect.variable == 'position' for effect in kept.effects) else 8
        shown = late & (np.arange(len(motion)) % every == 0)
        rows = []
        for load in loads:
            torque = gain * kept.current(motion.with_(load=np.full(len(motion), load)))
            rows.append(np.column_stack((
                np.asarray(motion.velocity), motion.position, np.full(len(motion), load),
                torque))[shown])
        return cls(np.concatenate(rows))

    def torque(self, motion: Samples, form: str = 'csv') -> np.ndarray:
        """Return the torque in a motion, N·m, shape (N,): linear between the rows."""
        load = np.zeros(len(motion)) if motion.load is None else motion.load
        speeds, loads = np.unique(self.rows[:, 0]), np.unique(self.rows[:, 2])
        torque = np.zeros(len(motion))
        for speed, one in zip(speeds, np.eye(len(speeds))):
            for level, own in zip(loads, np.eye(len(loads))):
                sweep = self.rows[(self.rows[:, 0] == speed) & (self.rows[:, 2] == level)]
                sweep = sweep[np.argsort(sweep[:, 1])]
                torque += (np.interp(np.asarray(motion.velocity), speeds, one)
                           * np.interp(load, loads, own)
                           * np.interp(motion.position, sweep[:, 1], sweep[:, 3]))
        return torque
