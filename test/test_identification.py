# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification of simulated joints: what it measures, and what it refuses."""

from dataclasses import replace
import math

from helpers import follow, note_model, SLOPES, under_weight
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.errors import InputError
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.identification.run import IdentificationRun
from friction_comp.model.friction_model import Breakaway, FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared

# s; the note's experiments, in test_reproduce.py, are at a thousand samples a second
STEP = 4e-3
QUICK = {'speeds': np.radians([10.0, 40.0, 100.0]).tolist(), 'breakaway_cycles': 2,
         'longest_cycle': 4.0, 'ramp_period': 8.0, 'ramp_slope': 0.06}


def identify(model, plant=None, alter=lambda run, sample: sample, carried=lambda position: 0.0,
             **changes):
    """Run to the end; return the run, the positions and the commands."""
    run = IdentificationRun(IdentificationGoal(**{**QUICK, **changes}), model.drive)
    _, positions, commands = follow(
        run, plant or Plant([model], seed=1, sample_time=STEP), alter, carried)
    return run, positions, commands


@pytest.fixture(scope='module')
def quick():
    """Return a drive, its run, and time, progress, remaining time and phase at each sample."""
    model, marks = note_model(1), []

    def note(run, sample):
        marks.append((sample[0], run.progress, run.remaining, run.phase))
        return sample
    return model, identify(model, alter=note)[0], marks


@pytest.mark.parametrize(('number', 'inertia'), [(1, 0.05), (2, 3.0), (3, 0.3)])
def test_inertia_need_not_be_known(number, inertia):
    model = note_model(number, inertia=inertia)
    run, positions, _ = identify(model, speeds=np.radians([10.0, 50.0]), breakaway_cycles=1,
                                 ramp_slope=SLOPES[number], motion_range=1.2)
    result = run.result()
    assert result.model(model.drive, 'elbow', (-1.0, 1.0)).position_limits == (-1.0, 1.0)
    assert np.max(np.abs(positions)) <= 0.6
    assert result.acceleration_per_current == pytest.approx(
        model.drive.torque_per_current / inertia, rel=0.25)
    truth = model.sigmoid(result.speeds[[0, -1]])
    np.testing.assert_allclose(result.currents[[0, -1]], truth, rtol=0.02)
    for point in result.points:
        assert point.actual_speed == pytest.approx(point.speed, rel=0.05)
    # One ramp does not show how much the next may differ.
    assert result.breakaway.positive_std == 0.0
    assert any('measured once in each direction' in word for word in result.warnings)


def test_lag_gravity_and_noise_are_tolerated():
    model = note_model(1, current_noise=0.02)
    plant = Plant([model], seed=4, sample_time=0.5 * STEP, undeclared=[Undeclared.from_effects([
        {'name': 'actuation_lag', 'parameters': {'lag': 0.005}},
        {'name': 'gravity', 'parameters': {'amplitude': 0.4, 'phase': 0.2}}])])
    run, positions, _ = identify(model, plant)
    result = run.result()
    assert np.max(np.abs(positions)) <= 0.5
    # Gravity shifts a drive's currents in both directions alike: their difference is friction.
    half = 0.5 * (result.currents[-1] - result.currents[0])
    truth = 0.5 * (model.sigmoid(result.speeds[-1]) - model.sigmoid(result.speeds[0]))
    assert half == pytest.approx(float(truth), rel=0.05)


def test_a_weight_that_the_model_carries_is_held_and_is_not_friction(tmp_path):
    """One of four times breakaway: at zero current, the joint would fall."""
    model = note_model(1)
    plant, weight, carried = under_weight(model, 0.4, 1.2)
    run, position, _ = identify(model, plant, carried=carried)
    assert np.max(np.abs(position)) <= 0.5
    result = run.result()
    np.testing.assert_allclose(result.currents, model.sigmoid(result.speeds), rtol=0.03)
    assert result.breakaway.positive_mean == pytest.approx(0.0995, rel=0.08)
    assert result.breakaway.negative_mean == pytest.approx(-0.0995, rel=0.08)
    assert not any('load' in word or 'direction needs' in word for word in result.warnings)
    written = result.model(model.drive, 'elbow', carrying=weight.effects[0])
    written.save(tmp_path / 'model.yaml')
    kept = FrictionModel.load(tmp_path / 'model.yaml')
    # At rest the compensator adds what carries to breakaway, wherever the joint is.
    law = CompensationLaw([kept], breakaway_gain=0.9)
    for place in (-0.3, 0.3):
        law.reset()
        given = [law.update(1e-3 * k, [place], None, [1])[0] for k in range(1500)][-1]
        assert given == pytest.approx(carried(place) + 0.9 * 0.0995, rel=0.1)


