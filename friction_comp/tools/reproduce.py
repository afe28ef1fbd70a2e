# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``reproduce``: repeats the technical note's experiments on simulated joints.

It prints the results of the simulation next to those of the note.
"""

from __future__ import annotations

from friction_comp.files import output_folder, to_json
from friction_comp.terminal import aligned, progress
from friction_comp.tools.common import Arguments, whole_number


def main(argv: list[str] | None = None) -> int:
    """Repeat the note's experiments and write results.json; returns 0."""
    parser = Arguments('reproduce', __doc__).add_output()
    parser.add_argument('--cycles', metavar='N', type=whole_number(2), default=200,
                        help='current ramps per direction and configuration (200)')
    parser.add_argument('--seed', metavar='N', type=whole_number(0), default=2,
                        help='seed of noise, scatter and persons (2)')
    arguments = parser.parse(argv)
    from friction_comp.note.experiments import compared, run_experiments

    with output_folder(arguments.output) as folder, progress('starting') as report:
        configurations = run_experiments(arguments.cycles, arguments.seed, report)
        (folder / 'results.json').write_text(
            to_json({'configurations': configurations}), encoding='utf-8')
    head = ['the note in brackets', *(f'configuration {name}' for name in configurations)]
    print(*aligned([head, *compared(configurations)]), arguments.output / 'results.json', sep='\n')
    return 0
