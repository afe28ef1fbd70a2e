# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Runs many closed loops at once, compiled and in parallel.

Every run has its own random sequence, so that results do not depend on the number of cores.
"""

from __future__ import annotations

from collections.abc import Sequence
import math

from numba import njit, prange
import numpy as np

from friction_comp.compensation.law_kernel import decide, observe
from friction_comp.compensation.law_parameters import STATE
from friction_comp.simulation.joint import joint_sample, JOINT_STATE, measure, MEASURED, start_joint
from friction_comp.simulation.undeclared import COLUMNS


@njit(cache=True, parallel=True)
def _run_all(parameters: np.ndarray, random: np.ndarray, laws: np.ndarray, own: np.ndarray,
             reference: np.ndarray, which: np.ndarray, held: bool, sample_time: float,
             log: np.ndarray, largest: np.ndarray, states: np.ndarray, outs: np.ndarray,
             known: bool) -> None:
    """Simulate R runs into `log` and `largest`; see `closed_loops`.

    `own` are the laws' states, `states` and `outs` the simulated joints', `known` says that the
    velocity is measured.
    """
    for r in prange(len(parameters)):
        p, law, s, out, shown = parameters[r], laws[r], states[r], outs[r], reference[which[r]]
        table, nothing = np.zeros((0, COLUMNS)), np.zeros(1)
        start_joint(p, s, random[r])
        measure(p, s, random[r], sample_time, out)
        for k in range(shown.shape[1]):
            command = 0.0
            if observe(law, own[r], k * sample_time, out.position, out.velocity, known):
                command = decide(law, own[r], shown[2, k], math.nan, False, 0.0, 0.0, 0.0)
            else:
                own[r].current = 0.0
            if k < log.shape[1]:
                log[r, k] = out
            joint_sample(p, s, random[r], table, nothing, sample_time, command, shown[0, k],
                         shown[1, k], held, out)
            largest[r] = max(largest[r], abs(s.position))


def closed_loops(parameters: np.ndarray, random: np.ndarray, laws: np.ndarray,
                 reference: Sequence[np.ndarray], which: np.ndarray, sample_time: float,
                 *, held: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Simulate R joints with their laws, which use Eq. 6 without further effects.

    Each run has its `joint_parameters`, (R,), `random_states`, (R, 1), and parameters of its
    `CompensationLaw`, (R,). `reference` is position, velocity and direction, each (M, L), of M
    movements, as `ReferenceMovement.at` returns them, and `which`, (R,), the index of each run's.
    Return the measured values, (R, L) of `MEASURED`, none unless a person holds the joints, and the
    largest distance from the start, (R,), rad.
    """
    movements = np.ascontiguousarray(np.stack(reference, axis=1))
    runs, length = len(parameters), movements.shape[2]
    log, largest = np.zeros((runs, length if held else 0), MEASURED), np.zeros(runs)
    # The velocity is known. As a constant in compiled code, it would compile `observe` once more.
    _run_all(np.ascontiguousarray(parameters), random.copy(), laws.copy(), np.zeros(runs, STATE),
             movements, which, held, sample_time, log, largest, np.zeros(runs, JOINT_STATE),
             np.zeros(runs, MEASURED), True)
    return log, largest
