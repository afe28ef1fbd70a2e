# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compiles report.json, whose figures all describe the model that is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.attempt import Fit, Question
from friction_comp.refinement.effect_columns import Key
from friction_comp.refinement.elsewhere import Elsewhere
from friction_comp.refinement.judge import (
    ambiguities,
    Errors,
    errors_of,
    findings,
    noise_floor,
    rms,
)
from friction_comp.refinement.leftover import Dependence, leftover
from friction_comp.refinement.prepare import Rows
from friction_comp.refinement.stability import Intervals, Parameter, Stability
from friction_comp.refinement.thresholds import SAME_LOAD
from friction_comp.refinement.units import in_unit
from friction_comp.refinement.verdict import AGAIN, Finding, Verdict

# Number of ranges of a variable in which samples at a limit are counted.
_RANGES = 15
# Rank correlation from which a pair of parameters is reported, and the largest number of pairs.
_CORRELATED, _PAIRS = 0.8, 8


@dataclass(frozen=True)
class ReportInput:
    """The input of a report.

    Parameters
    ----------
    question : Question
    fit : Fit
        With the named terms alone.
    start, model : FrictionModel
        The initial and the refined model.
    fit_before, before, fit_after, after : ndarray, shape (N,)
        Residuals of all samples, A: `fit_...` by the models themselves, the others by fits to
        other parts.
    stability : Stability
    intervals : Intervals
    unit : str
        Of the current.
    kept : bool
        Whether the initial model was kept, since no refined one predicts better.
    """

    question: Question
    fit: Fit
    start: FrictionModel
    model: FrictionModel
    fit_before: np.ndarray
    before: np.ndarray
    fit_after: np.ndarray
    after: np.ndarray
    stability: Stability
    intervals: Intervals
    unit: str
    kept: bool = False


def report_of(result: ReportInput) -> dict[str, Any]:
    """Return the content of report.json."""
    rows, raw = result.fit.rows, result.question.raw
    dependences = [*limits(rows), *leftover(
        rows.at_rows, rows.averaged(result.after), rows.scene.slowest)]
    growth_by_variable = Elsewhere(result.fit.table, result.fit.keys).growth(result.fit.keys)
    growth = max(1.0, *growth_by_variable.values())
    before = errors_of(rows, result.fit_before, result.before)
    after = errors_of(rows, result.fit_after, result.after, growth)
    effects = [] if result.kept else effects_of(result)
    open_questions = [] if result.kept else ambiguities(result.fit, result.stability)
    if result.question.model:
        base = 'the given model'
    elif rows.load_by_mechanics:
        base = 'sigmoid of Eq. 6 fitted to the recording, the measured load taken as it is'
    else:
        base = 'sigmoid of Eq. 6 fitted to the recording'
    verdict = Verdict(findings(
        result.fit, raw, after, growth_by_variable, dependences, open_questions))
    verdict.add(check_written_model(rows, result.fit, after))
    report = {
        'unit': result.unit, 'joint': result.model.joint, 'samples': len(raw),
        'samples_in_motion': int(rows.usable.sum()),
        'samples_clipped': int(rows.clipped.sum()),
        'held_out': f'{int(result.fit.table.block.max()) + 1} long parts, each predicted by a fit '
                    'to all others',
        'signal_rms': rms(raw.current[rows.usable]),
        'before': {'model': base, **before.to_dict()},
        'after': {'model': ' + '.join([base if result.question.model else 'sigmoid of Eq. 6', *(
            entry['name'] for entry in effects)]), **after.to_dict()},
        'noise_floor': noise_floor(rows, result.after),
        'effects': effects,
        'friction': friction_of(result),
        'correlations': [] if result.kept else correlations_of(result),
        'unexplained': [{'variable': dependence.variable, 'strength': dependence.strength,
                         'note': in_unit(dependence.note, result.unit)}
                        for dependence in dependences],
        'ambiguous': open_questions,
        'thirds': growth_by_variable,
        'differentiation': dict(result.fit.settings),
        'stopped_because': 'no further effect predicts parts that were not fitted better by more '
                           'than chance would',
    }
    verdict_words = verdict.to_dict()
    for name in ('reasons', 'warnings'):
        verdict_words[name] = [in_unit(line, result.unit) for line in verdict_words[name]]
    for finding in verdict_words['findings']:
        finding['text'] = in_unit(finding['text'], result.unit)
    return {**report, **verdict_words}


