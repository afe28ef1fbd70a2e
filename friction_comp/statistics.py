# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics that several rooms need and scipy does not offer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm(p_values: Sequence[float]) -> np.ndarray:
    """Return p-values adjusted for the number of tests by Holm's step-down method, shape (N,).

    Parameters
    ----------
    p_values : sequence of float, length N

    References
    ----------
    S. Holm, Scandinavian Journal of Statistics 6(2), 1979.
    """
    values = np.asarray(p_values, dtype=float)
    order = np.argsort(values, kind='stable')
    adjusted = np.empty(len(values))
    adjusted[order] = np.minimum(np.maximum.accumulate(
        values[order] * np.arange(len(values), 0, -1)), 1.0)
    return adjusted


def quantile_edges(values: np.ndarray, count: int, tails: Sequence[float] = ()) -> np.ndarray:
    """Return the inner edges of ranges that hold equally many values.

    Parameters
    ----------
    values : ndarray, shape (N,)
    count : int
        Of ranges.
    tails : sequence of float
        Shares at which either end is cut once more.

    Returns
    -------
    ndarray
        Ascending and without repetitions: fewer than ``count - 1`` where values stand often.
    """
    ends = np.array(tails, dtype=float)
    shares = np.concatenate((ends, np.linspace(0, 1, count + 1)[1:-1], 1.0 - ends))
    return np.unique(np.quantile(values, shares))
