# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What reaches a node is refused with a word if it cannot be used, and does not end the node."""

from pathlib import Path
import signal

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from node_process import Process
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from ros_system import compensator, joint_state, JOINTS, MODELS, own_domain, probe_node, ZERO
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger


@pytest.fixture(scope='module')
def driver(tmp_path_factory):
    with compensator(tmp_path_factory.mktemp('compensator'), [1, 1]) as found:
        yield found


def test_requests_that_cannot_be_met_are_refused_while_the_motor_is_driven(driver):
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
    driver.probe.call(Trigger, '/compensator/reset_faults', Trigger.Request())
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
    # If it was stopped for more than a second, the driver is in doubt.
    driver.probe.call(Trigger, '/compensator/reset_faults', Trigger.Request())
    driver.find(direction=[1, 1])


def test_a_time_before_zero_on_the_clock_is_ignored(tmp_path):
    with own_domain(), probe_node() as probe, Process(tmp_path / 'one', 'compensator', {
            'joints': JOINTS, 'model_files': MODELS[:2], 'use_sim_time': True}) as first, Process(
                tmp_path / 'two', 'recorder', {
                    'output': str(tmp_path / 'recording'), 'use_sim_time': True}) as second:
        ticks = probe.talk(Clock, '/clock')
        tick = Clock()
        tick.clock.sec = -5

        def answered(process):
            ticks.publish(tick)
            return 'message on /clock was ignored' in process.text

        # What is sent before both ends have discovered each other is lost.
        for process in (first, second):
            probe.until(lambda process=process: answered(process), 'the word')
            assert process.running
