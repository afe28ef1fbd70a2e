# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that changes with the motor's temperature."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.model.effects.base import Effect

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals


class Temperature(Effect):
    """``(A·s + B·v + C·s²)·(T - T0)``, s = tanh(v/v_t): friction changes with temperature.

    A is Coulomb and B viscous friction; C is for directions that change differently.
    """

    name = 'temperature'
    numbers = (('Coulomb friction per kelvin', 'A/K'),
               ('viscous friction per kelvin', 'A·s/(rad·K)'),
               ('offset per kelvin', 'A/K'))
    variable = 'temperature'
    needs = ('temperature',)
    # Friction falls almost linearly over tens of kelvin, so it is extrapolated to twice the range
    # seen.
    held = {'temperature': 1.0}
    constants = {'reference_temperature': None, 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """The reference is a convention: the median temperature of the recordings."""
        return [{'reference_temperature': scene.temperature, 'transition': scene.transition}]

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why a temperature that hardly changes shows nothing of it."""
        if scene.temperature_span >= 2.0:
            return ''
        return 'Motor temperature varied by less than 2 °C: its effect cannot be seen.'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return three columns."""
        difference = x.temperature - c.reference_temperature
        return (x.side * difference, x.velocity * difference, x.side * x.side * difference)

    def describe(self) -> str:
        """Return the effect in words."""
        a, b, _ = self.coefficients
        return (f'Temperature: per kelvin Coulomb friction changes by {a:+.3g} A and viscous '
                f'friction by {b:+.3g} A per rad/s')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        a, b, even = self.coefficients
        c = self.values
        return (f'({a:+.4g}·s {b:+.4g}·v {even:+.4g}·s²)·(T - {c["reference_temperature"]:.3g}), '
                f's = tanh(v/{c["transition"]:.3g})')
