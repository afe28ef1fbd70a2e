# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One current ramp of an identification: its samples, and the stops that a ramp may make."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

STOP_TIME = 0.16
"""s that a ramp with stops waits at each."""

# The joint is still moving at a stop if, in the last third of it, it moves at this share of the
# speed of the second third, by this many counts and by this share of the distance since the ramp
# began. A joint on its presliding comes to rest.
_SPEED_SHARE, _COUNTS, _WAY_SHARE = 0.5, 2.0, 0.08


class Sample(NamedTuple):
    """A sample for the script: s, rad and A, the last NaN where unknown."""

    time: float
    position: float
    current: float


class Ramp(NamedTuple):
    """One current ramp: `samples` are rows of `Sample`.

    `before` is the direction in which the joint slid last before it, 0 where that is not known;
    `stops` the currents in A at which it waited.
    """

    direction: int
    before: int
    samples: np.ndarray
    stops: tuple[float, ...] = ()


def speed_over(samples: Sequence[Sample], sign: int, window: float) -> float:
    """Speed in the direction `sign` over the last `window` seconds; 0 while they are too few."""
    last = samples[-1]
    for k in range(len(samples) - 2, -1, -1):
        elapsed = last.time - samples[k].time
        if elapsed >= 0.999 * window:
            return sign * (last.position - samples[k].position) / elapsed
    return 0.0


def time_of_ramp(elapsed: float, slope: float, stops: Sequence[float]) -> float:
    """Return the time on the ramp of Eq. 8 in s, after waiting at each of the stops, A."""
    late = 0.0
    for level in stops:
        reached = level / slope + late
        if elapsed <= reached:
            break
        if elapsed <= reached + STOP_TIME:
            return level / slope
        late += STOP_TIME
    return elapsed - late


def moving_level(ramp: Ramp, slope: float, resolution: float) -> float | None:
    """Return the current in A at which the joint keeps moving although the current is held.

    The first stop at which it does not come to rest; None where it does at each.
    """
    time, position = ramp.samples[:, 0] - ramp.samples[0, 0], ramp.samples[:, 1]
    way = ramp.direction * (position - position[0])
    for k, level in enumerate(ramp.stops):
        begin = level / slope + k * STOP_TIME
        if time[-1] < begin + STOP_TIME:
            return level   # It ran away at this stop, or on the way to it.
        a, b, c = np.interp(begin + STOP_TIME * np.array([1.0, 2.0, 3.0]) / 3.0, time, way)
        if c - b > max(_SPEED_SHARE * (b - a), _COUNTS * resolution, _WAY_SHARE * c):
            return level
    return None
