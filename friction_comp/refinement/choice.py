# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The effects chosen for one way of differentiating, and the model with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import differentiate
from friction_comp.model.effects import Effect
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.asymmetry import carve_out, named_asymmetry
from friction_comp.refinement.fit.effect_sum import first_fit, Fit, Term
from friction_comp.refinement.fit.final_fit import final_fit, mechanical_load, to_model
from friction_comp.refinement.fit.harmonics import with_exact_multiples
from friction_comp.refinement.judge.control import Control, control_of
from friction_comp.refinement.judge.evidence import advantage, held_out_residual
from friction_comp.refinement.judge.residual_dependence import ResidualDependence
from friction_comp.refinement.judge.residual_verdict import (
    clipped_rms,
    left_over,
    with_products,
)
from friction_comp.refinement.judge.scores import noise_floor
from friction_comp.refinement.prepare import fit_data as recordings
from friction_comp.refinement.prepare.differentiation_choice import lagging
from friction_comp.refinement.prepare.fit_data import FitData, Measured
from friction_comp.refinement.prepare.load_compensation import carried_by_a_person
from friction_comp.refinement.prepare.prepared import finer, prepare
from friction_comp.refinement.search.candidate_fit import mean_loss, Step
from friction_comp.refinement.search.revision import (
    evidence_of,
    in_order,
    objections,
    prune,
    refitted,
    search,
)
from friction_comp.refinement.search.stepwise import Chosen
from friction_comp.refinement.thresholds import (
    ALPHA,
    CLEARLY_ABOVE_NOISE,
    LARGE,
    LEAST_SHARE,
    SAME_LAG,
    STAND_IN,
)
from friction_comp.samples import Samples


@dataclass(frozen=True)
class Question:
    """What refinement was given.

    Parameters
    ----------
    raw : Samples
        All recordings.
    clipped : ndarray of bool, shape (N,)
        Samples at the limits of the current signal.
    model : FrictionModel or None
        Where to start.
    drive : Drive
    unit : str
        Of the current.
    progress : callable or None
    without : tuple of type
        Effects that are not tried.
    """

    raw: Samples
    clipped: np.ndarray
    model: FrictionModel | None
    drive: Drive
    unit: str
    progress: Callable[[float, str], None] | None
    without: tuple[type[Effect], ...] = ()


@dataclass(frozen=True)
class Choice:
    """Effects chosen for one way of differentiating.

    Parameters
    ----------
    model : FrictionModel
    data : FitData
    bases : list of Fit
        The model before, of both folds.
    steps : list of Step
    left : list of ResidualDependence
    usable : ndarray of bool, shape (N,)
    control : Control
    stopped : str
        Why the search ended.
    """

    model: FrictionModel
    data: FitData
    bases: list[Fit]
    steps: list[Step]
    left: list[ResidualDependence]
    usable: np.ndarray
    control: Control
    stopped: str


def choose(question: Question, settings: dict[str, Any]) -> Choice:
    """Choose the effects, and fit the model with them to all samples.

    Parameters
    ----------
    question : Question
    settings : dict
        How velocity is derived from position.

    Raises
    ------
    InputError
        If there is too little motion.
    """
    model, drive, progress = question.model, question.drive, question.progress
    samples = differentiate(question.raw, settings)
    slowest = recordings.sticking_speed(samples)
    usable = moving(samples, question.clipped, slowest, settings)
    load = 0.0
    if model is None or not any(isinstance(effect, mechanical_load()) for effect in model.effects):
        load = carried_by_a_person(samples, usable, drive)
    data = prepare(samples, usable, drive, slowest, load)
    terms = [Term(type(effect), dict(effect.values)) for effect in model.effects] if model else []
    bases = [optimizer.gauss_newton_restarted(beginning(data, fold, terms))
             for fold in (0, 1)]
    control = control_of(unfiltered(question.raw), samples, usable, question.unit)
    if control.law:
        found = Chosen(bases, len(terms), stopped="the current is a controller's answer, in which "
                       'no effect of the drive can be told')
        product = None
    else:
        found, product = search(data, bases, progress, question.without)
    rough = to_model(found.fits[0], None, None, drive, settings)
    floor = noise_floor(samples, usable, samples.current - rough.current(samples))
    every = finer(data, samples, usable)
    whole = confirmed(data, every, found)
    left, large = remaining(data, found.fits, slowest, floor)
    if large and not control.law:
        if without_stand_ins(data, found):
            whole = confirmed(data, every, found)
        left, large = remaining(data, found.fits, slowest, floor)
    steps, order = in_order(data, bases, found)
    whole = whole.reordered(order)
    known = 0.5 * (model.sigmoid.upper + model.sigmoid.lower) if model else 0.0
    # What has no name may well have an average, which is no asymmetry then.
    nameless = large or product is not None or bool(control.law)
    named = None if nameless else named_asymmetry(data, found.fits, steps, known)
    if named:
        steps.append(named)
        whole = final_fit(every, named.fits)
    whole = with_exact_multiples(whole)
    fitted = carve_out(to_model(whole, samples, usable, drive, settings), samples, usable)
    return Choice(fitted, data, bases, steps,
                  with_products(left, [product] if product else []), usable, control,
                  found.stopped)


