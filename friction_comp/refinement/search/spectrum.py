# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Spectrum of the residual over position: where ripple of unknown frequency shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene
    from friction_comp.samples import Samples

_FEWEST_PERIODS = 2.5
_BINS_A_PERIOD = 4
_MOST_BINS = 1 << 17


def highest_frequency(samples: Samples, usable: np.ndarray, scene: Scene, window: float) -> float:
    """Return the highest spatial frequency in rad/rad (periods a turn) that the data can show.

    Slow motion shows the finest ripple: the limit is where motion at the slowest quarter of the
    speeds takes three samples for a period, and four steps of the recorded position.
    """
    slow = float(np.percentile(np.abs(samples.velocity[usable]), 25))
    step = max(samples.sample_time, window)
    highest = 2.0 * math.pi / max(3.0 * slow * step, 1e-12)
    if scene.resolution > 0:
        highest = min(highest, 2.0 * math.pi / (4.0 * scene.resolution))
    return highest


def position_spectrum(position: np.ndarray, signal: np.ndarray, weight: np.ndarray, highest: float,
                      periods: float = _FEWEST_PERIODS) -> tuple[np.ndarray, np.ndarray]:
    """Return the power of a signal over position, as the fit of cos and sin would explain.

    Parameters
    ----------
    position, signal, weight : ndarray, shape (N,)
        The signal is modelled as weight · (a·cos(kq) + b·sin(kq)).
    highest : float
        Largest k.

    Returns
    -------
    k : ndarray, shape (M,)
        Spatial frequencies in rad/rad.
    power : ndarray, shape (M,)
        Sum of squares that each would explain, in units of signal².
    """
    span = float(np.ptp(position))
    if not span > 0 or not highest * span > 2.0 * math.pi * periods:
        return np.empty(0), np.empty(0)
    bins = min(math.ceil(_BINS_A_PERIOD * highest * span / (2.0 * math.pi)) + 1, _MOST_BINS)
    width = span / bins
    place = np.minimum(((position - position.min()) / width).astype(np.int64), bins - 1)
    sums = np.bincount(place, weight * signal, minlength=bins)
    size = 1 << (4 * bins - 1).bit_length()
    k = 2.0 * math.pi * np.fft.rfftfreq(size, width)
    energy = float(weight @ weight)
    if energy <= 0:
        return np.empty(0), np.empty(0)
    power = 2.0 * np.abs(np.fft.rfft(sums, size)) ** 2 / energy
    keep = (k >= 2.0 * math.pi * periods / span) & (k <= highest)
    return k[keep], power[keep]


def peaks(k: np.ndarray, power: np.ndarray, number: int, separation: float) -> list[float]:
    """Return the frequencies of the highest peaks, apart by at least a separation."""
    found: list[float] = []
    order = np.argsort(power)[::-1]
    for place in order[:2000]:
        if all(abs(k[place] - other) > separation for other in found):
            found.append(float(k[place]))
            if len(found) == number:
                break
    return found
