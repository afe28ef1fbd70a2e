# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects in compiled code are the effects of the compensator."""

from dataclasses import replace

from numba import njit
import numpy as np
import pytest
from test_effects import PARAMETERS

from friction_comp.compensation.compiled_effects import ASKED, compiled_effects, memory_size
from friction_comp.compensation.effects_here import EffectsHere
from friction_comp.compensation.law import CompensationLaw
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.base import Effect
from friction_comp.model.friction_model import Breakaway, FrictionModel
from friction_comp.package_files import package_file
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.joint_parameters import joint_parameters
from friction_comp.simulation.random_sequence import random_states
from simulated_recordings.closed_loop import closed_loop

OTHERS = {'rigid_body', 'coupling', 'load'}


def refined(names, scale=1.0):
    """Return configuration 1 with effects, its breakaway measured at two places."""
    model = FrictionModel.load(package_file('config', 'armin_configuration_1.yaml'))
    effects = []
    for name in names:
        parameters = dict(PARAMETERS[name])
        parameters['coefficients'] = [scale * c for c in parameters['coefficients']]
        effects.append(EFFECTS[name](parameters))
    both = model.breakaway
    return replace(model, effects=effects, breakaway=Breakaway(
        both.positive_mean, both.negative_mean, both.positive_std, both.negative_std,
        positive_position=0.1, negative_position=-0.2))


@njit
def ask(function, time, position, speed, temperature, continuous, memory, asked):
    """Ask as a compiled loop does."""
    function(time, position, speed, temperature, continuous, memory, asked[0])


def own_effects():
    """Return the names of all effects that need no more than the joint itself."""
    return [name for name, kind in EFFECTS.items() if not OTHERS & set(kind.needs)]


@pytest.fixture(scope='module')
def everything():
    """Return a model with all effects, and these compiled."""
    model = refined(own_effects())
    return model, compiled_effects(model)


@pytest.mark.slow
@pytest.mark.parametrize('continuous', [True, False])
def test_compiled_effects_ask_for_what_the_live_ones_do(everything, continuous):
    """All effects at once, over a motion with rests, reversals and a clock that stands still."""
    model, function = everything
    here = EffectsHere(model, Effect.why_left_out)
    assert len(here) > 8
    memory = np.zeros(memory_size(model))
    asked = np.zeros(1, ASKED)
    rng = np.random.default_rng(1)
    time = position = 0.0
    largest = np.zeros(5)
    for k in range(400):
        velocity = float(rng.choice([0.0, 0.004, -0.3, 0.7]))
        time += float(rng.choice([0.0, 0.001, 0.2]))
        position += 0.01 * velocity
        signals = {'temperature': 25.0 + 0.1 * k, 'load': None, 'rigid_body': None,
                   'coupling': None}
        wanted = (here.ask if continuous else here.total)(time, position, velocity, signals)
        ask(function, time, position, velocity, signals['temperature'], continuous, memory, asked)
        values = [wanted.forward, wanted.backward, wanted.carried, *wanted.shifts]
        np.testing.assert_allclose(list(asked[0]), values, rtol=1e-9, atol=1e-12)
        largest = np.maximum(largest, np.abs(values))
    assert np.all(largest[[2, 3, 4]] > 1e-3)
    assert np.all(largest[:2] > 0.01) == continuous


@pytest.mark.slow
def test_a_batch_of_refined_joints_is_the_plain_loop():
    """The same refined model, laws, plant and person in compiled code and in Python."""
    model = refined(['gravity', 'bump', 'hysteresis', 'temperature'], 0.05)
    movement = ReferenceMovement(repetitions=1, amplitude=0.3, speed=0.35, standstill=1.0)
    laws = ('continuous', 'paper')
    plain = [closed_loop(Plant([model], seed=8), CompensationLaw([model], law), movement,
                         movement.duration, reference_period=1e-3) for law in laws]
    batch = (np.tile(joint_parameters(model), 2), np.tile(random_states(8, 1), (2, 1)),
             np.concatenate([CompensationLaw([model], law).parameters for law in laws]),
             movement.at(plain[0]['time']))
    # One compilation of the effects serves both.
    log, _, _ = closed_loops(*batch, model=model)
    without, _, _ = closed_loops(*batch)
    for number, one in enumerate(plain):
        for name in ('position', 'command', 'interaction_torque'):
            assert np.abs(one[name][:, 0] - log[name][number]).max() < 1e-9
        assert np.abs(without['command'][number] - log['command'][number]).max() > 1e-3
