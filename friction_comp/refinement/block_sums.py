# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Block sums, which suffice for linear fits, and the regimes of motion that are the blocks.

For each block k, only the sums ``X_kᵀX_k``, ``X_kᵀy_k``, ``y_kᵀy_k`` and the number of rows are
kept. Fits leave blocks out, or resample them, by weights. Blocks differ in motion, not in time: an
exercise that is repeated twenty times has twenty parts and one motion. Leaving out a part does not
tell what a model says of other motion; leaving out a regime does, and the more so the larger it is:
of a sixteenth, the neighbours in position and time are fitted.
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
    """Sums of products over K blocks. In its methods, `columns` are S of P columns."""

    gram: np.ndarray  # (K, P + 1, P + 1): sums of products of all columns, the target last
    rows: np.ndarray  # (K,): number of rows in each block
    signs: np.ndarray  # (P,): 1 where a coefficient must not be negative, 0 where it is free

    @classmethod
    def over(cls, full: np.ndarray, block: np.ndarray, signs: np.ndarray | None = None
             ) -> BlockSums:
        """Return the sums of columns and, last, a target, (P + 1, R), with a block for each row."""
        parts = [full[:, block == k] for k in range(int(block.max()) + 1)]
        return cls(np.array([own @ own.T for own in parts]),
                   np.array([own.shape[1] for own in parts]),
                   np.zeros(len(full) - 1, dtype=int) if signs is None else signs)

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

    def errors_by_size(self, columns: Sequence[int]) -> np.ndarray:
        """Return the squared error of each block where it is left out with others, (L, K).

        A half of the blocks is left out at a time, a quarter, and so on to each by itself.
        """
        count = len(self.rows)
        sizes = [2 ** level for level in range(1, max(count - 1, 1).bit_length() + 1)]
        return self._left_out(columns, [
            np.arange(count) * min(size, count) // count for size in sizes])

    def held_out_errors(self, columns: Sequence[int], fold: np.ndarray | None = None) -> np.ndarray:
        """Return the squared error of each block by the fit to all blocks of other folds.

        Blocks of the same `fold`, shape (K,), are left out together; each by itself when omitted.
        """
        return self._left_out(columns, [np.arange(len(self.rows)) if fold is None else fold])[0]

    def _left_out(self, columns: Sequence[int], folds: Sequence[np.ndarray]) -> np.ndarray:
        """Return the squared error of each block, (L, K), for several `folds`, each (K,)."""
        own, every = self.part(columns), [np.eye(int(fold.max()) + 1)[fold].T for fold in folds]
        fits = self.fits(columns, 1.0 - np.concatenate(every))
        first = np.cumsum([0, *map(len, every)])
        return np.array([squared_errors(own.gram, fits[start + fold])
                         for start, fold in zip(first, folds)])

    def fits(self, columns: Sequence[int], weights: np.ndarray) -> np.ndarray:
        """Return the coefficients, shape (F, S), of fits to blocks with weights, shape (F, K)."""
        own = self.part(columns)
        return solve(np.tensordot(weights, own.gram, 1), own.norms, own.signs)

    def fit(self, columns: Sequence[int]) -> np.ndarray:
        """Return the coefficients fitted to all blocks, shape (S,)."""
        return np.asarray(self.fits(columns, np.ones((1, len(self.rows))))[0])

    def fitted_error(self, columns: Sequence[int]) -> float:
        """Return the squared error of the fit to all blocks."""
        own = self.part(columns)
        return float(squared_errors(own.gram, self.fit(columns)[None]).sum())


def column_shares(scaled: np.ndarray) -> np.ndarray:
    """Return the share of each column that is independent of the others, by sums of norm one."""
    inverse = np.linalg.inv(scaled + 1e-12 * np.eye(len(scaled)))
    return np.asarray(1.0 / np.sqrt(np.abs(np.diag(inverse))))


def squared_errors(gram: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return the squared error of blocks, (K,), with coefficients of each, (K, S), or of all."""
    both = np.concatenate((coefficients, np.full((len(coefficients), 1), -1.0)), axis=1)
    errors = (both[:, None] @ gram @ both[:, :, None])[:, 0, 0]
    return np.asarray(np.maximum(errors, 0.0))


def held_out_error(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> float:
    """Return the squared error of a target, (R,), each block by least squares on the others."""
    sums = BlockSums.over(np.vstack((columns.T, target)), block)
    return float(sums.held_out_errors(range(columns.shape[1])).sum())


def solve(sums: np.ndarray, norms: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Solve least squares problems with bounds at zero; return the coefficients, shape (F, S).

    A coefficient with the wrong sign is set to zero, the worst first, and the others are solved
    for without it. `sums`, shape (F, S + 1, S + 1), are of columns with these `signs`; `norms`, of
    the columns over all blocks, scale them and the ridge.
    """
    size = len(norms)
    gram = sums[:, :-1, :-1] / norms / norms[:, None]
    target, result = sums[:, :-1, -1] / norms, np.zeros(sums.shape[:1] + (size,))
    unit, free = np.eye(size), np.ones(result.shape, dtype=bool)
    open_, bound = np.arange(len(sums)), signs > 0
    while len(open_):
        kept = free[open_]
        inner = gram[open_] * kept[:, None] * kept[:, :, None]
        inner += unit * np.where(kept, _RIDGE, 1.0)[:, None]
        x = np.linalg.solve(inner, (target[open_] * kept)[:, :, None])[:, :, 0]
        result[open_] = x
        wrong = np.where(bound & kept & (x < 0.0), x, 0.0)
        worst = np.argmin(wrong, axis=1)
        again = wrong[np.arange(len(open_)), worst] < 0.0
        free[open_[again], worst[again]] = False
        open_ = open_[again]
    return np.asarray(result / norms)


# Share of the largest variance of a feature that is about as much.
_AS_MUCH = 0.7
# Places in which a speed is compared with itself, and the scatter of one speed, of its mean.
_PLACES, _ONE_SPEED = 20, 0.1


def ranks(values: np.ndarray) -> np.ndarray:
    """Return the share 0..1 of values that are smaller than each, shape (R,)."""
    ordered = np.sort(values)
    return (np.searchsorted(ordered, values) + np.searchsorted(ordered, values, side='right')
            ) / (2.0 * len(values))


def regimes_of(features: Sequence[np.ndarray], count: int) -> np.ndarray:
    """Return the regime of each row, shape (R,), 0..count - 1, by features, each (R,).

    The rows are halved again and again, along the feature that varies most in the part; of those
    that vary about as much, the first. Neighbouring regimes make up a quarter, or a half.
    """
    scaled = np.array([ranks(values) for values in features if np.ptp(values) > 0.0])
    regime = np.zeros(scaled.shape[1], dtype=int)
    parts, own = [np.arange(scaled.shape[1])], 1
    while own < count:
        halves = []
        for rows in parts:
            spread = np.var(scaled[:, rows], axis=1)
            widest = int(np.argmax(spread > _AS_MUCH * spread.max()))
            order = rows[np.argsort(scaled[widest, rows], kind='stable')]
            halves += [np.sort(order[:len(order) // 2]), np.sort(order[len(order) // 2:])]
        parts, own = halves, 2 * own
    for k, rows in enumerate(parts):
        regime[rows] = k
    return regime


def rank_correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Return the absolute rank correlation of two signals, (R,); 0 if one is constant."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    return abs(float(np.corrcoef(ranks(first), ranks(second))[0, 1]))


def repeats(position: np.ndarray, velocity: np.ndarray) -> float:
    """Return the share of the speed's variance that place and direction tell, 0..1.

    It is near one in a motion that is repeated again and again, whose regimes are hardly different
    motions. At one speed there is no such share.
    """
    speed, width = np.abs(velocity), min(float(np.ptp(position)), 2.0 * np.pi) / _PLACES
    if not width > 0.0 or np.std(speed) < _ONE_SPEED * np.mean(speed):
        return 0.0
    place = ((position - position.min()) % (_PLACES * width) / width).astype(int)
    cell = 2 * place + (velocity > 0)
    mean = np.bincount(cell, speed) / np.maximum(np.bincount(cell), 1)
    return float(1.0 - np.var(speed - mean[cell]) / np.var(speed))
