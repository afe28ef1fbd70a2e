# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's experiments and results, and the experiments on simulated joints.

These have only the sensors of a real drive. Sections 2.3 and 2.4 are the package's own
identification. Section 2.6 are movements of a simulated person under each condition; joints that
nobody touches are observed for an hour.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from friction_comp.compensation.law import law_parameters
from friction_comp.evaluation.conditions import evaluate, Evaluation
from friction_comp.exercise.exercise_script import ReferenceMovement
from friction_comp.identification.goal import IdentificationGoal
from friction_comp.identification.run import IdentificationResult, IdentificationRun
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway
from friction_comp.package_files import package_file
from friction_comp.parallel import child_process
from friction_comp.samples import Samples
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.joint_parameters import FRICTION, joint_parameters
from friction_comp.simulation.random_sequence import random_states

RAMP_PERIOD = 10.0
"""T of Eq. 8 in s, all configurations."""

FALSE_START = math.radians(1.0)
"""rad by which a joint has started by itself; sticking joints deflect by 0.01 to 0.02 degrees."""


@dataclass(frozen=True)
class Experiment:
    """One of the note's three configurations."""

    number: int
    # Mean and standard deviation of section 3, A.
    breakaway: float
    breakaway_std: float
    # Slope s of Eq. 8, A/s.
    ramp_slope: float
    # Section 3: peak torque with d = 0 and with d = ±1, N·m, and the reduction stated.
    peak_kinetic: float
    peak_compensated: float
    reduction: float
    # Slowest speeds of the table, deg/s, not in the note: they determine the transition's
    # steepness.
    slow: tuple[float, ...]

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speeds of the look-up table in rad/s, each measured in both directions."""
        return tuple(math.radians(speed) for speed in (*self.slow, 5.0, *range(10, 101, 10)))

    def model(self) -> FrictionModel:
        """Return the model of the simulated joint: the drive as the note describes it."""
        return FrictionModel.load(package_file('config', f'armin_configuration_{self.number}.yaml'))

    def movement(self, compensated: bool = True) -> ReferenceMovement:
        """Return one repetition of the reference movement, forth and back."""
        entry = self.model().simulation['movement']
        return ReferenceMovement(
            amplitude=math.radians(entry['amplitude']), speed=math.radians(entry['speed']),
            acceleration_time=float(entry['acceleration_time']), standstill=3.0,
            announcement=1.0, repetitions=1, compensated=compensated)


EXPERIMENTS = (
    Experiment(1, 0.0995, 0.0034, 0.05, 0.98, 0.39, 0.60, (3.0,)),
    Experiment(2, 0.1377, 0.0043, 0.06, 1.28, 0.44, 0.65, (2.25,)),
    Experiment(3, 0.3357, 0.0172, 0.12, 6.02, 1.21, 0.80, (0.35, 1.0, 2.0)),
)


SAMPLE_TIME, IDENTIFIED_EVERY = 1e-3, 2e-3
"""s between samples of the trials, and of identification, which is not compiled."""
MOTION_RANGE = math.radians(90.0)
REPETITIONS = 10
CONDITIONS = ('none', 'kinetic', 'paper', 'continuous', 'inertia')
LAWS = ('paper', 'continuous')
STANDSTILLS = 360
# Relative error by which the law's breakaway currents are too large in standstills.
BREAKAWAY_ERROR = 0.1


def varied_reference(movement: ReferenceMovement, time: np.ndarray, repetitions: int,
                     seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return a person's position, velocity, direction, (repetitions, N), and stiffness factors."""
    rng = np.random.default_rng(seed)
    begin = movement.begins(0)
    rows: tuple[list[np.ndarray], ...] = ([], [], [])
    for _ in range(repetitions):
        # A person begins 10 ms earlier or later, and is 2 % faster or slower and 5 % stiffer.
        delay = 0.01 * rng.standard_normal()
        rate = 1.0 + 0.02 * rng.standard_normal()
        position, velocity, _ = movement.at(begin + (time - begin - delay) * rate)
        for row, values in zip(rows, (position, velocity * rate, movement.at(time)[2])):
            row.append(values)
    factors = np.exp(0.05 * rng.standard_normal(repetitions))
    return tuple(np.array(row, dtype=float) for row in rows), factors


