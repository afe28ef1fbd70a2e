# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement must not be misled by: hidden inertia, filtered velocity, one-sided motion."""

from helpers import swings
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.statistics import rms

DRIVE = Drive(0.1, 100.0)
NOISE = 0.003


def strokes(seed, duration=80.0, rate=100.0):
    """Return time, position, velocity and acceleration of minimum-jerk strokes."""
    rng = np.random.default_rng(seed)
    parts, place = [], 0.0
    while sum(map(len, parts)) < duration * rate:
        goal = rng.uniform(-0.8, 0.8)
        length = max(20, int(rate * 1.875 * abs(goal - place) / rng.uniform(0.15, 0.9)))
        s = np.arange(length) / length
        parts.append(place + (goal - place) * (10 * s ** 3 - 15 * s ** 4 + 6 * s ** 5))
        place = goal
    q = np.concatenate(parts)[:int(duration * rate)]
    t = np.arange(len(q)) / rate
    v = np.gradient(q, t)
    return t, q, v, np.gradient(v, t)


def recorded(t, q, current, seed, counts=100_000, **signals):
    """Return samples with noise and an encoder's steps."""
    rng = np.random.default_rng([seed, 7])
    step = 2.0 * np.pi / counts
    return Samples(
        time=t, position=np.round(q / step) * step,
        current=current + NOISE * rng.standard_normal(len(t)),
        recording=np.zeros(len(t), dtype=int), **signals)


def friction(v):
    return 0.12 * np.tanh(v / 0.02) + 0.06 * v


def names(report):
    return [effect.name for effect in report.effects]


def traced(report):
    return [entry.variable for entry in report.unexplained]


@pytest.mark.slow
def test_inertia_is_found_beside_a_larger_effect_without_a_name():
    t, q, v, a = strokes(3)
    rough = 0.08 * np.sign(np.sin(9.0 * q) + 0.3) * np.where(q > 0.1, 1.0, -0.4)
    step = np.where(t > 61.0, 0.08, 0.0) * np.tanh(v / 0.02)
    report = refine([recorded(t, q, friction(v) + 0.05 * a + rough + step, 3)],
                    drive=DRIVE).report
    inertia = next(e for e in report.effects if e.name == 'inertia')
    assert inertia.parameters['coefficients'][0] == pytest.approx(0.05, rel=0.25)
    assert report.unexplained


@pytest.mark.slow
def test_a_lasting_change_is_not_called_warm_up():
    t, q, v, _ = strokes(5)
    changed = friction(v) * np.where(t > 55.0, 1.4, 1.0)
    report = refine([recorded(t, q, changed, 5)], drive=DRIVE).report
    # It may look like one, which is then said to be open.
    assert 'time' in {*traced(report), *(one for entry in report.ambiguous
                                         for one in entry.between)}
    assert report.verdict != 'trust'


def test_friction_of_the_size_of_acceleration_is_traced_to_it():
    t, q, v, a = strokes(6)
    report = refine([recorded(t, q, friction(v) + 0.03 * np.abs(a), 6)], drive=DRIVE).report
    assert traced(report)[0] == 'acceleration'
    assert 'direction_asymmetry' not in names(report)


@pytest.mark.slow
def test_coarse_velocities_are_not_mistaken_for_a_lag():
    t, q, v, _ = strokes(7)
    report = refine([recorded(t, 0.4 * q, friction(0.4 * v), 7, counts=20_000)],
                    drive=DRIVE).report
    assert names(report) == []


@pytest.mark.parametrize('reach, name', [(0.2, 'spring'), (1.5, 'gravity')])
def test_a_weight_over_a_few_degrees_looks_like_a_spring(reach, name):
    t = np.arange(0.0, 40.0, 0.005)
    q = reach * (0.6 * np.sin(1.1 * t) + 0.4 * np.sin(2.9 * t + 0.4))
    v = np.gradient(q, t)
    current = (0.8 * np.tanh(v / 0.02) + 0.3 * v + 0.05 * np.gradient(v, t) + 0.5 * np.cos(q - 0.3)
               + np.random.default_rng(1).normal(0.0, 0.02, len(t)))
    report = refine([Samples(time=t, position=q, velocity=v, current=current)]).report
    assert {'inertia', name} <= set(names(report))
    # What predicts as well is said, and lowers the verdict.
    rivals = [one for effect in report.effects for one in effect.instead]
    assert report.verdict == ('trust in part' if rivals else 'trust')


