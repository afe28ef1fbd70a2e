# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects as columns of a linear fit, and the block sums of these columns.

Each effect gives one or a few columns for each point of a small grid of its constants. Eq. 6 is
part of every fit: its plateaus and its viscous term as columns, its steepness and its shift through
their derivatives.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
import copy
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.model.arm import friction_groups, Group, groups_for
from friction_comp.model.effect import Effect, ResidualView
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.prepare import Rows, TRANSITIONS

# Number of columns of Eq. 6, and of those that are not derivatives; signs of their coefficients.
EQ6_COLUMNS, EQ6_LINEAR, _EQ6_SIGNS = 5, 3, (0, 1, 1, 0, 0)
# Limits of steepness times top speed: beyond them recordings show no difference.
_FLATTEST, _STEEPEST = 2.0, 6000.0
# Steepness times shift at which Eq. 6 has 15 % of Coulomb friction at zero velocity.
MAX_SHIFT = 0.3
# Times the standard deviation of the current: a part of a fit with more is cancelled by others.
_CANCELLED = 2.0
# Share of the squared error: a transition that brings less is good enough.
_LEAST_GAIN = 1e-4


@dataclass(frozen=True)
class Term:
    """An effect with its constants, or one group of terms of the effect `other_joints`."""

    kind: type[Effect]
    constants: dict[str, Any] = field(default_factory=dict, compare=False)
    group: Group | None = None
    # The values of the constants, which are compared and hashed, and the hash, often needed.
    _values: tuple[Any, ...] = field(init=False, repr=False)
    _hash: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, '_values', tuple(self.constants.values()))
        object.__setattr__(self, '_hash', hash((self.kind, self.group, self._values)))

    def __hash__(self) -> int:
        return self._hash

    def columns(self, rows: Rows) -> np.ndarray:
        """Return the term's columns on all samples, shape (N, M)."""
        if self.group is not None:
            assert rows.motion is not None, 'groups are made of the motion of several joints'
            return self.group.columns(rows.joints, *rows.motion)
        return self.kind.matrix(rows.samples, self.constants)

    def at_rows(self, rows: Rows) -> np.ndarray:
        """Return the term's columns on rows, shape (M, R)."""
        if self.group is None and not self.kind.has_memory:
            return self.kind.matrix(rows.at_rows, self.constants).T
        return self.columns(rows)[rows.index].T

    @property
    def choice(self) -> tuple[Any, ...]:
        """What it is, of which form, constants or the width of a group are one choice."""
        return self.kind.form_of or self.kind, self.group and replace(self.group, width=0.0)


def eq6_columns(rows: Rows, steepness: float, shift: float) -> np.ndarray:
    """Return Eq. 6 as columns, shape (N, EQ6_COLUMNS): constant, transition, viscous, derivatives.

    The last two are those of the transition by the logarithm of its steepness and by its shift.
    """
    v = np.asarray(rows.samples.velocity)
    half = 0.5 * steepness * (v - shift)
    transition = np.tanh(half)
    slope = 1.0 - transition ** 2
    # In motion in one direction, an offset and Coulomb friction are the same.
    bidirectional = 1.0 if rows.coverage.both_directions else 0.0
    return np.column_stack((
        np.full(len(v), bidirectional), transition, v, half * slope,
        -0.5 * bidirectional * steepness * slope))


