# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The content of report.json, all figures of the model that is written."""

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

# Ranges of a variable in which it is counted how many samples are at a limit.
_RANGES = 15
# Rank correlation from which two numbers are named together, and how many such pairs at most.
_CLOSE, _PAIRS = 0.8, 8


@dataclass(frozen=True)
class Outcome:
    """All that a report is made of.

    Parameters
    ----------
    question : Question
    fit : Fit
        With the named terms alone.
    start, model : FrictionModel
        Before and after.
    fit_before, before, fit_after, after : ndarray, shape (N,)
        Residuals of all samples, A: of the models before and after, and of fits to all parts but
        their own.
    stability : Stability
    intervals : Intervals
    unit : str
        Of the current.
    kept : bool
        Whether the model before was kept, since nothing that was found predicts better.
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


def report_of(o: Outcome) -> dict[str, Any]:
    """Return the content of report.json."""
    rows, raw = o.fit.rows, o.question.raw
    left = [*limits(rows), *leftover(rows.at_rows, rows.averaged(o.after), rows.scene.slowest)]
    grown = Elsewhere(o.fit.table, o.fit.keys).growth(o.fit.keys)
    growth = max(1.0, *grown.values())
    before = errors_of(rows, o.fit_before, o.before)
    after = errors_of(rows, o.fit_after, o.after, growth)
    effects = [] if o.kept else effects_of(o)
    open_questions = [] if o.kept else ambiguities(o.fit, o.stability)
    if o.question.model:
        base = 'the given model'
    elif rows.load_by_mechanics:
        base = 'sigmoid of Eq. 6 fitted to the recording, the measured load taken as it is'
    else:
        base = 'sigmoid of Eq. 6 fitted to the recording'
    verdict = Verdict(findings(o.fit, raw, after, grown, left, open_questions))
    verdict.add(check_written_model(rows, o.fit, after))
    report = {
        'unit': o.unit, 'joint': o.model.joint, 'samples': len(raw),
        'samples_in_motion': int(rows.usable.sum()),
        'samples_clipped': int(rows.clipped.sum()),
        'held_out': f'{int(o.fit.table.block.max()) + 1} long parts, each predicted by a fit to '
                    'all others',
        'signal_rms': rms(raw.current[rows.usable]),
        'before': {'model': base, **before.to_dict()},
        'after': {'model': ' + '.join([base if o.question.model else 'sigmoid of Eq. 6', *(
            entry['name'] for entry in effects)]), **after.to_dict()},
        'noise_floor': noise_floor(rows, o.after),
        'effects': effects,
        'friction': friction_of(o),
        'correlations': [] if o.kept else correlations_of(o),
        'unexplained': [{'variable': one.variable, 'strength': one.strength,
                         'note': in_unit(one.note, o.unit)} for one in left],
        'ambiguous': open_questions,
        'thirds': grown,
        'differentiation': dict(o.fit.settings),
        'stopped_because': 'no further effect predicts parts that were not fitted better by more '
                           'than chance would',
    }
    words = verdict.to_dict()
    for name in ('reasons', 'warnings'):
        words[name] = [in_unit(line, o.unit) for line in words[name]]
    for finding in words['findings']:
        finding['text'] = in_unit(finding['text'], o.unit)
    return {**report, **words}


def check_written_model(rows: Rows, fit: Fit, after: Errors) -> list[Finding]:
    """Return a finding where the model as it is written predicts worse than its fit.

    The fit's own error comes from block sums; that of the written model from its file's formula
    on the recording as it came.
    """
    table = fit.table
    residual = table.residual(fit.keys, derivatives=False)
    own = math.hypot(rms(residual), noise_floor(rows, rows.target) if rows.length > 1 else 0.0)
    # Samples that are no part of any row, and the noise that rows average out.
    if after.fit > 1.5 * max(own, after.held_out):
        return [Finding('written', f'The model as written predicts with an error of '
                        f'{after.fit:.3g} A, where its fit had {own:.3g} A.', AGAIN)]
    return []


def limits(rows: Rows) -> list[Dependence]:
    """Return the variable that decides whether the current is at a limit, if it is."""
    if not rows.clipped.any():
        return []
    share = float(rows.clipped.mean())
    best = ('velocity', 0.0)
    for name in ('velocity', 'acceleration', 'position', 'load', 'temperature'):
        values = getattr(rows.samples, name)
        if values is None:
            continue
        edges = np.quantile(values, np.linspace(0.0, 1.0, _RANGES + 1)[1:-1])
        cell = np.searchsorted(edges, values)
        count = np.maximum(np.bincount(cell), 1)
        rate = np.bincount(cell, rows.clipped.astype(float)) / count
        spread = float(count @ (rate - share) ** 2) / (len(cell) * share * (1.0 - share))
        # Velocity is what friction follows: another has to be clearly better to be named.
        if spread > (1.5 * best[1] if best[0] == 'velocity' else best[1]):
            best = (name, spread)
    return [Dependence(best[0], best[1], f'the current is at a limit in {100 * share:.2g} % of the '
                       f'samples, mostly by {best[0]}; these are not fitted')]


def friction_of(o: Outcome) -> dict[str, Any]:
    """Return Eq. 6 in the field's words, with 95 % intervals: A, and A·s/rad for viscous."""
    base, ends = o.model.sigmoid, o.intervals.coefficients
    return {'offset': 0.5 * (base.upper + base.lower), 'coulomb': 0.5 * (base.upper - base.lower),
            'viscous': base.viscous, 'transition': 2.0 / base.steepness, 'shift': base.shift,
            'intervals': {} if o.kept else {
                name: list(ends[index]) for index, name in enumerate(
                    ('offset', 'coulomb', 'viscous')) if index in ends}}


