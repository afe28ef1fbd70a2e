# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plans of all joints as one ``trajectory_msgs/JointTrajectory``, in the message's own layout."""

from __future__ import annotations

from collections.abc import Sequence
import json

import numpy as np

from friction_comp.excitation.plan import JointPlan


def trajectory_yaml(plans: Sequence[JointPlan], rate: float, remark: str) -> str:
    """Return the message as YAML, for ``ros2 topic pub`` or as part of an action's goal.

    Parameters
    ----------
    plans : sequence of JointPlan
        As long as each other.
    rate : float
        Points a second.
    remark : str
        Written above as a comment.
    """
    motions = [plan.samples(rate) for plan in plans]
    states = [np.column_stack([getattr(one, name) for one in motions])
              for name in ('position', 'velocity', 'acceleration')]
    names = ', '.join(json.dumps(plan.limits.joint, ensure_ascii=False) for plan in plans)
    lines = [*(f'# {line}' for line in remark.splitlines()),
             'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}',
             f'joint_names: [{names}]', 'points:']
    for time, position, velocity, acceleration in zip(motions[0].time, *states):
        whole, rest = divmod(round(1e9 * float(time)), 1_000_000_000)
        lines.append(
            f'- {{positions: {_row(position)}, velocities: {_row(velocity)}, accelerations: '
            f'{_row(acceleration)}, effort: [], time_from_start: '
            f'{{sec: {whole}, nanosec: {rest}}}}}')
    return '\n'.join(lines) + '\n'


def _row(values: np.ndarray) -> str:
    # With a point, since YAML would read a whole number as an integer.
    return f'[{", ".join(f"{value:.7f}" for value in values)}]'
