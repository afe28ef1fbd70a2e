# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about signals: contradictions are told with their cause, and valid signals have none."""

import math

from helpers import printed_by
from hypothesis import given, strategies as st
import numpy as np
import pytest
from recording_maker import DATA, needs_data
from scipy.signal import lfilter

from friction_comp.drive import Drive
from friction_comp.facts import motion, recorded
from friction_comp.facts.current import current_answer, gain_fault, late_answer, wrong_sign
from friction_comp.facts.motion import agreement_of, velocity_agreement, VelocityCheck
from friction_comp.recordings.reader import find_recordings, read_recording, recorded_joints
from friction_comp.samples import Samples

DRIVE = Drive(torque_constant=0.119, gear_ratio=50.0, encoder_counts=4096)


def movement(seconds=4.0, rate=1000.0):
    time = np.arange(0.0, seconds, 1.0 / rate)
    return time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time)


def strokes(seed=0, **changes):
    """Make a joint that a motor drives to and fro against friction, gravity and its inertia."""
    time = np.arange(0.0, 20.0, 2e-3)
    position = 0.6 * np.sin(1.3 * time)
    velocity = 0.78 * np.cos(1.3 * time)
    current = (0.3 * np.tanh(velocity / 0.02) + 0.2 * velocity + 0.4 * np.sin(position)
               - 0.05 * 1.3 * position
               + 0.02 * np.random.default_rng(seed).normal(size=len(time)))
    return Samples(time=time, position=position, velocity=velocity, current=current,
                   joint='elbow').with_(**changes)


def spoiled(signal, value, at=4321):
    values = getattr(strokes(), signal).copy()
    values[at] = value
    return strokes(**{signal: values})


def register(current, step=0.01, bit=1024, negative=False):
    """Return a current as servos report it: amounts in single precision, their sign as a bit."""
    amount = np.minimum(np.round(np.abs(current) / step), bit - 1)
    marked = current < 0.0 if negative else current > 0.0
    return (step * (amount + bit * marked)).astype(np.float32).astype(float)


def facts_of(samples, alone=True):
    """Return the first fault that any reader of a recording refuses, '' if there is none."""
    agreement = velocity_agreement(samples.time, samples.position, samples.velocity) \
        if samples.velocity is not None else motion.Agreement()
    return motion.impossible(samples) or agreement.fault or wrong_sign(samples, alone)


CURRENT, VELOCITY = strokes().current, strokes().velocity


@pytest.mark.parametrize(('samples', 'words'), [
    (spoiled('position', 1e300), 'position of 1e+300 rad at 8.642 s is impossible'),
    (spoiled('current', -1e150), 'A at 8.642 s is impossible'),
    (spoiled('velocity', 1e12), 'velocity of 1e+12 rad/s at 8.642 s'),
    (spoiled('position', 300.0), 'rad within 0.002 s'),
    (strokes(current=-CURRENT), 'effort has the wrong sign'),
    (strokes(current=-CURRENT, command=CURRENT), 'wrong sign'),
    (strokes(current=np.abs(CURRENT)), 'an amount without a sign'),
    (strokes(current=register(CURRENT)), 'its sign is a bit'),
    (strokes(current=register(CURRENT, negative=True)), 'its sign is a bit'),
    (strokes(velocity=-VELOCITY), 'one of the two has the wrong sign'),
    (strokes(), ''),
    (strokes(velocity=None), ''),
    # A person drives the joint, or the motor brakes as it was told to.
    (strokes(current=-CURRENT, load=2.0 * CURRENT), ''),
    (strokes(current=-CURRENT, command=-CURRENT), ''),
    (strokes(current=np.zeros(10_000)), ''),
    # Velocities that were logged at other times than the positions: too large and too small.
    (strokes(velocity=VELOCITY * np.repeat(np.resize([5.0, 0.1, 5.0, 0.1, 1.0], 200), 50)), ''),
    # A weight so heavy that the motor holds back on the way down.
    (strokes(current=CURRENT + 5.0 * np.cos(strokes().position)), ''),
    (strokes(position=strokes().position + 1e3), ''),
    # One that is never negative, but shows its friction; and an amount that is no motor's.
    (strokes(current=CURRENT - CURRENT.min()), ''),
    (strokes(current=np.abs(CURRENT), load=2.0 * CURRENT), ''),
    *((strokes(current=noise, command=noise[::-1]), '') for noise in (
        np.random.default_rng(seed).normal(size=10_000) for seed in range(10)))])
