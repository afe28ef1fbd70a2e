# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plant and exercise over DDS, one at a time."""

from array import array
from contextlib import contextmanager
from dataclasses import replace
import itertools
import time

from geometry_msgs.msg import WrenchStamped
from node_process import PATIENCE, Process
import numpy as np
import pytest
from ros_system import joint_state, MODELS, probe_node, RELIABLE, tick, value_of
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Float64MultiArray, Int8MultiArray, MultiArrayDimension

from friction_comp.exercise.exercise_script import load_exercise
from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.model.friction_model import FrictionModel
from friction_comp.package_files import package_file
from friction_comp.simulation.joint import Plant
from friction_comp.stamps import nanoseconds
from friction_comp.topics import TORQUE_UNIT

JOINTS = ['elbow', 'shoulder']


class Commander:
    """Answers a plant's states by hand."""

    def __init__(self, probe):
        self.probe = probe
        self.states = probe.listen(JointState, 'joint_states')
        self.wrenches = probe.listen(WrenchStamped, 'interaction_wrench')
        self.heat = probe.listen(Temperature, 'motor_temperature')
        self.ticks = probe.listen(Clock, '/clock')
        self.port = probe.talk(Float64MultiArray, 'current_command')

    def find(self):
        self.probe.matched(self.port)
        self.probe.until(lambda: self.states, 'a first state')

    def stamps(self):
        return sorted({nanoseconds(m.header.stamp) for m in self.states})

    def command(self, *values, labels=()):
        message = Float64MultiArray(data=array('d', values))
        message.layout.dim = [MultiArrayDimension(label=str(label), size=1, stride=1)
                              for label in labels]
        self.port.publish(message)

    def step(self, *values, unit=()):
        """Answer the last state and return the next one.

        The answer is repeated now and then, which the plant passes over: the first one is lost if
        both ends have not discovered each other yet.
        """
        last, looks = nanoseconds(self.states[-1].header.stamp), itertools.count()

        def answered():
            if next(looks) % 20 == 0:
                self.command(*values, labels=[last, *unit])
            return nanoseconds(self.states[-1].header.stamp) > last
        self.probe.until(answered, 'the next state')
        return self.states[-1]


@contextmanager
def plant(folder, **parameters):
    """Start a plant, by default of one joint in lockstep, and yield its commander."""
    with probe_node() as probe, Process(folder, 'plant', {
            'joints': ['elbow'], 'model_files': MODELS[:1], 'clock': 'lockstep', **parameters}):
        yield Commander(probe)


def test_lockstep_steps_once_for_each_command_as_the_plain_joint_does(tmp_path):
    models = [FrictionModel.load(path) for path in MODELS[:2]]
    models[1] = replace(models[1], simulation={
        **models[1].simulation, 'gear': 'lugre', 'delay_samples': 1})
    models[1].save(tmp_path / 'geared.yaml')
    twin = Plant(models, seed=5)
    with plant(tmp_path / 'room', joints=JOINTS, seed=5, model_files=[
            MODELS[0], str(tmp_path / 'geared.yaml')]) as commander:
        commander.find()
        commander.probe.spin_for(0.5)
        assert len(commander.stamps()) == 1
        torque = [m.drive.torque_per_current for m in models]
        for k in range(30):
            command = [0.02 * k, -0.01 * k]
            # Commands that are not finite, lack a joint or are torques are ignored.
            wrong = {7: [np.nan, 0.1], 9: [0.1], 11: command}
            unit = TORQUE_UNIT if k == 11 else 'A'
            state = commander.step(*wrong.get(k, command), unit=[unit])
            wanted = twin.step([0.0, 0.0] if k in wrong else command)
            assert list(state.name) == JOINTS
            np.testing.assert_allclose(state.position, wanted.position, rtol=0, atol=1e-12)
            np.testing.assert_allclose(state.velocity, wanted.velocity, rtol=0, atol=1e-12)
            np.testing.assert_allclose(state.effort, wanted.current * torque, rtol=0, atol=1e-12)
        assert np.abs(state.position[0]) > 0
        assert np.diff(commander.stamps()).tolist() == [1_000_000] * 30
        ticks = sorted({nanoseconds(m.clock) for m in commander.ticks})
        assert np.diff(ticks).tolist() == [10_000_000] * (len(ticks) - 1)
        assert len(ticks) >= 3
        assert {m.header.frame_id for m in commander.wrenches} == set(JOINTS)
        assert {m.header.frame_id for m in commander.heat} <= set(JOINTS)
        status = commander.probe.status_of('plant', lambda s: s.level == b'\x01')
        assert value_of(status, 'commands not usable') == '3'


