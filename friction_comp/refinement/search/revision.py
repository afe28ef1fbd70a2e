# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A search that changes its mind: effects taken back, exchanged, or done without from the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from friction_comp.model.effects import Effect
from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.effect_sum import Fit, Term
from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.fit.score_test import ScoreTest
from friction_comp.refinement.judge.carry_over import carries_over
from friction_comp.refinement.judge.evidence import advantage, held_out_residual, rms
from friction_comp.refinement.judge.physics import bound, objection, sound
from friction_comp.refinement.prepare.fit_data import FitData
from friction_comp.refinement.remembered import remembered
from friction_comp.refinement.search.candidate_fit import (
    adjusted,
    CandidateFit,
    chance_of,
    compared,
    mean_loss,
    Step,
    try_kind,
)
from friction_comp.refinement.search.candidates import best_gain, kinds_for
from friction_comp.refinement.search.stepwise import (
    as_good,
    Chosen,
    grow,
    least_advantage,
    Report,
)
from friction_comp.refinement.thresholds import (
    ADJUSTED,
    ALPHA,
    EXCHANGE,
    IN_DOUBT,
    LEAST_SHARE,
    PRODUCT,
    REVISIONS,
    STAND_IN,
)


def search(data: FitData, bases: Sequence[Fit], report: Report | None = None,
           without: tuple[type[Effect], ...] = ()) -> tuple[Chosen, type[Effect] | None]:
    """Return the effects that the data call for, and a product that none of them can replace.

    The search adds the best effect again and again, then takes back and exchanges. An effect that
    takes many shapes may have come early as a stand-in for several plainer ones, which a single
    exchange does not bring to light: the search is then done once more without it, and it has to
    prove itself beside what was found so. And where a joint swings nearly by itself, weight and
    inertia cancel: none of them explains anything alone, so that the search is done once more from
    all of them, where together they explain something.

    Parameters
    ----------
    data : FitData
    bases : sequence of Fit
        The model before, fitted once for each fold.
    report : callable, optional
        Called with a share of the work done and a word on it.
    without : tuple of type
        Effects that are not tried.
    """
    first = len(bases[0].terms)
    empty = Chosen(list(bases), first, without=without)
    chosen = settle(
        data, grow(data, replace(empty, granted={}, rivals={}), report=report), report)
    flexible = {kind for kind in chosen.kinds if kind.flexible}
    if flexible:
        plain = grow(data, replace(empty, granted={}, rivals={}), tuple(flexible), report)
        plain = settle(data, grow(data, plain, report=report), report)
        chosen = simpler_if_as_good(data, chosen, plain)
    whole = with_mechanics(data, empty)
    if whole is not None and not set(whole.kinds) <= set(chosen.kinds):
        whole = settle(data, grow(data, whole, report=report), report)
        chosen = simpler_if_as_good(data, chosen, whole)
    if chosen.product is None:
        return chosen, None
    return _beside_product(data, bases, chosen, report)


def with_mechanics(data: FitData, empty: Chosen) -> Chosen | None:
    """Return the choice of all that masses ask of a joint at once, None where data show no need."""
    kinds = [kind for kind in kinds_for(data, empty.fits[0].terms)
             if (kind.expected or kind.weight or kind.shown_before) and kind not in empty.without]
    fits: list[Fit] = list(empty.fits)
    for kind in kinds:
        fits = [fit.with_term(Term(kind, {})) for fit in fits]
    for place in reversed(range(empty.first, len(fits[0].terms))):
        if any(objection(fit, place) for fit in fits):
            fits = [fit.without(place) for fit in fits]
    if len(fits[0].terms) - empty.first < 2:
        return None
    residual = held_out_residual(data, empty.fits)
    trial = adjusted(data, residual, compared(data, residual, kinds[-1], fits))
    worth = max(2.0 * LEAST_SHARE * mean_loss(data, residual), least_advantage(data))
    if trial.p_value > ALPHA or trial.advantage < worth:
        return None
    return replace(empty, fits=trial.fits, granted={}, rivals={})


def simpler_if_as_good(data: FitData, first: Chosen, second: Chosen) -> Chosen:
    """Return the better of two choices on held-out data, the simpler within a standard error."""
    residuals = [held_out_residual(data, one.fits) for one in (first, second)]
    lead, error, _ = advantage(data, *residuals)
    if abs(lead) > error:
        return second if lead > 0.0 else first
    return second if second.complexity <= first.complexity else first


