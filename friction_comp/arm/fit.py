# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits an arm's links to recordings, with friction, rotor inertia and effects of every joint.

The measured current of joint j is modelled as
``k_j·τ_j(q, v, a; π) + offset + C·sign(v) + V·v + J·a + …``, where … are the effects that
`friction_comp.arm.beside` finds. The torque τ of the rigid bodies is linear in the links' inertial
parameters π (Atkeson, An and Hollerbach 1986). The current per torque k_j is fitted too, since an
arm's drive constants are seldom known. All joints share one π: the wrist's motion, for instance,
also shows a weight that the shoulder carries. Parameters that the motion does not determine keep
the URDF's values, and every π is physically possible.

The fit needs only sums of products of these columns over stretches of the recordings. All settings
(filter, mounting, regularisation) are chosen by the error on stretches that were left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
import math
from typing import Any, NamedTuple

import numpy as np

from friction_comp.arm import solver
from friction_comp.arm.beside import Beside, columns_of, JointTerm, signs_at
from friction_comp.arm.solver import Bodies, LinkIntervals, Prior, Sums
from friction_comp.arm.urdf import Chain
from friction_comp.errors import InputError
from friction_comp.model.arm import FREE_FALL, moving_states, PARAMETERS, Tree
from friction_comp.parallel import one_thread
from friction_comp.refinement.prepare import candidate_settings
from friction_comp.samples import Samples

FEWEST = 200  # samples
# Regularisation strengths that are compared, and the one used for all other choices, in squared
# standard deviations of one sample.
STRENGTHS = tuple(float(value) for value in np.geomspace(1.0, 1e6, 13))
_FIRST_STRENGTH = 100.0
# Relative difference of held-out errors up to which they are equal, and the URDF is preferred.
_EQUAL_ERRORS = 0.01
# Share by which another direction of gravity than the URDF's, or other scales than those assumed,
# must lower the errors.
_CLEARLY_BETTER = 0.15
_MOST_DIRECTIONS = 3
# Least share of a joint's current that friction must explain for its sign to be judged.
_LEAST_FRICTION = 0.1
_ROUNDS = 3  # of reweighting
_MOST_ROWS = {'choice': 8000, 'final': 40000}
_BANDWIDTHS = (2.0, 5.0, 10.0, 20.0, 40.0)
# Prior standard deviation of the logarithm of current per torque. If unknown, it is large, since
# drives of one arm differ. If declared, the links are fitted with the declared values; their errors
# appear in the joint's own refinement, where the rigid bodies' torque has a free coefficient.
_UNKNOWN_WIDTH, _DECLARED_WIDTH = 1.0, 1e-3


@dataclass(frozen=True)
class HeldOutStretch:
    """A stretch of a recording from `start` (s) on, and the arm fitted without it."""

    recording: int
    start: float
    tree: Tree
    scales: np.ndarray


