# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tool ``play``: moves joints along a trajectory, such as one that `excite` planned.

Without --controller the node `identification` moves the joints, one after another, by motor
currents and under its supervision. With it, a robot's own trajectory controller moves all of them.
"""

from __future__ import annotations

from pathlib import Path

from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments


def main(argv: list[str] | None = None) -> int:
    """Play the trajectory; returns 0."""
    parser = Arguments('play', __doc__, (
        'output/excite/trajectory.yaml',
        'output/excite/trajectory.yaml --controller joint_trajectory_controller'))
    parser.add_argument('trajectory', metavar='FILE', type=Path,
                        help='trajectory_msgs/JointTrajectory as YAML')
    parser.add_argument('--joint', metavar='NAME', help='move this joint only')
    parser.add_argument('--controller', metavar='NAME',
                        help='trajectory controller with the action NAME/follow_joint_trajectory')
    arguments = parser.parse(argv)
    from friction_comp.trajectory import Trajectory

    trajectory = Trajectory.load(arguments.trajectory)
    if arguments.joint:
        trajectory = trajectory.of(arguments.joint)
    from friction_comp.ros.tool_client import ToolClient

    with ToolClient(patience=20.0) as ros, progress('playing') as show:
        if arguments.controller:
            ros.play_on(arguments.controller, trajectory,
                        lambda share, phase: show(share, f'playing: {phase}'))
        else:
            for index, joint in enumerate(trajectory.joints):
                def report(share: float, phase: str, k: int = index, name: str = joint) -> None:
                    show((k + share) / len(trajectory.joints), f'{name}: {phase}')
                ros.play(trajectory.of(joint), report)
    print(f'played {arguments.trajectory}: {", ".join(trajectory.joints)}')
    return 0
