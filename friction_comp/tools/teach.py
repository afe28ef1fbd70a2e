# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``teach``: makes an exercise of a recorded movement that a person guided.

The node `exercise` plays it (parameter exercise_file) with the direction of each joint.
"""

from __future__ import annotations

import numpy as np

from friction_comp.errors import errors_name, InputError
from friction_comp.files import to_yaml, write_atomically
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, layout_of


def main(argv: list[str] | None = None) -> int:
    """Write the exercise file; returns 0."""
    parser = Arguments('teach', __doc__, (
        'examples/elbow/with_direction.mcap.zstd --output output/exercise.yaml',
        )).add_recordings(several=False)
    parser.add_output('exercise file to write')
    arguments = parser.parse(argv)
    from friction_comp.direction.exercise import exercise_of, teach
    from friction_comp.recordings.reader import find_recording, read_arm

    with progress('reading') as report:
        arm = read_arm(find_recording(arguments.recording), progress=report,
                       layout=layout_of(arguments))
    joints = [arguments.joint] if arguments.joint else list(arm)
    if unknown := set(joints) - set(arm):
        raise InputError(f'{arguments.recording}: no joint {unknown.pop()!r}; it has '
                         f'{", ".join(arm)}')
    samples = [arm[joint][0][0] for joint in joints]
    with errors_name(arguments.recording):
        begin = max(float(one.time[0]) for one in samples)
        end = min(float(one.time[-1]) for one in samples)
        time = samples[0].time[(samples[0].time >= begin) & (samples[0].time <= end)]
        if len(time) < 2:
            raise InputError('the joints were not recorded at the same time')
        position = np.column_stack([np.interp(time, one.time, one.position) for one in samples])
        document, _ = teach(joints, time, position)
    script = exercise_of(document)
    write_atomically(arguments.output, to_yaml(document))
    print(f'{arguments.output}: {len(script.times)} waypoints in {script.duration:.1f} s of '
          f'{", ".join(joints)}')
    return 0
