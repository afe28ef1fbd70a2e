# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which effects the data call for: one at a time, by the error on stretches not fitted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.effect_sum import robust_scale
from friction_comp.refinement.judge.evidence import advantage, held_out_residual, rms
from friction_comp.refinement.search.candidate_fit import (
    adjust_constants,
    ALPHA,
    chance_of,
    LEAST_SHARE,
    least_share,
    LEAST_SIZE,
    mean_loss,
    Step,
    try_kind,
)
from friction_comp.refinement.search.candidates import kinds_for
from friction_comp.refinement.search.masked_effects import hidden_expected, together
from friction_comp.refinement.search.unlisted_products import best_product

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.refinement.search.candidate_fit import CandidateFit

_MOST_EFFECTS = 10
_POLISHED = 3
# A product of variables is tried against effects with a name in so many steps, and has to lower
# the loss of all of them to this share.
_PRODUCT_ROUNDS, _PRODUCT = 3, 0.9
# Pairs of effects are looked for while so few were found one by one.
_PAIR_ROUNDS = 3
# Share of the loss that an effect beside a product has to take away to keep its name.
_BESIDE = 0.25


def select(data: FitData, fits: list[Fit],
           report: Callable[..., Any] | None = None) -> tuple[Any, ...]:
    """Add effects as long as held-out data call for them.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
        The base model, fitted once for each fold.
    report : callable, optional
        Called with a share of the work done and a word on it.

    Returns
    -------
    list of Step
    list of type
        A product of variables without which the effects with a name cannot do: see `nameless`.
    """
    steps, product = greedy(data, fits, report)
    if product is None:
        return steps, []
    residual = held_out_residual(data, fits)
    trial = try_kind(data, fits, residual, product)
    if trial is None:
        return steps, []
    place = len(fits[0].terms)
    beside, _ = greedy(data, trial.fits, report)
    named = held_out_residual(data, steps[-1].fits if steps else fits)
    nameless = held_out_residual(data, beside[-1].fits if beside else trial.fits)
    poorer = [fit.without(place) for fit in (beside[-1].fits if beside else trial.fits)]
    scale = robust_scale(nameless[data.usable])
    losses = [mean_loss(data, values, scale)
              for values in (nameless, named, held_out_residual(data, poorer))]
    if not losses[0] < _PRODUCT * min(losses[1:]):
        return steps, []
    # What is small beside something that is only traced may well be its rest.
    while beside and beside[-1].evidence['loss_reduction'] < _BESIDE:
        beside.pop()
    steps = []
    for step in beside:
        bare = [fit.without(place) for fit in step.fits]
        steps.append(replace(
            step, fits=bare, held_out_rmse=rms(held_out_residual(data, bare)[data.usable])))
    return steps, [product]


def greedy(data: FitData, fits: list[Fit],
           report: Callable[..., Any] | None = None) -> tuple[list[Step], type[Effect] | None]:
    """Add the best effect again and again, and take back what has become needless.

    Parameters
    ----------
    data, fits, report
        As for `select`.

    Returns
    -------
    list of Step
    type or None
        The product of variables, if any, that explained more than every effect with a name.
    """
    steps: list[Step] = []
    product = None
    residual = held_out_residual(data, fits)
    least = (LEAST_SIZE * rms(data.samples.current[data.usable])) ** 2
    while len(steps) < _MOST_EFFECTS:
        loss = mean_loss(data, residual)
        kinds = kinds_for(data, fits[0].terms)
        trials = []
        for number, kind in enumerate(kinds):
            if report:
                report((len(steps) + number / len(kinds)) / (len(steps) + 1.5), kind.name)
            trial = try_kind(data, fits, residual, kind)
            if trial is not None:
                trials.append(trial)
        trials.sort(key=lambda trial: -trial.advantage)
        for trial in trials[:_POLISHED]:
            adjust_constants(data, residual, trial)
        if product is None and len(steps) < _PRODUCT_ROUNDS:
            product = best_product(data, fits, residual, trials, max(LEAST_SHARE * loss, least))
        worthy = [trial for trial in trials
                  if trial.p_value < chance_of(trial.kind, len(kinds))
                  and trial.advantage > max(least_share(trial, data) * loss, least)]
        if not worthy:
            hidden = hidden_expected(data, fits, residual, kinds)
            found = [hidden] if hidden else []
            if not found and len(steps) < _PAIR_ROUNDS:
                found = together(data, fits, residual, trials, kinds, least)
            if not found:
                break
            steps += found
            fits = found[-1].fits
            residual = held_out_residual(data, fits)
            continue
        chosen = simplest_of_the_best(data, worthy)
        adjust_constants(data, residual, chosen, thorough=True)
        fits = chosen.fits
        adjusted = chosen.residual
        rivals = find_rivals(data, chosen, trials, residual)
        steps.append(Step(
            chosen.kind, fits, rms(adjusted[data.usable]),
            chosen.evidence(loss, len(kinds)), rivals))
        residual = adjusted
    return prune(data, steps, least), product


