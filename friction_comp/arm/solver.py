# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits links, currents per torque and friction of all joints by regularised least squares.

A recording is represented by sums of products of columns over stretches: the columns of the links'
parameters, of each joint's friction, rotor and further effects, and its current. The model is
nonlinear only in the parametrisation of the links and in the currents per torque, so the
Levenberg-Marquardt method needs nothing but these sums.

The ten parameters of a link are, in this order, its mass m, its first moment m·c (three), and the
entries Ixx, Ixy, Iyy, Ixz, Iyz, Izz of its inertia about the origin of its joint's frame. They
belong to a body of positive density exactly where the pseudo-inertia, the 4 by 4 matrix
``[[Σ, m·c], [m·cᵀ, m]]`` with ``Σ = ½·tr(I)·1 - I``, is positive definite (Wensing, Kim and
Slotine 2018, Eq. 17). Here it is written ``L·U·Uᵀ·Lᵀ`` with the Cholesky factor L of a prior and an
upper triangular U with exponentials on its diagonal (Rucker and Wensing 2022). Any ten values of
its entries give a possible body, ten zeros give the prior, and their norm is a distance from the
prior that does not depend on units and frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from friction_comp.arm.urdf import Chain
from friction_comp.model.arm import moving_states, PARAMETERS
from friction_comp.samples import Samples
from friction_comp.statistics import student_quantile

# Columns of a joint's friction and rotor: constant, Coulomb, viscous and acceleration; and which of
# their coefficients must not be negative.
FRICTION, FRICTION_SIGNS = 4, (0, 1, 1, 1)
STRETCHES, FOLDS = 12, 3
# Weight of the squared distance between a link and the URDF's (see `Bodies`), in squared standard
# deviations of one sample.
_STRENGTH = 100.0
_UPPER = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]


def pseudo_inertia(parameters: ArrayLike) -> np.ndarray:
    """Return the pseudo-inertia, shape (4, 4), of a link with ten parameters."""
    m, x, y, z, xx, xy, yy, xz, yz, zz = np.asarray(parameters, dtype=float).tolist()
    half = 0.5 * (xx + yy + zz)
    return np.array([[half - xx, -xy, -xz, x], [-xy, half - yy, -yz, y],
                     [-xz, -yz, half - zz, z], [x, y, z, m]])


def parameters_of(pseudo: np.ndarray) -> np.ndarray:
    """Return the ten parameters of a pseudo-inertia; leading axes are kept."""
    trace = pseudo[..., 0, 0] + pseudo[..., 1, 1] + pseudo[..., 2, 2]
    return np.stack([
        pseudo[..., 3, 3], pseudo[..., 0, 3], pseudo[..., 1, 3], pseudo[..., 2, 3],
        trace - pseudo[..., 0, 0], -pseudo[..., 0, 1], trace - pseudo[..., 1, 1],
        -pseudo[..., 0, 2], -pseudo[..., 1, 2], trace - pseudo[..., 2, 2]], axis=-1)


def nearest_possible(parameters: ArrayLike) -> np.ndarray:
    """Return the ten parameters with mass and extent raised as far as a possible body needs."""
    pseudo = pseudo_inertia(parameters)
    # In kg and m: many URDFs have massless links that only define frames.
    mass = max(pseudo[3, 3], 1e-3)
    centre = pseudo[:3, 3] / mass
    # Second moments about the centre of mass, which describe the link's extent.
    spread = pseudo[:3, :3] - mass * np.outer(centre, centre)
    sizes, axes = np.linalg.eigh(spread)
    largest = max(float(sizes[-1]), mass * 1e-3 ** 2)
    sizes = np.maximum(sizes, 1e-2 * largest)
    result = np.empty((4, 4))
    result[:3, :3] = (axes * sizes) @ axes.T + mass * np.outer(centre, centre)
    result[:3, 3] = result[3, :3] = mass * centre
    result[3, 3] = mass
    return parameters_of(result)


