# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes effect sizes with intervals, and the number of repetitions for a significant result."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from friction_comp.evaluation.compare import Comparison, SIGNIFICANT
from friction_comp.evaluation.intervals import CONFIDENCE, Interval

# The usual power of a trial: the probability that it finds a real difference.
POWER = 0.8
# Largest number of pairs that is considered.
_MOST = 1000


def effect_size(comparison: Comparison) -> Interval | None:
    """Return the mean difference in standard deviations of the differences, Cohen's d_z.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Interval or None
        With the large-sample 95 % interval of Hedges and Olkin (1985); None without scatter.
    """
    difference, count = comparison.difference, comparison.pairs
    if difference.low is None or difference.high is None or difference.high <= difference.low:
        return None
    half_interval = 0.5 * (difference.high - difference.low)
    std = half_interval * math.sqrt(count) / float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1))
    size = difference.mean / std
    half_width = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) * math.sqrt(
        1.0 / count + size ** 2 / (2.0 * count))
    return Interval(size, size - half_width, size + half_width, count)


def pairs_to_decide(comparison: Comparison, tests: int = 1) -> int | None:
    """Return how many pairs would show a difference of the observed size significantly.

    Computed from the power of the paired t test with 95.5 % of the pairs, the relative efficiency
    of Wilcoxon's test for normal differences, and at least so many that Wilcoxon's smallest
    p-value passes Holm's first step.

    Parameters
    ----------
    comparison : Comparison
    tests : int
        Number of comparisons of the same figure.

    Returns
    -------
    int or None
        None where the difference is zero, or where more than 1000 pairs would be needed.
    """
    size = effect_size(comparison)
    level = SIGNIFICANT / max(tests, 1)
    # The p-value of n differences of one sign is 2 · 2^-n.
    fewest = math.ceil(math.log2(2.0 / level))
    if size is None or not abs(size.mean) > 0.0:
        return fewest if size is None and comparison.difference.mean else None
    for count in range(max(fewest, 2), _MOST):
        noncentrality = abs(size.mean) * math.sqrt(0.955 * count)
        critical = float(stats.t.ppf(1.0 - 0.5 * level, count - 1))
        if float(np.nan_to_num(stats.nct.sf(critical, count - 1, noncentrality), nan=1.0)) >= POWER:
            return count
    return None