@dataclass
class ArmFit:
    """An arm's rigid bodies fitted to recordings."""

    tree: Tree  # with the fitted parameters
    start: Tree  # with those of the URDF
    scales: np.ndarray  # (J,): current per torque of each joint, A per N·m
    # (J, 4): offset (A), Coulomb (A), viscous (A·s/rad) and rotor inertia (A·s²/rad).
    friction: np.ndarray
    differentiation: dict[str, Any]  # how velocity and acceleration are computed from position
    strength: float  # of the regularisation
    held_out: np.ndarray  # (J,): RMS error in A on stretches not fitted
    without: np.ndarray  # (J,): the same for a fit without the links, only friction and rotor
    identifiable: int  # number of combinations of the links' parameters that the motion determines
    held_out_stretches: list[HeldOutStretch]  # every stretch, with the tree fitted without it
    intervals: LinkIntervals  # of the links and the currents per torque
    declared: bool  # whether the currents per torque are those given

    def torque(self, samples: Samples) -> np.ndarray:
        """Return the torque in N·m of the links on a joint, shape (N,), fitted to other stretches.

        The samples are those of one joint with `arm` and the `recording` numbers of the fit.
        """
        motion = moving_states(samples, self.tree.joints, self.differentiation)
        joint_index = self.tree.joints.index(samples.joint)
        stretch = np.full(len(samples), -1)
        for index, part in enumerate(self.held_out_stretches):
            stretch[(samples.recording == part.recording) & (samples.time >= part.start)] = index
        total = self.tree.torques(*motion)[:, joint_index]
        for index, part in enumerate(self.held_out_stretches):
            rows = stretch == index
            # Each fit has its own current per torque: convert to that of the whole fit.
            ratio = part.scales[joint_index] / self.scales[joint_index]
            total[rows] = ratio * part.tree.torques(*(x[rows] for x in motion))[:, joint_index]
        return total


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
            best = free.best(lambda share: report(0.4 + 0.1 * share))
    problem, best = _with_gravity_direction(problem, best)
    report(0.7)
    sums, x = best.sums, best.x
    prior, errors = _choose_strength(sums, best.prior, x)
    parts = [solver.solve(sums.total - own, prior, x) for own in sums.folds]
    report(0.8)
    links = len(joints) * PARAMETERS
    no_links = sums.sums.copy()
    no_links[..., :links, :] = no_links[..., :links] = 0.0
    without = _held_out(replace(sums, sums=no_links), prior, x)
    rows = solver.rows_of(problem.chain, joints, best.settings, _MOST_ROWS['final'])
    whole = rows.sums(columns_of(rows, best.tree, best.terms)[0])
    whole, x = _reweighted_fit(whole, prior, x)
    report(1.0)
    first = np.nonzero(np.diff(solver.stretches_of(joints[0].recording), prepend=-1))[0]
    held_out_stretches = [
        HeldOutStretch(int(joints[0].recording[row]), float(joints[0].time[row]), *problem.arm_of(
            parts[index % solver.FOLDS])) for index, row in enumerate(first)]
    tree, scales = problem.arm_of(x)
    return ArmFit(
        tree=tree, start=chain.tree, scales=scales,
        friction=prior.friction(x)[:, :solver.FRICTION], differentiation=best.settings,
        strength=prior.strength, held_out=errors, without=without,
        identifiable=identifiable(whole.total[:, :links, :links].sum(axis=0)),
        held_out_stretches=held_out_stretches,
        intervals=solver.confidence_intervals(whole.sums, prior, x),
        declared=problem.declared is not None)


class _Trial(NamedTuple):
    """A fit with some settings; `error` is the mean logarithm of the joints' held-out errors."""

    error: float
    settings: dict[str, Any]
    terms: list[JointTerm]  # beside the links
    sums: Sums
    prior: Prior
    x: np.ndarray
    tree: Tree


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

    def prepared(self, settings: dict[str, Any], terms: list[JointTerm] | None = None,
                 tree: Tree | None = None) -> _Trial:
        """Return what a fit needs; its error is infinite if the URDF's torques have wrong signs."""
        tree, terms = tree or self.chain.tree, terms or []
        rows = solver.rows_of(self.chain, self.joints, settings, _MOST_ROWS['choice'])
        columns, indices = columns_of(rows, tree, terms)
        sums = rows.sums(columns)
        typical = _typical_scale(sums, self.bodies)
        scale = np.full(len(self.joints), typical or 1.0)
        prior = Prior(
            self.bodies, _FIRST_STRENGTH, np.log(scale if self.declared is None else self.declared),
            _UNKNOWN_WIDTH if self.declared is None else _DECLARED_WIDTH,
            signs_at(indices, len(self.joints)))
        error = math.inf if typical is None else 0.0
        return _Trial(error, settings, terms, sums, prior, prior.mean, tree)

    def trial(self, settings: dict[str, Any], terms: list[JointTerm] | None = None,
              tree: Tree | None = None, start: np.ndarray | None = None) -> _Trial:
        """Return a fit with its held-out error; `start` is one with the same terms."""
        trial = self.prepared(settings, terms, tree)
        if trial.error == math.inf:
            return trial
        sums, x = _reweighted_fit(trial.sums, trial.prior, trial.x if start is None else start)
        error = float(np.mean(np.log(_held_out(sums, trial.prior, x))))
        return trial._replace(error=error, sums=sums, x=x)

    def first_error(self, settings: dict[str, Any]) -> float:
        """Return the mean logarithm of the joints' errors of a fit to all, without weights."""
        trial = self.prepared(settings)
        if trial.error == math.inf:
            return math.inf
        total, prior = trial.sums.total, trial.prior
        errors = solver.squared_errors(total, prior, solver.solve(total, prior, trial.x))
        return 0.5 * float(np.mean(np.log(errors + 1e-24)))

    def best(self, report: Callable[[float], None] = lambda share: None) -> _Trial:
        """Return the fit with the best settings; effects are searched before and after."""
        trials, choices = [], _settings(self.joints)
        first = self.with_effects(self.trial(choices[min(1, len(choices) - 1)]), 1)
        for settings in choices:
            trials.append(self.trial(settings, first.terms, first.tree, first.x))
            report(len(trials) / len(choices))
        return self.with_effects(min(trials, key=lambda trial: trial.error))

    def with_effects(self, trial: _Trial, rounds: int = _ROUNDS) -> _Trial:
        """Return a fit of links and effects in turn, until a round finds the same effects."""
        if trial.error == math.inf:
            return trial
        rows = solver.rows_of(self.chain, self.joints, trial.settings, _MOST_ROWS['choice'])
        for _ in range(rounds):
            before = trial.terms
            links, _ = self.arm_of(trial.x)
            terms = Beside(rows, links, trial.prior, trial.x, trial.sums.variance).search(before)
            if terms != before:
                trial = self.trial(trial.settings, terms, links)
            if [term.choice for term in terms] == [term.choice for term in before]:
                break
        return trial


