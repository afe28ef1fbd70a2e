# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Searches for effects at the best bandwidth and lag of motion, and fits what is found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.drive import Drive
from friction_comp.model.arm import neighbourhood
from friction_comp.model.differentiation import shifted_in_time
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import recorded_motion, thresholds
from friction_comp.refinement.block_sums import held_out_error
from friction_comp.refinement.effect_columns import (
    eq6_columns,
    EQ6_LINEAR,
    first_model,
    MAX_SHIFT,
    Table,
    Term,
)
from friction_comp.refinement.prepare import prepare, Rows
from friction_comp.refinement.search import adjust_constants, gain_of, Search
from friction_comp.samples import Samples

# A model without a weight beside the links may have so much more of the error.
_AS_GOOD = 1.1
# Times that filters are chosen with the terms found before.
_FILTERS = 3
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
        errors = self.table.errors(terms, derivatives=False)
        return math.sqrt(float(errors.sum()) / float(self.table.sums.rows.sum()))

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
        return float(np.mean(self.table.errors(self.terms, False) < self.table.errors(rest, False)))


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
        rows.load_coefficient and effect.known_coefficients(problem.drive))] if model else []
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
    wider = recorded_motion.smooth_settings(problem.raw)
    if best.settings['bandwidth'] < wider['bandwidth'] or best.settings.get('signals'):
        best = min(best, search_with(problem, wider), key=lambda fit: fit.rmse_with(fit.terms))
    best = _at_best_motion(problem, best)
    lagged = best
    # Terms stood in for a part of the lag: with them gone, it is found once more.
    for _ in range(2):
        settings = _with_best_lag(lagged)
        if settings == lagged.settings:
            break
        lagged = _at_best_motion(problem, search_with(
            problem, settings, lagged.terms[lagged.initial_count:]))
    late = lagged is not best and _with_late_terms(lagged)
    best = _with_late_terms(best)
    if late:
        best = _better(best, late, thresholds.LAG_SHARE)
    return refit(best, _without_weight_beside_links(best))


def _without_weight_beside_links(fit: Fit) -> list[Term]:
    """Return the terms without a weight that makes up for what is wrong with a URDF's links.

    The links are all weight. Where it is more than that, it stays: a name must not change what the
    model predicts.
    """
    terms = list(fit.terms)
    links = any(term.kind.name == 'rigid_body' for term in terms)
    beside = [term for term in terms[fit.initial_count:]
              if term.kind.weight and not term.kind.needs]
    if not links or not beside:
        return terms
    search = Search(fit.table, terms[:fit.initial_count])
    rest = search.backward([term for term in terms if term not in beside])
    return rest if fit.rmse_with(rest) < _AS_GOOD * fit.rmse_with(terms) else terms


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
    share, errors = gain_of(*(fit.table.errors(fit.terms) / fit.table.sums.rows
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
        now['signals'] = recorded_motion.choose_signals(raw, lambda name, bandwidth: error_with(
            {**now, 'signals': {**now.get('signals', {}), name: {'bandwidth': bandwidth}}}))
    kept = {name: now[name] for name in ('lag', 'signals') if now.get(name)}
    choices = [{**choice, **kept} for choice in recorded_motion.resolved_settings(raw)]
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
    own, transition = table.errors(fit.terms, False), table.transition
    for term, named in rivals.items():
        rest = [other for other in fit.terms if other != term]
        search.update_candidates(rest)
        search.candidates = [other for other in search.candidates if other.choice != term.choice]
        without = table.errors(rest, False)
        for other in search.shortlist(rest):
            # A rival, whose constants are not adjusted yet, must bring half of what the term does.
            if other.kind.name == term.kind.name or other.kind.name in named or not (
                    table.errors([*rest, other], False).sum() < 0.5 * (own + without).sum()):
                continue
            instead = adjust_constants(table, [*rest, other], 3)
            if not search.is_better(table.errors(instead, False), own):
                named.append(other.kind.name)
        table.set_transition(*transition)
        table.add(fit.terms)
    return rivals