def beginning(data: FitData, fold: int, terms: list[Term]) -> Fit:
    """Return the fit of a sigmoid and of the effects of the model before, for one fold."""
    fit = first_fit(data, data.fit_rows(fold))
    return Fit(data, fit.rows, fit.steepness, terms) if terms else fit


def unfiltered(raw: Samples) -> Samples:
    """Return samples with the velocity that a controller saw: as recorded, or nearly so."""
    recorded = raw.velocity is not None and bool(np.any(raw.velocity))
    return differentiate(raw, {'source': 'velocity' if recorded else 'position',
                               'bandwidth': None})


def moving(samples: Samples, clipped: np.ndarray, slowest: float,
           settings: dict[str, Any]) -> np.ndarray:
    """Return which samples show friction, shape (N,).

    Raises
    ------
    InputError
        If they are too few.
    """
    usable = (np.abs(samples.velocity) > slowest) & ~clipped
    if usable.sum() >= recordings.FEWEST and not lagging(samples, usable):
        usable &= recordings.in_motion(samples, slowest, settings)
    usable = recordings.without_few(usable, recordings.beside_gaps(samples, settings))
    if usable.sum() < recordings.FEWEST:
        raise InputError('the joint hardly moves in the recordings: '
                         f'{int(usable.sum())} samples of motion are too few')
    return usable


def confirmed(data: FitData, every: Measured, found: Chosen) -> Fit:
    """Return the fit on all samples, after what physics does not allow in it was taken back.

    Parameters
    ----------
    data : FitData
        What the effects were chosen on.
    every : Measured
        All samples, for the last fit.
    found : Chosen
        Changed in place.
    """
    while True:
        whole = final_fit(every, found.fits)
        wrong = objections(whole, found.first, tuple(found.granted))
        if not wrong:
            return whole
        found.fits = refitted(data, found.fits, wrong[-1][0])
        prune(data, found)


def remaining(data: FitData, fits: list[Fit], slowest: float, floor: float
              ) -> tuple[list[ResidualDependence], bool]:
    """Return what the held-out residual still depends on, and whether that is large."""
    residual = held_out_residual(data, fits)
    left = left_over(data, residual, slowest, floor)
    # Noise that is slow (history) bends nothing; what goes with a variable may.
    large = any(item.variable != 'history' and item.strength > LARGE for item in left)
    return left, large and clipped_rms(residual[data.usable]) > CLEARLY_ABOVE_NOISE * floor


def without_stand_ins(data: FitData, found: Chosen) -> bool:
    """Take back small effects while something large has no name; tell whether there were any.

    The largest effect is kept in any case, and so is what a search of its own has found.
    """
    any_gone = False
    while len(found.kinds) > 1:
        entries = [(evidence_of(data, found.fits, place), place)
                   for place in range(found.first, len(found.fits[0].terms))
                   if found.fits[0].terms[place].kind not in found.granted
                   and not found.fits[0].terms[place].kind.shown_before]
        (evidence, poorer), _ = min(
            entries, key=lambda entry: entry[0][0]['loss_reduction'],
            default=(({'loss_reduction': 1.0}, []), 0))
        if evidence['loss_reduction'] >= STAND_IN:
            break
        found.fits, any_gone = poorer, True
    return any_gone


def lag_shows(question: Question, found: Choice, settings: dict[str, Any]) -> bool:
    """Tell whether a lag that was found shows at another bandwidth too, and is the same there.

    Parameters
    ----------
    question : Question
    found : Choice
        With a lag among its steps.
    settings : dict
        Another way of differentiating.
    """
    samples = differentiate(question.raw, settings)
    slowest = recordings.sticking_speed(samples)
    usable = moving(samples, question.clipped, slowest, settings)
    data = prepare(samples, usable, question.drive, slowest, found.data.load_coefficient)
    place = next(number for number, term in enumerate(found.steps[-1].fits[0].terms)
                 if term.kind.reshapes)
    fits = [optimizer.gauss_newton(Fit(data, data.fit_rows(fold), old.steepness, old.terms))
            for fold, old in enumerate(found.steps[-1].fits)]
    poorer = [optimizer.gauss_newton(fit.without(place)) for fit in fits]
    without = held_out_residual(data, poorer)
    gain, _, p_value = advantage(data, without, held_out_residual(data, fits))
    for fit, old in zip(fits, found.steps[-1].fits):
        ratio = fit.terms[place].constants['lag'] / old.terms[place].constants['lag']
        if not 1.0 / SAME_LAG < ratio < SAME_LAG:
            return False
    kind, own = fits[0].terms[place].kind, fits[0].terms[place].constants
    worth = kind.worth(LEAST_SHARE, own, data.scene)
    return p_value < ALPHA and gain >= worth * mean_loss(data, without)