class Bodies:
    """The links' parameters as functions of ten coordinates per link, zeros at a prior (L, 10)."""

    def __init__(self, prior: ArrayLike) -> None:
        self.prior = np.array([nearest_possible(row) for row in np.asarray(prior, dtype=float)])
        self._root = np.array([np.linalg.cholesky(pseudo_inertia(row)) for row in self.prior])

    def parameters(self, coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the parameters, shape (L, 10), at coordinates of shape (10·L,).

        Also return the derivatives, shape (L, 10, 10), of each link's parameters (second axis) with
        respect to its coordinates (third axis).
        """
        # The pseudo-inertia is root @ upper @ upper.T @ root.T: positive definite at any values.
        own = np.reshape(coordinates, (-1, PARAMETERS))
        upper = np.zeros((len(own), 4, 4))
        changes = np.zeros((len(own), PARAMETERS, 4, 4))
        for k in range(4):
            upper[:, k, k] = changes[:, k, k, k] = np.exp(np.clip(own[:, k], -30.0, 30.0))
        for k, (row, column) in enumerate(_UPPER, start=4):
            upper[:, row, column] = own[:, k]
            changes[:, k, row, column] = 1.0
        factor = self._root @ upper
        transposed = factor.transpose(0, 2, 1)
        half_slopes = self._root[:, None] @ changes @ transposed[:, None]
        slopes = parameters_of(half_slopes + half_slopes.transpose(0, 1, 3, 2))
        return parameters_of(factor @ transposed), slopes.transpose(0, 2, 1)


@dataclass
class Sums:
    """Sums of products of all columns over stretches of the recordings."""

    # (S, J, 10·J + F + 1, 10·J + F + 1): for each stretch and joint, of the columns of the links,
    # of friction and further effects (F), and of the current, in units of `variance`.
    sums: np.ndarray
    variance: np.ndarray  # (J,): one unit of each joint's squared error, A²
    counts: np.ndarray  # (J,): number of samples

    @property
    def total(self) -> np.ndarray:
        """The sums over all stretches."""
        return np.asarray(self.sums.sum(axis=0))

    @property
    def folds(self) -> np.ndarray:
        """The sums over the stretches of each fold, with the shape of `sums` of F stretches."""
        fold = np.arange(len(self.sums)) % FOLDS
        return np.array([self.sums[fold == index].sum(axis=0) for index in range(FOLDS)])


@dataclass(frozen=True)
class ArmRows:
    """N samples of all J joints at the same times."""

    samples: list[Samples]  # of each joint, with velocity and acceleration
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]  # position, velocity, acceleration, (N, J)
    fitted: np.ndarray  # (N, J): which samples of each joint show friction
    moves: np.ndarray  # (J,): whether the joint moves often enough for that
    stretch: np.ndarray  # (N,)
    chain: Chain

    @functools.cached_property
    def _own(self) -> np.ndarray:
        """The columns of links, friction, rotor and current, (N, J, 10·J + FRICTION + 1)."""
        _, v, a = self.motion
        return np.concatenate((self.chain.regressor(*self.motion), np.stack(
            (np.ones_like(v), np.tanh(v / (0.03 * top_speeds(v))), v, a,
             np.column_stack([one.current for one in self.samples])), axis=2)), axis=2)

    @functools.cached_property
    def _variance(self) -> np.ndarray:
        return np.maximum(np.var(self._own[:, :, -1], axis=0), 1e-12)

    def columns(self, others: Sequence[np.ndarray]) -> np.ndarray:
        """Return all columns of each joint, shape (N, J, 10·J + F + 1); see `Sums`.

        `others` are those of each joint beside links, friction and rotor, (N, M), with any M.
        """
        beside = np.zeros((*self.fitted.shape, max(part.shape[1] for part in others)))
        for joint, part in enumerate(others):
            beside[:, joint, :part.shape[1]] = part
        return np.concatenate((self._own[:, :, :-1], beside, self._own[:, :, -1:]), axis=2)

    def sums(self, others: Sequence[np.ndarray]) -> Sums:
        """Return the sums of products of `columns(others)`."""
        columns = self.columns(others)
        weighted = columns * (self.fitted / self._variance)[:, :, None]
        stretches = [self.stretch == index for index in range(int(self.stretch.max()) + 1)]
        return Sums(np.array([
            weighted[part].transpose(1, 2, 0) @ columns[part].transpose(1, 0, 2)
            for part in stretches]), self._variance, self.fitted.sum(axis=0).astype(float))


def top_speeds(velocity: np.ndarray) -> np.ndarray:
    """Return the usual top speed of each joint, shape (J,)."""
    return np.maximum(np.percentile(np.abs(velocity), 95, axis=0), 1e-9)


def rows_of(chain: Chain, joints: list[Samples], settings: dict[str, Any], most_rows: int
            ) -> ArmRows:
    """Return at most `most_rows` rows of recordings of all joints, with the motion of settings."""
    motion = moving_states(joints[0], chain.tree.joints, settings)
    rows = slice(None, None, max(1, len(joints[0]) // most_rows))
    q, v, a = motion = tuple(signal[rows] for signal in motion)  # type: ignore[assignment]
    samples = [one.take(rows).with_(position=q[:, k], velocity=v[:, k], acceleration=a[:, k])
               for k, one in enumerate(joints)]
    # At rest, stiction can take any value; but a joint that hardly ever moves has no other data.
    moving = np.abs(v) > 0.01 * top_speeds(v)
    moves = moving.mean(axis=0) > 0.2
    fitted = np.where(moves, moving, True)
    # An effort that is constant, such as zeros of a gripper, is not a measurement.
    fitted &= np.array([np.ptp(one.current) > 0.0 for one in samples])
    return ArmRows(samples, motion, fitted, moves, stretches_of(joints[0].recording)[rows], chain)


def stretches_of(recording: np.ndarray) -> np.ndarray:
    """Return the number of each sample's stretch, shape (N,); no stretch spans two recordings."""
    stretch = np.arange(len(recording)) * STRETCHES // max(len(recording), 1)
    run = np.cumsum(np.diff(recording, prepend=recording[:1]) != 0)
    # One number for each pair of stretch and recording, counted from 0.
    return np.unique(stretch + (STRETCHES + 1) * run, return_inverse=True)[1].reshape(-1)


@dataclass(frozen=True)
class Prior:
    """Prior knowledge of the unknowns, a vector of length U.

    These are the links' coordinates (see `Bodies`), the logarithms of current per torque, and each
    joint's coefficients of friction, rotor and further effects.
    """

    bodies: Bodies  # the URDF's links
    log_scale: np.ndarray  # (J,): logarithm of each joint's current per torque, A per N·m
    log_width: float  # standard deviation of `log_scale`
    # (J, F): 1 where a coefficient of friction or of another effect must not be negative, else 0.
    signs: np.ndarray

    @property
    def links(self) -> slice:
        """Which unknowns are links' coordinates."""
        return slice(0, PARAMETERS * len(self.log_scale))

    @property
    def scales(self) -> slice:
        """Which unknowns are logarithms of current per torque."""
        return slice(self.links.stop, self.links.stop + len(self.log_scale))

    @property
    def mean(self) -> np.ndarray:
        """The unknowns without recordings, (U,)."""
        return np.concatenate((
            np.zeros(self.links.stop), self.log_scale, np.zeros(self.signs.size)))

    @property
    def precision(self) -> np.ndarray:
        """The inverse of their variance, (U,)."""
        weights = [_STRENGTH, self.log_width ** -2, 0.0]
        return np.repeat(weights, [self.links.stop, len(self.log_scale), self.signs.size])

    @property
    def lowest(self) -> np.ndarray:
        """The least possible values, (U,)."""
        return np.where(np.concatenate((np.zeros(self.scales.stop), self.signs.ravel())) > 0,
                        0.0, -np.inf)

    def friction(self, x: np.ndarray) -> np.ndarray:
        """Return the coefficients of friction, rotor and further effects among unknowns, (J, F)."""
        return x[self.scales.stop:].reshape(self.signs.shape)


def linearised(prior: Prior, x: np.ndarray) -> np.ndarray:
    """Return, as combinations of each joint's columns, the derivatives of its current by unknowns.

    Shape (J, P, U + 1), with P columns of `Sums`; the last is the error of x.
    """
    parameters, slopes = prior.bodies.parameters(x[prior.links])
    joints, width = prior.signs.shape
    links, base = parameters.size, prior.scales.stop
    scales = np.exp(np.clip(x[prior.scales], -50.0, 50.0))
    combine = np.zeros((joints, links + width + 1, x.size + 1))
    for k, slope in enumerate(slopes):
        own = slice(PARAMETERS * k, PARAMETERS * (k + 1))
        combine[:, own, own] = scales[:, None, None] * slope
    combine[:, :links, -1] = -scales[:, None] * parameters.ravel()
    combine[:, links:-1, -1] = -prior.friction(x)
    combine[:, -1, -1] = 1.0
    for joint, own in enumerate(combine):
        own[:links, links + joint] = -own[:links, -1]
        own[links:-1, base + width * joint:base + width * (joint + 1)] = np.eye(width)
    return combine


def solve(matrices: np.ndarray, prior: Prior, start: np.ndarray) -> np.ndarray:
    """Return the unknowns, shape (U,), that fit each joint's sums (see `Sums.total`) best.

    Coefficients have the signs that the prior requires. Only links and scales are damped: the
    current is linear in all else. Damping follows from how well the step was predicted (Nielsen
    1999).
    """
    lowest = prior.lowest
    x = np.maximum(start, lowest)
    loss, gradient, hessian = loss_gradient_hessian(matrices, prior, x)
    damping, growth = _STRENGTH, 2.0
    for _ in range(60):
        free = ~((x <= lowest) & (gradient > 0.0))
        own = hessian[np.ix_(free, free)]
        damped = damping * (np.flatnonzero(free) < prior.scales.stop)
        # The trace keeps the system regular where a coefficient's column is 0.
        system = own + np.diag(damped + 1e-12 * np.trace(own) / len(own))
        trial = x.copy()
        trial[free] -= np.linalg.solve(system, gradient[free])
        trial = np.maximum(trial, lowest)
        after = loss_gradient_hessian(matrices, prior, trial)
        if np.isfinite(after[0]) and after[0] < loss:
            step, gain = (trial - x)[free], loss - after[0]
            predicted = max(-step @ (gradient[free] + 0.5 * own @ step), gain)
            x, (loss, gradient, hessian) = trial, after
            # In squared standard deviations of one sample.
            if gain < 0.05:
                break
            damping *= max(0.2, 1.0 - (2.0 * gain / predicted - 1.0) ** 3)
            growth = 2.0
        else:
            damping *= growth
            growth *= 2.0
            if damping > 1e12:
                break
    return x


def loss_gradient_hessian(matrices: np.ndarray, prior: Prior, x: np.ndarray
                          ) -> tuple[float, np.ndarray, np.ndarray]:
    """Return half the loss, its gradient and the Gauss-Newton matrix."""
    combine = linearised(prior, x)
    products = (combine.transpose(0, 2, 1) @ (matrices @ combine)).sum(axis=0)
    deviation, precision = x - prior.mean, prior.precision
    loss = products[-1, -1] + precision @ deviation ** 2
    return (0.5 * float(loss), precision * deviation - products[:-1, -1],
            products[:-1, :-1] + np.diag(precision))


def squared_errors(matrices: np.ndarray, prior: Prior, x: np.ndarray) -> np.ndarray:
    """Return each joint's sum of squared errors for unknowns x, shape (J,)."""
    error = linearised(prior, x)[:, :, -1]
    return np.maximum(np.einsum('jp,jpq,jq->j', error, matrices, error), 0.0)


@dataclass(frozen=True)
class LinkIntervals:
    """The 95 % intervals of the links' parameters and of the currents per torque."""

    parameters: np.ndarray  # (J, 10, 2): both ends, infinite where the value is the URDF's
    scales: np.ndarray  # (J, 2): both ends of each joint's current per torque, A per N·m
    # (J, 10): share by which the recording reduces the prior variance of a parameter: 0 if it does
    # not depend on it, near 1 if it alone determines the value.
    from_recording: np.ndarray


def confidence_intervals(stretches: np.ndarray, prior: Prior, x: np.ndarray) -> LinkIntervals:
    """Return the intervals of the fit `x`; `stretches` are the sums of each stretch (`Sums.sums`).

    A parameter that the prior determines more than the recording has no interval: the recording
    does not show how accurate the URDF is.
    """
    covariance = _covariance(stretches, prior, x)
    quantile = float(student_quantile(max(len(stretches) - 1, 2)))

    parameters, slopes = prior.bodies.parameters(x[prior.links])
    by_link = block_diag(*slopes)
    variance = np.einsum('ij,jk,ik->i', by_link, covariance[prior.links, prior.links],
                         by_link).reshape(parameters.shape)
    half_width = quantile * np.sqrt(np.maximum(variance, 0.0))
    bounds = np.stack((parameters - half_width, parameters + half_width), axis=-1)
    # A mass is positive, even if the linearised interval includes negative values.
    bounds[:, 0] = np.maximum(bounds[:, 0], 0.0)
    _, slopes_of_urdf = prior.bodies.parameters(np.zeros_like(x[prior.links]))
    prior_variance = np.sum(slopes_of_urdf ** 2, axis=2) / _STRENGTH
    from_recording = np.clip(1.0 - variance / np.maximum(prior_variance, 1e-300), 0.0, 1.0)
    bounds[from_recording < 0.5] = -np.inf, np.inf

    # The unknowns are the logarithms of the scales.
    scales = x[prior.scales]
    half_width = quantile * np.sqrt(np.maximum(np.diag(covariance)[prior.scales], 0.0))
    return LinkIntervals(bounds, np.exp(np.clip(
        np.stack((scales - half_width, scales + half_width), axis=-1), -50.0, 50.0)),
        from_recording)


def _covariance(stretches: np.ndarray, prior: Prior, x: np.ndarray) -> np.ndarray:
    """Return the covariance of the unknowns of a fit, (U, U); 0 of those at their limit.

    It is White's, clustered by stretches since successive errors are correlated (Liang and Zeger
    1986), plus the uncertainty of the prior.
    """
    _, _, hessian = loss_gradient_hessian(stretches.sum(axis=0), prior, x)
    gradients = np.array([loss_gradient_hessian(own, prior, x)[1] for own in stretches])
    # The prior has the same gradient in every stretch, which cancels with the mean.
    gradients -= gradients.mean(axis=0)
    free = x > prior.lowest
    count = len(stretches)
    inverse = np.linalg.pinv(hessian[np.ix_(free, free)], rcond=1e-13, hermitian=True)
    scatter = gradients[:, free].T @ gradients[:, free] * count / max(count - 1, 1)
    covariance = np.zeros_like(hessian)
    covariance[np.ix_(free, free)] = inverse @ (scatter + np.diag(prior.precision[free])) @ inverse
    return covariance
