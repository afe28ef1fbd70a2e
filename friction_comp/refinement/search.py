# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects effects by one criterion: the error in regimes of motion that were not fitted.

Terms are added while that error becomes clearly smaller, and removed while it does not become
clearly larger: what is left is the smallest model whose error is within the scatter of the best.
Constants are adjusted between the points of their grids. The bandwidth and the lag of motion are
chosen with the terms found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.arm import neighbourhood
from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effect import Coverage
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums, held_out_error
from friction_comp.refinement.effect_columns import (
    eq6_columns,
    EQ6_LINEAR,
    first_model,
    MAX_SHIFT,
    proposals,
    Table,
    Term,
)
from friction_comp.refinement.prepare import (
    choose_signals,
    prepare,
    resolved_settings,
    Rows,
    smooth_settings,
)
from friction_comp.samples import Samples

_STEP = 1e-3
_RIDGE = 1e-6
# Of the squared error: a step that brings less is the last.
_LEAST_GAIN = 1e-3


def gain_of(before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """Return the share of a squared error that is gained, and the gain in standard errors.

    Both are the errors of regimes, (K,). In the second, each counts relative to its own error, so
    that one with large errors cannot decide.
    """
    gain, count = before - after, len(before)
    ratio = gain / np.maximum(before + after, 1e-300)
    mean = float(ratio.sum()) / count
    scatter = math.sqrt(float(np.sum((ratio - mean) ** 2)) / (count - 1) / count)
    return float(gain.sum() / max(before.sum(), 1e-300)), mean / max(scatter, 1e-12)


def error_reductions(sums: np.ndarray, chosen: list[int], candidates: Sequence[Sequence[int]],
                     signs: np.ndarray) -> np.ndarray:
    """Return the reduction of the fitted sum of squares by each candidate's columns, shape (N,).

    `sums`, shape (P + 1, P + 1), have the target last; the `chosen` columns are in the fit, and
    `signs`, shape (P,), are required.
    """
    norm = np.sqrt(np.maximum(np.diag(sums), 1e-300))
    inner = sums[chosen] / norm / norm[chosen][:, None]
    projection = np.linalg.solve(inner[:, chosen] + 1e-8 * np.eye(len(chosen)), inner).T
    reductions = np.zeros(len(candidates))
    sizes = np.array([len(columns) for columns in candidates])
    for size in np.unique(sizes[sizes > 0]):
        indices = np.nonzero(sizes == size)[0]
        columns = np.array([candidates[int(k)] for k in indices])
        # With the target last.
        full = np.column_stack((columns, np.full(len(columns), len(norm) - 1)))
        scaled = sums[columns[:, :, None], full[:, None]] / norm[columns][:, :, None]
        remaining = scaled / norm[full][:, None] - projection[columns] @ inner.T[full].transpose(
            0, 2, 1)
        target = remaining[:, :, -1].copy()
        remaining[:, np.arange(size), np.arange(size)] += 1e-6
        step = np.linalg.solve(remaining[:, :, :-1], target[:, :, None])[:, :, 0]
        gain = np.einsum('nm,nm->n', target, step)
        if size == 1:
            gain = np.where((signs[columns[:, 0]] > 0) & (step[:, 0] < 0.0), 0.0, gain)
        reductions[indices] = gain
    return reductions * norm[-1] ** 2


def own_shares(table: Table, terms: Sequence[Term]) -> list[float]:
    """Return of each term the share that is independent of Eq. 6 and the other terms.

    It is the root mean square over the combinations of its columns, so that it does not matter
    from where a position is measured.
    """
    scaled = table.sums.part(table.indices(terms, derivatives=False)).scaled(1e-12)
    inverse, shares, first = np.linalg.inv(scaled), [], EQ6_LINEAR
    for term in terms:
        part = slice(first, first := first + len(table.columns_of[term]))
        own = np.linalg.inv(inverse[part, part] @ scaled[part, part])
        shares.append(math.sqrt(abs(float(np.trace(own))) / len(own)))
    return shares


class Search:
    """A search among the terms that the effects propose for what is left of a table's target.

    The `fixed` terms are always kept.
    """

    def __init__(self, table: Table, fixed: Sequence[Term] = ()) -> None:
        self.table, self.fixed = table, list(fixed)
        self.candidates: list[Term] = []
        self._single = {term.kind for term in fixed if term.kind.max_count == 1}
        # Effects of time and history are offered last, so that they do not replace a recorded
        # cause, or a lag.
        self.late = False
        # By transition and terms, which the same steps compare again and again.
        self._errors: dict[tuple[tuple[float, float], frozenset[Term]], np.ndarray] = {}

    def errors(self, terms: Sequence[Term]) -> np.ndarray:
        """Return the squared error of each regime by the fit to all others."""
        key = self.table.transition, frozenset(terms)
        if key not in self._errors:
            self._errors[key] = self.table.errors(terms)
        return self._errors[key]

    @staticmethod
    def is_better(before: np.ndarray, after: np.ndarray) -> bool:
        """Return whether an error becomes clearly lower: by a share, and beyond its scatter.

        Both are those of each regime, the last row of (L, K); where more is left out, the error
        must not grow: what is wrong in other motion fits a regime between others well. What halves
        the squared error may do so in fewer regimes: friction near standstill is in some alone.
        """
        share, errors = gain_of(np.atleast_2d(before)[-1], np.atleast_2d(after)[-1])
        least = thresholds.STANDARD_ERRORS * (0.5 if share > 0.5 else 1.0)
        return bool(share > thresholds.LEAST_SHARE and errors > least
                    and after.sum() < before.sum())

    def holds_over_time(self, term: Term, rest: Sequence[Term]) -> bool:
        """Return whether an effect of time lowers the error in parts of time, too, beside others.

        What depends on time differs in time, not in motion; and another recording is predicted
        without it.
        """
        if term.kind.variable != 'time':
            return True
        table, start = self.table, self.table.rows.start
        part = np.argsort(np.argsort(start)) * int(thresholds.REGIMES) // len(start)
        errors = []
        for terms in (rest, [*rest, term]):
            columns = table.indices(terms)
            sums = BlockSums.over(np.vstack((table.columns[columns], table.target)), part,
                                  table.sums.signs[columns])
            errors.append(sums.held_out_errors(range(len(columns))))
        return self.is_better(*errors)

    def with_own_terms(self, terms: Sequence[Term]) -> list[Term]:
        """Return terms, and the joint's own inertia or weight where groups of other joints need it.

        Without that part, such a group would have to represent both, and fail in other postures.
        """
        groups = [term.group for term in terms if term.group]
        own = {'weight': 'gravity', 'kinetic': 'inertia'}
        needed = {own[group.kind] for group in groups if group.kind in own}
        needed -= {term.kind.name for term in terms if not term.group}
        return [*terms, *(term for term in (self.table.columns_of if needed else ())
                          if not term.group and term.kind.name in needed)]

    def without_collinear(self, terms: Sequence[Term]) -> list[Term]:
        """Return the terms without collinear ones; of these, the last is removed first.

        Over a short range a spring looks like a weight, and at one speed curvature like an offset:
        such terms get large coefficients that cancel, and are wrong in all other motion.
        """
        terms = list(terms)
        while True:
            shares = own_shares(self.table, terms)
            collinear = [term for term, share in zip(terms, shares)
                         if term not in self.fixed and share < thresholds.OWN_SHARE]
            if not collinear:
                return terms
            terms.remove(collinear[-1])

    def update_candidates(self, terms: Sequence[Term]) -> None:
        """Replace the candidates by the terms proposed for the residual of a fit."""
        table = self.table
        proposed = [term for term in proposals(table, terms) if term.kind not in self._single
                    and (self.late or term.kind.variable not in ('time', 'history'))]
        table.keep({*self.fixed, *terms, *proposed, *first_model(table)})
        self.candidates = table.add(proposed)

    def shortlist(self, terms: Sequence[Term]) -> list[Term]:
        """Return the candidates that reduce the fitted error most, one of each effect."""
        counts, known = Counter(term.choice for term in terms), set(terms)
        allowed = [term for term in self.candidates if term not in known and (
            counts[term.choice] < term.kind.max_count)]
        if not allowed:
            return []
        reductions = error_reductions(
            self.table.sums.gram.sum(axis=0), self.table.indices(terms),
            [self.table.columns_of[term] for term in allowed], self.table.sums.signs)
        best: dict[Any, Term] = {}
        for index in np.argsort(-reductions, kind='stable'):
            term = allowed[index]
            if reductions[index] > 0.0:
                best.setdefault(term.choice, term)
        return list(best.values())[:int(thresholds.SHORTLIST)]

    def adjusted(self, terms: Sequence[Term]) -> list[Term]:
        """Return terms with constants adjusted, as the transition of Eq. 6 is."""
        terms = adjust_constants(self.table, terms, 3)
        self.table.fit_transition(terms)
        return terms

    def forward(self, terms: Sequence[Term]) -> list[Term]:
        """Add terms while one is needed, and remove those that became superfluous."""
        terms = list(terms)
        while True:
            self.update_candidates(terms)
            before, transition = self.errors(terms), self.table.transition
            trials = [(self.errors(self.with_own_terms([*terms, term])), term)
                      for term in self.shortlist(terms)]
            trials.sort(key=lambda trial: float(trial[0][-1].sum()))
            best = next((term for after, term in trials if self.is_better(before, after)
                         and self.holds_over_time(term, terms)
                         and term in self.without_collinear([*terms, term])), None)
            if best is None:
                return terms
            grown = self.backward(self.adjusted(self.with_own_terms([*terms, best])))
            if not self.errors(grown).sum() < before.sum():
                self.table.set_transition(*transition)
                self.table.add(terms)
                return terms
            terms = grown

    def backward(self, terms: Sequence[Term]) -> list[Term]:
        """Remove terms that are not needed, the least useful first."""
        terms = self.with_own_terms(terms)
        while True:
            full, trials = self.errors(terms), []
            for term in terms:
                rest = [other for other in terms if other != term]
                if term in self.fixed or term in self.with_own_terms(rest):
                    continue
                without = self.errors(rest)
                if not self.is_better(without, full):
                    trials.append((float(without[-1].sum()), term))
            if not trials:
                return terms
            terms.remove(min(trials, key=lambda trial: trial[0])[1])

    def run(self, start: Sequence[Term]) -> list[Term]:
        """Search from some terms; return the terms at its end."""
        # A weight may be no improvement until the larger ripple beside it is known, so terms are
        # removed only after others were added.
        terms = self.without_collinear(list(dict.fromkeys([*self.fixed, *start])))
        self.table.fit_transition(terms)
        return self.backward(self.adjusted(self.forward(terms)))

    def run_late(self, terms: Sequence[Term]) -> list[Term]:
        """Search on with effects of time and history; return the terms at the end."""
        self.late = True
        return self.backward(self.adjusted(self.forward(terms)))


def step_size(term: Term, name: str, coverage: Coverage) -> float:
    """Return the change of a constant that is one step: the half width of its search range."""
    search, value = term.kind.constants[name], float(term.constants[name])
    assert search is not None
    if search.unit is None:
        return value * math.log(search.width)
    return 0.5 * search.width * search.unit(coverage, term.constants)


def with_step(term: Term, name: str, step: float, coverage: Coverage) -> Term:
    """Return a term with a constant changed by `step` steps, within its limits; see `step_size`."""
    search, value = term.kind.constants[name], term.constants[name]
    assert search is not None
    if search.unit is None:
        value *= search.width ** step
    else:
        value += step_size(term, name, coverage) * step
    low, high = search.limits(coverage, term.constants)
    return replace(term, constants={**term.constants, name: min(max(float(value), low), high)})


def free_constants(terms: Sequence[Term]) -> list[tuple[int, str]]:
    """Return the constants of terms that have a search range: index of the term, and name."""
    return [(index, name) for index, term in enumerate(terms) if term.group is None
            for name, search in term.kind.constants.items() if search is not None]


def constant_derivatives(table: Table, terms: Sequence[Term], free: Sequence[tuple[int, str]],
                         ) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of a fit's prediction by Q `free_constants`, shape (Q, R).

    The unit of each constant is its `step_size`. The part that the term's own columns can express
    is subtracted, and returned as coefficients of all columns, (Q, P).
    """
    coefficients, gram = table.coefficients(terms), table.sums.gram.sum(axis=0)
    rows, shares = np.empty((len(free), len(table.target))), np.zeros((len(free), len(gram) - 1))
    for k, (index, name) in enumerate(free):
        columns = table.columns_of[terms[index]]
        step, changed = _STEP, with_step(terms[index], name, _STEP, table.rows.coverage)
        if changed == terms[index]:
            # It is at its upper limit.
            step, changed = -_STEP, with_step(terms[index], name, -_STEP, table.rows.coverage)
        gain = np.array([coefficients[column] for column in columns])
        own = table.columns[columns]
        change = gain @ (changed.at_rows(table.rows) - own) / step
        shares[k, columns] = np.linalg.lstsq(
            gram[np.ix_(columns, columns)], own @ change, rcond=None)[0]
        rows[k] = change - shares[k, columns] @ own
    return rows, shares


def adjust_constants(table: Table, terms: Sequence[Term], rounds: int) -> list[Term]:
    """Adjust the constants of terms together with the coefficients, and return the terms.

    Each round is a Gauss-Newton step, halved until the error decreases. Terms that depend on the
    load of others get the loads of the new fit.
    """
    every, table = table, table.part(terms)
    terms = _with_current_loads(table, list(terms))
    for _ in range(rounds):
        free = free_constants(terms)
        if not free:
            break
        # Trials of the rounds before make room for others.
        table.keep(terms)
        residual = table.residual(terms, derivatives=False)
        design = np.vstack((table.columns[table.indices(terms)],
                            constant_derivatives(table, terms, free)[0]))
        norm = np.sqrt(np.einsum('ij,ij->i', design, design)) + 1e-300
        gram = design @ design.T / norm / norm[:, None]
        gram[np.diag_indices(len(gram))] += _RIDGE
        step = np.linalg.solve(gram, design @ residual / norm) / norm
        step = np.clip(step[-len(free):], -1.0, 1.0)
        initial = float(residual @ residual)
        for share in (1.0, 0.5, 0.25):
            changed = list(terms)
            for (index, name), size in zip(free, share * step):
                changed[index] = with_step(changed[index], name, float(size), table.rows.coverage)
            distinct = len(set(changed)) == len(changed)
            if distinct and len(table.add(changed)) == len(changed) and (
                    error := table.sums.fitted_error(table.indices(changed, False))) < initial:
                break
        else:
            break
        terms = _with_current_loads(table, changed)
        if error > (1.0 - _LEAST_GAIN) * initial:
            break
    return every.add(terms, table)


def _with_current_loads(table: Table, terms: list[Term]) -> list[Term]:
    """Return terms with the loads that follow from the coefficients of the other terms."""
    for index, term in enumerate(terms):
        if term.kind.uses_inner_load:
            constants = term.kind.with_loads(term.constants, table.load_shares(terms))
            added = table.add([Term(term.kind, constants)])
            terms[index] = added[0] if added else term
    return terms


# Most times that filters, or a lag, are chosen with the terms found before.
_FILTERS = 5
# Number of lags that are tried on each side, from half a sample to the longest.
_LAGS = 9
# Transitions that are tried on all samples, and the most samples for that.
_STEEPNESSES, _MOST_SAMPLES = 12, 20_000


@dataclass(frozen=True)
class Problem:
    """The input of refinement."""

    raw: Samples  # all recordings
    drive: Drive
    declared: bool  # whether torque constant and gear ratio are known
    model: FrictionModel | None  # the initial one
    linear: bool = False  # whether positions are in m


@dataclass(frozen=True)
class Fit:
    """The result of a search."""

    table: Table
    terms: list[Term]  # the terms, those of the initial model first
    initial_count: int  # number of terms of the initial model
    settings: dict[str, Any]  # of differentiation
    # Other effects from which the recording cannot tell each term; see `rivals_of`.
    rivals: dict[Term, list[str]] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        """The fitted rows."""
        return self.table.rows

    @property
    def lag(self) -> float:
        """By how much the torque follows the recorded current, s."""
        return float(self.settings.get('lag') or 0.0)

    def rmse_with(self, terms: Sequence[Term]) -> float:
        """Return the held-out RMS error of some of the terms, at the present transition, A."""
        errors = self.table.sums.held_out_errors(self.table.indices(terms, derivatives=False))
        return math.sqrt(float(errors.sum()) / float(self.table.sums.rows.sum()))

    def rmse_by_size(self) -> np.ndarray:
        """Return the RMS errors where a half of the motion is not fitted, a quarter, ..., A."""
        table = self.table
        errors = table.sums.errors_by_size(table.indices(self.terms, derivatives=False))
        return np.sqrt(errors.sum(axis=1) / float(table.sums.rows.sum()))

    def columns(self) -> np.ndarray:
        """Return the columns of Eq. 6 and of the terms on all samples, shape (N, S)."""
        return np.column_stack([eq6_columns(self.rows, *self.table.transition)[:, :EQ6_LINEAR],
                                *(term.columns(self.rows) for term in self.terms)])

    def residual(self) -> np.ndarray:
        """Return the residual of each sample by a fit to all other regimes, A, shape (N,)."""
        table, rows = self.table, self.table.rows
        fits = table.sums.fits(
            table.indices(self.terms, derivatives=False), 1.0 - np.eye(rows.blocks))
        return rows.target - np.einsum('ns,ns->n', self.columns(), fits[rows.block_of_sample])

    def chosen(self, term: Term) -> float:
        """Return the share of regimes that are predicted better with a term."""
        rest = [other for other in self.terms if other != term]
        return float(np.mean(self.table.errors(self.terms) < self.table.errors(rest)))


def fit_eq6_alone(fit: Fit) -> Fit:
    """Fit Eq. 6 to the rows of another fit, without effects."""
    table = Table(fit.rows, 2.0 / fit.rows.coverage.transition)
    table.fit_transition([])
    return refit(Fit(table, [], 0, fit.settings), [])


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


def search_with(problem: Problem, settings: dict[str, Any] | None = None,
                begin: Sequence[Term] | None = None) -> Fit:
    """Search with differentiation settings, chosen when omitted, and return the best fit.

    The search begins with the terms of the initial model and those of `begin`, or with each of
    `starts_of`.
    """
    rows, settings = prepare(
        problem.raw, problem.drive, settings, problem.declared, problem.linear)
    model = problem.model
    start = model.sigmoid if model else Sigmoid(1.0, -1.0, 2.0 / rows.coverage.transition)
    table = Table(rows, start.steepness, start.shift)
    # A load that is already part of the target cannot be an effect as well.
    effects = [effect for effect in model.effects if not (
        rows.load_coefficient and effect.is_load)] if model else []
    for effect in effects:
        effect.check_signals(rows.samples)
    initial = table.add([Term(type(effect), dict(effect.values)) for effect in effects])
    if not model:
        table.fit_transition([])
    known = {term.kind for term in initial if term.kind.max_count == 1}
    ends: list[tuple[float, list[Term], tuple[float, float]]] = []
    transition = table.transition
    for first in starts_of(table) if begin is None else [list(begin)]:
        table.set_transition(*transition)
        search = Search(table, initial)
        terms = search.run(table.add(
            [term for term in first if term.group or term.kind not in known]))
        # Of ends that are as good, the smaller model.
        cost = (1.0 + thresholds.LEAST_SHARE) ** len(terms)
        ends.append((cost * float(search.errors(terms).sum()), terms, table.transition))
    _, terms, transition = min(ends, key=lambda end: end[0])
    table.set_transition(*transition)
    table.add(terms)
    return Fit(table, terms, len(initial), settings)


def find_best_fit(problem: Problem) -> Fit:
    """Return the best fit over bandwidths and lags, each tried with the terms found before.

    What history explains, a lag may explain as well: with each, the search goes on to its end.
    """
    best = search_with(problem)
    # A plain drive knows of no ripple, which a filter of motion or of the load blurs.
    wider = smooth_settings(problem.raw)
    if best.settings['bandwidth'] < wider['bandwidth'] or best.settings.get('signals'):
        best = min(best, search_with(problem, wider), key=lambda fit: float(
            fit.table.errors(fit.terms).sum()) / len(fit.table.target))
    best = lagged = _at_best_motion(problem, best)
    # Terms stood in for a part of the lag: with them gone, it is found once more.
    for _ in range(_FILTERS):
        settings = _with_best_lag(lagged)
        if settings == lagged.settings:
            break
        lagged = _at_best_motion(problem, search_with(
            problem, settings, lagged.terms[lagged.initial_count:]))
    late = lagged is not best and _with_late_terms(lagged)
    best = _with_late_terms(best)
    if late:
        best = _better(best, late, thresholds.LAG_SHARE)
    return refit(best, best.terms)


def _at_best_motion(problem: Problem, fit: Fit) -> Fit:
    """Return the fit at the filters of motion and signals with which its terms predict best.

    Better filters show more terms, with which others may be better.
    """
    for _ in range(_FILTERS):
        settings = _with_best_motion(problem, fit)
        if settings == fit.settings:
            break
        again = search_with(problem, settings, fit.terms[fit.initial_count:])
        if _better(fit, again, thresholds.EQUIVALENT) is fit:
            break
        fit = again
    return fit


def _better(first: Fit, second: Fit, least: float) -> Fit:
    """Return the second fit if it has clearly less error, by a share; else the first."""
    share, errors = gain_of(*(fit.table.errors(fit.terms).mean(axis=0) / fit.table.sums.rows
                              for fit in (first, second)))
    return second if share > least and errors > thresholds.STANDARD_ERRORS else first


def _with_late_terms(fit: Fit) -> Fit:
    """Return a fit with effects of time and history, where these are needed."""
    search = Search(fit.table, fit.terms[:fit.initial_count])
    return replace(fit, terms=search.run_late(fit.terms))


def _error_by(fit: Fit) -> Callable[[Rows, float], float]:
    """Return the held-out squared error of a fit's terms on other rows, with another lag, s."""
    target = fit.table.target

    def error(rows: Rows, lag: float) -> float:
        columns = np.column_stack([eq6_columns(rows, *fit.table.transition),
                                   *(term.columns(rows) for term in fit.terms)])
        if lag:
            columns = shifted_in_time(columns, rows.samples, lag)
        columns = fit.rows.averaged(columns)
        return held_out_error(columns, target, fit.rows.block) if np.isfinite(
            columns).all() else math.inf
    return error


def _with_best_lag(fit: Fit) -> dict[str, Any]:
    """Return the settings with the delay of the current with which a fit's terms predict best.

    Terms may have stood in for the lag: a plain drive has its say, too.
    """
    step, plain = fit.rows.samples.sample_time, None
    if not fit.rows.load_coefficient:
        plain = replace(fit, terms=fit.table.add(first_model(fit.table)))
    sizes = np.geomspace(0.5, max(thresholds.LONGEST_LAG / step, 1.0), _LAGS) * step
    for tried in filter(None, (fit, plain)):
        error = _error_by(tried)
        errors = {lag: error(fit.rows, lag)
                  for lag in (0.0, *sizes.tolist(), *(-sizes).tolist())}
        lag = min(errors, key=lambda one: errors[one])
        # The lowest point of a parabola through the best lag of the grid and its neighbours.
        for _ in range(3):
            known = np.array(sorted(errors))
            place = int(np.clip(np.searchsorted(known, lag), 1, len(known) - 2))
            near = known[place - 1:place + 2]
            bend, slope, _ = np.polyfit(near - lag, [errors[one] for one in near], 2)
            if not bend > 0.0:
                break
            lag = float(np.clip(lag - 0.5 * slope / bend, near[0], near[-1]))
            if lag in errors:
                break
            errors[lag] = error(fit.rows, lag)
        lag = min(errors, key=lambda one: errors[one])
        least = thresholds.EQUIVALENT if fit.lag else 0.5 * thresholds.LAG_SHARE
        if errors[lag] < (1.0 - least) * errors[0.0]:
            return {**fit.settings, 'lag': fit.lag + float(lag)}
    return fit.settings


def _with_best_motion(problem: Problem, fit: Fit) -> dict[str, Any]:
    """Return the source and bandwidth of motion, and of signals, with which terms predict best."""
    error, raw, now = _error_by(fit), problem.raw, dict(fit.settings)

    def error_with(settings: dict[str, Any]) -> float:
        return error(fit.rows.with_settings(raw, settings), 0.0)
    # A load that is part of the target has to stay as it is.
    if not fit.rows.load_coefficient:
        now['signals'] = choose_signals(raw, lambda name, bandwidth: error_with(
            {**now, 'signals': {**now.get('signals', {}), name: {'bandwidth': bandwidth}}}))
    kept = {name: now[name] for name in ('lag', 'signals') if now.get(name)}
    choices = [{**choice, **kept} for choice in resolved_settings(raw)]
    least, choice = min(((error_with(choice), choice) for choice in choices),
                        key=lambda entry: entry[0])
    enough = (1.0 - thresholds.LEAST_SHARE) * error(fit.rows, 0.0)
    return choice if least < enough else fit.settings


def refit(fit: Fit, terms: Sequence[Term]) -> Fit:
    """Fit some terms alone, with the transition that predicts all samples best."""
    terms = adjust_constants(fit.table, terms, 5)
    # The transition is tried at many places, each with sums over all columns.
    table = fit.table.part(terms)
    table.fit_transition(terms)
    _fit_transition_to_all_samples(table, terms)
    return replace(fit, table=table, terms=terms)


def _fit_transition_to_all_samples(table: Table, terms: Sequence[Term]) -> None:
    """Set the transition of Eq. 6 that predicts all samples best, of those good in motion.

    Samples near standstill are not used to choose effects, since the current of a joint that
    sticks is not friction. But only they show how steeply friction changes its sign.
    """
    rows = table.rows
    index = np.arange(0, len(rows.samples), max(1, len(rows.samples) // _MOST_SAMPLES))
    steepness, shift = table.transition
    widths = rows.coverage.speed * np.geomspace(3e-4, 0.25, _STEEPNESSES)
    grid = [(steepness, shift), (steepness, 0.0)] + [
        (2.0 / width, trial) for width in widths for trial in dict.fromkeys((shift, 0.0))]
    others = np.column_stack([term.columns(rows) for term in terms]
                             or [np.empty((len(rows.samples), 0))])[index]
    some = replace(rows, samples=rows.samples.take(index))
    columns, target = table.indices(terms, derivatives=False), rows.target[index]
    trials = []
    for steepness, shift in grid:
        limit = MAX_SHIFT / steepness
        table.set_transition(steepness, float(np.clip(shift, -limit, limit)))
        error = float(table.sums.held_out_errors(columns).sum())
        base = eq6_columns(some, *table.transition)[:, :EQ6_LINEAR]
        fitted = table.sums.fit(columns)
        residual = target - base @ fitted[:EQ6_LINEAR] - others @ fitted[EQ6_LINEAR:]
        # Limit the influence of outliers.
        size = np.abs(residual)
        size = np.minimum(size, np.quantile(size, 0.999))
        trials.append((error, float(size @ size), table.transition))
    most = (1.0 + thresholds.LEAST_SHARE) * min(error for error, *_ in trials)
    *_, best = min((trial for trial in trials if trial[0] <= most), key=lambda trial: trial[1])
    table.set_transition(*best)


def rivals_of(fit: Fit) -> dict[Term, list[str]]:
    """Return by term the effects with which in its place regimes are predicted as well.

    The motion of the recording cannot tell the term from them. The terms of the initial model
    stay.
    """
    table = fit.table
    rivals: dict[Term, list[str]] = {term: [] for term in fit.terms[fit.initial_count:]}
    search = Search(table, fit.terms[:fit.initial_count])
    own, transition = table.errors(fit.terms), table.transition
    for term, named in rivals.items():
        rest = [other for other in fit.terms if other != term]
        search.update_candidates(rest)
        search.candidates = [other for other in search.candidates if other.choice != term.choice]
        without = table.errors(rest)
        for other in search.shortlist(rest):
            # A rival, whose constants are not adjusted yet, must bring half of what the term does.
            if other.kind.name == term.kind.name or other.kind.name in named or not (
                    table.errors([*rest, other]).sum() < 0.5 * (own + without).sum()):
                continue
            instead = adjust_constants(table, [*rest, other], 3)
            if not search.is_better(table.errors(instead), own):
                named.append(other.kind.name)
        table.set_transition(*transition)
        table.add(fit.terms)
    return rivals
