# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of an arm as sums of products of columns over stretches.

The columns are those of the links' parameters, of each joint's friction and rotor, and its current.
Stretches are left out by subtraction: no sample is touched again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.model.arm.states import moving_states
from friction_comp.samples import Samples

if TYPE_CHECKING:
    from friction_comp.rigid_bodies.urdf import Chain

# Columns of a joint's friction and rotor: constant, Coulomb, viscous and acceleration.
FRICTION = 4
STRETCHES, FOLDS = 12, 3
# Friction of an arm's joint changes its sign within this share of its usual top speed.
_TRANSITION, _STILL = 0.03, 0.01


@dataclass
class Sums:
    """Sums of products of all columns over stretches of the recordings."""

    # (S, J, 10·J + 5, 10·J + 5): of the columns of the links, of friction and of the current, for
    # each stretch and joint; in units of `variance`.
    sums: np.ndarray
    variance: np.ndarray  # (J,): one unit of each joint's squared error, A²
    counts: np.ndarray  # (J,): number of samples

    @property
    def total(self) -> np.ndarray:
        """The sums over everything."""
        return np.asarray(self.sums.sum(axis=0))

    @property
    def folds(self) -> np.ndarray:
        """The sums over the stretches of each fold, shape (F, J, 10·J + 5, 10·J + 5)."""
        fold = np.arange(len(self.sums)) % FOLDS
        return np.array([self.sums[fold == index].sum(axis=0) for index in range(FOLDS)])


def sums_of(chain: Chain, joints: list[Samples], settings: dict[str, Any],
            most_rows: int) -> Sums:
    """Return the sums over recordings of all joints, in units of the current's variance.

    Of more samples than `most_rows`, every second, third and so on is taken.
    """
    q, v, a = moving_states(joints[0], chain.tree.joints, settings)
    every = max(1, len(q) // most_rows)
    rows = slice(None, None, every)
    q, v, a = q[rows], v[rows], a[rows]
    current = np.column_stack([one.current[rows] for one in joints])
    top = np.maximum(np.percentile(np.abs(v), 95, axis=0), 1e-9)
    friction = np.stack((np.ones_like(v), np.tanh(v / (_TRANSITION * top)), v, a), axis=2)
    # Stiction can take any value at rest; but a joint that hardly ever moves has no other data.
    moving = np.abs(v) > _STILL * top
    counts = np.where(moving.mean(axis=0) > 0.2, moving, True) & np.isfinite(current)
    # A gripper's effort that is always zero is not a measurement.
    counts &= np.ptp(current, axis=0) > 0.0
    variance = np.maximum(np.var(current, axis=0), 1e-12)
    stretch = stretches_of(joints[0].recording)[rows]
    sums = []
    for index in range(int(stretch.max()) + 1):
        own = stretch == index
        regressor, weights = chain.regressor(q[own], v[own], a[own]), counts[own] / variance
        columns = [np.hstack((regressor[:, joint], friction[own, joint], current[own, joint, None]))
                   for joint in range(len(joints))]
        sums.append([(part * weights[:, joint, None]).T @ part
                     for joint, part in enumerate(columns)])
    return Sums(np.array(sums), variance, counts.sum(axis=0).astype(float))


def stretches_of(recording: np.ndarray) -> np.ndarray:
    """Return which stretch each sample belongs to, shape (N,), counted from 0.

    No stretch goes over the edge of a recording.
    """
    stretch = np.arange(len(recording)) * STRETCHES // max(len(recording), 1)
    run = np.cumsum(np.diff(recording, prepend=recording[:1]) != 0)
    return np.unique(stretch + (STRETCHES + 1) * run, return_inverse=True)[1].reshape(-1)
