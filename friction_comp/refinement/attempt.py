# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Searches the effects for each way of preparing the recordings, and chooses between these ways."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np
from scipy import optimize

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement.constants import adjusted
from friction_comp.refinement.effect_columns import (
    base_columns,
    DERIVATIVES,
    Key,
    proposals,
    Table,
    Term,
)
from friction_comp.refinement.joint_groups import neighbourhood
from friction_comp.refinement.plain_drive import held_out, plain_columns
from friction_comp.refinement.prepare import (
    blocks_of_samples,
    moved_again,
    prepare,
    Rows,
    shifted,
)
from friction_comp.refinement.recorded_motion import differentiations
from friction_comp.refinement.search import Search, Split
from friction_comp.refinement.thresholds import LAG, LEAST_SHARE, NAMED, SAME
from friction_comp.samples import Samples

# A plain drive turns round within this share of its top speed.
_TURN = 0.1
# Another bandwidth is tried where the terms found predict so much better at it.
_BETTER = 0.97
# Steps of a lag, in samples, and the longest tried, s.
_LAGS = (0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)
_LONGEST_LAG = 0.15


@dataclass(frozen=True)
class Question:
    """What refinement was given.

    Parameters
    ----------
    raw : Samples
        All recordings.
    drive : Drive
    declared : bool
        Whether the drive's torque constant and gear ratio are known.
    model : FrictionModel, optional
        Where to start.
    progress : callable
        Called with a share of the work done and a word on it.
    """

    raw: Samples
    drive: Drive
    declared: bool
    model: FrictionModel | None
    progress: Callable[[float, str], None]


@dataclass(frozen=True)
class Fit:
    """What a search found.

    Parameters
    ----------
    table : Table
    keys : list of Key
        The terms, those of the model before first.
    given : int
        How many of them are of the model before.
    settings : dict
        How velocity was computed from position.
    candidates : list of Key
        What was tried last.
    sure_of_lag : float
        Share of draws of blocks in which the lag lowers the error as it has to, where there is one.
    """

    table: Table
    keys: list[Key]
    given: int
    settings: dict[str, Any]
    candidates: list[Key]
    sure_of_lag: float = 1.0

    @property
    def rows(self) -> Rows:
        """The rows that were fitted."""
        return self.table.rows

    def errors(self) -> np.ndarray:
        """Return the squared error of each block by a fit to all others, shape (K,)."""
        return self.table.left_out(self.table.indices(self.keys))

    def rmse(self) -> float:
        """Return the RMS error of blocks that were not fitted, A."""
        return math.sqrt(float(self.errors().sum()) / float(self.table.sums.rows.sum()))

    def rmse_with(self, keys: Sequence[Key]) -> float:
        """Return the same of some of the terms, Eq. 6 keeping its transition."""
        table = self.table
        errors = table.left_out(table.indices(keys, derivatives=False))
        return math.sqrt(float(errors.sum()) / float(table.sums.rows.sum()))

    def residual(self) -> np.ndarray:
        """Return the residual in A of all samples by fits to all blocks but their own, (N,)."""
        table, rows = self.table, self.table.rows
        columns = np.column_stack([
            np.delete(base_columns(rows, table.steepness, table.shift), DERIVATIVES, axis=1),
            *(table.terms[key].columns(rows) for key in self.keys)])
        blocks = int(table.block.max()) + 1
        train = (table.block != np.arange(blocks)[:, None]).astype(float)
        fits = table.sums.fits(table.indices(self.keys, derivatives=False), train)
        return np.asarray(rows.target - np.einsum(
            'ns,ns->n', columns, fits[blocks_of_samples(rows)]))


def eq6_alone(question: Question, settings: dict[str, Any]) -> Fit:
    """Return Eq. 6 without any effect and without a lag, fitted to the recordings."""
    settings = {name: value for name, value in settings.items() if name != 'lag'}
    rows, settings = prepare(question.raw, question.drive, settings, question.declared)
    table = Table(rows, 2.0 / rows.scene.transition)
    table.turn([])
    return Fit(table, [], 0, settings, [])


