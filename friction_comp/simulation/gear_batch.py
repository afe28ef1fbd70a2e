# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop of many geared joints under their laws, compiled and in parallel."""

from __future__ import annotations

import math

from numba import njit, prange
import numpy as np

from friction_comp.compensation.guards import observe
from friction_comp.compensation.law_kernel import decide
from friction_comp.compensation.records import STATE
from friction_comp.simulation.gear_kernel import (
    gear_sample,
    GEAR_STATE,
    measure_gear,
    MEASURED,
    start_gear,
)
from friction_comp.simulation.joint import random_states

# Rows of the log; rad, rad/s, N·m, A.
LOGGED = ('rotor', 'rotor_speed', 'link_speed', 'interaction_torque', 'command')
SAMPLE_TIME = 1e-3


@njit(cache=True)
def _one_run(p, law, s, own, out, random, reference, disturbance, released, speed, log):
    start_gear(p, s, random)
    s.rotor_speed = s.link_speed = speed
    measure_gear(p, s, random, SAMPLE_TIME, out)
    for k in range(log.shape[1]):
        command = 0.0
        if observe(law, own, k * SAMPLE_TIME, out.position + disturbance[k], out.velocity, True):
            command = decide(law, own, reference[2, k], 0.0, 0.0, 0.0)
        else:
            own.current = 0.0
        log[0, k], log[1, k], log[2, k] = s.rotor, s.rotor_speed, s.link_speed
        log[3, k], log[4, k] = out.interaction_torque, command
        gear_sample(p, s, random, SAMPLE_TIME, command, reference[0, k], reference[1, k],
                    k < released, out)


@njit(cache=True, parallel=True)
def _all_runs(p, law, s, own, out, random, reference, disturbance, released, speed, log):
    for r in prange(p.shape[0]):
        m, b = r % reference.shape[0], r % disturbance.shape[0]
        _one_run(p[r], law[r], s[r], own[r], out[r], random[r], reference[m], disturbance[b],
                 released, speed, log[r])


def run_gears(parameters, laws, reference, seed=0, released=0, speed=0.0, disturbance=None):
    """Run geared joints under their laws at 1 kHz.

    Parameters
    ----------
    parameters : sequence of gear_kernel.GEAR records, length R
    laws : sequence of compensation.records.PARAMETERS arrays of shape (1,), length R
    reference : array_like, shape (3, N) or (R, 3, N)
        Position and velocity that the person follows, rad and rad/s, and the direction announced.
    seed : int
    released : int
        Sample at which the person lets go; 0: nobody ever holds the joint.
    speed : float
        rad/s at the beginning.
    disturbance : array_like, shape (N,), optional
        rad, added to what the encoder shows.

    Returns
    -------
    dict of str to ndarray, shape (R, N)
        The names in `LOGGED`.
    guards : ndarray of compensation.records.STATE, shape (R,)
        The laws' states at the end.
    """
    p = np.array(list(parameters))
    law = np.concatenate(list(laws))
    reference = np.ascontiguousarray(np.atleast_3d(np.asarray(reference, dtype=float).T).T)
    size, count = len(p), reference.shape[2]
    disturbance = np.zeros((1, count)) if disturbance is None else np.atleast_2d(disturbance)
    own, log = np.zeros(size, STATE), np.zeros((size, len(LOGGED), count))
    _all_runs(p, law, np.zeros(size, GEAR_STATE), own, np.zeros(size, MEASURED),
              random_states(seed, size), reference, disturbance, int(released), float(speed), log)
    return {name: log[:, i] for i, name in enumerate(LOGGED)}, own


def push(acceleration_time, speed, begin, end, announced):
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
