# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds what acts on single joints beside the links, in one fit with the links' parameters.

A spring, a ripple or friction that grows with the load is not what the links leave over: a wrong
mass explains much of it. So each of these effects is a set of columns beside those of the links,
whose parameters all joints share, and is added by the criterion of every search: the error of
stretches that were not fitted. The links are linearised about the latest fit; what the URDF says of
them is part of the sums of every stretch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friction_comp.arm.solver import ArmRows, FRICTION, FRICTION_SIGNS, linearised, Prior, Sums
from friction_comp.model.arm.coupling import friction_groups
from friction_comp.model.arm.tree import PARAMETERS, Tree
from friction_comp.model.effects import EFFECTS, ResidualView
from friction_comp.refinement import search
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import signs_of, Table, Term
from friction_comp.refinement.prepare import coverage_of
from friction_comp.refinement.recorded_motion import standstill_speed, TRANSITIONS
from friction_comp.refinement.search import Search

# Steps by which constants are changed, see `search.step_size`: a parabola gives the best.
_STEPS = (0.5, 0.1)


@dataclass(frozen=True)
class JointTerm(Term):
    """An effect of one joint."""

    joint: int = 0

    @property
    def choice(self) -> tuple[Any, ...]:
        """What it is, and at which joint."""
        return self.joint, *super().choice


def joint_of(term: Term) -> int:
    """Return the joint of a term of an arm."""
    assert isinstance(term, JointTerm)
    return term.joint


def columns_of(rows: ArmRows, tree: Tree, terms: Sequence[Term]
               ) -> tuple[list[np.ndarray], dict[Term, list[int]]]:
    """Return the columns of terms for each joint, (N, M), and the indices of each term's columns.

    Load is the torque of the links of `tree`.
    """
    torques = tree.torques(*rows.motion)
    parts: list[list[np.ndarray]] = [[np.empty((len(torques), 0))] for _ in rows.samples]
    indices = {}
    for term in terms:
        joint = joint_of(term)
        columns = (term.group.columns(tree.joints, *rows.motion) if term.group else
                   term.kind.matrix(rows.samples[joint].with_(rigid_body=torques[:, joint]),
                                    term.constants))
        first = sum(part.shape[1] for part in parts[joint])
        indices[term] = list(range(first, first + columns.shape[1]))
        parts[joint].append(columns)
    return [np.hstack(own) for own in parts], indices


def signs_at(indices: dict[Term, list[int]], joints: int) -> np.ndarray:
    """Return the required signs of each joint's friction and terms, (J, F); see `Prior.signs`."""
    rows = [list(FRICTION_SIGNS) for _ in range(joints)]
    for term, columns in indices.items():
        rows[joint_of(term)] += signs_of(term, len(columns))
    longest = max(map(len, rows))
    return np.array([row + [0] * (longest - len(row)) for row in rows])


