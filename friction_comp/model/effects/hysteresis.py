# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Presliding hysteresis: friction that takes some distance to turn round (Dahl, LuGre)."""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.model.effects.base import (
    Effect,
    geometric,
    OnlineTerm,
    SHARPEST_ONLINE,
    sign,
)


@njit(cache=True)
def turned(state, step, distance, exponent):
    """Return Dahl's state z after a step of position, solved exactly.

    dz/dq = (1 - z·sgn(dq))^p / distance (Dahl 1968): p = 1 turns round like an exponential, p < 1
    arrives after a finite distance, p > 1 takes its time.

    Parameters
    ----------
    state, step, distance, exponent : float
        z in -1..1; rad; rad; p.

    Returns
    -------
    float
    """
    if step == 0.0:
        return state
    side = 1.0 if step > 0.0 else -1.0
    left = 1.0 - side * state
    if left <= 0.0:
        return side
    way = abs(step) / distance
    if abs(exponent - 1.0) < 1e-6:
        left *= math.exp(-way)
    else:
        power = left ** (1.0 - exponent) - (1.0 - exponent) * way
        left = power ** (1.0 / (1.0 - exponent)) if power > 0.0 else 0.0
    return side * (1.0 - left)


@njit(cache=True)
def dahl_state(position, broken, start, distance, exponent):
    """Return Dahl's state z of every sample.

    Parameters
    ----------
    position : ndarray, shape (N,)
    broken : ndarray of bool, shape (N,)
        True where a stretch of data begins; z starts there as `start`.
    start : ndarray, shape (N,)
    distance, exponent : float
        As for `turned`.

    Returns
    -------
    ndarray, shape (N,)
    """
    state = np.empty(len(position))
    z = 0.0
    for k in range(len(position)):
        if broken[k]:
            z = start[k]
        else:
            z = turned(z, position[k] - position[k - 1], distance, exponent)
        state[k] = z
    return state


def breaks(samples):
    """Return True where a stretch of unbroken data begins, shape (N,)."""
    mark = np.zeros(len(samples), dtype=bool)
    for part in samples.segments():
        mark[part.start] = True
    return mark


class Hysteresis(Effect):
    """``A·z + B·dz/dt`` with Dahl's state z over a presliding distance.

    A is the share of Coulomb friction that turns round with the distance since the reversal; the
    sigmoid keeps the share that turns round with the velocity. B is the damping of the bristles in
    the LuGre model (Canudas de Wit et al. 1995), in A·s.
    """

    name = 'hysteresis'
    variable = 'history'
    constants = {'distance': ('log', 1.6), 'exponent': ('log', 1.5), 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Distances from a few steps of position to an eighth of the range."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        lowest = max(3e-4 * span, 3.0 * scene.resolution)
        return [{'distance': value, 'exponent': 1.0, 'transition': scene.transition}
                for value in geometric(min(lowest, 0.02 * span), 0.15 * span, 12)]

    @classmethod
    def columns(cls, samples, distance, exponent, transition):
        """Return two columns: the state, and its change with time in 1/s."""
        v = samples.velocity
        direction = sign(v, transition)
        position = np.ascontiguousarray(samples.position, dtype=float)
        state = dahl_state(position, breaks(samples), direction, distance, exponent)
        left = np.maximum(1.0 - state * np.sign(v), 0.0) ** exponent
        return np.column_stack((state, v * left / distance))

    def online(self):
        """Return the term; it fades at standstill, where stored torque would push the joint."""
        return _Bristles(self)

    def describe(self):
        """Return the effect in words."""
        return (f'Hysteresis: {self.coefficients[0]:.3g} A of friction turn round over '
                f'{self.values["distance"]:.3g} rad after a reversal')

    def formula(self):
        """Return the formula with its numbers."""
        c = self.values
        return (f'{self.coefficients[0]:+.4g}·z {self.coefficients[1]:+.4g}·dz/dt, '
                f'dz/dq = (1 - z·sgn(v))^{c["exponent"]:.3g}/{c["distance"]:.3g}')


class _Bristles(OnlineTerm):
    def __init__(self, effect):
        self._gain, self._damping = effect.coefficients
        self._constants = effect.values
        self.reset()

    def update(self, time, position, velocity, temperature=None, load=None):
        moving = abs(math.tanh(velocity / SHARPEST_ONLINE))
        step = 0.0 if self._position is None else position - self._position
        distance, exponent = self._constants['distance'], self._constants['exponent']
        self._state = turned(self._state, step, distance, exponent)
        self._position = position
        side = math.copysign(1.0, velocity)
        change = velocity * max(1.0 - side * self._state, 0.0) ** exponent / distance
        # What the bristles hold at rest is held by friction: fed to the motor it would push a
        # joint that nobody touches.
        return (self._gain * self._state + self._damping * change) * moving

    def reset(self):
        self._state = 0.0
        self._position = None
