# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia, as acceleration per current, from the first push and from cycles of Eq. 3.

In a cycle, currents, speeds and accelerations pass the same filter before they are compared, so
that none is rounded more than another at the corners of the profile. A current that is measured
behind a low pass follows the motion later than the current that caused it: the delay with which
both agree best is found together with inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from friction_comp.identification.kinetic import Sample

# So many cycles of neighbouring speeds are used together.
_CYCLES = 3

_TRANSIENT = 2.5e-3  # s that the current controller takes after a step of current
# Each of three averages takes this share of a cycle.
_SMOOTHING, _PASSES = 0.008, 3
# Share of the top speed from which on samples are used: nearer to a reversal, presliding ends.
_FAST = 0.5
# Time constants that are compared first, s: of the current, and of the position below zero. No
# joint is moved with later ones; one at the end only makes up for something else.
_LAGS = (-0.06, -0.04, -0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02, 0.04, 0.06)
# A lag must leave so much less unexplained than none, and so much less to be sure of it; inertia
# must explain this share.
_LESS, _SURE, _EXPLAINED = 0.7, 0.4, 0.8
# Others are compared if inertia explains this share of them.
_COMPARED = 0.5


class Inertia(NamedTuple):
    """What cycles tell of inertia.

    `lag` is the time constant in s of the low pass through which the measured current follows the
    motion; if it is negative, the measured position follows the current.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    lag: float
    sure: bool                          # whether there certainly is such a lag
    unexplained: float = 0.0            # share of the current's variance, beside friction
    differs: float = 0.0                # from that of cycles at other speeds, at most, as a share


def acceleration_of_push(pushed: Sequence[Sample], coasted: Sequence[Sample], strength: float,
                         sign: int) -> float:
    """Estimate k_t·n/J in rad/s² per A from a push at constant current and the coasting after it.

    Friction is about the same in both, so the difference of accelerations is k_t·n/J times the
    current `strength`, A. The controller tolerates errors of tens of percent. NaN if it cannot be
    estimated.
    """
    faster, top = _acceleration(pushed, sign)
    if not math.isfinite(faster) or top <= 0.0:
        return math.nan
    moving = []
    for sample in coasted:
        moving.append(sample)
        if len(moving) > 3 and sign * (moving[-1].position - moving[-4].position) <= 0.0:
            break
    slower, _ = _acceleration(moving[:max(4, int(0.8 * len(moving)))], sign)
    # If the joint stops within a few samples, use its top speed and the time to rest.
    stopping = -top / max(moving[-1].time - coasted[0].time, 1e-4)
    if not math.isfinite(slower) or slower >= 0.0:
        slower = stopping
    rate = (faster - slower) / strength
    return rate if math.isfinite(rate) and rate > 0.0 else math.nan


def _acceleration(samples: Sequence[Sample], sign: int) -> tuple[float, float]:
    """Return acceleration and final speed of a fitted parabola, in the push's direction."""
    time = np.array([sample.time for sample in samples])
    position = sign * np.array([sample.position for sample in samples])
    chosen = time >= time[0] + _TRANSIENT
    if np.sum(chosen) < 5:
        if time.size < 3:
            return math.nan, math.nan
        chosen[:] = True
    t, x = time[chosen] - time[-1], position[chosen]
    bend, slope, _ = np.polyfit(t, x, 2)
    return 2.0 * float(bend), float(slope)


def inertia_of_cycles(cycles: Sequence[np.ndarray]) -> Inertia | None:
    """Estimate inertia from cycles of Eq. 3: rows of s, rad and A, each of shape (N, 3).

    At a given speed and direction, friction is the same whether the joint accelerates or
    decelerates: the difference is due to inertia. None if inertia is too small a part of it.
    """
    found = _inertia_of([_smoothed(cycle) for cycle in cycles])
    return found if found and found.unexplained <= 1.0 - _EXPLAINED else None


