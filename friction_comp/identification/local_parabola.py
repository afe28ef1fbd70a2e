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
    from scipy.signal import savgol_filter

    inner = slice(count // 2, len(values) - count // 2)
    value, slope, bend = (
        savgol_filter(values, count, 2, deriv=order, delta=step)[inner] for order in range(3))
    return value, slope, bend