def check_written_model(rows: Rows, fit: Fit, after: Errors) -> list[Finding]:
    """Return a finding where the model as it is written predicts worse than its fit.

    The fit's error comes from block sums, that of the written model from `predict` on the
    recording.
    """
    table = fit.table
    residual = table.residual(fit.keys, derivatives=False)
    # Rows average noise out.
    fitted_error = math.hypot(
        rms(residual), noise_floor(rows, rows.target) if rows.length > 1 else 0.0)
    # Samples outside all rows may have larger errors.
    if after.fit > 1.5 * max(fitted_error, after.held_out):
        return [Finding('written', f'The model as written predicts with an error of '
                        f'{after.fit:.3g} A, but its fit had {fitted_error:.3g} A.', AGAIN)]
    return []


def limits(rows: Rows) -> list[Dependence]:
    """Return the variable on which it depends most whether the current is at a limit, if any."""
    if not rows.clipped.any():
        return []
    share = float(rows.clipped.mean())
    strongest = ('velocity', 0.0)
    for name in ('velocity', 'acceleration', 'position', 'load', 'temperature'):
        values = getattr(rows.samples, name)
        if values is None:
            continue
        edges = np.quantile(values, np.linspace(0.0, 1.0, _RANGES + 1)[1:-1])
        cell = np.searchsorted(edges, values)
        count = np.maximum(np.bincount(cell), 1)
        rate = np.bincount(cell, rows.clipped.astype(float)) / count
        spread = float(count @ (rate - share) ** 2) / (len(cell) * share * (1.0 - share))
        # Friction depends on velocity: another variable has to explain clearly more.
        if spread > (1.5 * strongest[1] if strongest[0] == 'velocity' else strongest[1]):
            strongest = (name, spread)
    return [Dependence(*strongest, f'the current is at a limit in {100 * share:.2g} % of the '
                       f'samples, mostly depending on {strongest[0]}; these are not fitted')]


def friction_of(result: ReportInput) -> dict[str, Any]:
    """Return Coulomb friction, viscous friction and offset with 95 % intervals, A and A·s/rad."""
    base, ends = result.model.sigmoid, result.intervals.coefficients
    return {'offset': 0.5 * (base.upper + base.lower), 'coulomb': 0.5 * (base.upper - base.lower),
            'viscous': base.viscous, 'transition': 2.0 / base.steepness, 'shift': base.shift,
            'intervals': {} if result.kept else {
                name: list(ends[index]) for index, name in enumerate(
                    ('offset', 'coulomb', 'viscous')) if index in ends}}


def correlations_of(result: ReportInput) -> list[dict[str, Any]]:
    """Return the correlated pairs of parameters."""
    table = result.fit.table
    names: dict[Parameter, str] = {}
    for column, name in zip((0, 1, 2), ('offset', 'Coulomb friction', 'viscous friction')):
        names[column] = name
    for key in result.fit.keys:
        kind = table.terms[key].kind
        label = kind.name.replace('_', ' ')
        for k, column in enumerate(table.columns_of(key)):
            coefficient = kind.numbers[k][0] if k < len(kind.numbers) else f'coefficient {k + 1}'
            names[column] = f'{label}: {coefficient}'
        for name in kind.constants:
            names[key, name] = f'{label}: {name.replace("_", " ")}'
    return [{'between': [names[a], names[b]], 'correlation': value}
            for (a, b), value in result.intervals.correlations.items()
            if abs(value) > _CORRELATED and a in names and b in names][:_PAIRS]


