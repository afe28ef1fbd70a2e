# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Measures of a movement's smoothness, from its velocity."""

from __future__ import annotations

import numpy as np

# Spectral arc length (Balasubramanian, Melendez-Calderon, Burdet 2012): highest frequency, Hz,
# amplitude threshold as a share of the largest, and zero padding as a power of two.
_HIGHEST, _FAINTEST, _PADDING = 10.0, 0.05, 4


def spectral_arc_length(velocity: np.ndarray, sample_time: float) -> float:
    """Return the spectral arc length of a movement's speed, dimensionless.

    It is about -1.4 for a single bell-shaped movement, and lower with each hesitation; NaN without
    motion. `velocity` is in rad/s, shape (N,).
    """
    speed = np.abs(velocity)
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + _PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, sample_time)
    if not amplitude.max() > 0:
        return float('nan')
    in_band = frequency <= _HIGHEST
    amplitude, frequency = amplitude[in_band] / amplitude.max(), frequency[in_band]
    last = int(np.nonzero(amplitude >= _FAINTEST)[0][-1]) + 1
    if last < 2:
        return float('nan')
    steps = np.diff(frequency[:last]) / (frequency[last - 1] - frequency[0])
    return float(-np.sum(np.hypot(steps, np.diff(amplitude[:last]))))


def log_dimensionless_jerk(velocity: np.ndarray, sample_time: float) -> float:
    """Return minus the logarithm of the dimensionless squared jerk, larger for smoother movements.

    NaN without motion.
    """
    top_speed, duration = float(np.abs(velocity).max()), len(velocity) * sample_time
    jerk = np.gradient(np.gradient(velocity, sample_time), sample_time)
    total = float(np.sum(jerk ** 2)) * sample_time
    if not top_speed > 0 < total:
        return float('nan')
    return float(-np.log(duration ** 3 / top_speed ** 2 * total))
