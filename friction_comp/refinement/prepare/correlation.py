# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How long a residual remembers, and stretches that outlast it."""

from __future__ import annotations

import numpy as np

_MOST_STRETCHES = 400


def correlation_samples(residual: np.ndarray, usable: np.ndarray) -> int:
    """Return after how many samples the residual's autocorrelation has fallen below 0.2."""
    values = residual[usable]
    values = values - np.median(values)
    # A few large errors at reversals would else stand for all the rest.
    limit = 3.0 * 1.4826 * float(np.median(np.abs(values)))
    values = np.clip(values, -limit, limit)
    values = values - values.mean()
    size = len(values)
    padded = 1 << (2 * size - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(values, padded)) ** 2
    correlation = np.fft.irfft(spectrum)[:max(2, size // 10)]
    if correlation[0] <= 0:
        return 1
    below = np.nonzero(correlation < 0.2 * correlation[0])[0]
    return int(below[0]) if below.size else size // 10


def stretch_length(residual: np.ndarray, usable: np.ndarray) -> int:
    """Return how many samples a stretch holds that outlasts the residual's memory twice over."""
    size = int(usable.sum())
    length = max(2 * correlation_samples(residual, usable), size // _MOST_STRETCHES)
    return max(2, min(length, size // 20))


def stretches(residual: np.ndarray, usable: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Return the number of the stretch of each usable sample, shape (M,).

    Stretches are twice as long as the residual remembers, and none reaches over a gap, so that
    the order in which runs stand makes no difference.

    Parameters
    ----------
    residual : ndarray, shape (N,)
    usable : ndarray of bool, shape (N,)
        M of which are True.
    run : ndarray of int, shape (N,)
    """
    size, length = int(usable.sum()), stretch_length(residual, usable)
    own = run[usable]
    new = np.diff(own, prepend=own[:1] - 1) != 0
    first = np.maximum.accumulate(np.where(new, np.arange(size), 0))
    pieces = np.bincount(np.cumsum(new) - 1)
    inside = np.minimum((np.arange(size) - first) // length,
                        np.maximum(np.repeat(pieces, pieces) // length, 1) - 1)
    change = new | (np.diff(inside, prepend=inside[:1]) != 0)
    return np.cumsum(change) - 1
