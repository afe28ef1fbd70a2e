# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The identification action over DDS: in lockstep with a simulated joint, and fed by the test."""

import math
import signal
import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
pytest.importorskip('friction_comp_interfaces', reason='the action type is not built')

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from friction_comp_interfaces.action import IdentifyFriction
from node_process import PATIENCE, Process
from rclpy.action import ActionClient
from ros_system import BEST_EFFORT, FakeDriver, joint_state, MODELS, probe_node
from std_msgs.msg import Float64MultiArray

from friction_comp.model.friction_model import FrictionModel

JOINT = 'elbow'
GOAL = {'joint': JOINT, 'speeds': [0.8, 1.4], 'motion_range': 0.8, 'ramp_slope': 0.2,
        'ramp_period': 2.0, 'breakaway_cycles': 2}
pytestmark = pytest.mark.slow


class Client:
    """An action client that waits with patience."""

    def __init__(self, probe):
        self.probe = probe
        self.feedback = []
        self._client = ActionClient(probe, IdentifyFriction, 'identify_friction')
        probe.until(self._client.server_is_ready, 'the action server')
        # A goal for an unknown joint is refused; the answer shows that both ends are connected.
        nobody = IdentifyFriction.Goal(**{**GOAL, 'joint': 'nobody'})
        probe.answered(lambda: self._client.send_goal_async(nobody), 'answer to the first goal')

    def ask(self, **changes):
        """Send a goal once and return its handle."""
        goal = IdentifyFriction.Goal(**{**GOAL, **changes})
        return self.probe.complete(self._client.send_goal_async(
            goal, lambda message: self.feedback.append(message.feedback)), 'answer to the goal')

    def begin(self, **changes):
        """Send a goal until it is accepted: the server must have found the joint first."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            handle = self.ask(**changes)
            if handle.accepted:
                return handle
            self.probe.spin_for(0.2)
        raise AssertionError('the goal was never accepted')

    def result(self, handle, timeout=60.0):
        return self.probe.answered(handle.get_result_async, 'the result', 20.0, timeout)

    def heard_all(self):
        """Wait until nobody commands any more, and the last command has been taken."""
        self.probe.until(
            lambda: not self.probe.subscribers['current_command'].get_publisher_count(), 'the end')
        count = -1
        while count != len(self.commands):
            count = len(self.commands)
            self.probe.spin_for(0.2)

    def close(self):
        self._client.destroy()


@pytest.fixture(scope='module')
def room(tmp_path_factory):
    return tmp_path_factory.mktemp('identification')


class Driver(FakeDriver):
    """A best-effort driver in real time whose joint never moves."""

    def __init__(self, probe):
        super().__init__(probe, [JOINT], BEST_EFFORT)
        self.position = 0.0

    def drive(self, condition, timeout=PATIENCE):
        """Publish states until the condition holds."""
        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, 'not in time'
            self.states.publish(joint_state(time.time_ns(), [JOINT], [self.position]))
            self.probe.spin_for(0.004)


@pytest.mark.parametrize('end', ['silence', 'not finite', 'terminated'])
def test_a_failed_goal_leaves_zero_current_and_no_file(room, end):
    models = room / f'models_{end.split()[0]}'
    with probe_node() as probe, Process(room, 'identification', {
            'joints': [JOINT], 'model_files': MODELS[:1], 'output_folder': str(models),
            # As long as it may be where silence is not what ends the run.
            'joint_state_timeout': 2.0 if end == 'silence' else 10.0}) as process:
        driver, client = Driver(probe), Client(probe)
        assert not client.ask().accepted, 'without joint states nothing can be identified'
        future = []

        def accepted():
            if not future or (future[-1].done() and not future[-1].result().accepted):
                future.append(client._client.send_goal_async(IdentifyFriction.Goal(**GOAL)))
            return future[-1].done() and future[-1].result().accepted
        driver.drive(accepted)
        handle = future[-1].result()
        outcome = handle.get_result_async()
        # A joint that does not move is pushed ever harder.
        driver.drive(lambda: any(abs(m.data[0]) > 0.005 for m in driver.commands[-100:])
                     or outcome.done())
        assert not outcome.done(), outcome.result().result.message
        if end == 'not finite':
            driver.position = float('nan')
            driver.drive(outcome.done)
        elif end == 'terminated':
            process.send(signal.SIGTERM)
            driver.drive(lambda: driver.commands[-1].data[0] == 0.0)
            assert process.wait() == 0
            assert 'Traceback' not in process.text
        if end != 'terminated':
            reply = probe.complete(outcome, 'the result')
            assert reply.status == GoalStatus.STATUS_ABORTED
            assert ('silent' if end == 'silence' else 'finite') in reply.result.message
        probe.until(lambda: driver.commands[-1].data[0] == 0.0, 'zero current')
        assert not models.exists()
        client.close()


@pytest.fixture(scope='module')
def system(room):
    """A plant in lockstep and the server, for all tests that let them live."""
    with probe_node() as probe, Process(room, 'plant', {
            'joints': [JOINT, 'wrist'], 'model_files': MODELS[:2], 'clock': 'lockstep',
            'seed': 4, 'wrench_period': 0.016, 'sample_time': 4e-3}), Process(
                room, 'identification', {
                    'joints': [JOINT, 'wrist'], 'model_files': MODELS[:2], 'use_sim_time': True,
                    'output_folder': str(room / 'models'), 'input_reliability': 'reliable',
                    'joint_state_timeout': 10.0}):
        client = Client(probe)
        client.commands = probe.listen(Float64MultiArray, 'current_command')
        client.models = room / 'models'
        yield client
        client.close()


@pytest.mark.parametrize('changes', [
    {'joint': 'knee'}, {'speeds': [0.1, float('nan')]}, {'speeds': [50.0, 0.1]},
    {'motion_range': -1.0}, {'ramp_slope': float('inf')}, {'ramp_period': -3.0},
    {'ramp_slope': 100.0}])
def test_refuses_goals_that_cannot_be_reached(system, changes):
    assert not system.ask(**changes).accepted
    status = system.probe.status_of(
        'identification',
        lambda s: any(v.key == 'last refusal' and v.value for v in s.values))
    assert status


def test_a_cancelled_goal_leaves_zero_current_and_no_file(system):
    handle = system.begin()
    system.probe.until(lambda: any(f.phase == 'velocity' for f in system.feedback), 'movement')
    second = system.ask()
    assert not second.accepted
    answer = system.probe.complete(handle.cancel_goal_async(), 'answer to the cancellation')
    assert len(answer.goals_canceling) == 1
    outcome = system.result(handle)
    assert outcome.status == GoalStatus.STATUS_CANCELED
    assert not outcome.result.success
    assert 'cancel' in outcome.result.message
    system.heard_all()
    assert list(system.commands[-1].data) == [0.0, 0.0]
    count = len(system.commands)
    system.probe.spin_for(0.5)
    assert len(system.commands) == count
    assert not system.models.exists()


def test_a_goal_that_is_cancelled_before_it_starts_does_not_move_the_joint(system):
    client = system.probe.create_client(CancelGoal, 'identify_friction/_action/cancel_goal')
    system.probe.until(client.service_is_ready, 'the service')
    end, cancelled = time.monotonic() + PATIENCE, []
    while not cancelled:
        assert time.monotonic() < end, 'the requests never arrived together'
        goal = system._client.send_goal_async(IdentifyFriction.Goal(**GOAL))
        # Without an id, it cancels all goals.
        answer = client.call_async(CancelGoal.Request())
        handle = system.probe.complete(goal, 'answer to the goal')
        cancelled = system.probe.complete(answer, 'answer to the cancellation').goals_canceling
        if handle.accepted:
            if not cancelled:
                system.probe.complete(handle.cancel_goal_async(), 'answer to the cancellation')
            assert system.result(handle).status == GoalStatus.STATUS_CANCELED
    system.probe.destroy_client(client)


def test_identifies_a_drive(system):
    system.feedback.clear()
    system.commands.clear()
    handle = system.begin()
    outcome = system.result(handle, 240.0)
    assert outcome.status == GoalStatus.STATUS_SUCCEEDED
    result = outcome.result
    assert result.success
    truth = FrictionModel.load(MODELS[0])
    speeds = sorted([*GOAL['speeds'], *(-v for v in GOAL['speeds'])])
    np.testing.assert_allclose(result.speeds, speeds, rtol=1e-3)
    np.testing.assert_allclose(result.currents, truth.sigmoid(np.array(speeds)), atol=6e-3)
    assert all(0.0 <= value < 0.02 for value in result.standard_deviations)
    # Two ramps a side, whose scatter is 3.4 %.
    assert result.breakaway_positive_mean == pytest.approx(0.0995, rel=0.1)
    assert result.breakaway_negative_mean == pytest.approx(-0.0995, rel=0.1)
    assert result.breakaway_positive_std < 0.01
    model = FrictionModel.load(result.model_file)
    assert model.joint == JOINT
    np.testing.assert_allclose(
        model.sigmoid.coefficients(), result.coefficients, rtol=1e-6, atol=1e-12)
    assert model.drive == truth.drive
    # Feedback comes now and then in real time, while simulated time runs as fast as it may: which
    # samples it shows is left to the machine, but they are in order and of this joint.
    progress, times = ([getattr(f, name) for f in system.feedback] for name in ('progress', 'time'))
    assert progress == sorted(progress)
    assert times == sorted(times)
    assert 0.0 <= progress[0] < progress[-1] <= 1.0
    phases = list(dict.fromkeys(f.phase for f in system.feedback))
    shown = [phase for phase in ('velocity', 'breakaway') if phase in phases]
    assert [phase for phase in phases if phase in shown] == shown
    for f in system.feedback:
        assert abs(f.position) < GOAL['motion_range']
        assert abs(f.velocity) < 2.0 * max(GOAL['speeds'])
        assert math.isfinite(f.current)
    assert any(f.velocity for f in system.feedback)
    # Only the joint of the goal was driven, and it was left at zero current.
    system.heard_all()
    commands = np.array([m.data for m in system.commands])
    assert np.abs(commands[:, 0]).max() > 0.1
    assert np.abs(commands[:, 1]).max() == 0.0
    assert list(system.commands[-1].data) == [0.0, 0.0]
