# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings in which a person moves the joint and the current follows a compensation law."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from friction_comp.model.plain_drive import plain_drive_columns
from friction_comp.refinement.fit.robust_regression import solve

if TYPE_CHECKING:
    from friction_comp.drive import Drive
    from friction_comp.samples import Samples

# Share of the load's variance that the motion explains when the person makes the motion.
_MADE_BY_MOTION = 0.3
# Load torques below this share of the current's spread make no difference.
_WORTH = 0.05
# A free coefficient this near to mechanics needs no help.
_NEAR = 0.15


def carried_by_a_person(samples: Samples, usable: np.ndarray, drive: Drive) -> float:
    """Return A per N·m of load where mechanics has to be relied on, else 0.

    Under a compensation law the current is a function of the motion alone, as exact as a law can
    be. A regression of the current on the motion then finds the law and not the drive: what the
    drive lacks shows in the torque of the person. The two belong together by
    J·a = k_t·n·i + τ_b - F, so that the friction is seen in i + τ_b/(k_t·n). This is used where a
    recording has a load and says by a command or a direction that a law was at work, where the
    load goes with the motion, and where the current by itself does not show the load.

    Parameters
    ----------
    samples : Samples
        With velocity and acceleration.
    usable : ndarray of bool, shape (N,)
    drive : Drive

    Returns
    -------
    float
    """
    if samples.load is None or (samples.command is None and samples.direction is None):
        return 0.0
    mechanics = -1.0 / drive.torque_per_current
    rows = np.nonzero(usable)[0][::max(1, int(usable.sum()) // 20000)]
    part = samples.take(rows)
    if np.std(part.load * mechanics) < _WORTH * np.std(part.current):
        return 0.0
    top = float(np.percentile(np.abs(part.velocity), 95))
    motion = plain_drive_columns(part.velocity, part.acceleration, 0.03 * top)
    ones = np.ones(len(part))
    left = part.load - motion @ solve(motion, part.load, ones)
    if 1.0 - np.var(left) / np.var(part.load) < _MADE_BY_MOTION:
        return 0.0
    free = solve(np.column_stack((motion, part.load)), part.current, ones)[-1]
    return 0.0 if abs(free / mechanics - 1.0) < _NEAR else mechanics
