# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effect sizes with their intervals, and the repetitions that would decide."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from friction_comp.evaluation.compare import Comparison, SIGNIFICANT
from friction_comp.evaluation.intervals import CONFIDENCE, Interval

# The usual power of a trial: four of five trials of such a difference find it.
POWER = 0.8
# More pairs than this nobody records.
_MOST = 1000


def effect_size(comparison: Comparison) -> Interval | None:
    """Return the mean difference in standard deviations of the differences, Cohen's d_z.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    Interval or None
        Its 95 % interval is Hedges and Olkin's for large samples (1985); None where there is no
        scatter to compare with.
    """
    difference, count = comparison.difference, comparison.pairs
    if difference.low is None or difference.high is None or difference.high <= difference.low:
        return None
    half = 0.5 * (difference.high - difference.low)
    spread = half * math.sqrt(count) / float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, count - 1))
    size = difference.mean / spread
    reach = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) * math.sqrt(
        1.0 / count + size ** 2 / (2.0 * count))
    return Interval(size, size - reach, size + reach, count)


def pairs_to_decide(comparison: Comparison, tests: int = 1) -> int | None:
    """Return how many pairs would settle a difference as large as the one seen.

    By the power of the paired t test, which Wilcoxon's test reaches but for 5 % where the
    differences are normal; and so many that its smallest probability passes Holm's first step.

    Parameters
    ----------
    comparison : Comparison
    tests : int
        Number of comparisons of the same figure.

    Returns
    -------
    int or None
        None where the difference is beside its scatter so small that nobody would record it.
    """
    size = effect_size(comparison)
    level = SIGNIFICANT / max(tests, 1)
    # The probability of n differences of one sign is 2 · 2^-n.
    least = math.ceil(math.log2(2.0 / level))
    if size is None or not abs(size.mean) > 0.0:
        return least if size is None and comparison.difference.mean else None
    for count in range(max(least, 2), _MOST):
        away = abs(size.mean) * math.sqrt(0.955 * count)
        beyond = float(stats.t.ppf(1.0 - 0.5 * level, count - 1))
        if float(np.nan_to_num(stats.nct.sf(beyond, count - 1, away), nan=1.0)) >= POWER:
            return count
    return None
