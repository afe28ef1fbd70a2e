# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of simulated joints: what it measures, tolerates and refuses; trajectories."""

from contextlib import suppress
from dataclasses import replace
import functools
import math
import re

from helpers import Bench, GOAL, note_model, short_search, SLOPES, under_weight
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.excitation.plan import JointLimits, plan_joint
from friction_comp.identification.goal import (
    IdentificationError,
    IdentificationGoal,
    TrajectoryGoal,
)
from friction_comp.identification.run import IdentificationRun, TrajectoryRun
from friction_comp.identification.supervised_run import Supervision
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid

# s; the note's experiments, in test_simulation.py, are at a thousand samples a second, and what is
# decided within milliseconds has twice as many samples
STEP = 4e-3


# What it measures.

@pytest.fixture(scope='module')
def plain():
    """Return a run of a drive that nothing is wrong with."""
    bench = Bench()
    bench.finish()
    return bench


def test_result_holds_table_fit_breakaway_and_model(plain, tmp_path):
    run, model = plain.run, plain.model
    result = run.result()
    assert run.result() is result, 'the evaluation takes long, so it is done once'
    assert (run.phase, run.progress, run.remaining) == ('done', 1.0, 0.0)
    # Twice in each direction, alternating.
    assert np.sign(result.breakaways).tolist() == [1, 1, -1, -1]
    assert np.all(result.standard_deviations > 0.001)
    path = tmp_path / 'model.yaml'
    result.model(model.drive, 'elbow', (-1.0, 1.0)).save(path)
    loaded = FrictionModel.load(path)
    assert loaded.joint == 'elbow'
    assert loaded.position_limits == (-1.0, 1.0)
    assert loaded.breakaway == result.breakaway
    for name, values in loaded.lookup_table.items():
        assert list(values) == getattr(result, name).tolist()
    np.testing.assert_allclose(loaded.sigmoid(result.speeds), result.sigmoid(result.speeds))


def test_progress_never_falls_and_the_estimate_is_fair(plain):
    times, progress, remaining, phases = zip(*plain.marks)
    assert np.all(np.diff(progress) >= 0.0)
    half = np.searchsorted(progress, 0.5)
    assert remaining[half] == pytest.approx(times[-1] - times[half], rel=0.4)
    order = list(dict.fromkeys(phases))
    assert order[:2] == ['standstill', 'push']
    assert {'travel', 'velocity', 'breakaway'} <= set(order)


@pytest.mark.parametrize(('number', 'inertia'), [(1, 0.05), (2, 3.0), (3, 0.3)])
def test_inertia_need_not_be_known(number, inertia):
    model = note_model(number, inertia=inertia)
    bench = Bench(model=model, seed=1, speeds=np.radians([10.0, 50.0]), breakaway_cycles=1,
                  ramp_slope=SLOPES[number], ramp_period=8.0, motion_range=1.2)
    result = bench.finish()
    assert bench.farthest <= 0.6
    np.testing.assert_allclose(
        result.currents[[0, -1]], model.sigmoid(result.speeds[[0, -1]]), rtol=0.02)
    for point in result.points:
        assert point.actual_speed == pytest.approx(point.speed, rel=0.05)
    # One ramp does not show how much the next may differ.
    assert result.breakaway.positive_std == 0.0
    assert any('measured once in each direction' in word for word in result.warnings)


