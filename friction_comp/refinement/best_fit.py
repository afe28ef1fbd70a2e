# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Searches for effects at several bandwidths and lags, and chooses among these settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.differentiation import as_recorded, shifted_in_time
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import recorded_motion, thresholds
from friction_comp.refinement.block_sums import held_out_error
from friction_comp.refinement.effect_columns import eq6_columns, EQ6_LINEAR, proposals, Table, Term
from friction_comp.refinement.lag import best_lag, best_response, ENOUGH
from friction_comp.refinement.prepare import prepare, Rows
from friction_comp.refinement.search import adjust_constants, Search
from friction_comp.refinement.stability import Intervals, starts_of
from friction_comp.samples import Samples

# Share of the top speed over which the friction of a plain drive changes sign.
_PLAIN_TRANSITION = 0.1
# Settings of the lag between current and torque.
_LAG = ('lag', 'time_constant')


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
    candidates: list[Term]  # the last ones
    # Share of bootstrap samples in which the lag lowers the error enough; 1 without a lag.
    lag_confidence: float = 1.0
    # Before terms that cannot be named were left out: the terms, and `rmse_with` them, A.
    found: tuple[Term, ...] = ()
    found_error: float = math.nan
    # Share of repeated searches that choose each term, and intervals; filled when terms are named.
    chosen: dict[Term, float] = field(default_factory=dict)
    intervals: Intervals = field(default_factory=Intervals)
    # Other effects from which the recording cannot tell each term; see `rivals_of`.
    rivals: dict[Term, list[str]] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        """The fitted rows."""
        return self.table.rows

    @property
    def lag(self) -> tuple[float, float]:
        """Delay and time constant between current and torque, s."""
        return self.settings.get('lag', 0.0), self.settings.get('time_constant', 0.0)

    def mean_error(self) -> float:
        """Return the mean squared error of blocks that were not fitted, A²."""
        return float(self.table.block_errors(self.terms).sum() / self.table.sums.rows.sum())

    def rmse_with(self, terms: Sequence[Term]) -> float:
        """Return the held-out RMS error of some of the terms, at the present transition, A."""
        errors = self.table.block_errors(terms, derivatives=False)
        return math.sqrt(float(errors.sum()) / float(self.table.sums.rows.sum()))

    def columns(self) -> np.ndarray:
        """Return the columns of Eq. 6 and of the terms on all samples, shape (N, S)."""
        return np.column_stack([eq6_columns(self.rows, *self.table.transition)[:, :EQ6_LINEAR],
                                *(term.columns(self.rows) for term in self.terms)])

    def residual(self) -> np.ndarray:
        """Return the residual of each sample by a fit to all other blocks, A, shape (N,)."""
        table, rows = self.table, self.table.rows
        train = (table.block != np.arange(rows.blocks)[:, None]).astype(float)
        fits = table.sums.fits(table.indices(self.terms, derivatives=False), train)
        return rows.target - np.einsum('ns,ns->n', self.columns(), fits[rows.block_of_sample])


def without_lag(settings: dict[str, Any]) -> dict[str, Any]:
    """Return differentiation settings without delay and low pass."""
    return {name: value for name, value in settings.items() if name not in _LAG}


def fit_eq6_alone(problem: Problem, settings: dict[str, Any]) -> Fit:
    """Fit Eq. 6 to the recordings, without effects and without a lag."""
    settings = without_lag(settings)
    rows, settings = prepare(
        problem.raw, problem.drive, settings, problem.declared, problem.linear)
    table = Table(rows, 2.0 / rows.coverage.transition)
    table.fit_transition([])
    return Fit(table, [], 0, settings, [])


