# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction that is not the same in both directions."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.model.effects.base import Effect

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals


class DirectionAsymmetry(Effect):
    """``A·h + B·|v|``: half the difference between the positive and the negative direction.

    A is what differs at low speed, B what differs per speed. Where `offset` is 1, h is 1: a
    constant current that is there at rest as well. Where it is 0, h = tanh²(v/v_t): Coulomb
    friction that differs between the directions of motion. The sigmoid of Eq. 6 can hold A
    itself; refinement moves it here where it is worth a name.
    """

    name = 'direction_asymmetry'
    numbers = (('half the difference of Coulomb friction', 'A'),
               ('half the difference of viscous friction', 'A·s/rad'))
    variable = 'direction'
    constants = {'offset': None, 'transition': None}

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{'offset': 1.0, 'transition': scene.transition}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return two columns, even in the velocity."""
        return (1.0 if c.offset else x.side ** 2, abs(x.velocity))

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        """Return why motion in one direction shows nothing of it."""
        if scene.both_directions:
            return ''
        return ('Motion was in one direction only: differences between directions, constant '
                'offsets and reversals cannot be seen.')

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """It is where an offset of the sigmoid belongs."""
        return True

    @classmethod
    def live_constants(cls, values: dict[str, float]) -> dict[str, float]:
        """At standstill it is zero, for breakaway has its own two values there."""
        return {**super().live_constants(values), 'offset': 0.0}

    def describe(self) -> str:
        """Return the effect in words."""
        a, b = self.coefficients
        return (f'Direction: the positive direction needs {2 * a:+.3g} A {2 * b:+.3g} A per rad/s '
                'more than the negative one')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        a, b = self.coefficients
        shape = '' if self.values['offset'] else f'·tanh²(v/{self.values["transition"]:.3g})'
        return f'{a:+.4g}{shape} {b:+.4g}·|v|'
