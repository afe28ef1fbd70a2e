# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds where on a current ramp a joint stops creeping and begins to slide."""

from __future__ import annotations

import math

import numpy as np

_SPEED_WINDOW = 0.03   # s over which the speed is taken
_POINTS = 160          # of the fit
_MISFIT = 0.13         # of the way slid, by which the fit may be wrong


# s before the run-away within which the slide began: a sliding joint reaches the run-away speed
# within tenths of a second. Over a longer time, creep on soft contacts, which yield more as the
# load approaches breakaway, would be mistaken for the slide.
_LONGEST_WINDOW = 0.6


def slide_begin(time: np.ndarray, position: np.ndarray, begin: int, end: int, sign: float,
                resolution: float, runaway_speed: float) -> tuple[float, float]:
    """Return when the joint began to slide, NaN where it did not, and its rest time before."""
    still = 2.5 * resolution + 1e-12
    moved = np.flatnonzero(np.abs(position[:begin] - position[begin]) > still)
    rest = float(time[begin] - time[moved[-1] + 1 if len(moved) else 0])
    runaway = _runaway(time, position, begin, end, sign, resolution, runaway_speed)
    if runaway < 0:
        return math.nan, rest
    window, instant = _LONGEST_WINDOW, math.nan
    for _ in range(4):
        first = max(begin, int(np.searchsorted(time, time[runaway] - window, side='right')) - 1)
        instant = _hinge(time[first:runaway + 1], sign * position[first:runaway + 1], resolution)
        window = min(max(4.0 * (time[runaway] - instant), 0.15), _LONGEST_WINDOW)
    return instant, rest


def _runaway(time: np.ndarray, position: np.ndarray, begin: int, end: int, sign: float,
             resolution: float, speed: float) -> int:
    """Return the first sample at which a speed has held over a window, -1 where none does."""
    now = np.arange(begin, end)
    tail = np.maximum(begin, np.searchsorted(time, time[now] - _SPEED_WINDOW, side='left'))
    elapsed, way = time[now] - time[tail], sign * (position[now] - position[tail])
    fast = (elapsed >= 0.5 * _SPEED_WINDOW) & (way > speed * elapsed) & (way > 4.0 * resolution)
    return int(now[np.argmax(fast)]) if fast.any() else -1


def _hinge(time: np.ndarray, position: np.ndarray, resolution: float) -> float:
    """Return the instant at which creep turns into a slide, by least squares.

    Creep is a parabola; the slide adds to it an acceleration and a growing one, no jump in speed,
    none of them backwards. No formula holds far into the slide, so the farther the joint has
    gone, the less a sample weighs.
    """
    count = min(_POINTS, len(time))
    if count < 12:
        return float(time[0])
    index = (len(time) - 1) * np.arange(count) // (count - 1)
    span = float(time[-1] - time[0])
    t, x = (time[index] - time[0]) / span, position[index] - position[0]
    early = max(6, int(0.4 * count))
    gone = np.maximum(0.0, x - np.polyval(np.polyfit(t[:early], x[:early], 1), t))
    weight = 1.0 / np.hypot(0.5 * resolution + 1e-12, _MISFIT * gone)
    knees = np.linspace(0.02, 0.97, 41)
    for _ in range(3):
        knee = float(knees[np.argmin(_hinge_errors(t, x, weight, knees))])
        width = knees[1] - knees[0]
        knees = np.linspace(max(0.0, knee - width), min(0.97, knee + width), 13)
    return float(time[0]) + knee * span


def _hinge_errors(t: np.ndarray, x: np.ndarray, weight: np.ndarray, knees: np.ndarray
                  ) -> np.ndarray:
    """Return the weighted squares left by a parabola and powers of (t - knee)₊, shape (K,)."""
    slide = np.maximum(t - knees[:, None], 0.0)
    creep = [np.broadcast_to(t ** power, slide.shape) for power in range(3)]
    design = weight[:, None] * np.stack((*creep, slide ** 2, slide ** 3), axis=2)
    target, best = weight * x, np.full(len(knees), np.inf)
    for columns in ([0, 1, 2, 3, 4], [0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2]):
        part = design[:, :, columns]
        size = np.sqrt(np.sum(part ** 2, axis=1)) + 1e-300
        scaled = part / size[:, None]
        turned = np.swapaxes(scaled, 1, 2)
        coefficients = np.linalg.solve(turned @ scaled + 1e-12 * np.eye(len(columns)),
                                turned @ target[:, None])
        error = np.sum((target[:, None] - scaled @ coefficients)[:, :, 0] ** 2, axis=1)
        forwards = (coefficients[:, 3:, 0] >= 0.0).all(axis=1)
        best = np.where(forwards, np.minimum(best, error), best)
    return best
