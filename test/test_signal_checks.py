# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Signals that contradict each other are reported with the cause, valid ones never."""

import math

from helpers import printed_by
from hypothesis import given, strategies as st
import numpy as np
import pytest
from scipy.signal import lfilter

from friction_comp.drive import Drive
from friction_comp.signal_checks import (
    beyond,
    current_answer,
    current_fault,
    late_answer,
    lost_rows,
    velocity_fault,
    velocity_ratios,
    VelocityCheck,
)

DRIVE = Drive(torque_constant=0.119, gear_ratio=50.0, encoder_counts=4096)


def movement(seconds=4.0, rate=1000.0):
    time = np.arange(0.0, seconds, 1.0 / rate)
    return time, 0.4 * np.sin(2.0 * time), 0.8 * np.cos(2.0 * time)


def told(time, position, velocity, factor=2.0, **options):
    return velocity_fault(velocity_ratios(time, position, velocity, **options), factor)


@pytest.mark.parametrize(('of_velocity', 'of_position', 'words'), [
    (57.29578, 1.0, 'deg/s'), (9.5493, 1.0, 'turns per minute'), (0.159155, 1.0, 'per second'),
    (1.0, 57.29578, 'position is in degrees'), (1.0, 0.159155, 'position is in turns'),
    (1000.0, 1.0, 'time in ms'), (3.3, 1.0, 'differ in unit'), (-1.0, 1.0, 'wrong sign'),
    (1.0, -57.29578, 'degrees, not rad, and one has the wrong sign'),
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
    assert told(time, position, velocity, factor=1.25, resolution=resolution) == ''


@pytest.mark.parametrize('factor', [1.0, 0.4, 3.0, 57.3, -1.0])
def test_a_low_pass_is_no_wrong_unit_and_hides_none(factor):
    """Of 0.06 s, on a joint that is pushed and stopped within a tenth of a second, as at first."""
    time = np.arange(0.0, 0.6, 1e-3)
    speed = np.interp(time, (0.0, 0.15, 0.2, 0.4, 0.45), (0.0, 0.0, 0.4, 0.4, 0.0))
    position = np.cumsum(speed) * 1e-3
    velocity = factor * lfilter([1.0 / 61.0], [1.0, -60.0 / 61.0], speed)
    faults = [velocity_fault(np.array([ratio]), 2.0)
              for ratio in velocity_ratios(time, position, velocity)]
    assert any(faults) == (factor != 1.0)


def test_gaps_of_a_busy_machine_do_not_delay_the_verdict():
    """Of every 0.1 s a process may miss a half, and a wrong unit must show as soon."""
    check = VelocityCheck(3.0, blocks=5)
    for k in range(600):
        if k % 100 < 50:
            continue
        check.take(1e-3 * k, 5e-4 * k, 5e-4 * 57.3e3)
    assert 'deg/s' in check.fault


def test_the_first_verdict_of_a_control_loop_waits_for_no_import():
    printed = printed_by(
        'import sys, friction_comp.control.inputs as inputs\n'
        'check, before = inputs.VelocityCheck(3.0, 5), set(sys.modules)\n'
        'faults = [check.take(1e-3 * k, 5e-4 * k, 35.0) for k in range(1000)]\n'
        'print(bool(faults[-1]), set(sys.modules) - before)')
    assert printed == 'True set()\n'


def test_a_joint_that_stands_tells_nothing():
    time = np.arange(0.0, 2.0, 1e-3)
    assert len(velocity_ratios(time, np.zeros(2000), np.zeros(2000))) == 0
    assert len(velocity_ratios(time, 1e-4 * np.sin(50.0 * time), np.zeros(2000))) == 0
    assert len(velocity_ratios(time[:1], time[:1], time[:1])) == 0


def test_a_running_check_needs_its_number_of_blocks_and_forgives_when_the_joint_moves_well():
    check = VelocityCheck(3.0, blocks=5)
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


def test_one_jump_among_many_blocks_is_no_contradiction():
    """As where a joint is homed, or an angle begins anew after a turn."""
    check = VelocityCheck(3.0, blocks=5)
    for k in range(1000):
        jump = 2.0 * math.pi if k > 500 else 0.0
        assert check.take(1e-3 * k, 5e-4 * k - jump, 0.5) == ''


@pytest.mark.parametrize(('effort', 'words'), [
    (1000.0, 'N·mm'), (1.0 / 5.95, 'the current in A'), (1000.0 / 5.95, 'the current in mA'),
    (0.02, "motor's torque, without the gears"), (20.0, "motor's torque in N·mm"),
    (3.0, 'torque constant'), (-1.0, 'wrong sign'), (-1000.0, 'wrong sign, and effort has'),
    (0.0, 'not measured'), (0.003, 'not measured')])
def test_an_effort_in_another_unit_is_named(effort, words):
    command = 0.1 * np.sin(np.arange(0.0, 10.0, 0.01))
    gain, _ = current_answer(command, effort * command)
    assert gain == pytest.approx(effort)
    assert words in current_fault(gain, DRIVE)


def test_an_effort_as_it_should_be_has_no_fault():
    assert current_fault(1.0, DRIVE) == ''


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


def test_values_that_no_joint_can_have():
    assert beyond('position', np.array([1.0, 1e300, -np.inf, np.nan])).tolist() == [
        False, True, True, False]
    assert not beyond('velocity', np.array([9e3])).any()


@pytest.mark.parametrize(('lost', 'noise', 'step'), [
    (0.03, 0.0, 1e-5), (0.1, 0.02, 1e-5), (0.03, 0.0, 1e-4), (0.0, 0.0, 1e-5), (0.0, 0.3, 1e-5),
    (0.0, 2.0, 1e-5), (0.0, 0.0, 1e-3), (0.0, 0.0, 4e-3)])
def test_rows_that_are_missing_show_in_the_position(lost, noise, step):
    """By even times; noise in parts of the usual motion from row to row."""
    rng = np.random.default_rng(3)
    true = 0.001 * np.arange(30_000)
    position = 0.8 * np.sin(2.0 * true) + 0.0016 * noise * rng.standard_normal(len(true))
    kept = np.flatnonzero(rng.random(len(true)) >= lost)
    position = step * np.round(position[kept] / step)
    found = lost_rows(true[:len(kept)], position, step)
    assert found == pytest.approx(lost, rel=0.3)
    # With the true times nothing is missing.
    assert lost_rows(true[kept], position, step) == 0.0
