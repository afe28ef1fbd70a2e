# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings as samples: one joint's signals on the time base of its joint states."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from friction_comp.errors import InputError
from friction_comp.recordings.scan import find_recordings, scan_recording, signal_of, SIGNALS
from friction_comp.samples import Samples

# A clock that starts at zero reaches its second stamp within this time; only then is a leading
# stamp of zero a time and not an empty field.
_ZERO_IS_A_TIME = 1_000_000_000


@dataclass
class RecordingInfo:
    """What is known of one recording beyond its samples.

    Attributes
    ----------
    path : Path
    joint : str
        The joint that was read.
    joints : list of str
        Every joint that the recording's joint states name.
    topics : dict
        Topic name to (message type, number of messages).
    start : float
        Stamp of the samples' time zero in s.
    stamps : ndarray
        Time of every joint state in s since `start`, in the order received, shape (M,).
    rows : ndarray of int
        Which of those joint states the samples are, shape (N,).
    dropped : dict
        Why joint states were left out, with their number: 'not finite', 'duplicate stamp'.
    notes : list of str
        What a reader of the results should know about the recording, in plain words.
    model : str or None
        Model file that was active, where the recording says.
    """

    path: Path
    joint: str = ''
    joints: list = field(default_factory=list)
    topics: dict = field(default_factory=dict)
    start: float = 0.0
    stamps: np.ndarray | None = None
    rows: np.ndarray | None = None
    dropped: dict = field(default_factory=dict)
    notes: list = field(default_factory=list)
    model: str | None = None


def read_recording(paths, joint=None, torque_constant=1.0, gear_ratio=1.0, progress=None):
    """Read recordings of one joint.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, single .mcap files, or folders of recordings.
    joint : str, optional
        Name of the joint; needed where a recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n: current is effort / (k_t · n).
    progress : callable, optional
        Called with the share 0..1 of everything that has been read.

    Returns
    -------
    list of Samples
        One per recording, each with `recording` set to its number. Time counts from the
        recording's first joint state.

    Raises
    ------
    InputError
        If a path, the joint, or a recording cannot be used; the text names it and says why.
    """
    return [samples for samples, _ in read_recording_with_info(
        paths, joint, torque_constant, gear_ratio, progress=progress)]


def read_recording_with_info(paths, joint=None, torque_constant=1.0, gear_ratio=1.0,
                             signals=tuple(SIGNALS), progress=None):
    """Read recordings as `read_recording` does, each with its `RecordingInfo`.

    Parameters
    ----------
    paths, joint, torque_constant, gear_ratio, progress
        As for `read_recording`.
    signals : tuple of str
        Topics to read besides ``joint_states``.

    Returns
    -------
    list of (Samples, RecordingInfo)
    """
    for name, value in (('torque constant', torque_constant), ('gear ratio', gear_ratio)):
        if not np.isfinite(value) or value <= 0:
            raise InputError(f'{name} must be a positive number, not {value}')
    found = find_recordings(paths)
    signals = ('joint_states',) + tuple(s for s in signals if s != 'joint_states')
    results = []
    for number, path in enumerate(found):
        def report(share, number=number):
            if progress:
                progress((number + share) / len(found))
        scan = scan_recording(path, signals, report)
        samples, info = _to_samples(scan, joint, torque_constant * gear_ratio)
        if joint is None and results and info.joint != results[0][1].joint:
            raise InputError(
                f'{path}: holds joint {info.joint!r}, but {results[0][1].path} holds '
                f'{results[0][1].joint!r}: name one with --joint')
        samples = samples.with_(recording=np.full(len(samples), number))
        results.append((samples, info))
        report(1.0)
    return results


