# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects effects by one criterion: the error in regimes of motion that were not fitted.

Terms are added while that error becomes clearly smaller, and removed while it does not become
clearly larger: what is left is the smallest model whose error is within the scatter of the best.
Constants are adjusted between the points of their grids. A lag is chosen with the terms found.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effect import Coverage
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums, held_out_error
from friction_comp.refinement.effect_columns import (
    EQ6_COLUMNS,
    eq6_columns,
    EQ6_LINEAR,
    first_model,
    MAX_SHIFT,
    proposals,
    Table,
    Term,
)
from friction_comp.refinement.prepare import prepare, Problem, Rows

_STEP = 1e-3
_RIDGE = 1e-6
# Times the squared error, of fits that no choice of terms may prefer.
_WRONG = 100.0
# Of the squared error: a step that brings less is the last.
_LEAST_GAIN = 1e-3


def error_reductions(sums: np.ndarray, chosen: list[int], candidates: Sequence[Sequence[int]],
                     signs: np.ndarray) -> np.ndarray:
    """Return the reduction of the fitted sum of squares by each candidate's columns, shape (N,).

    `sums`, shape (P + 1, P + 1), have the target last; the `chosen` columns are in the fit, and
    `signs`, shape (P,), are required.
    """
    norm = np.sqrt(np.maximum(np.diag(sums), 1e-300))
    scaled = sums / norm / norm[:, None]
    inner = scaled[chosen]
    # What the chosen columns leave of all others.
    left = scaled - inner.T @ np.linalg.solve(
        inner[:, chosen] + 1e-8 * np.eye(len(chosen)), inner)
    reductions = np.zeros(len(candidates))
    for k, columns in enumerate(candidates):
        target = left[columns, -1]
        step = np.linalg.solve(
            left[np.ix_(columns, columns)] + 1e-6 * np.eye(len(columns)), target)
        if len(columns) > 1 or not (signs[columns[0]] > 0 and step[0] < 0.0):
            reductions[k] = target @ step
    return reductions * norm[-1] ** 2


def is_better(before: np.ndarray, after: np.ndarray, least: float | None = None,
              scatters: float | None = None) -> bool:
    """Return whether an error becomes clearly lower: by a share, and beyond its scatter.

    Both are those of each regime, (K,) or the last row of (L, K); where more is left out, the error
    must not grow: what is wrong in other motion fits a regime between others well. What halves the
    squared error may do so in fewer regimes: friction near standstill is in some alone.
    """
    one, other = np.atleast_2d(before)[-1], np.atleast_2d(after)[-1]
    share = float((one - other).sum() / max(one.sum(), 1e-300))
    # Each regime counts relative to its own error, so that one with large errors cannot decide.
    ratio, count = (one - other) / np.maximum(one + other, 1e-300), len(one)
    scatter = math.sqrt(float(np.sum((ratio - ratio.mean()) ** 2)) / (count - 1) / count)
    errors = float(ratio.mean()) / max(scatter, 1e-12)
    least = thresholds.LEAST_SHARE if least is None else least
    scatters = thresholds.STANDARD_ERRORS if scatters is None else scatters
    return bool(share > least and after.sum() < before.sum() and errors > (
        scatters * (0.5 if share > 0.5 else 1.0)))


