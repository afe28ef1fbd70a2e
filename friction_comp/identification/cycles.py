# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What cycles of constant velocity measure: mean currents and drift.

Speeds rise while they are driven, so that time and speed would be mistaken for each other on a
drive that warms up: some speeds are driven once more at the end, and must agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import InputError
from friction_comp.identification.goal import constant_velocity_windows, FEWEST, SETTLING

MAX_SCATTER = 0.15
"""Standard deviation above which a current does not measure friction, a share of it."""


@dataclass(frozen=True)
class KineticPoint:
    """One entry of the look-up table."""

    speed: float                 # ω_c as requested, rad/s, signed
    current: float               # weighted mean, A
    standard_deviation: float    # of the measured current over the phase, A
    actual_speed: float          # mean velocity over the phase, rad/s
    unsteadiness: float          # largest deviation from a straight line, as a share of its length
    position: float = 0.0        # mean over the phase, rad


def constant_velocity_currents(time: ArrayLike, position: ArrayLike, current: ArrayLike,
                               speed: float, cycle_time: float
                               ) -> tuple[KineticPoint, KineticPoint]:
    """Average the current over the phases of one cycle of Eq. 3 at +ω_c and at -ω_c.

    Time in s since the beginning of the cycle, position in rad and measured current in A, each
    (N,). With the weights s²·(1 - s)² of a phase's share s, a controller that still settles hardly
    matters, and friction that varies over position averages out. Raises InputError if a phase has
    too few samples.
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
        slope, middle = np.polyfit(t, x, 1)
        straight = x - slope * t - middle
        distance = max(abs(slope) * (t[-1] - t[0]), 1e-12)
        points.append(KineticPoint(
            speed=sign * speed, current=float(weight @ i),
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
    gain: float = 1.0                       # factor of the controller's bandwidth

    @classmethod
    def measured(cls, begin: float, duration: float, speed: float, samples: np.ndarray,
                 commands: np.ndarray, gain: float = 1.0) -> Cycle:
        """Return the cycle that begins at a time in s; InputError without enough samples."""
        time, position, current = samples[np.isfinite(samples[:, 2])].T
        points, commanded = (
            constant_velocity_currents(t - begin, x, i, speed, duration)
            for t, x, i in ((time, position, current), (*samples.T[:2], commands)))
        return cls(begin, duration, points, commanded, samples, gain)

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

    `slopes` over position, A/rad, are those of `position_slopes`.
    """
    def level(cycle: Cycle, points: Sequence[KineticPoint]) -> tuple[KineticPoint, ...]:
        return tuple(replace(point, current=point.current - slope * (point.position - cycle.middle))
                     for point, slope in zip(points, slopes))
    return [replace(cycle, points=level(cycle, cycle.points),
                    commanded=level(cycle, cycle.commanded)) for cycle in cycles]


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
