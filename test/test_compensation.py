# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Both compensation laws, and what the motor gets with a model beside what another gives."""

from dataclasses import replace
import math

from helpers import note_model
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw, law_parameters
from friction_comp.compensation.law_kernel import LATE
from friction_comp.compensation.law_parameters import SHARE
from friction_comp.control.feed_forward import changes, feed_forward
from friction_comp.errors import InputError
from friction_comp.exercise.exercise_script import ReferenceMovement
from friction_comp.model.effects import EFFECTS, RESISTS
from friction_comp.model.effects.kinds import Inertia, LoadFriction, Temperature
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway, Presliding
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.simulation.batch import closed_loops
from friction_comp.simulation.joint import Plant, random_states
from friction_comp.simulation.joint_parameters import joint_parameters
from simulated_recordings.closed_loop import closed_loop


def hold(law, direction, seconds=1.5, start=0.0):
    """Leave a law with a joint that does not move and return all its currents."""
    times = start + np.arange(round(seconds * 1000)) * 1e-3
    return np.array([law.update(t, [0.0], [0.0], [direction])[0] for t in times])


def test_printed_law_equals_its_equations():
    """At standstill 0.9 of i_b in the direction d, in motion Eq. 6 alone, whatever d."""
    model = note_model(2)
    law = CompensationLaw([model], law='paper')
    for d in (-1, 0, 1):
        assert law.update(0.0, [0.0], [0.0], [d])[0] == pytest.approx(d * 0.9 * 0.1377)
        for speed in (-0.5, -0.02, 0.02, 0.5):
            current = law.update(0.0, [0.0], [speed], [d])[0]
            assert current == pytest.approx(float(model.sigmoid(speed)))


@pytest.mark.parametrize('d', [-1, 1])
def test_continuous_law_rises_holds_and_falls_without_a_jump(d):
    """The level comes and goes smoothly and stays below the gain's share."""
    law = CompensationLaw([note_model()])
    rest, up = hold(law, 0), hold(law, d, start=1.5)
    down = hold(law, 0, start=3.0)
    assert not rest.any()
    assert up[-1] * d == pytest.approx(0.9 * 0.0995)
    assert np.abs(up).max() <= 0.9 * 0.0995 + 1e-12
    assert down[-1] == 0.0
    everything = np.concatenate((rest, up, down))
    assert np.abs(np.diff(everything)).max() < 0.05 * 0.0995


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


@pytest.mark.parametrize('number', [1, 2, 3])
def test_continuous_law_never_starts_an_untouched_joint(number):
    """With i_b 10 % too large and its scatter, nothing leaves a third of a degree."""
    model = note_model(number)
    wrong = replace(model, breakaway=replace(
        model.breakaway, positive_mean=1.1 * model.breakaway.positive_mean,
        negative_mean=1.1 * model.breakaway.negative_mean))
    # The fit of Eq. 11 is asymmetric at standstill; the continuous law must not depend on it.
    direction = np.ones((2, 4000))
    direction[1] = -1.0
    direction[:, :300] = 0.0
    runs = 120
    _, extremes, _ = closed_loops(
        np.tile(joint_parameters(model), runs), random_states(21, runs),
        np.tile(law_parameters(wrong), runs),
        (0.0 * direction, 0.0 * direction, direction), np.arange(runs) % 2, released=0, every=0)
    assert np.degrees(np.abs(extremes)).max() < 0.33


@pytest.mark.parametrize('law', ['paper', 'continuous'])
def test_faults_give_zero_current(law):
    """What is not finite stops that joint only; odd directions count as none.

    The continuous law does without a velocity.
    """
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
        assert not hold(odd, d, 0.5).any()


def test_limit_and_terms():
    """Output is clipped; the terms add up to it."""
    model = note_model(3)
    law = CompensationLaw([model], law='paper', current_limit=0.1)
    assert law.update(0.0, [0.0], [0.0], [1])[0] == 0.1
    free = CompensationLaw([model])
    for k in range(700):
        current = free.update(k * 1e-3, [2e-7 * k * k], [4e-4 * k], [1])
    total = sum(free.terms[name][0] for name in ('friction', 'effects'))
    assert current[0] == pytest.approx(total)


