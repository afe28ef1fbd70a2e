# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``teach``: makes an exercise of a recorded movement that a person guided.

The node `exercise` plays it (parameter exercise_file) with the direction of each joint.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from friction_comp.errors import errors_name, InputError
from friction_comp.files import to_yaml, write_atomically
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, layout_of


def main(argv: list[str] | None = None) -> int:
    """Write the exercise file; returns 0."""
    parser = Arguments('teach', __doc__, (
        'examples/elbow/with_direction.mcap.zstd --output output/exercise.yaml',
        'guided --limits joint_limits.yaml --output exercise.yaml')).add_recordings(several=False)
    parser.add_output('exercise file to write')
    parser.add_argument('--limits', metavar='FILE', type=Path,
                        help="file with limits, as MoveIt's joint_limits.yaml: positions beyond "
                        'them are refused, faster movements slowed down')
    arguments = parser.parse(argv)
    from friction_comp.excitation.joint_limits import from_yaml
    from friction_comp.exercise.exercise_script import exercise_of
    from friction_comp.exercise.taught_exercise import teach
    from friction_comp.recordings import find_recording, read_arm

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
        limits = from_yaml(arguments.limits, joints) if arguments.limits else []
        for own, column in zip(limits, position.T):
            if not own.lowest <= column.min() <= column.max() <= own.highest:
                raise InputError(
                    f'{own.joint}: guided from {column.min():.3g} to {column.max():.3g} rad, but '
                    f'the limits are {own.lowest:g} and {own.highest:g} rad')
        taught = teach(joints, time, position, [own.velocity for own in limits] or None)
    script = exercise_of(taught.document)
    write_atomically(arguments.output, to_yaml(taught.document))
    print(f'{arguments.output}: {len(taught.waypoints)} waypoints in {script.duration:.1f} s of '
          f'{", ".join(joints)}')
    if taught.slowed > 1.0:
        print(f'slowed down by a factor of {taught.slowed:.2f}, to keep the limits of speed')
    return 0
