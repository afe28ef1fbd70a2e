# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads planned motions: tables of time and position without effort, and trajectories."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from friction_comp.columns import assign
from friction_comp.errors import errors_name, InputError
from friction_comp.layout import Layout
from friction_comp.recordings.storage import unreadable_on_error
from friction_comp.recordings.table_files import is_table, open_table
from friction_comp.samples import JointStates, Samples
from friction_comp.trajectory import Trajectory

# The name of a column that a plan does not have.
_EFFORT = 'effort'


def read_plan(path: Path, layout: Layout | None = None) -> dict[str, Samples] | None:
    """Return the planned motion of each joint by name; None if the file is not a plan.

    A plan is a JointTrajectory (.yaml), or a table in which time and position are found, but no
    effort and no current. Its samples have zero current, and the motion of all joints in `arm`.
    """
    if path.suffix.lower() in ('.yaml', '.yml'):
        trajectory = Trajectory.load(path)
        arm = JointStates(trajectory.joints, trajectory.position, trajectory.velocity)
        zero = np.zeros(len(trajectory.time))
        return {name: Samples(
            time=trajectory.time, position=arm.position[:, k], current=zero, joint=name,
            velocity=trajectory.velocity[:, k], acceleration=trajectory.acceleration[:, k],
            arm=arm) for k, name in enumerate(trajectory.joints)}
    if not path.is_file() or not is_table(path):
        return None
    with unreadable_on_error(path):
        table = open_table(path)
    with suppress(InputError):
        assign(table.names, layout, str(path))
        return None
    plans = []
    # A plan of the table's positions, or of its targets if it has none.
    for of_targets in (False, True):
        # Other faults are reported when the table is read as a recording.
        with suppress(InputError):
            plans.append(assign([*table.names, _EFFORT], layout, str(path), of_targets))
    if not plans:
        return None
    use = plans[0]
    wanted = [column.name for column in use.columns if column.name != _EFFORT]
    with unreadable_on_error(path):
        values = table.whole(wanted)
    time = use.signal_in(values, 'time', '')
    with errors_name(path):
        joints = {name: Samples.from_arrays(
            time, use.signal_in(values, 'position', name),
            current=np.zeros(len(values[wanted[0]])),
            velocity=use.signal_in(values, 'velocity', name), joint=name) for name in use.joints}
    length = {len(samples) for samples in joints.values()}
    if len(length) > 1:
        raise InputError(f'{path}: some joints lack a position in some rows')
    arm = JointStates(tuple(joints), np.column_stack([one.position for one in joints.values()]))
    return {name: samples.with_(arm=arm) for name, samples in joints.items()}
