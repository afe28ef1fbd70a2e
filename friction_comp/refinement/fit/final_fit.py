# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From a fit to a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import functools
import math
from typing import Any, TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize_scalar

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.effect_sum import Term, TRIAL
from friction_comp.refinement.fit.robust_regression import huber_loss
from friction_comp.refinement.judge.carry_over import parts_of, shows_in_parts
from friction_comp.refinement.prepare.fit_data import Measured

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.samples import Samples

# More samples than this gain nothing, and would cost memory.
_MOST_SAMPLES = 200_000
# Losses in motion that differ by less are as good as each other.
_AS_GOOD = 1.01
_NEARLY_AS_GOOD = 1.05
# Steepness times shift at which Eq. 6 is a quarter of the way from one plateau to the other.
_MIDDLE_HALF = math.log(3.0)


def final_fit(data: Measured, fits: list[Fit]) -> Fit:
    """Return the fit on all usable rows, started from the constants of either fold."""
    best = None
    for start in fits:
        fit = optimizer.gauss_newton(start.moved(data, data.usable))
        size = float(np.mean(np.abs(fit.left)))
        if best is None or size < best[0]:
            best = (size, fit)
    return _with_transition(best[1])


def _with_transition(fit: Fit) -> Fit:
    """Return the fit with the change of sign where and as steep as all samples show it.

    It is centred at zero velocity, unless motion objects and standstill does not: a velocity that
    reads a little off zero at rest would move it to where the model is sure of friction at rest.
    Wherever it is, standstill stays within its middle half, as in the note's three drives: at rest
    friction has no direction.
    """
    centred = tune_transition(optimizer.center_sigmoid(fit))
    judge = _Judge(fit, _AS_GOOD)
    if not fit.shift or judge.errors(centred)[0] < _AS_GOOD * judge.errors(fit)[0]:
        return centred
    tilted = tune_transition(fit)
    if abs(tilted.shift * tilted.steepness) > _MIDDLE_HALF:
        return centred
    return tilted if judge.errors(tilted)[1] < judge.errors(centred)[1] else centred


class _Judge:
    """Errors of fits in motion and everywhere, compared with those of a first one.

    Samples beside standstill do not decide which effects there are, since a joint that sticks
    tells nothing of friction. Without them, though, how fast friction changes its sign is a guess,
    an effect may differ from the sigmoid in it for no reason, and one form of a lag is as good as
    another. Of all ways that explain the motion as well, the one is taken that fits best where the
    joint starts, stops and turns round. One that costs more in motion than that has to make up for
    it in all samples together, in more parts of the recordings than chance lets it.
    """

    def __init__(self, fit: Fit, slack: float) -> None:
        self._scale, self._rows = fit.scale, fit.data.usable
        self._limit = float(np.quantile(np.abs(fit.residual), 0.999))
        in_motion, self._least = self.errors(fit)
        self._allowed = slack * in_motion
        self.best = fit

    def errors(self, fit: Fit) -> tuple[float, float]:
        """Return the loss in motion and the bounded mean square everywhere, A²."""
        size = np.minimum(np.abs(fit.residual), self._limit)
        return (float(np.mean(huber_loss(fit.residual[self._rows], self._scale))),
                float(np.mean(size ** 2)))

    def hear(self, fit: Fit) -> float:
        """Keep a fit if it is the best so far; return what to make small."""
        in_motion, everywhere = self.errors(fit)
        if in_motion > self._allowed:
            return everywhere + 1e3 * (in_motion - self._allowed)
        if everywhere < self._least:
            self.best, self._least = fit, everywhere
        return everywhere

    def prefers(self, other: Fit, plain: Fit) -> bool:
        """Tell whether another fit explains all samples better, in most parts of the recordings."""
        squares = [np.minimum(np.abs(one.residual), self._limit) ** 2 for one in (plain, other)]
        part = parts_of(np.ones(len(squares[0]), dtype=bool))
        return shows_in_parts(np.bincount(part, squares[0] - squares[1]))


def with_steepness(fit: Fit, steepness: float) -> Fit:
    """Return the fit with friction of all terms changing sign as steeply as that, solved."""
    twin = fit.copy()
    twin.steepness, twin.transition = float(steepness), 2.0 / float(steepness)
    twin.shift = fit.shift * fit.steepness / twin.steepness
    twin.fill()
    twin.solve(TRIAL)
    return twin


