# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds the movements in a recording and their announced directions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from friction_comp.samples import Samples
from friction_comp.statistics import top_speed

# Share of the top speed above which the reference counts as moving, and as moving constantly.
_MOVING, _CONSTANT = 0.01, 0.95
# A measured velocity is noisy, and people overshoot.
_MOVING_MEASURED, _CONSTANT_MEASURED = 0.1, 0.75
_SMOOTHING = 0.05
_SHORTEST = 0.1
# Movements that cover less than this share of the longest are corrections, not repetitions.
_SHORTEST_TRAVEL = 0.3
# Least number of encoder steps of a movement, where there is no reference.
_LEAST_STEPS = 20
# Time by which a joint may start before the movement of the reference, s.
_EARLY = 0.5


@dataclass(frozen=True)
class Movement:
    """One movement of a recording; times in s on the recording's clock."""

    begin: float  # of the reference's (else the joint's) motion
    end: float
    constant_begin: float  # of the phase of constant velocity
    constant_end: float
    rest_begin: float  # of the standstill before the movement
    # End of the standstill after it: a lagging joint may start as late.
    rest_end: float
    sign: int  # +1 for the positive direction, -1 for the negative
    direction: int  # announced direction d at the beginning of the movement
    travel: float  # rad

    @property
    def earliest(self) -> float:
        """Time from which the joint may have started, which may be before the reference, s."""
        return max(self.begin - _EARLY, self.rest_begin)


def find_movements(samples: Samples) -> list[Movement]:
    """Return the movements of one recording in order of time: the reference's, else the joint's."""
    if len(samples) < 2:
        return []
    velocity = _reference_velocity(samples)
    moving, constant, shortest_travel = _MOVING, _CONSTANT, 0.0
    if velocity is None:
        velocity = _measured_velocity(samples)
        moving, constant = _MOVING_MEASURED, _CONSTANT_MEASURED
        shortest_travel = _LEAST_STEPS * samples.position_step
    top = top_speed(np.abs(velocity), 0.99)
    if not top > 0.0:
        return []
    time = samples.time
    # First index, end and distance of each run of motion in one direction.
    runs = [(start, stop, float(abs(np.sum(
        velocity[start:stop - 1] * np.diff(time[start:stop])))))
        for start, stop in _runs(np.sign(velocity) * (np.abs(velocity) > moving * top))
        if time[stop - 1] - time[start] >= _SHORTEST]
    longest = max((travel for *_, travel in runs), default=0.0)
    runs = [run for run in runs if run[2] >= max(_SHORTEST_TRAVEL * longest, shortest_travel)]
    rest_begins = [0, *(stop - 1 for _, stop, _ in runs)]
    rest_ends = [*(start for start, _, _ in runs[1:]), -1]
    movements = []
    for (start, stop, travel), rest_begin, rest_end in zip(runs, rest_begins, rest_ends):
        speed = np.abs(velocity[start:stop])
        fast = start + np.nonzero(speed >= constant * speed.max())[0]
        movements.append(Movement(
            begin=float(time[start]), end=float(time[stop - 1]),
            constant_begin=float(time[fast[0]]), constant_end=float(time[fast[-1]]),
            rest_begin=float(time[rest_begin]), rest_end=float(time[rest_end]),
            sign=int(np.sign(velocity[start])),
            direction=_announced_direction(samples, start, fast[0] + 1), travel=travel))
    return movements


def _reference_velocity(samples: Samples) -> np.ndarray | None:
    if samples.reference_velocity is not None:
        return samples.reference_velocity
    if samples.reference_position is None:
        return None
    return np.gradient(samples.reference_position, samples.time)


def _measured_velocity(samples: Samples) -> np.ndarray:
    """Return the velocity from a zero-phase moving average of position, rad/s, shape (N,)."""
    width = max(round(_SMOOTHING / max(samples.sample_time, 1e-6)), 1)
    kernel = np.ones(width) / width
    padded = np.pad(samples.position, width, mode='edge')
    smooth = np.convolve(np.convolve(padded, kernel, 'same'), kernel, 'same')[width:-width]
    return np.gradient(smooth, samples.time)


def _runs(values: np.ndarray) -> Iterator[tuple[int, int]]:
    edges = np.concatenate(([0], np.nonzero(np.diff(values))[0] + 1, [len(values)]))
    for start, stop in pairwise(edges):
        if values[start] != 0:
            yield int(start), int(stop)


def _announced_direction(samples: Samples, start: int, stop: int) -> int:
    if samples.direction is None:
        return 0
    counts = np.bincount(samples.direction[start:stop].astype(int) + 1, minlength=3)
    return int(np.argmax(counts)) - 1