class ArmTable(Table):
    """The columns of links, of all joints' friction, and of terms, and their sums over cells.

    A cell is one joint in one stretch; the columns are derivatives by the unknowns of `Prior`, as
    differences from their means. `sums` have the columns of `indices` after those of friction, and
    x, shape (U,), is the latest fit with any terms.
    """

    def __init__(self, sums: Sums, prior: Prior, x: np.ndarray, indices: dict[Term, list[int]]
                 ) -> None:
        stretches, joints = sums.sums.shape[:2]
        # The unknowns are those of links and scales, and then of each joint's friction and terms.
        base = prior.scales.stop
        prior = replace(prior, signs=signs_at(indices, joints))
        # The current is linear in the coefficients: at any values its derivatives are the same.
        x = np.concatenate((x[:base], np.zeros(prior.signs.size)))
        first = base + prior.signs.shape[1] * np.arange(joints)
        self._always = [*range(base), *(first[:, None] + np.arange(FRICTION)).ravel().tolist()]
        self.columns_of = {term: [int(first[joint_of(term)]) + FRICTION + k for k in columns]
                           for term, columns in indices.items()}
        self.transition = 0.0, 0.0
        self.block = np.repeat(np.arange(stretches), joints)
        self.region = np.zeros_like(self.block)
        self._combine = linearised(prior, x)
        self._combine[:, :, -1] += self._combine[:, :, :-1] @ (x - prior.mean)
        gram = self._combine.transpose(0, 2, 1) @ sums.sums @ self._combine
        diagonal = np.arange(x.size)
        gram[:, :, diagonal, diagonal] += prior.precision / len(self.block)
        self.sums = BlockSums(gram.reshape(-1, *gram.shape[2:]), np.ones(len(self.block)),
                              np.concatenate((np.zeros(base, dtype=int), prior.signs.ravel())))

    def indices(self, terms: Sequence[Term], derivatives: bool = True) -> list[int]:
        """Return the column indices of links, friction and some terms."""
        return [*self._always, *(column for term in terms for column in self.columns_of[term])]

    def set_transition(self, steepness: float, shift: float) -> None:
        """Do nothing: friction changes its sign where it does in the sums."""

    def residual_of(self, columns: np.ndarray, terms: Sequence[Term]) -> np.ndarray:
        """Return the residual of a fit of terms, A, (N, J); `columns` are those of `ArmRows`."""
        chosen = self.indices(terms)
        combination = (self._combine[:, :, -1]
                       - self._combine[:, :, chosen] @ self.sums.fit(chosen))
        return np.einsum('njp,jp->nj', columns, combination)


