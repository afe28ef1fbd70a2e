# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How well the numbers of a model are known: intervals from the fit's curvature.

Errors beside each other in time are alike, so that samples do not count one by one. The scatter of
the gradient from stretch to stretch, each longer than the residual remembers, says how much they
count: White's covariance clustered by stretches (Liang and Zeger 1986).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.huber import huber_weights
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.prepare.correlation import stretches
from friction_comp.refinement.prepare.fit_data import FitData

_LEVEL = 0.95
_STEP = 1e-4
# A number whose influence is this small a share of its own once the others are free is theirs.
_SAME = 1e-5


@dataclass(frozen=True)
class _Knob:
    """A number of a model: where it stands, what it is, and the model with another one."""

    place: int
    name: str
    number: int
    value: float
    changed: Callable[[float], FrictionModel]


def intervals(model: FrictionModel, data: FitData) -> list[dict[str, Any]]:
    """Return the 95 % interval of every parameter of every effect, as their `parameters` are.

    Parameters
    ----------
    model : FrictionModel
    data : FitData
        What it was fitted to.

    Returns
    -------
    list of dict
        For each effect: for each constant [low, high], and for ``coefficients`` a list of such.
        A constant that was not searched is a convention and has its value twice.
    """
    knobs = _knobs(model)
    bounds = _half_widths(model, knobs, data)
    found = []
    for place, effect in enumerate(model.effects):
        entry: dict[str, Any] = {name: [value, value] for name, value in effect.values.items()}
        entry['coefficients'] = [[value, value] for value in effect.coefficients]
        for knob, half in zip(knobs, bounds):
            if knob.place != place:
                continue
            if not np.isfinite(half):
                # The data do not tell it: the effect is the same with any value.
                low_high: list[float | None] = [None, None]
            else:
                low_high = [float(knob.value - half), float(knob.value + half)]
            if knob.name == 'coefficients':
                entry['coefficients'][knob.number] = low_high
            else:
                entry[knob.name] = low_high
        found.append(entry)
    return found


def _knobs(model: FrictionModel) -> list[_Knob]:
    knobs = []
    for place, effect in enumerate(model.effects):
        for number, value in enumerate(effect.coefficients):
            knobs.append(_Knob(place, 'coefficients', number, value,
                               _changer(model, place, number=number)))
        for name, how in effect.constants.items():
            if how is not None:
                knobs.append(_Knob(place, name, 0, effect.values[name],
                                   _changer(model, place, name=name)))
    for name in ('upper', 'lower', 'viscous', 'steepness'):
        def changed(value: float, name: str = name) -> FrictionModel:
            return replace(model, sigmoid=replace(model.sigmoid, **{name: value}))
        knobs.append(_Knob(-1, name, 0, getattr(model.sigmoid, name), changed))
    return knobs


def _changer(model: FrictionModel, place: int, number: int = 0,
             name: str | None = None) -> Callable[[float], FrictionModel]:
    effect = model.effects[place]

    def changed(value: float) -> FrictionModel:
        coefficients = list(effect.coefficients)
        values = dict(effect.values)
        if name is None:
            coefficients[number] = value
        else:
            values[name] = value
        effects = list(model.effects)
        effects[place] = type(effect)({**values, 'coefficients': coefficients})
        return replace(model, effects=effects)
    return changed


def _half_widths(model: FrictionModel, knobs: list[_Knob], data: FitData) -> np.ndarray:
    """Return half the width of each knob's interval; infinite where the data do not tell it."""
    rows = data.usable
    predicted = model.current(data.samples)
    residual = data.samples.current - predicted
    slopes = np.empty((int(rows.sum()), len(knobs)))
    for column, knob in enumerate(knobs):
        step = _STEP * max(abs(knob.value), 1e-6)
        try:
            moved = knob.changed(knob.value + step).current(data.samples)
        except ValueError:
            moved = predicted
        slopes[:, column] = (moved - predicted)[rows] / step
    size = np.sqrt(np.mean(slopes ** 2, axis=0))
    seen = np.nonzero(np.isfinite(size) & (size > 0))[0]
    kept: list[Any] = []
    basis = np.empty((len(slopes), 0))
    for column in map(int, seen):
        own = slopes[:, column] / size[column]
        rest = own - basis @ (basis.T @ own)
        rest = rest - basis @ (basis.T @ rest)
        norm = np.linalg.norm(rest)
        if norm > _SAME * np.linalg.norm(own):
            kept.append(column)
            basis = np.column_stack([basis, rest / norm])
    half = np.full(len(knobs), np.inf)
    if not kept:
        return half
    design = slopes[:, kept] / size[kept]
    values = residual[rows]
    weights = huber_weights(values, robust_scale(values))
    number = stretches(residual, rows, data.folds.run)
    pull = design * (weights * values)[:, None]
    sums = np.stack([np.bincount(number, column) for column in pull.T], axis=1)
    inverse = np.linalg.pinv((design * weights[:, None]).T @ design, rcond=1e-14)
    free = max(len(sums) - len(kept), 2)
    covariance = inverse @ (sums.T @ sums) @ inverse * len(sums) / free
    quantile = float(stats.t.ppf(0.5 + 0.5 * _LEVEL, free))
    half[kept] = quantile * np.sqrt(np.maximum(np.diag(covariance), 0.0)) / size[kept]
    return half