def test_what_no_joint_can_have_is_told_and_nothing_else(samples, words):
    fault = facts_of(samples)
    assert words in fault
    assert bool(fault) == bool(words)


def test_a_weight_that_other_joints_move_is_no_wrong_sign():
    """At one place the motor then holds more going down than going up."""
    elbow = strokes()
    lifted = elbow.with_(current=elbow.current + 3.0 * np.cos(1.3 * elbow.time + np.pi))
    assert 'brakes the motion' in wrong_sign(lifted)
    assert wrong_sign(lifted, alone=False) == ''


@needs_data
def test_measured_recordings_have_no_fault_and_most_have_one_reversed():
    refused = passed = 0
    for path in find_recordings(DATA):
        for joint in recorded_joints(path):
            samples, = read_recording(path, joint)
            assert facts_of(samples, alone=samples.arm is None) == ''
            if samples.load is None:
                fault = wrong_sign(samples.with_(current=-samples.current))
                refused, passed = refused + bool(fault), passed + (not fault)
    # The rest never pass one position both ways, or a weight hides their friction.
    assert refused >= 2 * passed > 0


@pytest.mark.parametrize(('position', 'words'), [
    (np.mod(np.linspace(0.0, 3000.0, 5000), 360.0), 'angle in deg'),
    (np.mod(np.linspace(0.0, 9.0, 5000), 1.0), 'angle in turn'),
    (np.round(2000.0 * np.sin(np.linspace(0.0, 9.0, 5000))), 'whole numbers'),
    (np.round(0.3 * np.sin(np.linspace(0.0, 9.0, 5000)) * 4096) / 4096, 'if it is in turn'),
    (np.round(100 * np.sin(np.linspace(0.0, 9.0, 5000)) * 4096 / 360) * 360 / 4096,
     'if it is in deg'),
    (np.round(0.3 * np.sin(np.linspace(0.0, 9.0, 5000)) * 4096 / 6.2831853) * 6.2831853 / 4096, ''),
    (2.0 * np.sin(np.linspace(0.0, 9.0, 5000)), ''), (np.zeros(5000), ''), (np.arange(5.0), '')])
def test_a_position_that_cannot_be_in_radians_is_told(position, words):
    fault = motion.not_in_radians(position)
    assert words in fault
    assert bool(fault) == bool(words)


@pytest.mark.parametrize(('step', 'begin', 'words'), [
    (1.0, 0.0, 'rows 1 apart'), (4.0, 0.0, 'rows 4 apart'), (1e-6, 0.0, 'too close'),
    (1e6, 1.7e18, 'no times'), (1e-3, 0.0, ''), (0.1, 1.7e9, '')])
def test_times_that_cannot_be_in_seconds_are_told(step, begin, words):
    fault = recorded.not_in_seconds(begin + step * np.arange(1000.0))
    assert words in fault
    assert bool(fault) == bool(words)
    assert recorded.not_in_seconds(1e-3 * np.arange(1000.0) / 1e-9, 1e-9) == ''


