# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop for many runs at once: the same joint, the same law, compiled and in parallel.

Every run has its own random sequence, so that results do not depend on the number of cores.
"""

from __future__ import annotations

from numba import njit, prange
import numpy as np

from friction_comp.compensation import law_kernel
from friction_comp.compensation.guards import observe
from friction_comp.compensation.records import STATE
from friction_comp.simulation import joint_kernel as kernel

# Columns of the log.
LOGGED = ('position', 'velocity', 'current', 'interaction_torque', 'temperature', 'command')


@njit(cache=True)
def _one_run(p, random, law, own, position, velocity, direction, active, count, sample_time, every,
             log):
    """Run one joint and return the farthest that it went either way, rad."""
    s = np.zeros(kernel.STATES)
    out = np.zeros(kernel.OUTPUTS)
    table, memory = np.zeros((0, 10)), np.zeros(1)
    kernel.start_state(p, s, random)
    kernel.measure(p, s, random, sample_time, out)
    period = len(direction)
    lowest = highest = s[kernel.POSITION]
    for k in range(count):
        i = k % period
        command = 0.0
        if observe(law, own, k * sample_time, out[kernel.OUT_POSITION],
                              out[kernel.OUT_VELOCITY], True):
            command = law_kernel.decide(law, own, float(direction[i]), 0.0, 0.0, 0.0)
        if every > 0 and k % every == 0:
            row = k // every
            for c in range(kernel.OUTPUTS):
                log[row, c] = out[c]
            log[row, kernel.OUTPUTS] = command
        kernel.joint_sample(p, s, random, table, memory, sample_time, command, position[i],
                            velocity[i], active, out)
        lowest = min(lowest, s[kernel.POSITION])
        highest = max(highest, s[kernel.POSITION])
    return lowest, highest


@njit(cache=True, parallel=True)
def _all_runs(p, random, law, own, position, velocity, direction, which, active, count, sample_time,
              every, log, extremes):
    for r in prange(p.shape[0]):
        m = which[r]
        extremes[r, 0], extremes[r, 1] = _one_run(
            p[r], random[r], law[r], own[r], position[m], velocity[m], direction[m], active, count,
            sample_time, every, log[r])


def closed_loops(parameters, random, laws, reference, which=None, active=True, count=None,
                 sample_time=1e-3, every=1):
    """Run many joints under their laws.

    Parameters
    ----------
    parameters : ndarray, shape (R, kernel.PARAMETERS)
        Of the joints: `joint.plant_parameters`.
    random : ndarray of uint64, shape (R, 1)
        `joint.random_states`.
    laws : ndarray of records.PARAMETERS, shape (R,)
        `compensation.law_parameters`, joined.
    reference : tuple of ndarray, each of shape (M, L)
        Position, velocity and direction at every sample, as `ReferenceMovement.at` gives them;
        they begin again after L samples.
    which : ndarray of int, shape (R,), optional
        The movement of each run; the first for all when omitted.
    active : bool
        Whether the person holds the joint.
    count : int, optional
        Samples to run; L when omitted.
    sample_time : float
        s.
    every : int
        Log each so manieth sample; 0 logs nothing.

    Returns
    -------
    log : dict of str to ndarray, shape (R, ceil(count / every))
        The names in `LOGGED`.
    extremes : ndarray, shape (R, 2)
        Lowest and highest true position of each run in rad.
    """
    position, velocity, direction = (np.atleast_2d(np.asarray(a, dtype=float)) for a in reference)
    runs = len(parameters)
    count = position.shape[1] if count is None else int(count)
    which = np.zeros(runs, dtype=np.int64) if which is None else np.asarray(which, np.int64)
    rows = -(-count // every) if every else 0
    log = np.zeros((runs, rows, len(LOGGED)))
    extremes = np.zeros((runs, 2))
    _all_runs(np.ascontiguousarray(parameters), random.copy(), np.ascontiguousarray(laws),
              np.zeros(runs, STATE), position,
              velocity, direction, which, active, count, float(sample_time), int(every), log,
              extremes)
    return {name: log[:, :, c] for c, name in enumerate(LOGGED)}, extremes
