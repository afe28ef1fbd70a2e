# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What cycles of constant velocity measure: mean currents, drift, and inertia.

Speeds rise while they are driven, so that time and speed would be mistaken for each other on a
drive that warms up: some speeds are driven once more at the end, and must agree.

For inertia, as acceleration per current, only what follows the profile counts: an encoder's counts
are in the acceleration, and through the velocity controller in the current as well, so that least
squares on what was measured would find another inertia (two stages, with the profile as the
instrument).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import orth
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from friction_comp.errors import InputError
from friction_comp.identification.goal import constant_velocity_windows, FEWEST, SETTLING

MAX_SCATTER = 0.15
"""Standard deviation above which a current does not measure friction, a share of it."""
# The profile's velocity (Eq. 3) over the share of a cycle, and the low passes behind which the
# motion follows it, s: velocity controllers of 10 to 100 rad/s.
_SHARES, _SPEEDS = (0.0, 0.1, 0.4, 0.6, 0.9, 1.0), (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)
_FOLLOWS = (0.0, 0.03, 0.1)


@dataclass(frozen=True)
class KineticPoint:
    """One entry of the look-up table."""

    speed: float                 # ω_c as requested, rad/s, signed
    current: float               # weighted mean without the part that accelerates the joint, A
    standard_deviation: float    # of the measured current over the phase, A
    actual_speed: float          # mean velocity over the phase, rad/s
    unsteadiness: float          # largest deviation from a straight line, as a share of its length
    position: float = 0.0        # mean over the phase, rad


def constant_velocity_currents(time: ArrayLike, position: ArrayLike, current: ArrayLike,
                               speed: float, cycle_time: float,
                               acceleration_per_current: float = np.inf
                               ) -> tuple[KineticPoint, KineticPoint]:
    """Average the current over the phases of one cycle of Eq. 3 at +ω_c and at -ω_c.

    Time in s since the beginning of the cycle, position in rad and measured current in A, each
    (N,). The current that still accelerates the joint (k_t·n/J, rad/s² per A) is subtracted. The
    weights s²·(1 - s)² of a phase's share s are those with which the second derivative of a fitted
    parabola is the mean acceleration, and friction that varies over position averages out. Raises
    InputError if a phase has too few samples.
    """
    time, position, current = (
        np.asarray(values, dtype=float) for values in (time, position, current))
    points = []
    for sign, (begin, end) in zip((1.0, -1.0), constant_velocity_windows(cycle_time, SETTLING)):
        chosen = (time >= begin) & (time <= end)
        if np.sum(chosen) < FEWEST:
            raise InputError(f'speed {sign * speed:g} rad/s: {np.sum(chosen)} samples of the '
                             'constant-velocity phase are too few to average')
        t = time[chosen] - np.mean(time[chosen])
        x, i = position[chosen], current[chosen]
        share = (t - t[0]) / (t[-1] - t[0])
        # Samples may come unevenly: each stands for the time around it.
        weight = (share * (1.0 - share)) ** 2 * np.gradient(t)
        weight /= np.sum(weight)
        bend, slope, _ = np.polyfit(t, x, 2)
        straight = x - np.polyval(np.polyfit(t, x, 1), t)
        distance = max(abs(slope) * (t[-1] - t[0]), 1e-12)
        points.append(KineticPoint(
            speed=sign * speed, current=float(weight @ i - 2.0 * bend / acceleration_per_current),
            standard_deviation=float(np.std(i)), actual_speed=float(weight @ np.gradient(x, t)),
            unsteadiness=float(np.max(np.abs(straight)) / distance), position=float(weight @ x)))
    return points[0], points[1]


