# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction, or an offset, that drifts with the time since the recording began."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, gentle, geometric, OnlineTerm, sign


class WarmUp(Effect):
    """``(A·s + B·v + C·s²)·exp(-t/τ)``, s = tanh(v/v_t), t from the start of each recording.

    The last term is there because friction that differs between the directions (Eq. 6 has two
    plateaus) also changes differently.
    """

    name = 'warm_up'
    variable = 'time'
    constants = {'time_constant': ('log', 1.7), 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Time constants from a thirtieth of the recording to five times its length."""
        return [{'time_constant': value, 'transition': scene.transition}
                for value in geometric(scene.duration / 30.0, 5.0 * scene.duration, 9)]

    @classmethod
    def columns(cls, samples, time_constant, transition):
        """Return three columns."""
        v = samples.velocity
        fade = np.exp(-np.maximum(samples.time, 0.0) / time_constant)
        side = sign(v, transition)
        return np.column_stack((side * fade, v * fade, side * side * fade))

    def online(self):
        """Return the term; its time counts from the first sample after a reset."""
        return _Fading(self)

    def describe(self):
        """Return the effect in words."""
        a, b, _ = self.coefficients
        return (f'Warm-up: {a:+.3g} A of Coulomb and {b:+.3g} A per rad/s of viscous friction at '
                f'the start, fading with {self.values["time_constant"]:.3g} s')

    def formula(self):
        """Return the formula with its numbers."""
        a, b, even = self.coefficients
        c = self.values
        return (f'({a:+.4g}·s {b:+.4g}·v {even:+.4g}·s²)'
                f'·exp(-t/{c["time_constant"]:.4g}), s = tanh(v/{c["transition"]:.3g})')


class OffsetDrift(Effect):
    """``A·exp(-t/τ)``: a current that drifts whatever the direction, t as in `WarmUp`."""

    name = 'offset_drift'
    variable = 'time'
    constants = {'time_constant': ('log', 1.7)}

    @classmethod
    def grid(cls, scene):
        """Time constants as in `WarmUp`."""
        return [{'time_constant': value}
                for value in geometric(scene.duration / 30.0, 5.0 * scene.duration, 9)]

    @classmethod
    def columns(cls, samples, time_constant):
        """Return one column."""
        return np.exp(-np.maximum(samples.time, 0.0) / time_constant)[:, None]

    def why_left_out(self):
        """Return why the drift is not fed back."""
        return ('a drifting offset of the current sensor is no torque; fed back it could push an '
                'untouched joint')

    def describe(self):
        """Return the effect in words."""
        return (f'Offset drift: {self.coefficients[0]:+.3g} A at the start, fading with '
                f'{self.values["time_constant"]:.3g} s')

    def formula(self):
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·exp(-t/{self.values["time_constant"]:.4g})'


class _Fading(OnlineTerm):
    def __init__(self, effect):
        self._coulomb, self._viscous, self._even = effect.coefficients
        self._constants = effect.values
        self._start = None

    def update(self, time, position, velocity, temperature=None, load=None):
        if self._start is None or time < self._start:
            self._start = time
        c = self._constants
        fade = math.exp(-(time - self._start) / c['time_constant'])
        side = math.tanh(velocity / gentle(c['transition']))
        return (self._coulomb * side + self._viscous * velocity + self._even * side * side) * fade

    def reset(self):
        # A reset of the compensator does not cool the motor: the clock keeps running.
        pass
