# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One more effect on trial: fitted in both folds, and how sure it is that it helps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit import gauss_newton as optimizer
from friction_comp.refinement.fit.effect_sum import Fit, Term
from friction_comp.refinement.fit.robust_regression import huber_loss, robust_scale
from friction_comp.refinement.judge.evidence import advantage, held_out_residual
from friction_comp.refinement.judge.physics import objection
from friction_comp.refinement.remembered import remembered
from friction_comp.refinement.search.candidates import best_forms, best_term, searched
from friction_comp.refinement.thresholds import ALPHA, EXPECTED, LEAST_SHARE

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """A candidate effect, fitted in both folds."""

    kind: type[Effect]
    fits: list[Any]
    residual: np.ndarray
    advantage: float = 0.0
    error: float = 0.0
    p_value: float = 1.0

    @property
    def complexity(self) -> int:
        """Number of coefficients and searched constants."""
        term = self.fits[0].terms[-1]
        searched = sum(how is not None for how in term.kind.constants.values())
        free = term.columns(self.fits[0].samples.take(slice(0, 3)), 0.0).shape[1]
        return searched + free


@dataclass
class Step:
    """An effect that was added: with what before it, and what evidence it has at the end.

    Parameters
    ----------
    kind : type
    fits : list of Fit
        Of both folds, with this effect and those before it.
    held_out_rmse : float
        A.
    evidence : dict
        Against the final model without it, everything else fitted again.
    rivals : list of (type, float)
        What explains nearly the same, and the correlation.
    """

    kind: type[Effect]
    fits: list[Fit]
    held_out_rmse: float
    evidence: dict[str, Any]
    rivals: list[Any] = field(default_factory=list)


@remembered
def try_kind(data: FitData, fits: list[Fit], residual: np.ndarray,
             kind: type[Effect]) -> CandidateFit | None:
    """Fit one more effect in both folds; None where it makes no sense.

    A fold may hold too little of the effect to tell its variant (a bump crossed in one direction
    only). Where the folds disagree, either's variant is tried in both.
    """
    if kind.reshapes:
        return _best_form(data, fits, residual, kind)
    terms = [best_term(fit, kind) for fit in fits]
    if any(term is None for term in terms):
        return None
    choices = [terms]
    fixed = [name for name, how in kind.constants.items() if how is None and name != 'transition']
    if any(terms[0].constants[name] != terms[1].constants[name] for name in fixed):
        for term in terms:
            variant = {name: term.constants[name] for name in fixed}
            choices.append([
                searched(fit, Term(kind, {**own.constants, **variant}))
                for fit, own in zip(fits, terms)])
    best = None
    for choice in choices:
        grown = [fit.with_term(term) for fit, term in zip(fits, choice)]
        if any(objection(fit, -1) for fit in grown):
            continue
        trial = compared(data, residual, kind, grown)
        if best is None or trial.advantage > best.advantage:
            best = trial
    return best


def _best_form(data: FitData, fits: list[Fit], residual: np.ndarray,
               kind: type[Effect]) -> CandidateFit | None:
    """Return the trial of the form that helps most, its constants adjusted with all else."""
    best = None
    for choice in zip(*(best_forms(fit, kind) for fit in fits)):
        if any(term is None for term in choice):
            continue
        trial = adjusted(data, residual, CandidateFit(
            kind, [fit.with_term(term) for fit, term in zip(fits, choice)], residual))
        if not any(objection(fit, -1) for fit in trial.fits) and (
                best is None or trial.advantage > best.advantage):
            best = trial
    return best


def least_share(trial: CandidateFit, data: FitData) -> float:
    """Return the share of the loss that an effect has to take away to be worth its place."""
    return max(trial.kind.worth(LEAST_SHARE, fit.terms[-1].constants, data.scene)
               for fit in trial.fits)


def chance_of(kind: type[Effect], number: int) -> float:
    """Return the p-value an effect must stay below as one of a number tried (Bonferroni).

    What every drive has is not one of many candidates for what is going on, and what a search of
    its own has found is none any more.

    Parameters
    ----------
    kind : type
    number : int
        How many were tried; 1 for what is in the model.
    """
    return EXPECTED if kind.expected or kind.shown_before else ALPHA / max(number, 1)


def compared(data: FitData, residual: np.ndarray, kind: type[Effect],
             fits: list[Fit]) -> CandidateFit:
    """Return the trial of fits with one more effect, its advantage over a residual counted."""
    left = held_out_residual(data, fits)
    return CandidateFit(kind, fits, left, *advantage(data, residual, left))


@remembered
def adjusted(data: FitData, residual: np.ndarray, trial: CandidateFit,
             thorough: bool = False) -> CandidateFit:
    """Return a trial with all constants adjusted together, its advantage counted again."""
    adjust = optimizer.gauss_newton_restarted if thorough else optimizer.gauss_newton
    return compared(data, residual, trial.kind, [adjust(fit) for fit in trial.fits])


def mean_loss(data: FitData, residual: np.ndarray, scale: float | None = None) -> float:
    """Return the mean Huber loss of the usable samples, A².

    Parameters
    ----------
    data : FitData
    residual : ndarray, shape (N,)
    scale : float, optional
        Standard deviation in A beyond which it is linear; that of the residual when omitted.
    """
    values = residual[data.usable]
    return float(np.mean(huber_loss(values, scale or robust_scale(values))))
