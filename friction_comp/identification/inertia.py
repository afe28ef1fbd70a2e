# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia, as acceleration per current, from the first push and from cycles of Eq. 3.

In a cycle, currents, speeds and accelerations pass the same filter before they are compared, so
that none is rounded more than another at the corners of the profile. Of each, only what follows the
profile counts: an encoder's counts are in the acceleration, and through the velocity controller in
the current as well, so that least squares on what was measured would find another inertia (two
stages, with the profile as the instrument). A current that is measured behind a low pass follows
the motion later than the current that caused it: the delay with which both agree best is found
together with inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import orth
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from friction_comp.identification.kinetic import cycle_velocity, Sample

# So many cycles of neighbouring speeds are used together.
_CYCLES = 3

_TRANSIENT = 2.5e-3  # s that the current controller takes after a step of current
# Each of three averages takes this share of a cycle.
_SMOOTHING, _PASSES = 0.008, 3
# The motion follows the profile behind low passes such as these, s: velocity controllers of 10 to
# 100 rad/s.
_FOLLOWS = (0.0, 0.03, 0.1)
# Share of the top speed from which on samples are used: nearer to a reversal, presliding ends.
_FAST = 0.5
# Time constants that are compared first, s: of the current, and of the position below zero. No
# joint is moved with later ones; one at the end only makes up for something else.
_LAGS = (-0.06, -0.04, -0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02, 0.04, 0.06)
# A lag must leave at most this share of what none leaves unexplained; inertia must explain this
# share.
_LESS, _EXPLAINED = 0.5, 0.8
# Others are compared if inertia explains this share of them.
_COMPARED = 0.5


class Inertia(NamedTuple):
    """What cycles tell of inertia.

    `lag` is the time constant in s of the low pass through which the measured current follows the
    motion; if it is negative, the measured position follows the current.
    """

    acceleration_per_current: float     # k_t·n/J, rad/s² per A
    lag: float
    unexplained: float = 0.0            # share of the variance that follows the profile
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


