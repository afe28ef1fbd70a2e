# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The content of report.json."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.attempt import Found, Question
from friction_comp.refinement.columns import Key
from friction_comp.refinement.judge import ambiguities, Errors, noise_floor
from friction_comp.refinement.leftover import leftover
from friction_comp.refinement.stability import Intervals, Stability
from friction_comp.refinement.units import in_unit
from friction_comp.refinement.verdict import Verdict


@dataclass(frozen=True)
class Outcome:
    """All that a report is made of."""

    question: Question
    found: Found
    start: FrictionModel
    model: FrictionModel
    errors_before: Errors
    errors_after: Errors
    before: np.ndarray
    after: np.ndarray
    stability: Stability
    intervals: Intervals
    unit: str


def report_of(o: Outcome) -> dict[str, Any]:
    """Return the content of report.json."""
    rows = o.found.rows
    left = leftover(rows.at_rows, rows.averaged(o.after), rows.scene.slowest)
    names = [effect.name for effect in o.model.effects]
    report = {
        'version': 1, 'unit': o.unit, 'joint': o.model.joint, 'samples': len(rows.samples),
        'samples_in_motion': int(rows.usable.sum()), 'samples_clipped': 0,
        'held_out': f'{o.found.table.sums.blocks} long parts, each predicted by the model fitted '
        'to all others',
        'signal_rms': float(np.sqrt(np.mean(rows.samples.current[rows.usable] ** 2))),
        'before': {'model': 'the given model' if o.question.model else 'sigmoid of Eq. 6 fitted to the recording', **o.errors_before.to_dict()},
        'after': {'model': ' + '.join(['sigmoid of Eq. 6', *names]), **o.errors_after.to_dict()},
        'noise_floor': noise_floor(rows, o.after),
        'effects': effects_of(o),
        'unexplained': [{'variable': one.variable, 'strength': one.strength,
                         'note': in_unit(one.note, o.unit)} for one in left],
        'ambiguous': ambiguities(o.found, o.stability),
        'differentiation': dict(o.found.settings), 'stopped_because': '',
    }
    report.update(Verdict().to_dict())
    return report


def effects_of(o: Outcome) -> list[dict[str, Any]]:
    """Return the entries of the effects, in the order in which they lower the error most."""
    table, found = o.found.table, o.found
    rest, chosen, entries = list(found.keys[found.given:]), list(found.keys[:found.given]), []
    lag = found.settings.get('lag')
    if lag:
        entries.append({'name': 'actuation_lag', 'variable': 'history', 'held_out_rmse': found.rmse(chosen),
                        'chosen': 1.0, 'parameters': {'lag': lag}, 'intervals': {}, 'in_words': f'Lag: {1e3*lag:.2g} ms', 'formula': ''})
    while rest:
        errors = [(found.rmse([*chosen, key]), k) for k, key in enumerate(rest)]
        error, k = min(errors)
        key = rest.pop(k)
        chosen.append(key)
        term = table.terms[key]
        places = table.places(key)
        x = table.coefficients(found.keys)
        effect = term.kind({**term.constants, 'coefficients': [x[p] for p in places]} if term.group is None else {'coefficients': [1.0]})
        entries.append({
            'name': effect.name, 'variable': effect.variable, 'held_out_rmse': error,
            'chosen': o.stability.chosen.get(key, 1.0), 'parameters': effect.parameters,
            'intervals': {'coefficients': [list(o.intervals.coefficients[p]) for p in places]},
            'in_words': in_unit(effect.describe(), o.unit), 'formula': effect.formula()})
    return entries
