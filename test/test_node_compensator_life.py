# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensator over DDS: start, end, and faults."""

import signal
import subprocess
import sys
import time

from node_process import environment, PATIENCE, Process
import numpy as np
import pytest
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
    unasked,
    ZERO,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from friction_comp.control.compensation_loop import ALONE

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