def steadiest_inertia(cycles: Sequence[np.ndarray]) -> Inertia | None:
    """Return the inertia of the neighbouring speeds at which it explains the current best.

    At a given speed and direction, friction is the same whether the joint accelerates or
    decelerates: the difference is due to inertia. Faster cycles have larger accelerations, which
    noise hides less; but an elastic or heavy link swings after them, and the motor then accelerates
    less than all links, or more. `cycles` of Eq. 3 are those of all speeds, the lowest first, as
    rows of s, rad and A, each of shape (N, 3); the slowest third, near presliding, is left out
    where there are enough. None if inertia is too small a part of the current.
    """
    prepared = [_smoothed(cycle) for cycle in cycles]
    last = max(len(prepared) - _CYCLES, 0)
    together = [prepared[k:k + _CYCLES] for k in range(min(len(prepared) // 3, last), last + 1)]
    # A sensor is late at every speed, what swings is so at some.
    lag = sorted(map(_lag, together), key=abs)[(len(together) - 1) // 2]
    found = [one for few in together if (one := _explain(few, lag)).per_acceleration > 0.0]
    best = min(found, key=lambda one: one.unexplained, default=None)
    if best is None or best.unexplained > 1.0 - _EXPLAINED:
        return None
    return Inertia(1.0 / best.per_acceleration, lag, best.unexplained, differs=max(
        abs(math.log(one.per_acceleration / best.per_acceleration))
        for one in found if one.unexplained <= _COMPARED))


class _Smoothed(NamedTuple):
    motion: np.ndarray      # columns of both directions, speed and acceleration
    current: np.ndarray
    chosen: np.ndarray      # samples that are used
    basis: np.ndarray       # orthonormal columns that span what follows the profile, of those
    step: float             # s


def _lag(prepared: Sequence[_Smoothed]) -> float:
    """Return the lag of smoothed cycles in s; 0 if there is none."""
    plain = _explain(prepared, 0.0)

    def left(lag: float) -> float:
        # In all variance, counts of an encoder seem late, and in what follows the profile, a link
        # that swings; a sensor is late in both.
        found = _explain(prepared, lag)
        return max(found.unexplained / max(plain.unexplained, 1e-12),
                   found.of_all / max(plain.of_all, 1e-12))
    k = int(np.argmin([left(lag) for lag in _LAGS]))
    low, high = _LAGS[max(k - 1, 0)], _LAGS[min(k + 1, len(_LAGS) - 1)]
    lag = float(minimize_scalar(left, bounds=(low, high), method='bounded',
                                options={'xatol': 2e-4}).x)
    return lag if left(lag) < _LESS and 0.95 * _LAGS[0] < lag < 0.95 * _LAGS[-1] else 0.0


def without_lag(samples: np.ndarray, lag: float) -> np.ndarray:
    """Return rows of s, rad and A whose current is as late as the position, shape (N, 3)."""
    if not lag:
        return samples
    time, position, current = samples.T
    known = np.isfinite(current)
    return np.column_stack([
        time, position, np.interp(time + lag, time[known], current[known])])


def _smoothed(cycle: np.ndarray) -> _Smoothed:
    """Return the signals of a cycle at even steps, all behind the same filter."""
    known = cycle[np.isfinite(cycle[:, 2])]
    time, position, current = known.T
    duration = time[-1] - time[0]
    even = np.linspace(time[0], time[-1], max(int(duration / np.median(np.diff(time))), 50))
    step = float(even[1] - even[0])
    count = max(int(_SMOOTHING * duration / step), 3)
    speed = np.array([cycle_velocity(t, 1.0, duration) for t in even - time[0]])
    profile = np.column_stack([speed, np.gradient(speed, step)])
    signals = np.column_stack([
        np.interp(even, time, position), np.interp(even, time, current),
        *(_late(profile, lag, step) for lag in _FOLLOWS)])
    for _ in range(_PASSES):
        signals = uniform_filter1d(signals, count, axis=0, mode='nearest')
    speed = np.gradient(signals[:, 0], step)
    chosen = np.abs(speed) > _FAST * float(np.max(np.abs(speed)))
    sides = np.column_stack([speed > 0.0, speed < 0.0]).astype(float)
    return _Smoothed(
        np.column_stack([sides, speed, np.gradient(speed, step)]), signals[:, 1], chosen,
        orth(np.column_stack([sides, signals[:, 2:]])[chosen]), step)


class _Explained(NamedTuple):
    per_acceleration: float     # A per rad/s²
    unexplained: float          # share of the variance of what follows the profile
    of_all: float               # the same of all variance


def _explain(prepared: Sequence[_Smoothed], lag: float) -> _Explained:
    """Return current per acceleration, and the shares of the variance that it does not explain.

    Each cycle has its own friction: in either direction, and in proportion to speed.
    """
    follows, measured = np.zeros((2, 2)), np.zeros((2, 2))
    for motion, current, chosen, basis, step in prepared:
        columns = np.column_stack([_late(motion, lag, step), _late(current, -lag, step)])[chosen]
        for values, sums in ((columns, measured), (basis @ (basis.T @ columns), follows)):
            friction, _ = np.linalg.qr(values[:, :3])
            rest = values[:, 3:] - friction @ (friction.T @ values[:, 3:])
            sums += step * rest.T @ rest
    one = float(follows[0, 1] / max(follows[0, 0], 1e-300))
    line = np.array([-one, 1.0])
    return _Explained(one, *(
        float(line @ sums @ line) / max(sums[1, 1], 1e-300) for sums in (follows, measured)))


def _late(values: np.ndarray, lag: float, step: float) -> np.ndarray:
    """Return values behind a low pass, by a lag in s, none if it is not positive."""
    if lag <= 0.0:
        return values
    # The mean delay of this filter is the lag, also at low rates.
    share = step / (step + lag)
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, axis=0))