def test_turns_are_added_within_usual_steps_and_for_slow_joints_only():
    time = np.arange(0.0, 20.0, 0.05)
    turning = 9.0 * np.sin(0.2 * time) + 0.3 * np.sin(1.3 * time)
    angle = np.mod(turning + np.pi, 2.0 * np.pi) - np.pi
    for turn in (2.0 * np.pi, 360.0):
        scale = turn / (2.0 * np.pi)
        np.testing.assert_allclose(
            scale * angle + turn * motion.turns_of(time, scale * angle, turn), scale * turning)
    between = time[:-1] + 0.02
    np.testing.assert_allclose(
        motion.at_times(between, time, angle, turn=2.0 * np.pi),
        9.0 * np.sin(0.2 * between) + 0.3 * np.sin(1.3 * between), atol=2e-3)
    # A joint may have been anywhere after a gap, and one that jumps all the time is no angle.
    assert not motion.turns_of(np.array([0.0, 0.05, 0.1, 2.0]), np.array([3.1] * 3 + [-3.1])).any()
    assert not motion.turns_of(time, np.pi * np.sign(np.sin(40.0 * time))).any()


def test_rate_and_gaps():
    time = np.arange(0.0, 2.0, 1e-3)
    assert recorded.rhythm(time)[:2] == (pytest.approx(1000.0), 0)
    later = time + 0.5 * (time > 1.0) + 0.01 * (time > 1.5)
    assert recorded.rhythm(later) == (
        pytest.approx(1999 / 2.509), 1, pytest.approx(0.501), pytest.approx(1.0, abs=2e-3))
    assert recorded.rhythm(time[:1]) == recorded.rhythm(np.zeros(5)) == (0.0, 0, 0.0, 0.0)


def told(time, position, velocity, **options):
    return velocity_agreement(time, position, velocity, **options).fault


@pytest.mark.parametrize(('of_velocity', 'of_position', 'words'), [
    (57.29578, 1.0, 'deg/s'), (9.5493, 1.0, 'turns per minute'), (0.159155, 1.0, 'per second'),
    (1.0, 57.29578, 'position is in degrees'), (1.0, 0.159155, 'position is in turns'),
    (1000.0, 1.0, 'time in ms'), (3.3, 1.0, 'differ in unit'), (-1.0, 1.0, 'wrong sign'),
    (1.0, -57.29578, 'degrees, not rad, and one has the wrong sign'),
    (1.0, 1.4, 'really 0.714 times'), (1.2, 1.0, ''),
    (0.0, 1.0, 'not measured'), (1.0, 0.0, 'encoder is stuck'), (1.0, 1.0, '')])
def test_velocity_and_position_in_different_units_are_named(of_velocity, of_position, words):
    time, position, velocity = movement()
    fault = told(time, of_position * position, of_velocity * velocity)
    assert words in fault
    assert bool(fault) == bool(words)


@given(lag=st.floats(0.0, 0.02), noise=st.floats(0.0, 0.1), counts=st.integers(0, 1),
       rate=st.sampled_from([100.0, 250.0, 1000.0]), seed=st.integers(0, 100))
def test_a_late_noisy_coarse_or_interrupted_velocity_contradicts_nothing(
        lag, noise, counts, rate, seed):
    random = np.random.default_rng(seed)
    time, position, velocity = movement(rate=rate)
    velocity = np.interp(time - lag, time, velocity) + noise * random.normal(size=len(time))
    resolution = 1e-4 * counts
    if counts:
        position = resolution * np.round(position / resolution)
    time = time + 0.3 * (time > 1.0) + 0.05 * (time > 2.0)
    velocity[random.integers(0, len(time), 5)] = np.nan
    assert told(time, position, velocity, resolution=resolution) == ''


@pytest.mark.parametrize('factor', [1.0, 0.4, 3.0, 57.3, -1.0])
def test_a_low_pass_is_no_wrong_unit_and_hides_none(factor):
    """Of 0.06 s, on a joint that is pushed and stopped within a tenth of a second, as at first."""
    time = np.arange(0.0, 0.6, 1e-3)
    speed = np.interp(time, (0.0, 0.15, 0.2, 0.4, 0.45), (0.0, 0.0, 0.4, 0.4, 0.0))
    position = np.cumsum(speed) * 1e-3
    velocity = factor * lfilter([1.0 / 61.0], [1.0, -60.0 / 61.0], speed)
    faults = [agreement_of(np.array([ratio])).fault
              for ratio in motion.velocity_ratios(time, position, velocity)]
    assert any(faults) == (factor != 1.0)


