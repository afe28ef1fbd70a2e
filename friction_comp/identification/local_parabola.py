# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Position, speed and acceleration from counted positions, by parabolas over short windows."""

from __future__ import annotations

import numpy as np


def local_parabolas(values: np.ndarray, count: int,
                    step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit a parabola about every sample (Savitzky and Golay, Analytical Chemistry 36(8), 1964).

    Parameters
    ----------
    values : ndarray, shape (N,)
        At even steps.
    count : int
        Samples to a parabola, odd.
    step : float
        s.

    Returns
    -------
    value, slope, bend : ndarray, shape (N - count + 1,)
        Of the parabola at its middle, the slope per s, the second derivative per s².
    """
    t = step * (np.arange(count) - count // 2)
    square = t ** 2
    second = float(np.sum(square))
    spread = count * float(np.sum(square ** 2)) - second ** 2

    def correlated(weights: np.ndarray) -> np.ndarray:
        return np.convolve(values, weights[::-1], 'valid')

    mean = correlated(np.full(count, 1.0 / count))
    bend = 2.0 * correlated((count * square - second) / spread)
    return mean - 0.5 * bend * second / count, correlated(t / second), bend