def tune_transition(fit: Fit) -> Fit:
    """Return the fit with the change of sign around standstill as all samples show it."""
    fit = tune_lag(fit)

    @functools.cache
    def steep(logarithm: float) -> Fit:
        return with_steepness(fit, np.exp(logarithm))
    careful, free = (_tuned(fit, slack, steep) for slack in (_AS_GOOD, np.inf))
    if free.steepness == careful.steepness:
        return careful
    return free if _Judge(fit, _AS_GOOD).prefers(free, careful) else careful


def _tuned(fit: Fit, slack: float, steep: Callable[[float], Fit]) -> Fit:
    """Return the fit with the steepness that is best everywhere, at so much loss in motion."""
    judge, speed = _Judge(fit, slack), fit.data.scene.speed

    def tried(logarithm: float) -> float:
        return judge.hear(steep(float(logarithm)))
    grid = np.log(np.geomspace(8.0 / speed, 2000.0 / speed, 14))
    place = grid[int(np.argmin([tried(value) for value in grid]))]
    step = grid[1] - grid[0]
    minimize_scalar(tried, bounds=(place - step, place + step), method='bounded',
                    options={'maxiter': 8})
    if judge.best is fit:
        return fit
    best = judge.best.copy()
    best.solve()
    return best


def tune_lag(fit: Fit) -> Fit:
    """Return the fit with the form and size of its lag, if it has one, as all samples show it."""
    place = next((k for k, term in enumerate(fit.terms) if term.kind.reshapes), None)
    if place is None:
        return fit
    judge, kind = _Judge(fit, _NEARLY_AS_GOOD), fit.terms[place].kind
    for steepness in (fit.steepness, 300.0 / fit.data.scene.speed):
        now = with_steepness(fit, steepness)
        for constants in kind.forms(fit.data.scene):
            # From one to the next, so that what is the same in both stays.
            now = now.copy()
            now.terms[place] = Term(kind, constants)
            now.fill()
            now.solve(TRIAL)
            judge.hear(now)
    if judge.best is fit:
        return fit
    near, term = judge.best, judge.best.terms[place]
    size, = (name for name, how in kind.constants.items() if how is not None)

    def tried(ratio: float) -> float:
        twin = near.copy()
        twin.terms[place] = term.with_constants(
            **{size: float(term.constants[size] * np.exp(ratio))})
        return judge.hear(with_steepness(twin, near.steepness))
    minimize_scalar(tried, bounds=(-0.4, 0.4), method='bounded', options={'maxiter': 10})
    judge.best.solve()
    return judge.best


def to_model(fit: Fit, samples: Samples | None, usable: np.ndarray | None, drive: Drive,
             settings: dict[str, Any]) -> FrictionModel:
    """Return the `FrictionModel` of a fit.

    Parameters
    ----------
    fit : Fit
    samples, usable : Samples and ndarray of bool, or None
        Full set of samples to fit the coefficients to once more, the constants kept.
    drive : Drive
    settings : dict
        How velocity was derived from position.
    """
    if samples is not None and len(samples) <= _MOST_SAMPLES and fit.data.window:
        whole = Measured(samples, usable, 0.0, fit.data.scene, fit.data.load_coefficient)
        fit = fit.moved(whole, usable)
    offset, coulomb, viscous = (float(value) for value in fit.coefficients[:3])
    sigmoid = Sigmoid(upper=offset + coulomb, lower=offset - coulomb,
                      steepness=fit.steepness, shift=fit.shift, viscous=viscous)
    effects, place = [], 3
    for term, part in zip(fit.terms, fit.parts[1:]):
        number = part.shape[1]
        effects.append(term.kind({
            **term.constants,
            'coefficients': [float(value) for value in fit.coefficients[place:place + number]]}))
        place += number
    return with_load(FrictionModel(
        drive=drive, sigmoid=sigmoid, effects=effects, joint=fit.data.samples.joint,
        differentiation=dict(settings)), fit.data.load_coefficient)


def with_load(model: FrictionModel, coefficient: float) -> FrictionModel:
    """Return the model with the load torque that mechanics asks for, if any, as last effect."""
    if not coefficient:
        return model
    return replace(model, effects=[
        *model.effects, mechanical_load()({'coefficients': [coefficient]})])


def mechanical_load() -> type[Effect]:
    """Return the effect by which a measured load spares the motor its torque."""
    return next(kind for kind in EFFECTS.values() if kind.by_mechanics(Drive(1.0, 1.0)))
