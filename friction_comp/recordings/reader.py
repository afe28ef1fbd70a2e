# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads recordings as samples: one joint's signals at the times of its joint states."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path

import numpy as np

from friction_comp.columns import Layout
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.recordings import clocks
from friction_comp.recordings.activity import Activity
from friction_comp.recordings.joint_motion import joint_states_at, unwrapped
from friction_comp.recordings.plausible import check_plausible
from friction_comp.recordings.scan import (
    AnyPath,
    find_recording,
    find_recordings,
    Progress,
    Scan,
    signal_of,
    Track,
)
from friction_comp.recordings.sources import scan_recording
from friction_comp.recordings.time_base import further_signals, TimeBase
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS


@dataclass
class RecordingInfo:
    """Information on one recording beyond its samples.

    Attributes
    ----------
    path : Path
    joint : str
        The joint that was read.
    joints : list of str
        All joints in the recording's joint states.
    topics : dict
        Topic name to (message type, number of messages).
    start : float
        Stamp of the samples' time zero in s.
    stamps : ndarray
        Time of every joint state in s since `start`, in the order received, shape (M,).
    rows : ndarray of int
        Indices of the joint states used as samples, shape (N,).
    dropped : dict
        Number of joint states that were omitted, by reason: 'not finite', 'duplicate stamp', 'stamp
        far off'.
    notes : list of str
        Remarks on the recording for readers of the results.
    model : str or None
        Active model file, if recorded.
    activity : list of (float, Activity)
        The compensator's reported state, law and model, each with its begin in s since `start`;
        empty if not recorded.
    effort_is_current : bool
        Whether the effort is already the motor current in A, as a table may declare.
    """

    path: Path
    joint: str = ''
    joints: list[str] = field(default_factory=list)
    topics: dict[str, tuple[str, int]] = field(default_factory=dict)
    start: float = 0.0
    stamps: np.ndarray | None = None
    rows: np.ndarray | None = None
    dropped: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    model: str | None = None
    activity: list[tuple[float, Activity]] = field(default_factory=list)
    effort_is_current: bool = False

    def check_joint(self, other: RecordingInfo) -> None:
        """Raise InputError if another recording holds another joint."""
        if self.joint != other.joint:
            raise InputError(f'{self.path}: holds joint {self.joint!r}, but {other.path} holds '
                             f'{other.joint!r}: name one with --joint')


def read_recording(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                   torque_constant: float = 1.0, gear_ratio: float = 1.0,
                   progress: Progress | None = None,
                  layout: Layout | None = None) -> list[Samples]:
    """Read recordings of one joint.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, .mcap files, tables (CSV, Parquet, npz), or folders of recordings.
    joint : str, optional
        Name of the joint; needed where a recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n: current is effort / (k_t · n).
    progress : callable, optional
        Called with the share 0..1 of everything that has been read.
    layout : Layout, optional
        Known columns and units of a table; the others are inferred from the column names.

    Returns
    -------
    list of Samples
        One per recording, each with `recording` set to its index. Time starts at the recording's
        first joint state. If it holds other joints, `arm` is the motion of all.

    Raises
    ------
    InputError
        If a path, the joint, or a recording cannot be used; the text names it and says why.
    """
    return [samples for samples, _ in read_recording_with_info(
        paths, joint, torque_constant, gear_ratio, progress=progress, layout=layout)]


def read_recording_with_info(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                             torque_constant: float = 1.0, gear_ratio: float = 1.0,
                             signals: Sequence[str] = tuple(TOPICS),
                             progress: Progress | None = None, others: bool = True,
                             layout: Layout | None = None) -> list[tuple[Samples, RecordingInfo]]:
    """Read recordings as `read_recording` does, each with its `RecordingInfo`.

    Parameters
    ----------
    paths, joint, torque_constant, gear_ratio, progress
        As for `read_recording`.
    signals : sequence of str
        Topics to read besides ``joint_states``.
    others : bool
        Whether the samples contain the motion of all joints, as `arm`.
    layout : Layout, optional
        Known columns and units of a table.

    Returns
    -------
    list of (Samples, RecordingInfo)
    """
    torque_per_current = Drive(torque_constant, gear_ratio).torque_per_current
    recordings = find_recordings(paths)
    results: list[tuple[Samples, RecordingInfo]] = []
    for index, path in enumerate(recordings):
        def report(share: float, index: int = index) -> None:
            if progress:
                progress((index + share) / len(recordings))
        scan = scan_recording(path, with_states(signals), report,
                              None if others else joint, layout)
        samples, info = to_samples(scan, joint, torque_per_current)
        if others and len(info.joints) > 1:
            samples = samples.with_(arm=joint_states_at(samples, info, usable_joints(scan)))
        if results:
            info.check_joint(results[0][1])
        samples = samples.with_(recording=np.full(len(samples), index))
        results.append((samples, info))
        report(1.0)
    return results


