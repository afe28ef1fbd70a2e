# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""95 % intervals of Coulomb, viscous and static friction, offset, inertia and transition."""

from __future__ import annotations

from dataclasses import replace
import math

import numpy as np

from friction_comp.model.differentiation import filtered_as_acceleration
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import (
    inertia_of,
    is_of_speed,
    line_by_coefficient,
    line_of,
    near_standstill,
    speeds_of,
)
from friction_comp.model.measured import LINE, Recorded
from friction_comp.refinement.best_fit import Fit
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import EQ6_LINEAR
from friction_comp.refinement.stability import thirds
from friction_comp.statistics import rms

# Quantiles of the speed in motion that a model file keeps.
_SPEEDS = 12
# What effects depend on that is filtered already.
_FILTERED = ('acceleration', 'other joints')
# Column of Eq. 6's derivative with respect to the logarithm of the steepness.
_STEEPNESS = 3
# Half an interval, of the current, that is due to rounding.
_ROUNDING = 1e-9
# Widest transition of a sign change that counts as determined: a factor of e either way.
_MOST_LOG = 1.0


def recorded_of(fit: Fit, model: FrictionModel) -> Recorded:
    """Return the speeds and ranges of the recordings, and the intervals of a fit's numbers.

    An interval contains the scatter over parts drawn at random, with what the recordings hardly
    tell (see `unsettled`), and how far a number moves if the slow, the middle or the fast third of
    the samples is left out, or if the current is filtered as the motion is.
    """
    rows = fit.rows
    speed = np.abs(np.asarray(rows.samples.velocity)[rows.usable])
    speeds = np.quantile(speed, (np.arange(_SPEEDS) + 0.5) / _SPEEDS)
    recorded = Recorded(tuple(np.unique(speeds[speeds > 0.0]).tolist()))
    model = replace(model, recorded=recorded)
    weights, straight = _weights(fit, speeds_of(model)), line_of(model)
    values = (*straight.values(), inertia_of(model),
              near_standstill(model, straight['coulomb']))
    intervals, other_fits = {}, np.vstack((_without_thirds(fit), _with_filtered_current(fit)))
    for name, row, value in zip((*LINE, 'inertia', 'static'), weights, values):
        moved = other_fits @ row
        below, above = (math.hypot(end, float(np.abs(moved[1:] - moved[0]).max()))
                        for end in fit.intervals.ends(row))
        # In motion in one direction, the offset is part of Coulomb friction. A coefficient that
        # physics keeps at zero has no scatter, but rounding.
        if value is not None and min(below, above) > _ROUNDING * rms(fit.rows.target):
            intervals[name] = value - below, value + above
    of_steepness = np.eye(weights.shape[1])[_STEEPNESS]
    coulomb = abs(model.sigmoid.line[1])
    spread = fit.intervals.half_width(of_steepness) / coulomb if coulomb else math.inf
    if 0.0 < spread <= _MOST_LOG:
        transition = 2.0 / model.sigmoid.steepness
        intervals['transition'] = (transition * math.exp(-spread), transition * math.exp(spread))
    return replace(recorded, intervals=intervals).with_ranges(
        rows.samples.take(rows.usable), model.effects)


def _weights(fit: Fit, speeds: np.ndarray) -> np.ndarray:
    """Return the weights, (5, P), that make a fit's coefficients to `LINE`, inertia and static."""
    weights = np.zeros((len(LINE) + 2, max(fit.intervals.coefficients) + 1))
    weights[:EQ6_LINEAR, :EQ6_LINEAR] = np.eye(EQ6_LINEAR)
    for term in fit.terms:
        columns = fit.table.columns_of[term]
        if term.group is None and is_of_speed(term.kind):
            weights[:len(LINE), columns] = line_by_coefficient(term.kind, term.constants, speeds)
        if term.kind.name == 'inertia':
            weights[-2, columns[0]] = 1.0
        if term.kind.name == 'stribeck':
            weights[-1, columns[0]] = 1.0
    weights[-1] += weights[LINE.index('coulomb')]
    return weights


def _without_thirds(fit: Fit) -> np.ndarray:
    """Return the coefficients, (4, P), of all samples, and without each third of the speed.

    A model that lacks something fits each third differently, which parts of the recording drawn at
    random do not show.
    """
    table = fit.table
    columns = table.indices(fit.terms, derivatives=False)
    sums = table.sums_over(
        fit.terms, thirds(np.abs(np.asarray(fit.rows.at_rows.velocity))) // 2)
    fits = np.zeros((4, max(fit.intervals.coefficients) + 1))
    fits[:, columns] = sums.fits_without(
        range(len(columns)), np.vstack((np.ones(3), 1.0 - np.eye(3))) > 0.0)
    return fits


def _with_filtered_current(fit: Fit) -> np.ndarray:
    """Return the coefficients, (P,), of all samples if the current is filtered as the motion is.

    A fit predicts the current as it was recorded. The acceleration of a filtered motion is smaller
    than that which the current shows, so that inertia and what resembles it become larger.
    """
    rows, table = fit.rows, fit.table
    indices = table.indices(fit.terms, derivatives=False)
    already = [column for term in fit.terms if term.kind.variable in _FILTERED
               for column in table.columns_of[term]]
    every = np.column_stack((fit.columns(), rows.target))
    full = np.where(np.isin([*indices, -1], already), every,
                    filtered_as_acceleration(every, rows.samples, fit.settings))
    sums = BlockSums.over(rows.averaged(full).T, [slice(None)], table.sums.signs[indices])
    result = np.zeros(max(fit.intervals.coefficients) + 1)
    result[indices] = sums.fit(range(len(indices)))
    return result
