# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensator over DDS, with joint states from the test."""

from dataclasses import replace
import math
import time

from node_process import Process
import numpy as np
import pytest
from ros_system import (
    compensator,
    FakeDriver,
    joint_state,
    JOINTS,
    MODELS,
    own_domain,
    probe_node,
    RELIABLE,
    START,
    tick,
    value_of,
    ZERO,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, Temperature

from friction_comp.compensation.law import CompensationLaw
from friction_comp.model.friction_model import FrictionModel


def movement(count=40):
    """Stamps in s, positions and velocities of a start from rest, two joints."""
    steps = np.arange(count)
    travelled = np.maximum(steps - 10, 0)[:, None] ** 2 * np.array([[2e-5, -1e-5]])
    velocity = np.vstack((np.zeros((1, 2)), np.diff(travelled, axis=0) / 1e-3))
    return steps * 1e-3, travelled, velocity


@pytest.mark.parametrize('law', ['continuous', 'paper', 'kinetic', 'none'])
def test_answers_every_state_with_the_current_of_the_law(driver, law):
    probe = driver.probe
    assert probe.set_parameter('compensator', 'law', law) is None
    expected = CompensationLaw([FrictionModel.load(path) for path in MODELS[:2]], law)
    times, position, velocity = movement()
    # Before the first state, since loading compiled code may take longer than a silence may last.
    wanted = [expected.update(t, x, v, np.array([1.0, -1.0])).copy()
              for t, x, v in zip(times, position, velocity)]
    base = time.time_ns()
    driver.announce([1, -1])
    commands = [driver.ask(x, v, base + round(t * 1e9))
                for t, x, v in zip(times, position, velocity)]
    np.testing.assert_allclose(commands, wanted, rtol=0, atol=1e-12)
    assert len(driver.answers) == len(times)
    assert np.any(commands) == (law != 'none')


def test_a_state_sent_again_is_answered_again_but_one_that_crossed_is_not(driver):
    base = time.time_ns()
    # Sent again before it can have been answered; by a machine that is held up just then it is not.
    begun, count = -math.inf, 0
    while time.monotonic() - begun > 0.05:
        begun, count, base = time.monotonic(), count + 1, base + 1_000_000
        for _ in range(2):
            driver.states.publish(joint_state(base, JOINTS, ZERO))
    # States are taken in order: after the answer to a later one none before is still to come.
    later = base + 1_000_000
    driver.states.publish(joint_state(later, JOINTS, ZERO, [0.5, 0.5]))
    driver.probe.until(lambda: driver.answers and driver.answers[-1].data[0] > 0.05, 'an answer')
    assert len(driver.answers) == count + 1
    last = list(driver.answers[-1].data)
    driver.probe.spin_for(0.2)
    assert driver.ask([0.0, 0.0], [0.5, 0.5], later) == last
    assert len(driver.answers) == count + 2


def test_lifecycle_and_zero_current_on_deactivation(driver):
    probe = driver.probe
    driver.announce([1, 1])
    assert driver.ask([0.0, 0.0], ZERO)[0] > 0.05
    driver.rest()
    assert probe.state_of('compensator') == 'inactive'
    count = len(driver.commands)
    driver.states.publish(joint_state(time.time_ns(), JOINTS, ZERO))
    probe.spin_for(0.3)
    assert len(driver.commands) == count
    assert probe.transition('compensator', 'cleanup')
    assert probe.state_of('compensator') == 'unconfigured'
    assert probe.transition('compensator', 'configure')
    driver.activate()
    driver.find()
    driver.begin_anew()
    driver.announce([1, 1])
    assert driver.ask([0.0, 0.0], ZERO)[0] > 0.05


def test_a_new_model_is_taken_over_while_running(driver, tmp_path):
    probe = driver.probe
    driver.announce([1, 1])
    before = driver.ask([0.0, 0.0], ZERO)
    bad = tmp_path / 'bad.yaml'
    bad.write_text('format: friction_comp_model\nversion: 1\n')
    for files in ([MODELS[2], str(bad)], [MODELS[2], str(tmp_path / 'none.yaml')], [MODELS[2]]):
        assert probe.set_parameter('compensator', 'model_files', files)
        assert probe.get_parameter_of('compensator', 'model_files') == MODELS[:2]
        driver.announce([1, 1])
        np.testing.assert_allclose(driver.ask([0.0, 0.0], ZERO), before, atol=1e-12)
    assert probe.set_parameter('compensator', 'model_files', [MODELS[2], MODELS[1]]) is None
    driver.announce([1, 1])
    base = time.time_ns()
    for k in range(20):
        # The difference between the models fades in within some 0.05 s.
        after = driver.ask([0.0, 0.0], ZERO, base + k * 50_000_000)
    wanted = 0.9 * FrictionModel.load(MODELS[2]).breakaway.positive_mean
    assert after == [pytest.approx(wanted, rel=1e-3), pytest.approx(before[1], abs=1e-6)]


def test_diagnostics_report_each_law_and_state_however_short(tmp_path):
    # From these, a recording shows when which law and model were used. What changes is said between
    # the reports of each second, too.
    with compensator(tmp_path, period=1.0) as driver:
        probe = driver.probe
        probe.status_of('compensator')
        messages, laws = probe.heard['/diagnostics'], ['none', 'kinetic', 'continuous', 'none']
        for law in laws:
            assert probe.set_parameter('compensator', 'law', law) is None
        for transition in ('deactivate', 'activate', 'deactivate'):
            assert probe.transition('compensator', transition)
        used = [('active', law) for law in laws] + [
            (state, 'none') for state in ('inactive', 'active', 'inactive')]

        def all_reported_in_order():
            values = ({v.key: v.value for v in status.values} for message in messages
                      for status in message.status if status.name.startswith('compensator:'))
            reported = ((one['state'], one['law']) for one in values)
            return all(pair in reported for pair in used)
        probe.until(all_reported_in_order, 'laws and states in diagnostics')
        assert value_of(probe.status_of('compensator'), 'settings') == ''
        assert probe.set_parameter('compensator', 'breakaway_gain', 0.5) is None
        probe.status_of('compensator', lambda status: value_of(
            status, 'settings') == 'breakaway_gain 0.5')


def test_effects_whose_signal_is_missing_are_named_with_the_reason(tmp_path):
    """Never received, there, stale, there again; and a load, which this node never measures."""
    warm = FrictionModel.load(MODELS[0]).to_dict()
    FrictionModel.from_dict({**warm, 'effects': [
        {'name': 'temperature', 'parameters': {
            'coefficients': [0.01, 0.0, 0.0], 'reference_temperature': 25.0, 'transition': 0.02}},
        {'name': 'load_friction', 'parameters': {
            'coefficients': [0.02], 'exponent': 1.0, 'transition': 0.02}}]}).save(
                tmp_path / 'warm.yaml')
    base = 10_000_000_000

    def at(second):
        """Set the clock; return the stamp."""
        stamp = base + round(second * 1e9)
        clock.publish(tick(stamp))
        return stamp

    def measure(second, degrees):
        message = Temperature(temperature=degrees)
        message.header.frame_id = 'elbow'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            base + round(second * 1e9), 1_000_000_000)
        thermometer.publish(message)

    def move(second, words):
        """Move at 0.5 rad/s until the diagnostics meet the words; return them and the current."""
        for k in range(400):
            t = second + 0.001 * k
            command = driver.ask([0.5 * t, -0.5 * t], [0.5, -0.5], at(t))
            if k % 20 == 19:
                said = value_of(probe.status_of('compensator'), 'left_out')
                if [word in said for word in words] == list(words.values()):
                    return said, command[0]
        raise AssertionError(f'{said!r} does not meet {words}')

    with own_domain(), probe_node() as probe, Process(tmp_path, 'compensator', {
            **START, 'model_files': [str(tmp_path / 'warm.yaml'), MODELS[1]], 'law': 'kinetic',
            'use_sim_time': True}):
        driver = FakeDriver(probe, JOINTS)
        clock = probe.talk(Clock, '/clock', RELIABLE)
        thermometer = probe.talk(Temperature, 'motor_temperature', RELIABLE)
        for publisher in (clock, thermometer):
            probe.matched(publisher)
        driver.find(lambda: at(-1.0))
        driver.begin_anew()
        text, alone = move(0.0, {'temperature': True, 'no motor_temperature received': True,
                                 'load is not measured here': True})
        assert text.count('elbow: ') == 2
        assert 'shoulder' not in text
        # 0.01 A per kelvin from 25 °C on, which fades in.
        measure(0.5, 35.0)
        assert move(1.0, {'temperature': False, 'load_friction': True})[1] == pytest.approx(
            alone + 0.1, abs=0.01)
        for _ in range(10):
            # By default a node subscribes to /clock with best effort.
            at(61.0)
            probe.spin_for(0.02)
        assert move(61.0, {'last motor_temperature is 6': True, 'load_friction': True})[
            1] == pytest.approx(alone, abs=0.01)
        measure(61.9, 15.0)
        assert move(62.0, {'temperature': False, 'load_friction': True})[1] == pytest.approx(
            alone - 0.1, abs=0.01)