def test_a_weight_that_the_model_carries_is_held_and_is_not_friction(tmp_path):
    """One of four times breakaway: at zero current, the joint would fall."""
    model = note_model(1)
    plant, weight, carried = under_weight(model, 0.4, 1.2)
    bench = Bench(plant=plant, carried=carried)
    result = bench.finish()
    assert bench.farthest <= 0.4
    np.testing.assert_allclose(result.currents, model.sigmoid(result.speeds), rtol=0.03)
    assert result.breakaway.positive_mean == pytest.approx(0.0995, rel=0.08)
    assert result.breakaway.negative_mean == pytest.approx(-0.0995, rel=0.08)
    assert not any('load' in word or 'direction needs' in word for word in result.warnings)
    result.model(model.drive, 'elbow', carrying=weight.effects[0]).save(tmp_path / 'model.yaml')
    kept = FrictionModel.load(tmp_path / 'model.yaml')
    # At rest the compensator adds what carries to breakaway, wherever the joint is.
    law = CompensationLaw([kept], breakaway_gain=0.9)
    for place in (-0.3, 0.3):
        law.reset()
        given = [law.update(1e-3 * k, [place], None, [1])[0] for k in range(1500)][-1]
        assert given == pytest.approx(carried(place) + 0.9 * 0.0995, rel=0.1)


@pytest.mark.parametrize('factor', [-1.0, 0.1, 11.9])
def test_a_weight_that_is_held_with_another_unit_or_sign_ends_the_run(factor):
    plant, _, carried = under_weight(note_model(1), 0.3, 1.2)

    def alter(run, sample):
        assert run.phase == 'standstill', 'the joint is not pushed'
        return scaled(factor, 3)(run, sample)
    Bench(alter, plant=plant, carried=carried).refused('measured current')


def with_friction(model, factor):
    """Return a model with its friction, and what the joint's motion takes, times a factor."""
    c = model.sigmoid.coefficients()
    return replace(
        model, breakaway=model.breakaway.times(factor), sigmoid=Sigmoid.from_coefficients(
            (c[0] * factor, c[1], c[2] * factor, *c[3:5], c[5] * factor)),
        simulation={**model.simulation, **{name: model.simulation[name] * factor for name in (
            'inertia', 'presliding_stiffness', 'presliding_damping')}})


@pytest.mark.parametrize('friction', [0.3, 7.5])
def test_without_a_slope_ramps_follow_from_what_breaks_the_joint_free(friction):
    """Of a drive that takes 0.03 A as of one that takes 0.75; the limit is 3 A."""
    model = with_friction(note_model(1), friction)
    bench = Bench(model=model, seed=1, speeds=np.radians([40.0, 100.0]), ramp_slope=None)
    result, level = bench.finish(), model.breakaway.positive_mean
    assert result.breakaway.positive_mean == pytest.approx(level, rel=0.08)
    assert result.goal.ramp_slope == pytest.approx(level / 1.2, rel=0.3)
    assert bench.largest < 4.0 * level


@pytest.mark.parametrize('limit', [0.24, 0.34])
def test_the_limit_is_kept_and_speeds_that_need_more_current_are_left_out_and_said(limit):
    """As of default speeds on a drive that was given a small current limit."""
    model = note_model(1)
    model.drive = replace(model.drive, current_limit=limit)
    bench = Bench(model=model, seed=1, motion_range=0.5, ramp_slope=0.06)
    result = bench.finish()
    assert 0.1 < bench.largest <= limit
    assert np.abs(result.speeds).max() < 0.99 * math.radians(100.0)
    assert any(word.startswith('1.74533 rad/s left out') for word in result.warnings)


def test_at_the_lowest_rate_the_documented_speeds_are_driven_and_what_is_too_short_is_said():
    goal = {'speeds': [0.17, 0.7, 1.7], 'motion_range': 0.5, 'breakaway_cycles': 1,
            'longest_cycle': 20.0}
    bench = Bench(seed=1, step=0.01, **goal)
    result = bench.finish()
    assert result.speeds[-1] == pytest.approx(1.7, rel=0.05)
    assert result.currents == pytest.approx(bench.model.sigmoid(result.speeds), rel=0.05)
    narrow = IdentificationGoal(**{**GOAL, **goal, 'motion_range': 0.4})
    assert 'widen motion_range to 0.46 rad' in narrow.too_short(1.7, 0.01)
    assert not replace(narrow, motion_range=0.46).too_short(1.7, 0.01)


# What is no fault.

