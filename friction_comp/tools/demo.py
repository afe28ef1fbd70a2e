# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``demo``: the whole loop over ROS 2 on this machine, in simulated time.

Identify, compensate, evaluate, find what the model lacks, load the refined model, compare.
"""

from __future__ import annotations

import os
from pathlib import Path
import signal

from friction_comp.package_files import package_file
from friction_comp.tools.common import Arguments, whole_number
from friction_comp.tools.improve import main as improve
from friction_comp.tools.ros_domain import leased_domain

SCENES = {
    'loop': 'identify, compensate, evaluate, refine, compensate again',
    'two_joints': 'an exercise of two joints that turn round on the way, from YAML',
    'arm': 'a person guides an arm of three joints, its weight and friction taken (MuJoCo)',
    'improve': 'a drive that asks for its own motion, from nothing to a model that predicts',
    'wear': 'a drive that changes while it runs: told, refined, loaded and judged live'}


def main(argv: list[str] | None = None) -> int:
    """Run one scene of the demo and write its report; returns 0.

    Raises
    ------
    InputError
        If an argument cannot be used, or a node fails.
    """
    parser = Arguments('demo', __doc__, ('--watch', '--scene two_joints', '--scene wear --watch'))
    parser.add_argument('--output', metavar='DIR', type=Path, default=Path('friction_comp_demo'),
                        help='folder for models, recordings and the report (%(default)s)')
    parser.add_argument('--repetitions', metavar='N', type=whole_number(), default=3,
                        help='movements each way in a trial, repetitions of the exercise '
                        '(%(default)s)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=1,
                        help="of the simulated joint's noise and scatter (%(default)s)")
    parser.add_argument('--scene', choices=SCENES, default='loop',
                        help='; '.join(f'{name}: {text}' for name, text in SCENES.items())
                        + ' (%(default)s)')
    parser.add_argument('--watch', action='store_true',
                        help='with a live page on localhost (needs Bokeh)')
    parser.add_argument('--undeclared', metavar='FILE', type=Path,
                        help='what the simulated joint hides from the other nodes '
                        '(config/undeclared_example.yaml)')
    arguments = parser.parse(argv)
    if arguments.scene == 'improve':
        return improve([
            '--simulate', str(package_file('config', 'armin_configuration_1.yaml')),
            '--undeclared', str(arguments.undeclared
                                or package_file('config', 'undeclared_pair.yaml')),
            '--position', '-1', '1', '--velocity', '1.5', '--acceleration', '6',
            '--seed', str(arguments.seed), '--output', str(arguments.output)])
    # A separate domain, on this machine only, so that no robot is disturbed.
    with leased_domain() as domain:
        # Importing ROS 2 may restart Python, so it comes first.
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        # Nodes then discover each other in half a second instead of three.
        os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE',
                              str(package_file('config', 'quick_discovery.xml')))
        from friction_comp.nodes.demo_client import DemoClient
        from friction_comp.tools.demo_arm import GuidedArm
        from friction_comp.tools.demo_scenes import TwoJoints, Wear
        from friction_comp.tools.demo_stage import tell
        from friction_comp.tools.demo_story import Demo

        scene = {'loop': Demo, 'two_joints': TwoJoints, 'arm': GuidedArm,
                 'wear': Wear}[arguments.scene]
        previous = signal.signal(signal.SIGTERM, _interrupt)
        try:
            return tell(arguments, DemoClient, scene)
        finally:
            signal.signal(signal.SIGTERM, previous)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt
