# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Difference between the directions that the sigmoid has taken up, given its name."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.effects.direction_asymmetry import DirectionAsymmetry
from friction_comp.refinement.fit.effect_sum import Term
from friction_comp.refinement.judge.evidence import advantage, held_out_residual, rms
from friction_comp.refinement.search.candidate_fit import Step
from friction_comp.refinement.thresholds import ALPHA, ASYMMETRY

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.samples import Samples

_KIND = DirectionAsymmetry


def without_offset(fit: Any, known: Any) -> Any:
    """Return a fit whose sigmoid must have the offset that is known, in A."""
    twin = fit.copy()
    twin.offset = np.full(len(fit.data.samples), known)
    twin.scale_columns(-1, np.array([0.0, 1.0, 1.0]))
    twin.solve()
    return twin


def coulomb_of(fit: Fit) -> float:
    """Return the Coulomb friction in A of a fit: the sigmoid's and that which builds up."""
    coulomb, place = float(fit.coefficients[1]), 3
    for term, part in zip(fit.terms, fit.parts[1:]):
        if term.kind.coulomb_column is not None:
            coulomb += float(fit.coefficients[place + term.kind.coulomb_column])
        place += part.shape[1]
    return coulomb


def named_asymmetry(data: FitData, fits: list[Fit], steps: list[Step],
                    known: float = 0.0) -> Step | None:
    """Return a step for the asymmetry in the sigmoid, or None where it is not worth a name.

    The sigmoid of Eq. 6 may have another plateau in each direction, so that it takes up a
    constant offset or Coulomb friction that differs between the directions without any effect
    being added. Where the difference is large it is reported like any other effect.

    Parameters
    ----------
    data : FitData
    fits : list of Fit
        Of both folds, the effects included.
    steps : list of Step
        What was added so far.
    known : float
        Half the sum of the plateaus of the model before, A.
    """
    if any(step.kind.holds_offset(data.scene) for step in steps) or not both_directions(data):
        return None
    for fit in fits:
        if abs(fit.coefficients[0] - known) < ASYMMETRY * abs(coulomb_of(fit)):
            return None
    full = held_out_residual(data, fits)
    even = held_out_residual(data, [without_offset(fit, known) for fit in fits])
    gain, error, p_value = advantage(data, even, full)
    if p_value > ALPHA:
        return None
    return Step(
        _KIND, [fit.with_term(Term(_KIND, {'offset': 1.0, 'transition': fit.transition}))
                for fit in fits], rms(full[data.usable]),
        {'standard_errors': gain / max(error, 1e-300), 'p_value': p_value,
         'note': 'the sigmoid of the model before has taken it up; compared is a sigmoid that is '
                 'the same in both directions'})


def both_directions(data: FitData) -> bool:
    """Tell whether the data hold motion in both directions."""
    share = float(np.mean(data.samples.velocity[data.usable] > 0))
    return 0.1 < share < 0.9


def carve_out(model: FrictionModel, samples: Samples, usable: np.ndarray) -> FrictionModel:
    """Move the sigmoid's asymmetry into the model's effect of that name, where it has one.

    The current predicted in motion stays the same. At rest it depends on what the difference is:
    an offset stays, Coulomb friction vanishes. Rest in the recording decides.
    """
    place = next((k for k, effect in enumerate(model.effects) if isinstance(effect, _KIND)), None)
    if place is None:
        return model
    effect, sigmoid = model.effects[place], model.sigmoid
    middle = 0.5 * (sigmoid.upper + sigmoid.lower)
    a, b = effect.coefficients
    total = a + middle
    half = 0.5 * (sigmoid.upper - sigmoid.lower)
    model.sigmoid = type(sigmoid)(upper=half, lower=-half, steepness=sigmoid.steepness,
                                  shift=sigmoid.shift, viscous=sigmoid.viscous)
    values = {**effect.values, 'offset': 1.0, 'coefficients': [total, b]}
    model.effects[place] = _KIND(values)
    resting = np.abs(samples.velocity) < 0.2 * np.percentile(np.abs(samples.velocity[usable]), 5)
    if resting.sum() > 100:
        left = samples.current[resting] - model.current(samples)[resting]
        # With Coulomb's asymmetry the prediction at rest would be lower by all of it.
        if abs(np.median(left) + total) < abs(np.median(left)):
            model.effects[place] = _KIND({**values, 'offset': 0.0})
    return model