class Table:
    """Columns of terms on the rows of a recording, shape (P, R), and their sums over regimes."""

    def __init__(self, rows: Rows, steepness: float, shift: float = 0.0) -> None:
        self.rows, self.target = rows, rows.target[rows.index]
        self.transition = steepness, shift  # of Eq. 6, s/rad and rad/s
        self.columns_of: dict[Term, list[int]] = {}  # indices of the columns of each term added
        self.sums = BlockSums.over(self.target[None], rows.block)
        self.columns = np.empty((0, len(self.target)))
        self._set(self._grown(EQ6_COLUMNS), self._base(steepness, shift), _EQ6_SIGNS)

    def _base(self, steepness: float, shift: float) -> np.ndarray:
        return eq6_columns(self.rows, steepness, shift)[self.rows.index].T

    def part(self, terms: Container[Term]) -> Table:
        """Return a table of some of the terms alone, in which others are tried for less."""
        part = copy.copy(self)
        part.keep(terms)
        return part

    def keep(self, terms: Container[Term]) -> None:
        """Remove all other terms."""
        kept, size = [term for term in self.columns_of if term in terms], EQ6_COLUMNS
        columns = self.indices(kept)
        self.sums, self.columns = self.sums.part(columns), self.columns[columns]
        counts, self.columns_of = [len(self.columns_of[term]) for term in kept], {}
        for term, count in zip(kept, counts):
            self.columns_of[term], size = list(range(size, size + count)), size + count

    def add(self, terms: Sequence[Term], part: Table | None = None) -> list[Term]:
        """Add terms, whose columns a part of the table may have; return the finite ones."""
        fresh: dict[Term, np.ndarray] = {}
        for term in terms:
            if term not in self.columns_of and term not in fresh:
                columns = (part.columns[part.columns_of[term]] if part and term in part.columns_of
                           else term.at_rows(self.rows))
                if np.isfinite(columns).all():
                    fresh[term] = columns
        if fresh:
            places = self._grown(sum(map(len, fresh.values())))
            signs = [sign for term, columns in fresh.items() for sign in signs_of(
                term, len(columns))]
            self._set(places, np.concatenate(list(fresh.values())), signs)
            for term, columns in fresh.items():
                self.columns_of[term], places = places[:len(columns)], places[len(columns):]
        return [term for term in terms if term in self.columns_of]

    def _grown(self, count: int) -> list[int]:
        """Append columns of zeros, and return their indices."""
        size, old = len(self.columns), self.sums
        gram = old.gram
        self.columns = np.vstack((self.columns, np.zeros((count, len(self.target)))))
        for axis in (1, 2):
            gram = np.insert(gram, [size] * count, 0.0, axis)
        self.sums = BlockSums(gram, old.rows, np.append(old.signs, [0] * count).astype(int))
        return list(range(size, size + count))

    def _set(self, places: Sequence[int], columns: np.ndarray, signs: Sequence[int]) -> None:
        """Replace some columns, and their sums of products with all others and the target."""
        self.columns[places], self.sums.signs[places] = columns, signs
        for gram, rows in zip(self.sums.gram, self.rows.parts):
            every, own, target = self.columns[:, rows], columns[:, rows], self.target[rows]
            products = own @ every.T
            gram[places, :-1], gram[:-1, places] = products, products.T
            gram[places, -1] = gram[-1, places] = own @ target

    def indices(self, terms: Sequence[Term], derivatives: bool = True) -> list[int]:
        """Return the column indices of Eq. 6 and of some terms."""
        base = range(EQ6_COLUMNS if derivatives else EQ6_LINEAR)
        return [*base, *(column for term in terms for column in self.columns_of[term])]

    def residual(self, terms: Sequence[Term], derivatives: bool = True) -> np.ndarray:
        """Return the residual of a fit of some terms to all regimes, shape (R,)."""
        indices = self.indices(terms, derivatives)
        return np.asarray(self.target - self.sums.fit(indices) @ self.columns[indices])

    def coefficients(self, terms: Sequence[Term]) -> dict[int, float]:
        """Return the coefficient of each column index, fitted to all regimes."""
        indices = self.indices(terms, derivatives=False)
        return dict(zip(indices, map(float, self.sums.fit(indices))))

    def errors(self, terms: Sequence[Term]) -> np.ndarray:
        """Return the squared error of each regime that is not fitted, shape (L, B).

        It is the criterion of choice, see `BlockSums.errors_by_size`.
        """
        return self.sums.errors_by_size(self.indices(terms, derivatives=False))

    def cancels(self, terms: Sequence[Term]) -> bool:
        """Return whether a part of a fit makes much more than the current.

        Others cancel it then, none of which is that of the drive: in other motion they do not.
        """
        gram = self.sums.gram.sum(axis=0)
        # About the mean, which the offset of Eq. 6 takes; without it, the first column is zero.
        mean = gram[0] / max(gram[0, 0], 1e-300)
        spread = gram - gram[0, 0] * np.outer(mean, mean)
        fitted = self.coefficients(terms)
        parts = [[1], [2], *(self.columns_of[term] for term in terms)]
        return any(own @ spread[np.ix_(part, part)] @ own > _CANCELLED ** 2 * spread[-1, -1]
                   for part in parts for own in [np.array([fitted[k] for k in part])])

    def fit_transition(self, terms: Sequence[Term], rounds: int = 4) -> None:
        """Move the transition of Eq. 6 to its optimum beside some terms, by Gauss-Newton steps."""
        speed, part = self.rows.coverage.speed, self.part(terms)
        columns = part.indices(terms, derivatives=False)

        def error_at(transition: tuple[float, float]) -> float:
            part.set_transition(*transition)
            return float(part.sums.held_out_errors(columns).sum())
        current = self.transition
        best = error_at(current)
        for _ in range(rounds):
            before, coefficients = best, part.sums.fit(part.indices(terms))
            if not coefficients[1] > 0.0:
                break
            # Columns 3 and 4 are derivatives of column 1, Coulomb friction.
            growth = float(np.clip(coefficients[3] / coefficients[1], -1.0, 1.0))
            step = float(np.clip(
                coefficients[4] / coefficients[1], -1.0 / current[0], 1.0 / current[0]))
            for share in (1.0, 0.5, 0.25):
                steepness = float(np.clip(current[0] * math.exp(share * growth), _FLATTEST / speed,
                                          _STEEPEST / speed))
                limit = MAX_SHIFT / steepness
                trial = steepness, float(np.clip(current[1] + share * step, -limit, limit))
                error = error_at(trial)
                if error < best:
                    best, current = error, trial
                    break
            if best > (1.0 - _LEAST_GAIN) * before:
                break
        self.set_transition(*current)

    def set_transition(self, steepness: float, shift: float) -> None:
        """Set the steepness and the shift of Eq. 6 and recompute its columns."""
        if (steepness, shift) != self.transition:
            self.transition = steepness, shift
            self._set(range(EQ6_COLUMNS), self._base(steepness, shift), _EQ6_SIGNS)

    def load_shares(self, terms: Sequence[Term]) -> list[dict[str, float]]:
        """Return the load on the teeth due to each term of a fit; see `Effect.load_share`.

        Empty if no term gives a load. The offset of Eq. 6 is one where it is part of such a term,
        as with gravity over a short range.
        """
        coefficients, shares, carries_load = self.coefficients(terms), [], False
        for term in terms:
            if term.group is None and not term.kind.uses_inner_load:
                values = [coefficients[column] for column in self.columns_of[term]]
                shares.append(term.kind.load_share(values, term.constants))
                within = term.kind.offset_within
                carries_load = carries_load or within is not None
                if within is not None and self.rows.coverage.span < within:
                    shares.append({'offset': coefficients[0]})
        return shares if carries_load else []

    def residual_view(self, terms: Sequence[Term]) -> ResidualView:
        """Return the residual of a fit, from which effects propose constants."""
        part, coverage = self.rows.at_rows, self.rows.coverage
        velocity = np.asarray(part.velocity)
        return ResidualView(
            coverage, part.position, velocity, np.tanh(velocity / coverage.transition),
            self.residual(terms), self.rows.samples.sample_time, self.load_shares(terms))