def test_in_simulated_time_a_state_waits_for_the_direction_of_its_tick(tmp_path):
    parameters = {**START, 'use_sim_time': True, 'wait_for_direction': True}
    with own_domain(), probe_node() as probe, Process(tmp_path, 'compensator', parameters):
        driver = FakeDriver(probe, JOINTS)
        clock = probe.talk(Clock, '/clock', RELIABLE)
        planner = probe.talk(JointState, 'direction_stamped', RELIABLE)
        for publisher in (clock, planner):
            probe.matched(publisher)

        def at(stamp):
            clock.publish(tick(stamp))
            return stamp
        # A planner that has said nothing yet is not waited for.
        driver.find(lambda: at(1_000_000_000))
        planner.publish(joint_state(2_000_000_000, JOINTS, [], [1.0, -1.0]))
        assert driver.ask(ZERO, ZERO, at(2_000_000_000))[0] > 0.05
        count = len(driver.answers)
        # By default a node subscribes to /clock with best effort.
        for _ in range(10):
            driver.states.publish(joint_state(at(2_010_000_000), JOINTS, ZERO))
            probe.spin_for(0.02)
        assert len(driver.answers) == count
        planner.publish(joint_state(2_010_000_000, JOINTS, [], [-1.0, 1.0]))
        assert driver.ask(ZERO, ZERO, 2_010_000_000)[0] < -0.05
        # Nor is one that is gone.
        probe.destroy_publisher(planner)
        driver.find(lambda: at(3_000_000_000))