@dataclass(frozen=True)
class Cycle:
    """One cycle of Eq. 3; points are those of the positive and of the negative direction."""

    begin: float                            # s
    duration: float                         # s
    points: tuple[KineticPoint, ...]        # of the measured current
    commanded: tuple[KineticPoint, ...]     # of the commanded current
    samples: np.ndarray                     # s, rad and A, shape (N, 3)
    commands: np.ndarray                    # A, shape (N,)
    gain: float = 1.0                       # factor of the controller's bandwidth

    @classmethod
    def measured(cls, begin: float, duration: float, speed: float, samples: np.ndarray,
                 commands: np.ndarray, acceleration: float, gain: float = 1.0) -> Cycle:
        """Return the cycle that begins at a time in s, from samples and commands as above.

        `acceleration` is per current, rad/s² per A. InputError if a phase has too few samples.
        """
        time, position, current = samples[np.isfinite(samples[:, 2])].T
        points, commanded = (
            constant_velocity_currents(t - begin, x, i, speed, duration, acceleration)
            for t, x, i in ((time, position, current), (*samples.T[:2], commands)))
        return cls(begin, duration, points, commanded, samples, commands, gain)

    def again(self, acceleration: float) -> Cycle:
        """Return this cycle, measured with what is known of inertia at the end."""
        return self.measured(self.begin, self.duration, self.speed, self.samples, self.commands,
                             acceleration, self.gain)

    @property
    def speed(self) -> float:
        """Speed in rad/s, a magnitude."""
        return abs(self.points[0].speed)

    @property
    def friction(self) -> float:
        """Friction at this speed, half the difference of both directions, A."""
        return max(0.5 * (self.points[0].current - self.points[1].current), 1e-9)

    @property
    def time(self) -> float:
        """Time of the middle of the cycle, s."""
        return self.begin + 0.5 * self.duration

    @property
    def scatter(self) -> float:
        """Largest standard deviation of the current, a share of friction."""
        return max(point.standard_deviation for point in self.points) / self.friction

    @property
    def error(self) -> float:
        """Standard error of the mean current, a share of friction."""
        # With the weights, as if 0.7 of the samples counted alike.
        return max(point.standard_deviation / math.sqrt(max(0.7 * len(phase), 1.0))
                   for point, phase in zip(self.points, self.phases())) / self.friction

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


def pairs(first: Sequence[Cycle], again: Sequence[Cycle]) -> list[tuple[Cycle, Cycle]]:
    """Return cycles that held the same speed twice, by the time of the first."""
    def alike(one: Cycle, other: Cycle) -> bool:
        # One that was slower or faster measured other friction.
        return other.scatter <= max(MAX_SCATTER, 1.5 * one.scatter) and all(
            abs(b.actual_speed / a.actual_speed - 1.0) <= 0.02
            for a, b in zip(one.points, other.points))
    return [(one, other) for one in first for other in again
            if one.speed == other.speed and alike(one, other)]


def changes(both: Sequence[tuple[Cycle, Cycle]]) -> list[list[float]]:
    """Return by how much the current changed in both directions from one cycle to the other, A."""
    return [[later.current - one.current for one, later in zip(a.points, b.points)]
            for a, b in both]


def without_drift(first: Sequence[Cycle], again: Sequence[Cycle]
                  ) -> tuple[list[KineticPoint], dict[float, float]]:
    """Return the look-up table, and the drift at each speed in rad/s, a share of its friction.

    The drift is empty if it is small, or noise, at all speeds: the table is then what was measured
    first. Otherwise it is what would have been measured the second time: at speeds that were not
    driven again, the change is interpolated over the times at which speeds were driven first.
    """
    both = pairs(first, again)
    moved = changes(both)
    shares = {a.speed: max(forward, -backward, key=abs) / a.friction
              for (a, _), (forward, backward) in zip(both, moved)}
    if not any(abs(shares[a.speed]) > max(0.03, 3.0 * math.hypot(a.error, b.error))
               for a, b in both):
        return [point for cycle in first for point in cycle.points], {}
    times = [a.time for a, _ in both]
    return [replace(point, current=point.current + float(np.interp(cycle.time, times, side)))
            for cycle in first for point, side in zip(cycle.points, zip(*moved))], shares


# Inertia.

class Inertia(NamedTuple):
    """What cycles tell of inertia."""

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    unexplained: float = 0.0            # share of the variance that follows the profile
    differs: float = 0.0                # from that of cycles at other speeds, at most, as a share


