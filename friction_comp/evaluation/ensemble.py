# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Average and spread of many curves in the memory of one.

An hour of seven joints has thousands of movements, and weeks have hundreds of thousands: their
curves are summed up as they come, and none is kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

# s before a movement at which curves begin, and how far they go beyond its end, as a share of its
# duration.
LEAD, _BEYOND = 1.0, 0.25
# s between the points of all curves: every sample at 1 kHz, for a coarser curve may miss the peak;
# one and the same for slower recordings, so that curves of different ones can be added.
STEP = 1e-3
_LEAD_POINTS = round(LEAD / STEP)


def grid(duration: float) -> np.ndarray:
    """Return the s since its beginning at which a movement's curves have their points.

    Parameters
    ----------
    duration : float
        Of the movement, s.

    Returns
    -------
    ndarray, shape (N,)
    """
    return _times(round((1.0 + _BEYOND) * duration / STEP) + 1)


def _times(after: int) -> np.ndarray:
    return np.arange(-_LEAD_POINTS, after) * STEP


@dataclass
class Ensemble:
    """Curves of one or many movements, summed up point by point.

    Attributes
    ----------
    count : int
        Number of movements.
    sums : dict of str to ndarray
        By the curve's name, shape (3, N): at each point of `grid`, how many curves are known there,
        their sum, and the sum of their squares.
    """

    count: int = 0
    sums: dict[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, curves: Mapping[str, np.ndarray]) -> Ensemble:
        """Return the ensemble of one movement; its curves, shape (N,), are NaN where not known."""
        sums = {}
        for name, curve in curves.items():
            known = np.isfinite(curve)
            value = np.where(known, curve, 0.0)
            sums[name] = np.array([known, value, value ** 2])
        return cls(1, sums)

    def add(self, other: Ensemble) -> None:
        """Take in the movements of another ensemble."""
        self.count += other.count
        for name, theirs in other.sums.items():
            ours = self.sums.get(name, np.zeros((3, 0)))
            size = max(ours.shape[1], theirs.shape[1])
            self.sums[name] = _filled(ours, size) + _filled(theirs, size)

    def points(self, duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the times in s that all movements have, and which points of the curves they are.

        Parameters
        ----------
        duration : float
            s after which nothing more is shown.
        """
        time = _times(round(duration / STEP) + 1)
        known = self._at('position', np.arange(len(time)))[0]
        # An average over fewer would jump where one of them begins or ends.
        whole = known == self.count
        if not (whole & (time >= 0)).any():
            whole = known > 0
        chosen = np.nonzero(whole)[0]
        return time[chosen], chosen

    def mean_and_std(self, name: str, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a curve's average and standard deviation at some points; NaN where not known."""
        known, total, squares = self._at(name, points)
        with np.errstate(invalid='ignore', divide='ignore'):
            mean = np.where(known > 0, total / known, np.nan)
            spread = np.sqrt(np.maximum(squares - known * mean ** 2, 0.0)
                             / np.maximum(known - 1, 1))
        return mean, np.where(known > 0, spread, np.nan)

    def rms(self, name: str, points: np.ndarray) -> float:
        """Return a curve's root mean square over all movements; NaN where it is not known."""
        known, _, squares = self._at(name, points).sum(axis=1)
        return float(np.sqrt(squares / known)) if known else float('nan')

    def known_by_all(self, name: str, points: np.ndarray) -> bool:
        """Return whether every movement has a curve at some points."""
        return bool((self._at(name, points)[0] == self.count).all())

    def _at(self, name: str, points: np.ndarray) -> np.ndarray:
        size = int(points.max(initial=-1)) + 1
        return _filled(self.sums.get(name, np.zeros((3, 0))), size)[:, points]


def _filled(sums: np.ndarray, size: int) -> np.ndarray:
    """Return sums of at least that many points."""
    missing = size - sums.shape[1]
    return np.pad(sums, ((0, 0), (0, missing))) if missing > 0 else sums
