# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Refines all joints of an arm: its links in one fit, and then each joint.

Links are fitted to recordings, with friction, rotor inertia and effects of every joint.

The measured current of joint j is modelled as
``k_j·τ_j(q, v, a; π) + offset + C·sign(v) + V·v + J·a + …``. The torque τ of the rigid bodies is
linear in the links' inertial parameters π (Atkeson, An and Hollerbach 1986). The current per torque
k_j is fitted too, since an arm's drive constants are seldom known. All joints share one π: the
wrist's motion, for instance, also shows a weight that the shoulder carries. Parameters that the
motion does not determine keep the URDF's values, and every π is physically possible.

What acts on single joints beside the links, the … above, is found in the same fit. A spring, a
ripple or friction that grows with the load is not what the links leave over: a wrong mass explains
much of it. So each of these effects is a set of columns beside those of the links, and is added
where the error of stretches that were not fitted becomes clearly smaller. The links are linearised
about the latest fit; what the URDF says of them is part of the sums of every stretch.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
import functools
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from friction_comp.arm import solver
from friction_comp.arm.solver import (
    ArmRows,
    Bodies,
    FRICTION,
    FRICTION_SIGNS,
    linearised,
    LinkIntervals,
    Prior,
    Sums,
)
from friction_comp.arm.urdf import Chain
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.arm import Arm, friction_groups, PARAMETERS, Tree
from friction_comp.model.effect import Coverage, ResidualView
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import one_thread
from friction_comp.refinement import search, thresholds
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import signs_of, Term
from friction_comp.refinement.prepare import (
    candidate_settings,
    coverage_of,
    Problem,
    standstill_speed,
    TRANSITIONS,
)
from friction_comp.refinement.refine import refine
from friction_comp.refinement.result import Origin, RefineResult
from friction_comp.samples import Samples

# Share of the work for the rigid bodies.
_BODIES = 0.2
FEWEST = 200  # samples
# Share by which other scales than those assumed must lower the errors.
_CLEARLY_BETTER = 0.15
_MOST_ROWS = {'choice': 8000, 'final': 40000}


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

    def search(self) -> list[JointTerm]:
        """Return the terms to which steps lead, each of which adds the one that helps most."""
        chosen: list[JointTerm] = []
        while True:
            offered = self._offered(chosen)
            sums = self._sums([*chosen, *offered])
            before = sums.errors(chosen)
            trials = [(sums.errors([*chosen, term]), term) for term in offered]
            trials.sort(key=lambda trial: float(trial[0].sum()))
            best = next((term for after, term in trials if _improves(before, after)), None)
            if best is None:
                return chosen
            grown = self._adjusted([*chosen, best])
            if not self._sums(grown).errors(grown).sum() < before.sum():
                return chosen
            chosen = grown

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
        # In steps of `search.step_size`.
        for size in (0.5, 0.1):
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


