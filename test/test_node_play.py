# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Trajectories over DDS, their ends, and robots that take a torque instead of a current."""

from dataclasses import replace
import signal
from types import SimpleNamespace

from friction_comp_interfaces.action import PlayTrajectory
from node_process import Process, ROOT, ros_arguments
import numpy as np
import pytest
import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from ros_system import compensator, MODELS, own_domain, probe_node, value_of, ZERO
import yaml

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.excitation.plan import JointLimits, JointPlan, Move, trajectory_of
from friction_comp.messages import TORQUE_UNIT
from friction_comp.model.friction_model import FrictionModel
from friction_comp.nodes.compensator import CompensatorNode
from friction_comp.nodes.identification import trajectory_goal
from friction_comp.recordings.reader import read_recording
from friction_comp.ros import tool_client
from friction_comp.ros.joint_io import command_unit
from friction_comp.ros.node_main import yield_to_executor
from friction_comp.ros.tool_client import message_of

JOINT = 'shoulder_pan_joint'
LIMITS = JointLimits(JOINT, -0.6, 0.6, 1.0, 5.0)
DRIVE = FrictionModel.load(MODELS[0]).drive


ARMS = {file.stem: file
        for file in sorted((ROOT / 'examples' / 'torque_controlled').glob('*.yaml'))}


def of_the_arm(file, tmp_path, drive, node):
    """Write models of the joints of an arm's file.

    Return the joints, and parameters and arguments for a node with the file.
    """
    document = yaml.safe_load(file.read_text(encoding='utf-8'))
    joints = document['/**/compensator']['ros__parameters']['joints']
    model = replace(FrictionModel.load(MODELS[0]), drive=drive)
    files = [str(tmp_path / f'{joint}.yaml') for joint in joints]
    for joint, path in zip(joints, files):
        replace(model, joint=joint).save(path)
    # On a busy machine no state may be late, nor lost: each has one answer.
    return joints, {f'{node}:model_files': files, f'{node}:joint_state_timeout': 10.0,
                    f'{node}:input_reliability': 'reliable'}, [
                        '--ros-args', '--params-file', str(file)]


def motion():
    """Return four seconds of motion within the limits."""
    there = Move.within(0.2, 0.0, 0.5, 0.8, 4.0)
    back = Move.within(1.2, 0.5, -0.4, 0.6, 4.0)
    home = Move.within(3.1, -0.4, 0.0, 0.8, 4.0)
    return trajectory_of([JointPlan(LIMITS, (there, back, home), 4.0, {})], 50.0)


def test_the_tool_moves_a_joint_along_the_trajectory_by_torque(tmp_path):
    """On a plant that takes torques, as the controller of an arm does whose file the node reads.

    What `effort` holds and what is commanded agree, or the first ramp would end the goal. The
    recording has currents.
    """
    joints, parameters, arguments = of_the_arm(ARMS['ur_like'], tmp_path, DRIVE, 'identification')
    file, recorded = tmp_path / 'trajectory.yaml', tmp_path / 'recorded'
    file.write_text(motion().to_yaml('for a test'), encoding='utf-8')
    with probe_node() as probe, Process(tmp_path / 'run', 'plant', {
            'joints': joints, 'model_files': parameters['identification:model_files'],
            'command_interface': 'effort', 'clock': 'lockstep', 'seed': 4, 'sample_time': 8e-3,
            'wrench_period': 0.032, 'wait_for_listeners': 2}), Process(
                tmp_path / 'run', 'identification', {
                    **parameters, 'identification:use_sim_time': True,
                    'identification:output_folder': str(tmp_path)},
                arguments=arguments) as server, Process(
                        tmp_path / 'run', 'recorder', {
                            'output': str(recorded), 'use_sim_time': True,
                            'input_reliability': 'reliable'}):
        probe.status_of('recorder', lambda one: int(
            value_of(one, 'publishers of joint_states') or 0) > 0)
        assert run('play', [str(file)]) == 0
        assert 'rejected' not in server.text, 'no goal but the one that was asked for'
        assert 'incompatible' not in server.text
    samples, = read_recording(recorded, JOINT, DRIVE.torque_constant, DRIVE.gear_ratio)
    assert -0.5 < samples.position.min() < -0.35
    assert 0.45 < samples.position.max() < LIMITS.highest
    assert samples.position[-1] == pytest.approx(0.0, abs=0.02)
    # Both in A, whatever the topic held.
    moving = np.abs(samples.command) > 0.02
    assert np.corrcoef(samples.command[moving], samples.current[moving])[0, 1] > 0.9
    assert np.std(samples.command[moving]) == pytest.approx(
        np.std(samples.current[moving]), rel=0.2)
    other, = read_recording(recorded, 'elbow_joint', DRIVE.torque_constant, DRIVE.gear_ratio)
    assert not np.nan_to_num(other.command).any(), 'the other joint is left alone'


