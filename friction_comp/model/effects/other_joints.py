# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of the rest of the arm, by its rigid bodies or by terms found without them."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES, SearchRange

if TYPE_CHECKING:
    from friction_comp.model.effects.scene import Scene, Signals


class RigidBody(Effect):
    """``k·τ(q, dq/dt, d²q/dt²)``: weight and inertia of all links, from a URDF.

    The torque τ in N·m is that of the model's arm; k is the joint's current per torque. Fed back is
    the weight alone: accelerations from encoders come too late and too noisy.
    """

    name = 'rigid_body'
    numbers = (('current per torque', 'A/(N·m)'),)
    variable = 'other joints'
    role = CARRIES
    needs = ('rigid_body',)
    signs = (1,)
    physics = weight = True

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return the torque."""
        return (x.rigid_body,)

    def describe(self) -> str:
        """Return the effect in words."""
        return (f'Weight and inertia of the whole arm: {self.coefficients[0]:.4g} A per N·m that '
                'its links ask of the joint')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·τ_links'


class CarriedLoadFriction(Effect):
    """``A·tanh(v/v_t)·|τ|^p``: friction that grows with the links' torque on the teeth.

    The same as friction that grows with a measured load, where the load is known of the model.
    """

    name = 'carried_load_friction'
    numbers = (('friction at 1 N·m', 'A'),)
    variable = 'load'
    needs = ('rigid_body',)
    constants = {'exponent': SearchRange(1.6), 'transition': None}
    signs = (1,)

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{'exponent': exponent, 'transition': scene.transition} for exponent in (1.0, 2.0)]

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float], scene: Scene) -> float:
        """Keep the power where it is one of a load: below, it is Coulomb friction once more."""
        return min(max(value, 0.5), 3.0) if name == 'exponent' else value

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return one column."""
        return (x.side * abs(x.rigid_body) ** c.exponent,)

    def describe(self) -> str:
        """Return the effect in words."""
        return (f'Load-dependent friction: {self.coefficients[0]:+.4g} A at 1 N·m that the links '
                f'ask of the joint, growing with its power {self.values["exponent"]:.3g}')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return (f'{self.coefficients[0]:+.4g}·tanh(v/{self.values["transition"]:.3g})'
                f'·|τ_links|^{self.values["exponent"]:.3g}')


class OtherJoints(Effect):
    """The current due to the motion of other joints, found without a URDF."""

    name = 'other_joints'
    variable = 'other joints'
    role = CARRIES
    needs = ('coupling',)
    signs = (1,)
    weight = True

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """There is nothing to search."""
        return [{}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        """Return the current."""
        return (x.coupling,)

    def describe(self) -> str:
        """Return the effect in words."""
        return ('Other joints: weight and inertia that hang from this joint through them, as a sum '
                f'of terms found in the recording, times {self.coefficients[0]:.4g}')

    def formula(self) -> str:
        """Return the formula with its numbers."""
        return f'{self.coefficients[0]:+.4g}·i_other_joints'