@pytest.mark.parametrize('factor', [-1.0, 0.1, 11.9])
def test_a_weight_that_is_held_with_another_unit_or_sign_ends_the_run(factor):
    model = note_model(1)
    plant, _, carried = under_weight(model, 0.3, 1.2)

    def scaled(run, sample):
        assert run.phase == 'standstill', 'the joint is not pushed'
        sample[3] *= factor
        return sample
    with pytest.raises(IdentificationError, match='measured current'):
        identify(model, plant, scaled, carried)


def test_result_holds_table_fit_breakaway_and_model(quick, tmp_path):
    model, run, _ = quick
    result = run.result()
    assert run.result() is result, 'the evaluation takes long, so it is done once'
    assert (run.phase, run.progress, run.remaining) == ('done', 1.0, 0.0)
    # Twice in each direction, alternating.
    assert np.sign(result.breakaways).tolist() == [1, 1, -1, -1]
    assert len(result.coefficients) == 6
    assert np.all(result.standard_deviations > 0.001)
    path = tmp_path / 'model.yaml'
    result.model(model.drive, 'elbow').save(path)
    loaded = FrictionModel.load(path)
    assert loaded.joint == 'elbow'
    assert loaded.breakaway == result.breakaway
    for name, values in loaded.lookup_table.items():
        assert list(values) == getattr(result, name).tolist()
    np.testing.assert_allclose(loaded.sigmoid(result.speeds), result.sigmoid(result.speeds))


def test_progress_never_falls_and_the_estimate_is_fair(quick):
    times, progress, remaining, phases = zip(*quick[-1])
    assert np.all(np.diff(progress) >= 0.0)
    half = np.searchsorted(progress, 0.5)
    assert remaining[half] == pytest.approx(times[-1] - times[half], rel=0.4)
    order = list(dict.fromkeys(phases))
    assert order[:2] == ['standstill', 'push']
    assert {'travel', 'velocity', 'breakaway'} <= set(order)


def test_missed_and_repeated_samples_are_tolerated():
    model, random = note_model(1), np.random.default_rng(4)

    def lose(run, sample):
        if random.random() < 0.2 and sample[0] > 0.0:
            return None
        if random.random() < 0.1:
            assert run.update(*sample) == run.update(*sample)
        return sample

    run, positions, _ = identify(model, alter=lose)
    result = run.result()
    assert np.max(np.abs(positions)) <= 0.5
    np.testing.assert_allclose(
        result.currents[[0, -1]], model.sigmoid(result.speeds[[0, -1]]), rtol=0.02)


@pytest.mark.parametrize(('phase', 'index', 'kept', 'added', 'words'), [
    ('velocity', 1, 0.0, math.nan, 'encoder'), ('breakaway', 1, 0.0, math.inf, 'encoder'),
    ('velocity', 1, 0.0, -0.3, 'lags'), ('velocity', 1, 1.0, 0.7, 'range'),
    ('breakaway', 1, 1.0, -0.6, 'range'), ('velocity', 0, 1.0, 0.5, 'no sample for'),
    ('velocity', 0, 1.0, -2.0, 'went back'), ('velocity', 0, 0.0, math.nan, 'time'),
    ('velocity', 3, 0.0, math.nan, 'current is not finite')])
def test_faults_end_the_run_with_zero_current(phase, index, kept, added, words):
    begun, runs = [], []

    def alter(run, sample):
        runs[:] = [run]
        if run.phase == phase:
            begun.append(sample[0])
        if begun and sample[0] > begun[0] + 0.3:
            sample[index] = kept * sample[index] + added
        return sample
    with pytest.raises(IdentificationError, match=words) as caught:
        identify(note_model(1), alter=alter)
    run, = runs
    assert run.phase == 'failed'
    assert run.error == str(caught.value)
    assert not run.finished
    assert run.update(1e3, 0.0, 0.0, 0.0) == 0.0
    with pytest.raises(IdentificationError, match='not complete'):
        run.result()


@pytest.mark.parametrize('friction', [0.3, 7.5])
def test_without_a_slope_ramps_follow_from_what_breaks_the_joint_free(friction):
    """Of a drive that takes 0.03 A as of one that takes 0.75; the limit is 3 A."""
    model = with_friction(note_model(1), friction)
    run, _, commands = identify(model, speeds=np.radians([40.0, 100.0]), longest_cycle=2.0,
                                ramp_slope=None)
    result = run.result()
    level = model.breakaway.positive_mean
    assert result.breakaway.positive_mean == pytest.approx(level, rel=0.08)
    assert result.goal.ramp_slope == pytest.approx(level / 1.2, rel=0.3)
    assert np.max(np.abs(commands)) < 4.0 * level


