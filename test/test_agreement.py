# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What identification measures twice must agree; else it says what changed, and by how much."""

import math

from helpers import follow, note_model
import numpy as np
import pytest

from friction_comp.identification import agreement
from friction_comp.identification.goal import IdentificationGoal
from friction_comp.identification.profiles import cycle_position, cycle_velocity
from friction_comp.identification.ramps import Held, Ramp
from friction_comp.identification.run import IdentificationRun
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared

SPEEDS = np.array([0.09, 0.2, 0.5, 1.0, 1.6])
RANGE, COULOMB, VISCOUS = 0.9, 0.5, 0.2
STEP = 2e-3


def cycles(friction, load=lambda x: 0.0, speeds=SPEEDS, begin=0.0, noise=0.002, sensor=None):
    """Drive cycles of Eq. 3; friction(speed, position, time) and load(position) are in A."""
    random, driven = np.random.default_rng(4), []
    for speed in speeds:
        duration = 2.5 * RANGE / speed
        time = np.arange(0.0, duration, STEP)
        x = np.array([cycle_position(t, speed, duration) for t in time])
        v = np.array([cycle_velocity(t, speed, duration) for t in time])
        command = np.sign(v) * friction(np.abs(v), x, begin + time) + load(x)
        measured = (sensor or (lambda i: i))(command) + noise * random.standard_normal(len(x))
        driven.append(agreement.Cycle.measured(
            begin, duration, speed, np.column_stack([begin + time, x, measured]), command, np.inf))
        begin += duration + 2.0
    return driven


def plain(speed, x, time):
    return COULOMB + VISCOUS * speed


def warming(speed, x, time):
    warm = np.exp(-time / 60.0)
    return COULOMB * (1.0 + 0.1 * warm) + VISCOUS * (1.0 + 0.5 * warm) * speed


@pytest.mark.parametrize(('held', 'count', 'is_said'), [
    (0.50, 1e-3, True),     # friction at the lowest speed is 0.518 A
    (0.50, 1e-4, False),    # a fine encoder sees creep
    (0.55, 1e-3, False)])   # friction falls: a joint that slides becomes faster
def test_breakaway_of_a_joint_that_may_have_crept_unseen_is_said_to_be_doubtful(
        held, count, is_said):
    time = np.arange(0.0, 0.15, STEP)
    ramps = [Ramp(sign, sign, np.column_stack([time, 0.0 * time, sign * held + 0.0 * time]),
                  Held(time[0], time[-1], 0.0)) for sign in (1, -1)]
    said = agreement.say_unseen_creep(cycles(plain, speeds=SPEEDS[:1])[0], ramps, count)
    assert bool(said) == is_said
    assert not said or 'creep of up to 0.01 rad/s' in said[0]


@pytest.mark.parametrize(('swing', 'is_said'), [(0.1, False), (0.4, True)])
def test_a_current_that_oscillates_at_any_gain_is_said(swing, is_said):
    said = agreement.say_scatter(cycles(
        lambda speed, x, time: COULOMB * (1.0 + swing * np.sin(90.0 * time)), speeds=SPEEDS[:2]))
    assert bool(said) == is_said


def viscous(points):
    points = sorted(points, key=lambda point: point.speed)
    return fit_sigmoid([p.speed for p in points], [p.current for p in points])[0].viscous


def test_friction_that_falls_while_it_is_measured_is_named_and_that_of_the_end_given():
    first = cycles(warming)
    again = cycles(warming, speeds=SPEEDS[[0, 2, 4]], begin=150.0)
    points, drift = agreement.without_drift(first, again)
    end = VISCOUS * (1.0 + 0.5 * np.exp(-again[-1].time / 60.0))
    assert viscous([p for cycle in first for p in cycle.points]) > 1.08 * end
    assert viscous(points) == pytest.approx(end, rel=0.04)
    truth = np.array([np.sign(p.speed) * warming(abs(p.speed), 0.0, again[-1].time)
                      for p in points])
    np.testing.assert_allclose([p.current for p in points], truth, rtol=0.015)
    [words] = agreement.say_drift(drift)
    expected = warming(1.6, 0.0, again[-1].time) / warming(1.6, 0.0, first[-1].time) - 1.0
    assert drift[1.6] == pytest.approx(expected, abs=0.005)
    assert f'{drift[1.6]:+.1%} at 1.6 rad/s' in words


def test_friction_that_stays_is_what_was_measured_first():
    first, again = cycles(plain, noise=0.05), cycles(plain, speeds=SPEEDS[[0, 2, 4]], begin=150.0)
    points, drift = agreement.without_drift(first, again)
    assert points == [point for cycle in first for point in cycle.points]
    assert not drift
    assert not agreement.say_drift(drift)
    assert not agreement.check_positions(first, again)
    assert not agreement.check_currents(first)


@pytest.mark.parametrize('load', [lambda x: 0.4 * x, lambda x: 0.4 * np.sin(x + 0.5)])
def test_neither_a_spring_nor_gravity_is_taken_for_viscous_friction(load):
    driven = cycles(plain, load)
    assert viscous([p for cycle in driven for p in cycle.points]) > 1.1 * VISCOUS
    level = agreement.levelled(driven, agreement.position_slopes(driven))
    assert viscous([p for cycle in level for p in cycle.points]) == pytest.approx(VISCOUS, rel=0.02)


def test_friction_that_rises_over_the_range_does_not_bend_the_curve():
    driven = cycles(lambda v, x, t: plain(v, x, t) * (1.0 + 0.3 * (x - 0.5 * RANGE)))

    def error(cycles):
        return max(abs(abs(p.current) / plain(abs(p.speed), 0.0, 0.0) - 1.0)
                   for cycle in cycles for p in cycle.points)
    assert error(driven) > 0.05
    assert error(agreement.levelled(driven, agreement.position_slopes(driven))) < 0.025


