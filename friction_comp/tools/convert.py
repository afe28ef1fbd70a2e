# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``convert``: converts a recording into a table, and a table into a recording.

An output named .csv, .parquet or .npz is a table with one row per time, in SI units; any other
name is the folder of a rosbag2 recording.
"""

from __future__ import annotations

import os
from pathlib import Path

from friction_comp.errors import InputError
from friction_comp.files import check_file
from friction_comp.messages import NANO
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, layout_of


def main(argv: list[str] | None = None) -> int:
    """Write the recording in the other form; returns 0."""
    parser = Arguments('convert', __doc__, (
        'examples/elbow/with_direction.mcap.zstd --output output/with_direction.csv',
        'output/with_direction.csv --output output/with_direction')).add_recordings(several=False)
    parser.add_argument('--output', metavar='FILE|DIR', type=Path, required=True,
                        help='.csv, .parquet or .npz file, or a new folder')
    arguments = parser.parse(argv)
    from friction_comp.recordings.reader import read_joints
    from friction_comp.recordings.writer import write_samples
    from friction_comp.tables.table_files import is_table, write_columns
    from friction_comp.tables.table_recording import table_of

    output = arguments.output
    if os.path.lexists(output):
        raise InputError(f'{output}: already exists; recordings are not overwritten')
    check_file(output)
    with progress('reading') as report:
        joints, info = read_joints(
            arguments.recording, arguments.joint, lambda share: report(0.5 * share),
            layout_of(arguments))
        report(0.5, 'writing')
        if is_table(output):
            write_columns(output, table_of(joints))
        else:
            # Zero would mean that a message has no stamp.
            write_samples(output, joints, start_ns=max(round(1e9 * info.start), NANO))
    names = ', '.join(samples.joint or 'one joint' for samples in joints)
    print(f'{output}: {len(joints[0])} instants of {names}')
    for note in info.notes:
        print(f'note: {note}')
    return 0
