# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds what acts on single joints beside the links, in one fit with the links' parameters.

A spring, a ripple or friction that grows with the load is not what the links leave over: a wrong
mass explains much of it. So each of these effects is a set of columns beside those of the links,
whose parameters all joints share, and is added where the error of stretches that were not fitted
becomes clearly smaller. The links are linearised about the latest fit; what the URDF says of them
is part of the sums of every stretch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import functools
import math
from typing import Any

import numpy as np

from friction_comp.arm.solver import ArmRows, FRICTION, FRICTION_SIGNS, linearised, Prior
from friction_comp.model.arm import friction_groups, PARAMETERS, Tree
from friction_comp.model.effects import Coverage, EFFECTS, ResidualView
from friction_comp.refinement import search, thresholds
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import signs_of, Term
from friction_comp.refinement.prepare import coverage_of, standstill_speed, TRANSITIONS
from friction_comp.samples import Samples

# Steps by which constants are changed, see `search.step_size`: a parabola gives the best.
_STEPS = (0.5, 0.1)
# Share of both gains that is enough for an effect to stay in a fit.
_STAYS = 0.5


@dataclass(frozen=True)
class JointTerm(Term):
    """An effect of one joint."""

    joint: int = 0

    @property
    def choice(self) -> tuple[Any, ...]:
        """What it is, and at which joint."""
        return self.joint, *super().choice


Terms = Sequence[JointTerm]


def columns_of(rows: ArmRows, tree: Tree, terms: Terms
               ) -> tuple[list[np.ndarray], dict[JointTerm, list[int]]]:
    """Return the columns of terms for each joint, (N, M), and the indices of each term's columns.

    Load is the torque of the links of `tree`.
    """
    torques = tree.torques(*rows.motion)
    parts: list[list[np.ndarray]] = [[np.empty((len(torques), 0))] for _ in rows.samples]
    indices = {}
    for term in terms:
        columns = (term.group.columns(tree.joints, *rows.motion) if term.group else
                   term.kind.matrix(rows.samples[term.joint].with_(
                       rigid_body=torques[:, term.joint]), term.constants))
        first = sum(part.shape[1] for part in parts[term.joint])
        indices[term] = list(range(first, first + columns.shape[1]))
        parts[term.joint].append(columns)
    return [np.hstack(own) for own in parts], indices


def signs_at(indices: dict[JointTerm, list[int]], joints: int) -> np.ndarray:
    """Return the required signs of each joint's friction and terms, (J, F); see `Prior.signs`."""
    rows = [list(FRICTION_SIGNS) for _ in range(joints)]
    for term, columns in indices.items():
        rows[term.joint] += signs_of(term, len(columns))
    longest = max(map(len, rows))
    return np.array([row + [0] * (longest - len(row)) for row in rows])


@dataclass(frozen=True)
class _Sums:
    """The sums of links, all joints' friction and some terms over cells: a joint in a stretch."""

    sums: BlockSums     # of derivatives by the unknowns of `Prior`, as differences from their means
    always: list[int]   # columns of links and friction
    columns: dict[JointTerm, list[int]]
    local: dict[JointTerm, list[int]]   # the same among the columns of its joint
    stretch: np.ndarray     # of each cell; joints follow each other in each
    combine: np.ndarray     # see `solver.linearised`
    products: np.ndarray    # of each joint's own columns, as of `solver.Sums.total`
    rows: np.ndarray        # (N, J, P): the columns themselves

    def chosen(self, terms: Terms) -> list[int]:
        """Return the columns of a fit of links, friction and some terms."""
        return [*self.always, *(column for term in terms for column in self.columns[term])]

    def errors(self, terms: Terms) -> np.ndarray:
        """Return the squared errors of held-out stretches of each joint, (S, J)."""
        return self.sums.held_out_errors(self.chosen(terms), self.stretch).reshape(
            int(self.stretch.max()) + 1, -1)

    def residual(self, terms: Terms) -> np.ndarray:
        """Return the residual of a fit of terms, A, (N, J)."""
        chosen = self.chosen(terms)
        combination = (self.combine[:, :, -1]
                       - self.combine[:, :, chosen] @ self.sums.fit(chosen))
        return np.einsum('njp,jp->nj', self.rows, combination)