def steadiest_inertia(cycles: Sequence[np.ndarray]) -> Inertia | None:
    """Return the inertia of the neighbouring speeds at which it explains the current best.

    At a given speed and direction, friction is the same whether the joint accelerates or
    decelerates: the difference is due to inertia. Faster cycles have larger accelerations, which
    noise hides less; but an elastic or heavy link swings after them. `cycles` of Eq. 3 are those of
    all speeds, the lowest first, as rows of s, rad and A, each of shape (N, 3); the slowest third,
    near presliding, is left out where there are enough. None if inertia is too small a part of the
    current.
    """
    own = [_products(cycle) for cycle in cycles]
    # Three speeds at a time.
    last = max(len(own) - 3, 0)
    found = [one for k in range(min(len(own) // 3, last), last + 1)
             if (one := _explained(own[k:k + 3]))[0] > 0.0]
    best, unexplained = min(found, key=lambda one: one[1], default=(0.0, 1.0))
    if unexplained > 0.2:
        return None
    return Inertia(1.0 / best, unexplained, max(
        abs(math.log(one / best)) for one, left in found if left <= 0.5))


def _products(cycle: np.ndarray) -> np.ndarray:
    """Return products of speed, acceleration, slope of current, current as in the profile, (4, 4).

    They are without Coulomb friction, which is that of this cycle in either direction.
    """
    time, position, current = cycle[np.isfinite(cycle[:, 2])].T
    duration = time[-1] - time[0]
    even = np.linspace(time[0], time[-1], max(int(duration / np.median(np.diff(time))), 50))
    step = float(even[1] - even[0])
    speed = np.interp((even - time[0]) / duration, _SHARES, _SPEEDS)
    profile = np.column_stack([speed, np.gradient(speed, step)])
    # All pass the same filter, so that none is rounded more at the corners of the profile.
    signals = np.column_stack([
        np.interp(even, time, position), np.interp(even, time, current),
        *(_late(profile, lag, step) for lag in _FOLLOWS)])
    for _ in range(3):
        signals = uniform_filter1d(
            signals, max(int(0.008 * duration / step), 3), axis=0, mode='nearest')
    speed = np.gradient(signals[:, 0], step)
    # Nearer to a reversal, presliding ends.
    chosen = np.abs(speed) > 0.5 * float(np.max(np.abs(speed)))
    columns = np.column_stack([speed, np.gradient(speed, step), np.gradient(signals[:, 1], step),
                               signals[:, 1]])[chosen]
    sides = np.column_stack([speed > 0.0, speed < 0.0]).astype(float)[chosen]
    basis, sides = orth(np.column_stack([sides, signals[chosen, 2:]])), orth(sides)
    follows = basis @ (basis.T @ columns)
    rest = follows - sides @ (sides.T @ follows)
    return np.asarray(step * rest.T @ rest)


def _explained(products: Sequence[np.ndarray]) -> tuple[float, float]:
    """Return current per acceleration, A per rad/s², and the share of variance that it leaves.

    `products` are those of some cycles, each with its own viscous friction.
    """
    sums = np.sum([own[1:, 1:] - np.outer(own[1:, 0], own[0, 1:]) / own[0, 0]
                   for own in products], axis=0)
    sizes = np.maximum(np.sqrt(np.diag(sums)), 1e-150)
    alike = sums / np.outer(sizes, sizes)
    plain = alike[:1, 2]
    late = np.linalg.lstsq(alike[:2, :2], alike[:2, 2], rcond=None)[0]
    left = [float(1.0 - found @ alike[:len(found), 2]) for found in (plain, late)]
    # Behind a filter, a current's own slope makes up for its lag.
    found, unexplained = (late, left[1]) if left[1] < 0.5 * left[0] else (plain, left[0])
    return float(found[0] * sizes[2] / sizes[0]), unexplained


def _late(values: np.ndarray, lag: float, step: float) -> np.ndarray:
    """Return values behind a low pass with a time constant in s; none if it is zero."""
    # The mean delay of this filter is the time constant, also at low rates.
    share = step / (step + lag)
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, axis=0))
