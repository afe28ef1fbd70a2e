# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to a model with the effects that they show."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.asymmetry import carve_out, named_asymmetry
from friction_comp.refinement.fit.effect_sum import (
    first_fit,
    Fit,
    Term,
)
from friction_comp.refinement.fit.final_fit import (
    final_fit,
    mechanical_load,
    to_model,
    with_load,
)
from friction_comp.refinement.judge.caveats import ambiguities, warnings
from friction_comp.refinement.judge.evidence import held_out_residual, rms
from friction_comp.refinement.judge.residual_verdict import (
    CLEARLY_ABOVE_NOISE,
    clipped_rms,
    clipping,
    LARGE,
    left_over,
    with_products,
    without_stand_ins,
)
from friction_comp.refinement.judge.scores import noise_floor, scores, words_of
from friction_comp.refinement.prepare import fit_data as recordings
from friction_comp.refinement.prepare.coupling_choice import say_so, with_other_joints
from friction_comp.refinement.prepare.differentiation_choice import (
    choose_differentiation,
    lagging,
    sharpest,
    smoothest,
    velocity_against_position,
)
from friction_comp.refinement.prepare.load_compensation import carried_by_a_person
from friction_comp.refinement.search.stepwise import select

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.model.effects.scene import Scene
    from friction_comp.refinement.judge.residual_dependence import ResidualDependence
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.refinement.search.candidate_fit import Step
    from friction_comp.samples import Samples

# A second pass over more samples than this would take too long.
_TWICE = 200_000
# Errors that differ by less are as good as each other.
_AS_GOOD = 1.005


