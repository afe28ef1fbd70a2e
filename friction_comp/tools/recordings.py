# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools `evaluate`, `convert` and `teach`: what becomes of a recording."""

from __future__ import annotations

import os
from pathlib import Path

from friction_comp.errors import errors_name, InputError
from friction_comp.files import check_file, to_yaml, write_atomically
from friction_comp.messages import NANO
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, layout_of, write_results


def evaluate(argv: list[str] | None = None) -> int:
    """Computes the torque that a person needed in recorded movements."""
    arguments = Arguments(evaluate, ('examples/elbow --output output/evaluation',)
                          ).add_recordings().add_output().parse(argv)
    from friction_comp.evaluation.conditions import evaluate_recordings, repetitions_csv

    with progress('reading') as report:
        evaluations = evaluate_recordings(
            arguments.recordings, arguments.joint, layout_of(arguments),
            lambda share: report(0.9 * share))
        report(0.9, 'writing')
        from friction_comp.reports.evaluation_page import evaluation_page, terminal_lines

        content = evaluations[0].as_dict()
        if len(evaluations) > 1:
            content['joints'] = [evaluation.as_dict() for evaluation in evaluations]
        write_results(arguments, content, evaluation_page(evaluations),
                      files={'repetitions.csv': repetitions_csv(evaluations)})
    lines = []
    for evaluation in evaluations:
        lines += [f'{evaluation.joint}:'] * (len(evaluations) > 1)
        lines += terminal_lines(evaluation)
    lines += [note for note in evaluations[0].notes if note.startswith('left out: ')]
    print(*lines, arguments.output / 'report.html', sep='\n')
    return 0


def convert(argv: list[str] | None = None) -> int:
    """Converts a recording into a table, and a table into a recording.

    An output named .csv is a table with one row per time, in SI units; any other name is the folder
    of a rosbag2 recording.
    """
    parser = Arguments(convert, (
        'examples/elbow/with_direction.mcap.zstd --output output/with_direction.csv',
        'output/with_direction.csv --output output/with_direction')).add_recordings(several=False)
    parser.add_argument('--output', metavar='FILE|DIR', type=Path, required=True,
                        help='.csv file, or a new folder')
    arguments = parser.parse(argv)
    from friction_comp.recordings.reader import read_joints
    from friction_comp.recordings.writer import write_samples
    from friction_comp.tables.table_files import is_table, to_csv
    from friction_comp.tables.table_recording import table_of

    output = arguments.output
    if os.path.lexists(output):
        raise InputError(f'{output}: already exists; recordings are not overwritten')
    check_file(output)
    if is_table(output) and output.suffix.lower() != '.csv':
        raise InputError(f'{output}: a table is written as .csv')
    with progress('reading') as report:
        joints, info = read_joints(arguments.recording, arguments.joint, layout_of(arguments))
        report(0.5, 'writing')
        if is_table(output):
            write_atomically(output, to_csv(table_of(joints), 12))
        else:
            # Zero would mean that a message has no stamp.
            write_samples(output, joints, start_ns=max(round(1e9 * info.start), NANO))
    names = ', '.join(samples.joint or 'one joint' for samples in joints)
    print(f'{output}: {len(joints[0])} instants of {names}')
    for note in info.notes:
        print(f'note: {note}')
    return 0


def teach(argv: list[str] | None = None) -> int:
    """Makes an exercise of a recorded movement that a person guided.

    The node `exercise` plays it (parameter exercise_file) with the direction of each joint.
    """
    parser = Arguments(teach, (
        'examples/elbow/with_direction.mcap.zstd --output output/exercise.yaml',
        )).add_recordings(several=False)
    parser.add_output('exercise file to write')
    arguments = parser.parse(argv)
    import numpy as np

    from friction_comp.direction import exercise
    from friction_comp.recordings.reader import read_joints

    with progress('reading'):
        joints, _ = read_joints(arguments.recording, arguments.joint, layout_of(arguments))
    names = [one.joint for one in joints]
    with errors_name(arguments.recording):
        document, _ = exercise.teach(
            names, joints[0].time, np.column_stack([one.position for one in joints]))
    script = exercise.exercise_of(document)
    write_atomically(arguments.output, to_yaml(document))
    print(f'{arguments.output}: {len(script.times)} waypoints in {script.duration:.1f} s of '
          f'{", ".join(names)}')
    return 0
