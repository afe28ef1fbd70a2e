# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia of motor, gear and limb."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_comp.model.effects.scene import Scene, Signals


class Inertia(Effect):
    """``J/(k_t·n)·dv/dt``."""

    name = 'inertia'
    numbers = (('inertia', 'A·s²/rad'),)
    variable = 'acceleration'
    role = CARRIES
    needs = ('acceleration',)
    signs = (1,)
    physics = True
    not_fed_back = (
        'acceleration from the encoder comes too late and too noisy: fed back it would lower the '
        'apparent inertia and can destabilise the joint')

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return the acceleration."""
        return (x.acceleration,)

    @classmethod
    def load_share(cls, coefficients: Sequence[float] | np.ndarray, constants: dict[str, float]
                   ) -> dict[str, float]:
        """Return the current per acceleration, A·s²/rad."""
        return {'inertia': coefficients[0]}

    def describe(self) -> str:
        """Return the effect in words."""
        return f'Inertia: {self.coefficients[0]:.4g} A per rad/s²'

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·dv/dt'