def is_needed(term: Term, before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether a term lowers the error enough, of each regime before and after.

    What every drive may have does so by its share alone: whatever the regimes, it is there.
    """
    return is_better(before, after, scatters=0.0 if term.kind.in_first_model else None)


class Search:
    """A search among the terms that the effects propose for what is left of a table's target.

    The `fixed` terms are always kept.
    """

    def __init__(self, table: Table, fixed: Sequence[Term] = ()) -> None:
        self.table, self.fixed = table, list(fixed)
        self.candidates: list[Term] = []
        self._single = {term.kind for term in fixed if term.kind.max_count == 1}
        # By transition and terms, which the same steps compare again and again.
        self._errors: dict[tuple[tuple[float, float], frozenset[Term]], np.ndarray] = {}

    def errors(self, terms: Sequence[Term]) -> np.ndarray:
        """Return the squared error of each regime by the fit to all others.

        Where parts of the fit cancel each other, it counts as much larger.
        """
        key = self.table.transition, frozenset(terms)
        if key not in self._errors:
            self._errors[key] = self.table.errors(terms) * (
                _WRONG if self.table.cancels(terms) else 1.0)
        return self._errors[key]

    def update_candidates(self, terms: Sequence[Term], without: Collection[str] = ()) -> None:
        """Replace the candidates by the terms proposed for a fit, `without` those of variables."""
        table = self.table
        proposed = [term for term in proposals(table, terms) if term.kind not in self._single
                    and term.kind.variable not in without]
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
            trials = [(self.errors([*terms, term]), term) for term in self.shortlist(terms)]
            # Time last, so that it does not replace a recorded cause.
            trials.sort(key=lambda trial: (
                trial[1].kind.variable == 'time', float(trial[0][-1].sum())))
            for after, term in trials:
                if is_needed(term, before, after) and self.holds_over_time(term, terms):
                    grown = self.backward(self.adjusted([*terms, term]))
                    if self.errors(grown).sum() < before.sum():
                        terms = grown
                        break
                    self.table.set_transition(*transition)
                    self.table.add(terms)
            else:
                return terms

    def holds_over_time(self, term: Term, rest: Sequence[Term]) -> bool:
        """Return whether a term lowers the error in parts of time, too, beside others.

        What depends on time differs in time, not in motion; and another term that does not hold
        from part to part stands for something that was not recorded.
        """
        table, index = self.table, self.table.rows.index
        part = np.argsort(np.argsort(index)) * int(thresholds.REGIMES) // len(index)
        columns, count = table.indices([*rest, term], False), len(table.indices(rest, False))
        sums = BlockSums.over(np.vstack((table.columns[columns], table.target)), part,
                              table.sums.signs[columns])
        return is_better(sums.held_out_errors(range(count)),
                         sums.held_out_errors(range(len(columns))), scatters=0.0)

    def backward(self, terms: Sequence[Term]) -> list[Term]:
        """Remove terms that are not needed, the least useful first."""
        terms = list(terms)
        while True:
            full, trials = self.errors(terms), []
            for term in terms:
                rest = [other for other in terms if other != term]
                if term in self.fixed:
                    continue
                without = self.errors(rest)
                if not is_needed(term, without, full):
                    trials.append((float(without[-1].sum()), term))
            if not trials:
                return terms
            terms.remove(min(trials, key=lambda trial: trial[0])[1])

    def run(self, start: Sequence[Term]) -> list[Term]:
        """Search from some terms; return the terms at its end."""
        terms = list(dict.fromkeys([*self.fixed, *start]))
        self.table.fit_transition(terms)
        # A weight may be no improvement until the larger ripple beside it is known, so terms are
        # removed only after others were added; and what they hid is found then.
        for _ in range(2):
            terms = self.backward(self.adjusted(self.forward(terms)))
        return terms


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


# Most times that a lag is chosen with the terms found before.
_LAG_ROUNDS = 5
# Number of lags that are tried on each side, from half a sample to the longest, and between them.
_LAGS, _PARABOLAS = 9, 3
# Transitions that are tried on all samples, and the most samples for that.
_STEEPNESSES, _MOST_SAMPLES = 12, 20_000


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

    def rmse(self, terms: Sequence[Term]) -> np.ndarray:
        """Return the RMS errors of some terms where a half of the motion is not fitted, ..., A.

        A quarter and so on, to each regime by itself.
        """
        return np.sqrt(self.table.errors(terms).sum(axis=1) / float(self.table.sums.rows.sum()))

    def columns(self, rows: Rows, count: int = EQ6_LINEAR) -> np.ndarray:
        """Return `count` columns of Eq. 6 and those of the terms on all samples, shape (N, S)."""
        return np.column_stack([eq6_columns(rows, *self.table.transition)[:, :count],
                                *(term.columns(rows) for term in self.terms)])

    def residual(self) -> np.ndarray:
        """Return the residual of each sample by a fit to all other regimes, A, shape (N,)."""
        table, rows = self.table, self.table.rows
        fits = table.sums.fits(
            table.indices(self.terms, derivatives=False), 1.0 - np.eye(rows.blocks))
        return rows.target - np.einsum('ns,ns->n', self.columns(rows), fits[rows.block_of_sample])

    def chosen(self, term: Term) -> float:
        """Return the share of regimes that are predicted better with a term."""
        rest = [other for other in self.terms if other != term]
        return float(np.mean(self.table.errors(self.terms) < self.table.errors(rest)))


def fit_eq6_alone(fit: Fit) -> Fit:
    """Fit Eq. 6 to the rows of another fit, without effects."""
    table = Table(fit.rows, 2.0 / fit.rows.coverage.transition)
    table.fit_transition([])
    return refit(Fit(table, [], 0, fit.settings), [])


def search_with(problem: Problem, settings: dict[str, Any], begin: Sequence[Term] | None = None
                ) -> Fit:
    """Search with differentiation settings, and return the best fit.

    The search begins with the terms of the initial model and those of `begin`, or of the first
    model.
    """
    rows, model = prepare(problem, settings), problem.model
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
    terms = Search(table, initial).run(table.add([
        term for term in (first_model(table) if begin is None else begin)
        if term.group or term.kind not in known]))
    return Fit(table, table.add(terms), len(initial), settings)


def find_best_fit(problem: Problem) -> Fit:
    """Return the best fit over lags, each tried with the terms found before.

    What history explains, a lag may explain as well: with each, the search goes on to its end.
    """
    best = lagged = search_with(problem, problem.plain_settings)
    # Terms stood in for a part of the lag: with them gone, it is found once more.
    for _ in range(_LAG_ROUNDS):
        settings = _with_best_lag(lagged)
        if settings == lagged.settings:
            break
        again = search_with(problem, settings, lagged.terms[lagged.initial_count:])
        if lagged is not best and _mean_error(again) > (
                1.0 + thresholds.LAG_SHARE) * _mean_error(lagged):
            break
        lagged = again
    before, after = (fit.table.errors(fit.terms) / fit.table.sums.rows for fit in (best, lagged))
    best = lagged if is_better(before, after, thresholds.LAG_SHARE) else best
    return refit(best, best.terms)


def _mean_error(fit: Fit) -> float:
    """Return the squared error in regimes that were not fitted."""
    return float(fit.table.errors(fit.terms).sum()) / len(fit.table.target)


def _with_best_lag(fit: Fit) -> dict[str, Any]:
    """Return the settings with the delay of the current with which a fit's terms predict best.

    Terms may have stood in for the lag: a plain drive has its say, too.
    """
    rows, step, tries = fit.rows, fit.rows.samples.sample_time, [fit]
    plain = fit.table.add(first_model(fit.table))
    if not rows.load_coefficient and set(plain) != set(fit.terms):
        tries.append(replace(fit, terms=plain))
    sizes = np.geomspace(0.5, max(thresholds.LONGEST_LAG / step, 1.0), _LAGS) * step
    grid = [*(-sizes).tolist(), 0.0, *sizes.tolist()]
    for tried in tries:
        columns = tried.columns(rows, EQ6_COLUMNS)

        def error(lag: float, columns: np.ndarray = columns) -> float:
            moved = shifted_in_time(columns, rows.samples, lag) if lag else columns
            at_rows = moved[rows.index]
            return held_out_error(at_rows, fit.table.target, rows.block) if np.isfinite(
                at_rows).all() else math.inf
        errors = {lag: error(lag) for lag in grid}
        # The lowest point of a parabola through the best lag and its neighbours, again and again.
        for _ in range(_PARABOLAS):
            lags = sorted(errors)
            place = min(range(1, len(lags) - 1), key=lambda k: errors[lags[k]])
            near = np.array(lags[place - 1:place + 2])
            bend, slope, _ = np.polyfit(near - near[1], [errors[lag] for lag in near], 2)
            lag = float(np.clip(near[1] - 0.5 * slope / max(bend, 1e-300), near[0], near[2]))
            errors[lag] = error(lag)
        lag = min(errors, key=lambda one: errors[one])
        least = thresholds.EQUIVALENT if fit.lag else 0.5 * thresholds.LAG_SHARE
        if errors[lag] < (1.0 - least) * errors[0.0]:
            return {**fit.settings, 'lag': fit.lag + lag}
    return fit.settings


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
        # A history, or time, may stand for much, and takes the longest to try.
        search.update_candidates(rest, ('time', 'history'))
        search.candidates = [other for other in search.candidates if other.choice != term.choice]
        without = table.errors(rest)
        for other in search.shortlist(rest):
            # A rival, whose constants are not adjusted yet, must bring half of what the term does.
            if other.kind.name == term.kind.name or other.kind.name in named or not (
                    table.errors([*rest, other]).sum() < 0.5 * (own + without).sum()):
                continue
            instead = adjust_constants(table, [*rest, other], 3)
            if not is_better(table.errors(instead), own):
                named.append(other.kind.name)
        table.set_transition(*transition)
        table.add(fit.terms)
    return rivals