class EffectSearch(Search):
    """A search among all terms that the effects propose for the residual."""

    def __init__(self, table: Table, fixed: list[Term]) -> None:
        super().__init__(table, [], fixed)
        self._retained, self._time_effects = set(fixed), False
        self._known = {term.kind for term in fixed if term.kind.max_count == 1}
        # The latest proposals, and the transition and terms whose fit they are for.
        self._proposed: list[Term] = []
        self._fitted_terms: tuple[tuple[float, float], list[Term]] = (math.nan, math.nan), fixed

    def update_candidates(self, terms: Sequence[Term]) -> None:
        """Replace the candidates by the terms proposed for the residual of a fit."""
        table, fitted = self.table, (self.table.transition, list(terms))
        if fitted != self._fitted_terms:
            self._proposed = proposals(table, terms)
        # A search may go back to the terms before.
        table.keep({*self._retained, *self._fitted_terms[1], *terms, *self._proposed})
        self._fitted_terms = fitted
        self.candidates = [
            term for term in table.add(self._proposed) if term.kind not in self._known and (
                (term.kind.variable == 'time') == self._time_effects)]

    def after_addition(self, terms: Sequence[Term], rounds: int = 3) -> list[Term]:
        """Adjust all constants and the transition; update the candidates."""
        terms = adjust_constants(self.table, terms, rounds)
        self.table.fit_transition(terms)
        self.update_candidates(terms)
        return terms

    def in_best_form(self, terms: list[Term]) -> list[Term]:
        """Replace a term by another form of its effect if that, once adjusted, predicts better.

        Beside effects that are not known yet, the form that explains more may be the wrong one.
        """
        for term in terms:
            forms = [other for other in self.candidates
                     if other.choice == term.choice and other.kind is not term.kind]
            if forms and term not in self.fixed:
                rest = [other for other in terms if other != term]
                best = min(forms, key=lambda form: self.error([*rest, form]))
                changed = adjust_constants(self.table, [*rest, best], 5)
                if self.is_improvement(self.errors(terms), self.errors(changed)):
                    # All others were adjusted beside it.
                    return changed
        return terms

    def starts(self) -> list[list[Term]]:
        """Return the starts of the search, without what the initial model has."""
        starts = [[term for term in start if term.group or term.kind not in self._known]
                  for start in starts_of(self.table)]
        for start in starts:
            self._retained.update(start)
        return starts

    def search_from(self, start: Sequence[Term]) -> list[Term]:
        """Search from some terms; return the terms at its end.

        Effects of time are tried last, so that they do not replace a recorded cause.
        """
        self._time_effects = False
        # A weight may be no improvement until the larger ripple beside it is known, so terms are
        # removed only after others were added.
        terms = self.without_collinear(list(dict.fromkeys([*self.fixed, *start])))
        self.table.fit_transition(terms)
        self.update_candidates(terms)
        adjusted = self.after_addition(self.forward(terms), 5)
        terms = self.backward(self.in_best_form(self.exchange(adjusted)))
        self._time_effects = True
        self.update_candidates(terms)
        terms = self.forward(terms)
        if terms != adjusted:
            terms = self.backward(self.after_addition(terms, 5))
        self._retained.update(terms)
        return terms


def search_with(problem: Problem, settings: dict[str, Any] | None = None,
                begin: Sequence[Term] | None = None) -> Fit:
    """Search with differentiation settings, chosen when omitted, and return the best fit.

    The search begins with the terms of the initial model and those of `begin`, or with each of
    `EffectSearch.starts`. In the comparison, each term costs `LEAST_SHARE` of the error.
    """
    rows, settings = prepare(
        problem.raw, problem.drive, settings, problem.declared, problem.linear)
    model = problem.model
    start = model.sigmoid if model else Sigmoid(1.0, -1.0, 2.0 / rows.coverage.transition)
    table = Table(rows, start.steepness, start.shift)
    # A load that is already part of the target cannot be an effect as well.
    effects = [effect for effect in model.effects if not (
        rows.load_coefficient and effect.known_coefficients(problem.drive))] if model else []
    for effect in effects:
        effect.check_signals(rows.samples)
    initial = table.add([Term(type(effect), dict(effect.values)) for effect in effects])
    if not model:
        table.fit_transition([])
    search = EffectSearch(table, initial)
    starts = search.starts() if begin is None else [table.add(begin)]
    transition = table.transition
    ends: list[tuple[float, list[Term], tuple[float, float], list[Term]]] = []
    for first_terms in starts:
        table.set_transition(*transition)
        terms = search.search_from(first_terms)
        ends.append((search.cost(terms), terms, table.transition, search.candidates))
    _, terms, transition, candidates = min(ends, key=lambda end: end[0])
    table.set_transition(*transition)
    return Fit(table, terms, len(initial), settings,
               [term for term in candidates if term in table.columns_of])


def find_best_fit(problem: Problem) -> Fit:
    """Return the best fit over lags and bandwidths, each tried with a whole search."""
    best = search_with(problem)
    tried = [best.settings]
    # A plain drive knows of no ripple, which a filter of the motion or of the load blurs.
    wider = recorded_motion.smooth_settings(problem.raw)
    others = [{**best.settings, **wider}] if (
        best.settings['bandwidth'] < wider['bandwidth']) else []
    if best.settings.get('signals'):
        others.append(recorded_motion.choose_differentiation(
            problem.raw, best.rows.clipped, best.rows.joints, 0.0, filtered=False))
    for settings in others:
        best = min(best, search_with(problem, settings), key=Fit.mean_error)
        tried.append(settings)
    for _ in range(2):
        before, others = best, _other_settings(problem, best)
        if not any(best.lag):
            # The bandwidth that is best without a lag makes up for it: chosen together, too.
            others.append(_settings_with_lag(problem, best))
        for settings in others:
            if settings in tried:
                continue
            tried.append(settings)
            with_lag = without_lag(settings) != settings
            first_lag = with_lag and not any(best.lag)
            # Terms that stood in for a lag are a poor start; another bandwidth changes little.
            begin = None if with_lag and not any(before.lag) else best.terms[best.initial_count:]
            other = search_with(problem, settings, begin)
            share = thresholds.LAG_ERROR if first_lag else 1.0 - thresholds.EQUIVALENT
            if other.mean_error() < share * best.mean_error():
                confidence = _lag_confidence(other, best) if first_lag else best.lag_confidence
                if confidence >= thresholds.NAMED_SHARE:
                    best = replace(other, lag_confidence=confidence)
        if best is before:
            break
    return best


