# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Undeclared effects of random strength, and the recording under which each can be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
import math


@dataclass(frozen=True)
class Case:
    """One kind of undeclared effect.

    `variable`: what it depends on, one of `friction_comp.model.effects.VARIABLES`. ``draw(rng,
    level)`` gives the effects as in a file of undeclared effects; `level` is the drive's friction
    in N·m. `needs`: what the recording's `Excitation` must have for it.
    """

    variable: str
    draw: Callable
    needs: dict = field(default_factory=dict)


def _log(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def _effect(name, **parameters):
    return [{'name': name, 'parameters': {key: float(value)
                                          for key, value in parameters.items()}}]


def _stribeck(rng, level):
    return _effect('stribeck', amplitude=level * rng.uniform(0.2, 0.6),
                   velocity=_log(rng, 0.03, 0.25), exponent=rng.choice([1.0, 2.0]))


def _sub_linear(rng, level):
    return _effect('viscous_shape', amplitude=level * rng.uniform(0.4, 0.9),
                   velocity=1.0, exponent=rng.uniform(0.25, 0.5))


def _super_linear(rng, level):
    return _effect('viscous_shape', amplitude=level * rng.uniform(0.3, 0.8),
                   velocity=1.0, exponent=rng.uniform(1.8, 2.5))


def _direction(rng, level):
    return _effect('direction', coulomb=level * rng.uniform(-0.2, 0.2),
                   viscous=level * rng.uniform(0.2, 0.5) * _sign(rng))


def _gravity(rng, level):
    return _effect('gravity', amplitude=level * _log(rng, 0.2, 1.0),
                   phase=rng.uniform(-math.pi, math.pi))


def _ripple(name):
    def draw(rng, level):
        return _effect(name, amplitude=level * rng.uniform(0.1, 0.3),
                       frequency=_log(rng, 8.0, 200.0), phase=rng.uniform(-math.pi, math.pi))
    return draw


def _bump(rng, level):
    return _effect('bump', amplitude=level * rng.uniform(0.4, 0.9),
                   position=rng.uniform(-1.2, 1.2), width=_log(rng, 0.05, 0.2))


def _inertia(rng, level):
    return _effect('inertia', inertia=level * rng.uniform(0.1, 0.4))


def _load_friction(rng, level):
    return _effect('load', coefficient=rng.uniform(0.15, 0.4))


def _torque_constant(rng, level):
    return _effect('torque_constant', factor=1.0 + rng.uniform(0.1, 0.25) * _sign(rng))


def _temperature(rng, level):
    return _effect('temperature', coefficient=-rng.uniform(0.008, 0.02), reference=25.0)


def _warm_up(rng, level):
    return _effect('warm_up', share=rng.uniform(0.2, 0.5), time_constant=_log(rng, 15.0, 60.0))


def _hysteresis(rng, level):
    torque = level * rng.uniform(0.25, 0.6)
    return _effect('hysteresis', torque=torque, stiffness=torque / _log(rng, 0.03, 0.2))


def _backlash(rng, level):
    torque, gap = level * rng.uniform(0.25, 0.6), _log(rng, 0.02, 0.1)
    return _effect('backlash', torque=torque, gap=gap,
                   stiffness=torque / (gap * rng.uniform(0.1, 0.8)))


def _rest(rng, level):
    return _effect('rest', share=rng.uniform(0.3, 0.6), time_constant=_log(rng, 0.4, 2.0),
                   distance=_log(rng, 0.05, 0.2))


def _lag(rng, level):
    return _effect('actuation_lag', lag=rng.uniform(0.012, 0.04))


CASES = {
    'stribeck': Case('velocity', _stribeck),
    'sub_linear': Case('velocity', _sub_linear),
    'super_linear': Case('velocity', _super_linear),
    'direction': Case('direction', _direction),
    'gravity': Case('position', _gravity),
    'cogging': Case('position', _ripple('cogging')),
    'friction_ripple': Case('position', _ripple('friction_ripple')),
    'bump': Case('position', _bump),
    'inertia': Case('acceleration', _inertia),
    'load_friction': Case('load', _load_friction, {'load': 1.0}),
    'torque_constant': Case('load', _torque_constant, {'load': 1.0}),
    'temperature': Case('temperature', _temperature,
                        {'temperature': True, 'recordings': 3, 'duration': 80.0}),
    'warm_up': Case('time', _warm_up),
    'hysteresis': Case('history', _hysteresis),
    'backlash': Case('history', _backlash),
    'rest': Case('history', _rest),
    'actuation_lag': Case('history', _lag),
}
