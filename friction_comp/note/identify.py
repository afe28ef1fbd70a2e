# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Sections 2.3 and 2.4 on a simulated joint, using only the sensors of a real drive.

Applied literally, Eq. 9 detects breakaway at the first encoder count. But a joint at rest flickers
by a count, and creeps by tens of counts in presliding before it slides. Each ramp is therefore
evaluated backwards. First the run-away is found: a speed that persists too long for flicker or
creep. Then the beginning of the slide is found by fitting the position with a smooth creep that
changes into a slide at an unknown time. The current at that time is a local mean of the measured
current, corrected for the slope of the ramp.

Recordings of plain ramps allow no more. Identification pauses on its ramps and sees which current
holds; see `identification.ramp_evaluation`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

from numba import njit, prange
import numpy as np

from friction_comp.identification.breakaway import breakaway_records, BreakawayRecords, SlideBegin
from friction_comp.identification.goal import IdentificationGoal, IdentificationResult
from friction_comp.identification.kinetic import ramp_current
from friction_comp.identification.run import CUT_COUNTS, CUT_SPEED, CUT_WINDOW, IdentificationRun
from friction_comp.model.friction_model import FrictionModel
from friction_comp.note.published import Experiment, RAMP_PERIOD
from friction_comp.simulation.joint import joint_sample, measure, Plant, start_joint
from friction_comp.simulation.joint_parameters import joint_parameters, JOINT_STATE, MEASURED
from friction_comp.simulation.random_sequence import random_states
from friction_comp.simulation.undeclared import COLUMNS

SAMPLE_TIME = 1e-3
MOTION_RANGE = math.radians(90.0)
CYCLES_PER_RUN = 10
# Samples of the window in which a ramp ends, as in identification.
CUT_SAMPLES = round(CUT_WINDOW / SAMPLE_TIME)
# Speed in rad/s that creep, some mrad/s, does not reach, and s over which it is computed.
_RUNAWAY_SPEED, _SPEED_WINDOW = 0.02, 0.03
_CURRENT_WINDOW = 0.1  # s on each side over which the current is averaged
_SHORTEST_RAMP = 20    # samples
_POINTS = 160          # of the fit
_MISFIT = 0.13         # error of the fit as a share of the distance slid
# Longest time in s from the beginning of the slide to the run-away: tenths of a second. With a
# longer window, creep of soft contacts would be mistaken for the slide.
_LONGEST_WINDOW = 0.6


@dataclass(frozen=True)
class Ramps:
    """Current ramps: the first cycle (s, rad, A), all breakaways, and the drive time in s."""

    time: np.ndarray
    position: np.ndarray
    current: np.ndarray
    records: BreakawayRecords
    duration: float


def identify_table(experiment: Experiment, seed: int) -> tuple[IdentificationResult, float]:
    """Run identification for the look-up table, with one cycle; return result and drive time, s."""
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


def breakaway_currents(time: np.ndarray, position: np.ndarray, current: np.ndarray,
                       command: np.ndarray, resolution: float) -> BreakawayRecords:
    """Find every breakaway in current ramps, which may continue after it, as in Eq. 8, or not.

    In s, rad, measured and commanded A (zero between ramps), each (N,); `resolution` is a count in
    rad.
    """
    signs = np.sign(command).astype(int)
    edges = [0, *(np.flatnonzero(np.diff(signs)) + 1).tolist(), len(signs)]
    begins, directions = [], []
    for first, end in zip(edges[:-1], edges[1:]):
        sign, part = int(signs[first]), slice(first, end)
        begin = slide_begin(time[part], position[part], current[part], sign, resolution
                            ) if sign else None
        if begin is not None:
            begins.append(begin)
            directions.append(sign)
    return breakaway_records(begins, directions)


def slide_begin(time: np.ndarray, position: np.ndarray, current: np.ndarray, sign: int,
                resolution: float) -> SlideBegin | None:
    """Return where the joint begins to slide on one ramp, None if not; `sign` is its direction."""
    if len(time) < _SHORTEST_RAMP:
        return None
    runaway = _runaway(time, position, sign, resolution)
    if runaway < 0:
        return None
    window, instant, before = _LONGEST_WINDOW, 0.0, -1
    for _ in range(4):
        first = max(0, int(np.searchsorted(time, time[runaway] - window, side='right')) - 1)
        if first == before:
            break
        before = first
        instant = _hinge(time[first:runaway + 1], sign * position[first:runaway + 1], resolution)
        window = min(max(4.0 * (time[runaway] - instant), 0.15), _LONGEST_WINDOW)
    return SlideBegin(instant, _current_at(time, current, instant),
                      float(position[np.searchsorted(time, instant)]))


