# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Regimes of motion: blocks of a recording that differ in motion, not in time.

Parts of one recording share its motion: an exercise that is repeated twenty times has twenty parts
and one motion. Leaving out a part does not tell what a model says of other motion; leaving out a
regime does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

# Places in which a speed is compared with itself, and the scatter of one speed, of its mean.
_PLACES, _ONE_SPEED = 20, 0.1


def ranks(values: np.ndarray) -> np.ndarray:
    """Return the share 0..1 of values that are smaller than each, shape (R,)."""
    ordered = np.sort(values)
    return (np.searchsorted(ordered, values) + np.searchsorted(ordered, values, side='right')
            ) / (2.0 * len(values))


def regimes_of(features: Sequence[np.ndarray], count: int) -> np.ndarray:
    """Return the regime of each row, shape (R,), 0..count - 1, by features, each (R,).

    The rows are halved again and again, along the feature that varies most in the part.
    """
    scaled = np.array([ranks(values) for values in features if np.ptp(values) > 0.0])
    regime = np.zeros(scaled.shape[1], dtype=int)
    parts, own = [np.arange(scaled.shape[1])], 1
    while own < count:
        halves = []
        for rows in parts:
            widest = int(np.argmax(np.var(scaled[:, rows], axis=1)))
            order = rows[np.argsort(scaled[widest, rows], kind='stable')]
            halves += [np.sort(order[:len(order) // 2]), np.sort(order[len(order) // 2:])]
        parts, own = halves, 2 * own
    for k, rows in enumerate(parts):
        regime[rows] = k
    return regime


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the absolute rank correlation of two signals, (R,); 0 if one is constant."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return abs(float(np.corrcoef(ranks(first), ranks(second))[0, 1]))


def repeats(position: np.ndarray, velocity: np.ndarray) -> float:
    """Return the share of the speed's variance that place and direction tell, 0..1.

    It is near one in a motion that is repeated again and again, whose regimes are hardly different
    motions. At one speed there is no such share.
    """
    speed, width = np.abs(velocity), min(float(np.ptp(position)), 2.0 * np.pi) / _PLACES
    if not width > 0.0 or np.std(speed) < _ONE_SPEED * np.mean(speed):
        return 0.0
    place = ((position - position.min()) % (_PLACES * width) / width).astype(int)
    cell = 2 * place + (velocity > 0)
    mean = np.bincount(cell, speed) / np.maximum(np.bincount(cell), 1)
    return float(1.0 - np.var(speed - mean[cell]) / np.var(speed))
