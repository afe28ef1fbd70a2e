# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Presliding hysteresis: friction that takes some distance to turn round (Dahl's model)."""

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
def dahl_state(position, broken, start, distance):
    """Return Dahl's state z in -1..1, dz/dq = (1 - z·sgn(dq))/distance, solved exactly per step.

    Parameters
    ----------
    position : ndarray, shape (N,)
    broken : ndarray of bool, shape (N,)
        True where a stretch of data begins; z starts there as `start`.
    start : ndarray, shape (N,)
    distance : float

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
            step = position[k] - position[k - 1]
            if step > 0.0:
                z = 1.0 - (1.0 - z) * math.exp(-step / distance)
            elif step < 0.0:
                z = -1.0 + (1.0 + z) * math.exp(step / distance)
        state[k] = z
    return state


def breaks(samples):
    """Return True where a stretch of unbroken data begins, shape (N,)."""
    mark = np.zeros(len(samples), dtype=bool)
    for part in samples.segments():
        mark[part.start] = True
    return mark


class Hysteresis(Effect):
    """``A·z`` with Dahl's state z over a presliding distance.

    A is the share of Coulomb friction that turns round with the distance since the reversal; the
    sigmoid keeps the share that turns round with the velocity.
    """

    name = 'hysteresis'
    variable = 'history'
    constants = {'distance': ('log', 1.6), 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Distances from a few steps of position to an eighth of the range."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        lowest = max(3e-4 * span, 3.0 * scene.resolution)
        return [{'distance': value, 'transition': scene.transition}
                for value in geometric(min(lowest, 0.02 * span), 0.15 * span, 12)]

    @classmethod
    def columns(cls, samples, distance, transition):
        """Return one column."""
        direction = sign(samples.velocity, transition)
        position = np.ascontiguousarray(samples.position, dtype=float)
        state = dahl_state(position, breaks(samples), direction, distance)
        return state[:, None]

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
        return (f'{self.coefficients[0]:+.4g}·z, '
                f'dz/dq = (1 - z·sgn(v))/{c["distance"]:.3g}')


class _Bristles(OnlineTerm):
    def __init__(self, effect):
        self._gain = effect.coefficients[0]
        self._constants = effect.values
        self.reset()

    def update(self, time, position, velocity, temperature=None, load=None):
        moving = abs(math.tanh(velocity / SHARPEST_ONLINE))
        step = 0.0 if self._position is None else position - self._position
        if step:
            side = math.copysign(1.0, step)
            keep = math.exp(-abs(step) / self._constants['distance'])
            self._state = side + (self._state - side) * keep
        self._position = position
        # What the bristles hold at rest is held by friction: fed to the motor it would push a
        # joint that nobody touches.
        return self._gain * self._state * moving

    def reset(self):
        self._state = 0.0
        self._position = None
