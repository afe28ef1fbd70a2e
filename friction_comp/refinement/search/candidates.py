# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The best version of each effect for a residual: its constants found by search."""

from __future__ import annotations

import math

import numpy as np

from friction_comp.model.differentiation import delayed, earlier
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.fit.effect_sum import solve, Term
from friction_comp.refinement.search.spectrum import highest_frequency, peaks, position_spectrum

_COARSE_ROWS = 4000
_PEAKS = 4
# No more than so many of the same effect with other constants.
_MOST_OF_A_KIND = {'cogging': 4, 'friction_ripple': 4, 'bump': 3}
# Where the sign of the one coefficient is a matter of physics.
_POSITIVE = ('inertia', 'hysteresis', 'rest_time')


def kinds_for(data, terms):
    """Return the effects that can be tried beside some terms: those that have their signals."""
    present = [term.kind.name for term in terms]
    if data.load_coefficient:
        present.append('load_torque')
    kinds = []
    for name, kind in EFFECTS.items():
        if any(getattr(data.samples, signal) is None for signal in kind.needs):
            continue
        if present.count(name) >= _MOST_OF_A_KIND.get(name, 1):
            continue
        kinds.append(kind)
    return kinds


def best_term(fit, kind):
    """Return the term of a kind that lowers the error on the fitted rows most.

    Returns
    -------
    Term or None
        None where the data offer nothing to search.
    """
    every = max(1, len(fit.index) // _COARSE_ROWS)
    if 'frequency' in kind.constants:
        points = _ripples(fit, kind)
    else:
        points = [(Term(kind, constants), every) for constants in kind.grid(fit.data.scene)]
    best, best_gain = None, 0.0
    for term, coarse in points:
        gain = fit.gain(term, coarse)
        if gain > best_gain:
            best, best_gain = term, gain
    if best is None:
        return None
    best, _ = fit.search(best)
    return best


def plausible(fit):
    """Tell whether the last term's coefficient has the sign that physics asks for."""
    last = fit.terms[-1]
    if last.kind.name == 'actuation_lag':
        # A fraction of a sample is how the signals were sampled, no effect.
        return abs(last.constants['lag']) > 0.7 * fit.data.scene.sample_time
    if last.kind.name not in _POSITIVE:
        return True
    return fit.coefficients[-fit.parts[-1].shape[1]] > 0


def _ripples(fit, kind):
    data, scene = fit.data, fit.data.scene
    index = fit.index
    samples = fit.samples
    highest = highest_frequency(samples, data.usable, scene, data.window)
    position = samples.position[index]
    residual = fit.residual[index] * fit.weights
    separation = 2.0 * math.pi / max(scene.highest - scene.lowest, 1e-9)
    taken = [term.constants['frequency'] for term in fit.terms if term.kind is kind]
    points = []
    for growth in (0.0, 1.0):
        constants = {'growth': growth, 'speed': scene.speed, 'transition': scene.transition}
        weight = kind._amplitude(samples.velocity[index], growth, scene.speed, scene.transition)
        k, power = position_spectrum(position, residual, weight * fit.weights, highest)
        near = np.zeros(len(k), dtype=bool)
        for other in taken:
            near |= np.abs(k - other) < 0.5 * separation
        for frequency in peaks(k[~near], power[~near], _PEAKS, separation):
            points.append((Term(kind, {'frequency': frequency, **constants}), 1))
    return points


def lags(fit, kind):
    """Return the best lag of each of its forms: a delay, and a low pass either way.

    Returns
    -------
    list of Term or None
        None where a form does not help.
    """
    every = max(1, len(fit.index) // _COARSE_ROWS)
    index, weights = fit.index[::every], fit.weights[::every]
    goal = fit.target[index]

    def error(matrix):
        inner = matrix[index]
        residual = goal - inner @ solve(inner, goal, weights)
        return float(weights @ residual ** 2)
    matrix = np.hstack(fit.parts)
    without = error(matrix)
    best = dict.fromkeys((0.0, 1.0, -1.0), (None, without))
    for constants in kind.grid(fit.data.scene):
        lag, side = constants['lag'], constants['first_order']
        if side:
            trial = delayed(matrix, fit.samples, side * lag)
        else:
            trial = earlier(matrix, fit.samples, lag)
        size = error(trial)
        if size < best[side][1]:
            best[side] = (Term(kind, constants), size)
    return [term for term, _ in best.values()]
