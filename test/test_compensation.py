# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Both compensation laws, and what the motor gets with a model beside what another gives."""

from dataclasses import replace
import math

from closed_loop import closed_loop
from effect_maker import parameters_of
from helpers import drive_along, LEVEL, note_model, ROOT, small_model
from hypothesis import given, Phase, settings, strategies as st
import numpy as np
import pytest
import yaml

from friction_comp.compensation.law import CompensationLaw, LAWS
from friction_comp.compensation.law_kernel import LATE
from friction_comp.compensation.law_parameters import SHARE
from friction_comp.control.feed_forward import changes, feed_forward
from friction_comp.direction.exercise import ReferenceMovement
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.arm import Arm, Coupling, FREE_FALL, Group, PARAMETERS, Tree
from friction_comp.model.effect import CARRIES, RESISTS
from friction_comp.model.effects import (
    EFFECTS,
    FrictionRipple,
    Gravity,
    Inertia,
    LoadFriction,
    Temperature,
)
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.simulation.joint import Plant


def test_printed_law_equals_its_equations():
    """At standstill 0.9 of i_b in the direction d, in motion Eq. 6 alone, whatever d."""
    model = note_model(2)
    law = CompensationLaw([model], law='paper')
    for d in (-1, 0, 1):
        assert law.update(0.0, [0.0], [0.0], [d])[0] == pytest.approx(d * 0.9 * 0.1377)
        for speed in (-0.5, -0.02, 0.02, 0.5):
            current = law.update(0.0, [0.0], [speed], [d])[0]
            assert current == pytest.approx(float(model.sigmoid(speed)))


def test_continuous_law_never_jumps_while_the_joint_is_moved():
    """In a whole trial the current changes by a tenth of i_b at most from sample to sample."""
    model = note_model()
    movement = ReferenceMovement(
        amplitude=0.5, speed=0.35, acceleration_time=1.0, standstill=2.0, repetitions=1)
    log = closed_loop(Plant([model], seed=2), CompensationLaw([model]), movement,
                      movement.duration)
    steps = np.abs(np.diff(log['command'], axis=0))
    assert steps.max() < 0.101 * 0.0995
    paper = closed_loop(Plant([model], seed=2), CompensationLaw([model], law='paper'), movement,
                        movement.duration)
    assert np.abs(np.diff(paper['command'], axis=0)).max() > 0.5 * 0.0995
    moving = log['time'] < movement.begins(1) - movement.standstill
    assert np.abs(log['interaction_torque'][moving]).max() < 0.5 * np.abs(
        paper['interaction_torque'][moving]).max()


@pytest.mark.parametrize('law', ['paper', 'continuous'])
def test_faults_give_zero_current(law):
    """What is not finite stops that joint only; odd directions are none; positions may do."""
    model = note_model()
    for bad in (math.nan, math.inf):
        both = CompensationLaw([model, model], law=law)
        for k in range(150):
            current = both.update(k * 1e-3, [1e-3 * k, 1e-3 * k], [1.0, 1.0], [1, 1])
        assert np.all(current > 0.05)
        current = both.update(0.151, [bad, 0.151], [1.0, 1.0], [1, 1])
        assert current[0] == 0.0
        assert current[1] > 0.05
        current = both.update(0.152, [0.152, 0.152], [1.0, bad], [1, 1])
        assert (current[1] > 0.05) if law == 'continuous' else (current[1] == 0.0)
    odd = CompensationLaw([model], law=law)
    for d in (2, -3, 0.5, math.nan):
        assert not drive_along(odd, np.zeros(500), d, velocity=0.0).any()


def test_limit_and_terms():
    """Output is clipped; the terms add up to it."""
    model = note_model(3)
    law = CompensationLaw([model], law='paper', current_limit=0.1)
    assert law.update(0.0, [0.0], [0.0], [1])[0] == 0.1
    free = CompensationLaw([model])
    time = 1e-3 * np.arange(700)
    current = drive_along(free, 0.2 * time ** 2)
    total = sum(free.terms[name][0] for name in ('friction', 'effects'))
    assert current[-1] == pytest.approx(total)


