# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A plan: moves between places, at speeds and with rests that never repeat.

The n-th move's place, speed and rest are the n-th point of a scrambled Sobol sequence, so that all
combinations come and none twice. Five numbers bend that sequence (`SHAPE`): how slow the slowest
move is, how many are slow, how long a move and a rest may last, how near the ends places are.
`scipy.optimize.differential_evolution` chooses them so that the pair of effects that is told apart
worst is told apart as well as can be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
import math

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from friction_comp.errors import InputError
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.separation import coverage_within, Pair, separations
from friction_comp.model.friction_model import FrictionModel
from friction_comp.samples import Samples
from friction_comp.trajectory import Trajectory

# Share of the slowest speed, exponent of speeds, longest move and longest rest in s, exponent of
# positions; each with its search range.
SHAPE = ((0.01, 0.5), (0.3, 4.0), (1.0, 15.0), (0.05, 3.0), (0.05, 1.2))
# Share of the limits that is used: the rest is left to controllers, which interpolate and
# overshoot.
MARGIN = 0.95
SHORTEST = 20.0         # s, below which a plan has too few moves to be planned
LONGEST = 1800.0        # s, beyond which it holds more moves than points are drawn
_POINTS, _EVALUATED = 2048, 50.0
_POPULATION, _GENERATIONS = 6, 10
# Factor by which a plan that needs too much effort is slowed down, and how often.
_SLOWER, _TRIALS = 0.8, 12
# Weight of the logarithm of each pair relative to the worst pair.
_MEAN = 0.3
# Steepest slope of u³(10 - 15u + 6u²), the profile with which speed rises.
_STEEPEST = 1.875
# Shortest time in which speed rises, s: it limits jerk, in short moves too.
_SHORTEST = 0.1
_SPEEDS, _HARMONICS = 8, 5


@dataclass(frozen=True)
class Move:
    """One motion from rest to rest."""

    begin: float  # when it sets out, s
    start: float  # rad
    distance: float  # rad, with a sign
    speed: float  # while it is constant, rad/s
    ramp: float  # s in which speed rises, and falls
    cruise: float  # s in which it is constant

    @classmethod
    def within(cls, begin: float, start: float, end: float, speed: float,
               acceleration: float) -> Move:
        """Return the move at a speed, or at the highest that the limits leave it."""
        distance = abs(end - start)
        speed = min(speed, math.sqrt(distance * acceleration / _STEEPEST), distance / _SHORTEST)
        ramp = max(_STEEPEST * speed / acceleration, _SHORTEST)
        return cls(begin, start, end - start, speed, ramp, max(distance / speed - ramp, 0.0))

    @property
    def duration(self) -> float:
        """Seconds."""
        return 2.0 * self.ramp + self.cruise