def _to_samples(scan, joint, torque_per_current):
    track, joint, joints = _choose(scan, joint)
    info = RecordingInfo(scan.path, joint, joints, scan.topics, model=scan.model)
    stamp = _clock(track.receive, track.stamp, info.notes)
    columns = track.values[joint].T
    position, velocity, effort = columns
    usable = np.isfinite(position) & np.isfinite(effort)
    _need(scan, track.topic, joint, position, effort)
    # Velocity may be left empty; a driver that fills it only now and then is no better.
    has_velocity = np.isfinite(velocity)
    if has_velocity[usable].mean() < 0.5:
        velocity = None
    else:
        usable &= has_velocity
    order, duplicates = _in_order(stamp, usable, info.notes)
    info.dropped = {reason: count for reason, count in (
        ('not finite', int(np.count_nonzero(~usable))), ('duplicate stamp', duplicates)) if count}
    for reason, count in info.dropped.items():
        info.notes.append(f'{count} joint states left out: {reason}')
    origin = int(stamp.min())
    info.start = origin * 1e-9
    info.stamps = (stamp - origin) * 1e-9
    info.rows = order
    samples = Samples(
        time=info.stamps[order], position=position[order],
        current=effort[order] / torque_per_current,
        velocity=None if velocity is None else velocity[order], joint=joint)
    base = _TimeBase(stamp[order], track.receive[order], bool(track.stamp.any()))
    return samples.with_(**_further(scan, joint, joints, base, info.notes)), info


def _choose(scan, joint):
    tracks = scan.of('joint_states')
    if not tracks:
        if any(signal_of(topic, kind) == 'joint_states' for topic, (kind, _) in
               scan.topics.items()):
            raise InputError(f'{scan.path}: its joint_states hold no message')
        raise InputError(
            f'{scan.path}: no joint_states of type sensor_msgs/msg/JointState in it (topics: '
            f'{", ".join(sorted(scan.topics)) or "none"})')
    joints = list(dict.fromkeys(name for track in tracks for name in track.values))
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
        tracks[0].values[joint] = tracks[0].values.pop('')
        joints = [joint]
    holding = [track for track in tracks if joint in track.values]
    if len(holding) > 1:
        raise InputError(
            f'{scan.path}: joint {joint!r} is in several topics: '
            f'{", ".join(track.topic for track in holding)}')
    return holding[0], joint, list(holding[0].values)


def _need(scan, topic, joint, position, effort):
    for name, values in (('position', position), ('effort', effort)):
        if not np.isfinite(values).any():
            raise InputError(f'{scan.path}: {topic} holds no finite {name} of joint {joint!r}')
    if not (np.isfinite(position) & np.isfinite(effort)).any():
        raise InputError(
            f'{scan.path}: {topic} never holds position and effort of joint {joint!r} together')


def _clock(receive, stamp, notes):
    """Return the time of each message in ns: its stamp, or the receive time where that is zero."""
    empty = stamp == 0
    if empty.all():
        notes.append('stamps are zero: receive times are used')
        return receive
    if not empty.any():
        if len(stamp) > 20 and len(np.unique(stamp)) < len(stamp) // 10:
            notes.append('stamps hardly change: receive times are used')
            return receive
        return stamp
    filled = np.nonzero(~empty)[0]
    if filled[0] > 0 and not empty[filled[0]:].any() and stamp[filled[0]] < _ZERO_IS_A_TIME:
        return stamp
    # Stamps may follow another clock than the receiver's, so receive times are carried over.
    notes.append(f'{np.count_nonzero(empty)} stamps are zero: receive times are used for them')
    offset = stamp[filled] - receive[filled]
    nearest = np.searchsorted(filled, np.nonzero(empty)[0]).clip(0, len(filled) - 1)
    repaired = stamp.copy()
    repaired[empty] = receive[empty] + offset[nearest]
    return repaired


def _in_order(stamp, usable, notes):
    """Return the usable rows in time order, the first of each stamp, and the number of others."""
    rows = np.nonzero(usable)[0]
    times = stamp[rows]
    if (np.diff(times) < 0).any():
        notes.append('joint states were out of order: sorted by time')
        order = np.argsort(times, kind='stable')
        rows, times = rows[order], times[order]
    fresh = np.concatenate(([True], np.diff(times) > 0))
    return rows[fresh], int(np.count_nonzero(~fresh))


