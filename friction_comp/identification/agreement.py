# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What is measured twice must agree: else a result says by how much it does not.

- A speed that is driven before the ramps and once more after them: friction drifts, as on a drive
  that warms up. Time and speed would else be mistaken for each other, since speeds rise.
- A position that is passed twice: what both passes have in common depends on position.
- The measured and the commanded current at constant velocity: offset and gain of a sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from friction_comp.identification.breakaway import unseen_speed
from friction_comp.identification.inertia import Inertia, without_lag
from friction_comp.identification.kinetic import (
    constant_velocity_currents,
    constant_velocity_windows,
    KineticPoint,
    SETTLING,
)
from friction_comp.identification.ramp_evaluation import held_current, Ramp

# Above this standard deviation, a share of friction, a current does not measure it.
MAX_SCATTER = 0.15
# Shares of friction above which two measurements differ: of a speed driven again, of measured and
# commanded currents, and the amplitude of what depends on position.
_DRIFT, _CURRENTS, _POSITION = 0.03, 0.04, 0.05
# The same, if a single cycle shows it: noise is part of it.
_UNEVEN = 0.1
# Share of friction that may accelerate a joint of unknown inertia without a warning.
_UNSETTLED = 0.03
# A lag between current and position from which on a warning is given, s.
_LAG = 0.005
# Share by which inertias at different speeds may differ, and that inertia may leave unexplained,
# without a warning: rigid joints with fine encoders stay below 0.01.
_SWINGS = 0.05
# Share of the lowest speed that an encoder must tell from rest.
_UNSEEN = 0.1
# Standard errors of the difference of two means by which it must be larger.
_ERRORS = 3.0
# Ranges of position that are compared, and fewest samples in each.
_RANGES, _SAMPLES = 48, 3


@dataclass(frozen=True)
class Cycle:
    """One cycle of Eq. 3; points are those of the positive and of the negative direction."""

    begin: float                            # s
    duration: float                         # s
    points: tuple[KineticPoint, ...]        # of the measured current
    commanded: tuple[KineticPoint, ...]     # of the commanded current
    samples: np.ndarray                     # s, rad and A, shape (N, 3)
    commands: np.ndarray                    # A, shape (N,)

    @classmethod
    def measured(cls, begin: float, duration: float, speed: float, samples: np.ndarray,
                 commands: np.ndarray, acceleration: float, lag: float = 0.0) -> Cycle:
        """Return the cycle that begins at a time in s, from samples and commands as above.

        `acceleration` is per current, rad/s² per A, `lag` that of the current in s. InputError if a
        phase has too few samples.
        """
        level = without_lag(samples, lag)
        time, position, current = level[np.isfinite(level[:, 2])].T
        points = constant_velocity_currents(
            time - begin, position, current, speed, duration, acceleration)
        commanded = constant_velocity_currents(
            samples[:, 0] - begin, samples[:, 1], commands, speed, duration, acceleration)
        return cls(begin, duration, points, commanded, samples, commands)

    def again(self, acceleration: float, lag: float) -> Cycle:
        """Return this cycle, measured with what is known of inertia and lag at the end."""
        return self.measured(self.begin, self.duration, self.speed, self.samples, self.commands,
                             acceleration, lag)

    @property
    def speed(self) -> float:
        """Speed in rad/s, a magnitude."""
        return abs(self.points[0].speed)

    @property
    def time(self) -> float:
        """Time of the middle of the cycle, s."""
        return self.begin + 0.5 * self.duration

    @property
    def phase(self) -> float:
        """Duration of a phase at constant velocity, s."""
        (begin, end), _ = constant_velocity_windows(self.duration)
        return end - begin

    @property
    def scatter(self) -> float:
        """Largest standard deviation of the current, a share of friction."""
        return max(point.standard_deviation for point in self.points) / _friction(self.points)

    @property
    def reach(self) -> float:
        """Distance driven at constant velocity, rad."""
        return self.speed * self.phase

    @property
    def middle(self) -> float:
        """Middle of the range driven, rad."""
        position = self.samples[:, 1]
        return 0.5 * float(np.min(position) + np.max(position))

    def phases(self) -> list[np.ndarray]:
        """Return the samples of both phases at constant velocity, each of shape (N, 3)."""
        since = self.samples[:, 0] - self.begin
        known = np.isfinite(self.samples[:, 2])
        return [self.samples[(since >= begin) & (since <= end) & known]
                for begin, end in constant_velocity_windows(self.duration, SETTLING)]