def test_an_effect_without_its_signal_is_left_out_until_the_signal_comes():
    """The list says so, and the current turns over within its slope limit."""
    model = replace(note_model(2), effects=[
        Temperature({'coefficients': [0.01, 0.0, 0.0], 'reference_temperature': 25.0,
                     'transition': 0.02}),
        LoadFriction({'coefficients': [0.02], 'exponent': 1.0, 'transition': 0.02}),
        Inertia({'coefficients': [0.001]})])
    law, plain = (CompensationLaw([one, note_model(2)]) for one in (model, note_model(2)))
    assert [name for _, name, _ in law.never_applied] == ['inertia']
    currents, differences = [], []
    for k in range(1500):
        known = 500 <= k < 1000
        both = [0.5e-3 * k] * 2, [0.5, 0.5], [1, 1]
        current = law.update(k * 1e-3, *both, temperature=[35.0 if known else math.nan, 35.0],
                             load=[1.0, 1.0] if k >= 250 else None)
        left = {name: signals for joint, name, signals in law.missing}
        assert ('temperature' in left) != known
        assert ('load_friction' in left) == (k < 250)
        assert all(left.values())
        assert not any(joint == 1 for joint, *_ in law.missing)
        currents.append(current[0])
        differences.append(current[0] - plain.update(k * 1e-3, *both)[0])
    assert np.abs(np.diff(currents[50:])).max() < 0.11 * (note_model(2).sigmoid.upper + 0.12)
    assert differences[240] == pytest.approx(0.0, abs=1e-6)
    assert differences[490] == pytest.approx(SHARE * 0.02, rel=0.03)
    assert differences[990] == pytest.approx((SHARE - LATE) * 0.12, rel=0.03)
    assert differences[-1] == pytest.approx((SHARE - LATE) * 0.02, rel=0.03)
    law.reset()
    assert not law.missing


def test_arguments_are_checked():
    """Every refusal names its argument."""
    model = note_model()
    for options, word in (({'law': 'best'}, 'law'), ({'breakaway_gain': -1.0}, 'breakaway_gain'),
                          ({'current_limit': math.nan}, 'current_limit'),
                          ({'gravity': 'up'}, 'gravity')):
        with pytest.raises(InputError, match=word):
            CompensationLaw([model], **options)
    with pytest.raises(InputError, match='position'):
        CompensationLaw([model]).update(0.0, [0.0, 0.0], [0.0], [0])
    with pytest.raises(InputError, match='temperature'):
        CompensationLaw([model]).update(0.0, [0.0], [0.0], [0], temperature=[20.0, 30.0])


@pytest.mark.parametrize('last', ['none', 'kinetic', 'paper', 'continuous', 'another model'])
@pytest.mark.parametrize('first', ['none', 'kinetic', 'paper', 'continuous'])
def test_a_change_to_any_law_or_model_does_not_jump(first, last):
    new = note_model(2)
    law = CompensationLaw([note_model(1) if last == 'another model' else new], law=first)
    before = drive_along(law, 0.5e-3 * np.arange(300), velocity=0.5)
    if last == 'another model':
        law.set_model(0, new)
    else:
        law.retune(last, 0.9)
    after = drive_along(law, 0.5e-3 * np.arange(300, 900), velocity=0.5, begin=300)
    full = new.sigmoid.upper
    assert np.abs(np.diff([*before[-5:], *after])).max() < 0.11 * full
    if last == 'none':
        assert after[-1] == pytest.approx(0.0, abs=1e-4 * full)
    if (first, last) == ('continuous', 'another model'):
        assert after[-1] == pytest.approx((SHARE - LATE) * float(new.sigmoid(0.5)), rel=0.01)


