# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that is not the same in both directions."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, sign, StaticTerm


class DirectionAsymmetry(Effect):
    """``(A + B·|v|)·tanh²(v/v_t)``: half the difference between positive and negative direction.

    A is what differs at low speed (Coulomb asymmetry or a constant offset, which no recording of
    current alone can tell apart), B what differs per speed. The sigmoid of Eq. 6 can hold A
    itself; refinement moves it here where it is worth a name.
    """

    name = 'direction_asymmetry'
    variable = 'direction'
    constants = {'transition': None}

    @classmethod
    def grid(cls, scene):
        """There is nothing to search."""
        return [{'transition': scene.transition}]

    @classmethod
    def columns(cls, samples, transition):
        """Return two columns, even in the velocity and zero at standstill."""
        v = samples.velocity
        even = sign(v, transition) ** 2
        return np.column_stack((even, even * np.abs(v)))

    def online(self):
        """Return the term; it is zero at standstill, where breakaway has its own two values."""
        a, b = self.coefficients
        transition = self.values['transition']

        def term(_time, _position, v, _temperature, _load):
            return (a + b * abs(v)) * math.tanh(v / transition) ** 2
        return StaticTerm(term)

    def describe(self):
        """Return the effect in words."""
        a, b = self.coefficients
        return (f'Direction: the positive direction needs {2 * a:+.3g} A {2 * b:+.3g} A per rad/s '
                'more than the negative one')

    def formula(self):
        """Return the formula with its numbers."""
        a, b = self.coefficients
        return f'({a:+.4g} {b:+.4g}·|v|)·tanh²(v/{self.values["transition"]:.3g})'
