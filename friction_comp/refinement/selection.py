# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which effects the data call for: one at a time, by the error on stretches not fitted."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from friction_comp.refinement import newton
from friction_comp.refinement.candidates import best_term, kinds_for, plausible
from friction_comp.refinement.evidence import advantage, held_out_residual, rms
from friction_comp.refinement.fitting import huber_loss, robust_scale, Term
from friction_comp.refinement.hidden import beside_nuisance, INERTIA, loud, with_inertia
from friction_comp.refinement.nameless import better, products_for

# Chance of any wrong effect in a step, over all candidates together.
ALPHA = 0.01
# An effect has to lower the held-out loss by this share (the error by half of it), or it is not
# worth its place: less may be a base that is not quite of the right shape.
LEAST_SHARE = 0.04
# The same for a lag of a sample or two, which may be how the signals were sampled.
_SHARE_OF_SHORT_LAG = 0.16
# Nor one whose current is a smaller share of the signal than this: no drive is known as well.
LEAST_SIZE = 0.003
# Every drive has inertia, so that half of the chance is kept for it and the others share the rest.
_EXPECTED = 'inertia'
_MOST_EFFECTS = 10
_POLISHED = 3


@dataclass
class Trial:
    """A candidate effect, fitted in both folds."""

    kind: type
    fits: list
    residual: np.ndarray
    advantage: float = 0.0
    error: float = 0.0
    p_value: float = 1.0

    @property
    def complexity(self):
        """Number of coefficients and searched constants."""
        term = self.fits[0].terms[-1]
        searched = sum(how is not None for how in term.kind.constants.values())
        free = term.kind.columns(self.fits[0].samples.take(slice(0, 3)), **term.constants).shape[1]
        return searched + free


@dataclass
class Step:
    """An effect that was added: how, and what else would have done nearly as well."""

    kind: type
    fits: list
    held_out_rmse: float
    evidence: dict
    rivals: list = field(default_factory=list)


def try_kind(data, fits, residual, kind):
    """Fit one more effect in both folds; None where it makes no sense.

    A fold may hold too little of the effect to tell its variant (a bump crossed in one direction
    only). Where the folds disagree, either's variant is tried in both.
    """
    terms = [best_term(fit, kind) for fit in fits]
    if any(term is None for term in terms):
        return None
    choices = [terms]
    fixed = [name for name, how in kind.constants.items() if how is None and name != 'transition']
    if any(terms[0].constants[name] != terms[1].constants[name] for name in fixed):
        for term in terms:
            if 'lag' in term.constants:
                choices.append([term, term])
                continue
            variant = {name: term.constants[name] for name in fixed}
            choices.append([
                fit.search(Term(kind, {**own.constants, **variant}))[0]
                for fit, own in zip(fits, terms)])
    best = None
    for choice in choices:
        grown = [fit.with_term(term) for fit, term in zip(fits, choice)]
        if not all(plausible(fit) for fit in grown):
            continue
        trial = Trial(kind, grown, held_out_residual(data, grown))
        trial.advantage, trial.error, trial.p_value = advantage(data, residual, trial.residual)
        if best is None or trial.advantage > best.advantage:
            best = trial
    return best


def least_share(trial, data):
    """Return the share of the loss that an effect has to take away to be worth its place.

    A lag of a sample or two may be how the signals were sampled, and asks for more.
    """
    if trial.kind.name != 'actuation_lag':
        return LEAST_SHARE
    lag = min(abs(fit.terms[-1].constants['lag']) for fit in trial.fits)
    return LEAST_SHARE if lag > 2.0 * data.scene.sample_time else _SHARE_OF_SHORT_LAG


def chance_of(kind, number):
    """Return the p-value an effect must stay below as one of a number tried (Bonferroni)."""
    return 0.5 * ALPHA if kind.name == _EXPECTED else 0.5 * ALPHA / max(number - 1, 1)


def polish(data, residual, trial, thorough=False):
    """Adjust all constants of a trial together and count its advantage anew."""
    trial.fits = [(newton.polished if thorough else newton.polish)(fit) for fit in trial.fits]
    trial.residual = held_out_residual(data, trial.fits)
    trial.advantage, trial.error, trial.p_value = advantage(data, residual, trial.residual)