def usable_joints(scan: Scan, torque_per_current: Callable[[str], float] = lambda joint: 1.0
                  ) -> dict[str, tuple[Samples, RecordingInfo]]:
    """Return every usable joint of a scan.

    Parameters
    ----------
    scan : Scan
    torque_per_current : callable
        k_t · n in N·m/A for a joint's name.

    Raises
    ------
    InputError
        If there is none.
    """
    names = list(dict.fromkeys(name for track in scan.of('joint_states') for name in track.names))
    read: dict[str, tuple[Samples, RecordingInfo]] = {}
    reason = None
    wanted: list[str | None] = [*names] or [None]
    for name in wanted:
        try:
            entry = to_samples(scan, name, torque_per_current(name or ''))
        except InputError as error:
            # An arm is usable even if, for instance, its gripper has no effort.
            reason = error
            continue
        read[entry[1].joint] = entry
    if not read and reason:
        raise reason
    return read


def with_states(signals: Sequence[str]) -> tuple[str, ...]:
    """Return the names of signals, joint states among them."""
    return ('joint_states', *(name for name in signals if name != 'joint_states'))


def read_joints(path: AnyPath, joints: Sequence[str] | None = None,
                drives: dict[str, tuple[float, float]] | None = None,
                signals: Sequence[str] = tuple(TOPICS),
                progress: Progress | None = None, layout: Layout | None = None,
                notes: list[str] | None = None) -> list[Samples]:
    """Read several joints of one recording on one time base.

    Parameters
    ----------
    path : path-like
        One recording.
    joints : sequence of str, optional
        In this order; all joints of the joint states when omitted.
    drives : dict, optional
        Joint to (k_t in N·m/A, n); (1, 1) for joints that are not in it.
    signals : sequence of str
        Topics to read besides ``joint_states``.
    progress : callable, optional
        Called with the share 0..1 that has been read.
    layout : Layout, optional
        Known columns and units of a table.
    notes : list of str, optional
        Receives remarks for readers of the results, without duplicates.

    Returns
    -------
    list of Samples
        One per joint, all with the same `time`: the joint states in which all joints are usable.

    Raises
    ------
    InputError
        If the recording or a joint cannot be used.
    """
    scan = scan_recording(find_recording(path), with_states(signals), progress, layout=layout)
    if joints is None:
        joints = list(dict.fromkeys(n for track in scan.of('joint_states') for n in track.names))
    if not joints:
        raise InputError(f'{path}: joint_states names no joint')
    read = []
    for joint in joints:
        constants = (drives or {}).get(joint, (1.0, 1.0))
        samples, info = to_samples(scan, joint, Drive(*constants).torque_per_current)
        read.append(samples)
        if notes is not None:
            notes.extend(note for note in info.notes if note not in notes)
    common = reduce(np.intersect1d, [samples.time for samples in read])
    if not len(common):
        raise InputError(f'{path}: the joints {", ".join(joints)} never have values together')
    return [samples.take(np.searchsorted(samples.time, common)) for samples in read]


def to_samples(scan: Scan, joint: str | None,
               torque_per_current: float) -> tuple[Samples, RecordingInfo]:
    """Interpolate one joint's signals to the times of its joint states.

    Parameters
    ----------
    scan : Scan
    joint : str, optional
        Needed where the scan has several.
    torque_per_current : float
        k_t · n in N·m/A.

    Returns
    -------
    Samples, RecordingInfo

    Raises
    ------
    InputError
        If the joint is missing, or its values are impossible.
    """
    if scan.effort_is_current:
        torque_per_current = 1.0
    track, joint, joints = _select_joint(scan, joint)
    info = RecordingInfo(scan.path, joint, joints, scan.topics, notes=list(scan.notes),
                         model=scan.model, effort_is_current=scan.effort_is_current)
    stamp = clocks.message_times(track, info.notes)
    stray = clocks.far_off(stamp)
    shifts = clocks.set_backs(stamp[~stray], track.order[~stray], track.receive[~stray],
                              info.notes)
    stamp = shifts.of(stamp, track.order)
    columns = track.values[joint].T
    position, velocity, effort = columns
    finite = np.isfinite(position) & np.isfinite(effort)
    _check_finite(scan, track.topic, joint, position, effort)
    # Velocity may be empty; one that is mostly empty is ignored.
    has_velocity = np.isfinite(velocity)
    if has_velocity[finite].mean() < 0.5:
        velocity = None
    else:
        finite &= has_velocity
    order, duplicates = _in_order(stamp, finite & ~stray, info.notes)
    info.dropped = {reason: count for reason, count in (
        ('not finite', int(np.count_nonzero(~finite))), ('duplicate stamp', duplicates),
        ('stamp far off', int(np.count_nonzero(finite & stray)))) if count}
    for reason, count in info.dropped.items():
        info.notes.append(f'{count} joint states left out: {reason}')
    lost = scan.custom.get('messages_lost', '')
    if lost:
        info.notes.append(f'the recorder lost messages: {lost}')
    origin = int(stamp[~stray].min())
    info.start = origin * 1e-9
    info.stamps = (stamp - origin) * 1e-9
    info.rows = order
    clocks.note_gaps(info.stamps[order], info.notes)
    base = TimeBase(stamp[order], track.receive[order], bool(track.stamp.any()), shifts)
    info.activity = [(base.moment(activity.time) - info.start, activity.of(joint))
                     for activity in scan.activity]
    time = info.stamps[order]
    samples = Samples(
        time=time, position=unwrapped(time, position[order], info.notes),
        current=effort[order] / torque_per_current,
        velocity=None if velocity is None else velocity[order], joint=joint)
    samples = samples.with_(**further_signals(
        scan, joint, joints, base, torque_per_current, info.notes))
    check_plausible(samples, str(scan.path), alone=not _others_moved(scan, joint))
    return samples, info


