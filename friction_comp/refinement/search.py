# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects effects by one criterion: the error in regimes of motion that were not fitted.

Terms are added while that error becomes clearly smaller, and removed while it does not become
clearly larger: what is left is the smallest model whose error is within the scatter of the best.
Constants are adjusted between the points of their grids.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

import numpy as np

from friction_comp.model.effects import Coverage
from friction_comp.refinement import thresholds
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import EQ6_LINEAR, first_model, proposals, Table, Term

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

        What halves the squared error may do so in fewer regimes: friction near standstill is in
        some alone.
        """
        share, errors = gain_of(before, after)
        least = thresholds.STANDARD_ERRORS * (0.5 if share > 0.5 else 1.0)
        return share > thresholds.LEAST_SHARE and errors > least

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
            trials.sort(key=lambda trial: float(trial[0].sum()))
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
                    trials.append((float(without.sum()), term))
            if not trials:
                return terms
            terms.remove(min(trials, key=lambda trial: trial[0])[1])

    def exchange(self, terms: Sequence[Term]) -> list[Term]:
        """Replace terms by other effects where that lowers the error."""
        terms = list(terms)
        self.update_candidates(terms)
        for term in list(terms):
            rest = [other for other in terms if other != term]
            if term in self.fixed:
                continue
            limit = (1.0 - thresholds.LEAST_SHARE) * float(self.errors(terms).sum())
            trials = [(float(self.errors([*rest, other]).sum()), other)
                      for other in self.shortlist(rest) if other.kind != term.kind]
            for error, other in sorted(trials, key=lambda trial: trial[0])[:1]:
                if error < limit and other in self.without_collinear([*rest, other]):
                    terms[terms.index(term)] = other
        return terms

    def run(self, start: Sequence[Term]) -> list[Term]:
        """Search from some terms; return the terms at its end."""
        # A weight may be no improvement until the larger ripple beside it is known, so terms are
        # removed only after others were added.
        terms = self.without_collinear(list(dict.fromkeys([*self.fixed, *start])))
        self.table.fit_transition(terms)
        terms = self.forward(terms)
        return self.backward(self.adjusted(self.exchange(terms)))

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
    value = term.kind.limited(name, float(value), term.constants, coverage)
    return replace(term, constants={**term.constants, name: value})


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
