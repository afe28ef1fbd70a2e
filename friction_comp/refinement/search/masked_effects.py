# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the search for one effect at a time passes over: hidden inertia, and pairs of effects."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit.effect_sum import Term
from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.judge.evidence import held_out_residual
from friction_comp.refinement.judge.physics import objection
from friction_comp.refinement.judge.scores import noise_floor
from friction_comp.refinement.search.candidate_fit import (
    adjusted,
    mean_loss,
    try_kind,
)
from friction_comp.refinement.search.candidates import best_gain
from friction_comp.refinement.search.unlisted_products import Nameless
from friction_comp.refinement.thresholds import (
    ADJUSTED,
    ALPHA,
    CLEARLY_ABOVE_NOISE,
    EXPECTED,
    LEAST_SHARE,
)
from friction_comp.series import quantile_edges

if TYPE_CHECKING:
    from friction_comp.model.effects import Effect
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.refinement.search.candidate_fit import CandidateFit
    from friction_comp.samples import Samples

_POSITIONS, _TIMES = 16, 12
# Effects that a second one is tried beside.
_FIRSTS = 3


def nuisance_of(samples: Samples) -> Any:
    """Return a stand-in for an effect: any step function of position and of time.

    Each has its own level in either direction, so that it takes up what no effect known to the
    package describes, however coarsely. It is never part of a model.

    Parameters
    ----------
    samples : Samples

    Returns
    -------
    type
        With the class method `matrix` of an effect.
    """
    cuts = (quantile_edges(samples.position, _POSITIONS), quantile_edges(samples.time, _TIMES))

    class Nuisance(Nameless):
        """Levels of cells of position and of time, in either direction."""

        name = variable = 'nuisance'

        @classmethod
        def matrix(cls, samples: Any, constants: Any) -> Any:
            """Return one column of zeros and ones for each cell, shape (N, M)."""
            side = (samples.velocity > 0).astype(int)
            parts = []
            for cut, values in zip(cuts, (samples.position, samples.time)):
                cell = 2 * np.searchsorted(cut, values, side='right') + side
                parts.append(np.eye(2 * len(cut) + 2)[cell])
            return np.hstack(parts)
    return Nuisance


def exceeds_noise(data: FitData, residual: np.ndarray) -> bool:
    """Tell whether a residual is much larger than what changes from sample to sample.

    Parameters
    ----------
    data : FitData
    residual : ndarray, shape (N,)
    """
    floor = noise_floor(data.samples, data.usable, residual)
    return robust_scale(residual[data.usable]) > CLEARLY_ABOVE_NOISE * floor


def beside_nuisance(data: Any, fits: Any) -> Any:
    """Return fits that have the freedom of `nuisance_of` as well."""
    term = Term(nuisance_of(data.samples.take(data.usable)), {})
    return [fit.with_term(term) for fit in fits]


def with_expected(fits: Any, kind: Any) -> Any:
    """Return fits with an effect that every drive has, None where its sign would be wrong."""
    grown = [fit.with_term(Term(kind, {})) for fit in fits]
    return None if any(objection(fit, -1) for fit in grown) else grown


def hidden_expected(data: FitData, fits: list[Fit], residual: np.ndarray,
                    kinds: list[type[Effect]]
                    ) -> tuple[type[Effect], list[Fit], dict[str, Any]] | None:
    """Return what every drive has and a larger effect without a name hides, None if there is none.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
    residual : ndarray, shape (N,)
    kinds : list of type
        What may be tried still.

    Returns
    -------
    (type, list of Fit, dict) or None
        Kind, fits of both folds with it, and its evidence.
    """
    kind = next((kind for kind in kinds if kind.expected), None)
    if kind is None or not exceeds_noise(data, residual):
        return None
    free = beside_nuisance(data, fits)
    without = held_out_residual(data, free)
    trial = try_kind(data, free, without, kind)
    if trial is None or trial.p_value > 0.5 * ALPHA:
        return None
    loss = mean_loss(data, without)
    grown = with_expected(fits, kind)
    if grown is None or trial.advantage < LEAST_SHARE * loss:
        return None
    return kind, grown, {
        'loss_reduction': trial.advantage / loss,
        'standard_errors': trial.advantage / max(trial.error, 1e-300), 'p_value': trial.p_value,
        'beside': 'free levels over position and time, since something larger has no name'}


def _chance_of_pair(first: type[Effect], second: type[Effect], number: int) -> float:
    """Return the p-value that two effects together must stay below, of a number of kinds tried."""
    both = (first, second)
    # What other joints ask was found beside the joint's own weight and inertia, and needs them.
    if any(kind.shown_before for kind in both) and all(
            kind.shown_before or kind.expected or kind.weight for kind in both):
        return EXPECTED
    # What every drive has is no guess: then the other one alone was picked.
    one = any(kind.expected for kind in both)
    return ALPHA / ((1 if one else _FIRSTS) * number)


def together(data: FitData, fits: list[Fit], residual: np.ndarray, trials: list[CandidateFit],
             kinds: list[type[Effect]], least: float) -> CandidateFit | None:
    """Return the fits with two effects that help only together, None if there are no such.

    Load torque that is not in the model hides friction that grows with the load, and the other way
    round: neither lowers the held-out error alone. A second effect is tried beside each of those
    that fit best where they were fitted.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
    residual : ndarray, shape (N,)
    trials : list of CandidateFit
        Of one effect each.
    kinds : list of type
        What may be tried.
    least : float
        Advantage in A² that is worth a name.

    Returns
    -------
    CandidateFit or None
        Of the second effect, beside the first.
    """
    if not exceeds_noise(data, residual):
        return None

    def fitted(trial: Any) -> Any:
        return sum(float(np.mean(np.abs(fit.left))) for fit in trial.fits)
    firsts = sorted(trials, key=fitted)[:_FIRSTS]
    pairs = []
    for trial in firsts:
        # A lag shows at every reversal, whatever else is there: it is no second of a pair.
        gains = {kind: sum(best_gain(fit, kind) for fit in trial.fits)
                 for kind in kinds if not (kind is trial.kind and kind.most == 1)
                 and not kind.reshapes}
        for kind in sorted(gains, key=lambda kind: -gains[kind])[:int(ADJUSTED)]:
            pair = try_kind(data, trial.fits, residual, kind)
            if pair is not None:
                pairs.append((pair, _chance_of_pair(trial.kind, kind, len(kinds))))
    if not pairs:
        return None
    # Of those that chance does not explain the one that explains most: two that take many shapes
    # lower the error further, and as often by chance.
    best, chance = max(
        pairs, key=lambda entry: (entry[0].p_value < entry[1], entry[0].advantage))
    best = adjusted(data, residual, best)
    worth = max(2.0 * LEAST_SHARE * mean_loss(data, residual), least)
    return best if best.p_value < chance and best.advantage > worth else None