def settle(data: FitData, chosen: Chosen, report: Report | None = None) -> Chosen:
    """Take back and exchange effects, and add more, until nothing changes or rounds are over."""
    for _ in range(int(REVISIONS)):
        prune(data, chosen)
        if not exchange(data, chosen, report):
            break
        grow(data, chosen, report=report)
    prune(data, chosen)
    return chosen


@remembered
def refitted(data: FitData, fits: Sequence[Fit], place: int) -> list[Fit]:
    """Return fits without one term, everything else fitted again."""
    return [optimizer.gauss_newton_restarted(fit.without(place)) for fit in fits]


@remembered
def evidence_of(data: FitData, fits: list[Fit], place: int) -> tuple[dict[str, Any], list[Fit]]:
    """Return the evidence of a term in the whole, and the fits without it.

    The others' coefficients are solved for without it. Where that leaves any doubt, all their
    constants are adjusted as well: they might make up for it.
    """
    full = held_out_residual(data, fits)
    poorer = [fit.without(place) for fit in fits]
    without = held_out_residual(data, poorer)
    missed, error, p_value = advantage(data, without, full)
    if missed < IN_DOUBT * mean_loss(data, without) or p_value > 1e-6:
        poorer = refitted(data, fits, place)
        without = held_out_residual(data, poorer)
        missed, error, p_value = advantage(data, without, full)
    loss = mean_loss(data, without)
    return {'loss_reduction': missed / loss, 'standard_errors': missed / max(error, 1e-300),
            'p_value': p_value, 'advantage': missed}, poorer


def prune(data: FitData, chosen: Chosen) -> bool:
    """Take back effects without evidence, or without sense, in the whole; tell whether any was.

    The order in which effects came may have needed a stand-in for one that came later. Every
    effect is left out in turn, the others fitted again, and stays out where held-out data do not
    miss it.
    """
    least, any_gone = least_advantage(data), False
    place = len(chosen.fits[0].terms) - 1
    while place >= chosen.first:
        kind = chosen.fits[0].terms[place].kind
        if kind in chosen.granted:
            place -= 1
            continue
        evidence, poorer = evidence_of(data, chosen.fits, place)
        loss = mean_loss(data, held_out_residual(data, poorer))
        if (evidence['advantage'] < max(LEAST_SHARE * loss, least)
                or evidence['p_value'] > chance_of(kind, 1) or not sound(chosen.fits, [place])
                or not carries_over(poorer, chosen.fits, len(chosen.kinds))):
            chosen.fits, any_gone = refitted(data, chosen.fits, place), True
            place = len(poorer[0].terms)
        place -= 1
    return any_gone


def exchange(data: FitData, chosen: Chosen, report: Report | None = None) -> bool:
    """Try every other kind in the place of each chosen effect; tell whether one was exchanged."""
    any_new = False
    for place in range(len(chosen.fits[0].terms) - 1, chosen.first - 1, -1):
        old = chosen.fits[0].terms[place].kind
        reshaped_by_another = chosen.fits[0].reshaped and not old.reshapes
        # Other joints' weight was found beside the joint's own: a spring would be half of a sum.
        one_of_weights = old.weight and any(
            kind.shown_before for kind in chosen.kinds if kind is not old)
        if old.expected or old in chosen.granted or reshaped_by_another or one_of_weights:
            continue
        if report:
            report(0.9, f'others for {old.name}')
        better = _replacement(data, chosen, place)
        if better is not None:
            chosen.fits, any_new = better.fits, True
    return any_new


def _replacement(data: FitData, chosen: Chosen, place: int) -> CandidateFit | None:
    old, full = chosen.fits[0].terms[place], held_out_residual(data, chosen.fits)
    poorer = [fit.without(place) for fit in chosen.fits]
    residual = held_out_residual(data, poorer)
    if old.kind.reshapes:
        limit = 0.0
    else:
        limit = EXCHANGE * sum(ScoreTest(fit, 1).gains([other.terms[place]])[0]
                               for fit, other in zip(poorer, chosen.fits))
    mine = Chosen(chosen.fits, chosen.first).complexity
    best = None
    gains = {kind: sum(best_gain(fit, kind) for fit in poorer)
             for kind in kinds_for(data, poorer[0].terms)
             if kind is not old.kind and not kind.reshapes and kind not in chosen.without}
    likely = sorted((kind for kind in gains if gains[kind] > limit), key=lambda kind: -gains[kind])
    for kind in likely[:int(ADJUSTED)]:
        trial = try_kind(data, poorer, residual, kind)
        if trial is None:
            continue
        trial = adjusted(data, residual, trial)
        lead, error, _ = advantage(data, full, trial.residual)
        if old.kind.holds_on_another_day and not kind.holds_on_another_day and (
                lead <= as_good(error, trial.advantage)):
            continue
        simpler = Chosen(trial.fits, chosen.first).complexity < mine
        if (lead > error or (simpler and lead > -error)) and sound(trial.fits, [-1]) and (
                best is None or trial.advantage > best.advantage):
            best = trial
    return best


