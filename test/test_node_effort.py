# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that take a torque at the joint instead of a motor current."""

from pathlib import Path
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')

from ros_system import (
    FakeDriver,
    JOINTS,
    MODELS,
    probe_node,
    Process,
    refuses,
    RELIABLE,
    START,
    value_of,
)
from std_msgs.msg import Float64MultiArray

from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings import read_recording

ROOT = Path(__file__).resolve().parents[1]
ARMS = sorted((ROOT / 'examples' / 'torque_controlled').glob('*.yaml'))
pytestmark = [pytest.mark.slow, pytest.mark.processes]


def test_torques_are_the_currents_of_the_law_times_the_torque_constants(tmp_path):
    models = [FrictionModel.load(model) for model in MODELS[:2]]
    gains = np.array([model.drive.torque_per_current for model in models])
    law = CompensationLaw(models, 'continuous')
    with probe_node() as probe, Process(tmp_path, 'compensator', {
            **START, 'law': 'continuous', 'command_interface': 'effort'}):
        driver = FakeDriver(probe, JOINTS, topic='effort_command')
        driver.find()
        driver.begin_anew()
        driver.announce([1, -1])
        base = time.time_ns()
        for k in range(40):
            position = 2e-5 * max(k - 10, 0) ** 2 * np.array([1.0, -0.7])
            torque = driver.ask(position, [], base + round(1e6 * k))
            current = law.update(1e-3 * k, position, None, np.array([1.0, -1.0]))
            np.testing.assert_allclose(torque, current * gains, rtol=0.0, atol=1e-9)
    assert min(np.abs(torque)) > 0.2


def test_whoever_commands_torques_is_a_rival_of_whoever_commands_currents(tmp_path):
    with probe_node() as probe, Process(tmp_path, 'compensator', START):
        driver = FakeDriver(probe, JOINTS)
        driver.find(direction=[1, 1])
        other = probe.talk(Float64MultiArray, 'effort_command', RELIABLE)
        probe.until(lambda: (driver.find() or True) and not any(driver.commands[-1].data),
                    'zero current')
        status = probe.status_of('compensator', lambda one: 'command' in one.message)
        assert status
        probe.destroy_publisher(other)


def test_a_joint_is_moved_and_recorded_by_torque(tmp_path):
    """Identification's trajectory on a plant that takes torques, as a robot's controller does."""
    from test_node_play import motion

    common = {'joints': ['elbow'], 'model_files': MODELS[:1], 'command_interface': 'effort'}
    file = tmp_path / 'trajectory.yaml'
    file.write_text(motion().to_yaml('for a test'), encoding='utf-8')
    with probe_node() as probe, Process(tmp_path, 'plant', {
            **common, 'clock': 'lockstep', 'seed': 4, 'sample_time': 4e-3, 'wrench_period': 0.016,
            'wait_for_listeners': 2}), Process(tmp_path, 'identification', {
                **common, 'use_sim_time': True, 'input_reliability': 'reliable',
                'output_folder': str(tmp_path), 'joint_state_timeout': 10.0}), Process(
                    tmp_path, 'recorder', {
                        'output': str(tmp_path / 'recorded'), 'use_sim_time': True,
                        'input_reliability': 'reliable'}):
        probe.status_of('recorder', lambda one: int(
            value_of(one, 'publishers of joint_states') or 0) > 0)
        outcome = subprocess.run([sys.executable, '-m', 'friction_comp', 'play', str(file)],
                                 capture_output=True, text=True)
        assert outcome.returncode == 0, outcome.stderr
    drive = FrictionModel.load(MODELS[0]).drive
    samples, = read_recording(tmp_path / 'recorded', 'elbow', drive.torque_constant,
                              drive.gear_ratio)
    assert samples.position.max() > 0.45
    # Both in A, whatever the topic held.
    moving = np.abs(samples.command) > 0.02
    assert np.corrcoef(samples.command[moving], samples.current[moving])[0, 1] > 0.9
    assert np.std(samples.command[moving]) == pytest.approx(
        np.std(samples.current[moving]), rel=0.2)


def test_an_interface_that_is_not_known_is_refused(tmp_path):
    refuses(tmp_path, 'compensator', {**START, 'command_interface': 'voltage'},
            'command_interface: must be current or effort')


@pytest.mark.parametrize('file', ARMS, ids=lambda file: file.stem)
def test_a_compensator_runs_with_the_parameters_of_an_arm(file, tmp_path):
    """The files of docs/torque_controlled_robots.md, against a stand-in of such a controller."""
    document = yaml.safe_load(file.read_text(encoding='utf-8'))
    parameters = document['/**/compensator']['ros__parameters']
    controller = document['torque_controller']['ros__parameters']
    joints = parameters['joints']
    assert controller['joints'] == joints
    assert controller['interface_name'] == 'effort'
    models = []
    for joint in joints:
        model = FrictionModel.load(MODELS[0])
        model.joint = joint
        model.drive = Drive(1.0, 1.0, current_limit=40.0)
        model.save(tmp_path / f'{joint}.yaml')
        models.append(str(tmp_path / f'{joint}.yaml'))
    with probe_node() as probe, Process(tmp_path, 'compensator', {
            **parameters, 'model_files': models, 'joint_state_timeout': 10.0,
            'input_reliability': 'reliable'}):
        driver = FakeDriver(probe, joints, topic='effort_command')
        driver.find()
        base = time.time_ns()
        for k in range(30):
            torque = driver.ask([4e-4 * k] * len(joints), [], base + round(1e6 * k))
        # Eq. 6 of a drive of one N·m per A: torques with the sign of the motion.
        assert min(torque) > 0.005
        # A controller that hears nothing for its timeout is on its own; zero is sent before.
        driver.rest()
        assert list(driver.commands[-1].data) == [0.0] * len(joints)
