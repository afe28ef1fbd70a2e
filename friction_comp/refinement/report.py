# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles the report, whose figures describe the model that is written.

Only the errors in other conditions (`thirds`, `elsewhere_rmse`) of an initial model that is kept
are those of the best fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from friction_comp.model.differentiation import DEFAULT_SETTINGS
from friction_comp.model.friction_numbers import friction_of, FrictionNumbers
from friction_comp.refinement import judge, thresholds
from friction_comp.refinement.best_fit import Fit, Problem
from friction_comp.refinement.dependence import Dependence, remaining_dependences, share_of_means
from friction_comp.refinement.effect_columns import Term
from friction_comp.refinement.findings import finding, in_unit, verdict_of
from friction_comp.refinement.prepare import Rows
from friction_comp.refinement.result import (
    Correlation,
    FoundEffect,
    Origin,
    Predicted,
    RefinementReport,
)
from friction_comp.refinement.stability import (
    disagreement,
    error_growth,
    growth_elsewhere,
    Parameter,
    POSTURE,
    RECORDING,
)
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges, rms, smallest_step

# Number of ranges of a variable in which samples at a limit are counted.
_RANGES = 15
_MOST_PAIRS = 8


def report_of(problem: Problem, fit: Fit, start: Predicted, refined: Predicted, origin: Origin
              ) -> RefinementReport:
    """Return the report on a model; `fit` has the named terms alone.

    `refined` is `start`, the initial model, if no refined one predicts better.
    """
    rows, raw, given = fit.rows, problem.raw, problem.model is not None
    model, unit, kept = refined.model, origin.unit, refined is start
    dependences = [*clipping_dependence(rows), *unnamed_dependence(fit), *remaining_dependences(
        rows.at_rows, rows.averaged(refined.held_out), rows.coverage.slowest)]
    growth = error_growth(fit.table, fit.terms)
    if rows.region.any():
        growth[POSTURE] = growth_elsewhere(fit.table, fit.terms, fit.initial_count)
    between = disagreement(fit.table, fit.terms)
    if between:
        growth[RECORDING] = between.growth
    noise = judge.noise_floor(rows, refined.held_out)
    friction = friction_of(model, unit)
    effects = [] if kept else effects_of(problem, fit, friction, unit)
    open_questions = [] if kept else judge.ambiguities(fit)
    base = 'the given model' if given else 'sigmoid of Eq. 6 fitted to the recording'
    if rows.load_coefficient and not given:
        base += ', the measured load taken as it is'
    name = ' + '.join(['the given model' if given else 'sigmoid of Eq. 6',
                       *(effect.name for effect in effects)])
    tested = dict(growth)
    if 'acceleration' not in growth:
        tested[judge.STEPS] = error_by_steps(raw, refined, rows.usable)
    errors = judge.errors_of(rows, refined, name, max(1.0, *tested.values()))
    what = 'Presliding is' if model.breakaway else 'Breakaway and presliding are'
    notes = ([finding('no_presliding', what=what, why=refined.no_presliding)]
             if refined.no_presliding else [])
    # Only where the unit of position was assumed, not given.
    if any(' in rad' in one.partition(' (')[0] for one in origin.assumed) and (
            other := judge.other_turn(effects)):
        notes.append(other)
    old, now = problem.model and problem.model.breakaway, model.breakaway
    if old and now and now != old:
        notes.append(finding('breakaway_taken_along', factor=(
            (now.positive_mean - now.negative_mean) / (old.positive_mean - old.negative_mean))))
    verdict = verdict_of([
        *judge.findings_on_numbers(
            friction, errors.held_out_rmse, float(np.abs(raw.current).max())), *judge.findings(
            fit, raw, errors, tested, noise, dependences, open_questions, between), *notes], unit)
    return RefinementReport(
        unit=unit, joint=model.joint, samples=len(raw), samples_in_motion=int(rows.usable.sum()),
        samples_clipped=int(rows.clipped.sum()),
        held_out=f'{rows.blocks} long parts, each predicted by a fit to all others',
        signal_rms=rms(raw.current[rows.usable]), before=judge.errors_of(rows, start, base),
        after=errors, noise_floor=noise, effects=effects,
        friction=friction,
        assumed=list(origin.assumed),
        correlations=[] if kept else correlations_of(fit),
        unexplained=[replace(dependence, note=in_unit(dependence.note, unit))
                     for dependence in dependences],
        ambiguous=open_questions, thirds=growth,
        differentiation=dict(model.differentiation or DEFAULT_SETTINGS if kept else fit.settings),
        stopped_because='no further effect predicts parts that were not fitted better by more '
                        'than chance would',
        **{**vars(verdict), 'warnings': [*verdict.warnings, *origin.warnings]})


