# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The best version of each effect for a residual: its constants found by search."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any, TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.fit.effect_sum import Term
from friction_comp.refinement.fit.final_fit import mechanical_load
from friction_comp.refinement.fit.robust_regression import side_by_side, solve
from friction_comp.refinement.fit.score_test import ScoreTest
from friction_comp.refinement.search.spectrum import highest_frequency, peaks, position_spectrum

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.model.effects.scene import Scene, Search
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData

# About so many rows tell one point of a grid from another; what is chosen is fitted
# to all of them.
_COARSE_ROWS = 2000
_PEAKS = 4


def kinds_for(data: FitData, terms: list[Term]) -> list[type[Effect]]:
    """Return the effects that can be tried beside some terms: those that have their signals."""
    present = [term.kind for term in terms]
    if data.load_coefficient:
        present.append(mechanical_load())
    kinds = []
    for kind in EFFECTS.values():
        if any(getattr(data.samples, signal) is None for signal in kind.needs):
            continue
        if present.count(kind) >= kind.most or kind.hard_to_tell(data.scene):
            continue
        # A load that a person supplies is what friction asks for, so that whatever the model lacks
        # goes with it.
        if data.load_coefficient and 'load' in kind.needs:
            continue
        if kind.carried and not any(other.gives_load for other in present):
            continue
        kinds.append(kind)
    return kinds


def best_term(fit: Fit, kind: type[Effect]) -> Term | None:
    """Return the term of a kind that lowers the error on the fitted rows most.

    Returns
    -------
    Term or None
        None where the data offer nothing to search.
    """
    best, _ = _on_grid(fit, kind)
    if best is None:
        return None
    return searched(fit, best, max(1, round(len(fit.index) / _COARSE_ROWS)))


def searched(fit: Fit, term: Term, every: int = 1, evaluations: int = 14) -> Term:
    """Return the term with its constants searched around where they are, one after the other."""
    test = ScoreTest(fit, every)
    best, = test.gains([term])
    for name, how in term.kind.constants.items():
        if how is None or how.joint_only:
            continue
        current = term.constants[name]
        low, high, back = bracket(how, current, term.constants, fit.data.scene)

        def loss(x: float, name: str = name, back: Callable[..., Any] | type = back,
                 term: Term = term) -> float:
            value = term.kind.limited(
                name, float(back(x)), term.constants, fit.data.scene)
            return -test.gains([term.with_constants(**{name: value})])[0]
        found = minimize_scalar(loss, bounds=(low, high), method='bounded',
                                options={'maxiter': evaluations, 'xatol': 1e-4 * (high - low)})
        if -found.fun > best:
            best = -found.fun
            value = term.kind.limited(
                name, float(back(found.x)), term.constants, fit.data.scene)
            term = term.with_constants(**{name: value})
    return term


def bracket(how: Search, value: float, constants: dict[str, Any],
            scene: Scene) -> tuple[float, float, Callable[[float], float]]:
    """Return the search interval of a constant and the map from its scale.

    Parameters
    ----------
    how : Search
    value : float
        The constant's value now.
    constants : dict
        All constants of the term.
    scene : Scene
    """
    if how.logarithmic:
        return math.log(value / how.width), math.log(value * how.width), math.exp
    half = how.width * how.unit(scene, constants)
    return value - half, value + half, float


def best_gain(fit: Fit, kind: type[Effect]) -> float:
    """Return by how much the best point of a kind's grid would lower the sum of squares, A²."""
    return _on_grid(fit, kind)[1]


def _on_grid(fit: Fit, kind: type[Effect]) -> tuple[Term | None, float]:
    if kind.spectral:
        terms = _by_spectrum(fit, kind)
        gains = ScoreTest(fit, 1).gains(terms)
    else:
        every = max(1, round(len(fit.index) / _COARSE_ROWS))
        terms, gains = ScoreTest(fit, every).gains_on_grid(kind)
    most = max(gains, default=0.0)
    return (terms[gains.index(most)], most) if most > 0.0 else (None, 0.0)


def _by_spectrum(fit: Fit, kind: type[Effect]) -> list[Term]:
    """Return terms with the frequencies at which the residual swings most over position."""
    data, scene = fit.data, fit.data.scene
    index = fit.index
    samples = fit.samples
    highest = highest_frequency(samples, data.usable, scene, data.window)
    position = samples.position[index]
    residual = fit.left * fit.weights
    separation = 2.0 * math.pi / max(scene.highest - scene.lowest, 1e-9)
    name = kind.spectral
    taken = [term.constants[name] for term in fit.terms if term.kind is kind]
    points = []
    inner = samples.take(index)
    for constants in kind.grid(scene):
        # At frequency zero the first column is the amplitude itself.
        weight = kind.matrix(inner, {**constants, name: 0.0})[:, 0]
        k, power = position_spectrum(position, residual, weight * fit.weights, highest)
        near = np.zeros(len(k), dtype=bool)
        for other in taken:
            near |= np.abs(k - other) < 0.5 * separation
        for frequency in peaks(k[~near], power[~near], _PEAKS, separation):
            points.append(Term(kind, {name: frequency, **constants}))
    return points


def best_forms(fit: Fit, kind: type[Effect]) -> list[Term] | None:
    """Return the best term of each form of an effect that reshapes all others.

    A form is what its constants that are not searched say: a delay or a low pass.

    Returns
    -------
    list of Term or None
        None where a form does not help.
    """
    every = max(1, round(len(fit.index) / _COARSE_ROWS))
    index, weights = fit.index[::every], fit.weights[::every]
    goal = fit.target[index]

    def error(matrix: np.ndarray) -> float:
        inner = matrix[index]
        residual = goal - inner @ solve(inner, goal, weights)
        return float(weights @ residual ** 2)
    matrix = side_by_side(fit.whole)
    without = error(matrix)
    best: dict[tuple[float, ...], tuple[Term | None, float]] = {}
    for constants in kind.grid(fit.data.scene):
        form = tuple(constants[name] for name, how in kind.constants.items() if how is None)
        best.setdefault(form, (None, without))
        size = error(kind.moved(matrix, fit.samples, constants))
        if size < best[form][1]:
            best[form] = (Term(kind, constants), size)
    return [term for term, _ in best.values()]
