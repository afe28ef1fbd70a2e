# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Linear least absolute deviations, compiled, for the small problems inside the sigmoid's fit.

The method is the descent of Bloomfield and Steiger (SIAM J. Sci. Stat. Comput. 1, 1980): some
solution passes through as many points as there are coefficients; from such a solution, let one
of the points go, walk along the edge that opens to its lowest place (a weighted median), and
repeat until no edge leads down.
"""

from __future__ import annotations

from numba import njit
import numpy as np


@njit(cache=True)
def _invert(matrix: np.ndarray, inverse: np.ndarray) -> bool:
    """Gauss-Jordan with partial pivoting; false where the matrix is singular."""
    size = matrix.shape[0]
    work = matrix.copy()
    largest = 0.0
    for row in range(size):
        for column in range(size):
            inverse[row, column] = 1.0 if row == column else 0.0
            largest = max(largest, abs(work[row, column]))
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(work[row, column]) > abs(work[pivot, column]):
                pivot = row
        if abs(work[pivot, column]) <= 1e-12 * largest:
            return False
        if pivot != column:
            for k in range(size):
                work[column, k], work[pivot, k] = work[pivot, k], work[column, k]
                inverse[column, k], inverse[pivot, k] = inverse[pivot, k], inverse[column, k]
        factor = 1.0 / work[column, column]
        for k in range(size):
            work[column, k] *= factor
            inverse[column, k] *= factor
        for row in range(size):
            if row != column and work[row, column] != 0.0:
                factor = work[row, column]
                for k in range(size):
                    work[row, k] -= factor * work[column, k]
                    inverse[row, k] -= factor * inverse[column, k]
    return True


@njit(cache=True)
def independent_rows(design: np.ndarray, basis: np.ndarray) -> int:
    """Fill `basis` with rows that span the columns, spread by pivoting; return how many exist."""
    count, size = design.shape
    work = design.copy()
    for k in range(size):
        norm = 0.0
        for row in range(count):
            norm = max(norm, abs(work[row, k]))
        if norm == 0.0:
            return k
        for row in range(count):
            work[row, k] /= norm
    for step in range(size):
        best, best_norm = -1, 1e-14
        for row in range(count):
            norm = 0.0
            for k in range(size):
                norm += work[row, k] ** 2
            if norm > best_norm:
                best, best_norm = row, norm
        if best < 0:
            return step
        basis[step] = best
        chosen = work[best].copy()
        for row in range(count):
            dot = 0.0
            for k in range(size):
                dot += work[row, k] * chosen[k]
            dot /= best_norm
            for k in range(size):
                work[row, k] -= dot * chosen[k]
    return size


@njit(cache=True)
def least_absolute(design: np.ndarray, target: np.ndarray, basis: np.ndarray,
                   coefficients: np.ndarray) -> float:
    """Minimise ``Σ |target - design @ coefficients|``.

    Parameters
    ----------
    design : ndarray, shape (N, p)
    target : ndarray, shape (N,)
    basis : ndarray of int64, shape (p,)
        Rows to start from; replaced by the rows that the solution passes through.
    coefficients : ndarray, shape (p,)
        Filled with the solution.

    Returns
    -------
    float
        The smallest sum; infinite where the columns are not independent.
    """
    count, size = design.shape
    square = np.empty((size, size))
    inverse = np.empty((size, size))
    residual = np.empty(count)
    slope = np.empty(count)
    ratio = np.empty(count)
    for row in range(size):
        square[row] = design[basis[row]]
    if not _invert(square, inverse):
        if independent_rows(design, basis) < size:
            return np.inf
        for row in range(size):
            square[row] = design[basis[row]]
        if not _invert(square, inverse):
            return np.inf
    best_sum = np.inf
    for _ in range(20 * size + count):
        for k in range(size):
            value = 0.0
            for row in range(size):
                value += inverse[k, row] * target[basis[row]]
            coefficients[k] = value
        total = 0.0
        for i in range(count):
            value = target[i]
            for k in range(size):
                value -= design[i, k] * coefficients[k]
            residual[i] = value
        for row in range(size):
            residual[basis[row]] = 0.0
        for i in range(count):
            total += abs(residual[i])
        if total >= best_sum * (1.0 - 1e-13):
            return min(total, best_sum)
        best_sum = total

        leaving, entering, lowest = -1, -1, total * (1.0 - 1e-12)
        for row in range(size):
            # Slope of the sum at either side of the vertex says whether this edge leads down.
            pull, push = 0.0, 1.0
            for i in range(count):
                value = 0.0
                for k in range(size):
                    value += design[i, k] * inverse[k, row]
                slope[i] = value
            for j in range(size):
                slope[basis[j]] = 0.0
            for i in range(count):
                if residual[i] > 0.0:
                    pull += slope[i]
                elif residual[i] < 0.0:
                    pull -= slope[i]
                elif slope[i] != 0.0:
                    push += abs(slope[i])
            if abs(pull) <= push:
                continue
            sign = 1.0 if pull > 0.0 else -1.0
            crossed = 0
            for i in range(count):
                if sign * slope[i] * residual[i] > 0.0:
                    ratio[crossed] = residual[i] / slope[i] * sign
                    crossed += 1
            # Walk outwards until the slope turns: the weighted median.
            order = np.argsort(ratio[:crossed])
            descent = abs(pull) - push
            position = 0
            target_index = -1
            indices = np.empty(crossed, dtype=np.int64)
            crossed = 0
            for i in range(count):
                if sign * slope[i] * residual[i] > 0.0:
                    indices[crossed] = i
                    crossed += 1
            while position < crossed:
                i = indices[order[position]]
                descent -= 2.0 * abs(slope[i])
                target_index = i
                if descent <= 0.0:
                    break
                position += 1
            if target_index < 0:
                continue
            step = residual[target_index] / slope[target_index]
            reached = abs(step)
            for i in range(count):
                reached += abs(residual[i] - step * slope[i])
            if reached < lowest:
                lowest, leaving, entering = reached, row, target_index
        if leaving < 0:
            return best_sum
        basis[leaving] = entering
        square[leaving] = design[entering]
        if not _invert(square, inverse):
            return best_sum
    return best_sum