def error_by_steps(raw: Samples, refined: Predicted, usable: np.ndarray) -> float:
    """Return the error by the steps of the recorded velocity, over that on parts not fitted.

    At constant speeds, a velocity in whole counts does not change. The rate of any other jumps by
    its steps, as it does if the recorded one is moved at random by up to half a step.
    """
    if raw.velocity is None:
        return 0.0
    moved = smallest_step(raw.velocity) * (np.random.default_rng(0).random(len(raw)) - 0.5)
    change = refined.model.predict(raw.with_(velocity=raw.velocity + moved)
                                   ) - refined.model.predict(raw)
    return rms(change[usable]) / max(rms(refined.held_out[usable]), 1e-300)


def clipping_dependence(rows: Rows) -> list[Dependence]:
    """Return the variable on which clipping of the current depends most; empty without clipping."""
    if not rows.clipped.any():
        return []
    share = float(rows.clipped.mean())
    strength = {name: share_of_means(rows.clipped - share, np.searchsorted(
        quantile_edges(values, _RANGES), values))
        for name in ('velocity', 'acceleration', 'position', 'load', 'temperature')
        if (values := getattr(rows.samples, name)) is not None}
    # Friction depends on velocity: another variable has to explain clearly more.
    name = max(strength, key=lambda name: strength[name] * (1.5 if name == 'velocity' else 1.0))
    return [Dependence(name, strength[name], f'the current is at a limit in {100 * share:.2g} % of '
                       f'the samples, mostly depending on {name}; these are not fitted')]


def unnamed_dependence(fit: Fit) -> list[Dependence]:
    """Return what an effect that was found, but cannot be named, would explain, if it is much."""
    named = {(term.kind, term.group) for term in fit.terms}
    unnamed = [term.kind for term in fit.found if (term.kind, term.group) not in named]
    # Not with the derivatives of the transition, which was fitted to standstill, too, since then.
    error = fit.rmse_with(fit.terms)
    share = 1.0 - (fit.found_error / error) ** 2 if error > 0.0 else 0.0
    if not unnamed or share < thresholds.UNEXPLAINED:
        return []
    names = ' and '.join(dict.fromkeys(kind.name.replace('_', ' ') for kind in unnamed))
    return [Dependence(unnamed[0].variable, share, f'{names} would explain {100 * share:.0f} % of '
                       'its square, but the recording does not determine it')]


def correlations_of(fit: Fit) -> list[Correlation]:
    """Return the correlated pairs of parameters."""
    table = fit.table
    names: dict[Parameter, str] = {
        0: 'offset', 1: 'Coulomb friction', 2: 'viscous friction'}
    for term in fit.terms:
        kind = term.kind
        label = kind.name.replace('_', ' ')
        for k, column in enumerate(table.columns_of[term]):
            known = k < len(kind.coefficient_names)
            coefficient = kind.coefficient_names[k][0] if known else f'coefficient {k + 1}'
            names[column] = f'{label}: {coefficient}'
        for name in kind.constants:
            names[term, name] = f'{label}: {name.replace("_", " ")}'
    return [Correlation([names[a], names[b]], value)
            for value, a, b in fit.intervals.correlations()
            if abs(value) > thresholds.CORRELATED and a in names and b in names][:_MOST_PAIRS]


