# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torque that depends on the joint angle once a turn, as gravity does."""

from __future__ import annotations

import math
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_comp.model.effects.scene import Scene, Signals


class Gravity(Effect):
    """``A·cos(q) + B·sin(q)``, independent of the direction of motion."""

    name = 'gravity'
    numbers = (('part with the cosine of position', 'A'), ('part with the sine of position', 'A'))
    variable = 'position'
    role = CARRIES
    physics = weight = True
    gives_load = True
    constants = {}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return cos and sin of the joint angle."""
        return (np.cos(x.position), np.sin(x.position))

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """Over a part of a turn gravity is largely a constant."""
        return scene.span < 2.0

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a short range shows little of it."""
        if scene.span >= 0.5:
            return ''
        return (f'Position covered {scene.span:.3g} rad only: gravity cannot be told from an '
                'offset or a spring, and slow ripple cannot be seen.')

    @classmethod
    def load_share(cls, coefficients: Sequence[float] | np.ndarray, constants: dict[str, float]
                   ) -> dict[str, float]:
        """Return cos and sin of the joint angle, A."""
        return {'cosine': coefficients[0], 'sine': coefficients[1]}

    def describe(self) -> str:
        """Return the effect in words."""
        a, b = self.coefficients
        where = math.degrees(math.atan2(b, a))
        return (f'Gravity-like: {math.hypot(a, b):.3g} A once a turn, largest at a joint angle of '
                f'{where:.0f} degrees')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        a, b = self.coefficients
        return f'{a:+.4g}·cos(q) {b:+.4g}·sin(q)'
