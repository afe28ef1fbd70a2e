# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of the limb, which do not depend on the direction: weight, springs, inertia, the arm."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import CARRIES, Scene, Signals


class Gravity(Effect):
    """``A·cos(q) + B·sin(q)``, independent of the direction of motion."""

    name = 'gravity'
    numbers = (('part with the cosine of position', 'A'), ('part with the sine of position', 'A'))
    variable = 'position'
    role = CARRIES
    physics = weight = gives_load = True
    equation = '{A:+.4g}·cos(q) {B:+.4g}·sin(q)'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (np.cos(x.position), np.sin(x.position))

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """Over a part of a turn gravity is largely a constant."""
        return scene.span < 2.0

    @classmethod
    def insufficient_data(cls, scene: Scene) -> str:
        if scene.span >= 0.5:
            return ''
        return (f'Position covered {scene.span:.3g} rad only: gravity cannot be told from an '
                'offset or a spring, and slow ripple cannot be seen.')

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'cosine': coefficients[0], 'sine': coefficients[1]}

    def describe(self) -> str:
        a, b = self.coefficients
        where = math.degrees(math.atan2(b, a))
        return (f'Gravity-like: {math.hypot(a, b):.3g} A once a turn, largest at a joint angle of '
                f'{where:.0f} degrees')


class Spring(Effect):
    """``A·(q - q0)``, independent of the direction of motion, as a spring or a cable makes."""

    name = 'spring'
    numbers = (('stiffness', 'A/rad'),)
    variable = 'position'
    role = CARRIES
    physics = gives_load = True
    held = {'position': 0.25}
    constants = {'position': None}
    words = 'Spring-like: {A:+.3g} A per rad'

    @classmethod
    def grid(cls, scene: Scene) -> list[dict[str, float]]:
        """The middle of the range stands for where the spring is slack: see the sigmoid."""
        return [{'position': 0.5 * (scene.lowest + scene.highest)}]

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.position - c.position,)

    @classmethod
    def holds_offset(cls, scene: Scene) -> bool:
        """A constant says where the spring is slack."""
        return True

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'slope': coefficients[0], 'offset': -coefficients[0] * constants['position']}

    def formula(self) -> str:
        return f'{self.coefficients[0]:+.4g}·(q {-self.values["position"]:+.4g})'


class Inertia(Effect):
    """``J/(k_t·n)·dv/dt``: inertia of motor, gear and limb."""

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
    words = 'Inertia: {A:.4g} A per rad/s²'
    equation = '{A:+.4g}·dv/dt'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.acceleration,)

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'inertia': coefficients[0]}


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
    words = ('Weight and inertia of the whole arm: {A:.4g} A per N·m that its links ask of the '
             'joint')
    equation = '{A:+.4g}·τ_links'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.rigid_body,)


class OtherJoints(Effect):
    """The current due to the motion of other joints, found without a URDF."""

    name = 'other_joints'
    variable = 'other joints'
    role = CARRIES
    needs = ('coupling',)
    signs = (1,)
    weight = True
    words = ('Other joints: weight and inertia that hang from this joint through them, as a sum '
             'of terms found in the recording, times {A:.4g}')
    equation = '{A:+.4g}·i_other_joints'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.coupling,)
