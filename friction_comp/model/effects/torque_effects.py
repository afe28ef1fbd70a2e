# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques on the joint (weight, springs, inertia, the arm, a load), and friction by their load."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.effects.base import (
    CARRIES,
    Coverage,
    Effect,
    NEITHER,
    SearchRange,
    Signals,
    turns_often,
)

# Parts of the load that other effects put on the gear.
_LOADS = ('cosine', 'sine', 'slope', 'offset', 'inertia')


def _range_too_short(coverage: Coverage) -> str:
    if coverage.linear:
        return 'The axis is linear: what a weight holds is part of the offset.'
    return '' if coverage.span >= 0.5 else (
        f'Position covered {coverage.span:.3g} rad only: offset and spring contain what a weight '
        'holds there, and slow ripple cannot be seen.')


class Gravity(Effect):
    """``A·cos(q) + B·sin(q)``, independent of the direction of motion."""

    name = 'gravity'
    coefficient_names = (('part with the cosine of position', 'A'),
                         ('part with the sine of position', 'A'))
    variable = 'position'
    role = CARRIES
    in_first_model = weight = gives_load = True
    range_margins = {'position': np.inf}
    shown_by = (_range_too_short,)
    summary = ('Gravity-like: {size:.3g} A once a turn, largest at a joint angle of {angle:.0f} '
               'degrees')
    equation = '{A:+.5g}·cos(q) {B:+.5g}·sin(q)'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (np.cos(x.position), np.sin(x.position))

    @classmethod
    def determines_offset(cls, coverage: Coverage) -> bool:
        # Over a part of a turn gravity is largely a constant.
        return coverage.span < 2.0

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'cosine': coefficients[0], 'sine': coefficients[1]}


class Spring(Effect):
    """``A·(q - q0)``, independent of the direction of motion, as of a spring or a cable."""

    name = 'spring'
    coefficient_names = (('stiffness', 'A/rad'),)
    variable = 'position'
    role = CARRIES
    in_first_model = gives_load = True
    range_margins = {'position': 0.25}
    constants = {'position': None}
    # One is enough: the offset of Eq. 6 accounts for any other rest position.
    tried = {'position': lambda coverage: (0.5 * (coverage.lowest + coverage.highest),)}
    shown_by = (turns_often,)
    summary = 'Spring-like: {A:+.3g} A per rad'
    equation = '{A:+.5g}·(q - {position:.5g})'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.position - c.position,)

    @classmethod
    def determines_offset(cls, coverage: Coverage) -> bool:
        return True

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'slope': coefficients[0], 'offset': -coefficients[0] * constants['position']}

    def doubt(self) -> str:
        return '' if self.coefficients[0] >= 0.0 else (
            f'The spring of {self.coefficients[0]:.3g} A per rad pushes away from its middle, as '
            'no spring does: it stands for a weight or for other links, and only in positions like '
            'the recorded ones.')


class Inertia(Effect):
    """``J/(k_t·n)·dv/dt``: inertia of motor, gear and limb."""

    name = 'inertia'
    coefficient_names = (('inertia', 'A·s²/rad'),)
    variable = 'acceleration'
    role = CARRIES
    needs = ('acceleration',)
    signs = (1,)
    in_first_model = True
    not_fed_back = (
        'acceleration from the encoder is too late and too noisy: fed back it would lower the '
        'apparent inertia and can destabilise the joint')
    summary = 'Inertia: {A:.4g} A per rad/s²'
    equation = '{A:+.5g}·dv/dt'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.acceleration,)

    @classmethod
    def load_share(cls, coefficients: Sequence[float], constants: dict[str, float]
                   ) -> dict[str, float]:
        return {'inertia': coefficients[0]}


class RigidBody(Effect):
    """``k·τ(q, dq/dt, d²q/dt²)``: weight and inertia of all links, from a URDF.

    k is the joint's current per torque of the arm. Only the weight is fed back.
    """

    name = 'rigid_body'
    coefficient_names = (('current per torque', 'A/(N·m)'),)
    variable = 'other joints'
    role = CARRIES
    needs = ('rigid_body',)
    signs = (1,)
    in_first_model = weight = True
    summary = ('Weight and inertia of the whole arm: {A:.4g} A per N·m of torque that its links '
               'need at the joint')
    equation = '{A:+.5g}·τ_links'

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
    summary = ('Other joints: weight and inertia that act on this joint through them, as a sum of '
               'terms found in the recording, times {A:.4g}')
    equation = '{A:+.5g}·i_other_joints'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.coupling,)


class LoadTorque(Effect):
    """``A·τ_b``: the current that the measured torque saves the motor; by mechanics -1/(k_t·n)."""

    name = 'load_torque'
    coefficient_names = (('current per load', 'A/(N·m)'),)
    variable = 'load'
    role = NEITHER
    in_first_model = True
    needs = ('load',)
    not_fed_back = (
        'feeding the measured interaction torque back is admittance control, which this '
        'compensator is not: the torque sensor is for evaluation only')
    summary = 'Load: {A:+.4g} A per N·m of measured back-driving torque'
    equation = '{A:+.5g}·τ_b'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.load,)

    @classmethod
    def known_coefficients(cls, drive: Drive) -> list[float]:
        return [-1.0 / drive.torque_per_current]