def _beside_product(data: FitData, bases: Sequence[Fit], chosen: Chosen, report: Report | None
                    ) -> tuple[Chosen, type[Effect] | None]:
    """Return what has a name beside a product of variables, if the product is needed."""
    product = chosen.product
    residual = held_out_residual(data, list(bases))
    trial = try_kind(data, list(bases), residual, product)
    if trial is None:
        return chosen, None
    place = chosen.first
    beside = grow(data, Chosen(trial.fits, place + 1, without=chosen.without), report=report)
    prune(data, beside)
    poorer = [fit.without(place) for fit in beside.fits]
    nameless = held_out_residual(data, beside.fits)
    scale = robust_scale(nameless[data.usable])
    losses = [mean_loss(data, values, scale) for values in (
        nameless, held_out_residual(data, chosen.fits), held_out_residual(data, poorer))]
    if not losses[0] < PRODUCT * min(losses[1:]):
        return chosen, None
    # What is small beside something that is only traced may well be its rest.
    for last in range(len(beside.fits[0].terms) - 1, place, -1):
        evidence, fewer = evidence_of(data, beside.fits, last)
        if (evidence['loss_reduction'] < STAND_IN
                and beside.fits[0].terms[last].kind not in beside.granted):
            beside.fits = fewer
    bare = replace(beside, fits=[fit.without(place) for fit in beside.fits], first=place)
    bare.stopped = (f'{product.name} explains more of what remains than any effect known to the '
                    'package')
    return bare, product


def objections(fit: Fit, first: int, granted: Sequence[type[Effect]] = ()) -> list[tuple[int, str]]:
    """Return which terms of a finished fit physics does not allow, and why."""
    found = []
    for place in range(first, len(fit.terms)):
        why = objection(fit, place) or bound(fit, place)
        if why and fit.terms[place].kind not in granted:
            found.append((place, why))
    return found


def in_order(data: FitData, bases: Sequence[Fit], chosen: Chosen
             ) -> tuple[list[Step], list[int]]:
    """Return the chosen effects as steps, the one that explains most first, and the new order.

    Each step has the constants of the whole, its coefficients solved for with what is before it;
    the last one is the whole. The order is that of the terms of a fit, those of the model before
    in front.
    """
    order = list(range(chosen.first))
    left = list(range(chosen.first, len(chosen.fits[0].terms)))
    scale = robust_scale(held_out_residual(data, chosen.fits)[data.usable])
    evidence = {place: evidence_of(data, chosen.fits, place)[0] for place in left}
    steps, now = [], [_starting(base, fit, chosen.first) for base, fit in zip(bases, chosen.fits)]
    while left:
        tried = []
        for place in left:
            fits = [fit.with_term(whole.terms[place]) for fit, whole in zip(now, chosen.fits)]
            tried.append((mean_loss(data, held_out_residual(data, fits), scale), place, fits))
        _, place, now = min(tried, key=lambda entry: entry[0])
        left.remove(place)
        order.append(place)
        if not left:
            now = [fit.reordered(order) for fit in chosen.fits]
        kind = chosen.fits[0].terms[place].kind
        said = {name: value for name, value in evidence[place].items() if name != 'advantage'}
        steps.append(Step(kind, list(now), rms(held_out_residual(data, now)[data.usable]),
                          {**said, **chosen.granted.get(kind, {})}, chosen.rivals.get(kind, [])))
    return steps, order


def _starting(base: Fit, whole: Fit, first: int) -> Fit:
    """Return the model before with the steepness that the whole has, solved."""
    twin = whole.copy()
    twin.terms = list(whole.terms[:first])
    twin.refresh()
    return twin

