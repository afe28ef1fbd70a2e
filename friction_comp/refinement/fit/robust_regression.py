# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Least squares with Huber's weights, and with the signs that physics asks of coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dposv

from friction_comp.huber import HUBER

_RIDGE = 1e-9


def robust_scale(residual: np.ndarray) -> float:
    """Return the standard deviation that the bulk of residuals suggests (1.4826 · MAD)."""
    return 1.4826 * float(np.median(np.abs(residual))) + 1e-15


def huber_loss(residual: np.ndarray, scale: float) -> np.ndarray:
    """Return Huber's loss in A², which is r² within `HUBER` · scale and linear beyond."""
    size, limit = np.abs(residual), HUBER * scale
    return np.where(size <= limit, size * size, limit * (2.0 * size - limit))


def solve(matrix: np.ndarray, current: np.ndarray, weights: np.ndarray,
          signs: Sequence[int] = ()) -> np.ndarray:
    """Return weighted least squares coefficients; columns that say the same share the work.

    Parameters
    ----------
    matrix : ndarray, shape (N, M)
        Fastest where each column lies together in memory, as `side_by_side` makes it.
    current, weights : ndarray, shape (N,)
    signs : sequence of int, length M, optional
        Sign that a coefficient must have, 1 or -1, 0 for either. One that would have the wrong
        sign is zero, the worst first, and the others are solved for without it.

    Returns
    -------
    ndarray, shape (M,)
    """
    rows = np.ascontiguousarray(matrix.T)
    root = np.sqrt(weights)
    weighted = rows * root
    with np.errstate(over='ignore', invalid='ignore'):
        gram = weighted @ weighted.T
    power = np.diag(gram)
    if not (power < 1e200).all() or (power < 1e-200).any():
        # Out of all proportion, or never other than zero: such a column explains nothing.
        fine = np.isfinite(power) & (power < 1e200) & (power > 1e-200)
        weighted = np.where(fine[:, None], weighted, 0.0)
        gram = weighted @ weighted.T
        power = np.where(fine, np.diag(gram), 1.0)
    norm = np.sqrt(power)
    gram = gram / norm / norm[:, None]
    gram.flat[::len(gram) + 1] += _RIDGE
    goal = weighted @ (root * current) / norm
    found = _solved(gram, goal)
    if len(signs):
        wanted, free = np.asarray(signs), np.ones(len(goal), dtype=bool)
        while np.any(wrong := free & (found * wanted < 0.0)):
            free[np.argmin(np.where(wrong, found * wanted, 0.0))] = False
            found = np.zeros(len(goal))
            found[free] = _solved(gram[np.ix_(free, free)], goal[free])
    return np.asarray(found / norm)


def _solved(gram: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Return the solution of normal equations, whose ridge keeps them solvable."""
    _, found, failed = dposv(gram, goal)
    return np.linalg.lstsq(gram, goal, rcond=1e-12)[0] if failed else found


def side_by_side(parts: Sequence[np.ndarray], index: np.ndarray | None = None) -> np.ndarray:
    """Return matrices side by side, each column together in memory, or some of their rows.

    Parameters
    ----------
    parts : sequence of ndarray, shape (N, M_k)
    index : ndarray of int, shape (L,), optional
        Rows to take; all when omitted.

    Returns
    -------
    ndarray, shape (L, sum of M_k)
    """
    size = len(parts[0]) if index is None else len(index)
    rows = np.empty((sum(part.shape[1] for part in parts), size))
    place = 0
    for part in parts:
        for column in part.T:
            rows[place] = column if index is None else column[index]
            place += 1
    return rows.T