def _others_moved(scan: Scan, joint: str) -> bool:
    """Return whether another joint of the recording was moved."""
    positions = [values[np.isfinite(values[:, 0]), 0] for track in scan.of('joint_states')
              for name, values in track.values.items() if name != joint]
    return any(len(position) > 0 and np.ptp(position) > 0.01 for position in positions)


def _select_joint(scan: Scan, joint: str | None) -> tuple[Track, str, list[str]]:
    tracks = scan.of('joint_states')
    if not tracks:
        if any(signal_of(topic, kind) == 'joint_states' for topic, (kind, _) in
               scan.topics.items()):
            raise InputError(f'{scan.path}: its joint_states hold no message')
        raise InputError(
            f'{scan.path}: no joint_states of type sensor_msgs/msg/JointState in it (topics: '
            f'{", ".join(sorted(scan.topics)) or "none"})')
    joints = list(dict.fromkeys(name for track in tracks for name in track.names))
    if not joints:
        raise InputError(f'{scan.path}: joint_states names no joint')
    listed = ', '.join(repr(name) for name in joints)
    if joint is None:
        if len(joints) > 1:
            raise InputError(f'{scan.path}: several joints, name one with --joint: {listed}')
        joint = joints[0]
    elif joint not in joints:
        if joints != ['']:
            raise InputError(f'{scan.path}: no joint {joint!r} in it, but {listed}')
        tracks[0].values[joint] = tracks[0].values['']
        tracks[0].names[:] = joints = [joint]
    holding = [track for track in tracks if joint in track.names]
    if len(holding) > 1:
        raise InputError(
            f'{scan.path}: joint {joint!r} is in several topics: '
            f'{", ".join(track.topic for track in holding)}')
    return holding[0], joint, list(holding[0].names)


def _check_finite(scan: Scan, topic: str, joint: str, position: np.ndarray,
                  effort: np.ndarray) -> None:
    for name, values in (('position', position), ('effort', effort)):
        if not np.isfinite(values).any():
            raise InputError(f'{scan.path}: {topic} holds no finite {name} of joint {joint!r}')
    if not (np.isfinite(position) & np.isfinite(effort)).any():
        raise InputError(
            f'{scan.path}: {topic} never holds position and effort of joint {joint!r} together')


def _in_order(stamp: np.ndarray, usable: np.ndarray,
              notes: list[str]) -> tuple[np.ndarray, int]:
    """Return the usable rows in time order without duplicate stamps, and the number of these."""
    rows = np.nonzero(usable)[0]
    times = stamp[rows]
    if (np.diff(times) < 0).any():
        notes.append('joint states were out of order: sorted by time')
        order = np.argsort(times, kind='stable')
        rows, times = rows[order], times[order]
    fresh = np.concatenate(([True], np.diff(times) > 0))
    return rows[fresh], int(np.count_nonzero(~fresh))


def inspect_recording(path: AnyPath) -> RecordingInfo:
    """Return information on one recording, reading only its joint states.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    RecordingInfo
        With path, joints, topics and model set.
    """
    scan = scan_recording(path, ('joint_states',))
    joints = list(dict.fromkeys(name for t in scan.of('joint_states') for name in t.names))
    return RecordingInfo(scan.path, '', joints, scan.topics, notes=scan.notes, model=scan.model)
