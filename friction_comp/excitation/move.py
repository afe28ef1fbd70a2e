# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Motion from rest to rest with constant speed between, within limits by construction.

Speed rises from zero along a quintic, stays, and falls along the same quintic: acceleration and
jerk are continuous, position never overshoots, and the largest acceleration is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

# Steepest slope of u³(10 - 15u + 6u²), the profile with which speed rises.
_STEEPEST = 1.875
# Shortest time in which speed rises, s: it limits jerk, in short moves too.
_SHORTEST = 0.1


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
