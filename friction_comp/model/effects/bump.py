# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A local bump in position, as a worn or broken tooth makes."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.effects.base import Effect, gentle, geometric, sign, StaticTerm


class Bump(Effect):
    """``A·s·exp(-|q - q0|^p/(2·w^p))`` with s = tanh(v/v_t), or s = 1 where `directional` is 0.

    p = 2 is a bell; a larger exponent has a flatter top.
    """

    name = 'bump'
    variable = 'position'
    repeatable = True
    constants = {'position': ('linear', 0.5), 'width': ('log', 1.5), 'exponent': ('log', 2.2),
                 'directional': None, 'transition': None}

    @classmethod
    def grid(cls, scene):
        """Widths from a hundredth to an eighth of the range, places half a width apart."""
        span = scene.highest - scene.lowest
        if not span > 0:
            return []
        points = []
        for width in geometric(0.008 * span, 0.12 * span, 5):
            places = np.arange(scene.lowest, scene.highest + 0.5 * width, width)
            points += [{'position': float(place), 'width': width, 'exponent': 2.0,
                        'directional': directional, 'transition': scene.transition}
                       for place in places for directional in (1.0, 0.0)]
        return points

    @classmethod
    def columns(cls, samples, position, width, exponent, directional, transition):
        """Return one column."""
        distance = np.abs(samples.position - position) / width
        power = distance * distance if exponent == 2.0 else distance ** exponent
        bell = np.exp(-np.minimum(0.5 * power, 700.0))
        if directional:
            bell = bell * sign(samples.velocity, transition)
        return bell[:, None]

    def online(self):
        """Return the term; friction's bump passes through zero with the velocity."""
        gain = self.coefficients[0]
        c = self.values

        def term(_time, position, v, _temperature, _load):
            distance = min(abs(position - c['position']) / c['width'], 1e6)
            bell = math.exp(-min(0.5 * distance ** c['exponent'], 700.0))
            side = math.tanh(v / gentle(c['transition'])) if c['directional'] else 1.0
            return gain * side * bell
        return StaticTerm(term)

    def describe(self):
        """Return the effect in words."""
        c = self.values
        kind = 'more friction' if c['directional'] else 'torque in one direction'
        return (f'Bump: {self.coefficients[0]:+.3g} A {kind} at {c["position"]:.4g} rad, '
                f'about {2.4 * c["width"]:.2g} rad wide')

    def formula(self):
        """Return the formula with its numbers."""
        c = self.values
        side = f'·tanh(v/{c["transition"]:.3g})' if c['directional'] else ''
        return (f'{self.coefficients[0]:+.4g}·exp(-½·(|q - {c["position"]:.4g}|'
                f'/{c["width"]:.3g})^{c["exponent"]:.3g}){side}')