class Attempt:
    """A search among all terms that the residual proposes, in one table.

    Parameters
    ----------
    table : Table
    given : list of Key
        Terms that stay.
    """

    def __init__(self, table: Table, given: list[Key]) -> None:
        self.table, self.given = table, given
        self.search = Search(table, Split(table), [], given, self._improve)
        self._held = set(given)
        self._clock = False
        self.offer(given)

    def offer(self, keys: Sequence[Key]) -> None:
        """Propose candidate terms beside those of a fit."""
        table = self.table
        wanted = proposals(table, keys)
        self._held.update(keys)
        table.keep(self._held.union(term.key for term in wanted))
        kinds = {key[0] for key in self.given if table.terms[key].kind.most == 1}
        self.search.candidates = [key for key in table.add(wanted) if key[0] not in kinds and (
            (table.terms[key].kind.variable == 'time') == self._clock)]

    def starts(self) -> list[list[Key]]:
        """Return the starts of the search: all plain physics, and with the links beside a joint.

        Weight, spring and inertia may cancel in a motion, so that each helps with the others alone.
        """
        table, rows = self.table, self.table.rows
        plain = [key for key in self.search.candidates if table.terms[key].kind.physics]
        starts: list[list[Key]] = [plain]
        if rows.joints:
            kind = EFFECTS['other_joints']
            starts.append([*plain, *table.add([Term(kind, {}, group) for group in neighbourhood(
                rows.joints, rows.samples.joint)])])
        for some in starts:
            self._held.update(some)
        return starts

    def from_start(self, some: Sequence[Key]) -> list[Key]:
        """Return what a search from some terms ends with.

        Time comes last: what a cause that was recorded explains is not left to the clock.
        """
        search = self.search
        self._clock = False
        keys = search.backward(search.told_apart(list(dict.fromkeys([*self.given, *some]))))
        self.table.turn(keys)
        self.offer(keys)
        keys = search.forward(search.backward(keys))
        for self._clock in (False, True):
            if self._clock:
                self.offer(keys)
                keys = search.forward(keys)
            keys = adjusted(self.table, keys, 5)
            self.table.turn(keys)
            self.offer(keys)
            keys = search.backward(keys if self._clock else search.exchange(keys))
        self._held.update(keys)
        return keys

    def _improve(self, keys: list[Key]) -> list[Key]:
        keys = adjusted(self.table, keys, only=keys[-1:])
        self.table.turn(keys)
        self.offer(keys)
        return keys


def search_at(question: Question, settings: dict[str, Any] | None = None,
              begin: Sequence[Term] | None = None) -> Fit:
    """Return the fit for one way of computing velocity from position.

    Of the ends of several searches the one with the least error counts, a term being worth
    `LEAST_SHARE` of it.

    Parameters
    ----------
    question : Question
    settings : dict, optional
        How to differentiate; chosen when omitted.
    begin : sequence of Term, optional
        The only start, beside the terms that were given.
    """
    rows, settings = prepare(question.raw, question.drive, settings, question.declared)
    model = question.model
    start = model.sigmoid if model else Sigmoid(1.0, -1.0, 2.0 / rows.scene.transition)
    table = Table(rows, start.steepness, start.shift)
    # A load that is part of the target already is no effect beside it.
    given = table.add([Term(type(effect), dict(effect.values)) for effect in model.effects
                       if not (rows.load_by_mechanics and 'load' in effect.needs)
                       ] if model else [])
    if not model:
        table.turn([])
    attempt = Attempt(table, given)
    starts = attempt.starts() if begin is None else [table.add(begin)]
    transition = table.steepness, table.shift
    ends: list[tuple[float, int, list[Key], tuple[float, float], list[Key]]] = []
    for some in starts:
        table.turned(*transition)
        keys = attempt.from_start(some)
        ends.append((attempt.search.error(keys) * (1.0 + LEAST_SHARE) ** len(keys), len(ends),
                     keys, (table.steepness, table.shift), attempt.search.candidates))
    _, _, keys, transition, candidates = min(ends)
    table.turned(*transition)
    return Fit(table, keys, len(given), settings,
                 [key for key in candidates if key in table.terms])


