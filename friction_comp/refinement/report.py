# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles the report, whose figures describe the model that is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friction_comp.model.differentiation import DEFAULT_SETTINGS
from friction_comp.model.friction_numbers import friction_of, FrictionNumbers
from friction_comp.refinement import judge
from friction_comp.refinement.best_fit import Fit, Problem
from friction_comp.refinement.dependence import remaining_dependences
from friction_comp.refinement.effect_columns import Term
from friction_comp.refinement.findings import in_unit, verdict_of
from friction_comp.refinement.intervals import Intervals
from friction_comp.refinement.result import (
    Finding,
    FoundEffect,
    Origin,
    Predicted,
    RefinementReport,
)
from friction_comp.statistics import rms

# A load coefficient that deviates from -1/(k_t·n) by more is another one.
_SAME_LOAD = 0.02


def report_of(problem: Problem, fit: Fit, bounds: Intervals, start: Predicted, refined: Predicted,
              origin: Origin) -> RefinementReport:
    """Return the report on a model.

    `refined` is `start`, the initial model, if no refined one predicts better; the findings are
    then those of the best fit.
    """
    rows, raw, given = fit.rows, problem.raw, problem.model is not None
    model, unit, kept = refined.model, origin.unit, refined is start
    # In order of time.
    order = np.argsort(rows.start)
    dependences = remaining_dependences(
        rows.at_rows.take(order), rows.averaged(refined.held_out)[order], rows.coverage.slowest)
    between = judge.other_recordings(fit)
    friction = friction_of(model, unit)
    effects = [] if kept else effects_of(problem, fit, bounds, friction, unit)
    questions = [] if kept else judge.ambiguities(fit)
    base = 'the given model' if given else 'sigmoid of Eq. 6 fitted to the recording'
    if rows.load_coefficient and not given:
        base += ', the measured load taken as it is'
    name = ' + '.join(['the given model' if given else 'sigmoid of Eq. 6',
                       *(effect.name for effect in effects)])
    errors = judge.errors_of(rows, refined, name, max(
        between[0], judge.error_by_steps(raw, refined, rows.usable)))
    notes = _notes(problem, refined)
    # Only where the unit of position was assumed, not given.
    if any(' in rad' in one.partition(' (')[0] for one in origin.assumed):
        notes += judge.other_turn(effects)
    verdict = verdict_of([
        *judge.findings_on_numbers(friction, errors.held_out_rmse, float(np.abs(
            rows.target).max())),
        *judge.findings(fit, raw, errors, dependences, questions, between), *notes], unit)
    return RefinementReport(
        unit=unit, joint=model.joint, samples=len(raw), samples_in_motion=int(rows.usable.sum()),
        samples_clipped=int(rows.clipped.sum()),
        held_out=f'{rows.blocks} regimes of motion (by position, velocity, acceleration and load, '
        'or by posture), each predicted by a fit to all others',
        signal_rms=rms(raw.current[rows.usable]), before=judge.errors_of(rows, start, base),
        after=errors, noise_floor=judge.noise_floor(rows, refined.held_out), effects=effects,
        friction=friction,
        assumed=list(origin.assumed),
        unexplained=[replace(dependence, note=in_unit(dependence.note, unit))
                     for dependence in dependences],
        ambiguous=questions,
        differentiation=dict(model.differentiation or DEFAULT_SETTINGS if kept else fit.settings),
        stopped_because='no further effect predicts motion that was not fitted better by more '
                        'than chance would',
        **{**vars(verdict), 'warnings': [*verdict.warnings, *origin.warnings]})


def _notes(problem: Problem, refined: Predicted) -> list[Finding]:
    """Return what to know of friction at rest."""
    notes, model = [], refined.model
    what = 'Presliding is' if model.breakaway else 'Breakaway and presliding are'
    if refined.no_presliding:
        notes.append(Finding(
            'not_known', f'{what} not known, which a law needs at starts and turns: '
            f'{refined.no_presliding}. Ten slow reversals (a sine of 0.1 Hz) at 500 Hz or more '
            'show it.'))
    old, now = problem.model and problem.model.breakaway, model.breakaway
    if old and now and now != old:
        notes.append(Finding(
            'not_known', 'Breakaway friction was not measured here: it is that of the given model, '
            f'times {now.friction / old.friction:.3g} as friction in sliding. Identification '
            'measures it.'))
    return notes


