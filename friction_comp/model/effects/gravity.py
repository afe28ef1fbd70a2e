# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torque that depends on the joint angle once a turn, as gravity does."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, StaticTerm


class Gravity(Effect):
    """``A·cos(q) + B·sin(q)``, independent of the direction of motion."""

    name = 'gravity'
    variable = 'position'
    constants = {}

    @classmethod
    def grid(cls, scene):
        """There is nothing to search."""
        return [{}]

    @classmethod
    def columns(cls, samples):
        """Return cos and sin of the joint angle."""
        return np.column_stack((np.cos(samples.position), np.sin(samples.position)))

    def online(self):
        """Return the term; it holds the limb whether it moves or not."""
        a, b = self.coefficients

        def term(_time, position, _v, _temperature, _load):
            return a * math.cos(position) + b * math.sin(position)
        return StaticTerm(term)

    def describe(self):
        """Return the effect in words."""
        a, b = self.coefficients
        where = math.degrees(math.atan2(b, a))
        return (f'Gravity-like: {math.hypot(a, b):.3g} A once a turn, largest at a joint angle of '
                f'{where:.0f} degrees')

    def formula(self):
        """Return the formula with its numbers."""
        a, b = self.coefficients
        return f'{a:+.4g}·cos(q) {b:+.4g}·sin(q)'