def at(place, change, velocity=True):
    """Return what changes one value of each sample; the velocity may not be measured."""
    def alter(run, sample):
        sample[place] = change(sample[place])
        return sample if velocity else [*sample[:2], math.nan, sample[3]]
    return alter


def scaled(factor, place):
    return at(place, lambda value: factor * value)


def noisy(size, seed=5, factor=1.0, smoothing=1.0):
    """Return what adds noise to values behind a filter."""
    random, smooth = np.random.default_rng(seed), 0.0

    def change(value):
        nonlocal smooth
        smooth += smoothing * (value - smooth)
        return factor * (smooth + size * random.normal())
    return change


def low_pass(time_constant, step=STEP):
    return noisy(0.0, smoothing=-math.expm1(-step / time_constant))


def without_small_ones(dead):
    """Return what a drive makes of currents that has a dead band, A."""
    return lambda value: math.copysign(max(abs(value) - dead, 0.0), value)


def in_counts(step):
    return lambda position: math.floor(position / step) * step


def late_sensors():
    past = []

    def alter(run, sample):
        past.append(sample[1:3])
        sample[1:3] = past[-2:][0]
        return sample
    return alter


def lossy():
    """Samples are missed, and repeated."""
    random = np.random.default_rng(4)

    def alter(run, sample):
        if random.random() < 0.2 and sample[0] > 0.0:
            return None
        if random.random() < 0.1:
            assert run.update(*sample) == run.update(*sample)
        return sample
    return alter


FINE, COARSE = 2 ** 20, math.radians(0.2)


@pytest.mark.parametrize(('changes', 'error'), [
    ({'alter': at(2, low_pass(0.06))}, 0.03), ({'alter': late_sensors()}, 0.03),
    ({'alter': at(1, low_pass(0.025, 2e-3), False), 'step': 2e-3}, 0.03),
    ({'alter': at(3, lambda current: current + 0.05)}, 0.5), ({'alter': lossy()}, 0.03),
    ({'alter': at(1, noisy(2e-6, 7)), 'step': 2e-3, 'drive': Drive(0.119, 100.0, FINE)}, 0.05),
    ({'alter': at(3, noisy(0.02, smoothing=0.33), False), 'step': 2e-3, 'seed': 4}, 0.05),
    # The current comes 8 to 24 ms after the command.
    ({'late': 2}, 0.05), ({'late': 6}, 0.05),
    # A coarse encoder shows no speed in a single count.
    ({'alter': at(1, in_counts(COARSE), False), 'step': 2e-3,
      'drive': Drive(11.9, 1.0, round(2.0 * math.pi / COARSE))}, 0.04)])
def test_what_is_no_fault_is_tolerated(changes, error):
    """Filters, delays, offsets, a rotor that trembles by many counts, noise, and losses."""
    bench = Bench(**changes)
    result, model = bench.finish(), bench.model
    assert bench.farthest <= 0.4
    np.testing.assert_allclose(result.currents, model.sigmoid(result.speeds), rtol=error)
    half = 0.5 * (result.currents[-1] - result.currents[0])
    assert half == pytest.approx(float(model.sigmoid(result.speeds[-1])), rel=0.05)
    assert not any('backlash' in warning for warning in result.warnings)
    assert result.breakaway.friction == pytest.approx(0.0995, rel=0.1)


def test_presliding_of_an_encoder_coarser_than_stated_is_not_made_up():
    drive = replace(note_model(1).drive, encoder_counts=4000)
    assert Bench(at(1, in_counts(2.0 * math.pi / (200 * drive.gear_ratio))), drive=drive
                 ).finish().presliding is None


# What ends a run.

