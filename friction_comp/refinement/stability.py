# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Which terms can be named: repeated searches, intervals, and thirds that were not fitted.

The search is repeated on resampled blocks, and an effect is named where most searches choose it.
The scatter of the coefficients over resampled blocks gives their intervals.

The next recording will differ from this one in speed, position, time, load or posture. Therefore
each third of the samples, ordered by each of these, is predicted by a fit to the other thirds. The
largest of these errors is the error expected elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from typing import NamedTuple

import numpy as np
from scipy import stats

from friction_comp.model.arm import neighbourhood
from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import (
    eq6_columns,
    EQ6_LINEAR,
    first_model,
    proposals,
    Table,
    Term,
)
from friction_comp.refinement.prepare import regions_of
from friction_comp.refinement.search import (
    adjust_constants,
    constant_derivatives,
    free_constants,
    Search,
    step_size,
)
from friction_comp.statistics import CONFIDENCE, robust_std, student_quantile

# A column of the table, or a constant of a term.
Parameter = int | tuple[Term, str]
_DRAWS = 200
# Factor on how far the columns of `unsettled` move a fit: being linear, they fall a little short.
_BEYOND = 1.25
RECORDING, POSTURE = 'recording', 'posture'
"""Stand among variables for which of several recordings it was, and for where all joints were."""


def repeat_search(table: Table, terms: Sequence[Term], initial_count: int,
                  candidates: Sequence[Term]) -> dict[Term, float]:
    """Repeat the whole search on resampled blocks; return the share that chooses each term.

    The first `initial_count` terms are those of the initial model; all others, and the candidates,
    may be chosen.
    """
    rng = np.random.default_rng(0)
    fixed, span = list(terms[:initial_count]), table.rows.coverage.span
    single_kinds = {term.kind for term in terms if term.kind.max_count == 1 and not term.group}
    # Terms are offered with their adjusted constants, not also with neighbouring ones of the grid.
    offered = [*terms[initial_count:], *(term for term in candidates
                                         if term.kind not in single_kinds and term not in terms)]
    # As in the first search, drifts are offered last: over time, much can look like one.
    drifts = [term for term in offered if term.kind.variable == 'time']
    lasting = [term for term in offered if term not in drifts]
    expected = [term for term in lasting if term.kind.in_first_model and not term.group]
    groups = [term for term in terms[initial_count:] if term.group]
    # A group of other joints needs the joint's own inertia or weight.
    table = table.part(list(dict.fromkeys([*terms, *offered, *(
        term for term in table.columns_of if term.kind.in_first_model)])))
    searches: list[list[Term]] = []
    while len(searches) < thresholds.SEARCHES:
        weights = table.draw_blocks(rng)
        if np.sum(weights == 0) < 3:
            continue
        search = Search(table, lasting, fixed, weights)
        start = search.without_collinear([*fixed, *dict.fromkeys([*expected, *groups])])
        better = search.backward(search.forward(start))
        search.candidates = drifts
        searches.append(search.forward(better))
    return {term: float(np.mean([any(term.same_effect(other, span) for other in result)
                                 for result in searches])) for term in terms}


def rivals_of(table: Table, terms: Sequence[Term], initial_count: int) -> dict[Term, list[str]]:
    """Return by term the effects with which in its place blocks are predicted as well.

    The motion of the recording cannot tell the term from them. The first `initial_count` terms are
    those of the initial model, and stay.
    """
    rivals: dict[Term, list[str]] = {term: [] for term in terms[initial_count:]}
    trial = table.part(terms)
    trial.fit_transition(terms)
    search, now = Search(trial, []), trial.transition
    own = trial.block_errors(terms, derivatives=False)
    for term, named in rivals.items():
        rest = [other for other in terms if other != term]
        # A rival, whose constants are not adjusted yet, must bring half of what the term brings.
        most = own.sum() + thresholds.STAYS * (trial.block_errors(rest, False) - own).sum()
        search.candidates = trial.add([
            other for other in proposals(trial, rest) if other.choice != term.choice])
        for other in search.shortlist(rest):
            errors = trial.block_errors([*rest, other], False)
            # Other terms of the same effect are no other effect.
            if not errors.sum() < most or other.kind.name in (term.kind.name, *named):
                continue
            if search.is_improvement([errors], [own]):
                instead = adjust_constants(trial, [*rest, other], 3)
                trial.fit_transition(instead)
                errors = trial.block_errors(instead, False)
                trial.set_transition(*now)
            if not search.is_improvement([errors], [own]):
                named.append(other.kind.name)
    return rivals


