# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Section 2.6: ten repetitions each way by a simulated person, with and without compensation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from friction_comp.compensation.law import law_parameters
from friction_comp.evaluation.conditions import evaluate, Evaluation
from friction_comp.samples import Samples
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint_parameters import joint_parameters
from friction_comp.simulation.joint_records import FRICTION
from friction_comp.simulation.random_sequence import random_states

if TYPE_CHECKING:
    from friction_comp.exercise.reference_movement import ReferenceMovement
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.note.published import Experiment

SAMPLE_TIME = 1e-3
REPETITIONS = 10
CONDITIONS = ('none', 'kinetic', 'paper', 'continuous', 'inertia')
# Variation of human movements: standard deviations of the person's stiffness (relative), of the
# time at which the movement begins, s, and of its speed (relative).
STIFFNESS_VARIATION, DELAY_VARIATION, SPEED_VARIATION = 0.05, 0.01, 0.02


@dataclass(frozen=True)
class ConditionRun:
    """Evaluation and log, arrays of shape (R, N), of one condition.

    `peak` is the mean over both directions of the ensemble average's peak, N·m.
    """

    evaluation: Evaluation
    peak: float
    log: dict[str, np.ndarray]


def persons_reference(movement: ReferenceMovement, time: np.ndarray, repetitions: int,
                      seed: int) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """Return what the person aims at in each repetition, and factors of the person's stiffness.

    Position, velocity and direction have the shape (repetitions, N).
    """
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


def run_trial(experiment: Experiment, model: FrictionModel, name: str, seed: int, gain: float = 0.9,
              dead_speed: float = 0.0, repetitions: int = REPETITIONS) -> ConditionRun:
    """Run one condition.

    Parameters
    ----------
    experiment : Experiment
    model : FrictionModel
        What the compensation knows.
    name : str
        One of `CONDITIONS`.
    seed : int
        Of the person and of the joint; the same person comes under every condition.
    gain : float
        breakaway_gain.
    dead_speed : float
        rad/s up to which the printed kinetic term is left out; for showing what it does there.
    repetitions : int
    """
    movement = experiment.movement(compensated=name in ('paper', 'continuous'))
    count = round((movement.begins(1) + movement.movement_time + 1.0) / SAMPLE_TIME)
    time = np.arange(count) * SAMPLE_TIME
    reference, factors = persons_reference(movement, time, repetitions, seed)
    parameters = np.tile(joint_parameters(experiment.model()), repetitions)
    parameters['human_stiffness'] *= factors
    parameters['human_damping'] *= np.sqrt(factors)
    if name == 'inertia':
        # A bearing without friction: the small remaining levels only keep the formulas finite.
        for field in FRICTION:
            parameters[field] *= 1e-6
    law = law_parameters(model, 'none' if name == 'inertia' else name, gain)
    law['dead_speed'] = dead_speed
    log, _, _ = closed_loops(
        parameters, random_states((seed, 1), repetitions), np.tile(law, repetitions),
        reference, np.arange(repetitions), sample_time=SAMPLE_TIME)
    shown = movement.at(time)
    recordings = [
        Samples(
            time=time, position=log['position'][r], velocity=log['velocity'][r],
            current=log['current'][r], load=log['interaction_torque'][r],
            direction=shown[2].astype(float), reference_position=shown[0],
            reference_velocity=shown[1], joint=f'armin_{experiment.number}')
        for r in range(repetitions)]
    evaluation = evaluate(recordings, [f'repetition {r + 1}' for r in range(repetitions)])
    peak = float(np.mean([condition.peak_torque for condition in evaluation.conditions]))
    return ConditionRun(evaluation, peak, log)
