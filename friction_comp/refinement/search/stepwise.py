# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which effects the data call for: added one at a time, by the error on stretches not fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friction_comp.model.effects import Effect
from friction_comp.refinement.fit.effect_sum import Fit
from friction_comp.refinement.judge.carry_over import carries_over
from friction_comp.refinement.judge.evidence import advantage, held_out_residual, rms
from friction_comp.refinement.judge.physics import sound
from friction_comp.refinement.prepare.fit_data import FitData
from friction_comp.refinement.search.candidate_fit import (
    adjusted,
    CandidateFit,
    chance_of,
    least_share,
    mean_loss,
    try_kind,
)
from friction_comp.refinement.search.candidates import kinds_for
from friction_comp.refinement.search.masked_effects import hidden_expected, together
from friction_comp.refinement.search.unlisted_products import best_product
from friction_comp.refinement.thresholds import (
    ADJUSTED,
    LEAST_SHARE,
    LEAST_SIZE,
    MOST_EFFECTS,
    PAIR_ROUNDS,
    PRODUCT_ROUNDS,
)

Report = Callable[[float, str], None]


@dataclass
class Chosen:
    """The state of a search: the fits of both folds with what was chosen so far.

    Parameters
    ----------
    fits : list of Fit
    first : int
        How many terms belong to the model before.
    granted : dict
        Evidence of kinds that show only beside something that has no name.
    rivals : dict
        By kind, what explains nearly the same: see `find_rivals`.
    product : type or None
        A product of variables that explained more than every effect with a name.
    stopped : str
        Why no more was added.
    without : tuple of type
        Effects that are never tried.
    """

    fits: list[Fit]
    first: int
    granted: dict[type[Effect], dict[str, Any]] = field(default_factory=dict)
    rivals: dict[type[Effect], list[tuple[type[Effect], float]]] = field(default_factory=dict)
    product: type[Effect] | None = None
    stopped: str = ''
    without: tuple[type[Effect], ...] = ()

    @property
    def kinds(self) -> list[type[Effect]]:
        """The kinds of effects that were chosen."""
        return [term.kind for term in self.fits[0].terms[self.first:]]

    @property
    def complexity(self) -> int:
        """Number of coefficients and searched constants of what was chosen."""
        return sum(
            part.shape[1] + sum(how is not None for how in term.kind.constants.values())
            for term, part in zip(self.fits[0].terms[self.first:],
                                  self.fits[0].parts[self.first + 1:]))


def least_advantage(data: FitData) -> float:
    """Return the advantage in A² that is worth a name, by the size of the signal."""
    return float(LEAST_SIZE * rms(data.samples.current[data.usable])) ** 2


def grow(data: FitData, chosen: Chosen, without: Sequence[type[Effect]] = (),
         report: Report | None = None) -> Chosen:
    """Add the best effect again and again, as long as held-out data call for it.

    Parameters
    ----------
    data : FitData
    chosen : Chosen
        Changed in place.
    without : sequence of type
        Effects that are not tried.
    report : callable, optional
        Called with a share of the work done and a word on it.

    Returns
    -------
    Chosen
    """
    least = least_advantage(data)
    while len(chosen.kinds) < MOST_EFFECTS:
        residual = held_out_residual(data, chosen.fits)
        loss = mean_loss(data, residual)
        kinds = [kind for kind in kinds_for(data, chosen.fits[0].terms)
                 if kind not in (*without, *chosen.without)]
        done = len(chosen.kinds)
        trials = []
        for number, kind in enumerate(kinds):
            if report:
                report((done + number / len(kinds)) / (done + 1.5), kind.name)
            trial = try_kind(data, chosen.fits, residual, kind)
            if trial is not None:
                trials.append(trial)
        trials.sort(key=lambda trial: -trial.advantage)
        trials[:int(ADJUSTED)] = [
            adjusted(data, residual, trial) for trial in trials[:int(ADJUSTED)]]
        if chosen.product is None and done < PRODUCT_ROUNDS:
            chosen.product = best_product(
                data, chosen.fits, residual, trials, max(LEAST_SHARE * loss, least))
        best = first_sound(data, chosen.fits, residual, loss, least, trials, len(kinds))
        if best is not None:
            chosen.fits = best.fits
            chosen.rivals.setdefault(best.kind, []).extend(
                find_rivals(data, best, trials, residual))
            continue
        if not _grow_masked(data, chosen, residual, trials, kinds, least):
            chosen.stopped = ('none of the other effects lowers the error on data not fitted by '
                              'more than chance and a share worth a name')
            return chosen
    chosen.stopped = f'{int(MOST_EFFECTS)} effects are the most that are named'
    return chosen


