# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The node `direction` as a process: what it announces from each source, and what it doubts."""

from contextlib import contextmanager
import math

from builtin_interfaces.msg import Duration
from geometry_msgs.msg import WrenchStamped
from node_process import Process
import numpy as np
import pytest
from ros_system import joint_state, own_domain, probe_node, tick
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from friction_comp.messages import nanoseconds

NANO = 1_000_000_000
STEP = NANO // 100
JOINTS = ['elbow', 'wrist']


class Bench:
    """The node in simulated time, and the joints, whose positions the test sets."""

    def __init__(self, probe, process):
        self.probe, self.process, self.now = probe, process, 10 * NANO
        self.clock = probe.talk(Clock, '/clock')
        self.states = probe.talk(JointState, 'joint_states')
        self.said = probe.listen(JointState, 'direction_stamped')
        for publisher in (self.clock, self.states):
            probe.matched(publisher)
        self.position = dict.fromkeys(JOINTS, 0.0)
        probe.until(self._is_heard, 'the first announcement')

    def _is_heard(self):
        # An announcement before the node has found this listener is lost, and comes once a step.
        self.now += STEP
        self.clock.publish(tick(self.now))
        self.probe.spin_for(0.002)
        return self.said

    def step(self, send=lambda: None):
        """Advance by 10 ms and return what is announced then."""
        self.now += STEP
        self.states.publish(joint_state(self.now, JOINTS, [self.position[j] for j in JOINTS]))
        send()

        def answered():
            self.states.publish(joint_state(self.now, JOINTS, [self.position[j] for j in JOINTS]))
            self.clock.publish(tick(self.now))
            self.probe.spin_for(0.002)
            return self.said and nanoseconds(self.said[-1].header.stamp) >= self.now
        self.probe.until(answered, 'an announcement')
        self.last = self.said[-1]
        self.said.clear()
        return list(self.last.velocity)

    def steps(self, count, send=lambda: None):
        for _ in range(count):
            found = self.step(send)
        return found


@contextmanager
def bench(tmp_path, **parameters):
    with own_domain(), probe_node() as probe, Process(tmp_path, 'direction', {
            'joints': JOINTS, 'use_sim_time': True, 'input_reliability': 'reliable',
            **parameters}) as process:
        yield Bench(probe, process)


def plan(times, positions):
    return JointTrajectory(joint_names=['wrist', 'other'], points=[
        JointTrajectoryPoint(positions=[position, 0.0], time_from_start=Duration(
            sec=int(time), nanosec=round((time % 1.0) * 1e9)))
        for time, position in zip(times, positions)])


def comes(desk, directions, send):
    """Return whether directions are published soon after what is sent, again where it was lost."""
    return any(desk.step(send if k % 5 == 0 else lambda: None) == directions for k in range(100))


def test_a_plan_is_announced_with_its_end_and_replaced_and_dropped_when_not_followed(tmp_path):
    with bench(tmp_path, source='trajectory', tolerance=0.1) as desk:
        plans = desk.probe.talk(JointTrajectory, 'trajectory')
        desk.probe.matched(plans)
        assert desk.steps(3) == [0.0, 0.0]
        assert comes(desk, [0.0, 1.0], lambda: plans.publish(
            plan([0.2, 0.4, 0.8], [0.05, 0.1, 0.0])))
        assert desk.last.position[1] == pytest.approx(0.1)
        assert math.isnan(desk.last.position[0])
        assert comes(desk, [0.0, -1.0], lambda: plans.publish(plan([0.5], [-0.09])))
        assert desk.last.position[1] == pytest.approx(-0.09)
        desk.position['wrist'] = 0.2
        assert desk.steps(2) == [0.0, 0.0]
        status = desk.probe.status_of('direction', lambda s: s.level == b'\x01')
        assert 'wrist: the plan is not followed: 0.2' in status.message
        wrong = plan([0.5, 0.4], [0.0, 0.1])
        desk.probe.status_of('direction', lambda s: (
            desk.step(lambda: plans.publish(wrong)),
            'times of a plan must increase' in s.message)[1])


def test_a_sensor_announces_after_its_calibration_and_not_while_it_is_silent(tmp_path):
    random = np.random.default_rng(3)
    with bench(tmp_path, source='sensor', sensor_range=[0.0, 1023.0], axis='force.x') as desk:
        sensors = desk.probe.talk(Float64MultiArray, 'sensor')
        wrenches = desk.probe.talk(WrenchStamped, 'sensor_wrench')
        for publisher in (sensors, wrenches):
            desk.probe.matched(publisher)
        push = [0.0, 0.0]

        def send():
            values = np.rint(500.0 + np.array(push) + random.normal(size=2))
            sensors.publish(Float64MultiArray(data=values.tolist()))
        assert desk.steps(30, send) == [0.0, 0.0]
        client = desk.probe.create_client(Trigger, '/direction/calibrate')
        desk.probe.until(client.service_is_ready, 'the service')
        future = client.call_async(Trigger.Request())
        while not future.done():
            desk.step(send)
        assert future.result().success, future.result().message

        def grow():
            push[0] += 4.0
            push[1] -= 4.0
            send()
        assert desk.steps(30, send) == [0.0, 0.0]
        # A sample may come after the tick of its step.
        assert any((desk.step(grow), list(desk.last.effort)) == ([1.0, -1.0], [1.0, 1.0])
                   for _ in range(60))
        # By a wrench of one joint; the other falls silent.
        message = WrenchStamped()
        message.header.frame_id = 'elbow'

        def one():
            message.wrench.force.x = float(np.rint(500.0 + push[0] + random.normal()))
            wrenches.publish(message)
        assert any(desk.step(one) == [1.0, 0.0] for _ in range(100))
        status = desk.probe.status_of('direction', lambda s: s.level == b'\x01')
        assert 'wrist: sensor: silent' in status.message
        desk.process.send()
        assert desk.process.wait() == 0
        desk.probe.until(lambda: desk.said and list(desk.said[-1].velocity) == [0.0, 0.0],
                         'the end of all announcements')
