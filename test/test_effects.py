# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Every effect of the library: its current, its file entry, and what is fed back of it."""

import math

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS, VARIABLES
from friction_comp.model.effects.history_effects import Hysteresis
from friction_comp.model.effects.live_term import SHARPEST_LIVE
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

PARAMETERS = {
    'stribeck': {'velocity': 0.1, 'exponent': 2.0, 'transition': 0.02, 'coefficients': [0.1]},
    'viscous_shape': {'exponent': 0.5, 'reference': 1.0, 'transition': 0.02,
                      'coefficients': [0.1]},
    'direction_asymmetry': {'offset': 0.0, 'transition': 0.02, 'coefficients': [0.05, 0.02]},
    'gravity': {'coefficients': [0.2, 0.1]},
    'spring': {'position': 0.3, 'coefficients': [0.2]},
    'cogging': {'frequency': 12.0, 'growth': 0.0, 'speed': 1.0, 'transition': 0.02,
                'coefficients': [0.1, 0.05]},
    'friction_ripple': {'frequency': 12.0, 'growth': 1.0, 'speed': 1.0, 'transition': 0.02,
                        'coefficients': [0.1, 0.05]},
    'bump': {'position': 0.2, 'width': 0.1, 'exponent': 2.0, 'directional': 1.0,
             'transition': 0.02, 'coefficients': [0.2]},
    'inertia': {'coefficients': [0.3]},
    'load_torque': {'coefficients': [-0.08]},
    'load_friction': {'exponent': 1.0, 'transition': 0.02, 'coefficients': [0.05]},
    'rigid_body': {'coefficients': [0.1]},
    'other_joints': {'coefficients': [1.0]},
    'carried_load_friction': {'exponent': 1.0, 'transition': 0.02, 'coefficients': [0.05]},
    'inner_load_friction': {
        'cosine': 0.2, 'sine': 0.1, 'slope': 0.0, 'offset': 0.0, 'inertia': 0.0,
        'with_inertia': 0.0, 'exponent': 1.0, 'fading': 0.0, 'velocity': 1.0, 'transition': 0.02,
        'coefficients': [0.1]},
    'temperature': {'reference_temperature': 25.0, 'transition': 0.02,
                    'coefficients': [-0.002, -0.001, 0.0]},
    'warm_up': {'time_constant': 30.0, 'transition': 0.02, 'coefficients': [0.05, 0.02, 0.0]},
    'offset_drift': {'time_constant': 30.0, 'coefficients': [0.05]},
    'hysteresis': {'distance': 0.05, 'exponent': 1.0, 'transition': 0.02,
                   'coefficients': [0.1, 0.002]},
    'rest_time': {'time_constant': 1.0, 'distance': 0.05, 'velocity': 0.01, 'transition': 0.02,
                  'coefficients': [0.1]},
}
LEFT_OUT = {'inertia', 'load_torque', 'offset_drift', 'warm_up'}
# Torques that do not care for the direction of motion: they may hold a joint at rest.
HOLDS = {'gravity', 'spring', 'cogging', 'rigid_body', 'other_joints'}


@pytest.fixture(scope='module')
def motion():
    time = np.arange(0.0, 20.0, 0.01)
    position = 0.8 * np.sin(0.7 * time) + 0.1 * np.sin(3.1 * time)
    velocity = np.gradient(position, time)
    return Samples(
        time=time, position=position, velocity=velocity, current=np.zeros_like(time),
        acceleration=np.gradient(velocity, time), load=2.0 * np.sin(1.3 * time),
        temperature=25.0 + 0.5 * time, rigid_body=3.0 * np.cos(position),
        coupling=0.4 * np.sin(position))


def test_every_effect_of_the_library_is_tried_here():
    assert set(PARAMETERS) == set(EFFECTS)


@pytest.mark.parametrize('name', EFFECTS)
class TestEffect:
    def test_its_variable_is_one_of_those_that_reports_know(self, name):
        assert EFFECTS[name].variable in VARIABLES

    def test_current_is_finite_and_proportional_to_the_coefficients(self, name, motion):
        parameters = PARAMETERS[name]
        once = EFFECTS[name](parameters).current(motion)
        twice = EFFECTS[name]({
            **parameters, 'coefficients': [2 * c for c in parameters['coefficients']]})
        assert once.shape == (len(motion),)
        assert np.isfinite(once).all()
        np.testing.assert_allclose(twice.current(motion), 2 * once)
        assert np.abs(once).max() > 1e-3

    def test_file_entry_makes_the_same_effect(self, name, motion):
        effect = EFFECTS[name](PARAMETERS[name])
        again = EFFECTS[name](effect.to_dict()['parameters'])
        np.testing.assert_array_equal(again.current(motion), effect.current(motion))

    def test_it_says_what_it_is(self, name):
        effect = EFFECTS[name](PARAMETERS[name])
        assert len(effect.describe()) > 10
        assert effect.formula()

    def test_unknown_or_missing_parameters_are_refused(self, name):
        with pytest.raises(InputError, match='unknown'):
            EFFECTS[name]({**PARAMETERS[name], 'colour': 1.0})
        with pytest.raises(InputError, match='coefficients'):
            EFFECTS[name]({key: value for key, value in PARAMETERS[name].items()
                           if key != 'coefficients'})
        with pytest.raises(InputError, match='finite'):
            EFFECTS[name]({**PARAMETERS[name], 'coefficients': [math.nan]})

    def test_live_it_is_the_same_current_at_speed_or_it_says_why_not(self, name, motion):
        effect = EFFECTS[name](PARAMETERS[name])
        term = effect.live()
        if name in LEFT_OUT:
            assert term is None
            assert len(effect.not_fed_back) > 20
            return
        assert not effect.not_fed_back
        live = [term.update(*row) for row in zip(
            motion.time, motion.position, motion.velocity, motion.temperature, motion.load,
            motion.rigid_body, motion.coupling)]
        # Away from reversals, where the two signs of friction are the same.
        fast = np.abs(motion.velocity) > 0.25
        fast &= motion.time > 6.0
        np.testing.assert_allclose(
            np.array(live)[fast], effect.current(motion)[fast], atol=2e-3)

    def test_live_it_does_not_push_a_joint_at_rest(self, name):
        term = EFFECTS[name](PARAMETERS[name]).live()
        if term is None or name in HOLDS:
            return
        for k in range(100):
            term.update(0.01 * k, 0.005 * k, 0.5, 30.0, 1.0, 1.0, 1.0)
        assert term.update(1.0, 0.5, 0.0, 30.0, 1.0, 1.0, 1.0) == pytest.approx(0.0, abs=1e-12)


