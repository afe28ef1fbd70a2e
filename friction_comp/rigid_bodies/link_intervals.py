# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Intervals of link parameters, from the recording and the URDF together.

The effect of noise is computed from the scatter of the gradient between parts of the recording,
since successive errors are correlated (White's covariance, clustered by parts, Liang and Zeger
1986); the uncertainty left by the regularisation towards the URDF adds to it. A parameter that the
regularisation determines more than the recording is that of the URDF and has no interval: how well
the URDF's values are known cannot be seen in a recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from friction_comp.model.arm.tree import PARAMETERS
from friction_comp.rigid_bodies.solver import loss_gradient_hessian, Prior, Unknowns

_LEVEL = 0.95
# Share of the uncertainty of a parameter that the recording must remove for the value to be
# attributed to it.
_OWN = 0.5


@dataclass(frozen=True)
class LinkIntervals:
    """The 95 % intervals of the links' parameters and of what turns torque into current.

    Attributes
    ----------
    parameters : ndarray, shape (J, 10, 2)
        Lower and upper end: kg, kg·m, kg·m². Without end where the number is the URDF's.
    scales : ndarray, shape (J, 2)
        Of each joint's current per torque, A per N·m.
    told : ndarray, shape (J, 10)
        Which part of the uncertainty that a parameter had by the URDF alone the recording took
        away: 0 where it shows nothing of it, towards 1 where it alone decides.
    """

    parameters: np.ndarray
    scales: np.ndarray
    told: np.ndarray


def link_intervals(stretches: np.ndarray, prior: Prior, x: np.ndarray) -> LinkIntervals:
    """Return the intervals of links as fitted.

    Parameters
    ----------
    stretches : ndarray, shape (S, J, 10·J + 5, 10·J + 5)
        The products of columns of each stretch: see `normal_matrices`.
    prior : Prior
        With which they were fitted.
    x : ndarray, shape (U,)
        The fitted unknowns.
    """
    unknowns = Unknowns(stretches.shape[1])
    _, _, hessian = loss_gradient_hessian(stretches.sum(axis=0), prior, unknowns, x)
    pulls = np.array([loss_gradient_hessian(own, prior, unknowns, x)[1] for own in stretches])
    # The prior has the same gradient in every part, and cancels with the mean.
    pulls -= pulls.mean(axis=0)
    known = np.zeros(unknowns.size)
    known[unknowns.links], known[unknowns.scales] = prior.strength, 1.0 / prior.log_width ** 2
    free = x > unknowns.lowest
    count = len(stretches)
    inverse = np.linalg.pinv(hessian[np.ix_(free, free)], rcond=1e-13, hermitian=True)
    scatter = pulls[:, free].T @ pulls[:, free] * count / max(count - 1, 1)
    covariance = np.zeros_like(hessian)
    covariance[np.ix_(free, free)] = inverse @ (scatter + np.diag(known[free])) @ inverse
    wide = float(stats.t.ppf(0.5 + 0.5 * _LEVEL, max(count - 1, 2)))

    parameters, slopes = prior.bodies.parameters(x[unknowns.links])
    _, before = prior.bodies.parameters(np.zeros_like(x[unknowns.links]))
    bounds, known_share = np.empty((*parameters.shape, 2)), np.empty(parameters.shape)
    for link, (own, first) in enumerate(zip(slopes, before)):
        rows = slice(PARAMETERS * link, PARAMETERS * (link + 1))
        variance = np.einsum('ij,jk,ik->i', own, covariance[rows, rows], own)
        half = wide * np.sqrt(np.maximum(variance, 0.0))
        bounds[link] = np.stack((parameters[link] - half, parameters[link] + half), axis=-1)
        # The mass of a body is positive, whatever the linearised interval says.
        bounds[link, 0] = np.maximum(bounds[link, 0], 0.0)
        unseen = np.einsum('ij,ij->i', first, first) / prior.strength
        known_share[link] = np.clip(1.0 - variance / np.maximum(unseen, 1e-300), 0.0, 1.0)
        bounds[link, known_share[link] < _OWN] = -np.inf, np.inf
    width = wide * np.sqrt(np.maximum(np.diag(covariance)[unknowns.scales], 0.0))
    middle = x[unknowns.scales]
    return LinkIntervals(bounds, np.exp(np.clip(
        np.stack((middle - width, middle + width), axis=-1), -50.0, 50.0)), known_share)
