# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits an arm's links to recordings, with friction and rotor inertia of every joint.

The measured current of joint j is taken as ``k_j·τ_j(q, v, a; π) + offset + C·sign(v) + V·v + J·a``
with the torque τ of the rigid bodies, linear in the links' parameters π (Atkeson, An and Hollerbach
1986), and a current per torque k_j, since an arm's drive constants are seldom known. π is the same
for all joints: the shoulder carries the weight that the wrist shows. Parameters that the motion
does not show keep the URDF's values, and every π is physically possible.

The fit needs only sums of products of these columns over stretches of the recordings. Every choice
(filter, mounting, regularisation) is made by the error of stretches that were left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
import math
from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.arm.arm import moving_states
from friction_comp.model.arm.tree import FREE_FALL, PARAMETERS, Tree
from friction_comp.model.differentiation import METHOD
from friction_comp.rigid_bodies.link_inertia import Bodies
from friction_comp.rigid_bodies.solver import (
    FOLDS,
    FRICTION,
    link_intervals,
    LinkIntervals,
    Prior,
    solve,
    squared_errors,
    stretches_of,
    Sums,
    sums_of,
    Unknowns,
)
from friction_comp.samples import Samples

if TYPE_CHECKING:
    from friction_comp.rigid_bodies.urdf import Chain

FEWEST = 200
# Regularisation strengths that are compared, and the one used for all other choices. One unit is
# one squared standard deviation of one sample.
STRENGTHS = tuple(float(value) for value in np.geomspace(1.0, 1e6, 13))
_FIRST_STRENGTH = 100.0
# Held-out errors that differ by less are considered equal; the URDF is preferred then.
_EQUAL_ERRORS = 0.01
# A direction of gravity other than that of the URDF must lower errors by this share.
_CLEARLY_BETTER = 0.15
# Least share of a joint's current that friction explains where its sign is judged.
_LEAST_FRICTION = 0.1
_ROUNDS = 3
_MOST_ROWS = {'choice': 8000, 'final': 40000}
_BANDWIDTHS = (2.0, 5.0, 10.0, 20.0, 40.0)
# Standard deviation of the logarithm of current per torque: drives of one arm differ by a factor.
# Where they are declared, links are fitted with the declared values; errors of these appear in the
# joint's own refinement, where the torque of the rigid bodies has a free coefficient.
_UNKNOWN_WIDTH, _DECLARED_WIDTH = 1.0, 1e-3


@dataclass(frozen=True)
class HeldOutStretch:
    """A stretch of a recording, from a time in s on, and the arm fitted without it."""

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
    # (J, 4): offset A, Coulomb A, viscous A·s/rad and rotor A·s²/rad, as the fit needs them.
    friction: np.ndarray
    differentiation: dict[str, Any]  # how velocity and acceleration are computed from position
    strength: float  # of the regularisation
    held_out: np.ndarray  # (J,): RMS error in A on stretches not fitted
    without: np.ndarray  # (J,): that of friction and rotor inertia alone
    identifiable: int  # number of combinations of the links' parameters that the motion shows
    held_out_stretches: list[HeldOutStretch]  # every stretch, with the tree fitted without it
    intervals: LinkIntervals  # how well the links and the currents per torque are known

    def torque(self, samples: Samples) -> np.ndarray:
        """Return the torque in N·m of the links on a joint, shape (N,).

        The torque in each stretch of a recording is that of links fitted without this stretch, so
        that predictions there are not fitted to it. The samples, of one joint with `arm`, have the
        `recording` numbers of the fit.
        """
        motion = moving_states(samples, self.tree.joints, self.differentiation)
        joint_index = self.tree.joints.index(samples.joint)
        stretch = np.full(len(samples), -1)
        for index, part in enumerate(self.held_out_stretches):
            stretch[(samples.recording == part.recording) & (samples.time >= part.start)] = index
        total = self.tree.torques(*motion)[:, joint_index]
        for index, part in enumerate(self.held_out_stretches):
            rows = stretch == index
            # The scale of the links is only determined up to that of the current per torque.
            ratio = part.scales[joint_index] / self.scales[joint_index]
            total[rows] = ratio * part.tree.torques(*(x[rows] for x in motion))[:, joint_index]
        return total