def sampled(moves: Sequence[Move], start: float, time: np.ndarray
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity and acceleration, each (N,), of moves and rests between them.

    The moves are in the order of time, and `start` is the position before the first, rad.
    """
    position = np.full(len(time), start)
    velocity, acceleration = np.zeros(len(time)), np.zeros(len(time))
    for move in moves:
        first, stop = np.searchsorted(time, (move.begin, move.begin + move.duration))
        late = time[first:stop] - move.begin
        before, after = (np.clip(part / move.ramp, 0.0, 1.0)
                         for part in (late, move.duration - late))
        side = math.copysign(1.0, move.distance)
        rise = np.minimum(before, after)
        speed = move.speed * rise ** 3 * (10.0 - 15.0 * rise + 6.0 * rise ** 2)
        slope = move.speed / move.ramp * 30.0 * (rise * (1.0 - rise)) ** 2
        way = (_way(move, before) + move.speed * np.clip(late - move.ramp, 0.0, move.cruise)
               + 0.5 * move.speed * move.ramp - _way(move, after))
        position[first:stop] = move.start + side * way
        velocity[first:stop] = side * speed
        acceleration[first:stop] = side * np.where(before < after, slope, -slope)
        position[stop:] = move.start + move.distance
    return position, velocity, acceleration


def _way(move: Move, share: np.ndarray) -> np.ndarray:
    """Return the distance covered in a share of the acceleration time, rad."""
    return np.asarray(
        move.speed * move.ramp * share ** 4 * (2.5 - 3.0 * share + share ** 2))


@dataclass(frozen=True)
class JointPlan:
    """The planned motion of one joint."""

    limits: JointLimits
    start: float  # where it begins and ends, rad
    moves: tuple[Move, ...]
    seconds: float
    separation: dict[Pair, float]  # of each pair of effects, as of `separations`

    def samples(self, rate: float) -> Samples:
        """Return the motion sampled at a rate in Hz, with zero current."""
        return samples_of(self.moves, self.start, self.seconds, rate, self.limits.joint)


def trajectory_of(plans: Sequence[JointPlan], rate: float) -> Trajectory:
    """Return plans of equal duration as one trajectory, sampled at a rate in Hz."""
    motions = [plan.samples(rate) for plan in plans]
    states = [np.column_stack([getattr(one, name) for one in motions])
              for name in ('position', 'velocity', 'acceleration')]
    return Trajectory(tuple(plan.limits.joint for plan in plans), motions[0].time, *states)


def samples_of(moves: Sequence[Move], start: float, seconds: float, rate: float,
               joint: str) -> Samples:
    """Return moves sampled at a rate in Hz, up to the end at least, with zero current."""
    time = np.arange(math.ceil(seconds * rate - 1e-9) + 1) / rate
    position, velocity, acceleration = sampled(moves, start, time)
    return Samples(time=time, position=position, velocity=velocity, acceleration=acceleration,
                   current=np.zeros(len(time)), joint=joint)


def moves_by(shape: Sequence[float] | np.ndarray, limits: JointLimits, seconds: float,
             points: np.ndarray) -> tuple[float, list[Move]]:
    """Return the place where a plan begins and ends, and its moves.

    `shape` is a point of `SHAPE`, and `points`, shape (K, 3), are in the unit cube.
    """
    slowest, lean, longest, rest, reach = shape
    top, most = MARGIN * limits.velocity, MARGIN * limits.acceleration
    centre = 0.5 * (limits.lowest + limits.highest)
    half = 0.5 * MARGIN * (limits.highest - limits.lowest)
    now, here, moves = float(rest * points[0, 2]), centre, []
    for share, pace, wait in points[1:]:
        speed = top * slowest ** (pace ** lean)
        aim = centre + half * np.copysign(abs(2.0 * share - 1.0) ** reach, share - 0.5)
        there = float(np.clip(aim, here - speed * longest, here + speed * longest))
        if abs(there - here) < 0.01 * half:
            continue
        move = Move.within(now, here, there, speed, most)
        then = now + move.duration + rest * wait ** 2
        back = (Move.within(then, there, centre, 0.5 * top, most)
                if abs(there - centre) > 1e-6 * half else None)
        if then + (back.duration if back else 0.0) > seconds:
            break
        moves.append(move)
        now, here = then, there
    if abs(here - centre) > 1e-6 * half:
        moves.append(Move.within(now, here, centre, 0.5 * top, most))
    return centre, moves


def plan_joint(limits: JointLimits, pairs: Sequence[Pair], seconds: float, seed: int,
               model: FrictionModel | None = None,
               report: Callable[[float], None] = lambda share: None) -> JointPlan:
    """Return a motion of one joint that separates pairs of effects.

    The same seed gives the same plan. `model` predicts the effort of a motion, which is not checked
    otherwise; `report` is called with the share that is done.

    Raises
    ------
    InputError
        If there is too little or too much time, or the effort limit cannot be kept.
    """
    if seconds < SHORTEST:
        raise InputError(f'{seconds:g} s are too short for a plan: at least {SHORTEST:g} s')
    if seconds > LONGEST:
        raise InputError(f'{seconds:g} s are too long for a plan: at most {LONGEST:g} s')
    coverage = coverage_within(limits, seconds, 1.0 / _EVALUATED)
    points = qmc.Sobol(3, scramble=True, seed=seed).random(_POINTS)

    def separation(shape: np.ndarray, own: JointLimits) -> dict[Pair, float]:
        start, moves = moves_by(shape, own, seconds, points)
        try:
            return separations(samples_of(moves, start, seconds, _EVALUATED, own.joint), pairs,
                               coverage)
        except InputError:
            # Almost the whole time is rest.
            return dict.fromkeys(pairs, 0.0)

    def cost(shape: np.ndarray) -> float:
        shares = list(separation(shape, limits).values())
        logarithms = np.log(np.maximum(shares, 1e-6))
        return -float(min(logarithms) + len(pairs) * np.mean(logarithms) * _MEAN)
    generation = count(1)
    shape = differential_evolution(
        cost, SHAPE, popsize=_POPULATION, maxiter=_GENERATIONS, tol=0.0, polish=False, seed=seed,
        callback=lambda *_, **__: report(next(generation) / _GENERATIONS)).x
    own = limits
    for _ in range(_TRIALS):
        start, moves = moves_by(shape, own, seconds, points)
        distances = separation(shape, own)
        if not any(distances.values()):
            # Slowed down, hardly any move fits into the time.
            break
        if model is None or effort_of(model, samples_of(
                moves, start, seconds, 200.0, own.joint)) <= MARGIN * limits.effort:
            return JointPlan(limits, start, tuple(moves), seconds, distances)
        own = own.slowed(_SLOWER)
    raise InputError(
        f'joint {limits.joint!r}: {seconds:g} s are too short for motion within these limits'
        if own is limits else f'joint {limits.joint!r}: by its model even slow motion needs more '
        f'than the effort limit of {limits.effort:g} N·m')


def effort_of(model: FrictionModel, samples: Samples) -> float:
    """Return the largest torque at the joint in N·m that a motion needs by a model."""
    return float(np.max(np.abs(model.predict(samples)))) * model.drive.torque_per_current


def staircase(limits: JointLimits, seconds: float, rate: float) -> Samples:
    """Return motion to and fro at speeds that rise in steps, each with an equal share of the time.

    Plans are compared with it.
    """
    centre = 0.5 * (limits.lowest + limits.highest)
    half = 0.5 * MARGIN * (limits.highest - limits.lowest)
    now, here, side, moves = 0.0, centre, 1.0, []
    while True:
        step = min(int(now / seconds * _SPEEDS) + 1, _SPEEDS)
        speed = MARGIN * limits.velocity * step / _SPEEDS
        # Slow steps reverse earlier, so that they too go in both directions.
        way = min(half, 0.2 * speed * seconds / _SPEEDS)
        move = Move.within(now, here, centre + side * way, speed, MARGIN * limits.acceleration)
        if now + move.duration > seconds:
            break
        moves.append(move)
        now, here, side = now + move.duration, centre + side * way, -side
    return samples_of(moves, centre, seconds, rate, limits.joint)


def fourier_series(limits: JointLimits, seconds: float, rate: float, seed: int) -> Samples:
    """Return a random Fourier series of a period of 10 s that just keeps the limits."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * rate) + 1) / rate
    turns = 2.0 * np.pi / 10.0 * np.arange(1, _HARMONICS + 1)
    angle = turns * time[:, None] + rng.uniform(0.0, 2.0 * np.pi, _HARMONICS)
    size = rng.normal(0.0, 1.0, _HARMONICS) / turns
    position, velocity = np.sin(angle) @ size, np.cos(angle) @ (size * turns)
    acceleration = -np.sin(angle) @ (size * turns ** 2)
    middle = 0.5 * (position.max() + position.min())
    scale = MARGIN * min((limits.highest - limits.lowest) / np.ptp(position),
                         limits.velocity / np.abs(velocity).max(),
                         limits.acceleration / np.abs(acceleration).max())
    centre = 0.5 * (limits.lowest + limits.highest)
    return Samples(time=time, position=centre + scale * (position - middle),
                   velocity=scale * velocity, acceleration=scale * acceleration,
                   current=np.zeros(len(time)), joint=limits.joint)