@dataclass(frozen=True)
class Intervals:
    """95 % intervals of all fitted parameters, and the fits to resampled blocks."""

    # By column of the table, and by term and name.
    coefficients: dict[int, tuple[float, float]] = field(default_factory=dict)
    constants: dict[tuple[Term, str], tuple[float, float]] = field(default_factory=dict)
    draws: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))  # (D, P), both together
    quantile: float = math.nan  # half an interval over the standard deviation of the draws
    # How far what is `unsettled` moves each coefficient.
    moved: np.ndarray = field(default_factory=lambda: np.empty(0))
    # Coefficients of the draws, (D, P), each with what its term's constants change in its column.
    contributions: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    def half_width(self, weights: np.ndarray) -> float:
        """Return half the interval of a weighted sum of coefficients, with a weight by column."""
        sums = self.draws[:, :len(self.coefficients)] @ weights[list(self.coefficients)]
        return self.quantile * float(robust_std(sums - np.median(sums)))

    def ends(self, weights: np.ndarray) -> tuple[float, float]:
        """Return how far below and above a weighted sum of coefficients its interval ends."""
        half, moved = self.half_width(weights), float(self.moved @ weights[list(self.coefficients)])
        return half + max(-moved, 0.0), half + max(moved, 0.0)

    def excludes_zero(self, table: Table, term: Term) -> bool:
        """Return whether the interval of a term's contribution excludes zero.

        Its columns may stand in for each other, or for other terms: no coefficient is certain then,
        but what they add to the other terms is. That of each fit is projected on that of the fit to
        all blocks, and its interval is as wide as the choice of this direction requires (Scheffé).
        Where physics requires the sign of any coefficient, only these count.
        """
        columns = table.columns_of[term]
        columns = [column for column in columns if table.sums.signs[column]] or columns
        middle = np.array([np.mean(self.coefficients[column]) for column in columns])
        others = [column for column in self.coefficients if column not in columns]
        weights = np.zeros(len(table.columns))
        weights[columns] = table.sums.beside(columns, others) @ middle
        size = len(columns)
        wider = math.sqrt(
            size * stats.f.ppf(CONFIDENCE, size, table.rows.blocks - 1)) / self.quantile
        own = replace(self, draws=self.contributions)
        return bool(middle @ weights[columns] > wider * own.half_width(weights))

    def correlations(self) -> list[tuple[float, Parameter, Parameter]]:
        """Return the rank correlation of each pair of parameters, the largest first."""
        ranks = stats.rankdata(self.draws, axis=0)
        ranks -= ranks.mean(axis=0)
        size = np.sqrt(np.sum(ranks ** 2, axis=0)) + 1e-300
        matrix = (ranks / size).T @ (ranks / size)
        names: list[Parameter] = [*self.coefficients, *self.constants]
        pairs = [(float(matrix[j, k]), names[j], names[k])
                 for k in range(len(names)) for j in range(k)]
        return sorted(pairs, key=lambda pair: -abs(pair[0]))


def unsettled(table: Table, terms: Sequence[Term]) -> list[np.ndarray]:
    """Return columns, each (M, R), of what a fit assumes without being able to tell it well.

    A fit assumes that the joint has no other inertia, weight or spring: their columns are returned.
    It also assumes that torque and motion are recorded at the same time and filtered alike: the
    changes of the prediction at earlier and later times stand for a delay or a filter of either.
    """
    rows, kinds = table.rows, {term.kind for term in terms}
    prediction = np.column_stack([eq6_columns(rows, *table.transition)[:, :EQ6_LINEAR], *(
        term.columns(rows) for term in terms)]) @ list(table.coefficients(terms).values())
    step = max(thresholds.LAG_STEP, rows.samples.sample_time)
    moved = [rows.averaged(shifted_in_time(prediction, rows.samples, count * step) - prediction)
             for count in (-4, -2, -1, 1, 2, 4)]
    return [np.array(moved), *(
        term.at_rows(rows) for term in first_model(table)
        if term.kind not in kinds and not term.kind.needs)]