def _settings_with_lag(problem: Problem, fit: Fit) -> dict[str, Any]:
    """Return the settings that are best beside the delay of smooth motion, or those of `fit`."""
    raw, rows = problem.raw, fit.rows
    delay, gain = best_lag(recorded_motion.delay_errors(*recorded_motion.smooth_motion(
        *recorded_motion.excerpt(raw, rows.clipped))), raw.sample_time)
    error = recorded_motion.delay_errors(rows.samples, rows.start)
    # A filter of smooth motion may look like a delay.
    if gain < ENOUGH or error(delay) > (1.0 - ENOUGH) * error(0.0):
        return fit.settings
    delay = raw.sample_time * round(delay / raw.sample_time)
    late = raw.with_(current=shifted_in_time(raw.current, raw, -delay))
    return {**recorded_motion.choose_differentiation(
        late, rows.clipped, rows.joints, rows.load_coefficient), 'lag': delay}


def _lag_confidence(lagged: Fit, unlagged: Fit) -> float:
    """Return the share of bootstrap samples of blocks in which a lag lowers the error enough."""
    after, before = (fit.table.block_errors(fit.terms) for fit in (lagged, unlagged))
    drawn = np.random.default_rng(2).integers(0, len(before), (200, len(before)))
    after, before = (errors[drawn].sum(axis=1) for errors in (after, before))
    return float(np.mean(after < thresholds.LAG_ERROR * before))


def _other_settings(problem: Problem, fit: Fit) -> list[dict[str, Any]]:
    """Return other settings with which the terms of a fit, or a plain drive, predict better."""
    rows, others, settings = fit.rows, [], fit.settings
    target, step = rows.averaged(rows.target), rows.samples.sample_time

    def columns(other: Rows) -> np.ndarray:
        return np.column_stack([eq6_columns(other, *fit.table.transition),
                                *(term.columns(other) for term in fit.terms)])

    def error_of(matrix: np.ndarray, lag: float = 0.0, slow: float = 0.0) -> float:
        shifted = shifted_in_time(matrix, rows.samples, lag) if lag else matrix
        return held_out_error(rows.averaged(as_recorded(shifted, rows.samples, slow)), target,
                              rows.block)
    samples = rows.samples.with_(load=None) if rows.load_coefficient else rows.samples
    plain = recorded_motion.plain_columns(
        samples, [rows.coverage.transition, _PLAIN_TRANSITION * rows.coverage.speed])
    current_lag, _ = fit.lag
    # Viscous friction after a low pass has an inertia, which must not be the only one.
    own = np.column_stack((columns(replace(rows, time_constant=0.0)),
                           np.asarray(rows.samples.acceleration)))
    for matrix in [own] if any(fit.lag) else [plain, own]:
        def error_with_lag(lag: float, slow: float, matrix: np.ndarray = matrix) -> float:
            return error_of(matrix, lag - current_lag, slow)
        response = best_response(error_with_lag, step, fit.lag)
        if response != fit.lag:
            others.append({**without_lag(settings), **{
                name: value for name, value in zip(_LAG, response) if value}})
    if not rows.load_coefficient:
        def error_with(changed: dict[str, np.ndarray]) -> float:
            changed = {name: shifted_in_time(values, problem.raw, current_lag)
                       for name, values in changed.items()}
            return error_of(columns(replace(rows, samples=rows.samples.with_(**changed))))
        signals = recorded_motion.choose_signals(
            problem.raw, settings.get('signals', {}), error_with, with_lag=True)
        if signals != settings.get('signals', {}):
            others.append({**settings, 'signals': signals})
    errors: list[tuple[float, dict[str, Any]]] = []
    for choice in recorded_motion.resolved_settings(problem.raw):
        choice |= {name: settings[name] for name in (*_LAG, 'signals') if settings.get(name)}
        matrix = columns(rows.with_settings(problem.raw, choice))
        if np.isfinite(matrix).all():
            errors.append((error_of(matrix), choice))
    least, choice = min(errors, key=lambda entry: entry[0])
    now = [error for error, tried in errors if tried == settings]
    if choice != settings and (not now or least < thresholds.LOWER_ERROR ** 2 * now[0]):
        others.append(choice)
    return others