def fit_arm(chain: Chain, joints: list[Samples], declared: np.ndarray | None = None,
            progress: Callable[..., Any] | None = None) -> ArmFit:
    """Fit an arm to recordings.

    Parameters
    ----------
    chain : Chain
        Of the URDF.
    joints : list of Samples, length J
        As recorded, all on one time base and with `arm`, in the order of `chain.tree.joints`.
    declared : ndarray, shape (J,), optional
        Current per torque in A per N·m where torque constant and gear ratio are known.
    progress : callable, optional
        Called with a share of the work done.

    Raises
    ------
    InputError
        If there is too little motion to fit anything.
    """
    report = progress or (lambda share: None)
    if [one.joint for one in joints] != list(chain.tree.joints) or any(
            len(one) != len(joints[0]) or np.any(one.time != joints[0].time) for one in joints):
        raise InputError('the joints of an arm must be those of the URDF, on one time base')
    if len(joints[0]) < FEWEST:
        raise InputError(f'{len(joints[0])} samples are too few for an arm: at least {FEWEST} '
                         'are needed')
    bodies = Bodies(chain.tree.parameters)
    best = _best_settings(chain, joints, bodies, declared, lambda share: report(0.5 * share))
    chain, (_, settings, problem, prior, x) = _with_gravity_direction(
        chain, joints, bodies, best, declared)
    report(0.7)
    prior, errors = _choose_strength(problem, prior, x)
    parts = [solve(problem.total - own, prior, x) for own in problem.folds]
    report(0.8)
    links = len(joints) * PARAMETERS
    still = problem.sums.copy()
    still[..., :links, :] = still[..., :links] = 0.0
    without = _held_out(replace(problem, sums=still), prior, x)
    whole = sums_of(chain, joints, settings, _MOST_ROWS['final'])
    whole, x = _reweighted_fit(whole, prior, x)
    report(1.0)
    unknowns = Unknowns(len(joints))

    def tree_of(numbers: np.ndarray) -> tuple[Tree, np.ndarray]:
        return (replace(chain.tree, parameters=bodies.parameters(numbers[unknowns.links])[0]),
                np.exp(numbers[unknowns.scales]))
    first = np.nonzero(np.diff(stretches_of(joints[0].recording), prepend=-1))[0]
    held_out_stretches = [
        HeldOutStretch(int(joints[0].recording[row]), float(joints[0].time[row]),
                       *tree_of(parts[index % FOLDS])) for index, row in enumerate(first)]
    tree, scales = tree_of(x)
    return ArmFit(
        tree, chain.tree, scales,
        np.array([x[unknowns.friction(j)] for j in range(len(joints))]), settings,
        prior.strength, errors, without,
        identifiable(whole.total[:, :links, :links].sum(axis=0)), held_out_stretches,
        link_intervals(whole.sums, prior, x))


class _Trial(NamedTuple):
    """A fit and its error, the mean logarithm of its held-out errors; infinite without a fit."""

    error: float
    settings: dict[str, Any]
    problem: Sums
    prior: Prior
    x: np.ndarray


def _best_settings(
        chain: Chain, joints: list[Samples], bodies: Bodies, declared: np.ndarray | None,
        report: Callable[[float], None]) -> _Trial:
    """Return the trial with the differentiation settings of the lowest error."""
    trials, choices = [], _settings(joints)
    for settings in choices:
        trials.append(_trial(chain, joints, settings, bodies, declared))
        report(len(trials) / len(choices))
    return min(trials, key=lambda trial: trial.error)


def _trial(
        chain: Chain, joints: list[Samples], settings: dict[str, Any], bodies: Bodies,
        declared: np.ndarray | None) -> _Trial:
    """Return a fit with some differentiation settings; its error is infinite if it is impossible.

    That is if the URDF's torque has the wrong sign at every joint.
    """
    problem = sums_of(chain, joints, settings, _MOST_ROWS['choice'])
    usual = _typical_scale(problem, bodies)
    known = (np.log(declared), _DECLARED_WIDTH) if declared is not None else (
        np.full(len(joints), np.log(usual or 1.0)), _UNKNOWN_WIDTH)
    prior = Prior(bodies, _FIRST_STRENGTH, *known)
    unknowns = Unknowns(len(joints))
    x = np.zeros(unknowns.size)
    x[unknowns.scales] = prior.log_scale
    if usual is None:
        return _Trial(math.inf, settings, problem, prior, x)
    problem, x = _reweighted_fit(problem, prior, x)
    error = float(np.mean(np.log(_held_out(problem, prior, x))))
    return _Trial(error, settings, problem, prior, x)


def _with_gravity_direction(chain: Chain, joints: list[Samples], bodies: Bodies, best: _Trial,
                            declared: np.ndarray | None) -> tuple[Chain, _Trial]:
    """Return the arm with gravity in the direction that the recording shows, and its trial.

    An arm may be mounted on a wall or a ceiling, which its URDF does not tell. Another direction
    than the URDF's is used only if it lowers the held-out error clearly.
    """
    settings = best.settings if best.error < math.inf else _settings(joints)[-1]
    trials = []
    for direction in product((-1.0, 0.0, 1.0), repeat=3):
        length = np.linalg.norm(direction)
        if 0.0 < length < 1.5:
            turned = chain.with_gravity(np.array(direction) * np.linalg.norm(FREE_FALL) / length)
            trials.append((_trial(turned, joints, settings, bodies, declared), turned))
    other, mounted = min(trials, key=lambda trial: trial[0].error)
    if other.error == math.inf:
        raise InputError('the currents go against what the URDF says of every joint: it is the '
                         'URDF of another robot')
    if other.error >= best.error - _CLEARLY_BETTER:
        return chain, best
    return mounted, _best_settings(mounted, joints, bodies, declared, lambda share: None)