def prune(data: FitData, steps: list[Step], least: float) -> list[Step]:
    """Take back effects that those found later have made needless.

    The greedy order may add an effect as a stand-in for one that comes later. Every effect but
    the last is left out in turn, the others fitted anew, and stays out where held-out data do not
    miss it.
    """
    place = len(steps) - 2
    while place >= 0 and len(steps) > 1:
        if 'beside' in steps[place].evidence:
            place -= 1
            continue
        fits = steps[-1].fits
        first = len(fits[0].terms) - len(steps)
        poorer = [fit.without(first + place) for fit in fits]
        full = held_out_residual(data, fits)
        loss = mean_loss(data, full)
        missed, _, p_value = advantage(data, held_out_residual(data, poorer), full)
        if missed < 3.0 * max(LEAST_SHARE * loss, least):
            poorer = [optimizer.gauss_newton_restarted(fit) for fit in poorer]
            missed, _, p_value = advantage(data, held_out_residual(data, poorer), full)
        if missed < max(LEAST_SHARE * loss, least) or p_value > ALPHA:
            steps = without_step(data, steps, place, poorer)
        place -= 1
    return steps


def without_step(data: Any, steps: Any, place: Any, fits: Any) -> Any:
    """Return the steps less one; the last of them has the fits of the whole."""
    first = len(steps[0].fits[0].terms) - 1
    kept = []
    for number, step in enumerate(steps):
        if number == place:
            continue
        if number > place:
            step = replace(step, fits=[fit.without(first + place) for fit in step.fits])
        kept.append(step)
    kept[-1] = replace(kept[-1], fits=fits)
    return [replace(step, held_out_rmse=rms(held_out_residual(data, step.fits)[data.usable]))
            for step in kept]


def simplest_of_the_best(data: FitData, trials: list[CandidateFit]) -> CandidateFit:
    """Return the simplest trial within one standard error of the best."""
    best = max(trials, key=lambda trial: trial.advantage)
    near = [best]
    for trial in trials:
        if trial is best:
            continue
        lead, error, _ = advantage(data, trial.residual, best.residual)
        if lead < error and trial.complexity < best.complexity:
            near.append(trial)
    return min(near, key=lambda trial: (trial.complexity, -trial.advantage))


def find_rivals(data: FitData, chosen: CandidateFit, trials: list[CandidateFit],
                residual: np.ndarray) -> list[Any]:
    """Return effects of another variable that the data cannot tell from the chosen one.

    Returns
    -------
    list of (type, float)
        Effect, and how its share of the current correlates with that of the chosen effect.
    """
    usable = data.usable
    mine = (residual - chosen.residual)[usable]
    rivals = []
    for trial in trials:
        if trial.kind.variable == chosen.kind.variable or trial.advantage <= 0:
            continue
        theirs = (residual - trial.residual)[usable]
        if not (mine.std() > 0 and theirs.std() > 0):
            continue
        correlation = float(np.corrcoef(mine, theirs)[0, 1])
        lead, error, _ = advantage(data, trial.residual, chosen.residual)
        if correlation > 0.9 and lead < 2.0 * error + 0.02 * chosen.advantage:
            rivals.append((trial.kind, correlation))
    return rivals
