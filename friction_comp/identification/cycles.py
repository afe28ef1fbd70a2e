# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Cycles of constant velocity: what each measured, and what those driven twice have in common.

Speeds rise while they are driven, so that time and speed would be mistaken for each other on a
drive that warms up: some speeds are driven once more at the end, and must agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from friction_comp.identification.inertia import without_lag
from friction_comp.identification.profiles import (
    constant_velocity_currents,
    constant_velocity_windows,
    KineticPoint,
    SETTLING,
)

MAX_SCATTER = 0.15
"""Standard deviation above which a current does not measure friction, a share of it."""
# For two cycles to be compared, share by which the mean speed may differ, since one that was slower
# or faster measured other friction, and how many times as much the current may scatter.
_SAME_SPEED, _SAME_SCATTER = 0.02, 1.5
# Share of friction, and standard errors of the difference, by which a speed that is driven again
# must differ for friction to drift.
_DRIFT, _ERRORS = 0.03, 3.0
# Share of the samples of a phase that, if all counted alike, would have the error of the weighted
# mean: (∫w)² / ∫w² with w = s²(1 - s)².
_COUNTED = 0.7
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
    factor: float = 1.0                     # of the controller's gains

    @classmethod
    def measured(cls, begin: float, duration: float, speed: float, samples: np.ndarray,
                 commands: np.ndarray, acceleration: float, lag: float = 0.0,
                 factor: float = 1.0) -> Cycle:
        """Return the cycle that begins at a time in s, from samples and commands as above.

        `acceleration` is per current, rad/s² per A, `lag` that of the current in s. InputError if a
        phase has too few samples.
        """
        level = without_lag(samples, lag)
        time, position, current = level[np.isfinite(level[:, 2])].T
        points, commanded = (
            constant_velocity_currents(t - begin, x, i, speed, duration, acceleration)
            for t, x, i in ((time, position, current), (*samples.T[:2], commands)))
        return cls(begin, duration, points, commanded, samples, commands, factor)

    def again(self, acceleration: float, lag: float) -> Cycle:
        """Return this cycle, measured with what is known of inertia and lag at the end."""
        return self.measured(self.begin, self.duration, self.speed, self.samples, self.commands,
                             acceleration, lag, self.factor)

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
        return max(point.standard_deviation / math.sqrt(max(_COUNTED * len(phase), 1.0))
                   for point, phase in zip(self.points, self.phases())) / self.friction

    @property
    def reach(self) -> float:
        """Distance driven at constant velocity, rad."""
        (begin, end), _ = constant_velocity_windows(self.duration)
        return self.speed * (end - begin)

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

    def over_position(self) -> tuple[np.ndarray, np.ndarray]:
        """Return friction and load in A over ranges of position; NaN where too little is known."""
        sides = []
        for _, position, current in (phase.T for phase in self.phases()):
            index = np.floor(((position - self.middle) / self.reach + 0.5) * _RANGES).astype(int)
            inside = (index >= 0) & (index < _RANGES)
            count = np.bincount(index[inside], minlength=_RANGES)
            total = np.bincount(index[inside], current[inside], _RANGES)
            sides.append(np.where(count >= _SAMPLES, total / np.maximum(count, 1), np.nan))
        return 0.5 * (sides[0] - sides[1]), 0.5 * (sides[0] + sides[1])


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
        return other.scatter <= max(MAX_SCATTER, _SAME_SCATTER * one.scatter) and all(
            abs(b.actual_speed / a.actual_speed - 1.0) <= _SAME_SPEED
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
    if not any(abs(shares[a.speed]) > max(_DRIFT, _ERRORS * math.hypot(a.error, b.error))
               for a, b in both):
        return [point for cycle in first for point in cycle.points], {}
    times = [a.time for a, _ in both]
    return [replace(point, current=point.current + float(np.interp(cycle.time, times, side)))
            for cycle in first for point, side in zip(cycle.points, zip(*moved))], shares
