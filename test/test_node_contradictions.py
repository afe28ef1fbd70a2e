# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Contradicting inputs of the compensator give zero current, and diagnostics name the cause."""

from array import array
import math
import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')

from diagnostic_msgs.msg import DiagnosticArray
from ros_system import joint_state, JOINTS, probe_node, RELIABLE, ZERO
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8MultiArray

pytestmark = pytest.mark.slow


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


@pytest.mark.parametrize(('names', 'position', 'words'), [
    (['elbow', 'shoulder', 'elbow'], [0.0, 0.0, 0.5], 'elbow twice'),
    (JOINTS, [0.0, 1e300], 'shoulder: a position of 1e+300 rad is impossible')])
def test_states_that_cannot_be_are_named(driver, names, position, words):
    command = driver.ask(position, [0.0] * len(names), names=names)
    assert command[1] == 0.0
    assert (command[0] > 0.05) == (names == JOINTS)
    assert words in said(driver, words)


@pytest.mark.parametrize(('factor', 'words'), [
    (math.degrees(1.0), 'elbow: velocity is 57.3 times the rate of position: velocity is in deg/s'),
    (-1.0, 'wrong sign'), (0.0, 'not measured')])
def test_a_velocity_that_contradicts_the_position_is_told_by_its_unit(driver, factor, words):
    base = time.time_ns()
    for k in range(80):
        t = 0.01 * k
        command = driver.ask([0.5 * t, 0.5 * t], [0.5 * factor, 0.5], base + round(t * 1e9))
    assert command[0] == 0.0
    assert command[1] > 0.01, 'the other joint goes on'
    assert words in said(driver, words)


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


def test_a_joint_named_twice_in_a_direction_has_none(driver):
    stamped = driver.probe.talk(JointState, 'direction_stamped', RELIABLE)
    driver.probe.matched(stamped)
    message = JointState(name=['elbow', 'shoulder', 'elbow', 'wrist', 'wrist'],
                         velocity=array('d', [1.0, 1.0, -1.0, 1.0, -1.0]))
    # What is sent before both ends have discovered each other is lost.
    driver.probe.status_of('compensator', lambda s: (
        stamped.publish(message) or 'named twice' in s.message))
    assert np.abs(driver.ask(ZERO, ZERO)).max() < 0.01
    message = JointState(name=['wrist', 'elbow', 'shoulder', 'hand'],
                         velocity=array('d', [math.nan, 1.0, -1.0, math.inf]))
    stamped.publish(message)
    driver.probe.until(lambda: driver.ask(ZERO, ZERO)[1] < -0.05, 'the direction')
    assert driver.ask(ZERO, ZERO)[0] > 0.05
    driver.probe.destroy_publisher(stamped)
