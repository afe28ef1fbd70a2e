# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Many geared joints under their laws at 1 kHz: let go, left alone, or pushed."""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import random_states

# rad, rad/s, N·m, A.
LOGGED = ('rotor', 'rotor_speed', 'link_speed', 'interaction_torque', 'command')
SAMPLE_TIME = 1e-3


def run_gears(parameters: Sequence[np.void], laws: Sequence[np.ndarray], reference: np.ndarray,
              seed: int | Sequence[int] = 0, released: int = 0, speed: float = 0.0
              ) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Run geared joints under their laws at 1 kHz.

    Parameters
    ----------
    parameters : sequence of joint_parameters.JOINT records, length R
    laws : sequence of compensation.law_parameters.PARAMETERS arrays of shape (1,), length R
    reference : array_like, shape (3, N) or (R, 3, N)
        Position and velocity that the person follows, rad and rad/s, and the direction announced.
    seed : int
    released : int
        Sample at which the person lets go; 0: nobody ever holds the joint.
    speed : float
        rad/s at the beginning.

    Returns
    -------
    dict of str to ndarray, shape (R, N)
        The names in `LOGGED`.
    guards : ndarray of compensation.law_parameters.STATE, shape (R,)
        The laws' states at the end.
    """
    size = len(parameters)
    shown = np.asarray(reference, dtype=float)
    shown = shown.reshape(-1, 3, shown.shape[-1])
    log, _, guards = closed_loops(
        np.array(list(parameters)), random_states(seed, size), np.concatenate(list(laws)),
        tuple(shown.transpose(1, 0, 2)), np.arange(size) % len(shown), sample_time=SAMPLE_TIME,
        released=released, speed=speed, logged=LOGGED)
    return log, guards


def push(acceleration_time: float, speed: float, begin: float, end: float,
         announced: float) -> np.ndarray:
    """Return the reference of a person who sets a joint in motion, shape (3, N).

    Parameters
    ----------
    acceleration_time, speed : float
        s, rad/s.
    begin, end, announced : float
        s: when the movement begins, when the run ends, when the direction is announced.
    """
    time = np.arange(round(end / SAMPLE_TIME)) * SAMPLE_TIME
    velocity = speed * np.clip((time - begin) / acceleration_time, 0.0, 1.0)
    direction = np.where(time >= announced, math.copysign(1.0, speed), 0.0)
    return np.stack((np.cumsum(velocity) * SAMPLE_TIME, velocity, direction))
