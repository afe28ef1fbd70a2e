# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What any drive's current goes with at least, for regressions that look for something else."""

from __future__ import annotations

import numpy as np


def plain_drive_columns(velocity: np.ndarray, acceleration: np.ndarray,
                        *transitions: float) -> np.ndarray:
    """Return the columns offset, friction, viscous friction and inertia.

    Parameters
    ----------
    velocity, acceleration : ndarray, shape (N,)
        rad/s, rad/s².
    *transitions : float
        Velocities over which friction changes sign, rad/s; a column each.

    Returns
    -------
    ndarray, shape (N, 3 + number of transitions)
    """
    return np.column_stack((
        np.ones_like(velocity), *(np.tanh(velocity / width) for width in transitions), velocity,
        acceleration))
