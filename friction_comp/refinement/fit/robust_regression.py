# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Least squares with Huber's weights, and with the signs that physics asks of coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
    norm = np.sqrt(np.einsum('ij,ij->i', rows, rows) / max(rows.shape[1], 1))
    fine = np.isfinite(norm) & (norm > 1e-100)
    if not fine.all():
        # Out of all proportion, or never other than zero: such a column explains nothing.
        rows, norm = np.where(fine[:, None], rows, 0.0), np.where(fine, norm, 1.0)
    weighted = rows * np.sqrt(weights)
    gram = weighted @ weighted.T / np.outer(norm, norm)
    gram.flat[::len(gram) + 1] += _RIDGE * max(rows.shape[1], 1)
    goal = rows @ (weights * current) / norm
    found = np.linalg.lstsq(gram, goal, rcond=1e-12)[0]
    if len(signs):
        wanted, free = np.asarray(signs), np.ones(len(goal), dtype=bool)
        while np.any(wrong := free & (found * wanted < 0.0)):
            free[np.argmin(np.where(wrong, found * wanted, 0.0))] = False
            found = np.zeros(len(goal))
            found[free] = np.linalg.lstsq(gram[np.ix_(free, free)], goal[free], rcond=1e-12)[0]
    return found / norm


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