@dataclass
class _TimeBase:
    """The joint states' times, to which all other signals are brought."""

    stamp: np.ndarray
    receive: np.ndarray
    stamped: bool

    def pair(self, track):
        """Return the times of the joint states and of another topic on one clock."""
        if self.stamped and track.stamp.any():
            return self.stamp, track.stamp
        return self.receive, track.receive

    def hold(self, track, values, before=0.0):
        """Return the last value at each joint state; `before` where there was none yet."""
        times, known = self.pair(track)
        good = np.isfinite(values)
        order = np.argsort(known[good], kind='stable')
        known, values = known[good][order], values[good][order]
        index = np.searchsorted(known, times, side='right') - 1
        return np.where(index >= 0, values[index.clip(0)] if len(values) else before, before)

    def interpolate(self, track, values):
        """Return the signal at each joint state, or None where it covers less than half of them.

        Beyond its ends the nearest value stands.
        """
        times, known = self.pair(track)
        good = np.isfinite(values)
        if not good.any():
            return None
        order = np.argsort(known[good], kind='stable')
        known, values = known[good][order], values[good][order]
        origin = times[0]
        covered = (times >= known[0]) & (times <= known[-1])
        if len(known) > 1 and covered.mean() < 0.5:
            return None
        return np.interp(times - origin, known - origin, values)


def _further(scan, joint, joints, base, notes):
    signals = {}
    reference = _of_joint(scan.of('reference'), joint, joints, notes)
    if reference is not None:
        track, values = reference
        for column, name in enumerate(('reference_position', 'reference_velocity')):
            if np.isfinite(values[:, column]).any():
                _put(signals, name, base.interpolate(track, values[:, column]), track, notes)
    for topic, name in (('interaction_wrench', 'load'), ('motor_temperature', 'temperature')):
        found = _of_joint(scan.of(topic), joint, joints, notes)
        if found is not None:
            _put(signals, name, base.interpolate(found[0], found[1][:, 0]), found[0], notes)
    order = _array_order(scan, joints)
    command = _of_array(scan.of('current_command'), joint, order, notes)
    if command is not None:
        signals['command'] = base.hold(*command)
    direction = _of_array(scan.of('direction'), joint, order, notes)
    if direction is not None:
        held = base.hold(*direction)
        # Anything else counts as 0 for the compensator too.
        signals['direction'] = np.where(np.isin(held, (-1.0, 1.0)), held, 0.0).astype(int)
    return signals


def _put(signals, name, values, track, notes):
    if values is None:
        notes.append(f'{track.topic} covers less than half of the recording: not used')
    else:
        signals[name] = values


def _of_joint(tracks, joint, joints, notes):
    """Return the track with a joint's (or frame's) values, or None."""
    for track in tracks:
        if joint in track.values:
            return track, track.values[joint]
    if len(tracks) == 1 and len(tracks[0].values) == 1 and len(joints) == 1:
        # One joint and one sensor: they belong together whatever the frame is called.
        (name, values), = tracks[0].values.items()
        if name:
            notes.append(f'{tracks[0].topic} of {name!r} is taken to be that of {joint!r}')
        return tracks[0], values
    if tracks:
        notes.append(f'{tracks[0].topic} says nothing about joint {joint!r}')
    return None


def _array_order(scan, joints):
    """Return candidate joint orders for arrays without names: the reference's, then the states'."""
    orders = [list(track.values) for track in scan.of('reference')]
    orders.append(joints)
    return orders


def _of_array(tracks, joint, orders, notes):
    for track in tracks:
        values = track.values['']
        for order in orders:
            if joint in order and len(order) == values.shape[1]:
                return track, values[:, order.index(joint)]
        notes.append(f'{track.topic} has {values.shape[1]} values, which fits no list of joints')
    return None


def inspect_recording(path):
    """Return what one recording holds without reading more than its joint states.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    RecordingInfo
        With path, joints, topics and model set.
    """
    scan = scan_recording(path, ('joint_states',))
    joints = list(dict.fromkeys(name for t in scan.of('joint_states') for name in t.values))
    return RecordingInfo(scan.path, '', joints, scan.topics, model=scan.model)
