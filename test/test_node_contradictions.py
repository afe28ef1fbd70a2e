# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Contradicting inputs of the compensator give zero current, and diagnostics name the cause."""

from array import array
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import pytest
from ros_system import joint_state, JOINTS, probe_node, RELIABLE, ZERO
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8MultiArray


@pytest.fixture
def driver(driver):
    """A compensator that helps both joints into their directions."""
    driver.announce([1, 1])
    assert driver.ask(ZERO, ZERO)[0] > 0.05
    return driver


def said(driver, *words):
    """Wait for an error in the compensator's diagnostics that holds all the words."""
    def look(status):
        return status.level == b'\x02' and all(word in status.message for word in words)
    return driver.probe.status_of('compensator', look).message


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