def signs_of(term: Term, count: int) -> list[int]:
    """Return the required sign of each of a term's coefficients, 0 where it is free."""
    wanted = list(term.kind.signs_with(term.constants)[:count]) if term.group is None else [
        1 if term.group.kind == 'friction' else 0] * count
    return wanted + [0] * (count - len(wanted))


def first_model(table: Table) -> list[Term]:
    """Return the terms with which a search begins: every drive may have them."""
    return _proposed(table, [], [kind for kind in EFFECTS.values() if kind.in_first_model])


def _proposed(table: Table, terms: Sequence[Term], kinds: Iterable[type[Effect]]) -> list[Term]:
    rows, view = table.rows, table.residual_view(terms)
    return [
        Term(kind, constants) for kind in kinds
        if all(getattr(rows.samples, signal) is not None for signal in kind.needs)
        and kind.can_show(rows.coverage)
        and (view.load_shares or not kind.uses_inner_load)
        # The person's torque responds to friction: it correlates with every missing effect.
        and not (rows.load_coefficient and 'load' in kind.needs)
        for constants in kind.propose(view)]


def proposals(table: Table, terms: Sequence[Term]) -> list[Term]:
    """Return candidate terms to add to a fit, of effects whose signals were recorded and varied."""
    rows, proposed = table.rows, _proposed(table, terms, EFFECTS.values())
    if rows.joints:
        # Rigid bodies of a URDF are all weight and inertia of other joints.
        known = rows.samples.rigid_body is not None
        proposed += [Term(EFFECTS['other_joints'], {}, group) for group in (
            *(() if known else groups_for(rows.joints, rows.samples.joint)),
            *friction_groups(rows.joints, rows.samples.joint,
                             [share * rows.coverage.speed for share in TRANSITIONS]))]
    return proposed
