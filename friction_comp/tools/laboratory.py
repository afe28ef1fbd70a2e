# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools `demo` and `reproduce`: everything on simulated joints."""

from __future__ import annotations

from pathlib import Path

from friction_comp.demo.processes import private_domain
from friction_comp.files import check_folder, output_folder, to_json
from friction_comp.terminal import aligned, progress
from friction_comp.tools.common import Arguments, whole_number

SCENES = {
    'loop': 'from identification to the refined model',
    'arm': 'an arm is taught by hand (MuJoCo)',
    'to_and_fro': 'a hand leads a joint, with several laws'}


def demo(argv: list[str] | None = None) -> int:
    """Runs the whole loop over ROS 2 on this machine, in simulated time.

    Identify, compensate, evaluate, refine, load the refined model, compare.
    """
    parser = Arguments(demo, ('', '--scene arm'))
    parser.add_argument('--output', metavar='DIR', type=Path, default=Path('friction_comp_demo'),
                        help='file or folder for the results (%(default)s)')
    parser.add_argument('--repetitions', metavar='N', type=whole_number(), default=3,
                        help='movements in each direction, of the loop (%(default)s)')
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


def reproduce(argv: list[str] | None = None) -> int:
    """Repeats the technical note's experiments on simulated joints.

    It prints the results of the simulation next to those of the note.
    """
    parser = Arguments(reproduce).add_output()
    parser.add_argument('--cycles', metavar='N', type=whole_number(2), default=200,
                        help='current ramps per direction and configuration (200)')
    arguments = parser.parse(argv)
    from friction_comp.note.experiments import compared, run_experiments

    with output_folder(arguments.output) as folder, progress('starting') as report:
        configurations = run_experiments(arguments.cycles, 2, report)
        (folder / 'results.json').write_text(
            to_json({'configurations': configurations}), encoding='utf-8')
    head = ['the note in brackets', *(f'configuration {name}' for name in configurations)]
    print(*aligned([head, *compared(configurations)]), arguments.output / 'results.json', sep='\n')
    return 0
