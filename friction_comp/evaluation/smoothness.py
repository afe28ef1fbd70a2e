# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How smooth a movement is, from its velocity alone."""

from __future__ import annotations

import numpy as np

# Spectral arc length (Balasubramanian, Melendez-Calderon, Burdet 2012): Hz that count, share of
# the largest amplitude below which nothing does, and zero padding as a power of two.
_HIGHEST, _FAINTEST, _PADDING = 10.0, 0.05, 4


def spectral_arc_length(velocity: np.ndarray, sample_time: float) -> float:
    """Return how smooth a movement is: the spectral arc length of its speed, dimensionless.

    Parameters
    ----------
    velocity : ndarray
        rad/s, shape (N,).
    sample_time : float
        s.

    Returns
    -------
    float
        Negative; a single bell-shaped movement has about -1.4, each hesitation takes it down.
    """
    speed = np.abs(velocity)
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + _PADDING)
    amplitude = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, sample_time)
    if not amplitude.max() > 0:
        return float('nan')
    chosen = frequency <= _HIGHEST
    amplitude, frequency = amplitude[chosen] / amplitude.max(), frequency[chosen]
    last = int(np.nonzero(amplitude >= _FAINTEST)[0][-1]) + 1
    if last < 2:
        return float('nan')
    steps = np.diff(frequency[:last]) / (frequency[last - 1] - frequency[0])
    return float(-np.sum(np.hypot(steps, np.diff(amplitude[:last]))))


def log_dimensionless_jerk(velocity: np.ndarray, sample_time: float) -> float:
    """Return minus the logarithm of the jerk, made free of duration and speed.

    Parameters
    ----------
    velocity : ndarray
        rad/s, shape (N,).
    sample_time : float
        s.

    Returns
    -------
    float
        The larger, the smoother.
    """
    top, duration = float(np.abs(velocity).max()), len(velocity) * sample_time
    jerk = np.gradient(np.gradient(velocity, sample_time), sample_time)
    total = float(np.sum(jerk ** 2)) * sample_time
    return float(-np.log(duration ** 3 / top ** 2 * total)) if top > 0 < total else float('nan')
