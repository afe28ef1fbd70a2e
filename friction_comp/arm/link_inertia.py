# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertial parameters of links in a form that keeps them physically possible.

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

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.model.arm import PARAMETERS

# Least mass in kg and extent in m; many URDFs have massless links that only define frames.
_LEAST_MASS, _LEAST_RADIUS = 1e-3, 1e-3
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
    mass = max(pseudo[3, 3], _LEAST_MASS)
    centre = pseudo[:3, 3] / mass
    # Second moments about the centre of mass, which describe the link's extent.
    spread = pseudo[:3, :3] - mass * np.outer(centre, centre)
    sizes, axes = np.linalg.eigh(spread)
    largest = max(float(sizes[-1]), mass * _LEAST_RADIUS ** 2)
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
