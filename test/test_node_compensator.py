# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensator over DDS, with joint states from the test: answers, requests, faults and ends."""

from array import array
from dataclasses import replace
import os
import signal
import time

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from node_process import Process, unread_pipe
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
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
    unasked,
    value_of,
    ZERO,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray
from std_srvs.srv import Trigger

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.compensation_loop import ALONE
from friction_comp.model.friction_model import FrictionModel


def settled(driver, ahead=0):
    """Return the commands at rest once a change of law or model has faded in, `ahead` of now, s."""
    driver.announce([1, 1])
    base = time.time_ns() + ahead * 10**9
    return [driver.ask(ZERO, ZERO, base + k * 50_000_000) for k in range(20)][-1]


@pytest.mark.parametrize('law', ['continuous', 'paper', 'kinetic', 'none'])
def test_answers_every_state_with_the_current_of_the_law(driver, law):
    probe = driver.probe
    assert probe.set_parameter('compensator', 'law', law) is None
    expected = CompensationLaw([FrictionModel.load(path) for path in MODELS[:2]], law)
    # A start from rest of two joints: stamps in s, positions and velocities.
    steps = np.arange(40)
    times, position = 1e-3 * steps, np.maximum(steps - 10, 0)[:, None] ** 2 * [[2e-5, -1e-5]]
    velocity = np.vstack((ZERO, np.diff(position, axis=0) / 1e-3))
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


@pytest.mark.parametrize(('changes', 'words'), [
    ({'notes': {'unit': 'N·m'}}, 'command_interface'), ({'joint': 'shoulder'}, 'shoulder'),
    ({'notes': {'verdict': 'record again', 'reasons': ['Too short.']}}, 'Too short')])
def test_a_model_that_cannot_be_used_is_refused_while_the_motor_is_driven(
        driver, tmp_path, changes, words):
    path = tmp_path / 'model.yaml'
    path.write_text(str({**FrictionModel.load(MODELS[0]).to_dict(), **changes}))
    before = driver.ask(ZERO, ZERO)
    probe = driver.probe
    assert words in probe.set_parameter('compensator', 'model_files', [str(path), MODELS[1]])
    assert probe.get_parameter_of('compensator', 'model_files') == MODELS[:2]
    assert driver.ask(ZERO, ZERO) == before


def test_a_new_model_is_taken_over_while_running(driver):
    before = settled(driver)
    files = [MODELS[2], MODELS[1]]
    assert driver.probe.set_parameter('compensator', 'model_files', files) is None
    wanted = 0.9 * FrictionModel.load(MODELS[2]).breakaway.positive_mean
    assert settled(driver, 1) == [
        pytest.approx(wanted, rel=1e-3), pytest.approx(before[1], abs=1e-6)]


def test_what_a_file_says_against_its_model_is_told(driver, tmp_path):
    notes = {'verdict': 'record again', 'reasons': ['It falls.'], 'warnings': ['old']}
    replace(FrictionModel.load(MODELS[0]), notes=notes).save(tmp_path / 'elbow.yaml')
    probe = driver.probe
    assert probe.set_parameter('compensator', 'accept_record_again', True) is None
    assert probe.set_parameter(
        'compensator', 'model_files', [str(tmp_path / 'elbow.yaml'), MODELS[1]]) is None
    driver.ask(ZERO, ZERO)
    status = probe.status_of('compensator', lambda status: (
        status.level == b'\x01' and 'elbow: ' in status.message
        and ': It falls' in status.message))
    assert 'It falls' in value_of(status, 'said of the models')
    assert 'old' not in value_of(status, 'said of the models')
    probe.until(lambda: 'It falls' in driver.process.text, 'a line in the log')


def test_diagnostics_report_each_law_and_state_however_short(driver):
    """A recording shows by them when which law and model were used."""
    probe, laws = driver.probe, ['none', 'kinetic', 'continuous', 'none']
    probe.status_of('compensator')
    messages = probe.heard['/diagnostics']
    for law in laws:
        assert probe.set_parameter('compensator', 'law', law) is None
    for transition in ('deactivate', 'activate'):
        assert probe.transition('compensator', transition)
    used = [('active', law) for law in laws] + [('inactive', 'none'), ('active', 'none')]

    def all_reported_in_order():
        values = ({v.key: v.value for v in status.values} for message in messages
                  for status in message.status if status.name.startswith('compensator:'))
        reported = ((one['state'], one['law']) for one in values)
        return all(pair in reported for pair in used)
    probe.until(all_reported_in_order, 'laws and states in diagnostics')
    assert probe.set_parameter('compensator', 'breakaway_gain', 0.5) is None
    probe.status_of('compensator', lambda status: value_of(
        status, 'settings') == 'breakaway_gain 0.5')


