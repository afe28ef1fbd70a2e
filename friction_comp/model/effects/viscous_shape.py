# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Viscous friction that is not proportional to speed."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import SearchRange, speed_hardly_varied

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals


class ViscousShape(Effect):
    """``A·tanh(v/v_t)·(u^p - 6p/((p+1)(p+2))·u)``, u = |v|/v_ref: friction is curved over speed.

    The straight line nearest to u^p between standstill and v_ref is subtracted, so that the linear
    term of the sigmoid does not change. Beyond the recorded speeds the effect is constant, and
    friction continues along that line. Without the subtraction, the linear term would be fitted
    against the power, and could by itself be many times too steep.
    """

    name = 'viscous_shape'
    numbers = (('size at the reference speed', 'A'),)
    variable = 'velocity'
    held = {'velocity': 0.25}
    constants = {'exponent': SearchRange(1.3), 'reference': None, 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """Exponents below and above one."""
        return [{'exponent': exponent, 'reference': scene.speed,
                 'transition': scene.transition}
                for exponent in (0.3, 0.45, 0.6, 0.75, 1.4, 1.7, 2.0, 2.5, 3.0)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        speed = abs(x.velocity) / c.reference
        slope = 6.0 * c.exponent / ((c.exponent + 1.0) * (c.exponent + 2.0))
        return (x.side * (speed ** c.exponent - slope * speed),)

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a speed that hardly varies shows nothing of it."""
        return speed_hardly_varied(scene)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Next to one it is the linear term once more, and the two grow against each other.

        Below a fifth it is Coulomb friction once more, above three and a half a few fast samples.
        """
        if name == 'exponent' and 0.85 < value < 1.2:
            return 0.85 if value < 1.0 else 1.2
        return min(max(value, 0.2), 3.5) if name == 'exponent' else value

    def describe(self) -> str:
        """Return the effect in words."""
        gain, exponent = self.coefficients[0], self.values['exponent']
        bends = 'sub-linearly' if (gain > 0) == (exponent < 1) else 'super-linearly'
        return (f'Viscous shape: friction grows {bends} with speed '
                f'(power {exponent:.3g} beside the linear term)')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        c = self.values
        exponent, speed = c['exponent'], f'|v|/{c["reference"]:.3g}'
        slope = 6.0 * exponent / ((exponent + 1.0) * (exponent + 2.0))
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{c["transition"]:.3g})'
                f'·(({speed})^{exponent:.3g} - {slope:.3g}·{speed})')
