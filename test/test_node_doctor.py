# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The doctor over DDS, and a node that finds no other."""

import json
import time

from node_process import Process
import numpy as np
from ros_system import BEST_EFFORT, joint_state, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState

from friction_comp.monitoring.network import loopback_fault
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


def test_a_machine_without_loopback_is_named(monkeypatch, capsys):
    assert loopback_fault() == ''
    # An address that is not this machine's, as its own is not without the interface.
    fault = loopback_fault('192.0.2.1')
    assert 'ip link set lo up' in fault
    monkeypatch.setattr('friction_comp.monitoring.network.loopback_fault', lambda: fault)
    assert doctor.main(['--installed', '--json']) == 1
    finding, = (one for one in json.loads(capsys.readouterr().out)['findings']
                if one['about'] == 'network')
    assert finding['do'] == 'ip link set lo up'
