# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The breakaway level at rest depends on position as the model's effects do."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest

from friction_comp.compensation.effect_currents import EffectCurrents
from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects.kinds import FrictionRipple, Gravity, Hysteresis, Temperature
from friction_comp.model.friction_model import Breakaway, FrictionModel
from friction_comp.model.sigmoid import Sigmoid

PLACE = 0.1
RIPPLE = FrictionRipple({'coefficients': [0.02, 0.0], 'frequency': 20.0, 'growth': 0.0,
                         'speed': 0.5, 'transition': 0.001})
GRAVITY = Gravity({'coefficients': [0.0, 0.03]})
NOT_FED_BACK = attrgetter('not_fed_back')


def model(effects, place=PLACE):
    """A drive of 0.1 A breakaway; where it was measured, its effects came on top."""
    ripple = 0.02 * np.cos(20.0 * PLACE) if RIPPLE in effects else 0.0
    push = 0.03 * np.sin(PLACE) if GRAVITY in effects else 0.0
    return FrictionModel(
        drive=Drive(0.119, 100.0, 4000), sigmoid=Sigmoid(0.1, -0.1, 60.0),
        breakaway=Breakaway(0.1 + ripple + push, -0.1 - ripple + push,
                            positive_position=place, negative_position=place),
        effects=list(effects))


def current_at_rest(law, position, direction):
    for k in range(5):
        current = law.update(0.001 * k, [position], [0.0], [direction])
    return current[0]


@pytest.mark.parametrize('direction', [-1, 1])
@pytest.mark.parametrize('position', [-0.4, 0.0, 0.1, 0.23])
def test_level_at_rest_is_the_gain_times_the_local_breakaway(position, direction):
    law = CompensationLaw([model([RIPPLE, GRAVITY])], law='paper', breakaway_gain=0.9)
    here = 0.1 + 0.02 * np.cos(20.0 * position)
    assert current_at_rest(law, position, direction) == pytest.approx(
        direction * 0.9 * here + 0.03 * np.sin(position), abs=1e-4)


def test_without_effects_the_level_is_the_same_everywhere():
    law = CompensationLaw([model([])], law='paper')
    assert current_at_rest(law, 0.3, 1) == current_at_rest(law, -0.3, 1) == pytest.approx(0.09)


def test_without_a_breakaway_position_the_level_is_constant():
    bare = model([RIPPLE])
    bare = replace(bare, breakaway=replace(
        bare.breakaway, positive_position=None, negative_position=None))
    law = CompensationLaw([bare], law='paper')
    assert current_at_rest(law, 0.3, 1) == pytest.approx(0.9 * bare.breakaway.positive_mean)


def test_friction_of_effects_is_asked_for_in_both_directions_of_sliding():
    """Friction changes its sign with the side, also that which turns round slowly."""
    warmth = Temperature({'coefficients': [0.002, 0.0, 0.0], 'reference_temperature': 25.0,
                          'transition': 0.001})
    bristles = Hysteresis({'coefficients': [0.05, 0.0], 'distance': 0.01, 'exponent': 1.0,
                           'transition': 0.001})
    effects = EffectCurrents(model([RIPPLE, GRAVITY, warmth, bristles]), NOT_FED_BACK)
    for temperature, more in ((None, 0.0), (35.0, 0.02)):
        for position in (-0.4, 0.0, 0.23):
            currents = effects.at(1.0, position, 0.0, {
                'temperature': temperature, 'load': None, 'rigid_body': None, 'coupling': None})
            expected = 0.02 * np.cos(20.0 * position) + more + 0.05
            assert currents.forward == pytest.approx(expected)
            assert currents.backward == pytest.approx(-expected)
            assert currents.carried == pytest.approx(0.03 * np.sin(position))
            assert [name for name, _ in currents.missing] == (
                ['temperature'] if temperature is None else [])


def test_a_breakaway_position_is_a_number():
    with pytest.raises(InputError, match='positive_position'):
        Breakaway(0.1, -0.1, positive_position=float('nan'))
