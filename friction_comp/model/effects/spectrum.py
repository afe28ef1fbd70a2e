# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Spectrum of a residual over position, in which ripple of unknown frequency shows."""

from __future__ import annotations

import math

import numpy as np

_BINS_A_PERIOD = 4
_MOST_BINS = 1 << 17
# Fewest waves over the range of position, to distinguish a wave from a slope.
FEWEST_PERIODS = 1.5


def highest_frequency(velocity: np.ndarray, sample_time: float, resolution: float) -> float:
    """Return the highest spatial frequency in rad/rad that a recording can show.

    Motion at the slowest quarter of the speeds, rad/s, takes three samples, each `sample_time` s,
    for a period, and a period four steps of the recorded position, rad; 0 where it has none.
    """
    slow = float(np.percentile(np.abs(velocity), 25))
    highest = 2.0 * math.pi / max(3.0 * slow * sample_time, 1e-12)
    return min(highest, 2.0 * math.pi / (4.0 * resolution)) if resolution > 0 else highest


def position_spectrum(position: np.ndarray, signal: np.ndarray, amplitude: np.ndarray,
                      highest: float, periods: float = FEWEST_PERIODS
                      ) -> tuple[np.ndarray, np.ndarray]:
    """Return the sum of squares that cos and sin over position explain, by spatial frequency.

    Parameters
    ----------
    position, signal, amplitude : ndarray, shape (N,)
        The signal is modelled as amplitude · (a·cos(kq) + b·sin(kq)).
    highest : float
        Largest k, rad/rad (periods a turn).
    periods : float
        Fewest periods that the range of position has to hold.

    Returns
    -------
    k, power : ndarray, shape (M,)
        Spatial frequencies in rad/rad, and the sum of squares that each would explain.
    """
    span = float(np.ptp(position))
    energy = float(amplitude @ amplitude)
    if not highest * span > 2.0 * math.pi * periods or energy <= 0.0:
        return np.empty(0), np.empty(0)
    bins = min(math.ceil(_BINS_A_PERIOD * highest * span / (2.0 * math.pi)) + 1, _MOST_BINS)
    width = span / bins
    index = np.minimum(((position - position.min()) / width).astype(np.int64), bins - 1)
    sums = np.bincount(index, amplitude * signal, minlength=bins)
    size = 1 << (4 * bins - 1).bit_length()
    k = 2.0 * math.pi * np.fft.rfftfreq(size, width)
    power = 2.0 * np.abs(np.fft.rfft(sums, size)) ** 2 / energy
    keep = (k >= 2.0 * math.pi * periods / span) & (k <= highest)
    return k[keep], power[keep]


def peaks(k: np.ndarray, power: np.ndarray, count: int, separation: float) -> list[float]:
    """Return the frequencies of the highest peaks, apart by at least a separation."""
    highest: list[float] = []
    for index in np.argsort(power)[::-1][:2000]:
        if all(abs(k[index] - other) > separation for other in highest):
            highest.append(float(k[index]))
            if len(highest) == count:
                break
    return highest
