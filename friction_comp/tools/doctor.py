# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool `doctor`."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module, util
import os
import platform
import sys
from typing import Any

from friction_comp.files import add_environment_to_ament_path
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, whole_number

_REQUIRED = ('numpy', 'scipy', 'numba', 'yaml', 'matplotlib', 'rosbags', 'mcap')
_OPTIONAL = {'pinocchio': 'refine --urdf', 'mujoco': 'plant with arm_file',
             'pyarrow': 'Parquet files', 'h5py': 'HDF5 files'}
_ROS = ('rclpy', 'sensor_msgs', 'std_msgs', 'geometry_msgs', 'diagnostic_msgs', 'lifecycle_msgs')
_ACTIONS = ('IdentifyFriction', 'PlayTrajectory', 'RefineModel')
_VARIABLES = ('ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS')


def doctor(argv: list[str] | None = None) -> int:
    """Checks what is installed and running, and says what to do.

    The exit code is 0 if nothing is wrong (warnings included), 1 if there is a problem, 2 if an
    argument cannot be used. It publishes and changes nothing.
    """
    parser = Arguments(doctor, (
        '', '--seconds 0', '--seconds 10',
        '--ros-args -r current_command:=/current_controller/commands'))
    parser.add_argument('--seconds', metavar='S', type=whole_number(0), default=5,
                        help='how long to observe the running system (%(default)s); 0: check this '
                        'machine only')
    arguments = parser.parse(argv)
    findings = list(check_machine())
    if arguments.seconds and not _with(findings, 'problem'):
        from friction_comp.monitoring.checkup import check_system
        from friction_comp.ros.tool_client import observe

        with progress('observing') as report:
            seen = observe(arguments.seconds, arguments.ros, report)
        findings += check_system(seen)
    for level, about, what, do in findings:
        print(f'{level:8} {about}: {what}' + f'\n         -> {do}' * bool(do))
    missing = ', '.join(dict.fromkeys(one[1] for one in _with(findings, 'problem')))
    print(f'{len(_with(findings, "problem"))} problems, {len(_with(findings, "warning"))} '
          'warnings: ' + (f'not ready, look after {missing}' if missing else 'ready'))
    return int(bool(_with(findings, 'problem')))


def _with(findings: list[Any], level: str) -> list[Any]:
    return [one for one in findings if one[0] == level]


def check_machine() -> Iterator[tuple[str, str, str, str]]:
    """Yield level, subject, observation and advice about this machine."""
    domain = ', '.join(f'{name}={os.environ[name]}' for name in _VARIABLES if name in os.environ)
    yield ('ok', 'Python', f'{platform.python_version()}, {sys.executable}; '
           + (domain or 'ROS domain 0, all defaults'), '')
    for name in (*_REQUIRED, *_OPTIONAL, *_ROS):
        if util.find_spec(name) is None:
            use = 'nodes; tools for files run without it' if name in _ROS else (
                _OPTIONAL.get(name, ''))
            yield ('note' if name in _OPTIONAL else 'problem', name, 'not installed'
                   + f'; it is for {use}' * bool(use), 'source a ROS 2 installation, or use the '
                   'environment of `make setup`' if name in _ROS else f'pip install {name}')
    add_environment_to_ament_path()
    try:
        action = import_module('friction_comp_interfaces.action')
        wanted = [name for name in _ACTIONS if not hasattr(action, name)]
    except ImportError:
        wanted = ['friction_comp_interfaces']
    if wanted:
        yield ('problem', 'actions', f'no {", ".join(wanted)}',
               'build the package again: make setup, or colcon build')