def _with_gravity_direction(problem: _Problem, best: _Trial) -> tuple[_Problem, _Trial]:
    """Return the arm with the direction of gravity that fits the recording best, and its trial.

    An arm may be mounted on a wall or a ceiling, which its URDF does not say.
    """
    settings = best.settings if best.error < math.inf else _settings(problem.joints)[-1]
    turned = []
    for direction in product((-1.0, 0.0, 1.0), repeat=3):
        length = np.linalg.norm(direction)
        if 0.0 < length < 1.5:
            turned.append(replace(problem, chain=problem.chain.with_gravity(
                np.array(direction) * np.linalg.norm(FREE_FALL) / length)))
    # The problems have the same columns: try only those with the least errors of a first fit.
    turned.sort(key=lambda one: one.first_error(settings))
    trials = [(one.trial(settings), one) for one in turned[:_MOST_DIRECTIONS]]
    other, mounted = min(trials, key=lambda trial: trial[0].error)
    if other.error == math.inf:
        raise InputError('the currents contradict the torques of the URDF at every joint: it is '
                         'the URDF of another robot')
    if other.error >= best.error - _CLEARLY_BETTER:
        return problem, best
    return mounted, mounted.best()


def identifiable(products: np.ndarray) -> int:
    """Return the number of combinations of parameters that the joint torques determine.

    `products`, shape (10·J, 10·J), are the sums of products of the links' columns.
    """
    norm = np.sqrt(np.diag(products))
    seen = norm > 1e-9 * max(norm.max(), 1e-300)
    scaled = products[np.ix_(seen, seen)] / norm[seen] / norm[seen, None]
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(scaled), 0.0))
    return int(np.count_nonzero(values > 1e-6 * values.max(initial=0.0)))


def _settings(joints: list[Samples]) -> list[dict[str, Any]]:
    arm = joints[0].arm
    return candidate_settings(joints[0], None if arm is None else arm.velocity, _BANDWIDTHS)


def _typical_scale(problem: Sums, bodies: Bodies) -> float | None:
    """Return the weighted median of the joints' currents per torque, A per N·m, if any."""
    scales, sizes, resisting = [], [], []
    links = bodies.prior.ravel()
    for matrix in problem.total[problem.counts > 0.0]:
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
            if friction > _LEAST_FRICTION:
                resisting.append(coefficients[2] / norm[2] + coefficients[3] / norm[3] > 0.0)
        if coefficients[0] > 0.0:
            scales.append(math.log(coefficients[0] * norm[-1] / norm[0]))
            sizes.append(coefficients[0])
    if resisting and np.mean(resisting) < 0.5:
        raise InputError('friction in the efforts drives the joints instead of resisting: efforts '
                         'have the opposite sign of positions')
    if not scales:
        return None
    # Joints that carry large loads determine the scale best, so they weigh more.
    order = np.argsort(scales)
    share = np.cumsum(np.array(sizes)[order]) / max(sum(sizes), 1e-300)
    return float(np.exp(np.array(scales)[order][int(np.searchsorted(share, 0.5))]))


def _reweighted_fit(problem: Sums, prior: Prior, x: np.ndarray) -> tuple[Sums, np.ndarray]:
    """Fit with each joint weighted by its inverse residual variance; return problem and fit."""
    for _ in range(_ROUNDS):
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


def _choose_strength(problem: Sums, prior: Prior, x: np.ndarray) -> tuple[Prior, np.ndarray]:
    """Return the prior with the largest strength that predicts as well as the best, and errors."""
    priors = [replace(prior, strength=strength) for strength in STRENGTHS]
    trials = [(trial, _held_out(problem, trial, x)) for trial in priors]
    sizes = [float(np.mean(np.log(errors))) for _, errors in trials]
    return [trial for trial, size in zip(trials, sizes) if size <= min(sizes) + _EQUAL_ERRORS][-1]
