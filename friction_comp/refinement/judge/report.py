# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The content of report.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from friction_comp.model.effects.base import Effect
from friction_comp.model.effects.scene import RESISTS, too_coarse
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.fit.harmonics import exact_families, Family
from friction_comp.refinement.fit.uncertainty import intervals
from friction_comp.refinement.judge.caveats import ambiguities, warnings
from friction_comp.refinement.judge.control import Control
from friction_comp.refinement.judge.residual_dependence import ResidualDependence
from friction_comp.refinement.judge.residual_verdict import clipping
from friction_comp.refinement.judge.scores import noise_floor, scores, words_of
from friction_comp.refinement.judge.verdict import verdict_of
from friction_comp.refinement.prepare.coupling_choice import moved_beside
from friction_comp.refinement.prepare.differentiation_choice import velocity_against_position
from friction_comp.refinement.prepare.fit_data import FitData
from friction_comp.refinement.search.candidate_fit import Step
from friction_comp.refinement.units import in_unit
from friction_comp.samples import Samples


@dataclass(frozen=True)
class Outcome:
    """All that a report is made of.

    Parameters
    ----------
    raw, samples : Samples
        As recorded, and with velocity and acceleration.
    usable, clipped : ndarray of bool, shape (N,)
    data : FitData
    steps : list of Step
    start, model : FrictionModel
        Before and after.
    before, after : ndarray, shape (N,)
        Held-out residuals, A.
    trail : list of (str, float)
    left : list of ResidualDependence
    control : Control
    stopped : str
        Why the search ended.
    given : bool
        Whether the start was given.
    unit : str
        Of the current.
    settings : dict
        How velocity was derived from position.
    """

    raw: Samples
    samples: Samples
    usable: np.ndarray
    clipped: np.ndarray
    data: FitData
    steps: list[Step]
    start: FrictionModel
    model: FrictionModel
    before: np.ndarray
    after: np.ndarray
    trail: list[tuple[str, float]]
    left: list[ResidualDependence]
    control: Control
    stopped: str
    given: bool
    unit: str
    settings: dict[str, Any]


def report_of(outcome: Outcome) -> dict[str, Any]:
    """Return the content of report.json."""
    o, samples, usable = outcome, outcome.samples, outcome.usable
    left, clip = list(o.left), clipping(samples, o.clipped)
    if clip:
        left.append(clip)
    first = 'the given model' if o.given else 'sigmoid of Eq. 6 fitted to the recording'
    if o.data.load_coefficient:
        first += ', the measured load carried as mechanics asks'
    start_fit, after_fit = (samples.current - model.current(samples)
                            for model in (o.start, o.model))
    last = 'the model before' if o.given else 'sigmoid of Eq. 6'
    report = {
        'unit': o.unit, 'joint': o.model.joint, 'samples': len(samples),
        'samples_in_motion': int(usable.sum()),
        'samples_clipped': int(o.clipped.sum()),
        'held_out': o.data.folds.words,
        'signal_rms': float(np.sqrt(np.mean(samples.current[usable] ** 2))),
        'before': {'model': first, **scores(samples.current, start_fit, o.before, usable)},
        'after': {'model': words_of(o.model, last),
                  **scores(samples.current, after_fit, o.after, usable)},
        'noise_floor': noise_floor(samples, usable, o.after),
        'effects': _effects(o),
        'unexplained': [
            {'variable': item.variable, 'strength': item.strength,
             'note': in_unit(item.note, o.unit)} for item in left],
        'ambiguous': ambiguities(o.data.samples, o.data.usable, o.steps),
        'warnings': _warnings(o, clip),
        'differentiation': dict(o.settings),
        'stopped_because': o.stopped,
    }
    verdict = verdict_of(report, o.control, without_friction(o.model),
                         too_coarse(o.data.scene))
    report['verdict'], report['reasons'] = verdict.word, verdict.reasons
    report['record_again'] = verdict.recordings
    return report


def without_friction(model: FrictionModel) -> bool:
    """Tell whether nothing in a model resists the motion: the signs of a drive left no friction."""
    base = model.sigmoid
    return base.upper <= base.lower and (not model.effects or (base.viscous <= 0.0 and not any(
        effect.role == RESISTS for effect in model.effects)))


def _effects(o: Outcome) -> list[dict[str, Any]]:
    """Return the entries of the effects; ripples of one family are one entry with their base."""
    # A load that mechanics asks for is the last effect of either model, and was not found.
    first = len(o.start.effects) - bool(o.data.load_coefficient)
    found = slice(first, first + len(o.steps))
    own = o.model.effects[found]
    if not own:
        return []
    bounds = intervals(o.model, o.data)[found]
    entries = [
        {'name': effect.name, 'variable': effect.variable, 'held_out_rmse': error,
         'evidence': step.evidence, 'parameters': effect.parameters, 'intervals': bound,
         'holds_on_another_day': effect.holds_on_another_day,
         'in_words': in_unit(effect.describe(), o.unit), 'formula': effect.formula()}
        for effect, bound, step, (_, error) in zip(own, bounds, o.steps, o.trail[1:])]
    dropped: set[int] = set()
    for family in exact_families(own):
        places = sorted(family.orders)
        entries[places[0]] = _family_entry(own, entries, family)
        dropped.update(places[1:])
    return [entry for place, entry in enumerate(entries) if place not in dropped]


def _family_entry(own: list[Effect], entries: list[dict[str, Any]],
                  family: Family) -> dict[str, Any]:
    places = sorted(family.orders)
    orders = sorted(set(family.orders.values()))
    leading = entries[places[0]]
    parts = '; '.join(entries[place]['in_words'] for place in places)
    low_high = [entries[place]['intervals'][own[place].spectral] for place in places]
    low, high = (max(bound[0] / family.orders[place] for bound, place in zip(low_high, places)),
                 min(bound[1] / family.orders[place] for bound, place in zip(low_high, places)))
    first = (f'Ripple of {family.base:.5g} a turn' + (
        '' if orders == [1] else f' and its multiples ({", ".join(map(str, orders))} times)'))
    return {
        **leading,
        'evidence': min((entries[place]['evidence'] for place in places),
                        key=lambda evidence: evidence.get('standard_errors', 0.0)),
        'parameters': {
            'base': family.base, 'orders': [family.orders[place] for place in places],
            'coefficients': [entries[place]['parameters']['coefficients'] for place in places],
            'members': [{'name': own[place].name, **entries[place]['parameters']}
                        for place in places]},
        'intervals': {
            'base': sorted((low, high)),
            'coefficients': [entries[place]['intervals']['coefficients'] for place in places],
            'members': [entries[place]['intervals'] for place in places]},
        'in_words': f'{first}: {parts}',
        'formula': ' '.join(entries[place]['formula'] for place in places)}


def _warnings(o: Outcome, clip: ResidualDependence | None) -> list[str]:
    found = [line for line in (o.control.law, o.control.sequence, o.control.answer)
             if line]
    found += warnings(o.samples, o.data.scene)
    if clip:
        found.append(in_unit(clip.note[0].upper() + clip.note[1:] + '.', o.unit))
    beside = moved_beside(o.raw)
    if beside:
        found.append(
            f'Other joints moved too ({", ".join(beside)}), and nothing certain was found of what '
            'their weight and acceleration ask of this one: what is named gravity, spring, inertia '
            'or left unexplained may be theirs.')
    at_odds = velocity_against_position(o.raw)
    return [*found, at_odds] if at_odds else found
