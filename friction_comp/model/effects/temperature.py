# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that changes with the motor's temperature."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, sign, StaticTerm


class Temperature(Effect):
    """``(A·tanh(v/v_t) + B·v)·(T - T0)``: Coulomb and viscous friction change with T."""

    name = 'temperature'
    variable = 'temperature'
    needs = ('temperature',)
    constants = {'reference_temperature': None, 'transition': None}

    @classmethod
    def grid(cls, scene):
        """The reference is a convention: the median temperature of the recordings."""
        return [{'reference_temperature': scene.temperature, 'transition': scene.transition}]

    @classmethod
    def columns(cls, samples, reference_temperature, transition):
        """Return two columns."""
        v = samples.velocity
        difference = samples.temperature - reference_temperature
        return np.column_stack((sign(v, transition) * difference, v * difference))

    def online(self):
        """Return the term; it needs the temperature and passes through zero with the velocity."""
        a, b = self.coefficients
        c = self.values

        def term(_time, _position, v, temperature, _load):
            difference = temperature - c['reference_temperature']
            return (a * math.tanh(v / c['transition']) + b * v) * difference
        return StaticTerm(term, needs=('temperature',))

    def describe(self):
        """Return the effect in words."""
        a, b = self.coefficients
        return (f'Temperature: per kelvin Coulomb friction changes by {a:+.3g} A and viscous '
                f'friction by {b:+.3g} A per rad/s')

    def formula(self):
        """Return the formula with its numbers."""
        a, b = self.coefficients
        c = self.values
        return (f'({a:+.4g}·tanh(v/{c["transition"]:.3g}) {b:+.4g}·v)'
                f'·(T - {c["reference_temperature"]:.3g})')
