# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Mean and standard deviation of many curves in the memory of one.

An hour of seven joints has thousands of movements, and weeks have hundreds of thousands: their
curves are summed as they come, and none is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

# s that curves begin before a movement, and share of its duration that they go beyond its end.
LEAD, _BEYOND = 1.0, 0.25
# s between the points of all curves: at 1 kHz none misses the peak.
STEP = 1e-3
_LEAD_POINTS = round(LEAD / STEP)


def grid(duration: float) -> np.ndarray:
    """Return the times of a movement's curve points since its beginning, s, shape (N,)."""
    return _point_times(round((1.0 + _BEYOND) * duration / STEP) + 1)


def _point_times(stop: int) -> np.ndarray:
    """Return the times of the points before index `stop`; index 0 is the movement's beginning."""
    return np.arange(-_LEAD_POINTS, stop) * STEP


@dataclass
class Ensemble:
    """Curves of one or many movements, summed point by point."""

    count: int = 0  # of movements
    # Of each curve at the points of `grid`, (3, N): known values, their sum, the sum of their
    # squares.
    sums: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of_movement(cls, curves: Mapping[str, np.ndarray]) -> Ensemble:
        """Return the ensemble of one movement, whose curves (N,) are NaN where not known."""
        sums = {}
        for name, curve in curves.items():
            known = np.isfinite(curve)
            value = np.where(known, curve, 0.0)
            sums[name] = np.array([known, value, value ** 2])
        return cls(1, sums)

    def add(self, other: Ensemble) -> None:
        """Add the movements of another ensemble."""
        self.count += other.count
        for name, added in other.sums.items():
            present = self.sums.get(name, np.zeros((3, 0)))
            size = max(present.shape[1], added.shape[1])
            self.sums[name] = _padded(present, size) + _padded(added, size)

    def points(self, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the times up to `duration` that all movements cover, s, and their indices."""
        time = _point_times(round(duration / STEP) + 1)
        known = self._sums_at('position', np.arange(len(time)))[0]
        # A mean over fewer curves would jump where one of them begins or ends.
        complete = known == self.count
        if not (complete & (time >= 0)).any():
            complete = known > 0
        chosen = np.nonzero(complete)[0]
        return time[chosen], chosen

    def mean_and_std(self, name: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return mean and standard deviation over the movements at points, NaN where not known."""
        known, total, squares = self._sums_at(name, points)
        with np.errstate(invalid='ignore', divide='ignore'):
            mean = np.where(known > 0, total / known, np.nan)
            std = np.sqrt(np.maximum(squares - known * mean ** 2, 0.0) / np.maximum(known - 1, 1))
        return mean, np.where(known > 0, std, np.nan)

    def rms(self, name: str, points: np.ndarray) -> float:
        """Return the root mean square of a curve over all movements, NaN where not known."""
        known, _, squares = self._sums_at(name, points).sum(axis=1)
        return float(np.sqrt(squares / known)) if known else float('nan')

    def is_complete(self, name: str, points: np.ndarray) -> bool:
        """Return whether a curve is known at points for all movements."""
        return bool((self._sums_at(name, points)[0] == self.count).all())

    def _sums_at(self, name: str, points: np.ndarray) -> np.ndarray:
        """Return the rows of `sums` at points, zeros beyond the end of the curves."""
        size = int(points.max(initial=-1)) + 1
        return _padded(self.sums.get(name, np.zeros((3, 0))), size)[:, points]


def _padded(sums: np.ndarray, size: int) -> np.ndarray:
    missing = size - sums.shape[1]
    return np.pad(sums, ((0, 0), (0, missing))) if missing > 0 else sums
