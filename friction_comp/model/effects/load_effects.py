# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects of a measured load: it helps or hinders the motor and presses the teeth together."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import NEITHER, SearchRange

if TYPE_CHECKING:
    from friction_comp.drive import Drive
    from friction_comp.model.effects.scene import Scene, Signals


class LoadTorque(Effect):
    """``A·τ_b``: the current that the measured back-driving torque saves the motor.

    By mechanics A = -1/(k_t·n); another value means that the declared torque constant is wrong.
    """

    name = 'load_torque'
    numbers = (('current per load', 'A/(N·m)'),)
    variable = 'load'
    role = NEITHER
    physics = True
    needs = ('load',)
    not_fed_back = (
        'feeding the measured interaction torque back is admittance control, which this '
        'compensator is not: the torque sensor is for evaluation only')

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return the load torque."""
        return (x.load,)

    @classmethod
    def by_mechanics(cls, drive: Drive) -> list[float] | None:
        """Return the motor current that 1 N·m of load replaces, -1/(k_t·n)."""
        return [-1.0 / drive.torque_per_current]

    def describe(self) -> str:
        """Return the effect in words."""
        return f'Load: {self.coefficients[0]:+.4g} A per N·m of measured back-driving torque'

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·τ_b'


class LoadFriction(Effect):
    """``A·tanh(v/v_t)·|τ_b|^p``: friction that grows with the load on the teeth."""

    name = 'load_friction'
    numbers = (('friction at 1 N·m', 'A'),)
    variable = 'load'
    needs = ('load',)
    signs = (1,)
    held = {'load': 0.25}
    constants = {'exponent': SearchRange(1.6), 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{'exponent': exponent, 'transition': scene.transition} for exponent in (1.0, 2.0)]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        return (x.side * abs(x.load) ** c.exponent,)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Keep the power that of a load: below, it is Coulomb friction once more."""
        return min(max(value, 0.3), 3.0) if name == 'exponent' else value

    def describe(self) -> str:
        """Return the effect in words."""
        return (f'Load-dependent friction: {self.coefficients[0]:+.4g} A at 1 N·m of load, growing '
                f'with its power {self.values["exponent"]:.3g}')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{self.values["transition"]:.3g})'
                f'·|τ_b|^{self.values["exponent"]:.3g}')
