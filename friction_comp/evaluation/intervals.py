# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Means and shares with their confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the entry of report.json."""
        return {'mean': self.mean, 'low': self.low, 'high': self.high, 'count': self.count}


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of one or more values with its interval from Student's t."""
    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Interval(mean, None, None, count)
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1)
                 * np.std(values, ddof=1) / np.sqrt(count))
    return Interval(mean, mean - half, mean + half, count)


def share_interval(hits: int, count: int) -> Interval:
    """Return the share of hits in `count` with Wilson's interval."""
    ends = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method='wilson')
    return Interval(hits / count, float(ends.low), float(ends.high), count)