def steadiest_inertia(cycles: Sequence[np.ndarray]) -> Inertia | None:
    """Return the inertia of the neighbouring speeds at which it explains the current best.

    Faster cycles have larger accelerations, which noise and an encoder's counts hide less; but an
    elastic or heavy link swings after them, and the motor then accelerates less than all links, or
    more. `cycles` are those of all speeds as of `inertia_of_cycles`, the lowest first; the slowest
    third, near presliding, is left out where there are enough.
    """
    prepared = [_smoothed(cycle) for cycle in cycles]
    last = max(len(prepared) - _CYCLES, 0)
    found = [one for k in range(min(len(prepared) // 3, last), last + 1)
             if (one := _inertia_of(prepared[k:k + _CYCLES]))]
    best = min(found, key=lambda one: one.unexplained, default=None)
    if best is None or best.unexplained > 1.0 - _EXPLAINED:
        return None
    return best._replace(differs=max(
        abs(math.log(one.acceleration_per_current / best.acceleration_per_current))
        for one in found if one.unexplained <= _COMPARED))


def _inertia_of(prepared: Sequence[tuple[np.ndarray, np.ndarray, float]]) -> Inertia | None:
    """Return inertia and lag of smoothed cycles; None if inertia is not positive."""
    def left(lag: float) -> float:
        return _explain(prepared, lag)[1]
    k = int(np.argmin([left(lag) for lag in _LAGS]))
    low, high = _LAGS[max(k - 1, 0)], _LAGS[min(k + 1, len(_LAGS) - 1)]
    lag = float(minimize_scalar(left, bounds=(low, high), method='bounded',
                                options={'xatol': 2e-4}).x)
    share = left(lag) / max(left(0.0), 1e-12)
    if share > _LESS or not 0.95 * _LAGS[0] < lag < 0.95 * _LAGS[-1]:
        lag, share = 0.0, 1.0
    per_acceleration, unexplained = _explain(prepared, lag)
    if not per_acceleration > 0.0:
        return None
    return Inertia(1.0 / per_acceleration, lag, share < _SURE, unexplained)


def without_lag(samples: np.ndarray, lag: float) -> np.ndarray:
    """Return rows of s, rad and A whose current is as late as the position, shape (N, 3)."""
    if not lag:
        return samples
    time, position, current = samples.T
    known = np.isfinite(current)
    return np.column_stack([
        time, position, np.interp(time + lag, time[known], current[known])])


def _smoothed(cycle: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Return columns of speed and acceleration, the current, each smoothed, and the step in s."""
    known = cycle[np.isfinite(cycle[:, 2])]
    time, position, current = known.T
    duration = time[-1] - time[0]
    even = np.linspace(time[0], time[-1], max(int(duration / np.median(np.diff(time))), 50))
    step = float(even[1] - even[0])
    count = max(int(_SMOOTHING * duration / step), 3)
    signals = np.column_stack(
        [np.interp(even, time, position), np.interp(even, time, current)])
    for _ in range(_PASSES):
        signals = uniform_filter1d(signals, count, axis=0, mode='nearest')
    speed = np.gradient(signals[:, 0], step)
    return np.column_stack([speed, np.gradient(speed, step)]), signals[:, 1], step


def _explain(prepared: Sequence[tuple[np.ndarray, np.ndarray, float]],
             lag: float) -> tuple[float, float]:
    """Return current per acceleration, and the share of the variance that it does not explain.

    Each cycle has its own friction: in either direction, and in proportion to speed.
    """
    products = squares = total = 0.0
    for motion, current, step in prepared:
        speed = motion[:, 0]
        columns = _late(np.column_stack([speed > 0.0, speed < 0.0, motion]).astype(float), lag,
                        step)
        chosen = np.abs(speed) > _FAST * float(np.max(np.abs(speed)))
        friction, acceleration = columns[chosen, :3], columns[chosen, 3]
        rest = _late(current, -lag, step)[chosen]
        base, _ = np.linalg.qr(friction)
        acceleration = acceleration - base @ (base.T @ acceleration)
        rest = rest - base @ (base.T @ rest)
        products += step * float(acceleration @ rest)
        squares += step * float(acceleration @ acceleration)
        total += step * float(rest @ rest)
    slope = products / max(squares, 1e-300)
    return slope, 1.0 - slope * products / max(total, 1e-300)


def _late(values: np.ndarray, lag: float, step: float) -> np.ndarray:
    """Return values behind a low pass with a time constant in s, none if it is not positive."""
    if lag <= 0.0:
        return values
    share = -math.expm1(-step / lag)
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, axis=0))