def _grow_masked(data: FitData, chosen: Chosen, residual: np.ndarray, trials: list[CandidateFit],
                 kinds: list[type[Effect]], least: float) -> bool:
    """Add what shows only beside something else; tell whether there was any."""
    hidden = hidden_expected(data, chosen.fits, residual, kinds)
    if hidden is not None:
        kind, chosen.fits, evidence = hidden
        chosen.granted[kind] = evidence
        return True
    if len(chosen.kinds) >= PAIR_ROUNDS:
        return False
    pair = together(data, chosen.fits, residual, trials, kinds, least)
    if pair is None or not sound(pair.fits, [-2, -1]):
        return False
    chosen.fits = pair.fits
    return True


def first_sound(data: FitData, fits: list[Fit], residual: np.ndarray, loss: float, least: float,
                trials: list[CandidateFit], number: int) -> CandidateFit | None:
    """Return the candidate to take, all its constants adjusted; None where none deserves it.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
        Without it.
    residual : ndarray, shape (N,)
        Their held-out residual.
    loss, least : float
        Mean loss without it, and the advantage that is worth a name, A².
    trials : list of CandidateFit
        Those that were looked at more closely are exchanged for what they came to.
    number : int
        How many kinds were tried.
    """
    def deserves(trial: CandidateFit) -> bool:
        return (trial.p_value < chance_of(trial.kind, number)
                and trial.advantage > max(least_share(trial, data) * loss, least))
    left = [trial for trial in trials if deserves(trial)]
    while left:
        rough = simplest_of_the_best(data, left)
        best = adjusted(data, residual, rough, thorough=True)
        trials[trials.index(rough)] = best
        if deserves(best) and sound(best.fits, [-1]) and carries_over(
                fits, best.fits, len(best.fits[0].terms)):
            return best
        left = [trial for trial in left if trial is not rough]
    return None


def simplest_of_the_best(data: FitData, trials: list[CandidateFit]) -> CandidateFit:
    """Return the simplest candidate within one standard error of the best.

    A clock explains what warms up with it: where an effect that holds on another day explains
    nearly as much, it is taken instead.
    """
    best = max(trials, key=lambda trial: trial.advantage)
    near = [best]
    for trial in trials:
        if trial is best:
            continue
        lead, error, _ = advantage(data, trial.residual, best.residual)
        if lead < error and trial.complexity < best.complexity:
            near.append(trial)
    best = min(near, key=lambda trial: (trial.complexity, -trial.advantage))
    if best.kind.holds_on_another_day:
        return best
    causes = [trial for trial in trials
              if trial.kind.holds_on_another_day and alike(data, best, trial)]
    return max(causes, key=lambda trial: trial.advantage, default=best)


def as_good(error: float, advantage_of_best: float) -> float:
    """Return the lead in A² up to which a cause is preferred to a clock."""
    return 2.0 * error + 0.1 * advantage_of_best


def alike(data: FitData, first: CandidateFit, second: CandidateFit) -> bool:
    """Tell whether a second candidate explains what a first one does, nearly as well."""
    lead, error, _ = advantage(data, second.residual, first.residual)
    if lead > as_good(error, first.advantage):
        return False
    parts = [trial.fits[0].whole[-1][data.usable]
             @ trial.fits[0].own_coefficients()[-1] for trial in (first, second)]
    if not all(np.std(part) > 0 for part in parts):
        return False
    return float(np.corrcoef(*parts)[0, 1]) > 0.8


def find_rivals(data: FitData, chosen: CandidateFit, trials: list[CandidateFit],
                residual: np.ndarray) -> list[tuple[type[Effect], float]]:
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
