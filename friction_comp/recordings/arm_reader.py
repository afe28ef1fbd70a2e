# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads recordings of several joints: each joint's samples with the motion of the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from friction_comp.columns import Layout
from friction_comp.errors import InputError
from friction_comp.recordings.joint_motion import joint_states_at
from friction_comp.recordings.reader import (
    RecordingInfo,
    usable_joints,
    with_states,
)
from friction_comp.recordings.scan import AnyPath, find_recordings
from friction_comp.recordings.sources import scan_recording
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS


def read_arm(paths: AnyPath | Sequence[AnyPath],
             torque_per_current: Callable[[str], float] = lambda joint: 1.0,
             progress: Callable[[float], None] | None = None, layout: Layout | None = None
             ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Read every joint of recordings.

    Parameters
    ----------
    paths : path-like or list of path-like
        As for `read_recording`.
    torque_per_current : callable
        k_t · n in N·m/A for a joint's name.
    progress : callable, optional
        Called with the share 0..1 of everything that has been read.
    layout : Layout, optional
        Known columns and units of a table.

    Returns
    -------
    dict of str to list of (Samples, RecordingInfo)
        For each joint with an effort, one entry per recording. The samples' `arm` is the motion of
        all joints at the times of this joint's states.

    Raises
    ------
    InputError
        If a recording cannot be used, or recordings hold different joints.
    """
    result: dict[str, list[tuple[Samples, RecordingInfo]]] = {}
    recordings = find_recordings(paths)
    for index, path in enumerate(recordings):
        def report(share: float, index: int = index) -> None:
            if progress:
                progress((index + share) / len(recordings))
        scan = scan_recording(path, with_states(tuple(TOPICS)), report, layout=layout)
        joints = usable_joints(scan, torque_per_current)
        if result and set(joints) != set(result):
            name = sorted(set(joints) ^ set(result))[0]
            raise InputError(f'{path}: joint {name!r} is not in all recordings: an arm needs the '
                             'same joints in each')
        for name, (samples, info) in joints.items():
            samples = samples.with_(recording=np.full(len(samples), index),
                                    arm=joint_states_at(samples, info, joints))
            result.setdefault(name, []).append((samples, info))
    return result