@pytest.mark.parametrize(('name', 'value'), [
    ('law', 'magic'), ('breakaway_gain', 1.1), ('breakaway_gain', -0.1),
    ('current_limit', -1.0), ('joints', ['other', 'names']), ('joint_state_timeout', 1.0),
    ('direction_timeout', 0.0), ('breakaway_gain', 'much')])
def test_refuses_parameters_that_make_no_sense(shared_compensator, name, value):
    probe = shared_compensator.probe
    before = probe.get_parameter_of('compensator', name)
    assert probe.set_parameter('compensator', name, value)
    assert probe.get_parameter_of('compensator', name) == before


def test_a_model_in_another_unit_is_refused_while_the_motor_is_driven(driver, tmp_path):
    before = driver.ask(ZERO, ZERO)
    model = FrictionModel.load(MODELS[0])
    for unit, word in (('LSB', 'LSB'), ('N·m', 'command_interface')):
        model.notes = {'unit': unit}
        model.save(tmp_path / 'elbow.yaml')
        why = driver.probe.set_parameter(
            'compensator', 'model_files', [str(tmp_path / 'elbow.yaml'), MODELS[1]])
        assert word in why
    assert driver.ask(ZERO, ZERO) == before


@pytest.mark.parametrize('notes', [
    {'verdict': 'trust in part', 'reasons': ['The weight is not carried.'], 'warnings': ['old']},
    {'warnings': ['The weight is not carried.']}])