def test_the_current_limit_holds_and_may_change(driver):
    probe = driver.probe
    assert probe.set_parameter('compensator', 'current_limit', 0.05) is None
    driver.announce([1, -1])
    np.testing.assert_allclose(driver.ask(ZERO, ZERO), [0.05, -0.05])
    assert probe.set_parameter('compensator', 'current_limit', 0.0) is None
    driver.announce([1, -1])
    assert driver.ask(ZERO, ZERO) == ZERO, '0 is no other word for no limit'
    assert probe.set_parameter('compensator', 'current_limit', 1000.0) is None
    assert settled(driver)[0] > 0.05


def test_another_commander_is_a_fault_that_stays_until_it_is_reset(driver):
    probe = driver.probe

    def reset():
        return probe.call(Trigger, '/compensator/reset_faults', Trigger.Request())
    # The first call establishes the connection for the measured one.
    assert reset().message == 'nothing was latched'
    end = time.monotonic() + ALONE + 1.0
    while time.monotonic() < end:
        driver.announce([1, 1])
        assert driver.ask(ZERO, ZERO)[0] > 0.05
        probe.spin_for(0.02)
    other = probe.create_publisher(Float64MultiArray, 'current_command', RELIABLE)
    try:
        probe.until(lambda: list(driver.commands[-1].data) == ZERO, 'zero current')
        status = probe.status_of('compensator', lambda s: 'latched' in s.message)
        assert 'may command' in status.message
    finally:
        probe.destroy_publisher(other)
    driver.commands.clear()
    # It sends no commands until it knows that there is no other commander.
    driver.find()
    assert not any(any(command.data) for command in driver.commands)
    assert probe.status_of('compensator', lambda s: s.message.endswith('(latched)'))
    assert 'may command' in reset().message
    driver.find(direction=[1, 1])
    assert driver.process.text.count('stays until') == 1


@pytest.mark.parametrize(('kind', 'topic', 'words'), [
    (JointState, 'joint_states', ('elbow, shoulder come from several publishers',)),
    (Int8MultiArray, 'direction', ('elbow', 'contradict each other'))])
def test_two_publishers_that_contradict_each_other_get_no_current_and_are_named(
        driver, kind, topic, words):
    """Each of them has a driver's stamps; neither says a position that cannot be."""
    assert driver.probe.set_parameter('compensator', 'direction_timeout', 0.4) is None
    currents = []
    with probe_node() as other:
        rival = other.talk(kind, topic, RELIABLE)
        other.matched(rival)

        def named():
            """Both publish, until neither has had a current for a while, and it is said why."""
            for values in ([1, 1], [-1, -1]):
                if kind == JointState:
                    rival.publish(joint_state(time.time_ns(), JOINTS, [0.3, 0.3]))
                    driver.announce([1, 1])
                else:
                    (driver.directions if values[0] > 0 else rival).publish(
                        Int8MultiArray(data=array('b', values)))
                    driver.probe.spin_for(0.05)
                currents.append(driver.ask(ZERO, ZERO)[0])
            return np.abs(currents[-10:]).max() < 0.01 and any(
                '/probe_' in status.message and all(word in status.message for word in words)
                for message in diagnostics for status in message.status)
        diagnostics = driver.probe.listen(DiagnosticArray, '/diagnostics')
        driver.probe.until(named, 'zero current, and the names')
    # A single publisher is accepted when the conflict is over.
    driver.probe.until(lambda: driver.announce([1, 1]) or driver.ask(ZERO, ZERO)[0] > 0.05,
                       'a current')


def test_requests_that_cannot_be_met_are_refused_while_the_motor_is_driven(driver):
    driver.announce([1, 1])
    before = driver.ask(ZERO)
    assert min(before) > 0.05
    for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE,
                   Transition.TRANSITION_CLEANUP, 250):
        request = ChangeState.Request(transition=Transition(id=number))
        assert not driver.probe.call(
            ChangeState, '/compensator/change_state', request).success
        driver.announce([1, 1])
        assert driver.ask(ZERO) == before
    unknown = [Parameter(name='law', value=ParameterValue(type=77))]
    answer = driver.probe.call(SetParameters, '/compensator/set_parameters',
                               SetParameters.Request(parameters=unknown))
    assert not answer.results
    answer = driver.probe.call(
        SetParametersAtomically, '/compensator/set_parameters_atomically',
        SetParametersAtomically.Request(parameters=unknown))
    assert not answer.result.successful
    # Bytes that are no joint state, and one whose name is no text.
    for data in (b'\x00\x01\x00\x00\x01', bytes.fromhex(
            '00010000000000000000000001000000000000000100000002000000ff000000')):
        driver.states.publish(data)
    driver.announce([1, 1])
    assert driver.ask(ZERO) == before
    assert driver.process.running
    assert 'was refused' in driver.process.text


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


