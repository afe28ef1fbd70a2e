# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction over velocity: Stribeck weakening, curvature, differences between the directions."""

from __future__ import annotations

from typing import Any

import numpy as np

from friction_comp.model.effects.base import Coverage, Effect, SearchRange, Signals


def _speed_hardly_varied(coverage: Coverage) -> str:
    return '' if coverage.speed >= 1.5 * coverage.slow else (
        f'Speed hardly varied ({coverage.slow:.3g} to {coverage.speed:.3g} rad/s): effects of '
        'velocity cannot be seen.')


def _stribeck_speeds(coverage: Coverage) -> np.ndarray:
    lowest = max(1.5 * coverage.transition, 1.5 * coverage.slowest, 0.003 * coverage.speed)
    return np.geomspace(min(lowest, 0.3 * coverage.speed), 0.7 * coverage.speed, 9)


class Stribeck(Effect):
    """``A·tanh(v/v_t)·exp(-(|v|/v_s)^p)``, the second term of the note's Eq. 2 for p = 1."""

    name = 'stribeck'
    fades_in_sliding = True
    coefficient_names = (('height at standstill', 'A'),)
    variable = 'velocity'
    # Near the top speed it would be curved viscous friction; near standstill it cannot be seen.
    constants = {'velocity': SearchRange(1.6, limits=lambda coverage, _: (
        0.5 * coverage.slowest, 0.7 * coverage.speed)), 'exponent': None, 'transition': None}
    tried = {'velocity': _stribeck_speeds, 'exponent': (1.0, 2.0)}
    shown_by = (_speed_hardly_varied,)
    summary = ('Stribeck: near standstill friction differs by {A:+.3g} A, fading at about '
               '{velocity:.3g} rad/s')
    equation = '{A:+.5g}·tanh(v/{transition:.5g})·exp(-(|v|/{velocity:.5g})^{exponent:.5g})'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (x.sign * np.exp(-np.minimum((abs(x.velocity) / c.velocity) ** c.exponent, 700.0)),)


class ViscousShape(Effect):
    """``A·tanh(v/v_t)·(u^p - 6p/((p+1)(p+2))·u)``, u = |v|/v_ref: friction is curved over speed.

    The straight line nearest to u^p up to v_ref is subtracted: otherwise power and linear term
    would partly cancel, and the linear term could be many times too steep. Beyond the recorded
    speeds the effect is constant, and friction continues linearly.
    """

    name = 'viscous_shape'
    coefficient_names = (('size at the reference speed', 'A'),)
    variable = 'velocity'
    range_margins = {'velocity': 0.25}
    # Below a fifth it resembles Coulomb friction; above 3.5, a few fast samples determine it.
    constants = {'exponent': SearchRange(1.3, limits=lambda *_: (0.2, 3.5)), 'reference': None,
                 'transition': None}
    tried = {'exponent': (0.3, 0.45, 0.6, 0.75, 1.4, 1.7, 2.0, 2.5, 3.0),
             'reference': lambda coverage: (coverage.speed,)}
    shown_by = (_speed_hardly_varied,)
    summary = 'Viscous shape: friction is curved over speed (power {exponent:.3g})'
    equation = ('{A:+.5g}·tanh(v/{transition:.5g})·((|v|/{reference:.5g})^{exponent:.5g} - '
                '{slope:.5g}·|v|/{reference:.5g})')

    @staticmethod
    def _slope(exponent: float) -> float:
        return 6.0 * exponent / ((exponent + 1.0) * (exponent + 2.0))

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        speed = abs(x.velocity) / c.reference
        return (x.sign * (speed ** c.exponent - ViscousShape._slope(c.exponent) * speed),)

    @classmethod
    def signs_with(cls, constants: dict[str, float]) -> tuple[int, ...]:
        # A root that is subtracted is Stribeck friction, and endlessly steep at standstill.
        return (1,) if constants['exponent'] < 1.0 else (0,)

    @classmethod
    def limited(cls, name: str, value: float, constants: dict[str, float],
                coverage: Coverage) -> float:
        # At 1, the term is collinear with viscous friction.
        if name == 'exponent' and 0.85 < value < 1.2:
            return 0.85 if value < 1.0 else 1.2
        return super().limited(name, value, constants, coverage)

    def symbols(self) -> dict[str, Any]:
        return {**super().symbols(), 'slope': self._slope(self.values['exponent'])}


class DirectionAsymmetry(Effect):
    """``A·h + B·|v|``: half the difference between the positive and the negative direction.

    If `offset` is 1, h is 1: a constant current, also at rest. If it is 0, h = tanh²(v/v_t):
    Coulomb friction that differs between the directions. Eq. 6 can represent A itself; refinement
    uses this effect instead if it is worth naming.
    """

    name = 'direction_asymmetry'
    coefficient_names = (('half the difference of Coulomb friction', 'A'),
                         ('half the difference of viscous friction', 'A·s/rad'))
    variable = 'direction'
    constants = {'offset': None, 'transition': None}
    tried = {'offset': (1.0,)}
    shown_by = (lambda coverage: '' if coverage.both_directions else (
        'Motion was in one direction only: differences between directions, constant offsets and '
        'reversals cannot be seen.'),)
    summary = ('Direction: half of what the positive direction needs more than the negative one is '
               '{A:+.3g} A {B:+.3g} A per rad/s')
    equation = '{A:+.5g}{shape} {B:+.5g}·|v|'

    @staticmethod
    def columns(x: Signals, c: Any) -> tuple[Any, ...]:
        return (1.0 if c.offset else x.sign ** 2, abs(x.velocity))

    def symbols(self) -> dict[str, Any]:
        sign = f'·tanh(v/{self.values["transition"]:.5g})^2'
        return {**super().symbols(), 'shape': sign * (not self.values['offset'])}

    def fed_back(self) -> DirectionAsymmetry:
        # At rest, breakaway has its own two values.
        return DirectionAsymmetry({**self.parameters, 'offset': 0.0})
