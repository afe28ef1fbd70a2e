# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects effects forward, backward and by exchange, and adjusts their constants.

The selection needs block sums alone; constants are adjusted between the points of their grids. The
only criterion is the error of blocks that were not fitted. An effect is an improvement where it
lowers that error by `LEAST_SHARE`, and by two standard errors over the blocks.
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
from friction_comp.refinement.effect_columns import EQ6_LINEAR, Table, Term

_STEP = 1e-3
_RIDGE = 1e-6
# Of the squared error: a step that brings less is the last.
_LEAST_GAIN = 1e-3
# Constants that define an effect; the others only say how it fades.
_DEFINING = ('time_constant', 'width', 'distance')


def total(errors: Sequence[np.ndarray]) -> float:
    """Return the sum of all errors."""
    return float(sum(part.sum() for part in errors))


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
    """A search among the terms of a table, by the errors of blocks that were not fitted.

    Each block is predicted by the fit to all others. Where several joints moved, so is each
    region of posture: a wrong term that fits the postures of the recording would not be noticed.

    `candidates` may be added, and `fixed` terms are always kept. `weights`, shape (B,), are the
    numbers of times that each block is fitted; blocks with weight 0 are held out.
    """

    def __init__(self, table: Table, candidates: list[Term], fixed: Sequence[Term] = (),
                 weights: np.ndarray | None = None) -> None:
        self.table, self.candidates, self.fixed = table, candidates, fixed
        self._resampled = weights is not None
        drawn = np.ones(len(table.block)) if weights is None else weights[table.block]
        self._held_out = np.flatnonzero(drawn == 0.0)
        # The table of a resampled search stays as it is.
        self._fitted = np.tensordot(drawn, table.sums.gram, 1) if self._resampled else None
        # By transition and terms, which the same steps compare again and again.
        self._errors: dict[tuple[tuple[float, float], frozenset[Term]], list[np.ndarray]] = {}
        self._regions = len(np.unique(table.region)) > 1
        # A resampled sample holds out too few blocks to test their mean.
        self._standard_errors = 1.0 if self._resampled else float(thresholds.STANDARD_ERRORS)

    def after_addition(self, terms: list[Term]) -> list[Term]:
        """Return terms after one was added; a subclass may adjust them and update `candidates`."""
        return terms

    def errors(self, terms: Sequence[Term]) -> list[np.ndarray]:
        """Return the squared errors of held-out blocks and, if any, of held-out regions."""
        table, sums, key = self.table, self.table.sums, (self.table.transition, frozenset(terms))
        if key not in self._errors:
            columns = table.indices(terms)
            if self._resampled:
                errors = [sums.errors_of_fit(columns, self._held_out, self._fitted)]
            else:
                errors = [table.block_errors(terms)]
                errors += [sums.held_out_errors(columns, table.region)] if self._regions else []
            self._errors[key] = errors
        return self._errors[key]

    def error(self, terms: Sequence[Term]) -> float:
        """Return the sum of the held-out squared errors of a fit of some terms."""
        return total(self.errors(terms))

    def cost(self, terms: Sequence[Term]) -> float:
        """Return the held-out error by which ends of searches are compared: each term costs."""
        return self.error(terms) * (1.0 + thresholds.LEAST_SHARE) ** len(terms)

    def is_improvement(self, before: Sequence[np.ndarray], after: Sequence[np.ndarray],
                       share: float = 1.0) -> bool:
        """Return whether all `errors` decrease clearly, by `share` of the thresholds."""
        for old, new in zip(before, after):
            gain, count = old - new, len(old)
            if not gain.sum() > share * thresholds.LEAST_SHARE * old.sum():
                return False
            # Relative to the error of each block, so that a block with large errors cannot decide.
            ratio = gain / np.maximum(old + new, 1e-300)
            mean = float(ratio.sum()) / count
            scatter = math.sqrt(float(np.sum((ratio - mean) ** 2)) / (count - 1) / count)
            if not mean > share * self._standard_errors * scatter:
                return False
        return True

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

    def is_independent(self, term: Term, terms: Sequence[Term]) -> bool:
        """Return whether a term can be added without a collinear one in the fit."""
        return len(self.without_collinear([*terms, term])) > len(terms)

    def shortlist(self, terms: Sequence[Term]) -> list[Term]:
        """Return the candidates that reduce the fitted error most, one of each effect."""
        counts, known = Counter(term.choice for term in terms), set(terms)
        allowed = [term for term in self.candidates if term not in known and (
            counts[term.choice] < term.kind.max_count)]
        if not allowed:
            return []
        sums = self.table.sums.gram.sum(axis=0) if self._fitted is None else self._fitted
        reductions = error_reductions(
            sums, self.table.indices(terms),
            [self.table.columns_of[term] for term in allowed], self.table.sums.signs)
        best: dict[Any, Term] = {}
        for index in np.argsort(-reductions, kind='stable'):
            term = allowed[index]
            if reductions[index] > 0.0:
                best.setdefault(term.choice, term)
        return list(best.values())[:int(thresholds.SHORTLIST)]

    def forward(self, terms: Sequence[Term]) -> list[Term]:
        """Add terms while one is an improvement, and remove those that became superfluous."""
        terms = list(terms)
        before = self.errors(terms)
        while True:
            trials = [(self.errors(self.with_own_terms([*terms, term])), term)
                      for term in self.shortlist(terms)]
            trials.sort(key=lambda trial: total(trial[0]))
            best = next((term for after, term in trials if self.is_improvement(before, after)
                         and self.is_independent(term, terms)), None)
            if best is None:
                return terms
            transition = self.table.transition
            grown = self.backward(self.after_addition(self.with_own_terms([*terms, best])))
            now = self.errors(grown)
            if not total(now) < total(before):
                self.table.set_transition(*transition)
                return terms
            terms, before = grown, now

    def backward(self, terms: Sequence[Term]) -> list[Term]:
        """Remove terms that are no improvement, the least useful first."""
        terms = self.with_own_terms(terms)
        while True:
            full = self.errors(terms)
            trials: list[tuple[float, Term]] = []
            for term in terms:
                rest = [other for other in terms if other != term]
                if term in self.fixed or term in self.with_own_terms(rest):
                    continue
                without = self.errors(rest)
                share = 1.0 if term.group else thresholds.STAYS
                if not self.is_improvement(without, full, share):
                    trials.append((total(without), term))
            if not trials:
                return terms
            terms.remove(min(trials, key=lambda trial: trial[0])[1])

    def exchange(self, terms: Sequence[Term]) -> list[Term]:
        """Replace terms by other effects where that lowers the error."""
        terms = list(terms)
        for term in list(terms):
            if term in self.fixed:
                continue
            rest = [other for other in terms if other != term]
            limit = self.error(terms) * (1.0 - thresholds.STAYS * thresholds.LEAST_SHARE)
            trials = [(self.error([*rest, other]), other) for other in self.shortlist(rest)
                      if (other.kind, other.group) != (term.kind, term.group)]
            for error, other in sorted(trials, key=lambda trial: trial[0]):
                if error < limit and self.is_independent(other, rest):
                    terms[terms.index(term)] = other
                    break
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
    value = term.kind.limited(name, float(value), term.constants, coverage)
    return replace(term, constants={**term.constants, name: value})


