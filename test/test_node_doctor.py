# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the doctor sees of a running system."""

import time

from node_process import Process
import numpy as np
from ros_system import BEST_EFFORT, joint_state, own_domain, probe_node, RELIABLE
from sensor_msgs.msg import JointState


def test_the_doctor_finds_the_sign_and_who_publishes(tmp_path):
    with own_domain(), probe_node() as probe, Process(
            tmp_path, 'doctor', remappings={'__ns': '/arm'},
            arguments=('--seconds', '4')) as doctor:
        publisher = probe.talk(JointState, 'arm/joint_states', BEST_EFFORT)
        probe.listen(JointState, 'arm/joint_states', RELIABLE)
        while doctor.running:
            now = time.time_ns()
            t = now * 1e-9 % 1000.0
            publisher.publish(joint_state(
                now, ['elbow'], [np.sin(2.0 * t)], [-2.0 * np.cos(2.0 * t)], [0.0]))
            probe.spin_for(0.004)
        assert doctor.wait() == 1
        text = doctor.text
    assert 'elbow: velocity is -1 times the rate' in text, text
    assert 'reliable: nothing arrives' in text, text