def correlations_of(o: Outcome) -> list[dict[str, Any]]:
    """Return the correlated pairs of numbers."""
    table = o.fit.table
    names: dict[Parameter, str] = {}
    for column, name in zip((0, 1, 2), ('offset', 'Coulomb friction', 'viscous friction')):
        names[column] = name
    for key in o.fit.keys:
        kind = table.terms[key].kind
        spoken = kind.name.replace('_', ' ')
        for k, column in enumerate(table.columns_of(key)):
            own = kind.numbers[k][0] if k < len(kind.numbers) else f'coefficient {k + 1}'
            names[column] = f'{spoken}: {own}'
        for name in kind.constants:
            names[key, name] = f'{spoken}: {name.replace("_", " ")}'
    return [{'between': [names[a], names[b]], 'correlation': value}
            for (a, b), value in o.intervals.correlations.items()
            if abs(value) > _CLOSE and a in names and b in names][:_PAIRS]


def effects_of(o: Outcome) -> list[dict[str, Any]]:
    """Return the entries of the effects, in the order in which they lower the error most.

    Terms of other joints are one entry.
    """
    fit = o.fit
    rest, chosen, entries = list(fit.keys[fit.given:]), list(fit.keys[:fit.given]), []
    lag = fit.settings.get('lag', 0.0)
    # Within a sample it is how two signals were sampled, and late motion is a sensor's filter.
    if lag >= fit.rows.samples.sample_time:
        entries.append({
            'name': 'actuation_lag', 'variable': 'history',
            'held_out_rmse': fit.rmse_with(chosen),
            'chosen': fit.lag_confidence, 'parameters': {'lag': lag}, 'intervals': {},
            'in_words': f'Lag: the torque is {1e3 * lag:.3g} ms later than the current',
            'formula': f'i(t + {lag:.4g} s)'})
    while rest:
        together = [[key] for key in rest if key[-1] is None]
        groups = [key for key in rest if key[-1] is not None]
        if groups:
            together.append(groups)
        trials = [(fit.rmse_with([*chosen, *keys]), index) for index, keys in enumerate(together)]
        error, index = min(trials)
        chosen += together[index]
        rest = [key for key in rest if key not in together[index]]
        if known_load(o, together[index][0]):
            continue
        entry = (_group_entry if together[index][0][-1] is not None else _entry)(o, together[index])
        entries.append({**entry, 'held_out_rmse': error})
    return entries


def known_load(o: Outcome, key: Key) -> bool:
    """Return whether a term is the load with the coefficient -1/(k_t·n), beside a model given.

    `FrictionModel.measured` counts that for every model: it is no lack of this one.
    """
    by_mechanics = EFFECTS[key[0]].by_mechanics(o.question.drive)
    if by_mechanics is None or o.question.model is None:
        return False
    column, = o.fit.table.columns_of(key)
    coefficient = o.fit.table.coefficients(o.fit.keys)[column]
    return abs(coefficient / by_mechanics[0] - 1.0) < SAME_LOAD


def _entry(o: Outcome, keys: Sequence[Key]) -> dict[str, Any]:
    key, = keys
    table = o.fit.table
    term, places = table.terms[key], table.columns_of(key)
    values = table.coefficients(o.fit.keys)
    effect = term.kind({**term.constants, 'coefficients': [values[p] for p in places]})
    constants = {name: list(ends) for (one, name), ends in o.intervals.constants.items()
                 if one == key}
    return {
        'name': effect.name, 'variable': effect.variable, 'held_out_rmse': math.nan,
        'chosen': o.stability.chosen.get(key, 0.0), 'parameters': effect.parameters,
        'intervals': {'coefficients': [list(o.intervals.coefficients[p]) for p in places],
                      **constants},
        'holds_on_another_day': effect.holds_on_another_day,
        'in_words': in_unit(effect.describe(), o.unit), 'formula': effect.formula()}


def _group_entry(o: Outcome, keys: Sequence[Key]) -> dict[str, Any]:
    kind = EFFECTS['other_joints']
    names = sorted({name for key in keys for name in key[-1].everyone} - {o.question.raw.joint})
    return {
        'name': kind.name, 'variable': kind.variable, 'held_out_rmse': math.nan,
        'chosen': min(o.stability.chosen.get(key, 0.0) for key in keys),
        'parameters': {'coefficients': [1.0], 'terms': len(keys)}, 'intervals': {},
        'holds_on_another_day': True,
        'in_words': f'Weight and inertia of other links: {len(keys)} terms of the motion of '
                    f'{", ".join(names)}',
        'formula': f'{len(keys)} terms of ' + ', '.join(names)}