CONSTANTS = {'stribeck': {'velocity': 0.02, 'exponent': 1.0, 'transition': 1e-3},
             'viscous_shape': {'exponent': 0.5, 'reference': 0.5, 'transition': 1e-3},
             'hysteresis': {'distance': 1.5e-3, 'exponent': 1.0, 'transition': 1e-3},
             'friction_ripple': {'frequency': 1e-3, 'growth': 0.0, 'speed': 1.0,
                                 'transition': 1e-3},
             'bump': {'position': 0.0, 'width': 100.0, 'exponent': 2.0, 'directional': 1,
                      'transition': 1e-3}}


@pytest.mark.parametrize('name', sorted(
    name for name, kind in EFFECTS.items() if kind.role == RESISTS and name in CONSTANTS))
@pytest.mark.parametrize('held', [0.0, 1.0])
def test_sliding_and_resting_current_are_what_the_model_predicts(name, held):
    """Whatever terms hold most of the friction: the sigmoid, or an effect."""
    kind, base = EFFECTS[name], note_model(2)
    size = 0.15 if held else 0.05
    coefficients = [held * size, *[0.0] * (len(kind.units) - 1)]
    effect = kind({'coefficients': coefficients, **CONSTANTS[name]})
    sigmoid = replace(base.sigmoid, upper=base.sigmoid.upper - held * size,
                      lower=base.sigmoid.lower + held * size)
    model = replace(base, sigmoid=sigmoid, effects=[effect], breakaway=replace(
        base.breakaway, positive_position=None, negative_position=None))
    for side in (1.0, -1.0):
        time = 1e-3 * np.arange(1500)
        samples = Samples(time=time, position=side * 0.5 * time, current=np.zeros(1500),
                          velocity=np.full(1500, side * 0.5))
        current = drive_along(CompensationLaw([model]), samples.position, side,
                              velocity=side * 0.5)[-1]
        assert current == pytest.approx((SHARE - LATE) * model.predict(samples)[-1], rel=0.02)
        still = drive_along(CompensationLaw([model]), np.zeros(1500), side, velocity=0.0)[-1]
        assert still == pytest.approx(side * 0.9 * 0.1377, rel=0.02)


def scaled(model, factor):
    sigmoid = model.sigmoid
    return replace(
        model, sigmoid=replace(sigmoid, upper=factor * sigmoid.upper, viscous=(
            factor * sigmoid.viscous), lower=factor * sigmoid.lower),
        breakaway=model.breakaway.times(factor))


def test_a_model_that_gives_the_motor_less_is_told_with_both_figures():
    model = note_model(1)
    before, little, much = (feed_forward(scaled(model, k)) for k in (1.0, 1.05, 1.3))
    assert before[0] == pytest.approx(0.9 * np.array([model.breakaway.positive_mean] * 2))
    assert not changes(before, little)
    rest, sliding = changes(before, much)
    assert 'at rest, 0.116 A instead of 0.0896 A' in rest
    assert sliding.startswith('sliding')
    # Neither carried torque nor the arm counts.
    heavy = replace(model, effects=[EFFECTS['gravity']({'coefficients': [1.0, 0.5]})])
    assert changes(feed_forward(heavy), before) == []


def test_friction_turns_round_as_fast_in_an_effect_as_in_the_sigmoid():
    """A recording of a gear that yields far may give all friction to a hysteresis."""
    hysteresis = EFFECTS['hysteresis']({'distance': 2e-4, 'exponent': 1.0, 'transition': 0.02,
                                        'coefficients': [0.5, 0.0]})
    drive = note_model(2).drive
    known = {'breakaway': Breakaway(0.5, -0.5), 'presliding': Presliding(3e-4, std=3e-5)}
    models = [FrictionModel(drive, Sigmoid(0.5, -0.5, 200.0), **known),
              FrictionModel(drive, Sigmoid(1e-3, -1e-3, 6.0), effects=[hysteresis], **known)]
    law = CompensationLaw(models)
    currents = []
    for time in np.arange(0.0, 4.0, 1e-3):
        position = 0.2 * (1.0 - math.cos(3.8 * time))
        currents.append(law.update(time, [position, position], [math.nan] * 2, [0.0, 0.0]))
    plain, effect = np.array(currents)[1000:].T
    assert np.abs(plain).max() > 0.4
    assert np.sqrt(np.mean((plain - effect) ** 2)) < 0.1 * np.sqrt(np.mean(plain ** 2))