def effects_of(problem: Problem, fit: Fit, friction: FrictionNumbers, unit: str
               ) -> list[FoundEffect]:
    """Return the effects, those first that lower the error most.

    All terms of other joints' weight and inertia make one. Inertia has the interval that it has
    among the numbers of `friction`.
    """
    chosen, remaining = fit.terms[:fit.initial_count], fit.terms[fit.initial_count:]
    entries: list[FoundEffect] = []
    # A shorter lag is due to sampling; a negative one, due to a filter of a sensor.
    if sum(fit.lag) >= fit.rows.samples.sample_time:
        entries.append(lag_effect(*fit.lag, fit.rmse_with(chosen), fit.lag_confidence))
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
            entry = _found_effect(fit, terms, error, unit)
            if ends := friction.intervals.get(entry.name):
                entry = replace(entry, intervals={'coefficients': [list(ends)]})
            entries.append(entry)
    return entries


def lag_effect(delay: float, time_constant: float, error: float, chosen: float) -> FoundEffect:
    """Return the lag between current and torque: a delay or a first-order low pass, s."""
    if time_constant:
        parameters = {'time_constant': time_constant}
        said = f'follows the current by a first-order low pass of {1e3 * time_constant:.3g} ms'
        formula = f'(1 + {time_constant:.4g} s·d/dt) i(t)'
    else:
        parameters = {'lag': delay}
        said, formula = f'is {1e3 * delay:.3g} ms later than the current', f'i(t + {delay:.4g} s)'
    return FoundEffect(
        name='actuation_lag', variable='history', held_out_rmse=error, chosen=chosen,
        parameters=parameters, intervals={}, holds_on_another_day=None,
        in_words=f'Lag: the torque {said}', formula=formula)


def is_known_load(problem: Problem, fit: Fit, term: Term) -> bool:
    """Return whether a term is the load with the coefficient -1/(k_t·n), beside a given model.

    `FrictionModel.measured` includes that load for every model: this one does not lack it.
    """
    known_coefficients = term.kind.known_coefficients(problem.drive)
    if known_coefficients is None or problem.model is None:
        return False
    column, = fit.table.columns_of[term]
    coefficient = fit.table.coefficients(fit.terms)[column]
    return abs(coefficient / known_coefficients[0] - 1.0) < thresholds.SAME_LOAD


def _found_effect(fit: Fit, terms: Sequence[Term], error: float, unit: str) -> FoundEffect:
    """Return the effect of one term, or of all terms of other joints."""
    term, table = terms[0], fit.table
    kind = term.kind
    chosen = min(fit.chosen.get(term, 0.0) for term in terms)
    columns, values = table.columns_of[term], table.coefficients(fit.terms)
    own = [values[column] for column in columns]
    bounds = [list(fit.intervals.coefficients[column]) for column in columns]
    if term.group and term.group.kind == 'friction':
        said = term.group.describe()
        return FoundEffect(
            name='friction_between', variable=kind.variable, held_out_rmse=error, chosen=chosen,
            parameters={'coefficients': own}, intervals={'coefficients': bounds},
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
    constants = {name: list(ends) for (owner, name), ends in fit.intervals.constants.items()
                 if owner == term}
    said, rivals = effect.describe(), fit.rivals.get(term, [])
    if rivals:
        said += f'; or {" or ".join(rivals).replace("_", " ")}: the recording does not tell'
    return FoundEffect(
        name=kind.name, variable=kind.variable, held_out_rmse=error, chosen=chosen,
        parameters=effect.parameters, intervals={'coefficients': bounds, **constants},
        holds_on_another_day=effect.holds_on_another_day, in_words=in_unit(said, unit),
        formula=effect.formula(), instead=rivals)