def run_trial(experiment: Experiment, model: FrictionModel, name: str, seed: int) -> Evaluation:
    """Run and evaluate the condition `name`; a seed is the same person and joint in each."""
    movement = experiment.movement(compensated=name in ('paper', 'continuous'))
    count = round((movement.begins(1) + movement.movement_time + 1.0) / SAMPLE_TIME)
    time = np.arange(count) * SAMPLE_TIME
    reference, factors = varied_reference(movement, time, REPETITIONS, seed)
    parameters = np.tile(joint_parameters(experiment.model()), REPETITIONS)
    parameters['human_stiffness'] *= factors
    parameters['human_damping'] *= np.sqrt(factors)
    if name == 'inertia':
        # No friction: the small remaining levels only keep the formulas finite.
        for field in FRICTION:
            parameters[field] *= 1e-6
    law = law_parameters(model, 'none' if name == 'inertia' else name)
    log, _, _ = closed_loops(
        parameters, random_states((seed, 1), REPETITIONS), np.tile(law, REPETITIONS),
        reference, np.arange(REPETITIONS), sample_time=SAMPLE_TIME)
    shown = movement.at(time)
    recordings = [
        Samples(
            time=time, position=log['position'][r], velocity=log['velocity'][r],
            current=log['current'][r], load=log['interaction_torque'][r],
            direction=shown[2].astype(float), reference_position=shown[0],
            reference_velocity=shown[1], joint=f'armin_{experiment.number}')
        for r in range(REPETITIONS)]
    return evaluate(recordings, [f'repetition {r + 1}' for r in range(REPETITIONS)])


def mean_peak(evaluation: Evaluation) -> float:
    """Return the peak of the ensemble average, mean of both directions, N·m."""
    return float(np.mean([condition.peak_torque for condition in evaluation.conditions]))


def with_breakaway_error(model: FrictionModel) -> FrictionModel:
    """Return the model with breakaway means too large by `BREAKAWAY_ERROR`."""
    both = model.breakaway
    assert both is not None, 'an identified model has breakaway currents'
    return replace(model, breakaway=replace(
        both, positive_mean=both.positive_mean * (1.0 + BREAKAWAY_ERROR),
        negative_mean=both.negative_mean * (1.0 + BREAKAWAY_ERROR)))


def stand_still(experiment: Experiment, model: FrictionModel, law: str, seed: int) -> np.ndarray:
    """Return how far an untouched joint moves in each of `STANDSTILLS`, rad; one hour in total.

    Each takes 10 s, has new breakaway levels and a direction announced after 0.5 s, half of them
    d = 1; the law's breakaway currents are too large by `BREAKAWAY_ERROR`.
    """
    model = with_breakaway_error(model)
    count = round(10.0 / SAMPLE_TIME)
    still, direction = np.zeros((2, count)), np.zeros((2, count))
    direction[:, round(0.5 / SAMPLE_TIME):] = [[1.0], [-1.0]]
    _, extremes, _ = closed_loops(
        np.tile(joint_parameters(experiment.model()), STANDSTILLS),
        random_states((seed, 2), STANDSTILLS),
        np.tile(law_parameters(model, law), STANDSTILLS),
        (still, still, direction), np.arange(STANDSTILLS) % 2, released=0,
        sample_time=SAMPLE_TIME, every=0)
    return np.asarray(np.abs(extremes).max(axis=1))


def identify(experiment: Experiment, cycles: int, seed: int) -> tuple[IdentificationResult, float]:
    """Identify a simulated joint; return the result and the drive time it took, s."""
    model = experiment.model()
    run = IdentificationRun(IdentificationGoal(
        speeds=experiment.speeds, motion_range=MOTION_RANGE, ramp_slope=experiment.ramp_slope,
        ramp_period=RAMP_PERIOD, breakaway_cycles=cycles), model.drive)
    plant = Plant([model], seed=seed, sample_time=IDENTIFIED_EVERY)
    while True:
        state = plant.state
        command = run.update(state.time, state.position[0], state.velocity[0], state.current[0])
        if run.finished:
            return run.result(), state.time
        plant.step([command])