def test_friction_of_the_desired_motion_is_fed_forward_however_the_joint_moves():
    """To a follower under another controller, for example an MIT-mode one."""
    law, level = CompensationLaw([small_model()], 'desired'), 0.9 * LEVEL
    time = place = 0.0
    # Within 20 ms, also where the joint stays, comes back, or was never announced to stop.
    for count, speed, direction, expected in (
            (200, 0.0, 0, 0.0), (20, 0.0, 1, level), (500, 0.2, 1, level), (500, -0.2, 1, level),
            (20, 0.0, -1, -level), (500, 0.2, -1, -level), (500, -0.2, -1, -level),
            (20, -0.2, 0, 0.0), (500, 2.7, 1, 0.0), (500, 0.1, 1, level)):
        for _ in range(count):
            time, place = time + 1e-3, place + 1e-3 * speed
            current = law.update(time, [place], None, [direction])[0]
        assert current == pytest.approx(expected, rel=0.03)


def test_the_example_of_a_follower_sets_parameters_that_the_nodes_have():
    known, example = (yaml.safe_load((ROOT / path).read_text(encoding='utf-8')) for path in (
        'config/parameters.yaml', 'examples/mit_mode/arm_like.yaml'))
    for node, content in example.items():
        names = set(content['ros__parameters']) - {'joints', 'model_files'}
        assert names <= set(known[node]['ros__parameters']), node
    # The law of followers, and the source of its direction.
    assert LAWS[example['/**/compensator']['ros__parameters']['law']] == LAWS['desired']
    assert example['/**/direction']['ros__parameters']['source'] == 'reference'


# What a joint gets at rest: the level depends on position as the model's effects do.

@pytest.mark.parametrize('direction', [-1, 1])
@pytest.mark.parametrize(('ripple', 'weight', 'place'), [
    (0.02, 0.03, 0.1), (0.0, 0.0, 0.1), (0.02, 0.0, None)])
def test_level_at_rest_is_the_gain_times_the_local_breakaway(ripple, weight, place, direction):
    """A drive of 0.1 A breakaway; where it was measured, its effects came on top.

    The level is constant where that place is not known.
    """
    both = [FrictionRipple({'coefficients': [ripple, 0.0], 'frequency': 20.0, 'growth': 0.0,
                            'speed': 0.5, 'transition': 0.001}),
            Gravity({'coefficients': [0.0, weight]})]
    there, push = 0.1 + ripple * np.cos(2.0), weight * np.sin(0.1)
    model = FrictionModel(
        drive=Drive(0.119, 100.0, 4000), sigmoid=Sigmoid(0.1, -0.1, 60.0), effects=both,
        breakaway=Breakaway(there + push, push - there, positive_position=place,
                            negative_position=place))
    for position in (-0.4, 0.0, 0.1, 0.23):
        law = CompensationLaw([model], law='paper', breakaway_gain=0.9)
        for k in range(5):
            current = law.update(0.001 * k, [position], [0.0], [direction])[0]
        here = there if place is None else 0.1 + ripple * np.cos(20.0 * position)
        assert current == pytest.approx(
            direction * 0.9 * here + weight * np.sin(position), abs=1e-4)


JOINT = 'elbow'


def pendulum(mass, distance):
    """Return an arm of one horizontal joint: mass·9.81·distance·cos(q) N·m."""
    body = np.zeros((1, PARAMETERS))
    body[0, :2] = mass, mass * distance
    # Turned about -y, x rises.
    return Arm(Tree((JOINT,), ('revolute',), np.array([-1]), np.eye(3)[None], np.zeros((1, 3)),
                    np.array([[0.0, -1.0, 0.0]]), body, np.array(FREE_FALL)))


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
    arm = {'other_joints': Arm(Coupling(
        (Group('weight', ((JOINT, 1),)),), ((data.draw(st.floats(-3.0, 3.0)), 0.4),)))}.get(
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