@pytest.mark.parametrize(('phase', 'index', 'kept', 'added', 'words'), [
    ('velocity', 1, 0.0, math.nan, 'encoder'), ('breakaway', 1, 0.0, math.inf, 'encoder'),
    ('velocity', 1, 0.0, -0.3, 'lags'), ('velocity', 1, 1.0, 0.7, 'range'),
    ('breakaway', 1, 1.0, -0.6, 'range'), ('velocity', 0, 1.0, 0.5, 'no sample for'),
    ('velocity', 0, 1.0, -2.0, 'went back'), ('velocity', 0, 0.0, math.nan, 'time'),
    ('velocity', 3, 0.0, math.nan, 'current is not finite'),
    ('trajectory', 1, 0.0, 0.0, 'encoder is stuck'),
    ('trajectory', 1, 1.0, 2.0, 'left its motion range'),
    ('trajectory', 0, 1.0, 1.0, 'no sample for'), ('trajectory', 1, 0.0, math.nan, 'encoder'),
    ('trajectory', 3, -1.0, 0.0, 'measured current')])
def test_faults_end_the_run_with_zero_current(phase, index, kept, added, words):
    begun = []

    def alter(run, sample):
        if run.phase == phase:
            begun.append(sample[0])
        if begun and sample[0] > begun[0] + 0.3:
            sample[index] = kept * sample[index] + added
        return sample
    bench = following(2, alter=alter) if phase == 'trajectory' else Bench(alter)
    bench.refused(words)
    assert not bench.run.finished
    assert bench.run.update(1e3, 0.0, 0.0, 0.0) == 0.0
    if phase != 'trajectory':
        with pytest.raises(IdentificationError, match='not complete'):
            bench.run.result()


def test_cancelling_gives_zero_current():
    def cancel(run, sample):
        if run.phase == 'velocity' and sample[1] > 0.1:
            run.abort()
            assert (run.error, run.phase) == ('cancelled', 'failed')
            assert run.update(*sample) == 0.0
            raise KeyboardInterrupt
        return sample
    with pytest.raises(KeyboardInterrupt):
        Bench(cancel).finish()
    run = TrajectoryRun(planned(1), note_model(1).drive)
    run.update(0.0, 0.0)
    run.abort()
    assert run.phase == 'failed'
    assert not any(run.update(0.001 * k, 0.0) for k in range(1, 2000))


def test_joint_that_moves_at_zero_current_is_refused():
    run = IdentificationRun(IdentificationGoal(**GOAL), note_model(1).drive)
    with pytest.raises(IdentificationError, match='does not come to rest'):
        assert not any(run.update(k * 1e-3, 1e-5 * k, 0.0, 0.0) for k in range(20000))


@pytest.mark.parametrize(('entry', 'value', 'word'), [
    ('speeds', [], 'two'), ('speeds', [0.5, -0.5], 'two'), ('speeds', ['fast', 0.5], 'numbers'),
    *(('speeds', [0.5, bad], 'speeds must be') for bad in (0.0, math.nan, 1e-300, 1e300)),
    *(('motion_range', bad, 'motion_range') for bad in (0.0, math.inf, 1e300, 1e-300)),
    ('motion_range', 0.02, 'fewer than two speeds fit'),
    *(('ramp_slope', bad, 'ramp_slope') for bad in (-0.1, 1e-300)),
    *(('ramp_period', bad, 'ramp_period') for bad in (0.5, math.nan, 1e300)),
    *(('breakaway_cycles', bad, 'breakaway_cycles') for bad in (0, 2.5, 10**9)),
    ('longest_cycle', 0.0, 'longest_cycle'), ('longest_cycle', 'x', 'longest_cycle'),
    ('ramp_slope', 1.5, 'current limit')])
def test_goals_that_make_no_sense_are_refused(entry, value, word):
    with pytest.raises(InputError, match=word):
        IdentificationRun(IdentificationGoal(**{**GOAL, entry: value}), note_model(1).drive)


