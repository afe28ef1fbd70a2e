# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Block sums: products of columns summed over blocks, all that a linear fit needs.

For each block k the sums ``X_kᵀX_k``, ``X_kᵀy_k``, ``y_kᵀy_k`` and the number of rows are kept, and
no sample. Sums of chunks, recordings, days or processes are added; a block is left out by
subtraction; blocks are resampled by weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Share of a column's sum of squares over all blocks; keeps the coefficients of collinear columns,
# and of those that are nearly zero in the fitted blocks, small.
_RIDGE = 1e-7


@dataclass
class BlockSums:
    """Sums of products over blocks.

    Parameters
    ----------
    gram : ndarray, shape (K, P + 1, P + 1)
        Sums of products of all columns, the target last.
    rows : ndarray, shape (K,)
        Number of rows in each block.
    signs : ndarray of int, shape (P,)
        1 where a coefficient must not be negative, 0 where it is free.
    """

    gram: np.ndarray
    rows: np.ndarray
    signs: np.ndarray

    @property
    def blocks(self) -> int:
        """Number of blocks K."""
        return len(self.rows)

    def __add__(self, other: BlockSums) -> BlockSums:
        """Return the sums with the blocks of both."""
        return BlockSums(np.concatenate((self.gram, other.gram)),
                         np.concatenate((self.rows, other.rows)), self.signs)

    def left_out(self, columns: Sequence[int], fold: np.ndarray | None = None,
                 weights: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of each block by the fit to all blocks of other folds.

        Parameters
        ----------
        columns : sequence of int, length S
        fold : ndarray of int, shape (K,), optional
            Blocks that are left out together; each by itself when omitted.
        weights : ndarray, shape (K,), optional
            Weights of the blocks in the fits.

        Returns
        -------
        ndarray, shape (K,)
        """
        fold_of_block = np.arange(self.blocks) if fold is None else fold
        train = (fold_of_block != np.arange(int(fold_of_block.max()) + 1)[:, None]).astype(float)
        if weights is not None:
            train = train * weights
        return self.squares(columns, self.fits(columns, train)[fold_of_block])

    def squares(self, columns: Sequence[int], coefficients: np.ndarray) -> np.ndarray:
        """Return the squared error of each block with its own coefficients, shape (K,).

        Parameters
        ----------
        columns : sequence of int, length S
        coefficients : ndarray, shape (K, S)
        """
        inner = np.append(np.asarray(columns, dtype=int), self.gram.shape[1] - 1)
        mix = np.concatenate((coefficients, np.full((len(coefficients), 1), -1.0)), axis=1)
        return np.asarray((mix[:, None] @ self.gram[:, inner[:, None], inner]
                           @ mix[:, :, None])[:, 0, 0])

    def fits(self, columns: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """Return the coefficients of fits to weighted blocks, shape (F, S).

        Parameters
        ----------
        columns : sequence of int, length S
        weights : ndarray, shape (F, K)
        """
        inner = np.append(np.asarray(columns, dtype=int), self.gram.shape[1] - 1)
        mixed = np.tensordot(weights, self.gram[:, inner[:, None], inner], 1)
        return solve(mixed, self._norms(inner[:-1]), self.signs[inner[:-1]])

    def _norms(self, columns: np.ndarray) -> np.ndarray:
        """Return the root of each column's sum of squares over all blocks."""
        norms = np.sqrt(self.gram[:, columns, columns].sum(axis=0))
        return np.where(norms > 0.0, norms, 1.0)

    def own_share(self, columns: Sequence[int]) -> np.ndarray:
        """Return the share of each column's norm that is independent of the others, shape (S,).

        Parameters
        ----------
        columns : sequence of int, length S
        """
        norms = self._norms(np.asarray(columns, dtype=int))
        scaled = self.gram.sum(axis=0)[np.ix_(columns, columns)] / norms / norms[:, None]
        scaled[np.diag_indices(len(scaled))] += 1e-12
        return np.asarray(1.0 / np.sqrt(np.abs(np.diag(np.linalg.inv(scaled)))))

    def fit(self, columns: Sequence[int]) -> np.ndarray:
        """Return the coefficients fitted to all blocks, shape (S,)."""
        return self.fits(columns, np.ones((1, self.blocks)))[0]


def solve(sums: np.ndarray, norms: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Solve several least squares problems with bounds at zero.

    A coefficient with the wrong sign is set to zero, the worst first, and the others are solved
    for without it.

    Parameters
    ----------
    sums : ndarray, shape (F, S + 1, S + 1)
        Sums of products of the columns, the target last.
    norms : ndarray, shape (S,)
        Norms of the columns.
    signs : ndarray of int, shape (S,)

    Returns
    -------
    ndarray, shape (F, S)
    """
    size = len(norms)
    scaled = sums[:, :-1, :-1] / norms[:, None] / norms
    scaled.reshape(len(sums), -1)[:, ::size + 1] += _RIDGE
    goal = sums[:, :-1, -1] / norms
    solution = np.linalg.solve(scaled, goal[:, :, None])[:, :, 0]
    bounded = np.nonzero(signs)[0]
    for case in np.nonzero((solution[:, bounded] < 0.0).any(axis=1))[0]:
        free = np.ones(size, dtype=bool)
        while True:
            values = np.where(free[bounded], solution[case, bounded], 0.0)
            if not (values < 0.0).any():
                break
            free[bounded[int(np.argmin(values))]] = False
            indices = np.nonzero(free)[0]
            solution[case] = 0.0
            solution[case, indices] = np.linalg.solve(
                scaled[case][indices[:, None], indices], goal[case, indices])
    return np.asarray(solution / norms)