def effects_of(problem: Problem, fit: Fit, bounds: Intervals, friction: FrictionNumbers, unit: str
               ) -> list[FoundEffect]:
    """Return the effects, those first that lower the error most.

    All terms of other joints' weight and inertia make one. Inertia has the interval that it has
    among the numbers of `friction`.
    """
    chosen, remaining = fit.terms[:fit.initial_count], fit.terms[fit.initial_count:]
    entries: list[FoundEffect] = []
    # A shorter lag is due to sampling; a negative one, due to a filter of a sensor.
    if fit.lag >= fit.rows.samples.sample_time:
        entries.append(FoundEffect(
            name='actuation_lag', variable='history', held_out_rmse=fit.rmse_with(chosen),
            chosen=1.0, parameters={'lag': fit.lag}, intervals={}, holds_on_another_day=None,
            in_words=f'Lag: the torque is {1e3 * fit.lag:.3g} ms later than the current',
            formula=f'i(t + {fit.lag:.4g} s)'))
    while remaining:
        groups = [term for term in remaining if term.group and term.group.kind != 'friction']
        candidates = [[term] for term in remaining if term not in groups]
        if groups:
            candidates.append(groups)
        error, index = min((fit.rmse_with([*chosen, *terms]), index)
                           for index, terms in enumerate(candidates))
        terms = candidates[index]
        chosen += terms
        remaining = [term for term in remaining if term not in terms]
        if terms is groups or not is_known_load(problem, fit, terms[0]):
            entry = _found_effect(fit, bounds, terms, error, unit)
            if ends := friction.intervals.get(entry.name):
                entry = replace(entry, intervals={'coefficients': [list(ends)]})
            entries.append(entry)
    return entries


def is_known_load(problem: Problem, fit: Fit, term: Term) -> bool:
    """Return whether a term is the load with the coefficient -1/(k_t·n), beside a given model.

    `FrictionModel.measured` includes that load for every model: this one does not lack it.
    """
    known_coefficients = term.kind.known_coefficients(problem.drive)
    if known_coefficients is None or problem.model is None:
        return False
    column, = fit.table.columns_of[term]
    coefficient = fit.table.coefficients(fit.terms)[column]
    return abs(coefficient / known_coefficients[0] - 1.0) < _SAME_LOAD


def _found_effect(fit: Fit, bounds: Intervals, terms: Sequence[Term], error: float, unit: str
                  ) -> FoundEffect:
    """Return the effect of one term, or of all terms of other joints."""
    term, table = terms[0], fit.table
    kind = term.kind
    chosen = min(fit.chosen(term) for term in terms)
    columns, values = table.columns_of[term], table.coefficients(fit.terms)
    own = [values[column] for column in columns]
    ends = [list(bounds.coefficients[column]) for column in columns]
    if term.group and term.group.kind == 'friction':
        said = term.group.describe()
        return FoundEffect(
            name='friction_between', variable=kind.variable, held_out_rmse=error, chosen=chosen,
            parameters={'coefficients': own}, intervals={'coefficients': ends},
            holds_on_another_day=True,
            in_words=f'{said[0].upper()}{said[1:]}: {own[0]:.4g} {unit} of Coulomb and '
            f'{own[1]:.4g} {unit} per rad/s of viscous friction',
            formula=f'{own[0]:+.4g}·tanh(w/{term.group.width:.3g}) {own[1]:+.4g}·w, w = '
            + ' '.join(f'{"+" if side > 0 else "-"}v_{name}' for name, side in term.group.angles))
    if term.group:
        moved = {name for term in terms if term.group for name in term.group.all_joints}
        names = ', '.join(sorted(moved - {fit.rows.samples.joint}))
        return FoundEffect(
            name=kind.name, variable=kind.variable, held_out_rmse=error, chosen=chosen,
            parameters={'coefficients': [1.0], 'terms': len(terms)}, intervals={},
            holds_on_another_day=True,
            in_words=f'Weight and inertia of other links: {len(terms)} terms of the motion of '
            f'{names}',
            formula=f'{len(terms)} terms of {names}')
    effect = kind({**term.constants, 'coefficients': own})
    constants = {name: list(own) for (owner, name), own in bounds.constants.items()
                 if owner == term}
    said, rivals = effect.describe(), fit.rivals.get(term, [])
    if rivals:
        said += f'; or {" or ".join(rivals).replace("_", " ")}: the recording does not tell'
    return FoundEffect(
        name=kind.name, variable=kind.variable, held_out_rmse=error, chosen=chosen,
        parameters=effect.parameters, intervals={'coefficients': ends, **constants},
        holds_on_another_day=effect.holds_on_another_day, in_words=in_unit(said, unit),
        formula=effect.formula(), instead=rivals)
