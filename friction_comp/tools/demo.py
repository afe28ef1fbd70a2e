# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``demo``: runs the whole loop over ROS 2 on this machine, in simulated time.

Identify, compensate, evaluate, refine, load the refined model, compare.
"""

from __future__ import annotations

from pathlib import Path

from friction_comp.demo.processes import private_domain
from friction_comp.files import check_folder
from friction_comp.tools.common import Arguments, whole_number

SCENES = {
    'loop': 'from identification to the refined model',
    'arm': 'an arm is taught by hand (MuJoCo)',
    'to_and_fro': 'a hand leads a joint, with several laws'}


def main(argv: list[str] | None = None) -> int:
    """Run one scene of the demo and write its report; returns 0."""
    parser = Arguments('demo', __doc__, ('', '--scene arm'))
    parser.add_argument('--output', metavar='DIR', type=Path, default=Path('friction_comp_demo'),
                        help='file or folder for the results (%(default)s)')
    parser.add_argument('--repetitions', metavar='N', type=whole_number(), default=3,
                        help='movements in each direction, of the loop (%(default)s)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=1,
                        help="seed of the simulated joint's noise and scatter (%(default)s)")
    parser.add_argument('--scene', choices=SCENES, default='loop',
                        help='; '.join(f'{name}: {words}' for name, words in SCENES.items())
                        + ' (%(default)s)')
    arguments = parser.parse(argv)
    check_folder(arguments.output)
    with private_domain():
        # Importing ROS 2 may restart Python, so it comes first.
        from friction_comp.demo import scenes
        import friction_comp.ros.tool_client  # noqa: F401

        with scenes.open_system(arguments) as system:
            getattr(scenes, f'play_{arguments.scene}')(system)
    return 0
