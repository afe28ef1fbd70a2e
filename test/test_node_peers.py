# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A node that finds no other node tells the user."""

import json
import subprocess
import sys

from node_process import ROOT
from ros_system import own_domain, probe_node

from friction_comp.monitoring.network import alone, loopback_fault
from friction_comp.tools import doctor

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
