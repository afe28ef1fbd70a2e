# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The model of a gear that a perfect identification would write, and such a model made wrong.

Eq. 6 is fitted to the world's own steady friction; breakaway is what its own slow ramps find.
"""

import math

import numpy as np
from scipy.optimize import minimize

from friction_comp import FrictionModel

DEGREE = math.pi / 180.0
SPEEDS = np.array([1, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 50, 60, 70, 80, 90, 100]) * DEGREE
# A model's transition cannot be sharper than the slowest speed of identification shows.
STEEPEST = 4.0 / SPEEDS[0]
REFERENCE_TEMPERATURE = 25.0
# How sure a model says that its presliding is, as a share; what identification is off by.
STD = 0.1
SEEN = 3.0   # the least backlash that a model knows, counts; see identification/ramp_evaluation.py


def fit_sigmoid(speeds, currents):
    """Return level, steepness and viscous slope of Eq. 6 by Eq. 7, the same both ways."""
    def error(x):
        level, steepness, viscous = np.exp(x)
        steepness = min(steepness, STEEPEST)
        return np.sum(np.abs(level * np.tanh(0.5 * steepness * speeds) + viscous * speeds
                             - currents))
    slope, level = np.polyfit(speeds[3:], currents[3:], 1)
    start = np.log([max(level, 1e-6), 0.8 * STEEPEST, max(slope, 1e-4 * level)])
    found = minimize(error, start, method='Nelder-Mead',
                     options={'xatol': 1e-5, 'fatol': 1e-9, 'maxiter': 2000}).x
    level, steepness, viscous = np.exp(found)
    return level, min(steepness, STEEPEST), viscous


def true_models(world, gears, seed, repetitions):
    """Return the documents of the model files of gears, shape (J,), as `scaled` takes them.

    Every other one knows its presliding distance, and its backlash if the encoder shows it.

    `gears`: ndarray, shape (J,). `seed`, `repetitions`: of slow ramps.
    """
    currents = world.breakaway_currents(gears, seed, repetitions)
    documents = []
    for k, (gear, measured) in enumerate(zip(gears, currents)):
        tables = [world.steady_friction(gear, SPEEDS, side) for side in (1.0, -1.0)]
        level, steepness, viscous = fit_sigmoid(SPEEDS, np.mean(tables, axis=0))
        more = float(np.mean(tables[0] - tables[1])) / 2.0
        sigmoid = [level + more, steepness, level - more, 1.0, 1.0, viscous]
        written = document(gear, sigmoid, (measured[::2], measured[1::2]), tables)
        distance, scatter = world.presliding(gear)
        if k % 2 == 1 and np.isfinite(distance):
            written['presliding'] = {'distance': float(distance),
                                     'std': math.hypot(STD * float(distance), scatter)}
            if 'backlash' in gears.dtype.names and gear['backlash'] >= SEEN * gear['resolution']:
                written['presliding']['backlash'] = float(gear['backlash'])
        documents.append(written)
    return documents


def document(gear, sigmoid, ramps, tables):
    """Return a model file's plain values of what was measured in both directions."""
    ratio = 100.0  # only products with the ratio matter to a law
    return {
        'format': 'friction_comp_model', 'version': 1, 'joint': 'judged',
        'drive': {'torque_constant': float(gear['torque_per_current'] / ratio),
                  'gear_ratio': ratio,
                  'encoder_counts': round(2.0 * math.pi / gear['resolution'] / ratio),
                  'current_limit': float(gear['current_limit'])},
        'sigmoid': {'coefficients': [float(c) for c in sigmoid], 'velocity_unit': 'rad/s'},
        'breakaway': {
            name: {'mean': sign * float(np.mean(found)), 'std': float(np.std(found, ddof=1))}
            for name, sign, found in zip(('positive', 'negative'), (1.0, -1.0), ramps)},
        'effects': [],
        'lookup_table': {
            'speeds': [*(-SPEEDS[::-1]).tolist(), *SPEEDS.tolist()],
            'currents': [*(-tables[1][::-1]).tolist(), *tables[0].tolist()],
            'standard_deviations': [0.01 * float(np.mean(ramps))] * (2 * len(SPEEDS))},
    }


def scaled(document, kinetic=1.0, breakaway=None):
    """Return the model with its friction times a factor, as an error of identification.

    `breakaway`: `kinetic` when omitted.
    """
    if breakaway is None:
        breakaway = kinetic
    new = dict(document)
    c = list(document['sigmoid']['coefficients'])
    for k in (0, 2, 5):
        c[k] *= kinetic
    new['sigmoid'] = {**document['sigmoid'], 'coefficients': c}
    # A model of a recording has no table, and not always breakaway.
    if 'breakaway' in document:
        new['breakaway'] = {
            side: {'mean': entry['mean'] * breakaway, 'std': entry['std']}
            for side, entry in document['breakaway'].items()}
    if 'lookup_table' in document:
        table = document['lookup_table']
        new['lookup_table'] = {**table, 'currents': [kinetic * i for i in table['currents']]}
    new['effects'] = [scaled_effect(effect, kinetic) for effect in document['effects']]
    return FrictionModel.from_dict(new)


def scaled_effect(effect, factor):
    """Return an effect's entry with its friction times a factor; what carries a load stays."""
    if effect['name'] in ('gravity', 'cogging'):
        return effect
    parameters = dict(effect['parameters'])
    parameters['coefficients'] = [factor * c for c in parameters['coefficients']]
    return {**effect, 'parameters': parameters}