def select(data, fits, report=None):
    """Add effects as long as held-out data call for them.

    Parameters
    ----------
    data : Data
    fits : list of Fit
        The base model, fitted once for each fold.
    report : callable, optional
        Called with a share of the work done and a word on it.

    Returns
    -------
    list of Step
    list of type
        Products of variables that explain more than any effect with a name: see `nameless`.
    """
    steps, nameless = [], []
    residual = held_out_residual(data, fits)
    least = (LEAST_SIZE * rms(data.samples.current[data.usable])) ** 2
    while len(steps) < _MOST_EFFECTS:
        loss = float(np.mean(huber_loss(residual, robust_scale(residual[data.usable]))[
            data.usable]))
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
            polish(data, residual, trial)
        worthy = [trial for trial in trials
                  if trial.p_value < chance_of(trial.kind, len(kinds))
                  and trial.advantage > max(least_share(trial, data) * loss, least)]
        for product in products_for(data):
            trial = None if product in nameless else try_kind(data, fits, residual, product)
            if trial is not None and better(trial, trials, chance_of(product, len(kinds))) and (
                    trial.advantage > max(LEAST_SHARE * loss, least)):
                nameless.append(product)
        taken = {variable for product in nameless for variable in product.variables}
        worthy = [trial for trial in worthy
                  if trial.kind is INERTIA or trial.kind.variable not in taken]
        if not worthy:
            hidden = hidden_inertia(data, fits, residual, kinds)
            if hidden is None:
                break
            steps.append(hidden)
            fits = hidden.fits
            residual = held_out_residual(data, fits)
            continue
        chosen = simplest_of_the_best(data, worthy)
        polish(data, residual, chosen, thorough=True)
        fits = chosen.fits
        polished = chosen.residual
        rivals = find_rivals(data, chosen, trials, residual)
        steps.append(Step(
            chosen.kind, fits, rms(polished[data.usable]),
            {'loss_reduction': chosen.advantage / loss,
             'standard_errors': chosen.advantage / max(chosen.error, 1e-300),
             'p_value': chosen.p_value, 'candidates': len(kinds)}, rivals))
        residual = polished
    return prune(data, steps, least), nameless


def hidden_inertia(data, fits, residual, kinds):
    """Return a step for inertia that a larger effect without a name hides, None if there is none.

    Parameters
    ----------
    data : Data
    fits : list of Fit
    residual : ndarray, shape (N,)
    kinds : list of type
        What may be tried still.
    """
    if INERTIA not in kinds or not loud(data, residual):
        return None
    free = beside_nuisance(data, fits)
    without = held_out_residual(data, free)
    trial = try_kind(data, free, without, INERTIA)
    if trial is None or trial.p_value > chance_of(INERTIA, len(kinds)):
        return None
    loss = float(np.mean(huber_loss(without, robust_scale(without[data.usable]))[data.usable]))
    grown = with_inertia(fits)
    if grown is None or trial.advantage < LEAST_SHARE * loss:
        return None
    return Step(INERTIA, grown, rms(held_out_residual(data, grown)[data.usable]), {
        'loss_reduction': trial.advantage / loss,
        'standard_errors': trial.advantage / max(trial.error, 1e-300),
        'p_value': trial.p_value, 'candidates': len(kinds),
        'beside': 'free levels over position and time, since something larger has no name'})


def prune(data, steps, least):
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
        loss = float(np.mean(huber_loss(full, robust_scale(full[data.usable]))[data.usable]))
        missed, _, p_value = advantage(data, held_out_residual(data, poorer), full)
        if missed < 3.0 * max(LEAST_SHARE * loss, least):
            poorer = [newton.polished(fit) for fit in poorer]
            missed, _, p_value = advantage(data, held_out_residual(data, poorer), full)
        if missed < max(LEAST_SHARE * loss, least) or p_value > ALPHA:
            steps = without_step(data, steps, place, poorer)
        place -= 1
    return steps


def without_step(data, steps, place, fits):
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


def simplest_of_the_best(data, trials):
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


def find_rivals(data, chosen, trials, residual):
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
