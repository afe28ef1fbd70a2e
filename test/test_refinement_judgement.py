# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement must not say: controllers as friction, signs of no drive, guesses as findings."""

from dataclasses import replace
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from friction_comp.drive import Drive
from friction_comp.model.differentiation import delayed, earlier
from friction_comp.model.effects import EFFECTS, Scene
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.refinement.fit.effect_sum import Fit, Term
from friction_comp.refinement.fit.harmonics import exact_families, family_of
from friction_comp.refinement.fit.robust_regression import solve
from friction_comp.refinement.judge.control import control_of
from friction_comp.refinement.judge.physics import objection
from friction_comp.refinement.judge.report import without_friction
from friction_comp.refinement.prepare.fit_data import scene_of
from friction_comp.refinement.prepare.folds import runs_of, split
from friction_comp.refinement.prepare.prepared import prepare
from friction_comp.refinement.thresholds import table
from friction_comp.refinement.units import in_unit
from friction_comp.samples import Samples

SCENE = Scene(transition=0.02, speed=1.0, slowest=0.01, lowest=-1.0, highest=1.0, duration=100.0,
              sample_time=0.01, resolution=1e-5)


def sines(seed, duration=40.0, step=0.01):
    """Return time, position, velocity and acceleration of a sum of sines."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    q, v, a = (np.zeros_like(time) for _ in range(3))
    for frequency in (0.07, 0.19, 0.31, 0.53):
        size, phase = 0.8 / (1.0 + 3.0 * frequency), rng.uniform(0.0, 2.0 * np.pi)
        omega = 2.0 * np.pi * frequency
        q += size * np.sin(omega * time + phase)
        v += size * omega * np.cos(omega * time + phase)
        a -= size * omega ** 2 * np.sin(omega * time + phase)
    return time, q, v, a, rng


def pendulum(seed, load_friction=0.15):
    """Return a joint that carries a weight, its friction growing with what it carries."""
    time, q, v, a, rng = sines(seed)
    weight = 3.0 * np.sin(q)
    current = (weight + 0.3 * a + (0.4 + load_friction * np.abs(weight)) * np.tanh(v / 0.01)
               + 0.2 * v + 0.02 * rng.standard_normal(time.size))
    return Samples(time=time, position=q, velocity=v, current=current)


def test_friction_that_grows_with_the_carried_weight_is_found_without_a_torque_sensor():
    result = refine([pendulum(1)])
    report = result.report
    names = [effect['name'] for effect in report['effects']]
    assert names[0] == 'gravity'
    assert 'inner_load_friction' in names
    assert 'bump' not in names
    found = report['effects'][names.index('inner_load_friction')]
    assert found['parameters']['coefficients'][0] == pytest.approx(0.15, rel=0.15)
    low, high = found['intervals']['coefficients'][0]
    assert low < found['parameters']['coefficients'][0] < high
    assert report['unit'] == 'N·m'
    assert 'N·m' in found['in_words']
    assert ' A ' not in found['in_words']
    assert report['verdict'] in ('trust', 'trust in part')
    assert report['reasons']
    assert report['stopped_because']
    # On another recording it is the same drive.
    fresh = pendulum(2)
    moving = np.abs(fresh.velocity) > 0.05
    assert np.std((fresh.current - result.model.predict(fresh))[moving]) < 0.03


def test_the_order_of_recordings_makes_no_difference():
    parts = [pendulum(3), pendulum(4)]
    assert refine(parts).report == refine(parts[::-1]).report


def test_a_speed_controller_is_not_called_friction():
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 20.0, 0.005)
    wanted = np.repeat(rng.uniform(2.0, 6.0, 8), len(time) // 8)
    velocity = wanted + lfilter([0.2], [1.0, -0.8], rng.standard_normal(len(time)))
    current = 0.4 - 0.1 * np.roll(velocity, 2) + 0.002 * rng.standard_normal(len(time))
    result = refine([Samples(time=time, position=np.cumsum(velocity) * 0.005, velocity=velocity,
                             current=current)])
    assert result.report['effects'] == []
    assert result.report['verdict'] == 'record again'
    assert any('controller' in line for line in result.report['warnings'])


def test_a_speed_controller_hides_no_friction_where_mechanics_asks_for_its_current():
    rng = np.random.default_rng(6)
    step, size = 0.002, 10000
    time = np.arange(size) * step
    wanted = np.repeat(rng.uniform(-1.0, 1.0, 40), size // 40)
    velocity, current = np.zeros(size), np.zeros(size)
    for k in range(size - 1):
        current[k] = 2.0 * (wanted[k] - velocity[k])
        friction = 0.3 * np.tanh(velocity[k] / 0.02) + 0.1 * velocity[k]
        velocity[k + 1] = velocity[k] + step * (current[k] - friction) / 0.05
    current[-1] = current[-2]
    samples = Samples(time=time, position=np.cumsum(velocity) * step, velocity=velocity,
                      reference_velocity=wanted, current=current,
                      acceleration=np.gradient(velocity, step))
    moving = np.abs(velocity) > 0.02
    told = control_of(samples, samples, moving)
    assert told.law == ''
    assert 'speed controller' in told.answer
    # A current that answers speeds which are noise is explained by no drive.
    shaken = samples.with_(velocity=velocity + 0.3 * rng.standard_normal(size))
    shaken = shaken.with_(current=2.0 * (wanted - shaken.velocity),
                          acceleration=np.gradient(shaken.velocity, step))
    told = control_of(shaken, shaken, moving)
    assert 'speed controller' in told.law
    assert told.answer == ''


def test_bumps_are_not_looked_for_where_every_place_is_passed_in_one_motion():
    time = np.arange(0.0, 20.0, 0.005)
    for speeds, one in (((0.5,), True), ((0.1, 0.5, 1.0), False)):
        speed = np.repeat(speeds, len(time) // len(speeds) + 1)[:len(time)]
        # To and fro, turning round within 0.2 s.
        velocity = lfilter([1.0 / 40] * 40, [1.0], speed * np.where(time % 2.0 < 1.0, 1.0, -1.0))
        samples = Samples(time=time, position=np.cumsum(velocity) * 0.005, velocity=velocity,
                          current=np.tanh(velocity / 0.02))
        scene = scene_of(samples, np.abs(velocity) > 0.01, Drive(1.0, 1.0), 0.01)
        assert ('bumps' in EFFECTS['bump'].hard_to_tell(scene)) is one


def test_what_has_nothing_to_do_with_the_motion_gives_the_model_before():
    time, q, v, _, rng = sines(6)
    noise = lfilter([0.05], [1.0, -0.95], rng.standard_normal(time.size))
    result = refine([Samples(time=time, position=q, velocity=v, current=noise)])
    report = result.report
    assert report['after']['held_out_rmse'] <= report['before']['held_out_rmse']
    assert report['verdict'] != 'trust'
    sigmoid = result.model.sigmoid
    assert sigmoid.upper >= sigmoid.lower
    assert sigmoid.viscous >= 0.0


def test_one_file_or_two_are_dealt_alike():
    one, two = pendulum(7), pendulum(8)
    apart = Samples.concatenate([one, two])
    together = replace(apart, recording=np.zeros(len(apart), dtype=int), time=np.concatenate(
        [one.time, two.time + one.time[-1] + 3.0]))
    usable = np.abs(apart.velocity) > 0.02
    dealt = [split(part, usable, part.current, runs_of(part)) for part in (apart, together)]
    assert np.array_equal(dealt[0].fold, dealt[1].fold)
    assert np.array_equal(dealt[0].run, dealt[1].run)
    assert {0, 1} == set(dealt[0].fold)


def test_coefficients_of_the_wrong_sign_are_zero():
    rng = np.random.default_rng(9)
    matrix = rng.standard_normal((500, 3))
    goal = matrix @ [1.0, -2.0, 0.5]
    weights = np.ones(500)
    assert solve(matrix, goal, weights) == pytest.approx([1.0, -2.0, 0.5], rel=1e-6)
    bounded = solve(matrix, goal, weights, (1, 1, 0))
    assert bounded[1] == 0.0
    assert bounded[0] > 0.0


@pytest.mark.parametrize('name, constants, bound', [
    ('hysteresis', {'distance': 0.5, 'exponent': 1.0, 'transition': 0.02}, 'distance'),
    ('hysteresis', {'distance': 0.05, 'exponent': 3.0, 'transition': 0.02}, ''),
    ('actuation_lag', {'lag': 0.15, 'first_order': 1.0}, 'lag'),
    ('actuation_lag', {'lag': 0.02, 'first_order': 1.0}, ''),
    ('stribeck', {'velocity': 0.7, 'exponent': 1.0, 'transition': 0.02}, 'velocity'),
    ('rest_time', {'time_constant': 0.1, 'distance': 0.05, 'velocity': 0.01,
                   'transition': 0.02}, 'time_constant'),
    ('gravity', {}, '')])
def test_an_effect_knows_when_a_constant_ended_at_a_bound(name, constants, bound):
    kind = EFFECTS[name]
    for key, value in constants.items():
        if kind.constants[key] is not None:
            constants = {**constants, key: kind.limited(key, value, constants, SCENE)}
    assert kind.at_bound(constants, SCENE) == bound


@pytest.mark.parametrize('name, changes', [
    ('gravity', {'lowest': 0.0, 'highest': 0.034}), ('rest_time', {'rested': 0.2}),
    ('warm_up', {'duration': 27.0}), ('hysteresis', {'positions': 28.0}),
    ('hysteresis', {'reversals': 0.0}), ('actuation_lag', {'positions': 28.0}),
    ('stribeck', {'slow': 0.9}), ('temperature', {'temperature_span': 1.0}),
    ('direction_asymmetry', {'both_directions': False})])
def test_what_cannot_be_seen_is_said_by_the_effect_itself(name, changes):
    assert EFFECTS[name].hard_to_tell(SCENE) == ''
    assert EFFECTS[name].hard_to_tell(replace(SCENE, **changes)).endswith('.')


def test_what_drifted_by_the_clock_is_left_out_on_another_day():
    drift = EFFECTS['warm_up']({'time_constant': 30.0, 'transition': 0.02,
                                'coefficients': [0.5, 0.0, 0.0]})
    model = FrictionModel(drive=Drive(1.0, 1.0), sigmoid=Sigmoid(0.1, -0.1, 100.0),
                          effects=[drift])
    time, q, v, _, _ = sines(10, duration=10.0)
    samples = Samples(time=time, position=q, velocity=v, current=np.zeros_like(time))
    same, other = model.predict(samples, same_recording=True), model.predict(samples)
    assert np.max(np.abs(same)) > 0.4
    assert np.max(np.abs(other)) == pytest.approx(0.1, rel=0.05)
    assert model.effects == [drift]


def test_relatives_of_a_ripple_are_one_family():
    family = family_of([72.026, 18.01, 144.02, 31.4], span=30.0)
    assert family.base == pytest.approx(18.0, abs=0.02)
    assert family.orders == {0: 4, 1: 1, 2: 8}
    assert family_of([17.3, 41.9], span=30.0) is None
    made = [EFFECTS['cogging']({'frequency': k, 'growth': 0.0, 'speed': 1.0, 'transition': 0.02,
                                'coefficients': [0.1, 0.0]}) for k in (72.0, 18.0, 31.4)]
    found, = exact_families(made)
    assert found.base == 18.0
    assert found.orders == {0: 4, 1: 1}


@pytest.mark.parametrize('unit', ['N·m', 'V'])
def test_sentences_have_the_unit_of_the_recording(unit):
    said = in_unit('Spring-like: +3.5 A per rad', unit)
    assert said == f'Spring-like: +3.5 {unit} per rad'
    assert in_unit('A spring of 2 A', 'A') == 'A spring of 2 A'


def test_every_threshold_has_a_reason():
    rows = table()
    assert len(rows) > 20
    assert all(math.isfinite(value) and len(reason) > 15 for _, value, _, reason in rows)


def gappy():
    """Return samples with gaps, a clock that jumps back and uneven steps."""
    rng = np.random.default_rng(11)
    time = np.cumsum(rng.uniform(0.008, 0.012, 800))
    time[200:] += 3.0
    time[500:] -= 8.0
    values = rng.standard_normal((800, 3))
    return Samples(time=time, position=values[:, 0], current=values[:, 1]), values


@pytest.mark.parametrize('lag', [0.021, -0.005, 0.3])
def test_moving_in_time_stays_within_stretches(lag):
    samples, values = gappy()
    expected = np.array(values)
    for part in samples.segments():
        for column in range(3):
            expected[part, column] = np.interp(
                samples.time[part] + lag, samples.time[part], values[part, column])
    assert earlier(values, samples, lag) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('constant', [0.05, -0.05])
def test_low_pass_and_its_inverse_stay_within_stretches(constant):
    samples, values = gappy()
    expected = np.array(values)
    keep = math.exp(-samples.sample_time / abs(constant))
    for part in samples.segments():
        if constant > 0:
            expected[part] = lfilter([1.0 - keep], [1.0, -keep], values[part], axis=0,
                                     zi=keep * values[part][:1])[0]
        else:
            expected[part] -= constant * np.gradient(values[part], samples.sample_time, axis=0)
    assert delayed(values, samples, constant) == pytest.approx(expected, abs=1e-9)


def test_effects_are_named_rightly_where_a_person_carries_the_load():
    """Under a law, the measured load belongs to model and start alike, and is nothing found."""
    time, position, velocity, _, rng = sines(4)
    drive = Drive(0.119, 100.0)
    model = FrictionModel(drive=drive, sigmoid=Sigmoid(0.1, -0.1, 40.0, 0.0, 0.05))
    friction = model.sigmoid(velocity)
    current = 0.8 * friction
    load = (friction + 0.05 * np.cos(position) - current) * drive.torque_per_current
    samples = Samples(
        time=time, position=position, velocity=velocity, command=current,
        current=current + 0.001 * rng.normal(size=len(time)),
        load=load + 0.005 * rng.normal(size=len(time)),
        direction=np.sign(velocity).astype(int))
    result = refine([samples], model, drive)
    named = [effect['name'] for effect in result.report['effects']]
    assert 'gravity' in named
    assert [effect.name for effect in result.model.effects] == [*named, 'load_torque']


def test_a_weight_held_up_without_friction_is_no_drive():
    weight = EFFECTS['gravity']({'coefficients': [0.1, 3.3]})
    bend = EFFECTS['stribeck']({'velocity': 0.1, 'exponent': 1.0, 'transition': 0.01,
                                'coefficients': [0.2]})

    def model(coulomb, viscous, *effects):
        return FrictionModel(drive=Drive(1.0, 1.0), effects=list(effects), sigmoid=Sigmoid(
            coulomb, -coulomb, steepness=20.0, shift=0.0, viscous=viscous))
    assert without_friction(model(0.0, 0.0, weight))
    for resisting in (model(0.1, 0.0, weight), model(0.0, 0.1, weight),
                      model(0.0, 0.0, weight, bend)):
        assert not without_friction(resisting)


def test_what_two_joints_ask_that_swing_together_is_one_sum():
    # An elbow that swings back while the shoulder swings forth is asked for little: its inertia
    # alone would be many times the current, and what the shoulder asks takes most of it away.
    time, position, velocity, acceleration, _ = sines(3)
    shoulder = 0.02 * np.sin(3.0 * time) - acceleration
    samples = Samples(
        time=time, position=position, velocity=velocity, acceleration=acceleration,
        coupling=shoulder, load=shoulder, recording=np.zeros(len(time), dtype=int),
        current=acceleration + shoulder + 0.02 * np.tanh(velocity / 0.02))
    usable = np.abs(velocity) > 0.02
    data = prepare(samples, usable, Drive(1.0, 1.0), 0.02)

    def objection_beside(name):
        return objection(Fit(data, usable, 100.0, [
            Term(EFFECTS['inertia']), Term(EFFECTS[name])]), 0)
    assert objection_beside('other_joints') == ''
    assert 'far larger than the signal' in objection_beside('load_torque')
