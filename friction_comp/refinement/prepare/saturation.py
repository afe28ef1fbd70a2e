# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A current signal that ends before the current does, below the noise of what reads it."""

from __future__ import annotations

import numpy as np

from friction_comp.model.plain_drive import plain_drive_columns
from friction_comp.refinement.fit.robust_regression import robust_scale, solve
from friction_comp.refinement.thresholds import ASKS_FOR_MORE, FEWEST_AT_END, FOLLOWS
from friction_comp.samples import Samples

# Standard deviations of the noise: half the width of the heap that a ceiling makes of all that is
# above it, and how much what the motion asks for has to vary there.
_HEAP, _VARIES = 4.0, 3.0
# How many times as high the heap has to be as what is below it.
_HIGH = 1.5
# Of the columns of a plain drive.
_ACCELERATION = 3


def saturated(samples: Samples, clipped: np.ndarray) -> np.ndarray:
    """Return which samples sit at an end of the current signal though motion asks for more, (N,).

    A sensor with noise has no value that it repeats when it saturates. What is seen instead is a
    heap of values, as wide as the noise, at an end of the range, in which the current no longer
    follows what speed, acceleration and position ask for elsewhere. Constant speed makes a heap
    too, but asks for one current there.

    Parameters
    ----------
    samples : Samples
        With velocity and acceleration.
    clipped : ndarray of bool, shape (N,)
        Samples that are known to be at the limit.
    """
    mark = np.zeros(len(samples), dtype=bool)
    noise = _noise(samples)
    if not noise > 0.0:
        return mark
    columns = _asked_for(samples)
    for side in (1.0, -1.0):
        value = side * samples.current
        top = float(value[~clipped].max(initial=-np.inf))
        if not np.isfinite(top):
            continue
        level = float(np.median(value[value > top - 2.0 * _HEAP * noise]))
        heap = np.abs(value - level) < _HEAP * noise
        below = (value <= level - _HEAP * noise) & (value > level - 3.0 * _HEAP * noise)
        if heap.sum() < max(30, FEWEST_AT_END * len(value)) or heap.sum() < _HIGH * below.sum():
            continue
        others = ~heap & ~clipped
        if others.sum() < 10 * columns.shape[1]:
            continue
        gains = solve(columns[others], value[others], np.ones(int(others.sum())))
        wanted = columns[heap] @ gains
        # Friction alone may well be the same at all speeds; what inertia asks for is never flat.
        inertia = gains[_ACCELERATION] * columns[heap, _ACCELERATION]
        if (min(np.std(wanted), np.std(inertia)) < _VARIES * noise
                or np.mean(wanted > level + _VARIES * noise) < ASKS_FOR_MORE):
            continue
        wanted = wanted - wanted.mean()
        if float(wanted @ value[heap]) < FOLLOWS * float(wanted @ wanted):
            mark |= value > level - 0.5 * _HEAP * noise
    return mark


def _noise(samples: Samples) -> float:
    second = np.diff(samples.current, n=2)
    return robust_scale(second[np.abs(second) > 0.0]) / np.sqrt(6.0) if np.any(second) else 0.0


def _asked_for(samples: Samples) -> np.ndarray:
    """Return the columns of a plain drive with gravity and load, shape (N, M)."""
    velocity, acceleration = np.asarray(samples.velocity), np.asarray(samples.acceleration)
    # A coarse encoder stands still most of the time.
    moving = np.abs(velocity[velocity != 0.0])
    top = float(np.percentile(moving, 95)) if len(moving) else 1.0
    # Friction may differ between the directions, so that one of them asks for less.
    parts = [plain_drive_columns(velocity, acceleration, 0.03 * top), np.abs(velocity),
             np.cos(samples.position), np.sin(samples.position)]
    if samples.load is not None:
        parts.append(samples.load)
    return np.column_stack(parts)
