# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that take a torque at the joint instead of a motor current."""

import time

from node_process import Process, ROOT
import numpy as np
import pytest
from ros_system import compensator, FakeDriver, Goals, joint_state, MODELS, probe_node, tick
from rosgraph_msgs.msg import Clock
import yaml

from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.excitation.plan import JointPlan, Move, trajectory_of
from friction_comp.model.friction_model import FrictionModel
from friction_comp.ros.joint_io import command_unit
from friction_comp.ros.tool_client import message_of
from friction_comp.simulation.joint import Plant
from friction_comp.topics import TORQUE_UNIT

ARMS = sorted((ROOT / 'examples' / 'torque_controlled').glob('*.yaml'))
# For such arms, independently of the files: sample rate, and meaning of `effort`.
SEMANTICS = {'franka_like': (1000, 'torque'), 'ur_like': (500, 'torque')}


def test_torques_are_the_currents_of_the_law_times_the_torque_constants(tmp_path):
    models = [FrictionModel.load(model) for model in MODELS[:2]]
    gains = np.array([model.drive.torque_per_current for model in models])
    law = CompensationLaw(models, 'continuous')
    path = [2e-5 * max(k - 10, 0) ** 2 * np.array([1.0, -0.7]) for k in range(40)]
    # Before the first state, since loading compiled code may take longer than a silence may last.
    wanted = gains * [law.update(1e-3 * k, position, None, np.array([1.0, -1.0])).copy()
                      for k, position in enumerate(path)]
    with compensator(tmp_path, law='continuous', command_interface='effort') as driver:
        driver.begin_anew()
        driver.announce([1, -1])
        base = time.time_ns()
        torques = [driver.ask(position, [], base + round(1e6 * k))
                   for k, position in enumerate(path)]
        np.testing.assert_allclose(torques, wanted, rtol=0.0, atol=1e-9)
        assert {command_unit(message) for message in driver.commands} == {TORQUE_UNIT}
    assert min(np.abs(torques[-1])) > 0.2


class TorqueController(FakeDriver):
    """Stands in for the torque controller of an arm; one of its joints is simulated.

    It takes N·m, shows states at the arm's rate, in `effort` what such an arm shows, and leaves a
    joint that it hears nothing for without torque.
    """

    def __init__(self, probe, file, joints, node, model):
        super().__init__(probe, joints, node=node)
        rate, holds = SEMANTICS[file.stem]
        self.step = 1.0 / rate
        self.gain = model.drive.torque_per_current
        self.effort = self.gain if holds == 'torque' else 1.0
        self.plant = Plant([model], 3, None, self.step)
        # It uses its own clock: on a busy machine a state takes longer than on the arm.
        self.count, self.clock = 0, probe.talk(Clock, '/clock')
        self.in_step = False

    def catch_up(self):
        """Let all answers to earlier states arrive: from then on each state has the next one."""
        heard = -1
        while len(self.commands) > heard:
            heard = len(self.commands)
            self.probe.spin_for(1.0)
        self.in_step = True

    def go_on(self, answered):
        """Show one state, and apply the torque that answers it, if one must."""
        if answered() and not self.in_step:
            self.catch_up()
        rest = [0.0] * (len(self.joints) - 1)
        state, before = self.plant.state, len(self.commands)
        self.count += 1
        stamp = 10**9 + round(1e9 * self.step * self.count)
        self.clock.publish(tick(stamp))
        self.states.publish(joint_state(
            stamp, self.joints, [*state.position, *rest], [*state.velocity, *rest],
            [*(self.effort * state.current), *rest]))
        if answered():
            self.probe.until(lambda: self._answers_from(before) or not answered(), 'a command')
        else:
            self.probe.spin_for(0.002)
        heard = self._answers_from(before)
        torque = heard[-1].data[0] if heard else 0.0
        assert all(command_unit(message) == TORQUE_UNIT for message in heard)
        self.plant.step(np.array([torque / self.gain]), None, None, None)


