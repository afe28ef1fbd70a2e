# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``doctor``: checks what is installed and running, and says what to do.

The exit code is 0 if nothing is wrong (warnings included), 1 if there is a problem, 2 if an
argument cannot be used. It publishes and changes nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import importlib.metadata
import importlib.util
import os
from pathlib import Path
import platform
import sys
from typing import TYPE_CHECKING

from friction_comp.errors import InputError
from friction_comp.monitoring import network
from friction_comp.monitoring.observation import Finding, NOTE, Observation, OK, PROBLEM, WARNING
from friction_comp.package_files import add_environment_to_ament_path, middlewares
from friction_comp.results import to_json
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, positive

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel

# Module, distribution on PyPI, purpose, and whether the package works without it.
_PACKAGES = (
    ('numpy', 'numpy', '', False), ('scipy', 'scipy', '', False), ('numba', 'numba', '', False),
    ('yaml', 'PyYAML', '', False), ('matplotlib', 'matplotlib', '', False),
    ('threadpoolctl', 'threadpoolctl', '', False),
    ('rich', 'rich', '', False), ('markdown_it', 'markdown-it-py', '', False),
    ('rosbags', 'rosbags', '', False), ('mcap', 'mcap', '', False),
    ('zstandard', 'zstandard', '', False),
    ('pinocchio', 'pin', 'refine --urdf', True),
    ('mujoco', 'mujoco', 'plant with engine mujoco, and demo --scene arm', True),
    ('pyarrow', 'pyarrow', 'Parquet files', True),
    ('h5py', 'h5py', 'HDF5 files', True))
_ROS = ('rclpy', 'sensor_msgs', 'std_msgs', 'geometry_msgs', 'diagnostic_msgs', 'lifecycle_msgs')
_ACTIONS = ('IdentifyFriction', 'PlayTrajectory', 'RefineModel')
_STYLES = {OK: ('green', 'ok'), NOTE: ('cyan', 'note'), WARNING: ('yellow', 'warning'),
           PROBLEM: ('bold red', 'PROBLEM')}


def main(argv: list[str] | None = None) -> int:
    """Check the installation and the running system, and print the findings."""
    parser = Arguments('doctor', __doc__, (
        '', '--installed', '--seconds 10 --model config/armin_configuration_2.yaml',
        '--ros-args -r current_command:=/current_controller/commands'))
    parser.add_argument('--seconds', type=positive, default=5.0,
                        help='how long to observe the running system (%(default)s)')
    parser.add_argument('--model', metavar='FILE', type=Path, nargs='+', default=[],
                        help="model files to compare with live data; the compensator's by default")
    parser.add_effort_holds()
    parser.add_argument('--installed', action='store_true',
                        help='check this machine only, not the running system')
    parser.add_argument('--json', action='store_true', help='print findings as JSON')
    arguments = parser.parse(argv)
    # A file that cannot be used is named before anything is observed.
    models = _load(arguments.model)
    findings = list(check_machine())
    if not arguments.installed and PROBLEM not in {finding.level for finding in findings}:
        findings += check_running_system(arguments, models)
    if arguments.json:
        print(to_json({'findings': [vars(finding) for finding in findings]}), end='')
    else:
        _print(findings)
    return int(PROBLEM in {finding.level for finding in findings})


def _load(paths: list[Path]) -> list[FrictionModel]:
    if not paths:
        return []   # what a model needs may be what is missing
    from friction_comp.model.friction_model import FrictionModel

    return [FrictionModel.load(path) for path in paths]


def check_machine() -> Iterator[Finding]:
    """Yield the findings about this machine: what is installed, network and load."""
    yield Finding(OK, 'Python', f'{platform.python_version()}, {sys.executable}')
    for module, name, use, optional in _PACKAGES:
        if importlib.util.find_spec(module) is None:
            yield Finding(NOTE if optional else PROBLEM, name,
                          'not installed' + (f'; it is for {use}' if use else ''),
                          f'pip install {name}')
        elif not optional:
            try:
                version = importlib.metadata.version(name)
            except importlib.metadata.PackageNotFoundError:
                version = 'installed by the system'
            yield Finding(OK, name, version)
    missing = [name for name in _ROS if importlib.util.find_spec(name) is None]
    if missing:
        yield Finding(PROBLEM, 'ROS 2', f'no {", ".join(missing)}', 'source a ROS 2 '
                      'installation, or use the environment that `make setup` makes')
    else:
        yield Finding(OK, 'ROS 2', os.environ.get('ROS_DISTRO', 'from wheels in this environment'))
        yield from _interfaces()
        yield from _middleware()
    if fault := network.loopback_fault():
        what, _, do = fault.partition(': ')
        yield Finding(PROBLEM, 'network', what, do)
    load = os.getloadavg()[0] / (os.cpu_count() or 1) if hasattr(os, 'getloadavg') else 0.0
    if load > 1.0:
        yield Finding(WARNING, 'load', f'{load:.1f} processes wait for each processor core',
                      'nothing else should run beside a control loop')


