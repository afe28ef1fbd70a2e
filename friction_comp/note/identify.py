# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Sections 2.3 and 2.4 on a simulated joint, using only the sensors of a real drive."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

from numba import njit, prange
import numpy as np

from friction_comp.identification.breakaway import BreakawayRecords
from friction_comp.identification.goal import IdentificationGoal, IdentificationResult
from friction_comp.identification.run import CUT_COUNTS, CUT_SPEED, CUT_WINDOW, IdentificationRun
from friction_comp.identification.waveforms import ramp_current
from friction_comp.model.friction_model import FrictionModel
from friction_comp.note.published import Experiment, RAMP_PERIOD
from friction_comp.note.recorded_ramps import breakaway_currents
from friction_comp.simulation.joint import joint_sample, measure, Plant, start_joint
from friction_comp.simulation.joint_parameters import joint_parameters, JOINT_STATE, MEASURED
from friction_comp.simulation.random_sequence import random_states
from friction_comp.simulation.undeclared import COLUMNS

SAMPLE_TIME = 1e-3
MOTION_RANGE = math.radians(90.0)
CYCLES_PER_RUN = 10
# Samples of the window in which a ramp ends, as in identification.
CUT_SAMPLES = round(CUT_WINDOW / SAMPLE_TIME)


@dataclass(frozen=True)
class Ramps:
    """Current ramps: the first cycle (s, rad, A), all breakaways, and the drive time in s."""

    time: np.ndarray
    position: np.ndarray
    current: np.ndarray
    records: BreakawayRecords
    duration: float


def identify_table(experiment: Experiment, seed: int) -> tuple[IdentificationResult, float]:
    """Run the identification procedure for the look-up table; return result and drive time, s.

    The result contains the breakaway of a single cycle; `identify_breakaway` measures many.
    """
    model = experiment.model()
    goal = IdentificationGoal(
        speeds=experiment.speeds, motion_range=MOTION_RANGE, ramp_slope=experiment.ramp_slope,
        ramp_period=RAMP_PERIOD, breakaway_cycles=1)
    plant = Plant([model], seed=seed, sample_time=SAMPLE_TIME)
    run = IdentificationRun(goal, model.drive)
    while True:
        state = plant.state
        command = run.update(state.time, state.position[0], state.velocity[0], state.current[0])
        if run.finished:
            return run.result(), state.time
        plant.step([command])


@njit(cache=True, parallel=True)
def _ramp_runs(joints: np.ndarray, random: np.ndarray, states: np.ndarray, outs: np.ndarray,
               slope: float, count: int, sample_time: float, log: np.ndarray, held: bool) -> None:
    for r in prange(len(random)):
        p, s, out = joints[r], states[r], outs[r]
        table, memory = np.zeros((0, COLUMNS)), np.zeros(1)
        past = np.zeros(CUT_SAMPLES)
        start_joint(p, s, random[r])
        measure(p, s, random[r], sample_time, out)
        half, home, free = -1, 0.0, False
        for k in range(count):
            t = k * sample_time
            position = out.position
            now = int(t / (0.5 * RAMP_PERIOD))
            if now != half:
                half, home, free = now, position, False
                past[:] = position
            speed = (position - past[k % CUT_SAMPLES]) / (CUT_SAMPLES * sample_time)
            past[k % CUT_SAMPLES] = position
            if abs(position - home) > CUT_COUNTS * p.resolution and abs(speed) > CUT_SPEED:
                free = True
            ramp = ramp_current(t - math.floor(t / RAMP_PERIOD) * RAMP_PERIOD, slope, RAMP_PERIOD)
            command = 0.0 if free else ramp
            log[r, k, 0] = position
            log[r, k, 1] = out.current
            log[r, k, 2] = command
            joint_sample(p, s, random[r], table, memory, sample_time, command, 0.0, 0.0, held, out)


def identify_breakaway(experiment: Experiment, cycles: int, seed: int) -> Ramps:
    """Run the current ramps of Eq. 8, `cycles` in each direction, in many runs in parallel."""
    model = experiment.model()
    each = min(CYCLES_PER_RUN, cycles)
    runs = -(-cycles // each)
    count = round(each * RAMP_PERIOD / SAMPLE_TIME)
    log = np.zeros((runs, count, 3))
    # Nobody holds the joint. If compiled code said so, it would compile `joint_sample` once more,
    # for a constant.
    _ramp_runs(np.tile(joint_parameters(model), runs), random_states(seed, runs),
               np.zeros(runs, JOINT_STATE), np.zeros(runs, MEASURED), experiment.ramp_slope,
               count, SAMPLE_TIME, log, False)
    time = np.arange(count) * SAMPLE_TIME
    parts = [breakaway_currents(time, position, current, command,
                                model.drive.position_resolution or 1e-6)
             for position, current, command in (rows.T for rows in log)]
    columns = {name: np.concatenate([getattr(part, name) for part in parts])
               for name in vars(parts[0])}
    # The runs may have more cycles than requested.
    first = np.sort(np.concatenate([
        np.flatnonzero(columns['direction'] == sign)[:cycles] for sign in (1, -1)]))
    records = BreakawayRecords(**{name: column[first] for name, column in columns.items()})
    shown = slice(0, round(RAMP_PERIOD / SAMPLE_TIME))
    return Ramps(time[shown], log[0, shown, 0].copy(), log[0, shown, 1].copy(), records,
                 runs * count * SAMPLE_TIME)


def identified_model(experiment: Experiment, table: IdentificationResult,
                     ramps: Ramps) -> FrictionModel:
    """Return the model for the compensation, in which all friction values were measured."""
    return replace(experiment.model(), sigmoid=table.sigmoid,
                   breakaway=ramps.records.statistics(), simulation={}, notes={})
