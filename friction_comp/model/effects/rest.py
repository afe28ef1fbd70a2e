# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stiction that grows with the time at rest."""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.model.effects.base import Effect, gentle, geometric, OnlineTerm, sign
from friction_comp.model.effects.hysteresis import breaks


@njit(cache=True)
def rest_share(time, position, speed, broken, threshold, time_constant, distance):
    """Return what is left of the strength gained at rest, 0..1.

    The strength grows as 1 - exp(-rest/time_constant) while the speed is below the threshold, and
    fades over a distance of motion.

    Parameters
    ----------
    time, position, speed : ndarray, shape (N,)
    broken : ndarray of bool, shape (N,)
    threshold, time_constant, distance : float

    Returns
    -------
    ndarray, shape (N,)
    """
    share = np.empty(len(position))
    s = 0.0
    for k in range(len(position)):
        if broken[k]:
            s = 0.0
        elif speed[k] < threshold:
            s = 1.0 - (1.0 - s) * math.exp(-(time[k] - time[k - 1]) / time_constant)
        else:
            s = s * math.exp(-abs(position[k] - position[k - 1]) / distance)
        share[k] = s
    return share


class RestTime(Effect):
    """``A·tanh(v/v_t)·s``: s grows with the time at rest and fades over a distance of motion."""

    name = 'rest_time'
    variable = 'history'
    constants = {'time_constant': ('log', 1.8), 'distance': ('log', 1.8), 'velocity': None,
                 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Rest from fractions of a second to a minute, fading over up to a fifth of the range."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        return [{'time_constant': constant, 'distance': distance, 'velocity': share * scene.slowest,
                 'transition': scene.transition}
                for share in (1.0, 0.25)
                for constant in geometric(0.3, 30.0, 5)
                for distance in geometric(2e-3 * span, 0.2 * span, 6)]

    @classmethod
    def columns(cls, samples, time_constant, distance, velocity, transition):
        """Return one column."""
        v = samples.velocity
        share = rest_share(samples.time, samples.position, np.abs(v), breaks(samples), velocity,
                           time_constant, distance)
        return (sign(v, transition) * share)[:, None]

    def online(self):
        """Return the term; it passes through zero with the velocity."""
        return _Rested(self)

    def describe(self):
        """Return the effect in words."""
        c = self.values
        return (f'Rest time: up to {self.coefficients[0]:+.3g} A more friction after resting '
                f'(time constant {c["time_constant"]:.2g} s), lost over {c["distance"]:.2g} rad')

    def formula(self):
        """Return the formula with its numbers."""
        c = self.values
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{c["transition"]:.3g})'
                f'·(1 - exp(-t_rest/{c["time_constant"]:.3g}))·exp(-Δq/{c["distance"]:.3g})')


class _Rested(OnlineTerm):
    def __init__(self, effect):
        self._gain = effect.coefficients[0]
        self._constants = effect.values
        self.reset()

    def update(self, time, position, velocity, temperature=None, load=None):
        c = self._constants
        if self._time is not None:
            if abs(velocity) < c['velocity']:
                step = max(0.0, time - self._time)
                self._share = 1.0 - (1.0 - self._share) * math.exp(-step / c['time_constant'])
            else:
                self._share *= math.exp(-abs(position - self._position) / c['distance'])
        self._time, self._position = time, position
        return self._gain * math.tanh(velocity / gentle(c['transition'])) * self._share

    def reset(self):
        self._time = self._position = None
        self._share = 0.0
