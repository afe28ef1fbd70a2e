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
from friction_comp.simulation.joint import (
    joint_sample,
    JOINT_STATE,
    measure,
    MEASURED,
    Record,
    start_joint,
)
from friction_comp.simulation.undeclared import COLUMNS

SIGNALS = ('position', 'velocity', 'current', 'interaction_torque', 'temperature', 'command',
           'rotor', 'rotor_speed', 'link_speed')
"""What can be logged: measured values, the law's command, and the joint's true state."""
LOGGED = SIGNALS[:6]


@njit(cache=True)
def _log(row: np.ndarray, columns: np.ndarray, out: Record, s: Record, command: float) -> None:
    values = (out.position, out.velocity, out.current, out.interaction_torque, out.temperature,
              command, s.rotor, s.rotor_speed, s.link_speed)
    for c in range(len(columns)):
        row[c] = values[columns[c]]


@njit(cache=True, parallel=True)
def _run_all(parameters: np.ndarray, random: np.ndarray, laws: np.ndarray, own: np.ndarray,
             reference: np.ndarray, which: np.ndarray, speed: float, released: int,
             sample_time: float, every: int, columns: np.ndarray,
             log: np.ndarray, extremes: np.ndarray, states: np.ndarray, outs: np.ndarray,
             known: bool) -> None:
    """Simulate R runs into `log`, `extremes` and `own`, the laws' states; see `closed_loops`.

    `states` and `outs` are the simulated joints', `known` says that the velocity is measured.
    """
    for r in prange(len(parameters)):
        p, law, s, out, shown = parameters[r], laws[r], states[r], outs[r], reference[which[r]]
        table, nothing = np.zeros((0, COLUMNS)), np.zeros(1)
        start_joint(p, s, random[r])
        s.rotor_speed = s.link_speed = speed
        measure(p, s, random[r], sample_time, out)
        lowest = highest = s.rotor
        for k in range(shown.shape[1]):
            command = 0.0
            if observe(law, own[r], k * sample_time, out.position, out.velocity, known):
                command = decide(law, own[r], shown[2, k], math.nan, False, 0.0, 0.0, 0.0)
            else:
                own[r].current = 0.0
            if every > 0 and k % every == 0:
                _log(log[r, k // every], columns, out, s, command)
            joint_sample(p, s, random[r], table, nothing, sample_time, command, shown[0, k],
                         shown[1, k], k < released, out)
            lowest = min(lowest, s.rotor)
            highest = max(highest, s.rotor)
        extremes[r, 0], extremes[r, 1] = lowest, highest


def closed_loops(
        parameters: np.ndarray, random: np.ndarray, laws: np.ndarray,
        reference: Sequence[np.ndarray], which: Sequence[int] | np.ndarray | None = None,
        sample_time: float = 1e-3, every: int = 1,
        *, released: int | None = None, speed: float = 0.0, logged: Sequence[str] = LOGGED
        ) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Simulate R joints with their laws, which use Eq. 6 without further effects.

    Each run has its `joint_parameters`, (R,), `random_states`, (R, 1), and parameters of its
    `CompensationLaw`, (R,). `reference` is position, velocity and direction, each (M, L), of M
    movements, as `ReferenceMovement.at` returns them, and `which`, (R,), the index of each run's;
    the first for all when omitted. The person lets go at the sample `released`, never when omitted;
    `speed` is the initial velocity, rad/s. Return every n-th sample (`every`; 0: none) of the
    `logged` ones of `SIGNALS`, by name, each (R, ceil(L / every)); lowest and highest true position
    in rad, (R, 2); and the final states of the laws, (R,).
    """
    movements = np.ascontiguousarray(np.stack(
        [np.atleast_2d(np.asarray(a, dtype=float)) for a in reference], axis=1))
    runs, length = len(parameters), movements.shape[2]
    chosen = np.zeros(runs, dtype=np.int64) if which is None else np.asarray(which, np.int64)
    columns = np.array([SIGNALS.index(name) for name in logged], dtype=np.int64)
    log = np.zeros((runs, -(-length // every) if every else 0, len(columns)))
    extremes, own = np.zeros((runs, 2)), np.zeros(runs, STATE)
    release = length if released is None else int(released)
    # The velocity is known. As a constant in compiled code, it would compile `observe` once more.
    _run_all(np.ascontiguousarray(parameters), random.copy(), laws.copy(), own, movements, chosen,
             float(speed), release, float(sample_time), int(every), columns, log, extremes,
             np.zeros(runs, JOINT_STATE), np.zeros(runs, MEASURED), True)
    return {name: log[:, :, c] for c, name in enumerate(logged)}, extremes, own