def _runaway(time: np.ndarray, position: np.ndarray, sign: int, resolution: float) -> int:
    """Return the first sample with the run-away speed over the window; -1 if there is none."""
    tail = np.searchsorted(time, time - _SPEED_WINDOW, side='left')
    elapsed, moved = time - time[tail], sign * (position - position[tail])
    fast = ((elapsed >= 0.5 * _SPEED_WINDOW) & (moved > _RUNAWAY_SPEED * elapsed)
            & (moved > 4.0 * resolution))
    return int(np.argmax(fast)) if fast.any() else -1


def _current_at(time: np.ndarray, current: np.ndarray, instant: float) -> float:
    """Return the current in A at a time on the ramp, averaged to suppress noise."""
    t = time - np.mean(time)
    gradient = float(np.dot(t, current) / np.dot(t, t))
    reach = min(_CURRENT_WINDOW, max(time[-1] - instant, 0.01))
    a, b = np.searchsorted(time, (instant - reach, instant + reach))
    near = slice(int(a), int(b) + 1)
    return float(np.mean(current[near] - gradient * (time[near] - instant)))


def _hinge(time: np.ndarray, position: np.ndarray, resolution: float) -> float:
    """Return the time at which creep, a parabola, changes into a slide, by least squares.

    No formula holds far into the slide, so weights decrease with the distance slid.
    """
    count = min(_POINTS, len(time))
    if count < 12:
        return float(time[0])
    index = (len(time) - 1) * np.arange(count) // (count - 1)
    span = float(time[-1] - time[0])
    t, x = (time[index] - time[0]) / span, position[index] - position[0]
    early = max(6, int(0.4 * count))
    gone = np.maximum(0.0, x - np.polyval(np.polyfit(t[:early], x[:early], 1), t))
    weight = 1.0 / np.hypot(0.5 * resolution + 1e-12, _MISFIT * gone)
    knees = np.linspace(0.02, 0.97, 41)
    for _ in range(3):
        knee = float(knees[np.argmin(_hinge_errors(t, x, weight, knees))])
        width = knees[1] - knees[0]
        knees = np.linspace(max(0.0, knee - width), min(0.97, knee + width), 13)
    return float(time[0]) + knee * span


def _hinge_errors(t: np.ndarray, x: np.ndarray, weight: np.ndarray, knees: np.ndarray
                  ) -> np.ndarray:
    """Return weighted squared errors of a parabola plus powers of (t - knee)₊, shape (K,).

    The powers only push forwards. What the parabola takes of them and of the position is
    subtracted, which leaves two coefficients: both positive, one of them, or none.
    """
    parabola = np.linalg.qr(weight[:, None] * np.column_stack((np.ones_like(t), t, t ** 2)))[0]
    slide = np.maximum(t - knees[:, None], 0.0)
    powers = weight * np.stack((slide ** 2, slide ** 3))
    powers /= np.sqrt(np.sum(powers ** 2, axis=2, keepdims=True)) + 1e-300
    powers -= powers @ parabola @ parabola.T
    target = weight * x
    target = target - parabola @ (parabola.T @ target)
    # A knee at the first sample adds a parabola to one.
    square, cube = np.sum(powers ** 2, axis=2) + 1e-12
    cross = np.sum(powers[0] * powers[1], axis=1)
    of_square, of_cube = powers @ target
    gain = np.maximum(np.maximum(of_square, 0.0) ** 2 / square,
                      np.maximum(of_cube, 0.0) ** 2 / cube)
    determinant = square * cube - cross ** 2
    first = (of_square * cube - of_cube * cross) / determinant
    second = (of_cube * square - of_square * cross) / determinant
    both = np.where((first >= 0.0) & (second >= 0.0), first * of_square + second * of_cube, 0.0)
    return target @ target - np.maximum(gain, both)
