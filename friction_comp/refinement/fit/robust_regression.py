# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Least squares with Huber's weights, and with the signs that physics asks of coefficients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dposv

from friction_comp.huber import HUBER

_RIDGE = 1e-9
# Rows that weigh less than one are looked at by themselves where they are at most one in so many.
_FEW = 3
# Of a column's square, so much has to be left by them: below, rounding would begin to count.
_LEFT = 1e-3


def robust_scale(residual: np.ndarray) -> float:
    """Return the standard deviation that the bulk of residuals suggests (1.4826 · MAD)."""
    return 1.4826 * float(np.median(np.abs(residual))) + 1e-15


def huber_loss(residual: np.ndarray, scale: float) -> np.ndarray:
    """Return Huber's loss in A², which is r² within `HUBER` · scale and linear beyond."""
    size, limit = np.abs(residual), HUBER * scale
    return np.where(size <= limit, size * size, limit * (2.0 * size - limit))


class LeastSquares:
    """A linear model of a current, solved for one set of weights after the other.

    Parameters
    ----------
    matrix : ndarray, shape (N, M)
        Fastest where each column lies together in memory, as `side_by_side` makes it; it is not
        copied then, and `exchange` changes it.
    current : ndarray, shape (N,)
    """

    def __init__(self, matrix: np.ndarray, current: np.ndarray) -> None:
        self._rows, self._current = np.ascontiguousarray(matrix.T), current
        self._unweighted: tuple[np.ndarray, np.ndarray] | None = None

    def left(self, coefficients: np.ndarray) -> np.ndarray:
        """Return what coefficients leave of the current, shape (N,)."""
        return np.asarray(self._current - coefficients @ self._rows)

    def exchange(self, place: int, columns: np.ndarray) -> None:
        """Take other columns, shape (N, L), for those from a place on."""
        own = slice(place, place + columns.shape[1])
        self._rows[own] = columns.T
        if self._unweighted is not None:
            gram, goal = self._unweighted
            gram[own] = self._rows[own] @ self._rows.T
            gram[:, own] = gram[own].T
            goal[own] = self._rows[own] @ self._current

    def solved(self, weights: np.ndarray, signs: Sequence[int] = ()) -> np.ndarray:
        """Return weighted least squares coefficients; columns that say the same share the work.

        Parameters
        ----------
        weights : ndarray, shape (N,)
        signs : sequence of int, length M, optional
            Sign that a coefficient must have, 1 or -1, 0 for either. One that would have the wrong
            sign is zero, the worst first, and the others are solved for without it.

        Returns
        -------
        ndarray, shape (M,)
        """
        gram, goal = self._normal(weights)
        power = np.diag(gram)
        if not (power < 1e200).all() or (power < 1e-200).any():
            # Out of all proportion, or never other than zero: such a column explains nothing.
            fine = np.isfinite(power) & (power < 1e200) & (power > 1e-200)
            gram, goal = _sums(np.where(fine[:, None], self._rows, 0.0), self._current, weights)
            power = np.where(fine, np.diag(gram), 1.0)
        norm = np.sqrt(power)
        gram = gram / norm / norm[:, None]
        gram.flat[::len(gram) + 1] += _RIDGE
        goal = goal / norm
        found = _solved(gram, goal)
        if len(signs):
            wanted, free = np.asarray(signs), np.ones(len(goal), dtype=bool)
            while np.any(wrong := free & (found * wanted < 0.0)):
                free[np.argmin(np.where(wrong, found * wanted, 0.0))] = False
                found = np.zeros(len(goal))
                found[free] = _solved(gram[np.ix_(free, free)], goal[free])
        return np.asarray(found / norm)

    def _normal(self, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the normal equations' matrix and right side for weights.

        Huber's weights are one but for a few rows: what these weigh less is taken from the sums in
        which all rows weigh one, unless they are nearly all there is of a column.
        """
        fewer = np.nonzero(weights != 1.0)[0]
        if not len(fewer):
            if self._unweighted is None:
                self._unweighted = _sums(self._rows, self._current)
            return self._unweighted
        if self._unweighted is None or _FEW * len(fewer) > len(weights):
            return _sums(self._rows, self._current, weights)
        gram, goal = self._unweighted
        less, lost = _sums(self._rows.take(fewer, axis=1), self._current[fewer],
                           1.0 - weights[fewer])
        with np.errstate(invalid='ignore'):
            left = gram - less
        if not (np.diag(left) > _LEFT * np.diag(gram)).all():
            return _sums(self._rows, self._current, weights)
        return left, goal - lost


def _sums(rows: np.ndarray, current: np.ndarray, weights: np.ndarray | None = None
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return the weighted sums of products of rows, (M, M), and of these with a current, (M,)."""
    with np.errstate(over='ignore', invalid='ignore'):
        if weights is None:
            return rows @ rows.T, rows @ current
        root = np.sqrt(weights)
        weighted = rows * root
        return weighted @ weighted.T, weighted @ (root * current)


def solve(matrix: np.ndarray, current: np.ndarray, weights: np.ndarray,
          signs: Sequence[int] = ()) -> np.ndarray:
    """Return weighted least squares coefficients, as `LeastSquares` solves for them once."""
    return LeastSquares(matrix, current).solved(weights, signs)


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