@pytest.mark.parametrize('wrong, words', [
    (lambda one: one.joint_names.append('wrist'), 'one joint'),
    (lambda one: setattr(one, 'joint_names', ['knee']), 'knee'),
    (lambda one: setattr(one.points[3], 'velocities', []), 'lacks position or velocity'),
    (lambda one: one.points[2].positions.__setitem__(0, float('nan')), 'not finite')])
def test_a_trajectory_that_cannot_be_played_is_refused(wrong, words):
    message = message_of(motion())
    wrong(message)
    with pytest.raises(InputError, match=words):
        trajectory_goal(PlayTrajectory.Goal(trajectory=message), [JOINT, 'wrist'],
                        {'ramp_slope': 0.06, 'ramp_period': 10.0})


def test_a_result_is_not_waited_for_when_its_node_is_gone(monkeypatch, capsys):
    clock = [0.0]

    def pass_time(timeout_sec):
        clock[0] += timeout_sec
    monkeypatch.setattr(tool_client, 'time', SimpleNamespace(monotonic=lambda: clock[0]))
    client = tool_client.ToolClient()
    client._executor = SimpleNamespace(spin_once=pass_time)
    # Discovery loses it for a moment, and then it is killed.
    accepted = Future()
    accepted.set_result(SimpleNamespace(accepted=True, get_result_async=Future))
    action = SimpleNamespace(
        server_is_ready=lambda: clock[0] < 99.0 and not 9.0 < clock[0] < 9.5,
        send_goal_async=lambda *_: accepted)
    cancel = SimpleNamespace(call_async=lambda _: Future())
    with pytest.raises(InputError, match='identification has ended'):
        client._follow(action, cancel, None, None, 'identification')
    assert 100.0 < clock[0] < 103.0
    assert 'did not acknowledge' in capsys.readouterr().err


def test_torques_are_the_currents_of_the_law_times_the_torque_constants(tmp_path):
    models = [FrictionModel.load(model) for model in MODELS[:2]]
    wanted = [0.9 * model.drive.torque_per_current * level for model, level in zip(
        models, (models[0].breakaway.positive_mean, models[1].breakaway.negative_mean))]
    with compensator(tmp_path, [1, -1], command_interface='effort') as driver:
        driver.announce([1, -1])
        assert driver.ask(ZERO, ZERO) == pytest.approx(wanted, rel=1e-3)
        assert {command_unit(message) for message in driver.commands} == {TORQUE_UNIT}


@pytest.mark.parametrize('name', ARMS)
def test_a_compensator_has_the_parameters_of_an_arm(name, tmp_path):
    """The files of docs/torque_controlled_robots.md are files that ROS 2 can read."""
    _, parameters, arguments = of_the_arm(
        ARMS[name], tmp_path, Drive(1.0, 1.0, current_limit=40.0), 'compensator')
    with own_domain():
        rclpy.init(args=['x', *arguments, *ros_arguments(parameters)],
                   signal_handler_options=SignalHandlerOptions.NO)
        try:
            node = CompensatorNode()
            assert node.get_parameter('gravity').value == 'left_to_robot'
            assert node.get_parameter('command_interface').value == 'effort'
            assert node.get_parameter('breakaway_gain').value == 0.5
            node.leave()
            node.destroy_node()
        finally:
            rclpy.shutdown()


@pytest.fixture(scope='module')
def moving(tmp_path_factory):
    """A server of `play_trajectory` whose motion ends when it is cancelled, in another process."""
    events = []

    async def execute(goal):
        events.append('moves')
        while not goal.is_cancel_requested:
            await yield_to_executor()
        events.append('cancelled')
        goal.canceled()
        return PlayTrajectory.Result()
    with own_domain(), probe_node() as robot:
        server = ActionServer(
            robot, PlayTrajectory, 'play_trajectory', execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=ReentrantCallbackGroup())
        folder = tmp_path_factory.mktemp('play')
        plan = folder / 'plan.yaml'
        plan.write_text(motion().to_yaml(''), encoding='utf-8')
        yield robot, events, folder, plan
        server.destroy()


@pytest.mark.parametrize('number', [
    signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP])
def test_a_motion_ends_with_its_player_whatever_signal_ends_it(moving, number):
    robot, events, folder, plan = moving
    events.clear()
    with Process(folder, 'play', arguments=[str(plan)]) as player:
        robot.until(lambda: 'moves' in events, 'a motion')
        player.send(number)
        robot.until(lambda: not player.running, 'the end of the player')
        assert player.wait() == 128 + number
        robot.until(lambda: events == ['moves', 'cancelled'], 'the end of the motion')