def _improves(before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether errors, (S, J), decrease: that of a joint by more than chance, and their sum.

    A joint's error says nothing of the others', but the links that are fitted to it are also
    theirs.
    """
    gain = before - after
    # Relative to the error of each stretch, so that one with large errors cannot decide.
    ratio = gain / np.maximum(before + after, 1e-300)
    scatter = ratio.std(axis=0, ddof=1) / math.sqrt(len(ratio))
    return bool(gain.sum() > 0.0 and np.any(
        (gain.sum(axis=0) > thresholds.LEAST_SHARE * before.sum(axis=0))
        & (ratio.mean(axis=0) > thresholds.STANDARD_ERRORS * scatter)))


@dataclass
class ArmFit:
    """An arm's rigid bodies fitted to recordings."""

    tree: Tree  # with the fitted parameters
    start: Tree  # with those of the URDF
    scales: np.ndarray  # (J,): current per torque of each joint, A per N·m
    differentiation: dict[str, Any]  # how velocity and acceleration are computed from position
    held_out: np.ndarray  # (J,): RMS error in A on stretches not fitted
    intervals: LinkIntervals  # of the links and the currents per torque
    declared: bool  # whether the currents per torque are those given
    opposed: list[str]  # joints whose current opposes the torque of the URDF


@one_thread
def fit_arm(chain: Chain, joints: list[Samples], declared: np.ndarray | None = None,
            progress: Callable[..., Any] | None = None, assumed: bool = False) -> ArmFit:
    """Fit the arm of a URDF to recorded samples of its J joints.

    The samples have one time base and `arm`, in the order of `chain.tree.joints`. `declared`, shape
    (J,), are currents per torque in A per N·m, if known. If they are `assumed`, they are dropped
    where other values predict stretches that were left out clearly better. `progress` is called
    with the share 0..1 of the work done. Raises InputError if there are too few samples, some are
    not finite, or the currents cannot be those of the URDF.
    """
    report = progress or (lambda share: None)
    if [one.joint for one in joints] != list(chain.tree.joints) or any(
            len(one) != len(joints[0]) or np.any(one.time != joints[0].time) for one in joints):
        raise InputError('the joints of an arm must be those of the URDF, on one time base')
    if len(joints[0]) < FEWEST:
        raise InputError(f'{len(joints[0])} samples are too few for an arm: give {FEWEST} or more')
    for one in joints:
        if not np.isfinite((one.position, one.current)).all():
            raise InputError(f'joint {one.joint!r}: positions and currents must be finite numbers')
    bodies = Bodies(chain.tree.parameters)
    problem = _Problem(chain, joints, bodies, declared)
    best = problem.best(lambda share: report(0.4 * share))
    if assumed:
        free = replace(problem, declared=None)
        if free.trial(best.settings, best.terms, best.tree).error < best.error - _CLEARLY_BETTER:
            problem = free
            best = free.best(lambda share: report(0.4 + 0.3 * share))
    report(0.7)
    if best.error == math.inf:
        raise InputError('the currents contradict the torques of the URDF at every joint: it is '
                         'the URDF of another robot, or lacks how the base is mounted, a fixed '
                         'joint with that angle')
    rows = solver.rows_of(problem.chain, joints, best.settings, _MOST_ROWS['final'])
    whole, x = _reweighted_fit(
        rows.sums(columns_of(rows, best.tree, best.terms)[0]), best.prior, best.x)
    report(1.0)
    tree, scales = problem.arm_of(x)
    return ArmFit(
        tree=tree, start=chain.tree, scales=scales, differentiation=best.settings,
        held_out=_held_out(best.sums, best.prior, best.x),
        intervals=solver.confidence_intervals(whole.sums, best.prior, x),
        declared=problem.declared is not None,
        opposed=[chain.tree.joints[joint] for joint in best.opposed])


class _Trial(NamedTuple):
    """A fit with some settings; `error` is the mean logarithm of the joints' held-out errors."""

    error: float
    settings: dict[str, Any]
    terms: list[JointTerm]  # beside the links
    sums: Sums
    prior: Prior
    x: np.ndarray
    tree: Tree
    opposed: list[int]  # joints whose current opposes the URDF's torque


@dataclass(frozen=True)
class _Problem:
    chain: Chain
    joints: list[Samples]
    bodies: Bodies
    declared: np.ndarray | None

    def arm_of(self, x: np.ndarray) -> tuple[Tree, np.ndarray]:
        """Return the links and the currents per torque of a fit."""
        links, count = PARAMETERS * len(self.joints), len(self.joints)
        return (replace(self.chain.tree, parameters=self.bodies.parameters(x[:links])[0]),
                np.exp(x[links:links + count]))

    def trial(self, settings: dict[str, Any], terms: list[JointTerm] | None = None,
              tree: Tree | None = None) -> _Trial:
        """Return a fit with its held-out error, infinite if the URDF's torques have wrong signs."""
        tree, terms = tree or self.chain.tree, terms or []
        rows = solver.rows_of(self.chain, self.joints, settings, _MOST_ROWS['choice'])
        columns, indices = columns_of(rows, tree, terms)
        sums = rows.sums(columns)
        typical, opposed = _typical_scale(sums, self.bodies)
        scale = np.full(len(self.joints), typical or 1.0)
        prior = Prior(
            self.bodies, np.log(scale if self.declared is None else self.declared),
            # Drives of one arm differ. With declared values, their errors appear in the joint's own
            # refinement, where the rigid bodies' torque has a free coefficient.
            1.0 if self.declared is None else 1e-3,
            signs_at(indices, len(self.joints)))
        if typical is None:
            return _Trial(math.inf, settings, terms, sums, prior, prior.mean, tree, opposed)
        sums, x = _reweighted_fit(sums, prior, prior.mean)
        error = float(np.mean(np.log(_held_out(sums, prior, x))))
        return _Trial(error, settings, terms, sums, prior, x, tree, opposed)

    def best(self, report: Callable[[float], None] = lambda share: None) -> _Trial:
        """Return the fit with the best settings, and with what acts beside the links."""
        trials, choices = [], _settings(self.joints)
        for settings in choices:
            trials.append(self.trial(settings))
            report(len(trials) / len(choices))
        best = min(trials, key=lambda trial: trial.error)
        if best.error == math.inf:
            return best
        rows = solver.rows_of(self.chain, self.joints, best.settings, _MOST_ROWS['choice'])
        links, _ = self.arm_of(best.x)
        terms = Beside(rows, links, best.prior, best.x, best.sums.variance).search()
        return self.trial(best.settings, terms, links) if terms else best


def _settings(joints: list[Samples]) -> list[dict[str, Any]]:
    arm = joints[0].arm
    return candidate_settings(joints[0], None if arm is None else arm.velocity,
                              (2.0, 5.0, 10.0, 20.0, 40.0))


def _typical_scale(problem: Sums, bodies: Bodies) -> tuple[float | None, list[int]]:
    """Return the weighted median of the joints' currents per torque, A per N·m, if any.

    Beside it the joints whose current opposes the torque of the URDF.
    """
    scales, sizes, resisting, opposed = [], [], [], []
    links = bodies.prior.ravel()
    for joint in np.flatnonzero(problem.counts > 0.0).tolist():
        matrix = problem.total[joint]
        # Combine the columns to the URDF's torque, friction and the current.
        combine = np.zeros((len(matrix), len(matrix) - links.size + 1))
        combine[:links.size, 0] = links
        combine[links.size:, 1:] = np.eye(len(matrix) - links.size)
        own = combine.T @ matrix @ combine
        norm = np.sqrt(np.maximum(np.diag(own), 0.0)) + 1e-300
        own = own / norm / norm[:, None]
        coefficients = np.linalg.pinv(own[:-1, :-1], rcond=1e-12, hermitian=True) @ own[:-1, -1]
        if own[-1, -1] > 0.0:
            # Friction as a share of the current; if it is small, the joint hardly moved.
            friction = math.sqrt(max(coefficients[2:4] @ own[2:4, 2:4] @ coefficients[2:4], 0.0))
            if friction > 0.1:
                resisting.append(coefficients[2] / norm[2] + coefficients[3] / norm[3] > 0.0)
        # 0.0 and more where the URDF is right, -0.7 to -3 where an arm is mounted otherwise.
        if coefficients[0] < -0.3:
            opposed.append(joint)
        if coefficients[0] > 0.0:
            scales.append(math.log(coefficients[0] * norm[-1] / norm[0]))
            sizes.append(coefficients[0])
    if resisting and np.mean(resisting) < 0.5:
        raise InputError('friction in the efforts drives the joints instead of resisting: efforts '
                         'have the opposite sign of positions')
    if not scales:
        return None, opposed
    # Joints that carry large loads determine the scale best, so they weigh more.
    order = np.argsort(scales)
    share = np.cumsum(np.array(sizes)[order]) / max(sum(sizes), 1e-300)
    return float(np.exp(np.array(scales)[order][int(np.searchsorted(share, 0.5))])), opposed


def _reweighted_fit(problem: Sums, prior: Prior, x: np.ndarray) -> tuple[Sums, np.ndarray]:
    """Fit with each joint weighted by its inverse residual variance; return problem and fit."""
    for _ in range(3):
        x = solver.solve(problem.total, prior, x)
        residual = solver.squared_errors(problem.total, prior, x) / np.maximum(problem.counts, 1.0)
        residual = np.maximum(residual, 1e-24)
        problem = Sums(problem.sums / residual[:, None, None], problem.variance * residual,
                       problem.counts)
    return problem, x


def _held_out(problem: Sums, prior: Prior, x: np.ndarray) -> np.ndarray:
    total, sums = problem.total, np.zeros(len(problem.counts))
    for own in problem.folds:
        sums += solver.squared_errors(own, prior, solver.solve(total - own, prior, x))
    return np.sqrt(sums * problem.variance / np.maximum(problem.counts, 1.0)) + 1e-12


@dataclass(frozen=True)
class ArmResult:
    """The result of refining an arm."""

    fit: ArmFit
    results: dict[str, RefineResult]  # by joint; the models include the arm where they need it
    notes: list[str]  # for the reader, such as joints left out or locked

    def report(self) -> dict[str, Any]:
        """Return the arm's part of report.json."""
        fit, tree, bounds = self.fit, self.fit.tree, self.fit.intervals

        def by_name(values: Any) -> dict[str, Any]:
            mass, *others = values
            return {'mass': mass, 'first_moment': others[:3], 'inertia': others[3:]}
        return {
            'joints': list(tree.joints), 'gravity': tree.gravity,
            'differentiation': dict(fit.differentiation),
            'rigid_bodies': [{
                'joint': name, 'current_per_torque': fit.scales[k],
                'held_out_rmse': fit.held_out[k],
                **by_name(tree.parameters[k].tolist()), 'mass_urdf': fit.start.parameters[k, 0],
                'intervals': {'current_per_torque': bounds.scales[k].tolist(),
                              **by_name([[end if np.isfinite(end) else None for end in ends]
                                         for ends in bounds.parameters[k].tolist()])},
                'told_by_recording': by_name(bounds.from_recording[k].tolist()),
            } for k, name in enumerate(tree.joints)],
            'notes': list(self.notes)}


@one_thread
def refine_arm(recorded: dict[str, list[Samples]], urdf: str | Path,
               drives: dict[str, Drive] | None = None,
               models: dict[str, FrictionModel] | None = None,
               declared: Collection[str] = (), only: Sequence[str] | None = None,
               progress: Callable[[float, str], None] | None = None,
               torques: bool = False, origins: Mapping[str, Origin] | None = None) -> ArmResult:
    """Fit an arm's rigid bodies to each joint's recordings with `arm`, then refine each joint.

    `drives` and `models`, the initial ones, are by joint; `declared` are the joints whose drive is
    known. If all are, masses are fitted to torques. With `torques`, all currents are torques in N·m
    unless the recordings contradict. All joints are refined unless `only` some are. `progress` is
    called with the share of the work done and the name of the step. Units of `origins` are those
    that `torques` says. Raises InputError if URDF or recordings cannot be used.
    """
    report = progress or (lambda share, word: None)
    drives, models = drives or {}, models or {}
    if torques:
        drives, declared = dict.fromkeys(recorded, Drive(1.0, 1.0)) | drives, list(recorded)
    chain, notes = _chain_of(urdf, list(recorded), only or ())
    names = list(chain.tree.joints)
    scales = None
    if set(names) <= set(declared):
        scales = np.array([1.0 / drives[name].torque_per_current for name in names])
    carried = {name: [_add_person_torque(samples, drives[name]) if name in declared else samples
                      for samples in recorded[name]] for name in names}
    fit = fit_arm(chain, _at_common_times(carried), scales,
                  lambda share: report(_BODIES * share, 'rigid bodies'), torques)
    if torques and not fit.declared:
        torques, declared = False, ()
        notes.append('the efforts are no torques in N·m of this URDF: taken as currents of unknown '
                     'torque constants (--unit A says so, --torque-constant and --gear-ratio say '
                     'more)')
    notes += [f'the current of joint {name!r} opposes the torque of the URDF: its sign differs, or '
              'the arm is mounted otherwise (a fixed joint under the base says how)'
              for name in fit.opposed]
    arm, refined = Arm(fit.tree, fit.differentiation), list(only or names)
    results: dict[str, RefineResult] = {}
    for index, name in enumerate(refined):
        def report_joint(share: float, word: str, index: int = index, name: str = name) -> None:
            report(_BODIES + (1.0 - _BODIES) * (index + share) / len(refined), f'{name}: {word}')
        drive = drives.get(name)
        origin = replace((origins or {}).get(name, Origin()), declared=name in declared,
                         unit='N·m' if torques else 'A' if drive else '')
        try:
            result = refine([_with_links(recorded[name], arm)], models.get(name), drive,
                            report_joint, origin=origin)
        except InputError as error:
            notes.append(f'joint {name!r}: {error}')
        else:
            results[name] = _with_arm(result, arm)
    if not results:
        raise InputError(notes[-1])
    return ArmResult(fit, results, notes)


def _chain_of(urdf: str | Path, recorded: list[str], only: Sequence[str]
              ) -> tuple[Chain, list[str]]:
    """Return the chain of the recorded joints, which `only` must be some of, and notes on it."""
    chain = Chain(urdf, recorded)
    for name in only:
        if name not in chain.tree.joints:
            raise InputError(f'{urdf}: joint {name!r} is not in the URDF')
    return chain, [
        *(f'joint {name!r} is not in the URDF: left out' for name in chain.unknown),
        *(f'joint {name!r} of the URDF is not recorded: assumed to stay at position zero'
          for name in chain.locked)]


def _with_links(recorded: list[Samples], arm: Arm) -> Samples:
    """Return a joint's recordings as one, with the torque of the links and all joints' motion."""
    samples = arm.with_signal(Samples.concatenate(recorded))
    # In the order along the arm, which that of a recording need not be.
    return samples.with_(arm=samples.arm and samples.arm.of(arm.joints))


def _with_arm(result: RefineResult, arm: Arm) -> RefineResult:
    """Return the result of a joint whose model has the arm, if it needs the arm's links."""
    # The model may be the given one, which stays as it is.
    own = result.model.arm
    if any('rigid_body' in effect.needs for effect in result.model.effects):
        own = replace(arm, friction=own if own and own.signal == 'coupling' else None)
    return replace(result, model=replace(result.model, arm=own))


def _add_person_torque(samples: Samples, drive: Drive) -> Samples:
    """Return samples with the torque of a person who carries the links added to the current."""
    share = Problem(samples, drive).load_coefficient
    if not share:
        return samples
    return samples.with_(load=None, current=(
        samples.current - share * np.nan_to_num(np.asarray(samples.load))))


def _at_common_times(recorded: dict[str, list[Samples]]) -> list[Samples]:
    parts: list[list[Samples]] = [[] for _ in recorded]
    for joint_samples in zip(*recorded.values()):
        common = joint_samples[0].time
        for samples in joint_samples[1:]:
            common = np.intersect1d(common, samples.time, assume_unique=True)
        if len(common) < 0.5 * min(map(len, joint_samples)):
            raise InputError('the joints are hardly ever recorded together: '
                             f'{len(common)} joint states hold all of them')
        for part, samples in zip(parts, joint_samples):
            part.append(samples.take(np.searchsorted(samples.time, common)))
    return [replace(Samples.concatenate(part), joint=name) for name, part in zip(recorded, parts)]