def with_friction(model, factor):
    """Return a model with its friction, and what the joint's motion takes, times a factor."""
    c, both = model.sigmoid.coefficients(), model.breakaway
    return replace(
        model, sigmoid=Sigmoid.from_coefficients(
            (c[0] * factor, c[1], c[2] * factor, *c[3:5], c[5] * factor)),
        breakaway=Breakaway(*(factor * value for value in (
            both.positive_mean, both.negative_mean, both.positive_std, both.negative_std))),
        simulation={**model.simulation, **{name: model.simulation[name] * factor for name in (
            'inertia', 'presliding_stiffness', 'presliding_damping')}})


def test_joint_that_moves_at_zero_current_is_refused():
    run = IdentificationRun(IdentificationGoal(**QUICK), note_model(1).drive)
    with pytest.raises(IdentificationError, match='does not come to rest'):
        assert not any(run.update(k * 1e-3, 1e-5 * k, 0.0, 0.0) for k in range(20000))


def test_speeds_that_need_too_much_current_are_left_out_and_said():
    """As of default speeds on a drive that was given a small current limit."""
    model = note_model(1)
    model.drive = replace(model.drive, current_limit=0.34)
    run, _, _ = identify(model, motion_range=0.5)
    result = run.result()
    assert np.abs(result.speeds).max() < 0.99 * math.radians(100.0)
    assert any(word.startswith('1.74533 rad/s left out') for word in result.warnings)


def test_cancelling_gives_zero_current():
    def cancel(run, sample):
        if run.phase == 'velocity' and sample[1] > 0.1:
            run.abort()
            assert (run.error, run.phase) == ('cancelled', 'failed')
            assert run.update(*sample) == 0.0
            raise KeyboardInterrupt
        return sample
    with pytest.raises(KeyboardInterrupt):
        identify(note_model(1), alter=cancel)


def test_command_never_exceeds_the_limit():
    model = note_model(1)
    model.drive = replace(model.drive, current_limit=0.24)
    assert 0.1 < np.abs(identify(model)[2]).max() <= 0.24


@pytest.mark.parametrize(('entry', 'value', 'word'), [
    ('speeds', [], 'two'), ('speeds', [0.5, -0.5], 'two'), ('speeds', ['fast', 0.5], 'numbers'),
    *(('speeds', [0.5, bad], 'speeds must be') for bad in (0.0, math.nan, 1e-300, 1e300)),
    *(('motion_range', bad, 'motion_range') for bad in (0.0, math.inf, 1e300, 1e-300)),
    ('motion_range', 0.02, 'fewer than two speeds fit'),
    *(('ramp_slope', bad, 'ramp_slope') for bad in (-0.1, 1e-300)),
    *(('ramp_period', bad, 'ramp_period') for bad in (0.5, math.nan, 1e300)),
    *(('breakaway_cycles', bad, 'breakaway_cycles') for bad in (0, 2.5, 10**9)),
    ('longest_cycle', 0.0, 'longest_cycle'), ('longest_cycle', 'x', 'longest_cycle'),
    ('ramp_slope', 1.0, 'current limit')])
def test_goals_that_make_no_sense_are_refused(entry, value, word):
    with pytest.raises(InputError, match=word):
        IdentificationRun(IdentificationGoal(**{**QUICK, entry: value}), note_model(1).drive)


def test_presliding_of_an_encoder_coarser_than_stated_is_not_made_up():
    model = note_model(1)
    coarse = 2.0 * math.pi / (200 * model.drive.gear_ratio)

    def measured(run, sample):
        sample[1] = round(sample[1] / coarse) * coarse
        return sample
    model.drive = replace(model.drive, encoder_counts=4000)
    result = identify(model, alter=measured)[0].result()
    assert result.presliding is None


def test_at_the_lowest_rate_the_documented_speeds_are_driven_and_what_is_too_short_is_said():
    model = note_model(1)
    goal = {'speeds': [0.17, 0.7, 1.7], 'motion_range': 0.5, 'breakaway_cycles': 1,
            'longest_cycle': 20.0}
    result = identify(model, Plant([model], seed=1, sample_time=0.01), **goal)[0].result()
    assert result.speeds[-1] == pytest.approx(1.7, rel=0.05)
    assert result.currents == pytest.approx(model.sigmoid(result.speeds), rel=0.05)
    narrow = IdentificationGoal(**{**goal, 'motion_range': 0.4})
    assert 'widen motion_range to 0.46 rad' in narrow.too_short(1.7, 0.01)
    assert not replace(narrow, motion_range=0.46).too_short(1.7, 0.01)
