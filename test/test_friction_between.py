# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Differential wrists, whose motor turns with the sum or the difference of two joints."""

from dataclasses import replace

from helpers import sines
import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.model.arm.coupling import Coupling
from friction_comp.refinement import refine
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms

NAMES = ('pitch', 'roll')
NOISE = 0.02


def wrist(seed, side, coulomb=0.5, viscous=0.2):
    """Return the roll joint: 0.3 A Coulomb and 0.1 viscous alone, the rest of v_roll ± v_pitch."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 40.0, 0.01)
    position, velocity, acceleration = np.transpose([sines(time, (
        (0.15 / frequency, 2 * np.pi * frequency * rng.uniform(0.8, 1.2), rng.uniform(0.0, 6.28))
        for frequency in np.geomspace(0.1, 1.0, 5))) for _ in NAMES], (1, 2, 0))
    own = velocity[:, 1]
    both = own + side * velocity[:, 0]
    current = (0.3 * np.tanh(own / 0.02) + 0.1 * own + 0.03 * acceleration[:, 1]
               + coulomb * np.tanh(both / 0.02) + viscous * both)
    return Samples(time=time, position=position[:, 1], velocity=own, joint='roll',
                   current=current + NOISE * rng.standard_normal(len(time)),
                   arm=JointStates(NAMES, position, velocity))


def between(result):
    """Return the effects that are friction between joints."""
    return [effect for effect in result.report.effects if effect.name == 'friction_between']


@pytest.mark.parametrize('side', [1, -1])
def test_friction_that_turns_with_two_joints_is_named_with_both(side):
    result = refine([wrist(2, side)])
    entry, = between(result)
    coulomb, viscous = entry.parameters['coefficients']
    assert coulomb == pytest.approx(0.5, rel=0.1)
    assert viscous == pytest.approx(0.2, rel=0.1)
    assert 'roll and pitch' in entry.in_words
    assert result.report.effects[0].name == 'friction_between'
    other = wrist(5, side)
    assert rms(other.current - result.model.predict(other)) < 2.5 * NOISE
    # The file says all of it.
    arm = result.model.arm
    again = replace(arm, source=Coupling.from_dict(arm.source.to_dict()))
    assert again.with_signal(other).coupling == pytest.approx(arm.with_signal(other).coupling)
    # It is no weight: nothing of it acts at rest.
    assert again.at_rest(np.array([0.3] * len(again.joints)), 'roll') == 0.0


def test_no_friction_between_joints_is_named_where_there_is_none():
    assert not between(refine([wrist(2, 1, 0.0, 0.0)]))


@pytest.mark.parametrize('width', [0.0, -1.0, None])
def test_friction_between_joints_without_a_width_is_refused(width):
    group = {'kind': 'friction', 'angles': [['roll', 1], ['pitch', -1]], 'joints': [],
             'coefficients': [0.1, 0.2], 'width': width}
    with pytest.raises(InputError, match='coupling'):
        Coupling.from_dict({'groups': [group]})
