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
from friction_comp.direction.exercise import ReferenceMovement
from friction_comp.evaluation.conditions import evaluate, Evaluation
from friction_comp.files import package_file
from friction_comp.identification.goal import IdentificationGoal
from friction_comp.identification.run import IdentificationResult, IdentificationRun
from friction_comp.model.friction_model import FrictionModel
from friction_comp.parallel import child_process
from friction_comp.samples import Samples
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import FRICTION, joint_parameters, Plant, random_states

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
REPETITIONS = 10
CONDITIONS = ('none', 'kinetic', 'paper', 'continuous', 'inertia')
LAWS = ('paper', 'continuous')
STANDSTILLS = 360


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
    log, _ = closed_loops(
        parameters, random_states((seed, 1), REPETITIONS), np.tile(law, REPETITIONS),
        reference, np.arange(REPETITIONS), SAMPLE_TIME)
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


def stand_still(experiment: Experiment, model: FrictionModel, law: str, seed: int) -> np.ndarray:
    """Return how far an untouched joint moves in each of `STANDSTILLS`, rad; one hour in total.

    Each takes 10 s, has new breakaway levels and a direction announced after 0.5 s, half of them
    d = 1; the law's breakaway currents are 10 % too large.
    """
    assert model.breakaway is not None, 'an identified model has breakaway currents'
    model = replace(model, breakaway=replace(
        model.breakaway, positive_mean=1.1 * model.breakaway.positive_mean,
        negative_mean=1.1 * model.breakaway.negative_mean))
    count = round(10.0 / SAMPLE_TIME)
    still, direction = np.zeros((2, count)), np.zeros((2, count))
    direction[:, round(0.5 / SAMPLE_TIME):] = [[1.0], [-1.0]]
    _, largest = closed_loops(
        np.tile(joint_parameters(experiment.model()), STANDSTILLS),
        random_states((seed, 2), STANDSTILLS),
        np.tile(law_parameters(model, law), STANDSTILLS),
        (still, still, direction), np.arange(STANDSTILLS) % 2, SAMPLE_TIME, held=False)
    return largest


def identify(experiment: Experiment, cycles: int, seed: int) -> IdentificationResult:
    """Identify a simulated joint."""
    model = experiment.model()
    run = IdentificationRun(IdentificationGoal(
        speeds=experiment.speeds, motion_range=math.radians(90.0),
        ramp_slope=experiment.ramp_slope, ramp_period=10.0, breakaway_cycles=cycles), model.drive)
    plant = Plant([model], seed=seed, sample_time=IDENTIFIED_EVERY)
    while True:
        state = plant.state
        command = run.update(state.time, state.position[0], state.velocity[0], state.current[0])
        if run.finished:
            return run.result()
        plant.step([command])


def run_experiment(experiment: Experiment, identified: Callable[[], IdentificationResult],
                   seed: int, report: Callable[[float, str], None]) -> dict[str, Any]:
    """Run all experiments but the identification, which `identified` gets from another process.

    Returns the configuration's entry of results.json.
    """
    report(0.0, 'identification')
    result = identified()
    # The model for the compensation is what identification writes: it says how sure it is, too.
    model = result.model(experiment.model().drive)
    report(0.3, 'trials')
    peaks = {name: mean_peak(run_trial(experiment, model, name, seed)) for name in CONDITIONS}
    starts = {}
    for k, law in enumerate(LAWS):
        report(0.5 + 0.25 * k, f'standstill, {law} law')
        starts[law] = int(np.sum(stand_still(experiment, model, law, seed) > FALSE_START))
    report(1.0, 'done')
    return {
        'breakaway': {
            **{f'{side}_{figure}': getattr(result.breakaway, f'{side}_{figure}')
               for side in ('positive', 'negative') for figure in ('mean', 'std')},
            'cycles': result.goal.breakaway_cycles},
        'sigmoid': list(result.coefficients), 'sigmoid_error': result.sigmoid_error,
        'speeds': [point.speed for point in result.points],
        'currents': [point.current for point in result.points],
        'peak_torque': peaks,
        'peak_reduction': {law: 1.0 - peaks[law] / peaks['kinetic'] for law in LAWS},
        'false_starts': starts}


def run_experiments(cycles: int, seed: int,
                    report: Callable[[float, str], None]) -> dict[str, dict[str, Any]]:
    """Run the experiments of every configuration, with `cycles` current ramps per direction.

    Drives are identified sample by sample in a separate process, all else runs compiled and in
    parallel. ``report(share, description)`` is called with the progress. Returns the configurations
    of results.json, by number.
    """
    outcomes = {}
    with child_process() as pool:
        found = [pool.submit(identify, experiment, cycles, seed) for experiment in EXPERIMENTS]
        for k, experiment in enumerate(EXPERIMENTS):
            def report_part(share: float, what: str, k: int = k,
                            number: int = experiment.number) -> None:
                report((k + share) / len(EXPERIMENTS), f'configuration {number}: {what}')

            outcomes[str(experiment.number)] = run_experiment(
                experiment, found[k].result, seed, report_part)
    return outcomes


def compared(configurations: dict[str, Any]) -> list[list[str]]:
    """Return a row of text for each result in results.json, with the note's in brackets."""
    columns = [_cells(configurations[str(note.number)], note) for note in EXPERIMENTS]
    return [[name, *(column[name] for column in columns)] for name in columns[0]]


def _cells(result: dict[str, Any], note: Experiment) -> dict[str, str]:
    breakaway, peak = result['breakaway'], result['peak_torque']
    mean = 0.5 * (breakaway['positive_mean'] - breakaway['negative_mean'])
    std = 0.5 * (breakaway['positive_std'] + breakaway['negative_std'])
    removed = (peak['none'] - peak['continuous']) / (peak['none'] - peak['inertia'])
    reduction = result['peak_reduction']
    return {
        'breakaway current, mA': (
            f'{1e3 * mean:.1f} ± {1e3 * std:.1f} '
            f'({1e3 * note.breakaway:.1f} ± {1e3 * note.breakaway_std:.1f})'),
        'peak torque to start, N·m: no compensation': f'{peak["none"]:.2f}',
        'peak torque: kinetic only, d = 0': f'{peak["kinetic"]:.2f} ({note.peak_kinetic:.2f})',
        "peak torque: the note's law, d = ±1":
            f'{peak["paper"]:.2f} ({note.peak_compensated:.2f})',
        'peak torque: continuous law, d = ±1': f'{peak["continuous"]:.2f}',
        'peak torque: no friction': f'{peak["inertia"]:.2f}',
        "peak reduced from d = 0: the note's law":
            f'{100 * reduction["paper"]:.0f} % ({100 * note.reduction:.0f} %)',
        'peak reduced from d = 0: continuous law': f'{100 * reduction["continuous"]:.0f} %',
        'friction removed from the uncompensated peak: continuous law': f'{100 * removed:.0f} %',
        "false starts per hour, breakaway 10 % too large: note's / continuous law":
            '{paper} / {continuous}'.format(**result['false_starts'])}