def intervals(table: Table, terms: Sequence[Term], others: Sequence[np.ndarray] = ()) -> Intervals:
    """Return intervals from fits to resampled blocks.

    Each fit has one more column for each constant, the derivative of its term, so that the interval
    of a coefficient includes the uncertainty of the constants. An interval also includes how far
    the columns of `others`, each (M, R), move the coefficient, see `unsettled`; without these, as
    where it is asked whether an effect is there, a constant at its upper limit counts as known.
    """
    free = free_constants(terms)
    indices = table.indices(terms)
    derivatives, own = constant_derivatives(table, terms, free, bool(others))
    columns = np.vstack((table.columns[indices], derivatives, *others, table.target))
    # A coefficient that physics keeps at zero is as uncertain as if it were free.
    signs = np.zeros(len(columns) - 1, dtype=int)
    signs[:len(indices)] = table.sums.signs[indices] * (not others)
    sums, both = BlockSums.over(columns, table.block_rows, signs), range(len(signs))
    rng = np.random.default_rng(1)
    weights = np.array([table.draw_blocks(rng) for _ in range(_DRAWS)], dtype=float)
    draws, fitted = sums.fits(both, weights), sums.fit(both)[None]
    contributions = draws[:, :len(indices)].copy()
    # A change of a constant that the term's own columns can express is one of their coefficients.
    for fits in (draws, fitted):
        fits[:, :len(indices)] -= fits[:, len(indices):][:, :len(free)] @ own[:, indices]
    quantile = float(student_quantile(table.rows.blocks - 1))
    # By the median: samples that lack a direction of motion give outlying fits.
    half_widths = quantile * robust_std(draws - np.median(draws, axis=0), axis=0)
    # About the fit of the terms alone; the derivatives of Eq. 6 have no part in that.
    alone = {**dict(zip(indices, fitted[0])), **table.coefficients(terms)}
    middle = np.concatenate((list(alone.values()), np.zeros(len(free))))
    moved = _BEYOND * (fitted[0, :len(middle)] - middle) * bool(others)
    ends = np.array([np.minimum(moved, 0.0) - half_widths[:len(middle)],
                     np.maximum(moved, 0.0) + half_widths[:len(middle)]]).T
    coefficients = {column: (float(value + low), float(value + high))
                    for (column, value), (low, high) in zip(alone.items(), ends)}
    constants = {}
    for (index, name), steps in zip(free, ends[len(indices):]):
        term = terms[index]
        low, high = term.constants[name] + steps * step_size(term, name, table.rows.coverage)
        constants[term, name] = float(low), float(high)
    return Intervals(coefficients, constants, draws, quantile, moved[:len(indices)], contributions)


