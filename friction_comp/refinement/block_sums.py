# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Block sums: products of columns summed over blocks, which suffice for linear fits.

For each block k, only the sums ``X_kᵀX_k``, ``X_kᵀy_k``, ``y_kᵀy_k`` and the number of rows are
kept. Fits leave blocks out, or resample them, by weights.
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
    """Sums of products over K blocks. In its methods, `columns` are S indices of P columns."""

    gram: np.ndarray  # (K, P + 1, P + 1): sums of products of all columns, the target last
    rows: np.ndarray  # (K,): number of rows in each block
    signs: np.ndarray  # (P,): 1 where a coefficient must not be negative, 0 where it is free

    @classmethod
    def over(cls, full: np.ndarray, parts: Sequence[np.ndarray | slice], signs: np.ndarray
             ) -> BlockSums:
        """Return the sums of columns and, last, a target, shape (P + 1, R), over parts of rows."""
        blocks = [full[:, rows] for rows in parts]
        return cls(np.array([own @ own.T for own in blocks]),
                   np.array([own.shape[1] for own in blocks]), signs)

    def held_out_errors(self, columns: Sequence[int], fold: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of each block by the fit to all blocks of other folds.

        Blocks of the same `fold`, shape (K,), are left out together; each by itself when omitted.
        """
        fold_of_block = np.arange(len(self.rows)) if fold is None else fold
        train = fold_of_block != np.arange(int(fold_of_block.max()) + 1)[:, None]
        return self.squared_errors(columns, self.fits(columns, train.astype(float))[fold_of_block])

    def squared_errors(self, columns: Sequence[int], coefficients: np.ndarray,
                       blocks: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of each block, (K,), by its own coefficients, shape (K, S).

        Only of some `blocks`, by their indices, where given.
        """
        inner = np.append(np.asarray(columns, dtype=int), self.gram.shape[1] - 1)
        combination = np.concatenate((coefficients, np.full((len(coefficients), 1), -1.0)), axis=1)
        gram = self.gram[:, inner[:, None], inner] if blocks is None else self.gram[
            blocks[:, None, None], inner[:, None], inner]
        return np.asarray((combination[:, None] @ gram @ combination[:, :, None])[:, 0, 0])

    def fits(self, columns: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """Return the coefficients, shape (F, S), of fits to blocks with weights, shape (F, K)."""
        inner = np.append(np.asarray(columns, dtype=int), self.gram.shape[1] - 1)
        mixed = np.tensordot(weights, self.gram[:, inner[:, None], inner], 1)
        return solve(mixed, self._norms(inner[:-1]), self.signs[inner[:-1]])

    def fit_mixed(self, columns: Sequence[int], mixed: np.ndarray) -> np.ndarray:
        """Return the coefficients, shape (S,), of a fit to the sums of all columns over blocks."""
        inner = np.append(np.asarray(columns, dtype=int), self.gram.shape[1] - 1)
        return solve(mixed[None, inner[:, None], inner], self._norms(inner[:-1]),
                     self.signs[inner[:-1]])[0]

    def fit(self, columns: Sequence[int]) -> np.ndarray:
        """Return the coefficients fitted to all blocks, shape (S,)."""
        return self.fits(columns, np.ones((1, len(self.rows))))[0]

    def independent_share(self, columns: Sequence[int]) -> np.ndarray:
        """Return the share of each column's norm that is independent of the others, shape (S,)."""
        norms = self._norms(np.asarray(columns, dtype=int))
        scaled = self.gram.sum(axis=0)[np.ix_(columns, columns)] / norms / norms[:, None]
        scaled[np.diag_indices(len(scaled))] += 1e-12
        return np.asarray(1.0 / np.sqrt(np.abs(np.diag(np.linalg.inv(scaled)))))

    def beside(self, columns: Sequence[int], others: Sequence[int]) -> np.ndarray:
        """Return the sums of products of what columns have beside others, shape (S, S)."""
        inner = [*others, *columns]
        norms, size = self._norms(np.asarray(inner, dtype=int)), len(others)
        sums = self.gram.sum(axis=0)[np.ix_(inner, inner)] / norms / norms[:, None]
        sums[np.diag_indices(len(sums))] += _RIDGE
        own = sums[size:, size:] - sums[size:, :size] @ np.linalg.solve(
            sums[:size, :size], sums[:size, size:])
        return np.asarray(own * norms[size:] * norms[size:, None])

    def _norms(self, columns: np.ndarray) -> np.ndarray:
        """Return the root of each column's sum of squares over all blocks."""
        norms = np.sqrt(self.gram[:, columns, columns].sum(axis=0))
        return np.where(norms > 0.0, norms, 1.0)


def sums_of(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> BlockSums:
    """Return the block sums of columns, shape (R, P), and a target, with consecutive blocks."""
    edges = np.searchsorted(block, np.arange(int(block.max()) + 2))
    return BlockSums.over(
        np.column_stack((columns, target)).T, [slice(*ends) for ends in zip(edges, edges[1:])],
        np.zeros(columns.shape[1], dtype=int))


def held_out_error(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> float:
    """Return the squared error of all blocks, each by least squares on the others."""
    return float(sums_of(columns, target, block).held_out_errors(range(columns.shape[1])).sum())


def solve(sums: np.ndarray, norms: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Solve least squares problems with bounds at zero; return the coefficients, shape (F, S).

    A coefficient with the wrong sign is set to zero, the worst first, and the others are solved
    for without it. `sums`, shape (F, S + 1, S + 1), are those of products of columns with these
    `norms` and required `signs`, shape (S,), the target last.
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