class LoadFriction(Effect):
    """``A·tanh(v/v_t)·|τ_b|^p``: friction that grows with the measured load on the teeth."""

    name = 'load_friction'
    coefficient_names = (('friction at 1 N·m', 'A'),)
    variable = 'load'
    needs = ('load',)
    signs = (1,)
    range_margins = {'load': 0.25}
    # With a lower power it would be Coulomb friction.
    constants = {'exponent': SearchRange(1.6, limits=lambda *_: (0.3, 3.0)), 'transition': None}
    tried = {'exponent': (1.0, 2.0)}
    summary = ('Load-dependent friction: {A:+.4g} A at 1 N·m of load, growing with its power '
               '{exponent:.3g}')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·|τ_b|^{exponent:.5g}'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.sign * abs(x.load) ** c.exponent,)


class CarriedLoadFriction(LoadFriction):
    """``A·tanh(v/v_t)·|τ|^p``: as `LoadFriction`, with the links' torque by the model as load."""

    name = 'carried_load_friction'
    needs = ('rigid_body',)
    range_margins = {}
    constants = {'exponent': SearchRange(1.6, limits=lambda *_: (0.5, 3.0)), 'transition': None}
    summary = LoadFriction.summary.replace('of load', 'that the links need at the joint')
    equation = LoadFriction.equation.replace('τ_b', 'τ_links')

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.sign * abs(x.rigid_body) ** c.exponent,)


def _speed_of_fading(coverage: Coverage, constants: dict[str, float]) -> tuple[float, float]:
    """Return the limits of the fading speed; without fading, the constant is not searched."""
    return (coverage.slowest, 2.0 * coverage.speed) if constants['fading'] else (
        constants['velocity'], constants['velocity'])


class InnerLoadFriction(Effect):
    """``A·tanh(v/v_t)·|L|^p``, fading with speed where `fading` is 1: load-dependent friction.

    L is the current of the other effects of the model that carry a load: gravity, springs, inertia.
    The constants repeat that load, so that the effect can be evaluated alone; a fit keeps them
    equal to those of the model. p = 1 and 2 are the linear and the quadratic load dependence, and
    ``fading`` the Stribeck one, exp(-|v|/v_s), of Duclusaud et al. 2025 (BAM, models M3 to M6).
    Live, the load is that at rest, since accelerations are too late.
    """

    name = 'inner_load_friction'
    coefficient_names = (('friction per load', 'A per A'),)
    variable = 'load'
    uses_inner_load = True
    max_count = 2
    signs = (1,)
    constants = {**dict.fromkeys(_LOADS), 'with_inertia': None, 'exponent': None, 'fading': None,
                 'velocity': SearchRange(1.6, limits=_speed_of_fading), 'transition': None}
    summary = ('Load-dependent friction: {A:.3g} A of friction for 1 A (to the power {exponent:g}) '
               'of the load that gravity or a spring makes')
    equation = ('{A:+.5g}·tanh(v/{transition:.5g})·|{cosine:+.5g}·cos(q) {sine:+.5g}·sin(q) '
                '{slope:+.5g}·q {offset:+.5g} {of_inertia:+.5g}·dv/dt|^{exponent:g}')
    factors = {'fading': '·exp(-|v|/{velocity:.5g})'}

    @classmethod
    def grid(cls, coverage: Coverage) -> list[dict[str, float]]:
        fading = np.geomspace(0.05 * coverage.speed, coverage.speed, 4).tolist()
        shapes = [(1.0, 0.0, coverage.speed), (2.0, 0.0, coverage.speed),
                  *((1.0, 1.0, value) for value in fading)]
        return [{**dict.fromkeys(_LOADS, 0.0), 'with_inertia': with_inertia, 'exponent': exponent,
                 'fading': fading, 'velocity': velocity}
                for exponent, fading, velocity in shapes for with_inertia in (0.0, 1.0)]

    @classmethod
    def with_loads(cls, constants: dict[str, float],
                   shares: Iterable[dict[str, float]]) -> dict[str, float]:
        total = dict.fromkeys(_LOADS, 0.0)
        for share in shares:
            for name, value in share.items():
                total[name] += float(value)
        return {**constants, **total}

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        load = (c.cosine * np.cos(x.position) + c.sine * np.sin(x.position)
                + c.slope * x.position + c.offset + c.with_inertia * c.inertia * x.acceleration)
        fade = np.exp(-c.fading * np.minimum(abs(x.velocity) / c.velocity, 700.0))
        return (x.sign * abs(load) ** c.exponent * fade,)

    def symbols(self) -> dict[str, Any]:
        return {**super().symbols(),
                'of_inertia': self.values['with_inertia'] * self.values['inertia']}