def free_constants(terms: Sequence[Term]) -> list[tuple[int, str]]:
    """Return the constants of terms that have a search range: index of the term, and name."""
    return [(index, name) for index, term in enumerate(terms) if term.group is None
            for name, search in term.kind.constants.items() if search is not None]


def at_limit(term: Term, coverage: Coverage) -> bool:
    """Return whether a defining constant is at its limit, where the effect becomes another one.

    A warm-up slower than the recording is a drift; a bump as wide as the range is a spring.
    """
    # A step beyond the limit leaves the term unchanged.
    return any(with_step(term, name, step, coverage) == term
               for _, name in free_constants([term]) if name in _DEFINING
               for step in (_STEP, -_STEP))


def constant_derivatives(table: Table, terms: Sequence[Term], free: Sequence[tuple[int, str]],
                         at_limits: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return the derivatives of a fit's prediction by Q `free_constants`, shape (Q, R).

    The unit of each constant is its `step_size`. The part that the term's own columns can express
    is subtracted, and returned as coefficients of all columns, (Q, P). A constant at its upper
    limit counts as known unless `at_limits`.
    """
    coefficients, gram = table.coefficients(terms), table.sums.gram.sum(axis=0)
    rows, shares = np.empty((len(free), len(table.target))), np.zeros((len(free), len(gram) - 1))
    for k, (index, name) in enumerate(free):
        columns = table.columns_of[terms[index]]
        step, changed = _STEP, with_step(terms[index], name, _STEP, table.rows.coverage)
        if at_limits and changed == terms[index]:
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
        scaled = design / norm[:, None]
        gram = scaled @ scaled.T
        gram[np.diag_indices(len(gram))] += _RIDGE
        step = np.linalg.solve(gram, scaled @ residual) / norm
        step = np.clip(step[-len(free):], -1.0, 1.0)
        initial = float(residual @ residual)
        for share in (1.0, 0.5, 0.25):
            changed = list(terms)
            for (index, name), size in zip(free, share * step):
                changed[index] = with_step(changed[index], name, float(size), table.rows.coverage)
            distinct = len(set(changed)) == len(changed)
            if distinct and len(table.add(changed)) == len(changed) and (
                    error := table.error(changed)) < initial:
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
