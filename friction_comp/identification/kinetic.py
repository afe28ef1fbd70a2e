# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Mean currents at constant velocity: the look-up table of section 2.3."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import InputError
from friction_comp.identification.excitation import constant_velocity_windows

# s that a constant-velocity phase is given to settle.
_SETTLING = 0.25


@dataclass(frozen=True)
class KineticPoint:
    """One entry of the look-up table."""

    speed: float                 # ω_c as asked for, rad/s, signed
    current: float               # mean, A, the share that accelerates the joint taken off
    standard_deviation: float    # of the measured current over the phase, A
    actual_speed: float          # mean velocity over the phase, rad/s
    unsteadiness: float          # largest deviation from a straight line, as a share of its length
    samples: int


def constant_velocity_currents(time: ArrayLike, position: ArrayLike, current: ArrayLike,
                               speed: float, cycle_time: float,
                               acceleration_per_current: float | None = None
                               ) -> tuple[KineticPoint, KineticPoint]:
    """Average the current over the phases of one cycle of Eq. 3 at +ω_c and at -ω_c.

    `time` is in s since the cycle began, `position` in rad, `current` the measured one in A, each
    of shape (N,). With k_t·n/J, in rad/s² per A, the small current that still accelerates the joint
    during a phase is taken off its mean.
    """
    time, position, current = (
        np.asarray(values, dtype=float) for values in (time, position, current))
    points = []
    for sign, (begin, end) in zip((1.0, -1.0), constant_velocity_windows(cycle_time, _SETTLING)):
        chosen = (time >= begin) & (time <= end)
        count = int(np.sum(chosen))
        if count < 10:
            raise InputError(
                f'speed {sign * speed:g} rad/s: the constant-velocity phase holds {count} samples, '
                'too few to average')
        t = time[chosen] - np.mean(time[chosen])
        x, i = position[chosen], current[chosen]
        bend, slope, _ = np.polyfit(t, x, 2)
        mean = float(np.mean(i))
        if acceleration_per_current is not None:
            mean -= 2.0 * bend / acceleration_per_current
        straight = x - np.polyval(np.polyfit(t, x, 1), t)
        way = max(abs(slope) * (t[-1] - t[0]), 1e-12)
        points.append(KineticPoint(
            speed=sign * speed, current=mean, standard_deviation=float(np.std(i)),
            actual_speed=float(slope), unsteadiness=float(np.max(np.abs(straight)) / way),
            samples=count))
    return points[0], points[1]


def merge_points(points: Iterable[KineticPoint]) -> list[KineticPoint]:
    """Average repeated speeds: the look-up table in ascending speed."""
    groups: dict[float, list[KineticPoint]] = {}
    for point in points:
        groups.setdefault(round(point.speed, 9), []).append(point)
    merged = []
    for speed in sorted(groups):
        group = groups[speed]
        weights = np.array([point.samples for point in group], dtype=float)
        means = np.array([point.current for point in group])
        mean = float(np.average(means, weights=weights))
        spread = np.array([point.standard_deviation for point in group])
        variance = float(np.average(spread ** 2 + (means - mean) ** 2, weights=weights))
        merged.append(KineticPoint(
            speed=speed, current=mean, standard_deviation=variance ** 0.5,
            actual_speed=float(np.average([p.actual_speed for p in group], weights=weights)),
            unsteadiness=max(point.unsteadiness for point in group), samples=int(weights.sum())))
    return merged
