# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What effects say of themselves, and what is special about some of them."""

import math

import numpy as np
import pytest
from test_effect_properties import defaults, LIVE

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.history_effects import Hysteresis
from friction_comp.model.effects.live_term import LiveTerm, SHARPEST_LIVE
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples


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


@pytest.mark.parametrize('name', EFFECTS)
def test_an_effect_describes_itself_and_says_why_it_is_not_fed_back(name):
    effect = EFFECTS[name](defaults(name))
    assert len(effect.describe()) > 10
    assert effect.formula()
    assert bool(effect.not_fed_back) == (name not in LIVE)


def test_live_signs_are_never_sharper_than_stated():
    sharp = {**defaults('stribeck'), 'transition': 1e-5}
    term = LiveTerm(EFFECTS['stribeck'](sharp))
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


@pytest.mark.parametrize(('exponent', 'left'), [
    (0.5, (math.sqrt(2) - 0.5) ** 2), (1.0, 2 / math.e), (2.0, 1 / 1.5)])
def test_hysteresis_reverses_as_its_exponent_says(exponent, left):
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
        EFFECTS['temperature'](defaults('temperature')).current(bare)
    with pytest.raises(InputError, match='load'):
        EFFECTS['load_torque'](defaults('load_torque')).current(bare)