def effects_of(result: ReportInput) -> list[dict[str, Any]]:
    """Return the entries of the effects, those first that lower the error most.

    All terms of other joints make one entry.
    """
    fit = result.fit
    remaining, chosen, entries = list(fit.keys[fit.given:]), list(fit.keys[:fit.given]), []
    lag = fit.settings.get('lag', 0.0)
    # A shorter lag is due to sampling; a negative one, due to a filter of the motion's sensor.
    if lag >= fit.rows.samples.sample_time:
        entries.append({
            'name': 'actuation_lag', 'variable': 'history',
            'held_out_rmse': fit.rmse_with(chosen),
            'chosen': fit.lag_confidence, 'parameters': {'lag': lag}, 'intervals': {},
            'in_words': f'Lag: the torque is {1e3 * lag:.3g} ms later than the current',
            'formula': f'i(t + {lag:.4g} s)'})
    while remaining:
        candidates = [[key] for key in remaining if key[-1] is None]
        groups = [key for key in remaining if key[-1] is not None]
        if groups:
            candidates.append(groups)
        trials = [(fit.rmse_with([*chosen, *keys]), index) for index, keys in enumerate(candidates)]
        error, index = min(trials)
        chosen += candidates[index]
        remaining = [key for key in remaining if key not in candidates[index]]
        if known_load(result, candidates[index][0]):
            continue
        make_entry = _group_entry if candidates[index][0][-1] is not None else _entry
        entry = make_entry(result, candidates[index])
        entries.append({**entry, 'held_out_rmse': error})
    return entries


def known_load(result: ReportInput, key: Key) -> bool:
    """Return whether a term is the load with the coefficient -1/(k_t·n), beside a given model.

    `FrictionModel.measured` includes that load for every model: this one does not lack it.
    """
    by_mechanics = EFFECTS[key[0]].by_mechanics(result.question.drive)
    if by_mechanics is None or result.question.model is None:
        return False
    column, = result.fit.table.columns_of(key)
    coefficient = result.fit.table.coefficients(result.fit.keys)[column]
    return abs(coefficient / by_mechanics[0] - 1.0) < SAME_LOAD


def _entry(result: ReportInput, keys: Sequence[Key]) -> dict[str, Any]:
    key, = keys
    table = result.fit.table
    term, columns = table.terms[key], table.columns_of(key)
    values = table.coefficients(result.fit.keys)
    effect = term.kind({**term.constants, 'coefficients': [values[column] for column in columns]})
    constants = {name: list(ends) for (owner, name), ends in result.intervals.constants.items()
                 if owner == key}
    return {
        'name': effect.name, 'variable': effect.variable, 'held_out_rmse': math.nan,
        'chosen': result.stability.chosen.get(key, 0.0), 'parameters': effect.parameters,
        'intervals': {
            'coefficients': [list(result.intervals.coefficients[column]) for column in columns],
            **constants},
        'holds_on_another_day': effect.holds_on_another_day,
        'in_words': in_unit(effect.describe(), result.unit), 'formula': effect.formula()}


def _group_entry(result: ReportInput, keys: Sequence[Key]) -> dict[str, Any]:
    kind = EFFECTS['other_joints']
    names = sorted(
        {name for key in keys for name in key[-1].everyone} - {result.question.raw.joint})
    return {
        'name': kind.name, 'variable': kind.variable, 'held_out_rmse': math.nan,
        'chosen': min(result.stability.chosen.get(key, 0.0) for key in keys),
        'parameters': {'coefficients': [1.0], 'terms': len(keys)}, 'intervals': {},
        'holds_on_another_day': True,
        'in_words': f'Weight and inertia of other links: {len(keys)} terms of the motion of '
                    f'{", ".join(names)}',
        'formula': f'{len(keys)} terms of ' + ', '.join(names)}