@pytest.mark.parametrize(('changes', 'words'), [
    *(({'alter': scaled(factor, place)}, words) for factor, place, words in (
        (0.0, 3, 'not measured'), (0.0084, 3, 'not measured'), (math.nan, 3, 'not measured'),
        (57.3, 2, 'velocity'), (-1.0, 2, 'sign'))),
    *(({'alter': scaled(factor, 3), 'late': 30}, words) for factor, words in (
        (10.0, 'another unit'), (-1.0, 'wrong sign'), (0.0, 'not measured'))),
    # A dead band of a drive is no wrong unit.
    *(({'alter': at(3, without_small_ones(dead))}, 'dead band') for dead in (0.02, 0.3)),
    # Noise that hides the current; states that come too seldom.
    ({'alter': at(3, noisy(1.0), False), 'step': 1e-3}, 'too noisy'),
    ({'alter': lambda run, sample: [2.0 * sample[0], sample[1], math.nan, sample[3]],
      'step': 0.01}, '50 times per second; .* takes 100')])
def test_wrong_units_and_signs_are_found_before_the_joint_is_driven_far(changes, words):
    bench = Bench(**changes)
    bench.refused(words)
    assert bench.largest <= bench.run.goal.ramp_peak


@pytest.mark.parametrize('factor, noise', [
    (0.01, 0.02), (-0.4, 0.02), (3.0, 0.02), (-100.0, 0.02), (10_000.0, 0.02), (-1.0, 0.02),
    (0.4, 0.001), (-3.0, 0.001)])
def test_the_first_push_reveals_any_factor_and_sign_of_effort(factor, noise):
    """Noise is scaled as well; the velocity is not measured at all."""
    bench = Bench(at(3, noisy(noise, factor=factor), False))
    bench.refused('effort')
    assert bench.farthest < math.radians(1.0)
    # Friction takes 0.1 A.
    assert bench.largest < 0.12


@pytest.mark.parametrize('samples', [10, 15, 62])
def test_a_drive_that_answers_late_is_not_told_to_have_another_unit(samples):
    bench = Bench(late=samples)
    said = float(re.search(r'one (\S+) s late', bench.refused('right size'))[1])
    assert said == pytest.approx(STEP * samples, rel=0.1, abs=0.005)
    assert bench.largest < 0.4


def frozen(phase, delay, velocity):
    """The position as it was when the run had been in a phase for some s."""
    held = {}

    def alter(run, sample):
        if run.phase == phase:
            held.setdefault('since', sample[0])
        if 'since' in held and sample[0] > held['since'] + delay:
            sample[1] = held.setdefault('position', sample[1])
        return sample if velocity else [*sample[:2], math.nan, sample[3]]
    return alter


def stop(run, state):
    beyond = state.position[0] - 0.15
    return -4000.0 * beyond - 40.0 * state.velocity[0] if beyond > 0.0 else 0.0


STUCK = 'stuck|behind|break free|velocity'


@pytest.mark.parametrize(('changes', 'words'), [
    *(({'alter': frozen(*how)}, STUCK) for how in (
        ('push', 0.0, True), ('velocity', 0.3, True), ('velocity', 0.3, False),
        ('velocity', 8.0, False), ('breakaway', 1.0, True))),
    ({'torque': stop, 'step': 0.5 * STEP}, 'blocked|stop|behind|oscillates'),
    ({'torque': lambda run, state: 0.95 if run.phase == 'breakaway' else 0.0,
      'step': 0.5 * STEP}, 'leant|pushed|rest|touched'),
    # A drive that limits its current has no wrong unit.
    ({'most': 0.13}, '^the measured current stays at 0.1.* limits its current')])
def test_an_encoder_that_freezes_a_stop_a_person_or_a_limit_in_the_way_ends_the_run(changes, words):
    bench = Bench(**changes)
    bench.refused(words)
    # The drive's limit is 3 A, and what friction takes is 0.1 A.
    assert bench.largest < 0.7
    assert bench.fastest < 6.0, 'rad/s'


@pytest.mark.parametrize(('slope', 'words', 'largest'), [
    (GOAL['ramp_slope'], 'encoder is stuck', 0.4 * GOAL['ramp_slope'] * GOAL['ramp_period']),
    (None, 'not counted once up to 0.3', 0.1 * 3.0)])
