# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""At rest a joint gets the current that its model says, or the law says why not."""

from dataclasses import replace
import math

from effect_maker import parameters_of
from helpers import note_model
from hypothesis import given, Phase, settings, strategies as st
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.model.arm import Arm, Coupling, FREE_FALL, Group, PARAMETERS, Tree
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.base import CARRIES
from friction_comp.samples import Samples

JOINT = 'elbow'


def pendulum(mass, distance):
    """Return an arm of one horizontal joint: mass·9.81·distance·cos(q) N·m."""
    body = np.zeros((1, PARAMETERS))
    body[0, :2] = mass, mass * distance
    # Turned about -y, x rises.
    return Arm(Tree((JOINT,), ('revolute',), np.array([-1]), np.eye(3)[None], np.zeros((1, 3)),
                    np.array([[0.0, -1.0, 0.0]]), body, np.array(FREE_FALL)))


def others(cosine, sine):
    return Arm(Coupling((Group('weight', ((JOINT, 1),)),), ((cosine, sine),)))


def loaded(effect, arm=None, limit=3.0):
    model = note_model(1)
    return replace(model, joint=JOINT, effects=[effect], arm=arm,
                   drive=replace(model.drive, current_limit=limit))


def at_rest(law, position, seconds=3.0, **signals):
    """Return the current of a joint that has rested at a position for some time."""
    for k in range(round(100 * seconds)):
        current = law.update(0.01 * k, [position], [0.0], [0.0], **signals)
    return float(current[0])


@pytest.mark.parametrize('name', EFFECTS)
@settings(max_examples=6, phases=[Phase.generate])
@given(data=st.data())
def test_the_current_at_rest_is_predicted_or_a_reason_stands_beside_it(name, data):
    position, temperature = data.draw(st.floats(-9.0, 9.0)), data.draw(st.floats(-20.0, 90.0))
    arm = {'other_joints': others(data.draw(st.floats(-3.0, 3.0)), 0.4)}.get(
        name, pendulum(data.draw(st.floats(0.1, 9.0)), data.draw(st.floats(-0.5, 0.5))))
    effect = EFFECTS[name](data.draw(parameters_of(name)))
    model = loaded(effect, arm, data.draw(st.floats(0.2, 30.0)))
    law = CompensationLaw([model], sample_time=0.01)
    current = at_rest(law, position, temperature=[temperature], load=[1.5])
    still = np.full(50, 1.0)
    # As `predict`, but with a velocity of exactly zero.
    resting = model.with_arm(Samples(
        time=0.01 * np.arange(50), position=position * still, velocity=0.0 * still,
        acceleration=0.0 * still, current=0.0 * still, temperature=temperature * still,
        load=1.5 * still, joint=JOINT))
    said = float(effect.current(resting)[-1]) if effect.role == CARRIES and (
        not effect.not_fed_back) else 0.0
    limit = model.drive.current_limit
    assert current == pytest.approx(max(-limit, min(limit, said)), abs=1e-6)
    told = law.never_applied + law.missing + law.limited
    assert bool(told) == bool(abs(said) > limit + 1e-9 or effect.not_fed_back)


def test_what_is_no_torque_or_must_not_be_fed_back_is_left_out():
    """A rising feedback of load or acceleration, or a drift that is none, would push the joint."""
    assert {name for name, kind in EFFECTS.items() if kind.not_fed_back} == {
        'inertia', 'load_torque', 'offset_drift', 'warm_up'}


def test_what_a_limit_takes_from_the_weight_is_said():
    law = CompensationLaw([loaded(EFFECTS['rigid_body']({'coefficients': [0.1]}),
                                  pendulum(5.0, 0.5), 1.5)])
    assert at_rest(law, 0.0) == pytest.approx(1.5)
    (joint, name, why), = law.limited
    assert (joint, name) == (0, 'rigid_body')
    assert '2.45 A' in why
    assert '1.5 A' in why
    # In a posture that needs less, nothing is taken.
    assert at_rest(law, 1.2) == pytest.approx(2.4525 * math.cos(1.2))
    assert not law.limited
