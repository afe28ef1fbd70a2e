# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics that several rooms need; SciPy, which takes long to import, only where it is asked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

CONFIDENCE = 0.95
"""Degree of confidence of all intervals."""


def student_quantile(freedom: Any) -> Any:
    """Return half the width of an interval in standard errors, by its degrees of freedom.

    `freedom` is one number or many; the result has its shape.
    """
    from scipy.special import stdtrit

    return stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE)


def rms(values: np.ndarray) -> float:
    """Return the root mean square; NaN of an empty array."""
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else np.nan


def median(values: np.ndarray) -> float:
    """Return the median of values, (N,) with N of at least 1.

    The first call of numpy.median imports numpy.ma, which takes as long as a short program.
    """
    half = len(values) // 2
    ordered = np.partition(values, [half - 1 + len(values) % 2, half])
    return 0.5 * float(ordered[half - 1 + len(values) % 2] + ordered[half])


def robust_std(values: np.ndarray, axis: int | None = None) -> Any:
    """Return the standard deviation about zero, estimated from the median of the magnitudes."""
    return 1.4826 * np.median(np.abs(values), axis=axis)


def noise_level(values: np.ndarray) -> float:
    """Return the standard deviation of white noise on a slow signal, shape (N,)."""
    # The median step between neighbours is 0.954 standard deviations.
    return float(np.median(np.abs(np.diff(values)))) / 0.954


def gap_length(steps: np.ndarray) -> float:
    """Return the time in s above which one of these time steps, shape (N,), counts as a gap.

    It is longer than five usual steps and than 20 ms. Steps of 0, of samples that were sent again,
    say nothing of the usual one.
    """
    steps = steps[steps > 0.0]
    return max(5.0 * median(steps), 0.02) if len(steps) else 0.02


def smallest_step(values: np.ndarray) -> float:
    """Return the smallest change between neighbours, usually one encoder count; 0 without any."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12]
    return float(np.min(steps)) if steps.size else 0.0


def top_speed(speed: np.ndarray, share: float = 0.95) -> float:
    """Return the quantile `share` of the speed, 0 without motion.

    `speed` has magnitudes at equal distances in time, shape (N,). If the joint mostly rests, the
    quantile is one of rests: the result is at least half of the speed at which the middle of the
    path was travelled.
    """
    ordered = np.sort(speed)
    path = np.cumsum(ordered)
    if not path.size or not path[-1] > 0.0:
        return 0.0
    middle = ordered[np.searchsorted(path, 0.5 * path[-1])]
    return float(max(np.quantile(ordered, share), 0.5 * middle))


def evenly_spread(index: Any) -> Any:
    """Return multiples `index` of the golden ratio, modulo 1: evenly spread, without a period."""
    return index * (0.5 * (math.sqrt(5.0) - 1.0)) % 1.0