def test_an_encoder_that_never_worked_costs_one_ramp_and_is_named(slope, words, largest):
    """Position and velocity from it: nothing else tells it from a blocked joint."""
    bench = Bench(lambda run, sample: [sample[0], 0.0, 0.0, sample[3]], ramp_slope=slope)
    bench.refused(words)
    assert bench.largest <= largest + 1e-9
    assert bench.fastest < 8.0, 'rad/s, of a joint that nobody sees move'


def test_no_measured_current_changes_what_is_commanded(monkeypatch):
    """Whatever passes the supervision: neither feed-forward nor limits come from it."""
    monkeypatch.setattr(Supervision, 'check', lambda *_: True)
    monkeypatch.setattr(Supervision, 'is_current_confirmed', lambda _: True)
    commands = []
    for factor in (1.0, 1000.0):
        bench, heard = Bench(scaled(factor, 3)), []
        update = bench.run.update
        monkeypatch.setattr(bench.run, 'update', lambda *sample, update=update, heard=heard: (
            heard.append(update(*sample)) or heard[-1]))
        with suppress(IdentificationError):
            bench.finish()
        commands.append(heard)
    assert len(commands[0]) > 5_000
    assert commands[0] == commands[1]


# Trajectories.

LIMITS = JointLimits('', -0.8, 1.0, 1.2, 6.0)


@functools.cache
def motion_planned():
    with short_search(1):
        return plan_joint(LIMITS, [('gravity', 'stribeck')], 20.0, 3).samples(50.0)


def planned(number):
    motion = motion_planned()
    return TrajectoryGoal(motion.time, motion.position, np.asarray(motion.velocity),
                          ramp_slope=SLOPES[number])


def following(number, **changes):
    return Bench(run=TrajectoryRun(planned(number), note_model(number).drive),
                 model=note_model(number), **changes)


# Of breakaway, the weights are none, a fifth and three times.
@pytest.mark.parametrize(('number', 'weight', 'is_known'), [
    (3, 0.0, True), (1, 0.02, False), (1, 0.3, True)])
def test_a_plan_is_followed_beside_what_the_model_carries(number, weight, is_known):
    changes = {'seed': 5}
    if weight:
        changes['plant'], _, known = under_weight(note_model(number), weight, 0.3)
        changes |= {'carried': known} if is_known else {}
    bench, goal = following(number, **changes), planned(number)
    bench.finish()
    time, position, command = np.array(bench.rows).T
    assert bench.run.phase == 'done'
    assert command[-1] == 0.0
    assert LIMITS.lowest < position.min()
    assert position.max() < LIMITS.highest
    # Ends where the plan ends, and has been all over its range.
    if not weight:
        assert position[-1] == pytest.approx(goal.positions[-1], abs=0.01)
    assert np.ptp(position) > 0.97 * goal.motion_range
    assert np.abs(np.gradient(position[::5], time[::5])).max() < 1.05 * LIMITS.velocity


@pytest.mark.parametrize('changes, words', [
    ({'times': [0.0]}, 'two points'), ({'times': [0.0, 2.0, 1.0]}, 'do not ascend'),
    ({'positions': [0.0, math.nan, 0.0]}, 'not finite'),
    ({'positions': [0.1, 0.1, 0.1]}, 'does not move'),
    ({'velocities': [0.5, 0.0, 0.0]}, 'at rest'), ({'times': [0.0, 1.0, 1e6]}, '3600'),
    ({'velocities': []}, 'position and velocity'), ({'ramp_slope': 1e-300}, 'ramp_slope'),
    ({'positions': [0.0, 1e300, 0.0]}, 'motion_range'),
    ({'velocities': [0.0, 1e300, 0.0]}, 'speeds')])
def test_a_trajectory_that_cannot_be_followed_is_refused(changes, words):
    fine = {'times': [0.0, 1.0, 2.0], 'positions': [0.0, 0.5, 0.0], 'velocities': [0.0] * 3}
    TrajectoryGoal(**fine)
    with pytest.raises(InputError, match=words):
        TrajectoryGoal(**{**fine, **changes})
