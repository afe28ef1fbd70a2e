# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From a fit to a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import newton
from friction_comp.refinement.data import Data

# More samples than this gain nothing, and would cost memory.
_MOST_SAMPLES = 200_000


def final_fit(data, fits):
    """Return the fit on all usable rows, started from the constants of either fold."""
    best = None
    for start in fits:
        fit = newton.polish(moved(start, data, data.usable))
        size = float(np.mean(np.abs(fit.residual[data.usable])))
        if best is None or size < best[0]:
            best = (size, fit)
    return newton.upright(best[1])


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