def test_a_plant_waits_for_its_listeners_and_the_reference_of_a_tick(tmp_path):
    with probe_node() as late, plant(
            tmp_path, wait_for_reference=True, wait_for_listeners=2) as commander:
        probe = commander.probe
        references = probe.talk(JointState, 'reference')
        for publisher in (commander.port, references):
            probe.matched(publisher)
        probe.status_of('plant', lambda status: '1 of 2' in value_of(status, 'waits for'))
        states = late.listen(JointState, 'joint_states')
        probe.until(lambda: commander.ticks, 'a tick')
        tick = commander.ticks[-1].clock
        begin = nanoseconds(tick)
        references.publish(joint_state(begin - 10_000_000, ['elbow'], [0.5]))
        late.spin_for(0.3)
        assert not states
        assert not commander.states
        probe.until(lambda: commander.states or references.publish(
            joint_state(begin, ['elbow'], [0.5])), 'the first state')
        late.until(lambda: states, 'the first state')
        assert states[0].header.stamp == commander.states[0].header.stamp
        for _ in range(9):
            commander.step(0.0)
        # Another state's answer is passed over.
        commander.command(0.03, labels=[begin])
        commander.command(0.0)
        probe.until(lambda: commander.ticks[-1].clock != tick, 'the next tick')
        # The person leans on the joint, half a radian behind the reference.
        assert commander.wrenches[-1].wrench.torque.z > 0.01
        assert probe.set_parameter('plant', 'wait_for_reference', False) is None
        for _ in range(3):
            commander.step(0.0)


def test_real_time_runs_by_itself_and_forgets_old_commands(tmp_path):
    with plant(tmp_path, clock='real_time') as commander:
        commander.find()

        def pushed():
            commander.command(0.06)
            commander.probe.spin_for(0.005)
            return max(m.effort[0] for m in commander.states[-5:]) > 0.04 * 11.9
        commander.probe.until(pushed, 'the current')
        commander.probe.until(
            lambda: max(abs(m.effort[0]) for m in commander.states[-20:]) < 0.02 * 11.9,
            'zero current after silence')
        newest = nanoseconds(commander.states[-1].header.stamp)
        assert abs(1e-9 * newest - time.time()) < PATIENCE
        # A thousand a second on a machine that keeps up.
        period = np.median(np.diff(commander.stamps()))
        assert period == pytest.approx(1e6, rel=1e-3)


