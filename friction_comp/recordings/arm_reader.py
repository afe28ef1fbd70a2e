# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings of several joints: each joint's samples, with the motion of the others beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike

import numpy as np

from friction_comp.errors import InputError
from friction_comp.recordings.reader import RecordingInfo, to_samples
from friction_comp.recordings.scan import find_recordings, Scan, scan_recording, SIGNALS
from friction_comp.samples import JointStates, Samples

AnyPath = str | PathLike[str]


def read_arm(paths: AnyPath | Sequence[AnyPath],
             torque_per_current: Callable[[str], float] | float = 1.0,
             progress: Callable[[float], None] | None = None,
             joints: Sequence[str] | None = None
             ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Read every joint of recordings.

    Parameters
    ----------
    paths : path-like or list of path-like
        As for `read_recording`.
    torque_per_current : float or callable
        k_t · n in N·m/A, or what gives it for a joint's name.
    progress : callable, optional
        Called with the share 0..1 of everything that has been read.
    joints : sequence of str, optional
        Joints whose samples are wanted; all that have an effort when omitted.

    Returns
    -------
    dict of str to list of (Samples, RecordingInfo)
        For each joint one entry per recording. The samples' `arm` holds the positions of all
        joints that move or stand beside it, at the times of its own joint states.

    Raises
    ------
    InputError
        If a recording or a wanted joint cannot be used, or recordings hold different joints.
    """
    result: dict[str, list[tuple[Samples, RecordingInfo]]] = {}
    found = find_recordings(paths)
    for number, path in enumerate(found):
        def report(share: float, number: int = number) -> None:
            if progress:
                progress((number + share) / len(found))
        scan = scan_recording(path, ('joint_states', *SIGNALS), report)
        read = _read(scan, torque_per_current, joints)
        if result and set(read) != set(result):
            odd = sorted(set(read) ^ set(result))[0]
            raise InputError(f'{path}: joint {odd!r} is not in all recordings: an arm needs the '
                             'same joints in each')
        for name, (samples, info) in read.items():
            samples = samples.with_(recording=np.full(len(samples), number))
            result.setdefault(name, []).append((samples, info))
    return result


def _read(scan: Scan, torque_per_current: Callable[[str], float] | float,
          wanted: Sequence[str] | None) -> dict[str, tuple[Samples, RecordingInfo]]:
    names = list(dict.fromkeys(
        name for track in scan.of('joint_states') for name in track.values))
    read: dict[str, tuple[Samples, RecordingInfo]] = {}
    reason: InputError | None = None
    for name in names or [None]:
        each = torque_per_current(name) if callable(torque_per_current) else torque_per_current
        try:
            samples, info = to_samples(scan, name, each)
        except InputError as error:
            # A gripper without effort is no reason to refuse the arm.
            reason = error
            continue
        read[samples.joint] = samples, info
    if not read and reason:
        raise reason
    for name in wanted or ():
        if name not in read:
            raise reason or InputError(f'{scan.path}: no joint {name!r} in it, but '
                                       f'{", ".join(map(repr, read))}')
    if len(read) > 1:
        everyone = dict(read)
        read = {name: (samples.with_(arm=_beside(samples, info, everyone)), info)
                for name, (samples, info) in read.items()}
    return {name: entry for name, entry in read.items() if wanted is None or name in wanted}


def _beside(samples: Samples, info: RecordingInfo,
            everyone: dict[str, tuple[Samples, RecordingInfo]]) -> JointStates:
    """Return the motion of all joints at the times of one of them."""
    places, speeds = [], []
    for other, other_info in everyone.values():
        # Topics may begin at different times.
        time = samples.time + (info.start - other_info.start)
        places.append(np.interp(time, other.time, other.position))
        speeds.append(None if other.velocity is None
                      else np.interp(time, other.time, other.velocity))
    known = all(speed is not None for speed in speeds)
    return JointStates(tuple(everyone), np.column_stack(places),
                       np.column_stack(speeds) if known else None)

