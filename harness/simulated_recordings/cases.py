# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Undeclared effects of random strength, and the recording under which each can be seen."""

from __future__ import annotations

import math
from typing import NamedTuple


class Case(NamedTuple):
    """One kind of undeclared effect.

    `variable`: what it depends on, as `friction_comp.model.effect.Effect.variable`. `name`: of the
    undeclared effect, and `parameters` draws its parameters: f(rng, level), where `level` is the
    drive's friction in N·m. `needs`: what the recording's `Excitation` must have for it.
    """

    variable: str
    name: str
    parameters: callable
    needs: dict = {}

    def draw(self, rng, level):
        """Return the effects as in a file of undeclared effects."""
        return [{'name': self.name, 'parameters': {
            key: float(value) for key, value in self.parameters(rng, level).items()}}]


def _log(rng, low, high):
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def _hysteresis(rng, level):
    torque = level * rng.uniform(0.25, 0.6)
    return {'torque': torque, 'stiffness': torque / _log(rng, 0.03, 0.2)}


def _backlash(rng, level):
    torque, gap = level * rng.uniform(0.25, 0.6), _log(rng, 0.02, 0.1)
    return {'torque': torque, 'gap': gap, 'stiffness': torque / (gap * rng.uniform(0.1, 0.8))}


def _ripple(rng, level):
    return {'amplitude': level * rng.uniform(0.1, 0.3), 'frequency': _log(rng, 8.0, 200.0),
            'phase': rng.uniform(-math.pi, math.pi)}


CASES = {
    'stribeck': Case('velocity', 'stribeck', lambda rng, level: {
        'amplitude': level * rng.uniform(0.2, 0.6), 'velocity': _log(rng, 0.03, 0.25),
        'exponent': rng.choice([1.0, 2.0])}),
    'sub_linear': Case('velocity', 'viscous_shape', lambda rng, level: {
        'amplitude': level * rng.uniform(0.4, 0.9), 'velocity': 1.0,
        'exponent': rng.uniform(0.25, 0.5)}),
    'super_linear': Case('velocity', 'viscous_shape', lambda rng, level: {
        'amplitude': level * rng.uniform(0.3, 0.8), 'velocity': 1.0,
        'exponent': rng.uniform(1.8, 2.5)}),
    'direction': Case('direction', 'direction', lambda rng, level: {
        'coulomb': level * rng.uniform(-0.2, 0.2),
        'viscous': level * rng.uniform(0.2, 0.5) * _sign(rng)}),
    'gravity': Case('position', 'gravity', lambda rng, level: {
        'amplitude': level * _log(rng, 0.2, 1.0), 'phase': rng.uniform(-math.pi, math.pi)}),
    'cogging': Case('position', 'cogging', _ripple),
    'friction_ripple': Case('position', 'friction_ripple', _ripple),
    'bump': Case('position', 'bump', lambda rng, level: {
        'amplitude': level * rng.uniform(0.4, 0.9), 'position': rng.uniform(-1.2, 1.2),
        'width': _log(rng, 0.05, 0.2)}),
    'inertia': Case('acceleration', 'inertia', lambda rng, level: {
        'inertia': level * rng.uniform(0.1, 0.4)}),
    'load_friction': Case('load', 'load', lambda rng, level: {
        'coefficient': rng.uniform(0.15, 0.4)}, {'load': 1.0}),
    'torque_constant': Case('load', 'torque_constant', lambda rng, level: {
        'factor': 1.0 + rng.uniform(0.1, 0.25) * _sign(rng)}, {'load': 1.0}),
    'temperature': Case('temperature', 'temperature', lambda rng, level: {
        'coefficient': -rng.uniform(0.008, 0.02), 'reference': 25.0},
        {'temperature': True, 'recordings': 3, 'duration': 80.0}),
    'warm_up': Case('time', 'warm_up', lambda rng, level: {
        'share': rng.uniform(0.2, 0.5), 'time_constant': _log(rng, 15.0, 60.0)}),
    'hysteresis': Case('history', 'hysteresis', _hysteresis),
    'backlash': Case('history', 'backlash', _backlash),
    'rest': Case('history', 'rest', lambda rng, level: {
        'share': rng.uniform(0.3, 0.6), 'time_constant': _log(rng, 0.4, 2.0),
        'distance': _log(rng, 0.05, 0.2)}),
    'actuation_lag': Case('history', 'actuation_lag', lambda rng, level: {
        'lag': rng.uniform(0.012, 0.04)}),
}
