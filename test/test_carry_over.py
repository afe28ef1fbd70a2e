# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What carries over: from part to part of a recording, beyond its range, and to another day."""

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import differentiate
from friction_comp.model.effects import EFFECTS
from friction_comp.model.effects.edges import with_range
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import refine
from friction_comp.refinement.fit.effect_sum import first_fit, Term
from friction_comp.refinement.judge.carry_over import carries_over, gains
from friction_comp.refinement.prepare.coupling_choice import repeats_after
from friction_comp.refinement.prepare.folds import runs_of, split
from friction_comp.refinement.prepare.prepared import prepare
from friction_comp.refinement.prepare.saturation import saturated
from friction_comp.samples import JointStates, Samples

FREQUENCY = 40.0


def swings(seed, duration=60.0, step=0.01):
    """Return samples of a joint that swings, with a plain drive's current."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, step)
    q, v, a = (np.zeros_like(time) for _ in range(3))
    for frequency in (0.09, 0.23, 0.41):
        omega, phase = 2.0 * np.pi * frequency, rng.uniform(0.0, 2.0 * np.pi)
        q += 0.4 * np.sin(omega * time + phase)
        v += 0.4 * omega * np.cos(omega * time + phase)
        a -= 0.4 * omega ** 2 * np.sin(omega * time + phase)
    current = 0.5 * np.tanh(v / 0.01) + 0.2 * v + 0.02 * rng.standard_normal(time.size)
    return Samples(time=time, position=q, velocity=v, acceleration=a, current=current)


def with_and_without(samples, constants):
    """Return the fits of both folds without and with cogging."""
    usable = np.abs(samples.velocity) > 0.02
    data = prepare(samples, usable, Drive(1.0, 1.0), 0.02)
    poorer = [first_fit(data, data.fit_rows(fold)) for fold in (0, 1)]
    term = Term(EFFECTS['cogging'], {'growth': 0.0, 'speed': 1.0, 'transition': 0.02, **constants})
    return poorer, [fit.with_term(term) for fit in poorer]


@pytest.mark.parametrize(('share', 'expected'), [(1.0, True), (0.15, False)])
def test_what_only_a_part_of_the_recording_shows_does_not_carry_over(share, expected):
    samples = swings(1)
    cogging = 0.03 * np.sin(FREQUENCY * samples.position) / np.sqrt(share)
    there = samples.time < share * samples.time[-1]
    disturbed = samples.with_(current=samples.current + np.where(there, cogging, 0.0))
    poorer, richer = with_and_without(disturbed, {'frequency': FREQUENCY})
    assert carries_over(poorer, richer, 1) is expected


def test_the_more_effects_there_are_the_more_another_one_has_to_show():
    samples = swings(2)
    weak = 0.0021 * np.sin(FREQUENCY * samples.position)
    poorer, richer = with_and_without(
        samples.with_(current=samples.current + weak), {'frequency': FREQUENCY})
    verdicts = [carries_over(poorer, richer, number) for number in (1, 10 ** 6)]
    assert verdicts == [True, False]


def test_nothing_is_gained_elsewhere_by_an_effect_that_is_not_there():
    total = [gains(*with_and_without(swings(seed), {'frequency': FREQUENCY})).sum()
             for seed in range(3, 9)]
    assert np.median(total) < 0.0


def a_model(name, parameters, ranges):
    """Return a model of one effect that was fitted within some ranges."""
    effect = EFFECTS[name](parameters, ranges)
    return FrictionModel(Drive(1.0, 1.0), Sigmoid(0.5, -0.5, 100.0), effects=[effect])


SPRING = {'position': 0.0, 'coefficients': [2.0]}


def test_beyond_what_it_was_fitted_to_a_spring_keeps_its_value_at_the_edge():
    model = a_model('spring', SPRING, {'position': [-0.5, 0.8]})
    position = np.array([-2.0, -0.5, 0.3, 0.8, 5.0])
    still = np.zeros(5)
    samples = Samples(time=np.arange(5.0), position=position, velocity=still, acceleration=still,
                      current=still)
    assert model.current(samples) == pytest.approx([-1.0, -1.0, 0.6, 1.6, 1.6])
    live = model.effects[0].live()
    assert [live.update(0.0, q, 0.0) for q in position] == pytest.approx(
        [-1.0, -1.0, 0.6, 1.6, 1.6])


def test_a_temperature_that_is_not_known_stays_unknown():
    model = a_model('temperature', {
        'reference_temperature': 30.0, 'transition': 0.02, 'coefficients': [-0.01, 0.0, 0.0]},
        {'temperature': [25.0, 40.0]})
    live = model.effects[0].live()
    assert live.update(0.0, 0.0, 1.0, temperature=90.0) == pytest.approx(-0.1)
    assert np.isnan(live.update(0.0, 0.0, 1.0, temperature=np.nan))


def test_the_range_is_kept_in_the_file_and_checked_when_read(tmp_path):
    model = a_model('spring', SPRING, {'position': [-0.5, 0.8]})
    model.save(tmp_path / 'model.yaml')
    again = FrictionModel.load(tmp_path / 'model.yaml')
    assert again.effects[0].valid_range == {'position': (-0.5, 0.8)}
    for wrong in ({'velocity': [0.0, 1.0]}, {'position': [1.0, 0.0]}, {'position': 3.0}):
        document = model.to_dict()
        document['effects'][0]['valid_range'] = wrong
        with pytest.raises(InputError, match='valid_range'):
            FrictionModel.from_dict(document)


def test_the_range_is_that_of_the_motion_without_a_stray_sample():
    samples = swings(3)
    position = samples.position.copy()
    position[100] = 50.0
    effect = with_range(EFFECTS['spring'](SPRING), samples.with_(position=position))
    low, high = effect.valid_range['position']
    quarter = 0.25 * np.ptp(samples.position)
    assert (low, high) == pytest.approx(
        (samples.position.min() - quarter, samples.position.max() + quarter), abs=0.08)


def noisy_ceiling(ceiling, seed=4):
    """Return the samples of a current sensor that ends below what is asked, then has noise."""
    samples = swings(seed)
    rng = np.random.default_rng(seed)
    wanted = samples.current + 0.15 * samples.acceleration
    read = np.clip(wanted, -ceiling, ceiling) + 0.01 * rng.standard_normal(len(wanted))
    return samples.with_(current=read), np.abs(wanted) > ceiling


def test_a_sensor_that_saturates_below_its_noise_is_seen():
    samples, beyond = noisy_ceiling(0.62)
    found = saturated(samples, np.zeros(len(samples), dtype=bool))
    assert found[beyond].mean() > 0.8
    assert found[~beyond].mean() < 0.2


def test_a_current_that_is_not_cut_off_is_left_alone():
    samples, _ = noisy_ceiling(10.0)
    assert not saturated(samples, np.zeros(len(samples), dtype=bool)).any()


def test_constant_speeds_are_no_ceiling():
    time = np.arange(0.0, 40.0, 0.01)
    speed = 0.6 * np.sign(np.sin(2.0 * np.pi * time / 8.0))
    velocity = np.convolve(speed, np.ones(30) / 30.0, mode='same')
    rng = np.random.default_rng(5)
    current = (0.4 * np.tanh(velocity / 0.01) + 0.3 * velocity
               + 0.05 * np.gradient(velocity, 0.01) + 0.01 * rng.standard_normal(time.size))
    samples = Samples(time=time, position=np.cumsum(velocity) * 0.01, velocity=velocity,
                      acceleration=np.gradient(velocity, 0.01), current=current)
    assert not saturated(samples, np.zeros(len(samples), dtype=bool)).any()


def test_of_a_cause_and_a_clock_that_explain_alike_the_cause_is_named():
    rng = np.random.default_rng(2)
    base = swings(6, duration=150.0, step=0.02)
    drift = np.exp(-base.time / 60.0)
    temperature = np.round(43.0 - 18.0 * drift, 1)
    current = base.current + 0.25 * drift * np.tanh(base.velocity / 0.01)
    report = refine([base.with_(current=current + 0.01 * rng.standard_normal(len(base)),
                                acceleration=None, temperature=temperature)]).report
    assert [e['variable'] for e in report['effects'] if e['variable'] != 'acceleration'] == [
        'temperature']
    assert {'time', 'temperature'} in [set(entry['between']) for entry in report['ambiguous']]


def test_motion_at_one_speed_is_said_to_show_little_of_speed():
    time = np.arange(0.0, 30.0, 0.01)
    speed = np.convolve(0.5 * np.sign(np.sin(2.0 * np.pi * time / 6.0)), np.ones(80) / 80.0,
                        mode='same')
    rng = np.random.default_rng(7)
    current = 0.4 * np.tanh(speed / 0.01) + 0.1 * speed + 0.01 * rng.standard_normal(time.size)
    report = refine([Samples(time=time, position=np.cumsum(speed) * 0.01, velocity=speed,
                             current=current)]).report
    assert any(line.startswith('Speed was near 0.5') or line.startswith('Speed hardly varied')
               for line in report['warnings'])


def test_samples_that_arrive_together_are_no_burst_of_acceleration():
    samples = swings(8, duration=20.0)
    stamps = samples.time.copy()
    # Every hundredth message waits for the next one.
    stamps[100::100] = stamps[101::100] - 1e-6
    settings = {'source': 'velocity', 'bandwidth': None}
    late = differentiate(samples.with_(time=stamps), settings)
    assert np.abs(late.acceleration).max() < 5.0 * np.abs(samples.acceleration).max()
    even = differentiate(samples, settings)
    assert even.acceleration[5:-5] == pytest.approx(samples.acceleration[5:-5], abs=0.02)


def strokes(number, each, gap):
    """Return samples of strokes to and fro, so many seconds each, with rests not recorded."""
    step, rows = 0.01, round(each / 0.01)
    side = np.repeat(np.where(np.arange(number) % 2, -1.0, 1.0), rows)
    time = np.arange(number * rows) * step + np.repeat(np.arange(number), rows) * gap
    rng = np.random.default_rng(9)
    current = 0.4 * side + 0.02 * rng.standard_normal(side.size)
    return Samples(time=time, position=np.cumsum(side) * step, velocity=0.5 * side,
                   acceleration=0.0 * side, current=current)


@pytest.mark.parametrize(('number', 'each', 'gap'), [(2, 10.0, 3.0), (24, 1.0, 0.0)])
def test_both_halves_hold_both_directions_though_each_stroke_goes_one_way(number, each, gap):
    samples = strokes(number, each, gap)
    usable = np.ones(len(samples), dtype=bool)
    folds = split(samples, usable, np.sin(samples.time), runs_of(samples))
    for half in (0, 1):
        forwards = samples.velocity[folds.fold == half] > 0.0
        assert 0.1 < forwards.mean() < 0.9


def test_an_encoder_that_stands_still_most_of_the_time_does_no_harm():
    samples = swings(10)
    seldom = np.where(np.arange(len(samples)) % 40 == 0, samples.velocity, 0.0)
    nothing = np.zeros(len(samples), dtype=bool)
    assert not saturated(samples.with_(velocity=seldom, acceleration=seldom), nothing).any()
    assert not saturated(samples.with_(velocity=0.0 * seldom), nothing).any()


def test_standstill_has_a_say_in_where_friction_changes_its_sign():
    # In motion friction changes its sign at -0.06 rad/s, as a sensor that is off zero has it; at
    # rest, which is no motion, the drive asks for nothing.
    rng, step = np.random.default_rng(5), 0.005
    time = np.arange(0.0, 60.0, step)
    asked = np.sin(2.0 * np.pi * time / 7.3) + 0.7 * np.sin(2.0 * np.pi * time / 2.9)
    speed = np.where(np.abs(asked) < 0.6, 0.0, 0.8 * (asked - np.sign(asked) * 0.6))
    rest = speed == 0.0
    friction = np.where(rest, 0.0, 0.3 * np.tanh((speed + 0.06) / 0.005)) + 0.1 * speed
    samples = Samples(time=time, position=np.cumsum(speed) * step, velocity=speed,
                      current=friction + 0.01 * rng.standard_normal(time.size))
    found = refine([samples])
    assert np.sqrt(np.mean(found.model.predict(samples)[rest] ** 2)) < 0.1


def test_motion_of_all_joints_that_comes_again_is_seen():
    time = np.arange(0.0, 30.0, 0.01)
    fast, slow = np.sin(2.0 * np.pi * time / 3.0), np.sin(2.0 * np.pi * time / 7.5)
    for other, expected in ((slow, 15.0), (np.sin(time ** 1.5), None)):
        states = JointStates(('a', 'b'), np.column_stack((fast, other)))
        samples = Samples(time=time, position=fast, current=fast, joint='a', arm=states)
        assert repeats_after(samples) == (expected and pytest.approx(expected, abs=0.1))