def test_live_signs_are_never_sharper_than_stated():
    sharp = {**PARAMETERS['stribeck'], 'transition': 1e-5}
    term = EFFECTS['stribeck'](sharp).live()
    assert term.update(0.0, 0.0, 0.1 * SHARPEST_LIVE) < 0.2 * sharp['coefficients'][0]


def test_lag_moves_the_whole_prediction_in_time(motion):
    sigmoid = Sigmoid(upper=0.2, lower=-0.2, steepness=50.0, viscous=0.1)
    effects = [EFFECTS['gravity']({'coefficients': [0.3, 0.1]})]
    settings = {'source': 'velocity', 'bandwidth': None}
    late, plain = (
        FrictionModel(Drive(0.1, 100.0), sigmoid, effects=effects,
                      differentiation={**settings, **lag}).predict(motion)
        for lag in ({'lag': 0.02}, {}))
    np.testing.assert_allclose(late[:-2], plain[2:], atol=1e-9)


def test_hysteresis_turns_round_over_its_distance():
    position = np.concatenate((np.linspace(0, 1, 1001), np.linspace(1, 0, 1001)[1:]))
    time = 0.001 * np.arange(len(position))
    samples = Samples(time=time, position=position, velocity=np.gradient(position, time),
                      current=np.zeros_like(time))
    still = {**PARAMETERS['hysteresis'], 'coefficients': [0.1, 0.0]}
    current = EFFECTS['hysteresis'](still).current(samples)
    assert current[1000] == pytest.approx(0.1, rel=1e-6)
    # After one distance of 0.05 rad the state is -1 + 2/e of its amplitude.
    assert current[1050] == pytest.approx(0.1 * (-1 + 2 / math.e), rel=1e-3)


@pytest.mark.parametrize(('exponent', 'left'), [
    (0.5, (math.sqrt(2) - 0.5) ** 2), (1.0, 2 / math.e), (2.0, 1 / 1.5)])
def test_hysteresis_turns_round_as_its_exponent_says(exponent, left):
    # The solution of du/dx = -u^p for u = 1 - z, which is 2 at the reversal, at x = 1.
    c = Hysteresis.Constants(0.05, exponent, 0.02)

    def turned(state, step):
        return Hysteresis.step(state, 0.0, step, 0.0, c)
    assert 1.0 - turned(-1.0, 0.05) == pytest.approx(left)
    halves = turned(turned(-1.0, 0.02), 0.03)
    assert halves == pytest.approx(turned(-1.0, 0.05))
    assert turned(0.3, 0.0) == 0.3
    assert turned(0.3, -1e3) == pytest.approx(-1.0, abs=1e-3)


def test_damping_of_the_bristles_is_the_change_of_their_state():
    time = np.arange(0.0, 4.0, 0.001)
    position = 0.5 * np.sin(2.0 * time)
    samples = Samples(time=time, position=position, velocity=np.cos(2.0 * time),
                      current=np.zeros_like(time))
    kind, still = EFFECTS['hysteresis'], {'distance': 0.1, 'exponent': 1.3, 'transition': 1e-4}
    state = kind({**still, 'coefficients': [1.0, 0.0]}).current(samples)
    change = kind({**still, 'coefficients': [0.0, 1.0]}).current(samples)
    inner = np.abs(samples.velocity) > 0.05
    assert change[inner] == pytest.approx(np.gradient(state, time)[inner], abs=0.05)


def test_effects_without_their_signal_say_so(motion):
    bare = motion.with_(temperature=None, load=None)
    with pytest.raises(InputError, match='temperature'):
        EFFECTS['temperature'](PARAMETERS['temperature']).current(bare)
    with pytest.raises(InputError, match='load'):
        EFFECTS['load_torque'](PARAMETERS['load_torque']).current(bare)
