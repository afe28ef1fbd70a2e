# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Ripple over position: cogging, and friction that waxes and wanes with every tooth."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, gentle, sign, StaticTerm


class _Ripple(Effect):
    variable = 'position'
    repeatable = True
    constants = {'frequency': ('linear', 1.0), 'growth': None, 'speed': None, 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Frequencies come from the spectrum over position: see `refinement.spectrum`."""
        return []

    @classmethod
    def columns(cls, samples, frequency, growth, speed, transition):
        """Return cos and sin over position, times |v|^growth, times the sign of friction."""
        amplitude = cls._amplitude(samples.velocity, growth, speed, transition)
        phase = frequency * samples.position
        return np.column_stack((amplitude * np.cos(phase), amplitude * np.sin(phase)))

    def describe(self):
        """Return the effect in words."""
        size = math.hypot(*self.coefficients)
        with_speed = (f' at {self.values["speed"]:.2g} rad/s, growing with speed'
                      if self.values['growth'] else '')
        return (f'{self._word}: {size:.3g} A{with_speed}, {self.values["frequency"]:.5g} times a '
                'turn')

    def formula(self):
        """Return the formula with its numbers."""
        a, b = self.coefficients
        k = self.values['frequency']
        grown = (f'·(|v|/{self.values["speed"]:.3g})^{self.values["growth"]:g}'
                 if self.values['growth'] else '')
        return f'({a:+.4g}·cos({k:.6g}·q) {b:+.4g}·sin({k:.6g}·q)){grown}{self._suffix()}'

    def _suffix(self):
        return ''


class Cogging(_Ripple):
    """``(A·cos(kq) + B·sin(kq))·(|v|/v_ref)^g``, independent of the direction of motion."""

    name = 'cogging'
    _word = 'Cogging'

    @classmethod
    def _amplitude(cls, v, growth, speed, transition):
        return (np.abs(v) / speed) ** growth

    def online(self):
        """Return the term; it is independent of direction, so it also holds at standstill."""
        a, b = self.coefficients
        c = self.values

        def term(_time, position, v, _temperature, _load):
            phase = c['frequency'] * position
            grown = (abs(v) / c['speed']) ** c['growth'] if c['growth'] else 1.0
            return grown * (a * math.cos(phase) + b * math.sin(phase))
        return StaticTerm(term)


class FrictionRipple(_Ripple):
    """``(A·cos(kq) + B·sin(kq))·tanh(v/v_t)·(|v|/v_ref)^g``: changes sign with the direction."""

    name = 'friction_ripple'
    _word = 'Friction ripple'

    @classmethod
    def _amplitude(cls, v, growth, speed, transition):
        return sign(v, transition) * (np.abs(v) / speed) ** growth

    def online(self):
        """Return the term; it passes through zero with the velocity."""
        a, b = self.coefficients
        c = self.values

        def term(_time, position, v, _temperature, _load):
            phase = c['frequency'] * position
            grown = (abs(v) / c['speed']) ** c['growth'] if c['growth'] else 1.0
            return (grown * math.tanh(v / gentle(c['transition']))
                    * (a * math.cos(phase) + b * math.sin(phase)))
        return StaticTerm(term)

    def _suffix(self):
        return f'·tanh(v/{self.values["transition"]:.3g})'
