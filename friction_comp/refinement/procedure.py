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
from friction_comp.refinement import data as recordings, newton
from friction_comp.refinement.assemble import final_fit, to_model
from friction_comp.refinement.asymmetry import carve_out, named_asymmetry
from friction_comp.refinement.dependence import unexplained
from friction_comp.refinement.fitting import (
    first_fit,
    Fit,
    huber_weights,
    robust_scale,
    solve,
    Term,
)
from friction_comp.refinement.honesty import ambiguities, warnings
from friction_comp.refinement.report import noise_floor, scores, words_of
from friction_comp.refinement.selection import rms, select


@dataclass
class RefineResult:
    """What refinement found.

    Parameters
    ----------
    report : dict
        The content of report.json.
    model : FrictionModel
        Fitted on all usable samples, with the effects.
    start : FrictionModel
        The model before.
    samples : Samples
        All samples with velocity and acceleration.
    usable : ndarray of bool, shape (N,)
        The samples that the errors are counted on.
    before, after : ndarray, shape (N,)
        Held-out residual in A of the model before and of the refined model.
    scene : Scene
        What the recordings cover.
    trail : list of (str, float)
        Held-out error in A as effects were added.
    """

    report: dict
    model: FrictionModel
    start: FrictionModel
    samples: object
    usable: np.ndarray
    before: np.ndarray
    after: np.ndarray
    scene: object = None
    trail: list = field(default_factory=list)


def predict(model, samples):
    """Return the current in A, shape (N,), that a model expects for recorded samples.

    Velocity and acceleration are computed the way the model was fitted. There is a finite value
    for every sample, also at standstill, where it is the model's value for no motion.
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
    usable = recordings.in_motion(samples, slowest, settings) & ~clipped
    if usable.sum() < recordings.FEWEST:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(usable.sum())} samples of motion are too few')
    data = prepare(samples, usable, drive, slowest)
    terms = [Term(type(effect), dict(effect.values)) for effect in model.effects] if model else []
    bases = [newton.polished(_started(first_fit(data, data.fit_rows(fold)), terms))
             for fold in (0, 1)]
    steps = select(data, bases, progress)
    fits = steps[-1].fits if steps else bases
    if not model:
        named = named_asymmetry(data, fits, steps)
        if named:
            steps.append(named)
            fits = named.fits
    refined = carve_out(to_model(final_fit(data, fits), samples, usable, drive, settings),
                        samples, usable)
    refined.joint = refined.joint or (model.joint if model else '')
    if model:
        refined.breakaway, refined.simulation = model.breakaway, dict(model.simulation)
        refined.notes = dict(model.notes)

    fold = fold_of_all(data, len(samples))

    def held_out(pair):
        residual = np.empty(len(samples))
        for side, fit in enumerate(pair):
            rows = fold == side
            prediction = to_model(fit, None, None, drive, settings).predict(samples)
            residual[rows] = samples.current[rows] - prediction[rows]
        return residual

    start = model or to_model(final_fit(data, bases), samples, usable, drive, settings)
    start_fit = samples.current - start.predict(samples)
    before = start_fit if model else held_out(bases)
    trail = [('before', rms(before[usable]))]
    after = before
    for step in steps:
        after = held_out(step.fits)
        trail.append((step.kind.name, rms(after[usable])))
    if model and not steps:
        after = held_out(fits)
    after_fit = samples.current - refined.predict(samples)
    thin = after[data.origin]
    effects = refined.effects[len(terms):]
    first = ('the given model' if model else 'sigmoid of Eq. 6 fitted to the recording')
    report = {
        'unit': 'A', 'joint': refined.joint, 'samples': len(samples),
        'samples_in_motion': int(usable.sum()),
        'samples_clipped': int(clipped.sum()),
        'held_out': data.held_out,
        'signal_rms': rms(samples.current[usable]),
        'before': {'model': first, **scores(samples.current, start_fit, before, usable)},
        'after': {'model': words_of(refined, 'sigmoid of Eq. 6'),
                  **scores(samples.current, after_fit, after, usable)},
        'noise_floor': noise_floor(samples, usable, after),
        'effects': [
            {'name': effect.name, 'variable': effect.variable, 'held_out_rmse': error,
             'evidence': step.evidence, 'parameters': effect.parameters,
             'in_words': effect.describe(), 'formula': effect.formula()}
            for effect, step, (_, error) in zip(effects, steps, trail[1:])],
        'unexplained': [
            {'variable': item.variable, 'strength': item.strength, 'note': item.note}
            for item in unexplained(data.samples, data.usable, thin, slowest)],
        'ambiguous': ambiguities(data.samples, data.usable, steps, data.scene),
        'warnings': warnings(data.samples, data.usable, data.scene),
        'differentiation': dict(settings),
    }
    return RefineResult(report, refined, start, samples, usable, before, after, data.scene,
                        trail)


def _started(fit, terms):
    if not terms:
        return fit
    return Fit(fit.data, fit.rows, fit.steepness, terms)


def fold_of_all(data, size):
    """Return the fold of every original sample, shape (size,)."""
    place = np.searchsorted(data.origin, np.arange(size), side='right') - 1
    return data.fold[np.clip(place, 0, len(data.fold) - 1)]


def choose_differentiation(samples, clipped):
    """Return the settings whose motion explains the current best, by sigmoid and inertia."""
    best = None
    thin = max(1, len(samples) // 20000)
    usable = None
    for settings in reversed(recordings.bandwidths(samples)):
        moving = differentiate(samples, settings)
        if usable is None:
            speed = np.abs(moving.velocity)
            usable = (speed > 0.05 * np.percentile(speed, 95)) & ~clipped
        rows = np.nonzero(usable)[0][::thin]
        if len(rows) < 50:
            raise InputError('the joint hardly moves in the recordings: '
                             f'{len(rows)} samples of motion are too few')
        part = moving.take(rows)
        top = float(np.percentile(np.abs(part.velocity), 95))
        error = min(_motion_error(part, top / share) for share in (3.0, 10.0, 30.0, 100.0, 300.0))
        # Narrower than needed blunts reversals, so that a wider one wins when as good.
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
    thin, usable, window, origin = recordings.thinned(samples, usable)
    transition = 0.05 * float(np.percentile(np.abs(thin.velocity), 95))
    everything = np.zeros(len(thin), dtype=int)
    data = recordings.Data(
        thin, usable, everything, everything, everything.astype(bool), window,
        recordings.scene_of(thin, usable, drive, transition, slowest), '', origin)
    base = first_fit(data, usable)
    data.block, data.fold, data.guard, data.held_out = recordings.split(
        thin, usable, base.residual)
    data.scene = recordings.scene_of(thin, usable, drive, 2.0 / base.steepness, slowest)
    return data
