# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to a model with the effects that they show."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import data as recordings
from friction_comp.refinement.fitting import (
    first_fit,
    Fit,
    huber_weights,
    robust_scale,
    solve,
    Term,
)
from friction_comp.refinement.selection import held_out_residual, rms, select


@dataclass
class RefineResult:
    """What refinement found.

    Parameters
    ----------
    report : dict
        As the package's pages describe report.json.
    model : FrictionModel
        Fitted on all usable samples, with the effects.
    samples : Samples
        All samples with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
    before, after : ndarray, shape (N,)
        Current in A that the model before and the refined model predict.
    """

    report: dict
    model: FrictionModel
    samples: object = None
    usable: np.ndarray = None
    before: np.ndarray = None
    after: np.ndarray = None
    extra: dict = field(default_factory=dict)


def predict(model, samples):
    """Return the current in A, shape (N,), that a model expects for recorded samples.

    Velocity and acceleration are computed the way the model was fitted.
    """
    settings = model.differentiation or {'source': 'position', 'bandwidth': 40.0}
    current = model.predict(differentiate(samples, settings))
    return np.nan_to_num(current, nan=0.0, posinf=0.0, neginf=0.0)


def refine(recorded, model=None, drive=None, progress=None):
    """Find the effects that a model lacks.

    Parameters
    ----------
    recorded : list of Samples
    model : FrictionModel, optional
        Where to start; the note's sigmoid fitted to the recordings when omitted.
    drive : Drive, optional
        Of the model when omitted.
    progress : callable, optional
        Called with a share of the work done and a word on it.

    Returns
    -------
    RefineResult

    Raises
    ------
    InputError
        If the recordings cannot be used.
    """
    drive = drive or (model.drive if model else Drive(1.0, 1.0))
    samples = recordings.join(recorded)
    clipped = recordings.clipped(samples.current)
    settings = choose_differentiation(samples, clipped)
    samples = differentiate(samples, settings)
    slowest = recordings.sticking_speed(samples)
    usable = (np.abs(samples.velocity) > slowest) & ~clipped
    if usable.sum() < recordings.FEWEST:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(usable.sum())} samples of motion are too few')
    data = prepare(samples, usable, drive, slowest)
    bases = [first_fit(data, data.fit_rows(fold)) for fold in (0, 1)]
    steps = select(data, bases, progress)
    fits = steps[-1].fits if steps else bases
    whole = final_fit(data, fits)
    refined = to_model(whole, samples, usable, drive, settings)
    return RefineResult(
        {'fits': fits, 'bases': bases, 'steps': steps, 'data': data}, refined, samples, usable,
        None, refined.predict(samples))


def choose_differentiation(samples, clipped):
    """Return the settings whose motion explains the current best, by sigmoid and inertia."""
    best = None
    thin = max(1, len(samples) // 20000)
    usable = None
    for settings in recordings.bandwidths(samples):
        moving = differentiate(samples, settings)
        if usable is None:
            speed = np.abs(moving.velocity)
            usable = (speed > 0.05 * np.percentile(speed, 95)) & ~clipped
        rows = np.nonzero(usable)[0][::thin]
        part = moving.take(rows)
        top = float(np.percentile(np.abs(part.velocity), 95))
        error = min(_motion_error(part, top / share) for share in (3.0, 10.0, 30.0, 100.0, 300.0))
        # Wider than needed brings noise only, so that a narrower one wins when as good.
        if best is None or error < 0.995 * best[0]:
            best = (error, settings)
    return best[1]


def _motion_error(part, transition):
    v = part.velocity
    matrix = np.column_stack((
        np.ones_like(v), np.tanh(v / transition), v, part.acceleration))
    weights = np.ones(len(v))
    for _ in range(3):
        residual = part.current - matrix @ solve(matrix, part.current, weights)
        weights = huber_weights(residual, 2.0 * robust_scale(residual))
    return rms(residual)


def prepare(samples, usable, drive, slowest):
    """Return the `Data` to choose effects on."""
    thin, usable, window = recordings.thinned(samples, usable)
    transition = 0.05 * float(np.percentile(np.abs(thin.velocity), 95))
    size = len(thin)
    everything = np.zeros(size, dtype=int)
    data = recordings.Data(
        thin, usable, everything, everything, everything.astype(bool), window,
        recordings.scene_of(thin, usable, drive, transition, slowest), '')
    base = first_fit(data, usable)
    data.block, data.fold, data.guard, data.held_out = recordings.split(
        thin, usable, base.residual)
    data.scene = recordings.scene_of(thin, usable, drive, 2.0 / base.steepness, slowest)
    return data


def final_fit(data, fits):
    """Return the fit on all usable rows, started from the constants of both folds."""
    best = None
    for start in fits:
        fit = Fit(data, data.usable, start.steepness, start.terms, start.lag)
        fit.polish()
        size = float(np.mean(np.abs(fit.residual[data.usable])))
        if best is None or size < best[0]:
            best = (size, fit)
    return best[1]


def to_model(fit, samples, usable, drive, settings):
    """Return the `FrictionModel` of a fit, its coefficients refitted on all samples."""
    whole = recordings.Data(
        samples, usable, None, None, None, 0.0, fit.data.scene, '')
    full = Fit(whole, usable, fit.steepness, fit.terms, fit.lag)
    offset, coulomb, viscous = (float(value) for value in full.coefficients[:3])
    sigmoid = Sigmoid(upper=offset + coulomb, lower=offset - coulomb,
                      steepness=full.steepness, viscous=viscous)
    effects, place = [], 3
    for term, part in zip(full.terms, full.parts[1:]):
        number = part.shape[1]
        effects.append(term.kind({
            **term.constants,
            'coefficients': [float(value) for value in full.coefficients[place:place + number]]}))
        place += number
    return FrictionModel(
        drive=drive, sigmoid=sigmoid, effects=effects, joint=samples.joint,
        differentiation=dict(settings))


__all__ = ['RefineResult', 'Term', 'held_out_residual', 'predict', 'refine']
