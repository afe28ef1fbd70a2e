# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plans a motion of one joint: moves between positions with rests, which never repeat.

Target, speed and rest of the n-th move are the n-th point of a scrambled Sobol sequence,
transformed by the five parameters of `SHAPE`, which `scipy.optimize.differential_evolution` chooses
so that the pair of effects that is hardest to distinguish is separated best.

Separation is computed with refinement's columns and block sums: an effect can be distinguished from
another where a part of its columns is independent of those of the other and of Eq. 6.
`column_shares` gives that part; of some constants of both effects, the smallest is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, count
import math
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from friction_comp.errors import check_number, InputError
from friction_comp.files import read_xml
from friction_comp.model.effect import Coverage, Effect
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import one_thread
from friction_comp.refinement.block_sums import column_shares
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.prepare import in_motion, Rows
from friction_comp.samples import Samples
from friction_comp.trajectory import Trajectory

Pair = tuple[str, str]
DEFAULT = ('gravity', 'spring', 'stribeck', 'viscous_shape', 'inner_load_friction')
# Signals that a joint's own motion cannot vary, or that are unknown in a plan.
_NOT_MOVED = {'load', 'temperature', 'rigid_body', 'coupling'}
# Range of each parameter of a shape: slowest speed as a share of the fastest; exponent of the
# speeds, above 1 for more fast moves; longest move, s; longest rest, s; exponent of the positions,
# below 1 for more targets near the ends of the range.
SHAPE = ((0.01, 0.5), (0.3, 4.0), (1.0, 15.0), (0.05, 3.0), (0.05, 1.2))
# Share of the limits that is used: controllers interpolate and overshoot.
MARGIN = 0.95
_POPULATION, _GENERATIONS = 6, 10
# Steepest slope of u³(10 - 15u + 6u²), the profile with which speed rises.
_STEEPEST = 1.875


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint; `InputError` if one is no number, not positive, or leaves no range."""

    joint: str
    lowest: float  # of position, rad
    highest: float
    velocity: float  # largest magnitude, rad/s
    acceleration: float  # rad/s²
    effort: float = math.inf  # of the torque at the joint, N·m; infinite where it is not limited

    def __post_init__(self) -> None:
        what = f'joint {self.joint!r}: the limit of'
        # Beyond any joint that is planned for.
        for end in (self.lowest, self.highest):
            check_number(end, f'{what} position', least=-100.0, most=100.0)
        for name in ('velocity', 'acceleration', 'effort'):
            if name != 'effort' or self.effort != math.inf:
                check_number(getattr(self, name), f'{what} {name}', least=1e-6, most=1e6)
        if not self.lowest < self.highest:
            raise InputError(f'joint {self.joint!r}: the lowest position {self.lowest:g} is not '
                             f'below the highest {self.highest:g}')

    @property
    def centre(self) -> float:
        """The middle of the range, rad."""
        return 0.5 * (self.lowest + self.highest)


def from_urdf(path: str | Path, acceleration: float,
              joints: Sequence[str] = ()) -> list[JointLimits]:
    """Return the limits, of all revolute joints by default, that a URDF states in ``<limit>``.

    Not of joints that mimic another; a URDF does not state the acceleration, rad/s². Raises
    InputError if the file cannot be used, or a joint has no limits of position.
    """
    _, root = read_xml(path)
    found = {str(one.get('name')): one for one in root.findall('joint')
             if one.get('type') == 'revolute'}
    revolute = {name: one.find('limit') for name, one in found.items() if one.find('mimic') is None}
    if not revolute:
        raise InputError(f'{path}: the URDF has no revolute joint')
    limits = []
    for name in joints or revolute:
        limit = revolute.get(name)
        if name in found and name not in revolute:
            raise InputError(f'{path}: joint {name!r} mimics another, and cannot be moved itself')
        if limit is None:
            raise InputError(f'{path}: has no revolute joint {name!r} with a <limit>')
        try:
            low, high, velocity = (float(limit.get(key, ''))
                                   for key in ('lower', 'upper', 'velocity'))
            effort = float(limit.get('effort', 'inf'))
        except ValueError:
            raise InputError(f'{path}: the <limit> of joint {name!r} needs lower, upper and '
                             'velocity as numbers') from None
        limits.append(JointLimits(name, low, high, velocity, acceleration, effort))
    return limits


def pairs_of(names: Iterable[str]) -> list[Pair]:
    """Return all pairs of two or more effects; InputError if motion alone cannot show one."""
    names = list(dict.fromkeys(names))
    for name in names:
        why = _why_refused(name)
        if why:
            raise InputError(f'effect {name!r} {why}')
    if len(names) < 2:
        raise InputError('at least two effects are needed to tell them apart')
    return list(combinations(names, 2))


def _why_refused(name: str) -> str:
    if name not in EFFECTS:
        return f'is unknown; there are {", ".join(filter(_shown_by_motion, EFFECTS))}'
    missing = sorted(set(EFFECTS[name].needs) & _NOT_MOVED)
    if missing or name == 'other_joints':
        return f"cannot be shown by the joint's own motion: it needs {missing or 'other joints'}"
    if 'frequency' in EFFECTS[name].constants:
        return 'needs no plan: motion over many of its periods shows it, at whatever speeds'
    return ''


def _shown_by_motion(name: str) -> bool:
    return not _why_refused(name)


def pairs_in(report: Any, source: str) -> list[Pair]:
    """Return the pairs of effects that refinement's report.json, called `source`, leaves open.

    They are the ambiguous pairs, and those of each uncertain effect with the effects of `DEFAULT`:
    one that some repeated searches do not choose, or on whose variable the error still depends.
    Raises InputError if it is no such report, or leaves nothing open.
    """
    try:
        ambiguous = [sorted(map(str, entry['between'])) for entry in report['ambiguous']]
        uncertain = [one['name'] for one in report.get('effects', ()) if one['chosen'] < 0.9]
        unexplained = {one['variable'] for one in report.get('unexplained', ())}
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(f'{source}: is no report of refine: {error!r}') from None
    shown = [name for name in EFFECTS if _shown_by_motion(name)]
    pairs = [pair for pair in combinations(shown, 2)
             if sorted(EFFECTS[name].variable for name in pair) in ambiguous]
    uncertain += [name for name in DEFAULT if EFFECTS[name].variable in unexplained]
    for first in uncertain:
        if first in shown:
            pairs += [(first, second) for second in DEFAULT
                      if second != first and (second, first) not in pairs]
    if not pairs:
        raise InputError(f'{source}: refine left nothing open that motion alone can tell apart')
    return list(dict.fromkeys(pairs))


def coverage_within(limits: JointLimits, seconds: float) -> Coverage:
    """Return the coverage of motion that reaches all limits, for all plans within them."""
    return Coverage(
        transition=0.02 * limits.velocity, speed=limits.velocity, slowest=0.01 * limits.velocity,
        lowest=limits.lowest, highest=limits.highest, duration=seconds)


def terms_of(name: str, coverage: Coverage) -> list[Term]:
    """Return an effect with three sets of constants, spread over its grid."""
    kind: type[Effect] = EFFECTS[name]
    grid = kind.points(coverage)
    if not grid:
        raise InputError(f'effect {name!r} cannot be seen in {coverage.duration:g} s within these '
                         'limits')
    # Assume a mass whose load on the teeth is largest where the limb is level.
    shares = [{'cosine': 1.0}] if kind.uses_inner_load else []
    chosen = dict.fromkeys(np.linspace(0, len(grid) - 1, 3).astype(int).tolist())
    return [Term(kind, kind.with_loads(grid[row], shares)) for row in chosen]


def separations(samples: Samples, pairs: Sequence[Pair], coverage: Coverage) -> dict[Pair, float]:
    """Return for each pair the share of one effect that is independent of the other, 0..1.

    The samples have velocity and acceleration, the coverage is of `coverage_within`. Zero if there
    is hardly any motion. Raises InputError if an effect cannot be seen with this coverage.
    """
    try:
        usable = in_motion(samples, coverage.slowest)
    except InputError:
        return dict.fromkeys(pairs, 0.0)
    index = np.flatnonzero(usable)
    table = Table(Rows(
        samples=samples, target=samples.current, usable=usable, coverage=coverage, index=index,
        block=np.zeros(len(index), dtype=int)),
        2.0 / coverage.transition)
    names = dict.fromkeys(name for pair in pairs for name in pair)
    keys = {name: table.add(terms_of(name, coverage)) for name in names}

    def least(first: str, second: str) -> float:
        shares = []
        for one in keys[first]:
            for other in keys[second]:
                columns = table.indices([one, other], derivatives=False)
                share = dict(zip(columns, column_shares(table.sums.part(columns).scaled(0.0))))
                shares += [max(share[column] for column in table.columns_of[key])
                           for key in (one, other)]
        return float(min(shares, default=0.0))
    return {(first, second): least(first, second) for first, second in pairs}


@dataclass(frozen=True)
class Move:
    """One motion from rest to rest."""

    begin: float  # s
    start: float  # rad
    distance: float  # rad, with a sign
    speed: float  # during the phase of constant speed, rad/s
    ramp: float  # duration of acceleration, and of deceleration, s
    cruise: float  # duration of constant speed, s

    @classmethod
    def within(cls, begin: float, start: float, end: float, speed: float,
               acceleration: float) -> Move:
        """Return a move at a speed, or at the highest one that distance and acceleration allow."""
        distance = abs(end - start)
        speed = min(speed, math.sqrt(distance * acceleration / _STEEPEST), distance / 0.1)
        # A least time limits jerk, in short moves too.
        ramp = max(_STEEPEST * speed / acceleration, 0.1)
        return cls(begin, start, end - start, speed, ramp, max(distance / speed - ramp, 0.0))

    @property
    def duration(self) -> float:
        """Duration in s."""
        return 2.0 * self.ramp + self.cruise


def samples_of(moves: Sequence[Move], limits: JointLimits, seconds: float, rate: float) -> Samples:
    """Return moves and rests between them, in order of time, sampled at a rate in Hz.

    They begin at the centre. The current is zero; the last sample is at the end or just after it.
    """
    time = np.arange(math.ceil(seconds * rate - 1e-9) + 1) / rate
    position = np.full(len(time), limits.centre)
    velocity, acceleration = np.zeros(len(time)), np.zeros(len(time))
    for move in moves:
        first, stop = np.searchsorted(time, (move.begin, move.begin + move.duration))
        elapsed = time[first:stop] - move.begin
        # Time since the begin and until the end, as shares of the acceleration time.
        before, after = (np.clip(part / move.ramp, 0.0, 1.0)
                         for part in (elapsed, move.duration - elapsed))
        side = math.copysign(1.0, move.distance)
        rise = np.minimum(before, after)
        speed = move.speed * rise ** 3 * (10.0 - 15.0 * rise + 6.0 * rise ** 2)
        slope = move.speed / move.ramp * 30.0 * (rise * (1.0 - rise)) ** 2
        distance = (_ramp_distance(move, before)
                    + move.speed * np.clip(elapsed - move.ramp, 0.0, move.cruise)
                    + 0.5 * move.speed * move.ramp - _ramp_distance(move, after))
        position[first:stop] = move.start + side * distance
        velocity[first:stop] = side * speed
        acceleration[first:stop] = side * np.where(before < after, slope, -slope)
        position[stop:] = move.start + move.distance
    return Samples(time=time, position=position, velocity=velocity, acceleration=acceleration,
                   current=np.zeros(len(time)), joint=limits.joint)


def _ramp_distance(move: Move, share: np.ndarray) -> np.ndarray:
    """Return the distance covered in a share of the acceleration time, rad."""
    return np.asarray(move.speed * move.ramp * share ** 4 * (2.5 - 3.0 * share + share ** 2))


@dataclass(frozen=True)
class JointPlan:
    """The planned motion of one joint, which begins and ends at the centre of its limits."""

    limits: JointLimits
    moves: tuple[Move, ...]
    seconds: float
    separation: dict[Pair, float]  # of each pair of effects, see `separations`

    def samples(self, rate: float) -> Samples:
        """Return the motion sampled at a rate in Hz, with zero current."""
        return samples_of(self.moves, self.limits, self.seconds, rate)


def trajectory_of(plans: Sequence[JointPlan], rate: float) -> Trajectory:
    """Return plans of equal duration as one trajectory, sampled at a rate in Hz."""
    motions = [plan.samples(rate) for plan in plans]
    states = [np.column_stack([getattr(one, name) for one in motions])
              for name in ('position', 'velocity', 'acceleration')]
    return Trajectory(tuple(plan.limits.joint for plan in plans), motions[0].time, *states)


def moves_of_shape(shape: Sequence[float] | np.ndarray, limits: JointLimits, seconds: float,
                   points: np.ndarray) -> list[Move]:
    """Return the moves of a plan.

    `shape` has a value of each parameter of `SHAPE`. The rows of `points`, (K, 3), are the target,
    speed and rest of each move as numbers from 0 to 1; the first gives only the rest at the begin.
    """
    slowest, speed_exponent, longest_move, longest_rest, position_exponent = shape
    top, acceleration = MARGIN * limits.velocity, MARGIN * limits.acceleration
    centre, half = limits.centre, 0.5 * MARGIN * (limits.highest - limits.lowest)
    time, position, moves = float(longest_rest * points[0, 2]), centre, []
    for u_target, u_speed, u_rest in points[1:]:
        speed = top * slowest ** (u_speed ** speed_exponent)
        target = centre + half * np.copysign(
            abs(2.0 * u_target - 1.0) ** position_exponent, u_target - 0.5)
        target = float(np.clip(
            target, position - speed * longest_move, position + speed * longest_move))
        if abs(target - position) < 0.01 * half:
            continue
        move = Move.within(time, position, target, speed, acceleration)
        end = time + move.duration + longest_rest * u_rest ** 2
        # There must be time left to return to the centre.
        back = (Move.within(end, target, centre, 0.5 * top, acceleration)
                if abs(target - centre) > 1e-6 * half else None)
        if end + (back.duration if back else 0.0) > seconds:
            break
        moves.append(move)
        time, position = end, target
    if abs(position - centre) > 1e-6 * half:
        moves.append(Move.within(time, position, centre, 0.5 * top, acceleration))
    return moves


@one_thread
def plan_joint(limits: JointLimits, pairs: Sequence[Pair], seconds: float, seed: int,
               model: FrictionModel | None = None,
               report: Callable[[float], None] = lambda share: None) -> JointPlan:
    """Return a motion of one joint that separates pairs of effects; the same for the same seed.

    The effort limit is checked with `model`, if given; `report` gets the share of the work done.
    Raises InputError if there is too little or too much time, or the effort limit cannot be kept.
    """
    # Moves enough, and points enough for the moves.
    for wrong, what in ((seconds < 20.0, 'short for a plan: at least 20 s'),
                        (seconds > 1800.0, 'long for a plan: at most 1800 s')):
        if wrong:
            raise InputError(f'{seconds:g} s are too {what}')
    coverage = coverage_within(limits, seconds)
    points = qmc.Sobol(3, scramble=True, seed=seed).random(32768)

    def planned(shape: np.ndarray, own: JointLimits) -> JointPlan:
        moves = moves_of_shape(shape, own, seconds, points)
        return JointPlan(limits, tuple(moves), seconds, separations(
            samples_of(moves, limits, seconds, 50.0), pairs, coverage))

    def cost(shape: np.ndarray) -> float:
        shares = list(planned(shape, limits).separation.values())
        logarithms = np.log(np.maximum(shares, 1e-6))
        # The worst pair, and of each other one a little.
        return -float(min(logarithms) + 0.3 * len(pairs) * np.mean(logarithms))
    generation = count(1)
    shape = differential_evolution(
        cost, SHAPE, popsize=_POPULATION, maxiter=_GENERATIONS, tol=0.0, polish=False, seed=seed,
        callback=lambda *_, **__: report(next(generation) / _GENERATIONS)).x
    reduced = limits
    for _ in range(12):
        plan = planned(shape, reduced)
        if not any(plan.separation.values()):
            # At this speed, hardly any move fits into the time.
            break
        if model is None or peak_torque(model, plan.samples(200.0)) <= MARGIN * limits.effort:
            return plan
        reduced = replace(reduced, velocity=0.8 * reduced.velocity,
                          acceleration=0.8 * reduced.acceleration)
    raise InputError(
        f'joint {limits.joint!r}: {seconds:g} s are too short for motion within these limits'
        if reduced is limits else f'joint {limits.joint!r}: by its model even slow motion needs '
        f'more than the effort limit of {limits.effort:g} N·m')


def peak_torque(model: FrictionModel, samples: Samples) -> float:
    """Return the largest joint torque of a motion that no person loads, by a model, N·m."""
    unloaded = samples.with_(load=np.zeros(len(samples)))
    return float(np.max(np.abs(model.predict(unloaded)))) * model.drive.torque_per_current
