# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensator over DDS: start and end, faults, and what contradicts or cannot be met."""

from array import array
from pathlib import Path
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from node_process import environment, PATIENCE, Process
import numpy as np
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.lifecycle import TransitionCallbackReturn
from ros_system import (
    BEST_EFFORT,
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
    ZERO,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray
from std_srvs.srv import Trigger

from friction_comp.control.compensation_loop import ALONE
from friction_comp.nodes.compensator import CompensatorNode

# Where a library is half imported, and where an exception would be lost.
INTERRUPTED = """
import os, signal, sys
from friction_comp.__main__ import main

class Callback:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

class Interrupt:
    def find_spec(self, name, *_):
        if name == 'rclpy.executors':
            Callback()

sys.meta_path.insert(0, Interrupt())
sys.exit(main(['compensator']))
"""


@pytest.fixture(scope='module')
def hasty(tmp_path_factory):
    """One that soon takes silence for a fault."""
    with compensator(tmp_path_factory.mktemp('hasty'), [1, 1], joint_state_timeout=0.5) as driver:
        yield driver


def test_an_interrupt_leaves_zero_current(tmp_path):
    """With default quality of service, the node hears a best-effort driver."""
    with own_domain(), probe_node() as probe, Process(
            tmp_path, 'compensator', {'joints': JOINTS, 'model_files': MODELS[:2], 'law': 'paper'},
            fresh=True) as process:
        driver = FakeDriver(probe, JOINTS, BEST_EFFORT)
        driver.find(direction=[1, 1])
        process.send()
        assert process.wait() == 0
        probe.until(lambda: list(driver.commands[-1].data) == ZERO, 'zero current')
        assert 'Traceback' not in process.text


def test_waits_for_its_manager_without_autostart(tmp_path):
    with probe_node() as probe, Process(
            tmp_path, 'compensator', {**START, 'autostart': False}, {'__node': 'managed'}):
        assert probe.state_of('managed') == 'unconfigured'
        assert probe.transition('managed', 'configure')
        assert probe.state_of('managed') == 'inactive'
        assert probe.transition('managed', 'shutdown')
        assert probe.state_of('managed') == 'finalized'


def test_silence_of_the_states_gives_zero_current(hasty):
    hasty.rest()
    hasty.activate()
    hasty.find(direction=[1, 1])
    hasty.probe.until(lambda: unasked(hasty.commands[-1]), 'a command of its own accord')
    assert list(hasty.commands[-1].data) == ZERO
    assert hasty.probe.status_of('compensator', lambda s: (
        s.level == b'\x02' and 'no joint_states' in s.message))


def test_a_stamped_direction_has_the_planners_age(driver):
    planner = driver.probe.talk(JointState, 'direction_stamped')
    driver.probe.matched(planner)

    def say(age, *velocity):
        now = time.time_ns()
        planner.publish(joint_state(now - round(age * 1e9), JOINTS, ZERO, velocity))
        return now

    def turned():
        return np.sign(driver.ask(ZERO, ZERO, say(0.0, 3.0, -2.0))).tolist() == [1.0, -1.0]
    driver.probe.until(turned, 'the direction')
    # Older than what is known: it was overtaken.
    assert np.sign(driver.ask(ZERO, ZERO, say(59.0, -1.0, -1.0))).tolist() == [1.0, -1.0]
    command = driver.ask(ZERO, ZERO, say(-600.0, 1.0, 1.0))
    assert np.abs(command).max() < 0.01, 'nobody knows how old it is'


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


@pytest.mark.parametrize(('yields', 'words'), [
    (False, 'active: commands the motor'),
    (True, 'active: commands nothing while another node may command the motor')])
def test_one_that_yields_to_another_says_so_as_it_is_activated(yields, words):
    node, said = object.__new__(CompensatorNode), []
    node._ending, node._managed_entities = False, ()
    node._configured = SimpleNamespace(open=lambda: None, yields=yields)
    node._set_state = lambda *state: said.append(state)
    assert node.on_activate(None) == TransitionCallbackReturn.SUCCESS
    assert said == [('active', words)]


def test_two_publishers_of_one_joint_are_named(driver):
    """Each of them has a driver's stamps; neither says a position that cannot be."""
    with probe_node() as other:
        rival = other.talk(JointState, 'joint_states', RELIABLE)
        other.matched(rival)
        told = []

        def named():
            """Both publish, until the compensator has found out who they are."""
            rival.publish(joint_state(time.time_ns(), JOINTS, [0.3, 0.3]))
            driver.announce([1, 1])
            told.append(driver.ask(ZERO, ZERO))
            return any(status.message.count('/probe_') == 2
                       and 'elbow, shoulder come from several publishers' in status.message
                       for message in diagnostics for status in message.status)
        diagnostics = driver.probe.listen(DiagnosticArray, '/diagnostics')
        driver.probe.until(named, 'the names of both')
        assert told[-1] == ZERO
    # A single publisher is accepted after a second.
    driver.probe.until(lambda: driver.announce([1, 1]) or driver.ask(ZERO, ZERO)[0] > 0.05,
                       'a current')


def test_planners_that_contradict_each_other_give_no_direction(driver):
    assert driver.probe.set_parameter('compensator', 'direction_timeout', 0.4) is None
    currents = []
    with probe_node() as other:
        rival = other.talk(Int8MultiArray, 'direction', RELIABLE)
        other.matched(rival)

        def ignored():
            """Both announce, until neither has had a current for a while, and it is said why."""
            for publisher, value in ((driver.directions, 1), (rival, -1)):
                publisher.publish(Int8MultiArray(data=array('b', [value, value])))
                driver.probe.spin_for(0.05)
                currents.append(driver.ask(ZERO, ZERO)[0])
            return len(currents) > 10 and np.abs(currents[-10:]).max() < 0.01 and any(
                all(words in status.message for words in (
                    'elbow', 'contradict each other', '/probe_'))
                for message in diagnostics for status in message.status)
        diagnostics = driver.probe.listen(DiagnosticArray, '/diagnostics')
        driver.probe.until(ignored, 'zero current')
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
    assert not answer.results[0].successful
    assert '77' in answer.results[0].reason
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


@pytest.mark.parametrize('number', [signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU])
def test_a_stopped_node_leaves_zero_current_and_forgets_what_it_missed(driver, number):
    driver.find(direction=[1, 1])
    status = Path(f'/proc/{driver.process._process.pid}/status')
    driver.process.send(number)
    driver.probe.until(lambda: 'T (stopped)' in status.read_text(), 'a stopped process')
    driver.probe.until(lambda: list(driver.commands[-1].data) == ZERO, 'zero current')
    # Without a stamp, a joint state counts from when it is read.
    driver.announce([1, 1])
    for _ in range(20):
        driver.states.publish(joint_state(0, JOINTS, ZERO))
    said, count = driver.process.text.count('begins anew'), len(driver.commands)
    driver.process.send(signal.SIGCONT)
    driver.probe.until(lambda: driver.process.text.count('begins anew') > said, 'the node')
    driver.probe.spin_for(0.5)
    assert not any(any(command.data) for command in driver.commands[count:])


def test_a_time_before_zero_on_the_clock_is_ignored(tmp_path):
    with own_domain(), probe_node() as probe, Process(tmp_path / 'one', 'compensator', {
            'joints': JOINTS, 'model_files': MODELS[:2], 'use_sim_time': True}) as first, Process(
                tmp_path / 'two', 'recorder', {
                    'output': str(tmp_path / 'recording'), 'use_sim_time': True}) as second:
        ticks = probe.talk(Clock, '/clock')
        def answered(process):
            ticks.publish(tick(-5 * 10**9))
            return 'message on /clock was ignored' in process.text

        # What is sent before both ends have discovered each other is lost.
        for process in (first, second):
            probe.until(lambda process=process: answered(process), 'the word')
            assert process.running


@pytest.mark.parametrize('number', [
    signal.SIGTERM, signal.SIGHUP, signal.SIGTRAP, signal.SIGRTMIN + 1])
def test_other_signals_leave_zero_current_too(tmp_path, number):
    with compensator(tmp_path, [1, 1]) as driver:
        driver.process.send(number)
        driver.probe.until(lambda: list(driver.commands[-1].data) == ZERO, 'zero current')
        assert driver.process.wait() == 0


def test_an_interrupt_while_it_is_being_imported_is_no_error():
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED], env=environment(), capture_output=True, text=True,
        timeout=PATIENCE, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', '')