@dataclass
class RefineResult:
    """What refinement found.

    Parameters
    ----------
    report : dict[str, Any]
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

    report: dict[str, Any]
    model: FrictionModel
    start: FrictionModel
    samples: Samples
    usable: np.ndarray
    before: np.ndarray
    after: np.ndarray
    scene: Scene | None = None
    trail: list[Any] = field(default_factory=list)


def refine(recorded: list[Samples], model: FrictionModel | None = None, drive: Drive | None = None,
           progress: Callable[..., Any] | None = None) -> RefineResult:
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
    raw = recordings.join(recorded)
    clipped = recordings.clipped(raw.current)
    settings = choose_differentiation(raw, clipped)
    raw, arm = with_other_joints(model.with_arm(raw) if model else raw, ~clipped, settings)
    found = choose(raw, clipped, settings, model, drive, progress)
    # Which bandwidth suits is seen better once the effects are known.
    better = sharpest(found.model, raw, found.usable, settings)
    if better != settings and len(raw) < _TWICE:
        found = choose(raw, clipped, better, model, drive, progress)
    found = without_blur(found, raw, clipped, model, drive, progress)
    refined = found.model
    refined.joint = refined.joint or (model.joint if model else '')
    if model:
        refined.breakaway, refined.simulation = model.breakaway, dict(model.simulation)
        refined.notes, refined.arm = dict(model.notes), model.arm
    # Samples near standstill do not decide which effects there are; what the model is worth beside
    # rest and at reversals does depend on how sharply the two are told apart.
    settings = sharpest(refined, raw, ~clipped, refined.differentiation, found.usable)
    refined.differentiation = dict(settings)
    samples = differentiate(raw, settings)
    result = summarise(found, samples, clipped, model, drive, settings)
    if arm and any('coupling' in effect.needs for effect in refined.effects):
        refined.arm = arm
        say_so(result.report, arm)
    at_odds = velocity_against_position(raw)
    if at_odds:
        result.report['warnings'].append(at_odds)
    return result


@dataclass
class Choice:
    """Effects chosen for one way of differentiating."""

    model: FrictionModel
    data: FitData
    bases: list[Any]
    steps: list[Any]
    left: list[Any]
    usable: np.ndarray

    @property
    def fits(self) -> list[Fit]:
        """The fits of both folds with all effects."""
        return self.steps[-1].fits if self.steps else self.bases


def choose(raw: Samples, clipped: np.ndarray, settings: dict[str, Any], model: FrictionModel | None,
           drive: Drive, progress: Callable[..., Any] | None) -> Choice:
    """Choose the effects, and fit the model with them to all samples."""
    samples = differentiate(raw, settings)
    slowest = recordings.sticking_speed(samples)
    usable = (np.abs(samples.velocity) > slowest) & ~clipped
    if usable.sum() >= recordings.FEWEST and not lagging(samples, usable):
        usable &= recordings.in_motion(samples, slowest, settings)
    if usable.sum() < recordings.FEWEST:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(usable.sum())} samples of motion are too few')
    data = prepare(samples, usable, drive, slowest)
    if model is None or not any(isinstance(effect, mechanical_load()) for effect in model.effects):
        data.load_coefficient = carried_by_a_person(samples, usable, drive)
    terms = [Term(type(effect), dict(effect.values)) for effect in model.effects] if model else []
    bases = [optimizer.gauss_newton_restarted(_started(first_fit(data, data.fit_rows(fold)), terms))
             for fold in (0, 1)]
    steps, nameless = select(data, bases, progress)
    rough = to_model((steps[-1].fits if steps else bases)[0], None, None, drive, settings)
    floor = noise_floor(samples, usable, samples.current - rough.current(samples))
    steps, left, large = honest(data, bases, steps, slowest, floor, nameless)
    found = Choice(None, data, bases, steps, left, usable)
    known = 0.5 * (model.sigmoid.upper + model.sigmoid.lower) if model else 0.0
    # What has no name may well have an average, which is no asymmetry then.
    named = None if large else named_asymmetry(data, found.fits, steps, known)
    if named:
        steps.append(named)
    found.model = carve_out(
        to_model(final_fit(data, found.fits), samples, usable, drive, settings), samples, usable)
    return found


def summarise(found: Choice, samples: Samples, clipped: np.ndarray, model: FrictionModel | None,
              drive: Drive, settings: dict[str, Any]) -> RefineResult:
    """Return the `RefineResult` of a choice."""
    data, steps, bases, usable, refined = (
        found.data, found.steps, found.bases, found.usable, found.model)
    fold = fold_of_all(data, len(samples))

    def held_out(pair: list[Fit]) -> np.ndarray:
        residual = np.empty(len(samples))
        for side, fit in enumerate(pair):
            rows = fold == side
            prediction = to_model(fit, None, None, drive, settings).current(samples)
            residual[rows] = samples.current[rows] - prediction[rows]
        return residual

    if model:
        start = with_load(model, data.load_coefficient)
    else:
        start = to_model(final_fit(data, bases), samples, usable, drive, settings)
    start_fit = samples.current - start.current(samples)
    before = start_fit if model else held_out(bases)
    trail = [('before', rms(before[usable]))]
    after = before
    for step in steps:
        after = held_out(step.fits)
        trail.append((step.kind.name, rms(after[usable])))
    if model and not steps:
        after = held_out(bases)
    after_fit = samples.current - refined.current(samples)
    left = list(found.left)
    clip = clipping(samples, clipped)
    if clip:
        left.append(clip)
    effects = refined.effects[len(model.effects) if model else 0:]
    first = ('the given model' if model else 'sigmoid of Eq. 6 fitted to the recording')
    if data.load_coefficient:
        first += ', the measured load carried as mechanics asks'
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
            for item in left],
        'ambiguous': ambiguities(data.samples, data.usable, steps, data.scene),
        'warnings': warnings(data.samples, data.usable, data.scene),
        'differentiation': dict(settings),
    }
    return RefineResult(report, refined, start, samples, usable, before, after, data.scene,
                        trail)


def honest(
        data: FitData, bases: list[Fit], steps: list[Step], slowest: float, floor: float,
        nameless: Sequence[type[Effect]] = ()) -> tuple[list[Step], list[ResidualDependence], bool]:
    """Return the effects that may keep their names, and what has none.

    Returns
    -------
    list of Step, list of Dependence, bool
        The last tells whether something large is without a name.
    """
    def state(kept: list[Step]) -> tuple[list[ResidualDependence], bool]:
        fits = kept[-1].fits if kept else bases
        residual = held_out_residual(data, fits)
        left = left_over(data, residual, slowest, floor)
        # Noise that is slow (history) bends nothing; what goes with a variable may.
        large = any(item.variable != 'history' and item.strength > LARGE for item in left)
        return left, large and clipped_rms(residual[data.usable]) > CLEARLY_ABOVE_NOISE * floor
    left, large = state(steps)
    if large:
        kept = without_stand_ins(steps)
        if len(kept) < len(steps):
            steps = kept
            left, large = state(steps)
    return steps, with_products(left, nameless), large or bool(nameless)


def without_blur(found: Choice, raw: Samples, clipped: np.ndarray, model: FrictionModel | None,
                 drive: Drive, progress: Callable[..., Any] | None) -> Choice:
    """Return a choice without lag where smoother velocities leave no call for it.

    A lag smooths, and so lowers the noise of velocities that were not smoothed enough: then it is
    no property of the drive.
    """
    smoothing = [effect for effect in found.model.effects if effect.smooths]
    if not smoothing or len(raw) >= _TWICE:
        return found
    settings = found.model.differentiation
    plain = replace(found.model, effects=[
        effect for effect in found.model.effects if effect not in smoothing])
    smoother = smoothest(plain, raw, found.usable, settings)
    if smoother == settings:
        return found
    other = choose(raw, clipped, smoother, model, drive, progress)
    if any(step.kind.reshapes for step in other.steps):
        return found
    both = found.usable & other.usable
    errors = [rms((raw.current - choice.model.current(
        differentiate(raw, choice.model.differentiation)))[both]) for choice in (found, other)]
    return other if errors[1] < _AS_GOOD * errors[0] else found


def _started(fit: Fit, terms: list[Any]) -> Fit:
    if not terms:
        return fit
    return Fit(fit.data, fit.rows, fit.steepness, terms)


def fold_of_all(data: FitData, size: int) -> np.ndarray:
    """Return the fold of every original sample, shape (size,)."""
    place = np.searchsorted(data.origin, np.arange(size), side='right') - 1
    return data.fold[np.clip(place, 0, len(data.fold) - 1)]


def prepare(samples: Samples, usable: np.ndarray, drive: Drive, slowest: float) -> FitData:
    """Return the `FitData` to choose effects on."""
    thin, usable, window, origin = recordings.thinned(samples, usable)
    transition = 0.05 * float(np.percentile(np.abs(thin.velocity), 95))
    everything = np.zeros(len(thin), dtype=int)
    data = recordings.FitData(
        thin, usable, everything, everything, everything.astype(bool), window,
        recordings.scene_of(thin, usable, drive, transition, slowest), '', origin)
    base = first_fit(data, usable)
    data.block, data.fold, data.guard, data.held_out = recordings.split(
        thin, usable, base.residual)
    scene = recordings.scene_of(thin, usable, drive, 2.0 / base.steepness, slowest)
    data.scene = replace(scene, sample_time=samples.sample_time)
    return data
