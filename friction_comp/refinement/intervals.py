# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""95 % intervals of all that is fitted, and of the numbers that follow from it.

They are those of fits to regimes of motion drawn at random, with replacement: a model that lacks
something fits each regime differently. What the recording hardly tells widens them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import numpy as np

from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.friction_numbers import (
    inertia_of,
    is_of_speed,
    line_by_coefficient,
    line_of,
    near_standstill,
    speeds_of,
)
from friction_comp.model.model_file import LINE, Recorded
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import EQ6_LINEAR, first_model, Term
from friction_comp.refinement.search import constant_derivatives, Fit, free_constants, step_size
from friction_comp.statistics import rms, robust_std

_DRAWS = 200
# Half an interval over the standard deviation: Student's with a degree of freedom less than
# `REGIMES`. `scipy.special`, which computes it, takes as long to import as this whole module runs.
_QUANTILE = 2.1314
# Change of the lag, s, over which intervals take its effect, and factor on how far such columns
# move a fit: being linear, they fall a little short.
_LAG_STEP, _BEYOND = 0.01, 1.25
# Quantiles of the speed in motion that a model file keeps.
_SPEEDS = 12
# Column of Eq. 6's derivative with respect to the logarithm of the steepness.
_STEEPNESS = 3
# Half an interval, of the current, that is due to rounding.
_ROUNDING = 1e-9
# Widest transition of a sign change that counts as determined: a factor of e either way.
_MOST_LOG = 1.0


@dataclass(frozen=True)
class Intervals:
    """95 % intervals of all fitted parameters, and the fits to drawn regimes."""

    # By column of the table, and by term and name.
    coefficients: dict[int, tuple[float, float]]
    constants: dict[tuple[Term, str], tuple[float, float]]
    draws: np.ndarray  # (D, P), both together
    # How far what is `_unsettled` moves each coefficient.
    moved: np.ndarray

    def half_width(self, weights: np.ndarray) -> float:
        """Return half the interval of a weighted sum of coefficients, with a weight by column."""
        sums = self.draws[:, :len(self.coefficients)] @ weights[list(self.coefficients)]
        return _QUANTILE * float(robust_std(sums - np.median(sums)))

    def ends(self, weights: np.ndarray) -> tuple[float, float]:
        """Return how far below and above a weighted sum of coefficients its interval ends."""
        half, moved = self.half_width(weights), float(self.moved @ weights[list(self.coefficients)])
        return half + max(-moved, 0.0), half + max(moved, 0.0)


def _unsettled(fit: Fit) -> list[np.ndarray]:
    """Return columns, each (M, R), of what a fit assumes without being able to tell it well.

    A fit assumes that the joint has no other inertia, weight or spring: their columns are returned.
    It also assumes that torque and motion are recorded at the same time and filtered alike: the
    changes of the prediction at earlier and later times stand for a delay or a filter of either.
    """
    table, rows = fit.table, fit.rows
    kinds = {term.kind for term in fit.terms}
    prediction = fit.columns(rows) @ list(table.coefficients(fit.terms).values())
    step = max(_LAG_STEP, rows.samples.sample_time)
    moved = [(shifted_in_time(prediction, rows.samples, count * step) - prediction)[rows.index]
             for count in (-4, -2, -1, 1, 2, 4)]
    return [np.array(moved), *(
        term.at_rows(rows) for term in first_model(table)
        if term.kind not in kinds and not term.kind.needs)]


def intervals(fit: Fit) -> Intervals:
    """Return intervals from fits to regimes drawn at random.

    Each fit has one more column for each constant, the derivative of its term, so that the interval
    of a coefficient includes the uncertainty of the constants, and how far the columns of
    `_unsettled` move it.
    """
    table, terms = fit.table, fit.terms
    free, indices, others = free_constants(terms), table.indices(terms), _unsettled(fit)
    derivatives, own = constant_derivatives(table, terms, free)
    # A coefficient that physics keeps at zero is as uncertain as if it were free: no signs.
    sums = BlockSums.over(np.vstack((table.columns[indices], derivatives, *others, table.target)),
                          fit.rows.block)
    both, count = range(len(sums.signs)), fit.rows.blocks
    drawn = np.random.default_rng(1).integers(0, count, (_DRAWS, count))
    weights = np.array([np.bincount(own_, minlength=count) for own_ in drawn], dtype=float)
    draws, fitted = sums.fits(both, weights), sums.fit(both)[None]
    # A change of a constant that the term's own columns can express is one of their coefficients.
    for fits in (draws, fitted):
        fits[:, :len(indices)] -= fits[:, len(indices):][:, :len(free)] @ own[:, indices]
    # By the median: draws that lack a direction of motion give outlying fits.
    half_widths = _QUANTILE * robust_std(draws - np.median(draws, axis=0), axis=0)
    # About the fit of the terms alone; the derivatives of Eq. 6 have no part in that.
    alone = {**dict(zip(indices, fitted[0])), **table.coefficients(terms)}
    middle = np.concatenate((list(alone.values()), np.zeros(len(free))))
    moved = _BEYOND * (fitted[0, :len(middle)] - middle)
    ends = np.array([np.minimum(moved, 0.0) - half_widths[:len(middle)],
                     np.maximum(moved, 0.0) + half_widths[:len(middle)]]).T
    coefficients = {column: (float(value + low), float(value + high))
                    for (column, value), (low, high) in zip(alone.items(), ends)}
    constants = {}
    for (index, name), steps in zip(free, ends[len(indices):]):
        term = terms[index]
        low, high = term.constants[name] + steps * step_size(term, name, table.rows.coverage)
        constants[term, name] = float(low), float(high)
    return Intervals(coefficients, constants, draws[:, :len(middle)], moved[:len(indices)])


def recorded_of(fit: Fit, bounds: Intervals, model: FrictionModel) -> Recorded:
    """Return the speeds and ranges of the recordings, and the intervals of a model's numbers."""
    rows = fit.rows
    speed = np.abs(np.asarray(rows.samples.velocity)[rows.usable])
    speeds = np.quantile(speed, (np.arange(_SPEEDS) + 0.5) / _SPEEDS)
    recorded = Recorded(tuple(np.unique(speeds[speeds > 0.0]).tolist()))
    model = replace(model, recorded=recorded)
    weights, straight = _weights(fit, bounds, speeds_of(model)), line_of(model)
    values = (*straight.values(), inertia_of(model),
              near_standstill(model, straight['coulomb']))
    found = {}
    for name, row, value in zip((*LINE, 'inertia', 'static'), weights, values):
        below, above = bounds.ends(row)
        # In motion in one direction, the offset is part of Coulomb friction. A coefficient that
        # physics keeps at zero has no scatter, but rounding.
        if value is not None and min(below, above) > _ROUNDING * rms(rows.target):
            found[name] = value - below, value + above
    of_steepness = np.eye(weights.shape[1])[_STEEPNESS]
    coulomb = abs(model.sigmoid.line[1])
    spread = bounds.half_width(of_steepness) / coulomb if coulomb else math.inf
    if 0.0 < spread <= _MOST_LOG:
        transition = 2.0 / model.sigmoid.steepness
        found['transition'] = (transition * math.exp(-spread), transition * math.exp(spread))
    return replace(recorded, intervals=found).with_ranges(
        rows.samples.take(rows.usable), model.effects)


def _weights(fit: Fit, bounds: Intervals, speeds: np.ndarray) -> np.ndarray:
    """Return the weights, (5, P), that make a fit's coefficients to `LINE`, inertia and static."""
    weights = np.zeros((len(LINE) + 2, max(bounds.coefficients) + 1))
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
