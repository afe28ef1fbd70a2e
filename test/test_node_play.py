# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories over DDS: played by the node identification, or by a robot's own controller."""

import subprocess
import sys
import threading

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
pytest.importorskip('friction_comp_interfaces', reason='the action type is not built')

from action_msgs.msg import GoalStatus
from friction_comp_interfaces.action import PlayTrajectory
from node_process import Process
from rclpy.action import ActionClient
from ros_system import joint_state, MODELS, probe_node, RELIABLE
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from friction_comp.__main__ import run
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.plan import JointPlan, Move, trajectory_of
from friction_comp.nodes.tool_client import message_of, ToolClient

JOINT = 'elbow'
LIMITS = JointLimits(JOINT, -0.5, 0.6, 1.0, 5.0)
pytestmark = [pytest.mark.slow, pytest.mark.processes]


def motion():
    """Return four seconds of motion within the limits."""
    there = Move.within(0.2, 0.0, 0.5, 0.8, 4.0)
    back = Move.within(1.2, 0.5, -0.4, 0.6, 4.0)
    home = Move.within(3.1, -0.4, 0.0, 0.8, 4.0)
    return trajectory_of([JointPlan(LIMITS, 0.0, (there, back, home), 4.0, {})], 50.0)


@pytest.fixture(scope='module')
def room(tmp_path_factory):
    return tmp_path_factory.mktemp('play')


@pytest.fixture(scope='module')
def system(room):
    """A plant in lockstep and the node identification."""
    with probe_node() as probe, Process(room, 'plant', {
            'joints': [JOINT, 'wrist'], 'model_files': MODELS[:2], 'clock': 'lockstep',
            'seed': 4, 'wrench_period': 0.016, 'sample_time': 4e-3}), Process(
                room, 'identification', {
                    'joints': [JOINT, 'wrist'], 'model_files': MODELS[:2], 'use_sim_time': True,
                    'output_folder': str(room / 'models'), 'input_reliability': 'reliable',
                    'joint_state_timeout': 10.0}):
        probe.commands = probe.listen(Float64MultiArray, 'current_command')
        probe.states = probe.listen(JointState, 'joint_states')
        # Without it the beginning of the motion may be missed.
        probe.until(lambda: probe.states, 'joint states')
        yield probe


def tool_beside(probe, arguments):
    """Run a tool while the probe goes on listening; return its exit code and what it said."""
    process = subprocess.Popen([sys.executable, '-m', 'friction_comp', *arguments],
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while process.poll() is None:
        probe.spin_for(0.05)
    return process.returncode, process.stdout.read()


def test_the_tool_moves_the_joint_along_the_trajectory(system, room):
    path = room / 'trajectory.yaml'
    path.write_text(motion().to_yaml('for a test'), encoding='utf-8')
    code, words = tool_beside(system, ['play', str(path)])
    assert code == 0, words
    position = np.array([message.position[0] for message in system.states])
    assert LIMITS.lowest < position.min() < -0.35
    assert 0.45 < position.max() < LIMITS.highest
    assert position[-1] == pytest.approx(0.0, abs=0.02)
    system.until(lambda: not any(system.commands[-1].data), 'zero current')
    commands = np.array([message.data for message in system.commands])
    assert np.abs(commands[:, 0]).max() > 0.1
    assert not commands[:, 1].any(), 'the other joint is left alone'


def test_a_cancelled_trajectory_leaves_zero_current(system):
    client = ActionClient(system, PlayTrajectory, 'play_trajectory')
    system.until(client.server_is_ready, 'the action server')
    feedback = []
    handle = None
    while handle is None or not handle.accepted:
        # The server must have found the joint first.
        handle = system.complete(client.send_goal_async(
            PlayTrajectory.Goal(trajectory=message_of(motion())),
            lambda message: feedback.append(message.feedback)), 'answer to the goal')
        system.spin_for(0.1)
    system.until(lambda: any(one.phase == 'trajectory' for one in feedback), 'movement')
    system.complete(handle.cancel_goal_async(), 'answer to the cancellation')
    outcome = system.answered(handle.get_result_async, 'the result', 20.0, 60.0)
    assert outcome.status == GoalStatus.STATUS_CANCELED
    assert not outcome.result.success
    system.until(lambda: not system.subscribers['current_command'].get_publisher_count(), 'the end')
    count = -1
    while count != len(system.commands):
        count = len(system.commands)
        system.spin_for(0.3)
    assert list(system.commands[-1].data) == [0.0, 0.0]
    client.destroy()


@pytest.mark.parametrize('wrong, words', [
    (lambda one: one.joint_names.append('wrist'), 'one joint'),
    (lambda one: setattr(one, 'joint_names', ['knee']), 'knee'),
    (lambda one: setattr(one.points[3], 'velocities', []), 'lacks position or velocity'),
    (lambda one: one.points[2].positions.__setitem__(0, float('nan')), 'not finite')])
def test_a_trajectory_that_cannot_be_played_is_refused(system, wrong, words):
    message = message_of(motion())
    wrong(message)
    client = ActionClient(system, PlayTrajectory, 'play_trajectory')
    system.until(client.server_is_ready, 'the action server')
    handle = system.answered(lambda: client.send_goal_async(
        PlayTrajectory.Goal(trajectory=message)), 'answer to the goal')
    assert not handle.accepted
    system.status_of('identification', lambda status: any(
        item.key == 'last refusal' and words in item.value for item in status.values))
    client.destroy()


def test_without_the_type_of_trajectory_controllers_the_tool_says_what_to_install(
        room, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'control_msgs', None)
    path = room / 'trajectory.yaml'
    path.write_text(motion().to_yaml(''), encoding='utf-8')
    assert run('play', [str(path), '--controller', 'arm_controller']) == 2
    assert 'install ros-jazzy-control-msgs' in capsys.readouterr().err


def test_a_robots_controller_gets_all_joints_and_time_to_reach_the_first_point():
    action = pytest.importorskip('control_msgs.action', reason='control_msgs is not installed')
    from rclpy.action import ActionServer, GoalResponse

    received, shares = [], []

    def execute(handle):
        received.append(handle.request.trajectory)
        feedback = action.FollowJointTrajectory.Feedback()
        feedback.desired.time_from_start = handle.request.trajectory.points[-1].time_from_start
        handle.publish_feedback(feedback)
        handle.succeed()
        return action.FollowJointTrajectory.Result()

    def judge(request):
        known = request.trajectory.joint_names == [JOINT]
        return GoalResponse.ACCEPT if known else GoalResponse.REJECT
    with probe_node() as robot:
        states = robot.talk(JointState, 'joint_states', RELIABLE)
        server = ActionServer(robot, action.FollowJointTrajectory,
                              'arm_controller/follow_joint_trajectory', execute,
                              goal_callback=judge)
        ended = []

        def play():
            with ToolClient(patience=30.0) as ros:
                ros.play_on('arm_controller', motion(), lambda share, _: shares.append(share))
            ended.append(True)
        thread = threading.Thread(target=play)
        thread.start()
        while thread.is_alive():
            states.publish(joint_state(1, [JOINT], [-0.4]))
            robot.spin_for(0.02)
        server.destroy()
    assert ended
    assert shares == [pytest.approx(1.0)]
    first, last = received[0].points[0], received[0].points[-1]
    # From -0.4 to 0 rad at a third of 0.8 rad/s.
    assert first.time_from_start.sec + 1e-9 * first.time_from_start.nanosec > 2.0
    assert last.positions[0] == pytest.approx(0.0, abs=1e-6)