class Ticks:
    """Gives an exercise of `JOINTS` its time by hand, and hears what it makes of it."""

    begin = 10**9

    def __init__(self, probe):
        self.probe = probe
        self.clock = probe.talk(Clock, '/clock')
        self.states = probe.talk(JointState, 'joint_states')
        self.references = probe.listen(JointState, 'reference')
        self.directions = probe.listen(Int8MultiArray, 'direction')
        probe.matched(self.clock)
        probe.matched(self.states)
        # Of both topics: the first direction is sent once, to those who are known by then.
        probe.until(lambda: probe.count_publishers('reference')
                    and probe.count_publishers('direction'), 'publishers')
        probe.spin_for(0.2)
        # Before the first joint state, no person holds the joints.
        probe.until(lambda: self.tick(self.begin) or probe.spin_for(0.1) or self.references,
                    'a reference')

    def tick(self, stamp):
        self.clock.publish(tick(stamp))

    def find_joints(self):
        """Tell where the joints are: the elbow at 2 rad, the shoulder at 1 rad."""
        self.states.publish(joint_state(self.begin, ['shoulder', 'elbow'], [1.0, 2.0]))

    def reference(self, stamp):
        """Tick and return the reference of that tick; one before it may have come late."""
        self.tick(stamp)
        self.probe.until(
            lambda: self.references and nanoseconds(self.references[-1].header.stamp) == stamp,
            'the reference of the tick')
        return self.references[-1]

    def announced(self, count):
        """Return the first directions, when there are so many."""
        self.probe.until(lambda: len(self.directions) >= count, 'all directions')
        return [tuple(message.data) for message in self.directions[:count]]


MOVEMENT = {'amplitude': 0.2, 'speed': 0.4, 'acceleration_time': 0.1, 'standstill': 0.3,
            'announcement': 0.1, 'repetitions': 1}
EXAMPLE = package_file('config', 'exercises', 'two_joints.yaml')


@pytest.mark.parametrize(('parameters', 'source', 'step', 'announced'), [
    (MOVEMENT, ReferenceMovement(**MOVEMENT), 10_000_000, {(1, 1), (-1, -1)}),
    # The elbow turns round, the shoulder goes on.
    ({'exercise_file': str(EXAMPLE)}, load_exercise(EXAMPLE).of(JOINTS), 50_000_000,
     {(1, 1), (-1, 1)})], ids=['movement', 'script'])
def test_an_exercise_follows_the_ticks_and_announces_each_joint(
        parameters, source, step, announced, tmp_path):
    with probe_node() as probe, Process(tmp_path, 'exercise', {
            'joints': JOINTS, 'clock': 'ticks', 'when_done': 'exit',
            'input_reliability': 'reliable', **parameters}) as process:
        ticks = Ticks(probe)
        assert not ticks.references[-1].name
        # Nor does it begin at a later tick before it knows where they are.
        ticks.references.clear()
        ticks.tick(ticks.begin + 5_000_000)
        probe.spin_for(0.3)
        assert all(nanoseconds(m.header.stamp) == ticks.begin for m in ticks.references)
        ticks.find_joints()
        # After the last of these the node ends, and answers no more.
        wanted, times = [], step * np.arange(round(1e9 * source.duration / step) + 1) / 1e9
        for time_ in times:
            got = ticks.reference(ticks.begin + step + round(1e9 * time_))
            position, velocity, direction = (np.broadcast_to(v, 2) for v in source.at(time_))
            assert list(got.name) == JOINTS
            np.testing.assert_allclose(got.position, [2.0, 1.0] + position, atol=1e-12)
            np.testing.assert_allclose(got.velocity, velocity, atol=1e-12)
            wanted.append(tuple(direction))
        # None at the first tick, before it knows where the joints are.
        assert ticks.announced(1 + len(times)) == [(0, 0), *wanted]
        assert announced <= set(wanted)
        assert process.wait() == 0


def test_an_exercise_by_its_timer_takes_the_joints_of_any_driver(tmp_path):
    """It names the joint it waits for, and keeps the direction to itself if it is told to."""
    with probe_node() as probe, Process(tmp_path, 'exercise', {
            'joints': JOINTS, 'announce_direction': False, 'amplitude': 0.05, 'speed': 0.5,
            'acceleration_time': 0.05, 'standstill': 0.5, 'announcement': 0.1, 'repetitions': 1}):
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
            m.position and m.position[0] > 0.34 for m in references), 'the movement')
        status = probe.status_of('exercise', lambda s: s.message == 'done')
        assert value_of(status, 'elbow: reference [rad]') == '0.3'
        assert {tuple(m.data) for m in directions} == {(0, 0)}
