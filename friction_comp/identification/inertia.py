# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia, as acceleration per current, from the first push and from cycles of Eq. 3.

In a cycle, currents, speeds and accelerations pass the same filter before they are compared, so
that none is rounded more than another at the corners of the profile. Of each, only what follows the
profile counts: an encoder's counts are in the acceleration, and through the velocity controller in
the current as well, so that least squares on what was measured would find another inertia (two
stages, with the profile as the instrument). A current or a position that is measured behind a low
pass is late: the time constant by which its own slope makes up for that is found with inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import orth
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from friction_comp.identification.profiles import Sample

_TRANSIENT = 2.5e-3  # s that the current controller takes after a step of current
# So many cycles of neighbouring speeds are used together.
_CYCLES = 3
# Each of three averages takes this share of a cycle. Samples are used from this share of the top
# speed on: nearer to a reversal, presliding ends.
_SMOOTHING, _PASSES, _FAST = 0.008, 3, 0.5
# The profile's velocity (Eq. 3) over the share of a cycle, and the low passes behind which the
# motion follows it, s: velocity controllers of 10 to 100 rad/s.
_SHARES, _SPEEDS = (0.0, 0.1, 0.4, 0.6, 0.9, 1.0), (0.0, 1.0, 1.0, -1.0, -1.0, 0.0)
_FOLLOWS = (0.0, 0.03, 0.1)
# Lags that are compared, s, of the current, and of the position below zero: no joint is moved with
# later ones, and one at the end only makes up for something else. One is taken from this size on,
# if it leaves at most this share of what none leaves unexplained.
_LAGS, _LAG, _LESS = np.linspace(-0.06, 0.06, 121), 0.005, 0.5
# Inertia must explain this share, and of other speeds this one to be compared.
_EXPLAINED, _COMPARED = 0.8, 0.5


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
    time, position, _ = np.array(pushed).T
    chosen = time >= time[0] + _TRANSIENT
    if np.sum(chosen) < 5:
        chosen[:] = True
    if time.size < 3:
        return math.nan
    bend, top, _ = np.polyfit(time[chosen] - time[-1], sign * position[chosen], 2)
    ways = sign * np.array([sample.position for sample in coasted])
    stopped = coasted[int(np.argmax(ways))].time - coasted[0].time
    rate = float(2.0 * bend + top / max(stopped, 1e-4)) / strength
    return rate if top > 0.0 and math.isfinite(rate) and rate > 0.0 else math.nan