def test_what_a_file_says_against_its_model_is_told(driver, tmp_path, notes):
    replace(FrictionModel.load(MODELS[0]), notes=notes).save(tmp_path / 'elbow.yaml')
    probe = driver.probe
    assert probe.set_parameter(
        'compensator', 'model_files', [str(tmp_path / 'elbow.yaml'), MODELS[1]]) is None
    driver.ask(ZERO, ZERO)
    status = probe.status_of('compensator', lambda status: (
        status.level == b'\x01' and 'elbow: ' in status.message
        and ': The weight is not carried' in status.message))
    assert 'The weight is not carried' in value_of(status, 'said of the models')
    assert 'old' not in value_of(status, 'said of the models')
    probe.until(lambda: 'The weight is not carried' in driver.process.text, 'a line in the log')


def test_a_model_to_be_recorded_again_is_taken_only_if_asked_for(driver, tmp_path):
    replace(FrictionModel.load(MODELS[0]), notes={
        'verdict': 'record again', 'reasons': ['Too short.']}).save(tmp_path / 'elbow.yaml')
    files = [str(tmp_path / 'elbow.yaml'), MODELS[1]]
    probe, before = driver.probe, driver.ask(ZERO, ZERO)
    assert 'Too short' in probe.set_parameter('compensator', 'model_files', files)
    assert driver.ask(ZERO, ZERO) == before
    assert probe.set_parameter('compensator', 'accept_record_again', True) is None
    assert probe.set_parameter('compensator', 'model_files', files) is None
    assert probe.status_of('compensator', lambda status: (
        status.level == b'\x01' and 'Too short' in status.message))


def test_a_weight_beyond_the_limit_is_said_before_and_while_it_is_not_supported(driver, tmp_path):
    model = FrictionModel.load(MODELS[0]).to_dict()
    FrictionModel.from_dict({**model, 'effects': [{'name': 'gravity', 'parameters': {
        'coefficients': [0.1, 0.0]}}]}).save(tmp_path / 'heavy.yaml')
    probe = driver.probe
    assert probe.set_parameter('compensator', 'current_limit', 0.05) is None
    assert probe.set_parameter(
        'compensator', 'model_files', [str(tmp_path / 'heavy.yaml'), MODELS[1]]) is None
    assert 'in some postures its weight takes up to 0.1 A' in driver.process.text
    driver.begin_anew()
    driver.ask(ZERO, ZERO)
    words = 'gravity needs 0.1 A, more than the limit of 0.05 A'
    status = probe.status_of('compensator', lambda status: words in status.message)
    values = {value.key: value.value for value in status.values}
    assert 'more than the limit' in values['left_out']
    assert float(values['elbow: guard: not carried']) == pytest.approx(0.05)


def test_the_current_limit_holds(driver):
    assert driver.probe.set_parameter('compensator', 'current_limit', 0.05) is None
    driver.announce([1, -1])
    np.testing.assert_allclose(driver.ask([0.0, 0.0], ZERO), [0.05, -0.05])
    assert driver.probe.set_parameter('compensator', 'current_limit', 0.0) is None
    driver.announce([1, -1])
    assert driver.ask([0.0, 0.0], ZERO) == ZERO, '0 is no other word for no limit'
    assert driver.probe.set_parameter('compensator', 'current_limit', 1000.0) is None
    driver.announce([1, -1])
    base = time.time_ns()
    for k in range(20):
        command = driver.ask([0.0, 0.0], ZERO, base + k * 50_000_000)
    assert command[0] > 0.05
