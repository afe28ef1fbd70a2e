# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The doctor over DDS, and a node that finds no other."""

import json
import subprocess
import sys
import time

from node_process import Process, ROOT
import numpy as np
from ros_system import BEST_EFFORT, joint_state, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState

from friction_comp.monitoring.network import alone, loopback_fault
from friction_comp.tools import doctor


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