@pytest.mark.parametrize(('samples', 'words'), [
    # Of every 0.1 s a busy machine misses a half, and a wrong unit shows as soon.
    ([(1e-3 * k, 5e-4 * k, 28.65) for k in range(600) if k % 100 >= 50], 'deg/s'),
    # A joint that is homed, or an angle that begins anew after a turn, is no contradiction.
    ([(1e-3 * k, 5e-4 * k - 2.0 * math.pi * (k > 500), 0.5) for k in range(1000)], '')])
def test_blocks_of_motion_decide_whatever_a_single_one_says(samples, words):
    check = VelocityCheck(blocks=5)
    faults = [check.take(*sample) for sample in samples]
    assert words in faults[-1] if words else not any(faults)


def test_the_first_verdict_of_a_control_loop_waits_for_no_import():
    printed = printed_by(
        'import sys, friction_comp.control.inputs as inputs\n'
        'check, before = inputs.VelocityCheck(5), set(sys.modules)\n'
        'faults = [check.take(1e-3 * k, 5e-4 * k, 35.0) for k in range(1000)]\n'
        'print(bool(faults[-1]), set(sys.modules) - before)')
    assert printed == 'True set()\n'


def test_a_joint_that_stands_tells_nothing():
    time = np.arange(0.0, 2.0, 1e-3)
    assert len(motion.velocity_ratios(time, np.zeros(2000), np.zeros(2000))) == 0
    assert len(motion.velocity_ratios(time, 1e-4 * np.sin(50.0 * time), np.zeros(2000))) == 0
    assert len(motion.velocity_ratios(time[:1], time[:1], time[:1])) == 0


def test_a_running_check_needs_its_number_of_blocks_and_forgives_when_the_joint_moves_well():
    check = VelocityCheck(blocks=5)
    faults = [check.take(1e-3 * k, 5e-4 * k, 35.0) for k in range(1000)]
    assert not any(faults[:500])
    assert 'deg/s' not in faults[-1]
    assert 'velocity is 70 times' in faults[-1]
    # The fault remains while the joint is at rest, and is cleared by correct motion.
    for k in range(1000, 2000):
        check.take(1e-3 * k, 0.5, 0.0)
    assert check.fault
    for k in range(2000, 3000):
        check.take(1e-3 * k, 5e-4 * k, 0.5)
    assert check.fault == ''


@pytest.mark.parametrize(('effort', 'words'), [
    (1000.0, 'N·mm'), (1.0 / 5.95, 'the current in A'), (1000.0 / 5.95, 'the current in mA'),
    (0.02, "motor's torque, without the gears"), (20.0, "motor's torque in N·mm"),
    (3.0, 'torque constant'), (-1.0, 'wrong sign'), (-1000.0, 'wrong sign, and effort has'),
    (0.0, 'not measured'), (0.003, 'not measured'), (1.0, '')])
def test_an_effort_in_another_unit_is_named(effort, words):
    command = 0.1 * np.sin(np.arange(0.0, 10.0, 0.01))
    gain, _ = current_answer(command, effort * command)
    assert gain == pytest.approx(effort)
    assert words in gain_fault(gain, DRIVE)


@pytest.mark.parametrize('factor', [1.0, -300.0])
def test_noise_is_known_by_what_the_command_does_not_explain(factor):
    random = np.random.default_rng(3)
    time = np.arange(0.0, 0.8, 1e-3)
    command = 0.1 * time
    for noise, error in ((0.0, 0.0), (0.01, 0.12)):
        answer = late_answer(time, command, factor * (
            command + noise * random.normal(size=len(time))))
        assert answer.gain == pytest.approx(factor, rel=0.15)
        assert answer.error == pytest.approx(error * abs(factor), rel=0.5, abs=1e-4)