def test_what_varies_over_position_is_named_with_its_size():
    def worm(speed, x, time):
        return plain(speed, x, time) * (1.0 + 0.25 * np.sin(50.0 * x))
    [words] = agreement.check_positions(cycles(worm, noise=0.05), cycles(worm, begin=150.0))
    assert words.startswith('friction varies over position')
    assert 22 <= float(words.split('±')[1].split('%')[0]) <= 27
    [words] = agreement.check_positions(*(
        cycles(plain, lambda x: 0.1 * np.sin(40.0 * x), begin=begin) for begin in (0.0, 150.0)))
    assert words.startswith('the load varies over position')
    # What turns once with the joint is seen as a rise over the short range of a slow cycle.
    [words] = agreement.check_positions(*(cycles(
        lambda v, x, t: plain(v, x, t) * (1.0 + 0.2 * np.sin(x - 0.45)), begin=begin)
        for begin in (0.0, 150.0)))
    assert words.startswith('friction varies over position')
    assert 7 <= float(words.split('±')[1].split('%')[0]) <= 11
    # Noise that is different each time does not count.
    loud = cycles(plain, noise=0.3)
    assert not agreement.check_positions(loud, cycles(plain, speeds=SPEEDS[:1], begin=9.0))


@pytest.mark.parametrize(('sensor', 'words'), [
    (lambda i: 0.9 * i, '0.90 times'), (lambda i: i - 0.05, '-8% of friction'),
    (lambda i: i - 0.08 * np.sign(i), '0.87 times')])
def test_a_current_sensor_that_is_off_is_named(sensor, words):
    [said] = agreement.check_currents(cycles(plain, sensor=sensor))
    assert words in said


def test_a_lag_of_current_or_position_is_named():
    assert agreement.say_lag(0.004) == []
    assert 'the measured current is 0.02 s later than the position' in agreement.say_lag(0.02)[0]
    assert 'the measured position is 0.01 s later than the current' in agreement.say_lag(-0.01)[0]


def test_a_joint_that_still_accelerates_with_unknown_inertia_is_named():
    driven = cycles(plain)
    fast = driven[-1]
    late = [*driven[:-1], fast.again(math.inf, 0.0)]
    assert agreement.say_unsettled(driven, late) == []
    bent = fast.samples + np.outer((fast.samples[:, 0] - fast.begin) ** 2, (0.0, 0.5, 0.0))
    unsettled = agreement.Cycle.measured(
        fast.begin, fast.duration, fast.speed, bent, fast.commands, 10.0)
    [words] = agreement.say_unsettled(
        [*driven[:-1], unsettled], [*driven[:-1], unsettled.again(math.inf, 0.0)])
    assert 'from 1.6 rad/s on' in words
    assert f'off by {1.0 / 10.0 / plain(1.6, 0.0, 0.0):.0%}' in words


def test_friction_that_varies_over_position_averages_out_without_whole_periods():
    for phase in (0.0, 2.0, 4.0):
        driven = cycles(
            lambda v, x, t, p=phase: plain(v, x, t) * (1.0 + 0.4 * np.sin(50.0 * x + p)))
        for cycle in driven:
            truth = plain(cycle.speed, 0.0, 0.0)
            np.testing.assert_allclose([abs(p.current) for p in cycle.points], truth, rtol=0.02)
        # Plain means of the fastest are off by more, of which viscous friction is a small part.
        assert max(abs(abs(np.mean(phase[:, 2])) / truth - 1.0)
                   for phase in driven[-1].phases()) > 0.025


@pytest.mark.parametrize('share', [0.0, 0.3])
def test_a_whole_run_drives_three_speeds_again_and_tells_of_a_drive_that_warms_up(share):
    model = note_model(1)
    warm = Undeclared.from_dict({'format': 'friction_comp_undeclared', 'version': 1, 'effects': [
        {'name': 'warm_up', 'parameters': {'share': share, 'time_constant': 25.0}}]})
    goal = IdentificationGoal(speeds=np.radians([10.0, 20.0, 40.0, 60.0, 100.0]), ramp_slope=0.06,
                              breakaway_cycles=2, longest_cycle=4.0, ramp_period=8.0)
    run = IdentificationRun(goal, model.drive)
    follow(run, Plant([model], seed=1, sample_time=4e-3, undeclared=[warm]))
    result = run.result()
    assert len(result.speeds) == 10
    assert [cycle.speed for cycle in run.repeated] == [goal.speeds[k] for k in (0, 2, 4)]
    notes = result.model(model.drive).notes
    if not share:
        assert result.warnings == notes['warnings'] == notes['drift'] == []
        return
    assert [word for word in result.warnings if 'drifted' in word]
    left = 1.0 + share * np.exp(-run.repeated[-1].time / 25.0)
    np.testing.assert_allclose(result.currents, left * model.sigmoid(result.speeds), rtol=0.04)
    assert [entry['speed'] for entry in notes['drift']] == list(result.drift)
    assert all(entry['share'] < -0.05 for entry in notes['drift'])


@pytest.mark.parametrize(('ripple', 'words'), [(0.0, 'pushed'), (0.2, '±20%')])
def test_currents_that_do_not_hold_have_the_cause_that_the_slowest_cycle_shows(ripple, words):
    """Friction that varies once a turn of the motor, behind a gear of 50."""
    driven = cycles(lambda v, x, t: COULOMB * (1.0 + ripple * np.cos(50.0 * x)), noise=0.02)
    assert words in agreement.why_unreliable(driven[0])
