# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stribeck weakening: friction that falls before it rises with speed."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect, geometric
from friction_comp.model.effects.scene import SearchRange, speed_hardly_varied

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals


class Stribeck(Effect):
    """``A·tanh(v/v_t)·exp(-(|v|/v_s)^p)``, the second term of the note's Eq. 2 for p = 1."""

    name = 'stribeck'
    numbers = (('height at standstill', 'A'),)
    variable = 'velocity'
    constants = {'velocity': SearchRange(1.6), 'exponent': None, 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Stribeck velocities from just above standstill to two thirds of the top speed."""
        lowest = max(1.5 * scene.transition, 1.5 * scene.slowest, 0.003 * scene.speed)
        return [{'velocity': velocity, 'exponent': exponent, 'transition': scene.transition}
                for velocity in geometric(min(lowest, 0.3 * scene.speed), 0.7 * scene.speed, 9)
                for exponent in (1.0, 2.0)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column, 1 at zero speed and fading with it."""
        return (x.side * np.exp(-np.minimum((abs(x.velocity) / c.velocity) ** c.exponent, 700.0)),)

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a speed that hardly varies shows nothing of it."""
        return speed_hardly_varied(scene)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Fading as slowly as the top speed it is curved viscous friction; at rest, not seen."""
        if name == 'velocity':
            return min(max(value, 0.5 * scene.slowest), 0.7 * scene.speed)
        return value

    def describe(self) -> str:
        """Return the effect in words."""
        size, speed = abs(self.coefficients[0]), self.values['velocity']
        if self.coefficients[0] > 0:
            return (f'Stribeck: near standstill friction is {size:.3g} A higher, fading at about '
                    f'{speed:.3g} rad/s')
        return (f'Sub-linear friction: near standstill it is {size:.3g} A lower, rising within '
                f'about {speed:.3g} rad/s')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        c = self.values
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{c["transition"]:.3g})'
                f'·exp(-(|v|/{c["velocity"]:.3g})^{c["exponent"]:g})')
