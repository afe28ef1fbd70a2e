# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The launch files are loaded and started, if `launch` is installed."""

import os
import shutil
import signal
import subprocess
import sys
import time

from helpers import ROOT
import pytest

pytest.importorskip('launch_ros', reason='launch is not in this environment')

from ros_system import MODELS, own_domain, probe_node

STARTS = {'compensation': {'compensator'}, 'identification': {'identification'},
          'simulation': {'plant', 'compensator', 'exercise'}}


RUN = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    sys.argv[1], launch_arguments=[word.split(':=') for word in sys.argv[2:]])]))
sys.exit(service.run())
"""


@pytest.fixture(scope='module')
def prefix(tmp_path_factory):
    """A workspace as colcon would install it, as far as launch looks at it."""
    prefix = tmp_path_factory.mktemp('prefix')
    index = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / 'friction_comp').touch()
    share = prefix / 'share' / 'friction_comp'
    for name in ('config', 'launch'):
        shutil.copytree(ROOT / name, share / name)
    executables = prefix / 'lib' / 'friction_comp'
    executables.mkdir(parents=True)
    for name in ('plant', 'compensator', 'identification', 'exercise'):
        path = executables / name
        path.write_text(f'#!/bin/sh\nexec {sys.executable} -m friction_comp {name} "$@"\n')
        path.chmod(0o755)
    return prefix


@pytest.mark.parametrize('name', sorted(STARTS))
def test_starts_its_nodes_and_ends_them_on_an_interrupt(prefix, tmp_path, name):
    with own_domain(), probe_node() as probe:
        environment = dict(
            os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), *sys.path]),
            AMENT_PREFIX_PATH=os.pathsep.join([str(prefix), sys.prefix]),
            ROS_LOG_DIR=str(tmp_path / 'log'))
        parameters = tmp_path / 'own.yaml'
        parameters.write_text(
            "/**/compensator: {ros__parameters: {current_limit: 2.0, law: paper, "
            f"joints: [elbow], model_files: ['{MODELS[0]}']}}}}\n")
        log = (tmp_path / 'out.txt').open('w')
        process = subprocess.Popen(
            [sys.executable, '-c', RUN, str(ROOT / 'launch' / f'{name}.launch.py'),
             *(() if name == 'compensation' else
               ("joints:=['elbow']", f"model_files:=['{MODELS[0]}']")),
             *(() if name == 'identification' else ('law:=kinetic',)),
             f'parameters:={parameters}', 'log_level:=warn',
             # On a busy machine, nodes may take longer than launch waits by itself.
             'sigterm_timeout:=60', 'sigkill_timeout:=60'],
            env=environment, stdout=log, stderr=log, start_new_session=True)
        try:
            probe.until(lambda: STARTS[name] <= set(probe.get_node_names()), 'the nodes')
            if name != 'identification':
                probe.until(lambda: probe.count_publishers('current_command') == 1, 'activation')
                # What is not given stays as the parameter file says.
                assert probe.get_parameters_of(
                    'compensator', ['current_limit', 'law']) == [2.0, 'kinetic']
            time.sleep(0.5)
            os.killpg(process.pid, signal.SIGINT)
            process.wait(120.0)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    text = (tmp_path / 'out.txt').read_text()
    assert process.returncode == 0, text
    assert text.count('process has finished cleanly') == len(STARTS[name]), text
    assert 'Traceback' not in text
