# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plant and exercise over DDS, one at a time."""

from array import array
from contextlib import contextmanager
import itertools
import time

from node_process import Process
import numpy as np
import pytest
from ros_system import joint_state, MODELS, probe_node, RELIABLE, value_of
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Int8MultiArray, MultiArrayDimension

from friction_comp.messages import nanoseconds, TORQUE_UNIT
from friction_comp.model.friction_model import FrictionModel
from friction_comp.simulation.joint import Plant

JOINTS = ['elbow', 'shoulder']


class Commander:
    """Answers a plant's states by hand."""

    def __init__(self, probe):
        self.probe = probe
        self.states = probe.listen(JointState, 'joint_states')
        self.port = probe.talk(Float64MultiArray, 'current_command')
        probe.matched(self.port)
        probe.until(lambda: self.states, 'a first state')

    def command(self, *values, labels=()):
        message = Float64MultiArray(data=array('d', values))
        message.layout.dim = [MultiArrayDimension(label=str(label), size=1, stride=1)
                              for label in labels]
        self.port.publish(message)

    def step(self, *values, unit='A'):
        """Answer the last state and return the next one.

        The answer is repeated now and then, which the plant passes over: the first one is lost if
        both ends have not discovered each other yet.
        """
        last, looks = nanoseconds(self.states[-1].header.stamp), itertools.count()

        def answered():
            if next(looks) % 20 == 0:
                self.command(*values, labels=[last, unit])
            return nanoseconds(self.states[-1].header.stamp) > last
        self.probe.until(answered, 'the next state')
        return self.states[-1]


@contextmanager
def plant(folder, **parameters):
    with probe_node() as probe, Process(folder, 'plant', {
            'joints': JOINTS, 'model_files': MODELS[:2], 'seed': 5, **parameters}):
        yield Commander(probe)


def test_lockstep_takes_each_command_once_and_unusable_ones_as_zero(tmp_path):
    models = [FrictionModel.load(path) for path in MODELS[:2]]
    twin, torque = Plant(models, seed=5), [model.drive.torque_per_current for model in models]
    with plant(tmp_path, clock='lockstep') as commander:
        stamps = [nanoseconds(commander.states[-1].header.stamp)]
        for k in range(12):
            command = [0.02 * k, -0.01 * k]
            wrong = {7: [np.nan, 0.1], 9: [0.1], 11: command}
            state = commander.step(*wrong.get(k, command), unit=TORQUE_UNIT if k == 11 else 'A')
            wanted = twin.step([0.0, 0.0] if k in wrong else command)
            np.testing.assert_allclose(state.position, wanted.position, rtol=0, atol=1e-12)
            np.testing.assert_allclose(state.effort, wanted.current * torque, rtol=0, atol=1e-12)
            stamps.append(nanoseconds(state.header.stamp))
        assert np.diff(stamps).tolist() == [1_000_000] * 12
        status = commander.probe.status_of('plant', lambda s: s.level == b'\x01')
        assert value_of(status, 'commands not usable') == '3'


def test_real_time_runs_by_itself_and_forgets_old_commands(tmp_path):
    with plant(tmp_path) as commander:
        def pushed():
            commander.command(0.06, 0.0)
            commander.probe.spin_for(0.005)
            return max(m.effort[0] for m in commander.states[-5:]) > 0.04 * 11.9
        commander.probe.until(pushed, 'the current')
        commander.probe.until(
            lambda: max(abs(m.effort[0]) for m in commander.states[-20:]) < 0.02 * 11.9,
            'zero current after silence')
        stamps = sorted({nanoseconds(m.header.stamp) for m in commander.states})
        # A thousand a second on a machine that keeps up.
        assert np.median(np.diff(stamps)) == pytest.approx(1e6, rel=1e-3)


def test_an_exercise_by_its_timer_takes_joints_of_any_driver_and_its_announcement_back(tmp_path):
    with probe_node() as probe, Process(tmp_path, 'exercise', {
            'joints': JOINTS, 'amplitude': -0.05, 'speed': 0.5, 'acceleration_time': 0.05,
            'standstill': 0.5, 'announcement': 0.4}) as process:
        states = probe.talk(JointState, 'joint_states', RELIABLE)
        references = probe.listen(JointState, 'reference')
        directions = probe.listen(Int8MultiArray, 'direction')

        def tell(*joints):
            for joint in joints:
                states.publish(joint_state(time.time_ns(), [joint], [0.3]))
            probe.spin_for(0.02)
        status = probe.status_of('exercise', lambda s: tell('elbow') or 'elbow' not in s.message)
        assert status.message == 'waits for a position of shoulder in joint_states'
        probe.until(lambda: tell(*JOINTS) or any(
            m.position and m.position[0] < 0.26 for m in references), 'the movement')
        probe.until(lambda: list(directions[-1].data) == [-1, -1], 'the next announcement')
        process.send()
        assert process.wait() == 0
        probe.until(lambda: list(directions[-1].data) == [0, 0], 'its end')