@dataclass
class ExperimentOutcome:
    """Results of one configuration."""

    experiment: Experiment
    identified: IdentificationResult
    model: FrictionModel  # the identified one
    trials: dict[str, Evaluation]  # by condition
    standstills: dict[str, np.ndarray]  # by law: distances in rad, as from `stand_still`
    drive_time: float  # simulated time that identification took, s

    @property
    def breakaway(self) -> Breakaway:
        """Breakaway currents as identified."""
        assert self.model.breakaway is not None, 'an identified model has breakaway currents'
        return self.model.breakaway

    @property
    def peaks(self) -> dict[str, float]:
        """Peak torque per condition in N·m."""
        return {name: mean_peak(trial) for name, trial in self.trials.items()}

    def reduction(self, law: str) -> float:
        """Share by which a law lowers the peak torque of the condition 'kinetic'."""
        return 1.0 - self.peaks[law] / self.peaks['kinetic']

    def false_starts(self, law: str) -> int:
        """Return the number of standstills in which the joint moved farther than `FALSE_START`."""
        return int(np.sum(self.standstills[law] > FALSE_START))

    def as_dict(self) -> dict[str, Any]:
        """Return the configuration's entry of results.json."""
        return {
            'breakaway': {
                **{f'{side}_{figure}': getattr(self.breakaway, f'{side}_{figure}')
                   for side in ('positive', 'negative') for figure in ('mean', 'std')},
                'cycles': self.identified.goal.breakaway_cycles},
            'sigmoid': list(self.model.sigmoid.coefficients()),
            'sigmoid_error': self.identified.sigmoid_error,
            'speeds': [point.speed for point in self.identified.points],
            'currents': [point.current for point in self.identified.points],
            'peak_torque': self.peaks,
            'peak_reduction': {law: self.reduction(law) for law in LAWS},
            'false_starts': {law: self.false_starts(law) for law in LAWS}}


def run_experiment(experiment: Experiment, identified: Callable[[], tuple[
        IdentificationResult, float]], seed: int, report: Callable[[float, str], None]
        ) -> ExperimentOutcome:
    """Run all experiments but the identification, which `identified` gets from another process."""
    report(0.0, 'identification')
    result, seconds = identified()
    # The model for the compensation: all its friction was measured.
    model = replace(experiment.model(), sigmoid=result.sigmoid, breakaway=result.breakaway,
                    simulation={}, notes={})
    report(0.3, 'trials')
    trials = {name: run_trial(experiment, model, name, seed) for name in CONDITIONS}
    standstills = {}
    for k, law in enumerate(LAWS):
        report(0.5 + 0.25 * k, f'standstill, {law} law')
        standstills[law] = stand_still(experiment, model, law, seed)
    report(1.0, 'done')
    return ExperimentOutcome(experiment, result, model, trials, standstills, seconds)


def run_experiments(cycles: int, seed: int,
                    report: Callable[[float, str], None]) -> list[ExperimentOutcome]:
    """Run the experiments of every configuration, with `cycles` current ramps per direction.

    Drives are identified sample by sample in a separate process, all else runs compiled and in
    parallel. ``report(share, description)`` is called with the progress.
    """
    outcomes = []
    with child_process() as pool:
        found = [pool.submit(identify, experiment, cycles, seed) for experiment in EXPERIMENTS]
        for k, experiment in enumerate(EXPERIMENTS):
            def report_part(share: float, what: str, k: int = k,
                            number: int = experiment.number) -> None:
                report((k + share) / len(EXPERIMENTS), f'configuration {number}: {what}')

            outcomes.append(run_experiment(experiment, found[k].result, seed, report_part))
    return outcomes
