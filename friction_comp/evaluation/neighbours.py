# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Least squares over repetitions that resemble their neighbours, as those of a person do.

Repetitions are no independent draws: a person tires, and is for a while stronger or weaker. How
alike neighbours are a few repetitions cannot tell, so every correlation counts by its likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from friction_comp.statistics import student_quantile

# Correlations of neighbouring repetitions, and how likely they are before any was seen: strong ones
# are rare.
_CORRELATIONS = np.arange(0.0, 0.95, 0.1)
_PRIOR = (1.0 - _CORRELATIONS) ** 1.5
# Share of the values' RMS below which their scatter is rounding.
_ROUNDING = 1e-9
NOTHING = 1e-100
"""A square that counts where values do not scatter at all, as those of a dead sensor."""


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval, None where it is not known."""

    mean: float
    low: float | None
    high: float | None
    count: int

    @classmethod
    def around(cls, mean: float, half: float, count: int) -> Interval:
        """Return the interval with half of its width given."""
        return cls(mean, mean - half, mean + half, count)

    @property
    def half(self) -> float | None:
        """Half the width of the interval."""
        return None if self.low is None or self.high is None else 0.5 * (self.high - self.low)

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the entry of report.json."""
        return asdict(self)


def mean_interval(values: Sequence[float], order: Sequence[float] | None = None) -> Interval:
    """Return the mean of one or more values with its interval.

    `order` are the values' places in time, ascending; they follow each other without it.
    """
    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Interval(mean, None, None, count)
    place = np.arange(count) if order is None else np.asarray(order)
    error = first_coefficient(np.asarray(values), np.ones((count, 1)), place, np.ones(count))[1]
    return Interval.around(mean, float(student_quantile(count - 1)) * error, count)


def first_coefficient(values: np.ndarray, columns: np.ndarray, place: np.ndarray,
                      scatter: np.ndarray) -> tuple[float, float]:
    """Return the first coefficient of a least-squares fit and its standard error.

    `values` are of shape (N,), `columns` (N, P) with rank P < N. `place` (N,) are the values'
    places in time, ascending. Errors, in proportion to `scatter` (N,), are a process of first
    order, and the variance is its mean over all correlations, each by its restricted likelihood.
    """
    from scipy.linalg import solve_banded

    count, width = columns.shape
    weights = np.linalg.pinv(columns)[0]
    gaps = np.diff(place, prepend=-np.inf)
    even, even_columns = values / scatter, (columns.T / scatter).T
    least = count * (_ROUNDING * float(np.sqrt(np.mean(even ** 2)))) ** 2 + NOTHING
    likelihood, variance = [], []
    for correlation in _CORRELATIONS:
        # How alike a value is to the one before it.
        alike = correlation ** gaps
        scale = 1.0 / np.sqrt(1.0 - alike ** 2)
        white, columns_white = (_whitened(part, alike, scale) for part in (even, even_columns))
        triangle = np.linalg.qr(columns_white, 'r')
        fit = np.linalg.lstsq(columns_white, white, rcond=None)[0]
        square = max(float(np.sum((white - columns_white @ fit) ** 2)), least) / (count - width)
        bands = np.array([np.append(0.0, -(alike * scale)[1:]), scale])
        variance.append(square * float(np.sum(solve_banded((0, 1), bands, scatter * weights) ** 2)))
        likelihood.append(np.sum(np.log(scale)) - np.sum(np.log(np.abs(np.diag(triangle))))
                          - 0.5 * (count - width) * np.log(square))
    share = _PRIOR * np.exp(np.array(likelihood) - max(likelihood))
    return float(weights @ values), float(np.sqrt(np.average(variance, weights=share)))


def _whitened(values: Any, alike: np.ndarray, scale: np.ndarray) -> Any:
    """Return values, (N,) or (N, P), less what those before them tell, in equal scale."""
    before = np.concatenate((np.zeros_like(values[:1]), values[:-1]))
    return ((values.T - alike * before.T) * scale).T
