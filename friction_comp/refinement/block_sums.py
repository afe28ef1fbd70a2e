# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Block sums: products of columns summed over blocks, which suffice for linear fits.

For each block k, only the sums ``X_kᵀX_k``, ``X_kᵀy_k``, ``y_kᵀy_k`` and the number of rows are
kept. Fits leave blocks out, or resample them, by weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from numba import njit
import numpy as np

from friction_comp.refinement import thresholds

# Share of a column's sum of squares over all blocks; keeps the coefficients of collinear columns,
# and of those that are nearly zero in the fitted blocks, small.
_RIDGE = 1e-7
# Columns whose own shares differ by less stand in for each other.
_ALIKE = 1.1


@dataclass
class BlockSums:
    """Sums of products over K blocks. In its methods, `columns` are S of P columns."""

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

    @property
    def norms(self) -> np.ndarray:
        """Root of each column's sum of squares over all blocks, 1 if that is zero, shape (P,)."""
        norms = np.sqrt(np.einsum('kii->i', self.gram)[:-1])
        return np.where(norms > 0.0, norms, 1.0)

    def scaled(self, ridge: float) -> np.ndarray:
        """Return the sums of products of all columns at norm one, with a ridge, shape (P, P)."""
        norms = self.norms
        return np.asarray(self.gram.sum(axis=0)[:-1, :-1] / norms / norms[:, None]
                          + ridge * np.eye(len(norms)))

    def part(self, columns: Sequence[int]) -> BlockSums:
        """Return the sums of some columns alone."""
        inner = np.array([*columns, -1])
        return BlockSums(self.gram[:, inner[:, None], inner], self.rows, self.signs[inner[:-1]])

    def merged(self, fold: np.ndarray) -> BlockSums:
        """Return the sums over all blocks of each fold, whose index each block has, shape (K,)."""
        own = fold == np.arange(int(fold.max()) + 1)[:, None]
        gram = np.tensordot(own.astype(float), self.gram, 1)
        return BlockSums(gram, np.bincount(fold, self.rows).astype(int), self.signs)

    def held_out_errors(self, columns: Sequence[int], fold: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of each block by the fit to all blocks of other folds.

        Blocks of the same `fold`, shape (K,), are left out together; each by itself when omitted.
        """
        own, every = self.part(columns), np.arange(len(self.rows))
        fold = every if fold is None else fold
        left_out = own if np.array_equal(fold, every) else own.merged(fold)
        fits = solve(own.gram.sum(axis=0) - left_out.gram, own.gram, own.signs)
        return _squared_errors(own.gram, fits[fold])

    def fits_without(self, columns: Sequence[int], train: np.ndarray) -> np.ndarray:
        """Return the coefficients of fits to some of the blocks, bool (F, K), shape (F, S).

        What these blocks do not determine, since a column hardly differs from zero or from others
        in them, stays as in the fit to all: noise would decide it. Of several, the last stays.
        """
        own = self.part(columns)
        sums, norms, whole = np.tensordot(train.astype(float), own.gram, 1), own.norms, None
        fits = solve(sums, own.gram, own.signs)
        for k, inner in enumerate(sums[:, :-1, :-1] / norms / norms[:, None]):
            free = np.arange(len(norms))
            while len(free) and (shares := column_shares(inner[np.ix_(free, free)])).min() < \
                    thresholds.OWN_SHARE:
                free = np.delete(free, np.flatnonzero(shares < _ALIKE * shares.min())[-1])
            if len(free) == len(norms):
                continue
            whole = self.fit(columns) if whole is None else whole
            held = np.where(np.isin(np.arange(len(norms)), free), 0.0, whole)
            # The current that remains for the free coefficients beside the held ones.
            rest = sums[k].copy()
            rest[-1, :-1] -= sums[k, :-1, :-1] @ held
            both = np.append(free, -1)
            fits[k] = held
            fits[k, free] = solve(rest[None, both[:, None], both], own.gram[:, both[:, None], both],
                                  own.signs[free])[0]
        return fits

    def errors_without(self, columns: Sequence[int], fold: np.ndarray) -> np.ndarray:
        """Return the squared error of each block by `fits_without` the blocks of its fold."""
        train = fold != np.arange(int(fold.max()) + 1)[:, None]
        return _squared_errors(self.part(columns).gram, self.fits_without(columns, train)[fold])

    def errors_of_fit(self, columns: Sequence[int], blocks: np.ndarray | slice = slice(None),
                      fitted: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of blocks by one fit to all, or to sums (P + 1, P + 1)."""
        own, inner = self.part(columns), np.array([*columns, -1])
        sums = own.gram.sum(axis=0) if fitted is None else fitted[inner[:, None], inner]
        return _squared_errors(own.gram[blocks], solve(sums[None], own.gram, own.signs))

    def squared_errors(self, columns: Sequence[int], coefficients: np.ndarray) -> np.ndarray:
        """Return the squared error of each block, (K,); all have coefficients (1, S), or own."""
        return _squared_errors(self.part(columns).gram, coefficients)

    def fits(self, columns: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """Return the coefficients, shape (F, S), of fits to blocks with weights, shape (F, K)."""
        own = self.part(columns)
        return solve(np.tensordot(weights, own.gram, 1), own.gram, own.signs)

    def fit(self, columns: Sequence[int]) -> np.ndarray:
        """Return the coefficients fitted to all blocks, shape (S,)."""
        own = self.part(columns)
        return solve(own.gram.sum(axis=0)[None], own.gram, own.signs)[0]

    def beside(self, columns: Sequence[int], others: Sequence[int]) -> np.ndarray:
        """Return the sums of products of what columns have beside others, shape (S, S)."""
        both, size = self.part([*others, *columns]), len(others)
        norms, sums = both.norms, both.scaled(_RIDGE)
        own = sums[size:, size:] - sums[size:, :size] @ np.linalg.solve(
            sums[:size, :size], sums[:size, size:])
        return np.asarray(own * norms[size:] * norms[size:, None])


def column_shares(scaled: np.ndarray) -> np.ndarray:
    """Return the share of each column that is independent of the others, by sums of norm one."""
    inverse = np.linalg.inv(scaled + 1e-12 * np.eye(len(scaled)))
    return np.asarray(1.0 / np.sqrt(np.abs(np.diag(inverse))))


def _squared_errors(gram: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    combination = np.concatenate((coefficients, np.full((len(coefficients), 1), -1.0)), axis=1)
    return np.asarray((combination[:, None] @ gram @ combination[:, :, None])[:, 0, 0])


def sums_of(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> BlockSums:
    """Return the block sums of columns, shape (R, P), and a target, with consecutive blocks."""
    edges = np.searchsorted(block, np.arange(int(block.max()) + 2))
    return BlockSums.over(
        np.vstack((columns.T, target)), [slice(*ends) for ends in zip(edges, edges[1:])],
        np.zeros(columns.shape[1], dtype=int))


def held_out_error(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> float:
    """Return the squared error of all blocks, each by least squares on the others."""
    return float(sums_of(columns, target, block).held_out_errors(range(columns.shape[1])).sum())


@njit(cache=True)
def solve(sums: np.ndarray, gram: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Solve least squares problems with bounds at zero; return the coefficients, shape (F, S).

    A coefficient with the wrong sign is set to zero, the worst first, and the others are solved
    for without it. `sums`, shape (F, S + 1, S + 1), of which the lower triangle is read, are of
    columns with these `signs`; `gram` gives the sums of squares over all blocks, of which the ridge
    is a share.
    """
    size = len(signs)
    result, scale = np.zeros((len(sums), size)), np.ones(size + 1)
    for i in range(size):
        square = np.sum(gram[:, i, i])
        scale[i] = 1.0 / math.sqrt(square) if square > 0.0 else 1.0
    for problem, x in zip(sums, result):
        kept, worst = scale.copy(), 0
        while worst >= 0:
            _solve_scaled(problem, kept, x)
            worst, least = -1, 0.0
            for i in range(size):
                if signs[i] > 0 and x[i] < least:
                    worst, least = i, x[i]
            if worst >= 0:
                kept[worst] = 0.0
        x *= scale[:-1]
    return result


@njit(cache=True)
def _solve_scaled(sums: np.ndarray, scale: np.ndarray, x: np.ndarray) -> None:
    """Write the coefficients of S columns times their `scale` into `x`, by Cholesky's method.

    `sums`, (S + 1, S + 1), are those of the columns and the target; a column of scale 0 gets 0.
    """
    size = len(x)
    lower = np.empty((size + 1, size))
    for i in range(size + 1):
        for j in range(min(i + 1, size)):
            rest = sums[i, j] * scale[i] * scale[j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            lower[i, j] = (rest / lower[j, j] if j < i else
                           math.sqrt(max(rest + _RIDGE, 1e-3 * _RIDGE)))
    for i in range(size - 1, -1, -1):
        x[i] = lower[size, i]
        for k in range(i + 1, size):
            x[i] -= lower[k, i] * x[k]
        x[i] /= lower[i, i]