@dataclass(frozen=True)
class Beside:
    """A search among the effects of position and of load at all joints, from the latest fit.

    `x` are the unknowns of that fit with any terms, `variance` the unit of each joint's error.
    """

    rows: ArmRows
    tree: Tree
    prior: Prior
    x: np.ndarray
    variance: np.ndarray

    def search(self, terms: Terms) -> list[JointTerm]:
        """Return the terms to which steps lead: adding one while one helps, and removing others.

        The constants of the terms given are adjusted first: other links than those before may ask
        for other ones.
        """
        chosen = self._adjusted(terms) if terms else []
        while True:
            offered = self._offered(chosen)
            sums = self._sums([*chosen, *offered])
            before = sums.errors(chosen)
            trials = [(sums.errors([*chosen, term]), term) for term in offered]
            trials.sort(key=lambda trial: float(trial[0].sum()))
            best = next((term for after, term in trials if _improves(before, after)), None)
            if best is None:
                return self._needed(chosen)
            grown = self._needed(self._adjusted([*chosen, best]))
            if not self._sums(grown).errors(grown).sum() < before.sum():
                return chosen
            chosen = grown

    def _needed(self, terms: Terms) -> list[JointTerm]:
        """Return the terms without those that are no improvement, the least useful first."""
        kept, sums = list(terms), self._sums(terms)
        while True:
            full = sums.errors(kept)
            without = [(sums.errors([other for other in kept if other != term]), term)
                       for term in kept]
            useless = [(float(errors.sum()), term) for errors, term in without
                       if not _improves(errors, full, 1.0 if term.group else _STAYS)]
            if not useless:
                return kept
            kept.remove(min(useless, key=lambda trial: trial[0])[1])

    def _sums(self, terms: Terms) -> _Sums:
        beside, indices = columns_of(self.rows, self.tree, list(dict.fromkeys(terms)))
        measured, joints = self.rows.sums(beside), len(self.rows.samples)
        weights = measured.variance / self.variance
        own = measured.sums * weights[:, None, None]
        # The unknowns are those of links and scales, and then of each joint's friction and terms.
        base = self.prior.scales.stop
        prior = replace(self.prior, signs=signs_at(indices, joints))
        # The current is linear in the coefficients: at any values its derivatives are the same.
        x = np.concatenate((self.x[:base], np.zeros(prior.signs.size)))
        first = base + prior.signs.shape[1] * np.arange(joints)
        combine = linearised(prior, x)
        combine[:, :, -1] += combine[:, :, :-1] @ (x - prior.mean)
        gram = combine.transpose(0, 2, 1) @ own @ combine
        stretch = np.repeat(np.arange(len(own)), joints)
        diagonal = np.arange(x.size)
        gram[:, :, diagonal, diagonal] += prior.precision / len(stretch)
        return _Sums(
            BlockSums(gram.reshape(-1, *gram.shape[2:]), np.ones(len(stretch)),
                      np.concatenate((np.zeros(base, dtype=int), prior.signs.ravel()))),
            [*range(base), *(first[:, None] + np.arange(FRICTION)).ravel().tolist()],
            {term: [int(first[term.joint]) + FRICTION + k for k in columns]
             for term, columns in indices.items()},
            {term: [PARAMETERS * joints + FRICTION + k for k in columns]
             for term, columns in indices.items()},
            stretch, combine, own.sum(axis=0), self.rows.columns(beside))

    def _offered(self, terms: Terms) -> list[JointTerm]:
        """Return the proposed terms: of each choice, the one that lowers the error most."""
        residual = self._sums(terms).residual(terms)
        taken = {term.choice for term in terms if term.kind.max_count == 1 or term.group}
        proposed = [term for joint in self._moved for term in self._proposals(joint, residual)
                    if term not in terms and term.choice not in taken]
        sums, best = self._sums([*terms, *proposed]), dict[Any, JointTerm]()
        for joint, products in enumerate(sums.products):
            own = [term for term in proposed if term.joint == joint]
            chosen = [*range(PARAMETERS * len(self.rows.samples) + FRICTION), *(
                column for term in terms if term.joint == joint for column in sums.local[term])]
            reductions = search.error_reductions(
                products, chosen, [sums.local[term] for term in own], np.zeros(len(products) - 1))
            for index in np.argsort(-reductions, kind='stable'):
                best.setdefault(own[index].choice, own[index])
        return list(best.values())

    @functools.cached_property
    def _moved(self) -> dict[int, tuple[Samples, Coverage]]:
        """Samples and what they cover of each joint that moves."""
        torques, found = self.tree.torques(*self.rows.motion), {}
        for joint in np.flatnonzero(self.rows.moves & self.rows.fitted.any(axis=0)).tolist():
            samples = self.rows.samples[joint].with_(rigid_body=torques[:, joint])
            found[joint] = samples, coverage_of(
                samples, self.rows.fitted[:, joint], standstill_speed(samples), samples)
        return found

    def _proposals(self, joint: int, residual: np.ndarray) -> list[JointTerm]:
        """Return a joint's effects of position and load, and friction shared with its neighbours.

        Constants are those that the residual of all joints, A, (N, J), suggests.
        """
        (samples, coverage), fitted = self._moved[joint], self.rows.fitted[:, joint]
        part = samples.take(fitted)
        velocity = np.asarray(part.velocity)
        view = ResidualView(
            coverage, part.position, velocity, np.tanh(velocity / coverage.transition),
            residual[fitted, joint], samples.sample_time, [])
        terms = [
            JointTerm(kind, constants, None, joint) for kind in EFFECTS.values()
            if kind.variable in ('position', 'load') and not kind.uses_inner_load
            # The columns of the links hold all weight.
            and not kind.weight and kind.can_show(coverage)
            and all((signal := getattr(samples, name)) is not None and np.isfinite(signal).all()
                    for name in kind.needs)
            for constants in kind.propose(view)]
        moving = {self.tree.joints[other] for other in self._moved}
        return terms + [
            JointTerm(EFFECTS['other_joints'], {}, group, joint) for group in friction_groups(
                self.tree.joints, samples.joint,
                [share * coverage.speed for share in TRANSITIONS]) if group.all_joints <= moving]

    def _adjusted(self, terms: Terms) -> list[JointTerm]:
        """Return terms with each constant where a parabola through three values has its least."""
        chosen = list(terms)
        for size in _STEPS:
            free = search.free_constants(chosen)
            sides = [[self._moved_term(chosen, index, name, step) for step in (-size, size)]
                     for index, name in free]
            sums = self._sums([*chosen, *(term for pair in sides for one in pair for term in one)])
            middle, changed = sums.errors(chosen).sum(), list(chosen)
            for (index, name), pair in zip(free, sides):
                low, high = (sums.errors(one).sum() for one in pair)
                bend = low + high - 2.0 * middle
                step = 0.5 * (low - high) / bend if bend > 0.0 else 2.0 * np.sign(low - high)
                changed[index] = self._moved_term(
                    chosen, index, name, float(np.clip(step, -2.0, 2.0)) * size)[index]
            if self._sums(changed).errors(changed).sum() < middle:
                chosen = changed
        return chosen


    def _moved_term(self, terms: Terms, index: int, name: str, step: float) -> list[JointTerm]:
        """Return terms with a constant of one changed by some steps."""
        changed, term = list(terms), terms[index]
        moved = search.with_step(term, name, step, self._moved[term.joint][1])
        changed[index] = JointTerm(moved.kind, moved.constants, moved.group, term.joint)
        return changed


def _improves(before: np.ndarray, after: np.ndarray, share: float = 1.0) -> bool:
    """Return whether errors, (S, J), decrease: that of a joint by more than chance, and their sum.

    A joint's error says nothing of the others', but the links that are fitted to it are also
    theirs. `share` is that of the thresholds of every search.
    """
    if not after.sum() < before.sum():
        return False
    gain = before - after
    # Relative to the error of each stretch, so that one with large errors cannot decide.
    ratio = gain / np.maximum(before + after, 1e-300)
    scatter = ratio.std(axis=0, ddof=1) / math.sqrt(len(ratio))
    return bool(np.any((gain.sum(axis=0) > share * thresholds.LEAST_SHARE * before.sum(axis=0))
                       & (ratio.mean(axis=0) > share * thresholds.STANDARD_ERRORS * scatter)))
