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
        _clear_column(work, inverse, column, pivot)
    return True


@njit(cache=True)
def _clear_column(work: np.ndarray, inverse: np.ndarray, column: int, pivot: int) -> None:
    """Turn a column into that of the unit matrix, the pivot's row first."""
    size = work.shape[0]
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
            norm = _dot(work[row], work[row])
            if norm > best_norm:
                best, best_norm = row, norm
        if best < 0:
            return step
        basis[step] = best
        chosen = work[best].copy()
        for row in range(count):
            dot = _dot(work[row], chosen) / best_norm
            for k in range(size):
                work[row, k] -= dot * chosen[k]
    return size


@njit(cache=True)
def _dot(first: np.ndarray, second: np.ndarray) -> float:
    total = 0.0
    for k in range(first.size):
        total += first[k] * second[k]
    return total


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
    inverse = np.empty((size, size))
    residual, slope = np.empty(count), np.empty(count)
    if not _invert(design[basis], inverse):
        if independent_rows(design, basis) < size or not _invert(design[basis], inverse):
            return np.inf
    best_sum = np.inf
    for _ in range(20 * size + count):
        total = _at_vertex(design, target, basis, inverse, coefficients, residual)
        if total >= best_sum * (1.0 - 1e-13):
            return min(total, best_sum)
        best_sum = total
        leaving, entering, lowest = -1, -1, total * (1.0 - 1e-12)
        for row in range(size):
            end, reached = _along_edge(design, basis, inverse, row, residual, slope)
            if reached < lowest:
                lowest, leaving, entering = reached, row, end
        if leaving < 0:
            return best_sum
        basis[leaving] = entering
        if not _invert(design[basis], inverse):
            return best_sum
    return best_sum


@njit(cache=True)
def _at_vertex(design: np.ndarray, target: np.ndarray, basis: np.ndarray, inverse: np.ndarray,
               coefficients: np.ndarray, residual: np.ndarray) -> float:
    """Fill coefficients and residuals of the solution through the basis; return the sum."""
    for k in range(basis.size):
        coefficients[k] = _dot(inverse[k], target[basis])
    for i in range(target.size):
        value = target[i]
        for k in range(basis.size):
            value -= design[i, k] * coefficients[k]
        residual[i] = value
    for row in range(basis.size):
        residual[basis[row]] = 0.0
    total = 0.0
    for i in range(target.size):
        total += abs(residual[i])
    return total


@njit(cache=True)
def _along_edge(design: np.ndarray, basis: np.ndarray, inverse: np.ndarray, row: int,
                residual: np.ndarray, slope: np.ndarray) -> tuple[int, float]:
    """Let go of one of the basis' points; return the point that ends the edge, and the sum there.

    The sum is infinite where the edge does not lead down.
    """
    for i in range(residual.size):
        slope[i] = _dot(design[i], inverse[:, row])
    for j in range(basis.size):
        slope[basis[j]] = 0.0
    # The slope of the sum at either side of the vertex says whether this edge leads down.
    pull, push = 0.0, 1.0
    for i in range(residual.size):
        if residual[i] > 0.0:
            pull += slope[i]
        elif residual[i] < 0.0:
            pull -= slope[i]
        else:
            push += abs(slope[i])
    if abs(pull) <= push:
        return -1, np.inf
    end = _lowest_point(residual, slope, 1.0 if pull > 0.0 else -1.0, abs(pull) - push)
    if end < 0:
        return -1, np.inf
    step = residual[end] / slope[end]
    reached = abs(step)
    for i in range(residual.size):
        reached += abs(residual[i] - step * slope[i])
    return end, reached


@njit(cache=True)
def _lowest_point(residual: np.ndarray, slope: np.ndarray, sign: float, descent: float) -> int:
    """Walk along an edge until the sum's slope turns, the weighted median; -1 where none does."""
    crossed = np.nonzero(sign * slope * residual > 0.0)[0]
    order = np.argsort(residual[crossed] / slope[crossed] * sign)
    end = -1
    for position in range(crossed.size):
        end = crossed[order[position]]
        descent -= 2.0 * abs(slope[end])
        if descent <= 0.0:
            break
    return end