def error_growth(table: Table, terms: Sequence[Term]) -> dict[str, float]:
    """Return by variable the error on its thirds, each left out of a fit, over that on blocks.

    A third counts as far as twice the range of the others: a staircase of speeds has accelerations
    for milliseconds, a hundred times those of the other samples, and who leaves these out knows
    nothing of inertia.
    """
    averages, columns = table.rows.at_rows, range(len(table.indices(terms, derivatives=False)))
    variables = {'speed': np.abs(np.asarray(averages.velocity)), 'position': averages.position,
                 'time': np.arange(len(table.target)),
                 'acceleration': np.abs(np.asarray(averages.acceleration)),
                 'load': averages.load, 'temperature': averages.temperature}
    # Where nearly all values are equal, as accelerations by a velocity in whole register counts,
    # all are in one third, and nothing would be left to fit.
    partitions = {name: part for name, values in variables.items()
                  if values is not None and np.ptp((part := thirds(values)) // 2) > 0}

    def error(part: np.ndarray) -> float:
        """Return the mean squared error of each third by the others, where these reach it."""
        sums = table.sums_over(terms, part)
        held_out = sums.errors_without(columns, np.arange(len(sums.rows)) // 2)
        return max(float(held_out[::2].sum()) / max(float(sums.rows[::2].sum()), 1.0), 1e-300)
    least = error(2 * table.rows.block)
    return {name: math.sqrt(error(part) / least) for name, part in partitions.items()}


def starts_of(table: Table) -> list[list[Term]]:
    """Return the starts of a search: the first model, without and with neighbouring links.

    Weight, spring and inertia may cancel in a motion, so that each helps only with the others.
    """
    rows, starts = table.rows, [table.add(first_model(table))]
    if rows.joints and rows.samples.rigid_body is None:
        kind = EFFECTS['other_joints']
        starts.append([*starts[0], *table.add([Term(kind, {}, group) for group in neighbourhood(
            rows.joints, rows.samples.joint)])])
    return starts


def growth_elsewhere(table: Table, terms: Sequence[Term], initial_count: int) -> float:
    """Return the error in postures that no search has seen, over that of blocks.

    An arm without a URDF has more terms than its motion tells apart: those that are chosen stand in
    for others, and blocks, or a fit without some postures, do not show it, as all were seen when
    terms were chosen, often on a path that was driven again and again. So the search is repeated
    without each region of posture, from the same starts, and predicts it. The first `initial_count`
    terms are always in.
    """
    rows = table.rows
    assert rows.motion is not None
    trial = Table(replace(rows, region=regions_of(
        rows.averaged(rows.motion[0]), thresholds.POSTURES)), *table.transition)
    trial.add(terms, table)
    fixed = list(terms[:initial_count])
    candidates = list(dict.fromkeys([*terms, *trial.add(proposals(trial, fixed))]))
    starts, error = starts_of(trial), 0.0
    for region in np.unique(trial.region):
        rest = trial.without(region)
        search = Search(rest, candidates, fixed)
        # A cheap search, one fit to two thirds of the blocks, first removes most of the neighbours.
        rough = Search(rest, [], fixed, (np.arange(rows.blocks) % 3 > 0).astype(int))
        ends = [search.backward(search.forward(rough.backward(search.without_collinear(
            list(dict.fromkeys([*fixed, *start])))))) for start in starts]
        chosen = rest.indices(min(ends, key=search.cost), derivatives=False)
        errors = trial.sums.squared_errors(chosen, rest.sums.fit(chosen)[None])
        error += float(errors[trial.region == region].sum())
    return math.sqrt(error / max(float(table.block_errors(terms, False).sum()), 1e-300))


class Disagreement(NamedTuple):
    """How far recordings that are fitted together differ from each other.

    Quarters of each are predicted by a fit to all other quarters, to those of the same recording,
    and to those of the other recordings.
    """

    ratio: float    # error of the first over that of the second
    growth: float   # error of the third over that of the first
    name: str       # what differs most between fits to each: a number of Eq. 6, or an effect
    least: float    # its least and largest coefficient
    most: float


def disagreement(table: Table, terms: Sequence[Term]) -> Disagreement | None:
    """Return how far the recordings differ; None for a single one."""
    rows = table.rows
    number = np.unique(rows.samples.recording[rows.start], return_inverse=True)[1]
    count = int(number.max()) + 1
    if count == 1:
        return None
    quarter = np.empty_like(number)
    for k in range(count):
        own = np.flatnonzero(number == k)
        quarter[own] = 4 * k + 4 * np.arange(len(own)) // len(own)
    sums, group = table.sums_over(terms, quarter), np.arange(4 * count)
    every, others, same = (range(len(sums.signs)), group != group[:, None],
                           group // 4 == group[:, None] // 4)
    together, alone = (float(sums.squared_errors(every, sums.fits_without(every, train)).sum())
                       for train in (others, others & same))
    left_out = float(sums.errors_without(every, group // 4).sum())
    fits = sums.fits_without(every, same[::4])
    most = int(np.argmax(np.ptp(fits, axis=0) * sums.norms))
    names = ['the offset', 'Coulomb friction', 'viscous friction', *(
        term.kind.name.replace('_', ' ') for term in terms for _ in table.columns_of[term])]
    return Disagreement(
        math.sqrt(together / max(alone, 1e-300)), math.sqrt(left_out / max(together, 1e-300)),
        names[most], float(fits[:, most].min()), float(fits[:, most].max()))


def thirds(values: np.ndarray) -> np.ndarray:
    """Return twice the third of each value, shape (R,), plus 1 if the others do not reach it."""
    edges = np.quantile(values, (1 / 3, 2 / 3))
    third = np.searchsorted(edges, values, side='right')
    low, high = float(values.min()), float(values.max())
    beyond = (third == 2) & (values - edges[1] > edges[1] - low)
    beyond |= (third == 0) & (edges[0] - values > high - edges[0])
    return 2 * third + beyond