def test_silence_gives_zero_current_also_where_nobody_reads_the_log(tmp_path):
    """Each wrong state is a line in the log; none of them delays an answer, the zero or the end."""
    with unread_pipe(tmp_path) as pipe, own_domain(), probe_node() as probe, Process(
            tmp_path / 'run', 'compensator', {**START, 'joint_state_timeout': 0.3},
            error=pipe, fresh=True) as process:
        driver, longest = FakeDriver(probe, JOINTS), 0.0
        driver.find(direction=[1, 1])
        for wrong in (float('nan'), float('inf'), 1e300) * 40:
            begin = time.monotonic()
            driver.ask([0.0, wrong], ZERO)
            longest = max(longest, time.monotonic() - begin)
        assert longest < 0.3
        driver.find(direction=[1, 1])
        begin = time.monotonic()
        probe.until(lambda: unasked(driver.commands[-1]), 'a command of its own accord')
        assert time.monotonic() - begin < 0.5
        assert list(driver.commands[-1].data) == ZERO
        assert probe.status_of('compensator', lambda s: (
            s.level == b'\x02' and 'no joint_states' in s.message))
        process.send(signal.SIGTERM)
        assert process.wait() == 0
        assert list(driver.commands[-1].data) == ZERO


@pytest.mark.parametrize('number', [None, signal.SIGTERM, signal.SIGTSTP])
def test_a_listener_that_pauses_hears_the_last_zero(tmp_path, number):
    """However the compensator ends, or is deactivated."""
    with compensator(tmp_path / 'one', [1, 1]) as driver, Process(tmp_path / 'two', 'plant', {
            'joints': JOINTS, 'model_files': MODELS[:2], 'command_timeout': 10.0,
            'sample_time': 0.01}, {'joint_states': 'states_of_plant'}) as plant:
        probe = driver.probe

        def commanded():
            driver.announce([1, 1])
            driver.ask(ZERO, ZERO)
            return float(value_of(probe.status_of('plant'), 'elbow: command [A]')) > 0.05
        probe.until(commanded, 'a current in the plant')
        plant.send(signal.SIGSTOP)
        driver.announce([1, 1])
        assert driver.ask(ZERO, ZERO)[0] > 0.05
        if number is None:
            driver.probe.begin_transition('compensator', 'deactivate')
        else:
            driver.process.send(number)
        probe.spin_for(1.6)
        plant.send(signal.SIGCONT)
        probe.status_of('plant')
        assert float(value_of(probe.status_of('plant'), 'elbow: command [A]')) == 0.0
        if number is not None:
            assert driver.process.wait() == 0
        assert 'not acknowledged' not in driver.process.text


def test_a_zero_that_nobody_acknowledges_is_told(tmp_path):
    with compensator(tmp_path / 'one', [1, 1]) as driver, Process(tmp_path / 'two', 'recorder', {
            'output': str(tmp_path / 'recording')}) as stopped:
        probe = driver.probe
        probe.until(lambda: (driver.ask(ZERO, ZERO), int(value_of(probe.status_of(
            'compensator'), 'listeners to the command')))[1] > 1, 'a second listener')
        stopped.send(signal.SIGSTOP)
        driver.ask(ZERO, ZERO)
        driver.process.send()
        assert driver.process.wait() == 0
        assert 'zero, was not acknowledged within 2 s' in driver.process.text
        stopped.send(signal.SIGCONT)


def test_what_drives_a_motor_has_no_memory_in_common_with_those_who_listen(driver):
    """A listener that is stopped with the lock of such memory would stop its publishers, too."""
    folder = f'/proc/{driver.process._process.pid}/fd'
    files = []
    for end in os.listdir(folder):
        try:
            files.append(os.readlink(f'{folder}/{end}'))
        except OSError:
            continue
    assert files
    assert not [file for file in files if file.startswith('/dev/shm/fastrtps')]
