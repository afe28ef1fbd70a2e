# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""When on a current ramp a joint stops creeping and begins to slide, from its position."""

from __future__ import annotations

import math

from numba import njit
import numpy as np

_SPEED_WINDOW = 0.03   # s over which the speed is taken
_POINTS = 160          # of the fit
_MISFIT = 0.13         # of the way slid, by which the fit may be wrong


# s before the run-away within which the slide began: a joint that slides reaches the run-away's
# speed within tenths of a second. Seen over longer, the bend of creep on soft contacts, which give
# ever more as the load comes near to breakaway, would pass for the slide.
_LONGEST_WINDOW = 0.6


@njit(cache=True)
def slide_begin(time: np.ndarray, position: np.ndarray, begin: int, end: int, sign: float,
                 resolution: float, runaway_speed: float) -> tuple[float, float]:
    """Return when the joint began to slide, NaN where it did not, and its rest time before."""
    still = 2.5 * resolution + 1e-12
    last = begin
    while last > 0 and abs(position[last - 1] - position[begin]) <= still:
        last -= 1
    rest = time[begin] - time[last]

    # The run-away: a speed that holds over the window, and goes on.
    tail, found = begin, -1
    for i in range(begin, end):
        while time[i] - time[tail] > _SPEED_WINDOW:
            tail += 1
        elapsed = time[i] - time[tail]
        if elapsed < 0.5 * _SPEED_WINDOW:
            continue
        way = sign * (position[i] - position[tail])
        if way > runaway_speed * elapsed and way > 4.0 * resolution:
            found = i
            break
    if found < 0:
        return np.nan, rest
    window, instant = _LONGEST_WINDOW, np.nan
    for _ in range(4):
        first = found
        while first > begin and time[found] - time[first] < window:
            first -= 1
        instant = _hinge(time, position, first, found, sign, resolution)
        window = min(max(4.0 * (time[found] - instant), 0.15), _LONGEST_WINDOW)
    return instant, rest


@njit(cache=True)
def _hinge(time: np.ndarray, position: np.ndarray, first: int, last: int, sign: float,
           resolution: float) -> float:
    """Least-squares instant at which creep turns into a slide.

    Creep is a parabola; the slide adds to it an acceleration and a growing one, no jump in speed,
    none of them backwards. No formula holds far into the slide, so the farther the joint has
    gone, the less a sample weighs.
    """
    count = min(_POINTS, last - first + 1)
    if count < 12:
        return time[first]
    t, x, weight = np.empty(count), np.empty(count), np.empty(count)
    span = time[last] - time[first]
    for k in range(count):
        i = first + (last - first) * k // (count - 1)
        t[k] = (time[i] - time[first]) / span
        x[k] = sign * (position[i] - position[first])
    early = max(6, int(0.4 * count))
    t_mean, x_mean = t[:early].mean(), x[:early].mean()
    away = t[:early] - t_mean
    speed = np.sum(away * (x[:early] - x_mean)) / np.sum(away ** 2)
    for k in range(count):
        gone = max(0.0, x[k] - x_mean - speed * (t[k] - t_mean))
        weight[k] = 1.0 / math.hypot(0.5 * resolution + 1e-12, _MISFIT * gone)
    best, instant = np.inf, 0.0
    low, high, steps = 0.02, 0.97, 40
    for _ in range(3):
        for k in range(steps + 1):
            knee = low + (high - low) * k / steps
            error = _hinge_error(t, x, weight, knee)
            if error < best:
                best, instant = error, knee
        width = (high - low) / steps
        low, high, steps = max(0.0, instant - width), min(0.97, instant + width), 12
    return time[first] + instant * span


@njit(cache=True)
def _hinge_error(t: np.ndarray, x: np.ndarray, weight: np.ndarray, knee: float) -> float:
    """Weighted sum of squares left by a parabola and the powers 2 and 3 of (t - knee)₊."""
    design = np.empty((t.size, 5))
    for k in range(t.size):
        slide = max(t[k] - knee, 0.0)
        design[k, 0] = weight[k]
        design[k, 1] = weight[k] * t[k]
        design[k, 2] = weight[k] * t[k] ** 2
        for power in range(2, 4):
            design[k, 6 - power] = weight[k] * slide ** power
    target = weight * x
    kept = np.ones(5, dtype=np.bool_)
    error = np.inf
    for _ in range(4):
        columns = np.nonzero(kept)[0]
        error, coefficients = _least_squares(np.ascontiguousarray(design[:, columns]), target)
        backwards, lowest = -1, 0.0
        for j in range(3, columns.size):
            if coefficients[j] < lowest:
                backwards, lowest = columns[j], coefficients[j]
        if backwards < 0:
            break
        kept[backwards] = False
    return error


@njit(cache=True)
def _least_squares(design: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray]:
    """Sum of squares and coefficients, by Gram-Schmidt."""
    size = design.shape[1]
    basis, rest = design.copy(), target.copy()
    triangle = np.zeros((size, size))
    projection, coefficients = np.zeros(size), np.zeros(size)
    for k in range(size):
        for j in range(k):
            triangle[j, k] = _dot(basis[:, j], basis[:, k])
            _subtract(basis[:, k], triangle[j, k], basis[:, j])
        triangle[k, k] = np.sqrt(_dot(basis[:, k], basis[:, k]))
        if triangle[k, k] > 1e-12:
            for i in range(rest.size):
                basis[i, k] /= triangle[k, k]
            projection[k] = _dot(basis[:, k], rest)
            _subtract(rest, projection[k], basis[:, k])
    for k in range(size - 1, -1, -1):
        value = projection[k]
        for j in range(k + 1, size):
            value -= triangle[k, j] * coefficients[j]
        coefficients[k] = value / triangle[k, k] if triangle[k, k] > 1e-12 else 0.0
    return _dot(rest, rest), coefficients


@njit(cache=True)
def _dot(first: np.ndarray, second: np.ndarray) -> float:
    total = 0.0
    for i in range(first.size):
        total += first[i] * second[i]
    return total


@njit(cache=True)
def _subtract(values: np.ndarray, factor: float, others: np.ndarray) -> None:
    """Take a multiple of others from values, in place."""
    for i in range(values.size):
        values[i] -= factor * others[i]