def identifiable(products: np.ndarray) -> int:
    """Return the number of base parameters: combinations that joint torques show.

    `products`, shape (10·J, 10·J), are the sums of products of the links' columns. It is the number
    of singular values of the normalised columns above 1e-6 of the largest.
    """
    norm = np.sqrt(np.diag(products))
    seen = norm > 1e-9 * max(norm.max(), 1e-300)
    scaled = products[np.ix_(seen, seen)] / norm[seen] / norm[seen, None]
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(scaled), 0.0))
    return int(np.count_nonzero(values > 1e-6 * values.max(initial=0.0)))


def _settings(joints: list[Samples]) -> list[dict[str, Any]]:
    step = max(joints[0].sample_time, 1e-9)
    narrow = [value for value in _BANDWIDTHS if value <= 0.3 / step]
    sources = ['position']
    arm = joints[0].arm
    velocity = None if arm is None else arm.velocity
    if velocity is not None and np.any(velocity, axis=0).all():
        sources.append('velocity')
    return [{'method': METHOD, 'source': source, 'bandwidth': value}
            for source in sources for value in [*narrow, None]]


def _typical_scale(problem: Sums, bodies: Bodies) -> float | None:
    """Return the current per torque, A per N·m, with which the URDF's values fit the arm best.

    It is the weighted median over the joints; None if it is positive for none of them.
    """
    scales, sizes, resisting = [], [], []
    known = bodies.known.ravel()
    for matrix in problem.total[problem.counts > 0.0]:
        # The URDF's torque, friction and the current.
        pick = np.zeros((len(matrix), FRICTION + 2))
        pick[:known.size, 0] = known
        pick[known.size:, 1:] = np.eye(FRICTION + 1)
        own = pick.T @ matrix @ pick
        norm = np.sqrt(np.maximum(np.diag(own), 0.0)) + 1e-300
        own = own / norm / norm[:, None]
        coefficients = np.linalg.pinv(own[:-1, :-1], rcond=1e-12, hermitian=True) @ own[:-1, -1]
        if own[-1, -1] > 0.0:
            # As a share of the current; below, the joint stood still or had no friction.
            sliding = math.sqrt(max(coefficients[2:4] @ own[2:4, 2:4] @ coefficients[2:4], 0.0))
            if sliding > _LEAST_FRICTION:
                resisting.append(coefficients[2] / norm[2] + coefficients[3] / norm[3] > 0.0)
        if coefficients[0] > 0.0:
            scales.append(math.log(coefficients[0] * norm[-1] / norm[0]))
            sizes.append(coefficients[0])
    if resisting and np.mean(resisting) < 0.5:
        raise InputError('the efforts push the joints along as they move: their sign is not that '
                         'of the positions')
    if not scales:
        return None
    # Joints that carry large loads determine it best.
    order = np.argsort(scales)
    share = np.cumsum(np.array(sizes)[order]) / max(sum(sizes), 1e-300)
    return float(np.exp(np.array(scales)[order][int(np.searchsorted(share, 0.5))]))


def _reweighted_fit(problem: Sums, prior: Prior, x: np.ndarray) -> tuple[Sums, np.ndarray]:
    """Return the fit, and its problem with each joint weighted by the inverse residual variance."""
    for _ in range(_ROUNDS):
        x = solve(problem.total, prior, x)
        residual = squared_errors(problem.total, prior.bodies, x) / np.maximum(problem.counts, 1.0)
        residual = np.maximum(residual, 1e-24)
        problem = Sums(problem.sums / residual[:, None, None], problem.variance * residual,
                       problem.counts)
    return problem, x


def _held_out(problem: Sums, prior: Prior, x: np.ndarray) -> np.ndarray:
    """Return each joint's RMS error in A on stretches that were not fitted, shape (J,)."""
    total, sums = problem.total, np.zeros(len(problem.counts))
    for own in problem.folds:
        sums += squared_errors(own, prior.bodies, solve(total - own, prior, x))
    return np.sqrt(sums * problem.variance / np.maximum(problem.counts, 1.0)) + 1e-12


def _choose_strength(problem: Sums, prior: Prior, x: np.ndarray) -> tuple[Prior, np.ndarray]:
    """Return the prior with the largest strength that predicts as well as the best."""
    trials = []
    for strength in STRENGTHS:
        trial = replace(prior, strength=strength)
        errors = _held_out(problem, trial, x)
        trials.append((float(np.mean(np.log(errors))), trial, errors))
    least = min(entry[0] for entry in trials)
    return [entry[1:] for entry in trials if entry[0] <= least + _EQUAL_ERRORS][-1]
