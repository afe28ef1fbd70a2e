# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Small statistics of series of numbers that several rooms need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def lag1_autocorrelation(values: np.ndarray) -> float:
    """Return the share of variance that neighbours have in common, 0 for white noise.

    Parameters
    ----------
    values : ndarray, shape (N,)
        With a mean of zero.
    """
    power = float(values @ values)
    return float(values[1:] @ values[:-1]) / power if power > 0 else 0.0


def quantile_edges(values: np.ndarray, number: int, tails: Sequence[float] = ()) -> np.ndarray:
    """Return the inner edges of ranges that hold equally many values.

    Parameters
    ----------
    values : ndarray, shape (N,)
    number : int
        Of ranges.
    tails : sequence of float
        Shares at which either end is cut once more.

    Returns
    -------
    ndarray
        Ascending and without repetitions: fewer than ``number - 1`` where values stand often.
    """
    ends = np.array(tails, dtype=float)
    shares = np.concatenate((ends, np.linspace(0, 1, number + 1)[1:-1], 1.0 - ends))
    return np.unique(np.quantile(values, shares))
