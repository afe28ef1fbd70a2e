# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Interpolates the motion of all joints to the times of one of them, and unwraps angles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from friction_comp.samples import JointStates, Samples

# A jump by nearly a turn within this time is a wrapped angle: s, rad.
_WRAP_TIME, _WRAP = 0.02, (1.8 * np.pi, 2.2 * np.pi)


class Started(Protocol):
    """Has the stamp of a recording's time zero, in s."""

    start: float


def joint_states_at(samples: Samples, info: Started,
                    everyone: Mapping[str, tuple[Samples, Started]]) -> JointStates:
    """Return the motion of all joints at the times of one of them.

    Parameters
    ----------
    samples : Samples
        Of the one joint.
    info : RecordingInfo
        Of the same joint; topics may begin at different times.
    everyone : dict of str to (Samples, RecordingInfo)

    Returns
    -------
    JointStates
        Linearly interpolated; beyond the ends the nearest value.
    """
    positions, speeds = [], []
    for other, other_info in everyone.values():
        time = samples.time + (info.start - other_info.start)
        positions.append(np.interp(time, other.time, other.position))
        if other.velocity is not None:
            speeds.append(np.interp(time, other.time, other.velocity))
    known = len(speeds) == len(positions)
    return JointStates(tuple(everyone), np.column_stack(positions),
                       np.column_stack(speeds) if known else None)


def unwrapped(time: np.ndarray, position: np.ndarray, notes: list[str]) -> np.ndarray:
    """Return the unwrapped position in rad."""
    jumps = np.diff(position)
    size = np.abs(jumps)
    wraps = (size > _WRAP[0]) & (size < _WRAP[1]) & (np.diff(time) < _WRAP_TIME)
    # Jumps are wraps only if the joint is slow otherwise.
    if not wraps.any() or np.quantile(size, 0.9) > 0.1 * np.pi:
        return position
    notes.append(f'position wraps around {np.count_nonzero(wraps)} times: turns are added')
    turns = np.concatenate(([0.0], np.cumsum(np.where(wraps, -np.sign(jumps), 0.0))))
    return position + 2.0 * np.pi * turns
