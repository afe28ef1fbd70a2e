# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Section 2.6: movements of a simulated person under each condition, and untouched joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from friction_comp.compensation.law import law_parameters
from friction_comp.evaluation.conditions import evaluate, Evaluation
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.note.published import Experiment
from friction_comp.samples import Samples
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint_parameters import FRICTION, joint_parameters
from friction_comp.simulation.random_sequence import random_states

SAMPLE_TIME = 1e-3
REPETITIONS = 10
CONDITIONS = ('none', 'kinetic', 'paper', 'continuous', 'inertia')
# A person's standard deviations of stiffness (relative), time of the begin, s, and speed
# (relative).
STIFFNESS_VARIATION, DELAY_VARIATION, SPEED_VARIATION = 0.05, 0.01, 0.02
# Number of standstills, duration of each, s, and time in it at which a direction is announced, s.
STANDSTILLS, STANDSTILL_TIME, ANNOUNCED = 360, 10.0, 0.5
# Relative error by which the law's breakaway currents are too large in standstills.
BREAKAWAY_ERROR = 0.1


def varied_reference(movement: ReferenceMovement, time: np.ndarray, repetitions: int,
                     seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return a person's position, velocity, direction, (repetitions, N), and stiffness factors."""
    rng = np.random.default_rng(seed)
    begin = movement.begins(0)
    rows: tuple[list[np.ndarray], ...] = ([], [], [])
    for _ in range(repetitions):
        delay = DELAY_VARIATION * rng.standard_normal()
        rate = 1.0 + SPEED_VARIATION * rng.standard_normal()
        position, velocity, _ = movement.at(begin + (time - begin - delay) * rate)
        for row, values in zip(rows, (position, velocity * rate, movement.at(time)[2])):
            row.append(values)
    factors = np.exp(STIFFNESS_VARIATION * rng.standard_normal(repetitions))
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

    Each has new breakaway levels and a direction announced, half of them d = 1; the law's breakaway
    currents are too large by `BREAKAWAY_ERROR`.
    """
    model = with_breakaway_error(model)
    count = round(STANDSTILL_TIME / SAMPLE_TIME)
    still, direction = np.zeros((2, count)), np.zeros((2, count))
    direction[:, round(ANNOUNCED / SAMPLE_TIME):] = [[1.0], [-1.0]]
    _, extremes, _ = closed_loops(
        np.tile(joint_parameters(experiment.model()), STANDSTILLS),
        random_states((seed, 2), STANDSTILLS),
        np.tile(law_parameters(model, law), STANDSTILLS),
        (still, still, direction), np.arange(STANDSTILLS) % 2, released=0,
        sample_time=SAMPLE_TIME, every=0)
    return np.asarray(np.abs(extremes).max(axis=1))
