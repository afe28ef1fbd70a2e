# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A plain drive: Eq. 6, inertia, weight and load, and its error on held-out blocks.

No effect is selected here. This error is the criterion by which motion is computed and prepared.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from friction_comp.refinement.sums import BlockSums
from friction_comp.samples import Samples

# Shares of the top speed over which friction may change sign.
TRANSITIONS = (0.3, 0.1, 0.03, 0.01, 0.003)


def plain_columns(samples: Samples, transitions: Sequence[float],
                  motion: tuple[np.ndarray, ...] | None = None, index: int = 0) -> np.ndarray:
    """Return the columns of a plain drive: friction, inertia, weight and load."""
    v, q = np.asarray(samples.velocity), samples.position
    columns = [np.ones_like(v), *(np.tanh(v / width) for width in transitions), v,
               samples.acceleration, np.cos(q), np.sin(q)]
    if np.ptp(q) < 2.0:
        columns.append(q)
    if samples.load is not None:
        columns += [samples.load, np.abs(samples.load) * np.tanh(v / transitions[-1])]
    if samples.rigid_body is not None:
        columns += [samples.rigid_body, np.abs(samples.rigid_body) * np.tanh(v / transitions[-1])]
    if motion is not None:
        angles, _, accelerations = motion
        for first in range(index + 1):
            for last in range(index, angles.shape[1]):
                if first < last:
                    total = angles[:, first:last + 1].sum(axis=1)
                    columns += [np.cos(total), np.sin(total)]
        columns += [acceleration for k, acceleration in enumerate(accelerations.T) if k != index]
    return np.column_stack(columns)


def held_out(columns: np.ndarray, target: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Return the squared error of each block by least squares on all others, shape (K,)."""
    return sums_of(columns, target, block).left_out(range(columns.shape[1]))


def sums_of(columns: np.ndarray, target: np.ndarray, block: np.ndarray,
            signs: np.ndarray | None = None, weights: np.ndarray | None = None) -> BlockSums:
    """Return the block sums of columns, shape (R, P), and a target, shape (R,).

    The rows of a block have to be consecutive.
    """
    matrix = np.column_stack((columns, target))
    weighted = matrix if weights is None else matrix * weights[:, None]
    blocks = int(block.max()) + 1
    edges = np.searchsorted(block, np.arange(blocks + 1))
    gram = np.array([weighted[a:b].T @ matrix[a:b] for a, b in zip(edges[:-1], edges[1:])])
    if signs is None:
        signs = np.zeros(columns.shape[1], dtype=int)
    return BlockSums(gram, np.diff(edges), signs)