def test_a_new_model_comes_in_without_a_jump():
    """The current goes to that of the new model within its slope."""
    law, other = CompensationLaw([note_model(1)]), note_model(2)
    currents = []
    for k in range(1000):
        if k == 400:
            law.set_model(0, other)
        currents.append(law.update(k * 1e-3, [0.5e-3 * k], [0.5], [0])[0])
    # From full friction one way to full friction the other takes 20 ms.
    assert np.abs(np.diff(currents[350:])).max() < 0.11 * other.sigmoid.upper
    assert currents[-1] == pytest.approx((SHARE - LATE) * float(other.sigmoid(0.5)), rel=0.01)


def test_a_new_model_is_trusted_anew_and_shows_at_rest_whether_its_drive_holds_it():
    law, step, position = CompensationLaw([note_model(1)]), 1e-3, 0.0
    taken, currents = [], []
    for k in range(2400):
        if k == 1200:
            before = taken[-1]
            law.set_model(0, note_model(1))
        # The joint gives way as soon as it is led, both times.
        if k % 1200 in range(170, 270):
            position += 20e-3 * step
        currents.append(law.update(k * step, [position], None, [1])[0])
        taken.append(law.guards['taken back'][0])
    assert before > 0.29
    assert taken[1201] == 0.0
    # It is led again: the current begins at none, and no jump starts the joint.
    assert min(currents[1200:1260]) < 0.15 * currents[1199]
    assert np.abs(np.diff(currents)).max() < 0.12 * max(currents)
    assert taken[-1] > 0.05


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


@pytest.mark.parametrize('last', ['none', 'kinetic', 'paper', 'continuous'])
@pytest.mark.parametrize('first', ['none', 'kinetic', 'paper', 'continuous'])
def test_retuning_from_any_law_to_any_other_does_not_jump(first, last):
    law, currents = CompensationLaw([note_model(2)], law=first), []
    for k in range(900):
        if k == 300:
            law.retune(last, 0.9)
        currents.append(law.update(k * 1e-3, [0.5e-3 * k], [0.5], [1])[0])
    full = note_model(2).sigmoid.upper
    assert np.abs(np.diff(currents[295:])).max() < 0.11 * full
    if last == 'none':
        assert currents[-1] == pytest.approx(0.0, abs=1e-4 * full)


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
    coefficients = [held * size, *[0.0] * (len(kind.coefficient_names) - 1)]
    effect = kind({'coefficients': coefficients, **CONSTANTS[name]})
    sigmoid = replace(base.sigmoid, upper=base.sigmoid.upper - held * size,
                      lower=base.sigmoid.lower + held * size)
    model = replace(base, sigmoid=sigmoid, effects=[effect], breakaway=replace(
        base.breakaway, positive_position=None, negative_position=None))
    for side in (1.0, -1.0):
        law = CompensationLaw([model])
        for k in range(1500):
            current = law.update(1e-3 * k, [side * 0.5e-3 * k], [side * 0.5], [side])[0]
        time = 1e-3 * np.arange(1500)
        samples = Samples(time=time, position=side * 0.5 * time, current=np.zeros(1500),
                          velocity=np.full(1500, side * 0.5))
        assert current == pytest.approx(
            (SHARE - LATE) * model.predict(samples)[-1], rel=0.02)
        at_rest = hold(CompensationLaw([model]), side)[-1]
        assert at_rest == pytest.approx(side * 0.9 * 0.1377, rel=0.02)


def scaled(model, factor):
    sigmoid, breakaway = model.sigmoid, model.breakaway
    return replace(
        model, sigmoid=replace(sigmoid, upper=factor * sigmoid.upper, viscous=(
            factor * sigmoid.viscous), lower=factor * sigmoid.lower),
        breakaway=replace(breakaway, positive_mean=factor * breakaway.positive_mean,
                          negative_mean=factor * breakaway.negative_mean))


def test_a_model_that_gives_the_motor_less_is_told_with_both_figures():
    model = note_model(1)
    before, little, much = (feed_forward(scaled(model, k)) for k in (1.0, 1.05, 1.3))
    assert before[0] == pytest.approx(0.9 * np.array([model.breakaway.positive_mean] * 2))
    assert not changes(before, little)
    rest, sliding = changes(before, much)
    assert 'at rest, 0.116 A instead of 0.0896 A' in rest
    assert sliding.startswith('sliding')


def test_carried_torque_and_the_arm_do_not_count():
    model = note_model(1)
    heavy = replace(model, effects=[EFFECTS['gravity']({'coefficients': [1.0, 0.5]})])
    assert changes(feed_forward(heavy), feed_forward(model)) == []


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