def _interfaces() -> Iterator[Finding]:
    add_environment_to_ament_path()
    try:
        action = importlib.import_module('friction_comp_interfaces.action')
        wanted = [name for name in _ACTIONS if not hasattr(action, name)]
    except ImportError:
        wanted = ['friction_comp_interfaces']
    if wanted:
        yield Finding(PROBLEM, 'actions', f'no {", ".join(wanted)}',
                      'build the package again: make setup, or colcon build')
    else:
        yield Finding(OK, 'actions', ', '.join(_ACTIONS))


def _middleware() -> Iterator[Finding]:
    """Yield a problem if RMW_IMPLEMENTATION is not installed: every ROS 2 process would end."""
    wanted, installed = os.environ.get('RMW_IMPLEMENTATION'), middlewares()
    if wanted and installed and wanted not in installed:
        yield Finding(PROBLEM, 'middleware', f'RMW_IMPLEMENTATION is {wanted}, which is not '
                      f'installed; there is {", ".join(installed)}',
                      'unset RMW_IMPLEMENTATION here '
                      f'and on the robot alike, or install {wanted} on both')


def check_running_system(arguments: argparse.Namespace, models: list[FrictionModel]
                         ) -> list[Finding]:
    """Return the findings about the running system, and on models of its joints."""
    from friction_comp.monitoring.checkup import check_system
    from friction_comp.ros.system_probe import middleware, observe

    variables = ', '.join(f'{name}={os.environ[name]}' for name in (
        'ROS_DOMAIN_ID', 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_STATIC_PEERS', 'ROS_LOCALHOST_ONLY')
        if name in os.environ)
    findings = [Finding(
        OK, 'middleware', f'{middleware()}; {variables or "domain 0, all defaults"}')]
    with progress('observing') as report:
        seen = observe(arguments.seconds, arguments.ros, report)
    seen.effort_is_current = arguments.effort_holds == 'current'
    return findings + check_system(seen) + _check_models(seen, models)


def _check_models(seen: Observation, given: list[FrictionModel]) -> list[Finding]:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.model.motor_check import doubts, is_to_be_recorded_again
    from friction_comp.monitoring.checkup import check_joint

    joints = seen.states.joints if seen.states else []
    findings: list[Finding] = []
    models = []
    for index, model in enumerate(given):
        # The file of a joint of another name belongs to the joint at its place in the list.
        is_named = model.joint in joints or index >= len(joints)
        models.append((model.joint if is_named else joints[index], model))
        # Those of a running compensator are told by its diagnostics.
        level = PROBLEM if is_to_be_recorded_again(model) else WARNING
        findings += [Finding(level, models[-1][0], text, 'record or identify it again')
                     for text in doubts(model)]
    if not given:
        for node, values in seen.parameters.items():
            if 'compensator' not in node:
                continue
            for joint, path in zip(values.get('joints') or (), values.get('model_files') or ()):
                try:
                    models.append((joint, FrictionModel.load(path, joint)))
                except InputError as error:
                    findings.append(Finding(PROBLEM, joint, str(error),
                                            'look whether the file is on this machine too'))
    for joint, model in models if seen.states else ():
        findings += check_joint(seen, joint, model)
    return findings


def _print(findings: list[Finding]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False, show_header=False)
    for _ in range(3):
        table.add_column(overflow='fold')
    for finding in findings:
        style, word = _STYLES[finding.level]
        do = f'\n→ {finding.do}' if finding.do else ''
        table.add_row(f'[{style}]{word}[/{style}]', finding.about.replace('[', r'\['),
                      (finding.what + do).replace('[', r'\['))
    Console(highlight=False).print(table)
    count = {level: sum(finding.level == level for finding in findings) for level in _STYLES}
    print(', '.join(f'{count[level]} {level}{"s" * (count[level] != 1)}'
                    for level in ('problem', 'warning')))
    print(readiness(findings))


def readiness(findings: list[Finding]) -> str:
    """Return the last line: ready, or what is missing."""
    missing = list(dict.fromkeys(f.about for f in findings if f.level == PROBLEM))
    if not missing:
        return 'ready'
    needed = {name for _, name, _, optional in _PACKAGES if not optional}
    if needed.isdisjoint(missing) and 'ROS 2' in missing:
        return ('ready for recordings (convert, evaluate, refine, predict); for the nodes and the '
                f'demo look after: {", ".join(missing)}')
    return f'not ready: look after {", ".join(missing)}'