@pytest.mark.slow
def test_a_bump_that_a_fold_crosses_one_way_only_is_still_found():
    t, q, v, _ = strokes(8, duration=100.0)
    bump = 0.05 * np.exp(-((q - 0.74) / 0.05) ** 2) * np.tanh(v / 0.02)
    result = refine([recorded(t, q, friction(v) + bump, 8)], drive=DRIVE)
    assert names(result.report)[0] == 'bump'
    t, q, v, _ = strokes(9)
    current = friction(v) + 0.05 * np.exp(-((q - 0.74) / 0.05) ** 2) * np.tanh(v / 0.02)
    other = recorded(t, q, current, 9)
    moving = np.abs(v) > 0.02
    error = (result.model.predict(other) - other.current)[moving]
    assert rms(error) < 1.3 * NOISE


@pytest.mark.parametrize('scale, said', [(1.02, False), (1.6, True), (0.6, True)])
def test_velocity_that_is_not_the_slope_of_position_is_said(scale, said):
    t, q, v, _ = strokes(2, duration=40.0)
    report = refine([recorded(t, q, friction(v), 2, velocity=v / scale)], drive=DRIVE).report
    told = [finding for finding in report.findings if finding.code == 'signals']
    assert bool(told) == said
    assert report.verdict == ('trust in part' if said else 'trust')


def test_temperature_is_preferred_to_time_if_both_explain_equally():
    rng = np.random.default_rng(2)
    base = swings(6, 150.0, 0.02).with_(acceleration=None)
    drift = np.exp(-base.time / 60.0)
    temperature = np.round(43.0 - 18.0 * drift, 1)
    current = base.current + 0.25 * drift * np.tanh(base.velocity / 0.01)
    report = refine([base.with_(current=current + 0.01 * rng.standard_normal(len(base)),
                                temperature=temperature)]).report
    assert [e.variable for e in report.effects if e.variable != 'acceleration'] == [
        'temperature']
    assert {'time', 'temperature'} in [set(entry.between) for entry in report.ambiguous]
    assert all(entry.experiment for entry in report.ambiguous)


@pytest.mark.slow
def test_standstill_helps_to_locate_the_sign_change_of_friction():
    # In motion friction changes its sign at -0.06 rad/s, as a sensor that is off zero has it; at
    # rest, which is no motion, the drive asks for nothing.
    rng, step = np.random.default_rng(5), 0.005
    time = np.arange(0.0, 60.0, step)
    asked = np.sin(2.0 * np.pi * time / 7.3) + 0.7 * np.sin(2.0 * np.pi * time / 2.9)
    speed = np.where(np.abs(asked) < 0.6, 0.0, 0.8 * (asked - np.sign(asked) * 0.6))
    rest = speed == 0.0
    drawn = np.where(rest, 0.0, 0.3 * np.tanh((speed + 0.06) / 0.005)) + 0.1 * speed
    samples = Samples(time=time, position=np.cumsum(speed) * step, velocity=speed,
                      current=drawn + 0.01 * rng.standard_normal(time.size))
    found = refine([samples])
    assert rms(found.model.predict(samples)[rest]) < 0.1


def test_a_current_at_its_limit_is_a_finding():
    samples = swings(11)
    report = refine([samples.with_(current=np.clip(samples.current, -0.7, 0.7))]).report
    assert report.samples_clipped > 100
    assert 'signals' in {finding.code for finding in report.findings}


