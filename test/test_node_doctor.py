# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The doctor over DDS."""

import json
import time

from node_process import Process
import numpy as np
from ros_system import BEST_EFFORT, joint_state, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState


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
    assert any('QoS' in line and 'reliable: nothing arrives' in line for line in problems), problems
    assert all(one['do'] for one in findings if one['level'] == 'problem')