def levelled(cycles: Sequence[Cycle], slopes: Sequence[float]) -> list[Cycle]:
    """Return cycles with the currents of the points as in the middle of the range.

    `slopes` over position, A/rad, are those of `position_slopes`. What both directions have in
    common is a load, which is subtracted from the samples, too.
    """
    result = []
    for cycle in cycles:
        load = np.zeros_like(cycle.samples)
        load[:, 2] = 0.5 * sum(slopes) * (cycle.samples[:, 1] - cycle.middle)
        points, commanded = (tuple(
            replace(point, current=point.current - slope * (point.position - cycle.middle))
            for point, slope in zip(kind, slopes)) for kind in (cycle.points, cycle.commanded))
        result.append(replace(cycle, points=points, commanded=commanded,
                              samples=cycle.samples - load))
    return result


def position_slopes(cycles: Sequence[Cycle]) -> tuple[float, float]:
    """Return by how much the current rises over position, A/rad, forwards and backwards.

    The controller settles at the beginning of a phase, so that its mean belongs to the far side
    forwards and to the near side backwards, the more the faster the joint is: a spring would be
    taken for viscous friction. `cycles` begin with the slowest; only the slower half is used, in
    which the controller has settled.
    """
    products, squares = np.zeros(2), np.full(2, 1e-12)
    for cycle in cycles[:max(1, len(cycles) // 2)]:
        for side, (_, position, current) in enumerate(phase.T for phase in cycle.phases()):
            away = position - np.mean(position)
            products[side] += float(away @ current)
            squares[side] += float(away @ away)
    forward, backward = products / squares
    return float(forward), float(backward)


def pairs(first: Sequence[Cycle], again: Sequence[Cycle]) -> list[tuple[Cycle, Cycle]]:
    """Return cycles of the same speed, by the time of the first."""
    second = {cycle.speed: cycle for cycle in again}
    return [(cycle, second[cycle.speed]) for cycle in first if cycle.speed in second]


def without_drift(first: Sequence[Cycle], again: Sequence[Cycle]
                  ) -> tuple[list[KineticPoint], dict[float, float]]:
    """Return the look-up table, and the drift at each speed in rad/s, a share of its friction.

    The drift is empty if it is small, or noise, at all speeds: the table is then what was measured
    first. Otherwise it is what would have been measured the second time: at speeds that were not
    driven again, the change is interpolated over the times at which speeds were driven first.
    """
    both = pairs(first, again)
    changes = [[later.current - one.current for one, later in zip(a.points, b.points)]
               for a, b in both]
    shares = {a.speed: max(forward, -backward, key=abs) / _friction(a.points)
              for (a, _), (forward, backward) in zip(both, changes)}
    if not any(abs(shares[a.speed]) > max(_DRIFT, _ERRORS * math.hypot(_error(a), _error(b)))
               for a, b in both):
        return [point for cycle in first for point in cycle.points], {}
    times = [a.time for a, _ in both]
    return [replace(point, current=point.current + float(np.interp(cycle.time, times, side)))
            for cycle in first for point, side in zip(cycle.points, zip(*changes))], shares


def say_drift(shares: dict[float, float]) -> list[str]:
    """Return a warning on the drift of `without_drift`."""
    if not shares:
        return []
    sizes = ', '.join(f'by {share:+.1%} at {speed:.3g} rad/s' for speed, share in shares.items())
    return [f'friction drifted during the measurement: {sizes}. The look-up table and its curve '
            'are those of the end, breakaway is the mean of the time before. Let the drive warm '
            'up, then identify it again']


def check_positions(first: Sequence[Cycle], again: Sequence[Cycle]) -> list[str]:
    """Return warnings if friction, or the load, varies over position.

    The slowest speed that was driven twice is used. What both cycles have in common is not noise.
    """
    both = pairs(first, again)
    if not both:
        return []
    profiles = [_over_position(cycle) for cycle in both[0]]
    friction = _friction(both[0][0].points)
    width = max(float(np.ptp(cycle.samples[:, 1])) for cycle in first)
    said = []
    for part, (what, then) in enumerate((
            ('friction', 'the look-up table has means over the range driven, breakaway is nearer '
             'to the peaks in its middle; in other places, either may differ by more'),
            ('the load', 'gravity, a spring or cogging, which are no part of the model: add them '
             'with refine, since compensated friction no longer holds a weight'))):
        one, other = (profile[part] for profile in profiles)
        known = np.isfinite(one) & np.isfinite(other)
        if np.sum(known) < _RANGES // 2:
            continue
        common = float(np.cov(one[known], other[known])[0, 1])
        # A slow cycle is short: what rises over it, rises over all that the fastest drive.
        places = np.flatnonzero(known) * both[0][0].reach / _RANGES
        rise, other_rise = (
            float(np.polyfit(places, profile[known], 1)[0]) for profile in (one, other))
        trend = 0.5 * width * min(abs(rise), abs(other_rise)) * (rise * other_rise > 0.0)
        amplitude = max(math.sqrt(2.0 * max(common, 0.0)), trend) / friction
        if amplitude > _POSITION:
            said.append(f'{what} varies over position, by about ±{amplitude:.0%} of friction: '
                        f'{then}')
    return said


def why_unreliable(slowest: Cycle) -> str:
    """Return why the currents that hold a joint differ, as far as its slowest cycle shows it."""
    friction, _ = _over_position(slowest)
    known = friction[np.isfinite(friction)]
    amplitude = math.sqrt(2.0) * float(np.std(known)) / _friction(slowest.points) if len(
        known) else 0.0
    if amplitude < _UNEVEN:
        return 'it is pushed, or its friction changes with time, or from place to place'
    return (f'friction varies over position, by about ±{amplitude:.0%} at {slowest.speed:.3g} '
            'rad/s, so that breakaway is another one at each place. Look for its cause, as an '
            'eccentric shaft or a damaged tooth. Or refine a recording of slow motion: the effect '
            'friction_ripple models it')


def check_currents(cycles: Sequence[Cycle]) -> list[str]:
    """Return a warning if measured and commanded currents differ at constant velocity."""
    measured, commanded = (sum(_friction(points) for points in kind) for kind in (
        [cycle.points for cycle in cycles], [cycle.commanded for cycle in cycles]))
    gain = measured / max(commanded, 1e-9)
    offset = sum(one.current - other.current for cycle in cycles
                 for one, other in zip(cycle.points, cycle.commanded)) / (2.0 * measured)
    said = []
    if abs(gain - 1.0) > _CURRENTS:
        said.append(f'the measured current is {gain:.2f} times the commanded one: torque constant, '
                    'gear ratio or current controller deviate from the model file, and friction '
                    'is the measured one')
    if abs(offset) > _CURRENTS:
        said.append(f'the measured current is off the commanded one by {offset:+.0%} of friction '
                    'in both directions: the current sensor has an offset, now part of the model')
    return said


def say_scatter(cycles: Sequence[Cycle]) -> list[str]:
    """Return a warning if the current varies too much to measure friction, with any gains."""
    worst = max(cycles, key=lambda cycle: cycle.scatter)
    if worst.scatter <= MAX_SCATTER:
        return []
    return [f'at {worst.speed:.3g} rad/s, the current varies by ±{worst.scatter:.0%} of friction, '
            'with lower gains as well: friction varies there, or the joint oscillates under its '
            'velocity controller, and the look-up table may be off']


def say_lag(lag: float) -> list[str]:
    """Return a warning on the lag of the current, s, or, below zero, of the position."""
    if abs(lag) < _LAG:
        return []
    late, early = ('current', 'position') if lag > 0.0 else ('position', 'current')
    return [f'the measured {late} is {abs(lag):.2g} s later than the {early}, as behind a low '
            'pass in the drive; friction and inertia are without this lag']


def say_swing(inertia: Inertia | None) -> list[str]:
    """Return a warning if inertia differs between speeds, or leaves some current unexplained."""
    doubt = max(inertia.differs, inertia.unexplained) if inertia else 0.0
    if doubt < _SWINGS:
        return []
    return [f'the acceleration per current may be off by {doubt:.0%}: at different speeds it is as '
            'different, or does not explain as much. The joint swings, as one with an elastic or '
            'heavy link, whose acceleration is not that of the motor, or its encoder is coarse. '
            'Presliding of a joint that swings may be up to 30 % short']


def say_unseen_creep(slowest: Cycle, ramps: Sequence[Ramp], resolution: float) -> list[str]:
    """Return a warning if the joint may have crept, unseen, at the current that held it.

    Where friction falls from standstill, a joint that slides becomes faster, and is seen: there,
    breakaway exceeds friction in the slowest cycle. `resolution` is in rad per count.
    """
    unseen = unseen_speed([ramp.held for ramp in ramps], resolution)
    breakaway = sum(np.mean([abs(held_current(ramp)) for ramp in ramps if ramp.direction == sign])
                    for sign in (1, -1)) / 2.0
    if unseen < _UNSEEN * slowest.speed or breakaway > _friction(slowest.points):
        return []
    return [f'the encoder does not tell rest from creep of up to {unseen:.2g} rad/s, and friction '
            'does not fall from standstill: breakaway may be as much too high as friction rises up '
            'to this speed']


def say_unsettled(accelerated: Sequence[Cycle], plain: Sequence[Cycle]) -> list[str]:
    """Return a warning where acceleration matters, on a joint whose inertia is not known.

    Both are the same cycles: currents without what accelerates the joint, as far as it is known,
    and with it.
    """
    shares = {one.speed: max(abs(a.current - b.current) for a, b in zip(one.points, other.points))
              / _friction(other.points) for one, other in zip(accelerated, plain)}
    far = [speed for speed, share in shares.items() if share > _UNSETTLED]
    if not far:
        return []
    return [f'from {min(far):.3g} rad/s on, the velocity controller had no time to settle, and the '
            f'inertia is not known: currents there may be off by {max(shares.values()):.0%} of '
            'friction. Widen motion_range, or request lower speeds']


def _friction(points: Sequence[KineticPoint]) -> float:
    return max(0.5 * (points[0].current - points[1].current), 1e-9)


def _error(cycle: Cycle) -> float:
    """Return the standard error of the current at constant velocity, a share of friction."""
    # 0.7 of the samples would have this error if all counted alike.
    return max(point.standard_deviation / math.sqrt(max(0.7 * len(phase), 1.0))
               for point, phase in zip(cycle.points, cycle.phases())) / _friction(cycle.points)


def _over_position(cycle: Cycle) -> tuple[np.ndarray, np.ndarray]:
    """Return friction and load in A over ranges of position; NaN where too little is known."""
    sides = []
    reach = cycle.reach
    for _, position, current in (phase.T for phase in cycle.phases()):
        index = np.floor(((position - cycle.middle) / reach + 0.5) * _RANGES).astype(int)
        inside = (index >= 0) & (index < _RANGES)
        count = np.bincount(index[inside], minlength=_RANGES)
        total = np.bincount(index[inside], current[inside], _RANGES)
        sides.append(np.where(count >= _SAMPLES, total / np.maximum(count, 1), np.nan))
    return 0.5 * (sides[0] - sides[1]), 0.5 * (sides[0] + sides[1])