def searched(question: Question) -> Fit:
    """Return what is found, with the lag and the bandwidth that suit it.

    Both are chosen like everything else: by the error of blocks that were not fitted, after a
    whole search with each.
    """
    best = search_at(question)
    tried = [best.settings]
    for _ in range(2):
        before = best
        for settings in _other_settings(question, best):
            if settings in tried:
                continue
            tried.append(settings)
            fresh = bool(settings.get('lag')) and not best.settings.get('lag')
            # What a lag was blurred into makes a poor start; another bandwidth changes little.
            other = search_at(question, settings, None if fresh else [
                best.table.terms[key] for key in best.keys[best.given:]])
            if other.rmse() ** 2 < (LAG if fresh else 1.0 - SAME) * best.rmse() ** 2:
                sure = _share_of_draws(other, best) if fresh else best.sure_of_lag
                if sure >= NAMED:
                    best = replace(other, sure_of_lag=sure)
        if best is before:
            break
    return best


def _share_of_draws(late: Fit, early: Fit) -> float:
    """Return the share of resampled block sets in which a lag lowers the error enough."""
    rng = np.random.default_rng(2)
    with_lag, without = (np.bincount(found.table.block, found.errors()) for found in (late, early))
    if len(with_lag) != len(without):
        return 1.0
    drawn = rng.integers(0, len(without), (200, len(without)))
    return float(np.mean(with_lag[drawn].sum(axis=1) < LAG * without[drawn].sum(axis=1)))


def _other_settings(question: Question, fit: Fit) -> list[dict[str, Any]]:
    """Return settings with which the terms found, or a plain drive, predict better."""
    rows, others, settings = fit.rows, [], fit.settings
    target = rows.averaged(rows.target)
    terms = [fit.table.terms[key] for key in fit.keys]

    def columns(other: Rows) -> np.ndarray:
        return np.column_stack([base_columns(other, fit.table.steepness, fit.table.shift),
                                *(term.columns(other) for term in terms)])
    samples = rows.samples.with_(load=None) if rows.load_by_mechanics else rows.samples
    plain = plain_columns(samples, [rows.scene.transition, _TURN * rows.scene.speed])
    has = settings.get('lag', 0.0)
    for matrix in [columns(rows)] if has else [plain, columns(rows)]:
        lag, gain = _best_lag(rows, matrix, target, fine=bool(has))
        if gain > (SAME if has else 0.5 * (1.0 - LAG)):
            others.append({**settings, 'lag': has + lag})
    errors: list[tuple[float, int, dict[str, Any]]] = []
    for choice in differentiations(question.raw):
        if has:
            choice['lag'] = has
        matrix = columns(moved_again(rows, question.raw, choice))
        if np.isfinite(matrix).all():
            error = float(held_out(rows.averaged(matrix), target, rows.block).sum())
            errors.append((error, len(errors), choice))
    least, _, choice = min(errors)
    now = [error for error, _, same in errors if same == settings]
    if choice != settings and (not now or least < _BETTER ** 2 * now[0]):
        others.append(choice)
    return others


def _best_lag(rows: Rows, matrix: np.ndarray, target: np.ndarray, fine: bool
              ) -> tuple[float, float]:
    """Return the time shift of columns that predicts best, s, and the share it takes away.

    Parameters
    ----------
    rows : Rows
    matrix : ndarray, shape (N, P)
        Columns on all samples.
    target : ndarray, shape (R,)
    fine : bool
        Whether only shifts of less than two samples are tried.
    """
    step = rows.samples.sample_time

    def error(lag: float) -> float:
        moved = rows.averaged(shifted(matrix, rows.samples, lag))
        return float(held_out(moved, target, rows.block).sum())
    sizes = (1.0, 2.0) if fine else [size for size in _LAGS if size * step <= _LONGEST_LAG]
    lags = np.array(sorted([0.0, *(side * size * step for size in sizes for side in (1, -1))]))
    errors = [error(lag) for lag in lags]
    index = int(np.argmin(errors))
    best = optimize.minimize_scalar(
        error, bounds=(lags[max(index - 1, 0)], lags[min(index + 1, len(lags) - 1)]),
        method='bounded', options={'xatol': 0.02 * step, 'maxiter': 12})
    least, lag = min((errors[index], float(lags[index])), (float(best.fun), float(best.x)))
    return lag, 1.0 - least / errors[int(np.argmin(np.abs(lags)))]
