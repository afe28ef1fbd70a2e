# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Means and shares with their confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy import stats

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval, None for a single value."""

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


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of one or more values with its interval from Student's t."""
    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Interval(mean, None, None, count)
    half = student_quantile(count - 1) * np.std(values, ddof=1) / np.sqrt(count)
    return Interval.around(mean, float(half), count)


def student_quantile(freedom: int) -> float:
    """Return Student's t for half the width of the interval in standard errors."""
    return float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, freedom))


def share_interval(hits: int, count: int) -> Interval:
    """Return the share of hits in `count` with Wilson's interval."""
    ends = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method='wilson')
    return Interval(hits / count, float(ends.low), float(ends.high), count)
