# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torque proportional to the joint angle, as a spring or a cable makes."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_comp.model.effects.scene import Scene, Signals


class Spring(Effect):
    """``A·(q - q0)``, independent of the direction of motion."""

    name = 'spring'
    numbers = (('stiffness', 'A/rad'),)
    variable = 'position'
    role = CARRIES
    physics = True
    gives_load = True
    held = {'position': 0.25}
    constants = {'position': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """The middle of the range stands for where the spring is slack: see the sigmoid."""
        return [{'position': 0.5 * (scene.lowest + scene.highest)}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        return (x.position - c.position,)

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """A constant says where the spring is slack."""
        return True

    @classmethod
    def load_share(cls, coefficients: Sequence[float] | np.ndarray, constants: dict[str, float]
                   ) -> dict[str, float]:
        """Return slope in A per rad and what it amounts to at position zero."""
        return {'slope': coefficients[0], 'offset': -coefficients[0] * constants['position']}

    def describe(self) -> str:
        """Return the effect in words."""
        return f'Spring-like: {self.coefficients[0]:+.3g} A per rad'

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·(q {-self.values["position"]:+.4g})'
