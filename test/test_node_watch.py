# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The live page and the doctor over DDS, and a node that finds no other."""

import itertools
import json
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_process import Process, ROOT
import numpy as np
import pytest
from ros_system import BEST_EFFORT, joint_state, MODELS, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.network import alone, loopback_fault
from friction_comp.ros.live_feed import LiveFeed
from friction_comp.tools import doctor

MODEL = FrictionModel.load(MODELS[0])


@pytest.mark.parametrize('in_ampere', [False, True])
def test_joint_current_and_residual_of_the_last_seconds(in_ampere):
    gain = 1.0 if in_ampere else MODEL.drive.torque_per_current
    with probe_node() as probe:
        publisher = probe.talk(JointState, 'joint_states')
        planner = probe.talk(JointState, 'direction_stamped')
        feed = LiveFeed([], [MODEL], [], in_ampere)
        try:
            probe.matched(publisher)
            probe.matched(planner)
            stamp, times = 10**9, itertools.count(step=0.02)

            def shown():
                """Publish, as a best-effort listener may miss some, until all is shown."""
                for t in itertools.islice(times, 20):
                    velocity = 0.6 * np.cos(2.0 * t)
                    publisher.publish(joint_state(
                        stamp + round(t * 1e9), ['elbow'], [0.3 * np.sin(2.0 * t)], [velocity],
                        [MODEL.sigmoid(velocity) * gain]))
                    planner.publish(joint_state(stamp, ['elbow'], [], [-0.3]))
                    probe.spin_for(0.003)
                data = feed.window('elbow', 0.0, 2.0)
                return t > 4.0 and len(data['time']) > 30 and data['direction'][-1] == -1.0
            probe.until(shown, 'two seconds')
            data = feed.window('elbow', 0.0, 2.0)
            assert 1.5 < data['time'][-1] - data['time'][0] <= 2.0
            assert 0.3 < np.abs(data['velocity']).max() < 0.61
            np.testing.assert_allclose(
                data['current'] * MODEL.drive.torque_per_current, data['torque'])
            assert np.median(np.abs(data['residual'])) < 0.1 * MODEL.sigmoid(0.5)
            # A simulation that is started again begins at the same stamp.
            times = itertools.count(step=0.02)

            def forgotten():
                shown()
                return feed.window('elbow', 0.0, 100.0)['time'].max() < 4.0
            probe.until(forgotten, 'the rows of the new run')
            probe.until(lambda: ('problem', 'joint_states', 'none') in feed.status(), 'silence')
        finally:
            feed.close()
        assert not feed._thread.is_alive()


def test_model_and_current_are_those_of_the_compensator(tmp_path):
    start = {'joints': ['elbow'], 'model_files': MODELS[:1], 'joint_state_timeout': 1.0}
    with probe_node() as probe, Process(tmp_path, 'compensator', start):
        publisher = probe.talk(JointState, 'joint_states')
        feed = LiveFeed([], [], [])
        try:
            probe.matched(publisher)

            begin = time.time_ns()

            def shown():
                stamp = time.time_ns()
                t = 1e-9 * (stamp - begin)
                publisher.publish(joint_state(
                    stamp, ['elbow'], [0.3 * np.sin(2.0 * t)], [0.6 * np.cos(2.0 * t)], [0.0]))
                data = feed.window('elbow', 0.0, 2.0)
                # Kinetic friction is fed forward in the direction of motion.
                return (np.isfinite(data['residual']).any()
                        and (np.abs(data['command']) > 0.02).any())
            probe.until(shown, 'a residual and a command')
        finally:
            feed.close()


def test_commands_are_shown_at_the_joints_of_the_compensator():
    with probe_node() as probe:
        states = probe.talk(JointState, 'joint_states')
        commands = probe.talk(Float64MultiArray, 'current_command')
        status = probe.talk(DiagnosticArray, '/diagnostics')
        feed = LiveFeed([], [], [])
        try:
            for publisher in (states, commands, status):
                probe.matched(publisher)
            times = itertools.count(step=0.02)

            def shown():
                """Publish states in another order than commands; return the last commands."""
                commands.publish(Float64MultiArray(data=[1.0, 2.0]))
                probe.spin_for(0.02)
                states.publish(joint_state(
                    round(1e9 + 1e9 * next(times)), ['elbow', 'shoulder'], [0.0, 0.0]))
                probe.spin_for(0.02)
                return [data['command'][-1] for data in (
                    feed.window(joint, 0.0, 1.0) for joint in ('shoulder', 'elbow'))
                    if len(data['time'])]
            probe.until(lambda: len(shown()) == 2, 'both joints')
            assert np.isnan(shown()).all(), 'nobody knows whose they are'

            def told():
                status.publish(DiagnosticArray(status=[DiagnosticStatus(
                    name='compensator: compensation', hardware_id='shoulder, elbow')]))
                return shown() == [1.0, 2.0]
            probe.until(told, 'each command at its joint')
        finally:
            feed.close()


def test_models_and_joints_must_be_as_many():
    with pytest.raises(InputError, match='one file per joint'):
        LiveFeed(['elbow', 'shoulder'], [MODEL], [])


def test_finds_the_sign_and_who_publishes(tmp_path):
    with own_domain(), probe_node() as probe, Process(
            tmp_path, 'doctor', remappings={'__ns': '/arm'},
            arguments=('--seconds', '4', '--json')) as doctor:
        publisher = probe.talk(JointState, 'arm/joint_states', BEST_EFFORT)
        probe.listen(JointState, 'arm/joint_states', RELIABLE)
        while doctor.running:
            now = time.time_ns()
            t = now * 1e-9 % 1000.0
            publisher.publish(joint_state(
                now, ['elbow'], [np.sin(2.0 * t)], [-2.0 * np.cos(2.0 * t)], [0.0]))
            probe.spin_for(0.004)
        assert doctor.wait() == 1
        findings = json.loads(doctor.text)['findings']
    problems = [f"{one['about']}: {one['what']}" for one in findings if one['level'] == 'problem']
    assert any('elbow: velocity is -1 times the rate' in line for line in problems), problems
    assert any('QoS' in line and 'best effort' in line for line in problems), problems
    assert all(one['do'] for one in findings if one['level'] == 'problem')


# Less than a person would want to be told of.
HASTY = """
import friction_comp.ros.node_main as node_main
node_main.PATIENCE = 0.3
from friction_comp.__main__ import run
raise SystemExit(run('exercise', ['--ros-args', '-p', 'joints:=[elbow]']))
"""


def test_a_node_without_peers_says_so_and_names_those_found_later():
    with own_domain():
        with subprocess.Popen([sys.executable, '-c', HASTY], cwd=ROOT, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            lines = iter(process.stdout.readline, '')
            told = next(line for line in lines if 'no other node' in line)
            assert 'ROS_DOMAIN_ID' in told
            with probe_node() as probe:
                assert probe.get_name() in next(line for line in lines if 'found' in line)
            process.terminate()
        assert process.returncode == 0


def test_a_machine_without_loopback_is_named(monkeypatch, capsys):
    assert loopback_fault() == ''
    # An address that is not this machine's, as its own is not without the interface.
    fault = loopback_fault('192.0.2.1')
    assert 'ip link set lo up' in fault
    monkeypatch.setattr('friction_comp.monitoring.network.loopback_fault', lambda: fault)
    assert fault in alone(10.0)
    assert doctor.main(['--installed', '--json']) == 1
    finding, = (one for one in json.loads(capsys.readouterr().out)['findings']
                if one['about'] == 'network')
    assert finding['do'] == 'ip link set lo up'