class ArmSearch(Search):
    """A search among the effects of position and of load at all joints, from the latest fit.

    An effect is an improvement where it is at one joint, and where the error of all is no larger: a
    joint's error says nothing of the others', but the links that are fitted to it are also theirs.
    """

    def __init__(self, rows: ArmRows, tree: Tree, prior: Prior, x: np.ndarray,
                 variance: np.ndarray, terms: Sequence[Term]) -> None:
        self._rows, self._tree, self._variance = rows, tree, variance
        self._prior, self._x = prior, x
        torques, self._samples, self._coverage = tree.torques(*rows.motion), {}, {}
        for joint in np.flatnonzero(rows.moves & rows.fitted.any(axis=0)).tolist():
            samples = rows.samples[joint].with_(rigid_body=torques[:, joint])
            self._samples[joint] = samples
            self._coverage[joint] = coverage_of(
                samples, rows.fitted[:, joint], standstill_speed(samples), samples)
        self._known = dict.fromkeys(terms)
        super().__init__(self._table(terms), [])
        self._update_candidates(terms)

    def _measured(self, terms: Sequence[Term]
                  ) -> tuple[list[np.ndarray], Sums, dict[Term, list[int]]]:
        """Return the columns of terms, their sums with all others, and their indices."""
        columns, indices = columns_of(self._rows, self._tree, terms)
        sums = self._rows.sums(columns)
        weights = sums.variance / self._variance
        return columns, replace(sums, sums=sums.sums * weights[:, None, None]), indices

    def _table(self, terms: Sequence[Term]) -> ArmTable:
        _, sums, indices = self._measured(terms)
        return ArmTable(sums, self._prior, self._x, indices)

    def _update_candidates(self, terms: Sequence[Term]) -> None:
        """Replace the candidates: of each choice, the proposed term that lowers the error most."""
        self._known |= dict.fromkeys(terms)
        columns, sums, indices = self._measured([*self._known])
        residual = ArmTable(sums, self._prior, self._x, indices).residual_of(
            self._rows.columns(columns), terms)
        proposed = [term for joint in self._samples
                    for term in self._proposals(joint, residual) if term not in self._known]
        _, sums, indices = self._measured([*self._known, *proposed])
        # In the sums of a joint, its terms follow all links and its own friction.
        first = PARAMETERS * len(self._rows.samples) + FRICTION
        columns_of = {term: [first + index for index in own] for term, own in indices.items()}
        best: dict[Any, Term] = {}
        for joint, products in enumerate(sums.total):
            offered = [term for term in proposed if joint_of(term) == joint]
            chosen = [*range(first), *(column for term in terms if joint_of(term) == joint
                                       for column in columns_of[term])]
            reductions = search.error_reductions(
                products, chosen, [columns_of[term] for term in offered],
                np.zeros(len(products) - 1))
            for index in np.argsort(-reductions, kind='stable'):
                best.setdefault(offered[index].choice, offered[index])
        self.candidates = [*best.values()]
        self.table = self._table([*self._known, *self.candidates])

    def _proposals(self, joint: int, residual: np.ndarray) -> list[Term]:
        """Return a joint's effects of position and load, and friction shared with its neighbours.

        Constants are those that the residual of all joints, A, (N, J), suggests.
        """
        samples, coverage = self._samples[joint], self._coverage[joint]
        fitted = self._rows.fitted[:, joint]
        part = samples.take(fitted)
        velocity = np.asarray(part.velocity)
        view = ResidualView(
            coverage, part.position, velocity, np.tanh(velocity / coverage.transition),
            residual[fitted, joint], samples.sample_time, [])
        terms: list[Term] = [
            JointTerm(kind, constants, None, joint) for kind in EFFECTS.values()
            if kind.variable in ('position', 'load') and not kind.uses_inner_load
            # The columns of the links hold all weight.
            and not kind.weight and not kind.insufficient_data(coverage)
            and all((signal := getattr(samples, name)) is not None and np.isfinite(signal).all()
                    for name in kind.needs)
            for constants in kind.propose(view)]
        moving = {self._tree.joints[j] for j in self._samples}
        return terms + [
            JointTerm(EFFECTS['other_joints'], {}, group, joint) for group in friction_groups(
                self._tree.joints, samples.joint,
                [share * coverage.speed for share in TRANSITIONS]) if group.all_joints <= moving]

    def after_addition(self, terms: list[Term]) -> list[Term]:
        """Adjust the constants of terms, and update the candidates."""
        for size in _STEPS:
            terms = self._adjusted(terms, size)
        self._update_candidates(terms)
        return terms

    def _adjusted(self, terms: list[Term], size: float) -> list[Term]:
        """Return terms with each constant where a parabola through three values has its least."""
        free = search.free_constants(terms)

        def moved(index: int, name: str, step: float) -> list[Term]:
            coverage = self._coverage[joint_of(terms[index])]
            return [search.with_step(term, name, step, coverage) if k == index else term
                    for k, term in enumerate(terms)]
        sides = [[moved(index, name, step) for step in (-size, size)] for index, name in free]
        table = self._table(list(dict.fromkeys(
            [*terms, *(term for pair in sides for trial in pair for term in trial)])))
        middle, changed = table.error(terms), terms
        for (index, name), pair in zip(free, sides):
            low, high = (table.error(trial) for trial in pair)
            bend = low + high - 2.0 * middle
            step = 0.5 * (low - high) / bend if bend > 0.0 else 2.0 * np.sign(low - high)
            best = moved(index, name, float(np.clip(step, -2.0, 2.0)) * size)[index]
            changed = [best if k == index else term for k, term in enumerate(changed)]
        table = self._table(list(dict.fromkeys([*terms, *changed])))
        return changed if table.error(changed) < middle else terms

    def errors(self, terms: Sequence[Term]) -> list[np.ndarray]:
        """Return the squared errors of held-out stretches of each joint."""
        errors = self.table.held_out_errors(self.table.indices(terms))
        return list(errors.reshape(int(self.table.block.max()) + 1, -1).T)

    def is_improvement(self, before: Sequence[np.ndarray], after: Sequence[np.ndarray],
                       share: float = 1.0) -> bool:
        """Return whether the errors of a joint decrease by more than chance, and their sum does."""
        return search.total(after) < search.total(before) and any(
            super(ArmSearch, self).is_improvement([old], [new], share)
            for old, new in zip(before, after))