def of_the_arm(file, tmp_path, drive, node):
    """Check an arm's file and write models of its joints.

    Return the joints, one of the models, and arguments for a node with the file.
    """
    document = yaml.safe_load(file.read_text(encoding='utf-8'))
    parameters = {name.strip('/*'): own['ros__parameters'] for name, own in document.items()}
    controller, rate = parameters['torque_controller'], SEMANTICS[file.stem][0]
    joints = controller['joints']
    assert controller['interface_name'] == 'effort'
    assert parameters['controller_manager']['update_rate'] == rate
    # A few lost packets do not count as a timeout.
    for each in ('compensator', 'identification'):
        assert parameters[each]['joints'] == joints
        assert 10 <= rate * parameters[each]['joint_state_timeout'] <= 50
    model = FrictionModel.load(MODELS[0])
    model.drive = drive or model.drive
    files = [str(tmp_path / f'{joint}.yaml') for joint in joints]
    for model.joint, path in zip(joints, files):
        model.save(path)
    return joints, model, {f'{node}:model_files': files,
                   # On a busy machine no state may be late, nor lost: each has one answer.
                   f'{node}:joint_state_timeout': 10.0, f'{node}:input_reliability': 'reliable',
                   }, ['--ros-args', '--params-file', str(file)]


def test_a_joint_of_an_arm_is_moved_by_its_torque_controller(tmp_path):
    """What `effort` holds and what is commanded agree, or the first ramp would end the goal."""
    from friction_comp_interfaces.action import PlayTrajectory
    from test_node_play import LIMITS

    file = next(file for file in ARMS if file.stem == 'ur_like')
    joints, model, parameters, arguments = of_the_arm(file, tmp_path, None, 'identification')
    with probe_node() as probe, Process(
            tmp_path / 'run', 'identification', {
                **parameters, 'identification:use_sim_time': True}, arguments=arguments):
        arm = TorqueController(probe, file, joints, 'identification', model)
        plan = JointPlan(LIMITS, 0.0, (Move.within(0.05, 0.0, 0.2, 0.8, 4.0),), 0.7, {})
        message = message_of(trajectory_of([plan], 50.0))
        message.joint_names = [arm.joints[0]]
        goals = Goals(probe, PlayTrajectory, 'play_trajectory', {})
        handle = goals.begin(lambda: arm.go_on(lambda: False), trajectory=message, ramp_slope=0.4)
        outcome = handle.get_result_async()
        while not outcome.done():
            arm.go_on(lambda: bool(arm.commands) and arm.commanders and not outcome.done())
        assert outcome.result().result.success, outcome.result().result.message
        assert arm.plant.state.position[0] == pytest.approx(0.2, abs=0.02)
        goals.close()


@pytest.mark.parametrize('file', ARMS, ids=lambda file: file.stem)
def test_a_compensator_runs_with_the_parameters_of_an_arm(file, tmp_path):
    """The files of docs/torque_controlled_robots.md are files that ROS 2 can read."""
    joints, _, parameters, arguments = of_the_arm(
        file, tmp_path, Drive(1.0, 1.0, current_limit=40.0), 'compensator')
    with probe_node() as probe, Process(
            tmp_path / 'run', 'compensator', parameters, arguments=arguments):
        driver = FakeDriver(probe, joints)
        driver.find()
        assert probe.get_parameters_of('compensator', [
            'gravity', 'breakaway_gain', 'command_interface']) == ['left_to_robot', 0.5, 'effort']
        base = time.time_ns()
        for k in range(30):
            torque = driver.ask([4e-4 * k] * len(joints), [], base + round(1e6 * k))
        # Eq. 6 of a drive of one N·m per A: torques with the sign of the motion.
        assert min(torque) > 0.005
        # A controller that hears nothing for its timeout is on its own; zero is sent before.
        driver.rest()
        assert list(driver.commands[-1].data) == [0.0] * len(joints)