def steadiest_inertia(cycles: Sequence[np.ndarray]) -> Inertia | None:
    """Return the inertia of the neighbouring speeds at which it explains the current best.

    At a given speed and direction, friction is the same whether the joint accelerates or
    decelerates: the difference is due to inertia. Faster cycles have larger accelerations, which
    noise hides less; but an elastic or heavy link swings after them, and the motor then accelerates
    less than all links, or more. `cycles` of Eq. 3 are those of all speeds, the lowest first, as
    rows of s, rad and A, each of shape (N, 3); the slowest third, near presliding, is left out
    where there are enough. None if inertia is too small a part of the current.
    """
    own = [_products(cycle) for cycle in cycles]
    last = max(len(own) - _CYCLES, 0)
    together = [np.array(own[k:k + _CYCLES])
                for k in range(min(len(own) // 3, last), last + 1)]
    # A sensor is late at every speed, what swings is so at some.
    lag = sorted(map(_lag_of, together), key=abs)[(len(together) - 1) // 2]
    found = [one for few in together if (one := _explained(few, lag))[0] > 0.0]
    best, unexplained = min(found, key=lambda one: one[1], default=(0.0, 1.0))
    if unexplained > 1.0 - _EXPLAINED:
        return None
    return Inertia(1.0 / best, lag, unexplained, max(
        abs(math.log(one / best)) for one, left in found if left <= _COMPARED))


def without_lag(samples: np.ndarray, lag: float) -> np.ndarray:
    """Return rows of s, rad and A whose current is as late as the position, shape (N, 3)."""
    if not lag:
        return samples
    time, position, current = samples.T
    known = np.isfinite(current)
    return np.column_stack([
        time, position, np.interp(time + lag, time[known], current[known])])


def _products(cycle: np.ndarray) -> np.ndarray:
    """Return products of speed, acceleration, its slope, current, and its slope, (2, 5, 5).

    The first are those of what follows the profile, the others of all; without Coulomb friction,
    which is that of this cycle in either direction.
    """
    time, position, current = cycle[np.isfinite(cycle[:, 2])].T
    duration = time[-1] - time[0]
    even = np.linspace(time[0], time[-1], max(int(duration / np.median(np.diff(time))), 50))
    step = float(even[1] - even[0])
    speed = np.interp((even - time[0]) / duration, _SHARES, _SPEEDS)
    profile = np.column_stack([speed, np.gradient(speed, step)])
    signals = np.column_stack([
        np.interp(even, time, position), np.interp(even, time, current),
        *(_late(profile, lag, step) for lag in _FOLLOWS)])
    for _ in range(_PASSES):
        signals = uniform_filter1d(
            signals, max(int(_SMOOTHING * duration / step), 3), axis=0, mode='nearest')
    speed, slope = (np.gradient(signals[:, k], step) for k in range(2))
    acceleration = np.gradient(speed, step)
    chosen = np.abs(speed) > _FAST * float(np.max(np.abs(speed)))
    sides = np.column_stack([speed > 0.0, speed < 0.0]).astype(float)[chosen]
    columns = np.column_stack([speed, acceleration, np.gradient(acceleration, step),
                               signals[:, 1], slope])[chosen]
    basis = orth(np.column_stack([sides, signals[chosen, 2:]]))
    sides = orth(sides)
    products = []
    for values in (basis @ (basis.T @ columns), columns):
        rest = values - sides @ (sides.T @ values)
        products.append(step * rest.T @ rest)
    return np.array(products)


def _lag_of(products: np.ndarray) -> float:
    """Return the lag in s with which the current explains the acceleration best; 0 if none does."""
    # In all variance, counts of an encoder seem late, and in what follows the profile, a link that
    # swings; a sensor is late in both.
    left = np.max([[_explained(products[:, [kind]], lag)[1] for lag in _LAGS] / np.maximum(
        _explained(products[:, [kind]], 0.0)[1], 1e-12) for kind in (0, 1)], axis=0)
    best = int(np.argmin(left))
    lag = float(_LAGS[best])
    taken = left[best] < _LESS and abs(lag) >= _LAG and 0 < best < len(_LAGS) - 1
    return lag if taken else 0.0


def _explained(products: np.ndarray, lag: float) -> tuple[float, float]:
    """Return current per acceleration, A per rad/s², and the share of variance that it leaves.

    `products` are those of some cycles, (K, 2, 5, 5), each with its own viscous friction.
    """
    late, early = max(lag, 0.0), max(-lag, 0.0)
    signals = np.array([[1.0, early, 0.0, 0.0, 0.0], [0.0, 1.0, early, 0.0, 0.0],
                        [0.0, 0.0, 0.0, 1.0, late]])
    sums = np.zeros((2, 2))
    for own in products[:, 0]:
        all_of = signals @ own @ signals.T
        sums += all_of[1:, 1:] - np.outer(all_of[1:, 0], all_of[0, 1:]) / all_of[0, 0]
    per = float(sums[0, 1] / max(sums[0, 0], 1e-300))
    return per, float(sums[1, 1] - per * sums[0, 1]) / max(float(sums[1, 1]), 1e-300)


def _late(values: np.ndarray, lag: float, step: float) -> np.ndarray:
    """Return values behind a low pass with a time constant in s; none if it is zero."""
    # The mean delay of this filter is the time constant, also at low rates.
    share = step / (step + lag)
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, axis=0))
