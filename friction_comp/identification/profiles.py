# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movements of identification (note, Eq. 3-5), and the mean currents of a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

from numba import njit
import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import InputError

# Time in s at the beginning of a constant-velocity phase that is not used, and fewest samples of
# the rest for an average.
SETTLING, _FEWEST = 0.25, 6


@njit(cache=True)
def cycle_state(time: float, speed: float, cycle_time: float) -> tuple[float, float]:
    """Return reference position (rad) and velocity (rad/s) of Eq. 3; zero outside the cycle.

    The far end, at T/2, is 0.4·ω_c·T away (Eq. 4). The fifth phase begins at 0.9 T, where the note
    prints ``0.9 < t``.
    """
    share = time / cycle_time
    if share <= 0.0 or share >= 1.0:
        return 0.0, 0.0
    if share <= 0.1:
        moved, slope = 5.0 * share * share, 10.0 * share
    elif share <= 0.4:
        moved, slope = share - 0.05, 1.0
    elif share <= 0.6:
        since = share - 0.4
        moved, slope = 0.35 + since - 5.0 * since * since, 1.0 - 10.0 * since
    elif share <= 0.9:
        moved, slope = 0.95 - share, -1.0
    else:
        moved, slope = 5.0 * (1.0 - share) ** 2, -10.0 * (1.0 - share)
    return speed * cycle_time * moved, speed * slope


def travel_state(time: float, distance: float, duration: float) -> tuple[float, float]:
    """Return position (rad) and velocity (rad/s) of a quintic from rest to rest."""
    share = min(max(time / duration, 0.0), 1.0)
    position = distance * share ** 3 * (10.0 - 15.0 * share + 6.0 * share ** 2)
    return position, distance / duration * 30.0 * (share * (1.0 - share)) ** 2


def constant_velocity_windows(cycle_time: float, settling: float = 0.0
                              ) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the phases of Eq. 3 at +ω_c and -ω_c, s, without `settling`, or 60 % of each."""
    skipped = min(max(settling, 0.0), 0.18 * cycle_time)
    return ((0.1 * cycle_time + skipped, 0.4 * cycle_time),
            (0.6 * cycle_time + skipped, 0.9 * cycle_time))


def shortest_cycle(step: float) -> float:
    """Return the shortest cycle of Eq. 3, s, in which samples every `step`, s, suffice.

    A fifth more than needed, as they may come unevenly.
    """
    needed = 1.2 * _FEWEST * step
    # As in `constant_velocity_windows`: without `SETTLING`, or 60 % of the phase.
    return min(needed / 0.12, (needed + SETTLING) / 0.3)


class Sample(NamedTuple):
    """What a motion is told of its joint at a time: s, rad and A; current is NaN if unknown."""

    time: float
    position: float
    current: float


def sample_rows(samples: Sequence[Sample]) -> np.ndarray:
    """Return samples as rows of s, rad and A, shape (N, 3).

    Four to forty times as fast as ``np.array``, with which a control loop would be late after a
    motion of 20 s.
    """
    return np.fromiter(chain.from_iterable(samples), float, 3 * len(samples)).reshape(-1, 3)


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
    (N,). The small current that still accelerates the joint, by `acceleration_per_current`
    (k_t·n/J, rad/s² per A), is subtracted from the mean.

    Currents, speeds and positions are averaged with weights that vanish at both ends of a phase,
    s²·(1 - s)² of its share s. The second derivative of a fitted parabola is the mean acceleration
    with just these weights, so that a controller that still settles does not matter; and friction
    that varies over position averages out without a whole number of its periods. Raises InputError
    if a phase has too few samples.
    """
    time, position, current = (
        np.asarray(values, dtype=float) for values in (time, position, current))
    points = []
    for sign, (begin, end) in zip((1.0, -1.0), constant_velocity_windows(cycle_time, SETTLING)):
        chosen = (time >= begin) & (time <= end)
        if np.sum(chosen) < _FEWEST:
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
