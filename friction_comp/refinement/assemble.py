# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From a fit to a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import newton
from friction_comp.refinement.data import Data
from friction_comp.refinement.fitting import huber_loss

# More samples than this gain nothing, and would cost memory.
_MOST_SAMPLES = 200_000
# Losses in motion that differ by less are as good as each other.
_AS_GOOD = 1.01


def final_fit(data, fits):
    """Return the fit on all usable rows, started from the constants of either fold."""
    best = None
    for start in fits:
        fit = newton.polish(moved(start, data, data.usable))
        size = float(np.mean(np.abs(fit.residual[data.usable])))
        if best is None or size < best[0]:
            best = (size, fit)
    return settled(newton.upright(best[1]))


def settled(fit):
    """Return the fit with the change of sign around standstill as all samples show it.

    Samples beside standstill do not decide which effects there are, since a joint that sticks
    tells nothing of friction. Without them, though, how fast friction changes its sign is a guess,
    and an effect may differ from the sigmoid in it for no reason. Of all ways that explain the
    motion as well, the one is taken that fits best where the joint starts, stops and turns round.
    """
    data, rows = fit.data, fit.data.usable
    limit = float(np.quantile(np.abs(fit.residual), 0.999))

    def errors(candidate):
        size = np.abs(candidate.residual)
        return (float(np.mean(huber_loss(candidate.residual[rows], fit.scale))),
                float(np.mean(np.minimum(size, limit) ** 2)))

    def changed(steepness, transition):
        twin = fit.copy()
        twin.steepness, twin.transition = float(steepness), float(transition)
        twin.shift = fit.shift * fit.steepness / twin.steepness
        twin.fill()
        twin.solve(3)
        return twin
    allowed, least = errors(fit)
    allowed *= _AS_GOOD
    best = fit
    speed = data.scene.speed

    def tried(logarithm):
        nonlocal best, least
        steepness = np.exp(logarithm)
        twin = changed(steepness, 2.0 / steepness)
        in_motion, everywhere = errors(twin)
        if in_motion <= allowed and everywhere < least:
            best, least = twin, everywhere
        return everywhere if in_motion <= allowed else everywhere + 1e3 * (in_motion - allowed)
    grid = np.log(np.geomspace(8.0 / speed, 2000.0 / speed, 14))
    scores = [tried(value) for value in grid]
    place = grid[int(np.argmin(scores))]
    step = grid[1] - grid[0]
    minimize_scalar(tried, bounds=(place - step, place + step), method='bounded',
                    options={'maxiter': 8})
    if best is fit:
        return fit
    best.solve()
    return best


def moved(fit, data, rows):
    """Return a fit with the same terms and constants on other rows, solved."""
    twin = fit.copy()
    twin.data, twin.rows, twin.index = data, rows, np.nonzero(rows)[0]
    twin.forget()
    twin.refresh()
    return twin


def to_model(fit, samples, usable, drive, settings):
    """Return the `FrictionModel` of a fit.

    Parameters
    ----------
    fit : Fit
    samples, usable : Samples and ndarray of bool, or None
        Full set of samples to fit the coefficients to once more, the constants kept.
    drive : Drive
    settings : dict
        How velocity was had of position.
    """
    if samples is not None and len(samples) <= _MOST_SAMPLES and fit.data.window:
        whole = Data(samples, usable, None, None, None, 0.0, fit.data.scene, '',
                     load_coefficient=fit.data.load_coefficient)
        fit = moved(fit, whole, usable)
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


def with_load(model, coefficient):
    """Return the model with the load torque that mechanics asks for, if any, as last effect."""
    if not coefficient:
        return model
    return replace(model, effects=[
        *model.effects, EFFECTS['load_torque']({'coefficients': [coefficient]})])
