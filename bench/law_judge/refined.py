# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Gears with one effect beside Eq. 6, strong enough to matter, and in their models too."""

import math

import numpy as np

from law_judge.model import REFERENCE_TEMPERATURE, SPEEDS, true_models
from world.gear import truth
from world.gear.gears import draw_gears, KINDS, set_presliding
from world.gear.state import BOUC_WEN, DAHL, LUGRE
from world.gear.truth import steady_friction
from world.persons import log_uniform

REFINED = ('with_gravity', 'with_cogging', 'with_friction_ripple', 'with_temperature',
           'with_load_friction', 'with_stribeck', 'with_hysteresis')


def draw_refined(kind, draws, seed, repetitions):
    """Return gears of all kinds of friction with one effect, and documents of their models."""
    random = np.random.default_rng([seed, 1000 + REFINED.index(kind)])
    gears = np.concatenate([
        draw_gears(KINDS[(k + REFINED.index(kind)) % len(KINDS)], 1, seed + 2 * k)
        for k in range(draws)])
    effects = [_EFFECTS[kind](gear, random) for gear in gears]
    documents = true_models(truth, gears, seed, repetitions)
    for gear, document, (name, parameters) in zip(gears, documents, effects):
        sigmoid = document['sigmoid']['coefficients']
        transition = 2.0 / sigmoid[1]
        if name == 'stribeck':
            _split_stribeck(gear, sigmoid)
        elif name == 'hysteresis':
            _split_hysteresis(gear, sigmoid)
        if 'transition' in parameters:
            parameters['transition'] = transition
        document['effects'] = [{'name': name, 'parameters': parameters}]
    return gears, documents


def _split_stribeck(gear, sigmoid):
    """Let the sigmoid hold what is left beside the Stribeck term."""
    flat = gear.copy()
    flat['static'] = flat['coulomb']
    for k, side in ((0, 1.0), (2, -1.0)):
        sigmoid[5], sigmoid[k] = np.polyfit(SPEEDS, steady_friction(flat, SPEEDS, side), 1)


def _split_hysteresis(gear, sigmoid):
    """Let the sigmoid hold what turns round at once."""
    level = float(gear['link_coulomb']) / gear['torque_per_current']
    sigmoid[0] -= level
    sigmoid[2] -= level


def _breakaway(gear):
    return gear['static'] + gear['link_coulomb']


def _gravity(gear, random):
    gear['gravity'] = random.uniform(0.3, 1.5) * _breakaway(gear)
    gear['gravity_phase'] = random.uniform(-math.pi, math.pi)
    size = gear['gravity'] / gear['torque_per_current']
    phase = gear['gravity_phase']
    return 'gravity', {'coefficients': [size * math.cos(phase), size * math.sin(phase)]}


def _cogging(gear, random):
    gear['cogging'] = random.uniform(0.1, 0.3) * gear['coulomb']
    gear['cogging_frequency'] = random.choice([20.0, 60.0, 100.0])
    size = -gear['cogging'] / gear['torque_per_current']
    phase = gear['cogging_phase']
    return 'cogging', {
        'coefficients': [size * math.cos(phase), -size * math.sin(phase)], 'transition': 1.0,
        'frequency': float(gear['cogging_frequency']), 'growth': 0.0, 'speed': 1.0}


def _friction_ripple(gear, random):
    gear['ripple'] = random.uniform(0.1, 0.3)
    gear['ripple_frequency'] = random.choice([2.0, 20.0, 60.0])
    size = gear['ripple'] * gear['coulomb'] / gear['torque_per_current']
    phase = gear['ripple_phase']
    return 'friction_ripple', {
        'coefficients': [size * math.cos(phase), -size * math.sin(phase)], 'transition': 1.0,
        'frequency': float(gear['ripple_frequency']), 'growth': 0.0, 'speed': 1.0}


def _temperature(gear, random):
    gear['heating'], gear['heating_time'] = random.uniform(10.0, 25.0), random.uniform(2.0, 10.0)
    gear['warming'] = -random.uniform(0.005, 0.016)  # friction falls with temperature
    per = gear['warming'] / gear['torque_per_current']
    return 'temperature', {
        'coefficients': [per * gear['coulomb'], per * gear['viscous'], 0.0], 'transition': 1.0,
        'reference_temperature': REFERENCE_TEMPERATURE}


def _load_friction(gear, random):
    gear['load_friction'] = random.uniform(0.05, 0.15)
    return 'load_friction', {
        'coefficients': [gear['load_friction'] / gear['torque_per_current']], 'transition': 1.0,
        'exponent': 1.0}


def _stribeck(gear, random):
    if gear['friction'] in (DAHL, BOUC_WEN):
        gear['friction'] = LUGRE
        set_presliding(gear, random)
    gear['static'] = gear['coulomb'] * random.uniform(1.3, 1.8)
    gear['stribeck_velocity'] = math.radians(log_uniform(random, 2.0, 15.0))
    size = (gear['static'] - gear['coulomb']) / gear['torque_per_current']
    return 'stribeck', {
        'coefficients': [size], 'velocity': float(gear['stribeck_velocity']),
        'exponent': float(gear['stribeck_exponent']), 'transition': 1.0}


def _hysteresis(gear, random):
    gear['link_coulomb'] = random.uniform(0.2, 0.5) * gear['coulomb']
    gear['link_bristle'] = log_uniform(random, 5e-3, 3e-2)
    for name in ('coulomb', 'static'):
        gear[name] -= gear['link_coulomb']
    return 'hysteresis', {
        'coefficients': [gear['link_coulomb'] / gear['torque_per_current'], 0.0],
        'distance': float(gear['link_bristle']), 'exponent': 1.0, 'transition': 1.0}


_EFFECTS = dict(zip(REFINED, (
    _gravity, _cogging, _friction_ripple, _temperature, _load_friction, _stribeck, _hysteresis)))