def test_a_speed_controller_is_not_called_friction():
    rng = np.random.default_rng(5)
    time = np.arange(0.0, 20.0, 0.005)
    wanted = np.repeat(rng.uniform(2.0, 6.0, 8), len(time) // 8)
    noise = rng.standard_normal(len(time))
    velocity = wanted + np.array([0.2 * sum(0.8 ** j * noise[k - j] for j in range(min(k, 30)))
                                  for k in range(len(time))])
    current = 0.4 - 0.1 * np.roll(velocity, 2) + 0.002 * rng.standard_normal(len(time))
    report = refine([Samples(time=time, position=np.cumsum(velocity) * 0.005, velocity=velocity,
                             current=current)]).report
    assert report.verdict == 'record again'
    assert 'wrong_sign' in {finding.code for finding in report.findings}


def test_effects_are_named_rightly_where_a_person_carries_the_load():
    """Under a law, the measured load belongs to model and start alike, and is nothing found."""
    motion = swings(4)
    rng = np.random.default_rng(4)
    model = FrictionModel(drive=DRIVE, sigmoid=Sigmoid(0.1, -0.1, 40.0, 0.0, 0.05))
    wanted = model.sigmoid(motion.velocity)
    current = 0.8 * wanted
    load = (wanted + 0.05 * np.cos(motion.position) - current) * DRIVE.torque_per_current
    samples = motion.with_(
        command=current, acceleration=None,
        current=current + 0.001 * rng.normal(size=len(motion)),
        load=load + 0.005 * rng.normal(size=len(motion)),
        direction=np.sign(motion.velocity).astype(int))
    result = refine([samples], model, DRIVE)
    named = [effect.name for effect in result.report.effects]
    assert 'gravity' in named
    assert [effect.name for effect in result.model.effects] == [*named, 'load_torque']


def pendulum(seed, load_friction=0.15):
    """Return a joint that carries a weight, its friction growing with what it carries."""
    motion = swings(seed, 60.0)
    rng = np.random.default_rng(seed)
    weight = 3.0 * np.sin(motion.position)
    current = (weight + 0.3 * motion.acceleration
               + (0.4 + load_friction * np.abs(weight)) * np.tanh(motion.velocity / 0.01)
               + 0.2 * motion.velocity + 0.02 * rng.standard_normal(len(motion)))
    return motion.with_(current=current, acceleration=None)


@pytest.mark.slow
def test_friction_that_grows_with_the_carried_weight_is_found_without_a_torque_sensor():
    result = refine([pendulum(1)])
    report = result.report
    found = {effect.name: effect for effect in report.effects}
    assert {'gravity', 'inner_load_friction'} <= set(found)
    assert 'bump' not in found
    own = found['inner_load_friction']
    assert own.parameters['coefficients'][0] == pytest.approx(0.15, rel=0.15)
    low, high = own.intervals['coefficients'][0]
    assert low < own.parameters['coefficients'][0] < high
    assert report.unit == 'N·m'
    assert 'N·m' in own.in_words
    assert ' A ' not in own.in_words
    assert report.verdict in ('trust', 'trust in part')
    # On another recording it is the same drive.
    fresh = pendulum(2)
    moving = np.abs(fresh.velocity) > 0.05
    assert np.std((fresh.current - result.model.predict(fresh))[moving]) < 0.03


@pytest.mark.slow
@pytest.mark.parametrize('swept', [True, False])
def test_drift_in_a_sweep_of_frequency_may_be_a_dependence_on_it(swept):
    t = np.arange(0.0, 80.0, 0.01)
    q = 0.4 * (np.sin(2.0 * np.pi * (0.1 + 0.005 * t) * t) if swept else
               np.sin(2.0 * np.pi * 0.31 * t) + 0.5 * np.sin(2.0 * np.pi * 0.87 * t))
    v = np.gradient(q, t)
    current = friction(v) * (1.0 + 0.6 * np.exp(-t / 20.0)) + 0.01 * np.gradient(v, t)
    report = refine([recorded(t, q, current, 5)], drive=DRIVE).report
    assert 'time' in [effect.variable for effect in report.effects]
    said = [question for question in report.ambiguous if 'rose or fell with time' in question.why]
    assert bool(said) == swept
