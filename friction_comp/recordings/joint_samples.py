# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Turns a joint's raw signals into samples at the times of its joint states."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from friction_comp.checks import one_of
from friction_comp.errors import InputError
from friction_comp.facts.recorded import implausible, tidied
from friction_comp.recordings import time_base
from friction_comp.recordings.scan import Scan, signal_of, Track
from friction_comp.samples import JointStates, RecordingInfo, Samples
from friction_comp.tables.table_recording import TableRecording
from friction_comp.topics import TOPICS

# A joint whose position covers more, rad or m, moved.
_MOVED = 0.01
# Share of a signal's variance that may be its rounding, where it is a multiple of another.
_ROUNDED = 1e-4


def number_recordings(recordings: Iterable[tuple[Samples, RecordingInfo]]
                      ) -> list[tuple[Samples, RecordingInfo]]:
    """Return recordings with `recording` set to their index; InputError for several joints."""
    numbered: list[tuple[Samples, RecordingInfo]] = []
    for samples, info in recordings:
        first = numbered[0][1] if numbered else info
        if info.joint != first.joint:
            raise InputError(f'{info.path}: contains joint {info.joint!r}, but {first.path} '
                             f'contains {first.joint!r}: name one with --joint')
        numbered.append((samples.with_(recording=np.full(len(samples), len(numbered))), info))
    return numbered


def without_compensation(samples: Samples, info: RecordingInfo) -> Samples:
    """Return the samples during which no compensation law drove the motor; note what is left out.

    Under a law the current follows its model: without the load, it says nothing about friction.
    """
    begins = [begin for begin, _ in info.activity]
    active = np.array([False, *(activity.state == 'active' and activity.law not in ('', 'none')
                                for _, activity in info.activity)])
    compensated = active[np.searchsorted(begins, samples.time, 'right')]
    if not compensated.any():
        return samples
    info.notes.append(
        f'{100.0 * compensated.mean():.0f} % of the samples left out: a compensation law drove the '
        'motor, and without the load its current does not show the friction')
    return samples.take(~compensated)


def to_samples(scan: Scan | TableRecording, joint: str | None,
               torque_per_current: float) -> tuple[Samples, RecordingInfo]:
    """Interpolate one joint's signals to the times of its joint states.

    Raises InputError if the joint is missing or not named, or the values are impossible.
    """
    if isinstance(scan, TableRecording):
        return scan.samples(joint, torque_per_current)
    if scan.effort_is_current:
        torque_per_current = 1.0
    track, joint, joints, own = _select_joint(scan, joint)
    info = RecordingInfo(scan.path, joint, scan.topics, notes=list(scan.notes),
                         model=scan.model, effort_is_current=scan.effort_is_current,
                         linear=scan.linear)
    stamp = time_base.message_times(track, info.notes)
    position, velocity, effort = own.T[:3]
    for name, signal in (('position', position), ('effort', effort)):
        if not np.isfinite(signal).any():
            raise InputError(f'{scan.path}: {track.topic} contains no finite {name} of joint '
                             f'{joint!r}')
    finite = np.isfinite(position) & np.isfinite(effort)
    # Velocity may be empty; if it mostly is, it is ignored.
    if finite.any() and np.isfinite(velocity[finite]).mean() >= 0.5:
        finite &= np.isfinite(velocity)
    else:
        velocity = None
    far = time_base.far_off(stamp)
    usable = np.flatnonzero(finite & ~far)
    order = usable[time_base.rising(stamp[usable])]
    if not len(order):
        raise InputError(f'{scan.path}: {track.topic} never has position and effort of joint '
                         f'{joint!r} together, with a stamp near the others')
    alone = len(scan.joints) == 1
    for reason, count in (
            # Messages of other joints alone have no value of this one.
            ('not finite', np.count_nonzero(~finite & (np.isfinite(own).any(axis=1) | alone))),
            ('stamp far off', np.count_nonzero(finite & far)),
            ('stamp not later than those before, or after the clock was set back',
             len(usable) - len(order))):
        if count:
            info.notes.append(f'{count} joint states left out: {reason}')
    lost = scan.custom.get('messages_lost', '')
    if lost:
        info.notes.append(f'the recorder lost messages: {lost}')
    origin = int(stamp[order[0]])
    info.start = origin * 1e-9
    info.stamps = (stamp - origin) * 1e-9
    info.rows = order
    time = info.stamps[order]
    time_base.note_gaps(time, info.notes)
    base = time_base.TimeBase(stamp[order], track.receive[order], bool(track.stamp.any()),
                              info.notes)
    info.activity = [(base.to_state_time(activity.time) - info.start, activity.of(joint))
                     for activity in scan.activity]
    samples, kept = tidied(Samples(
        time=time, position=position[order], current=effort[order] / torque_per_current,
        velocity=None if velocity is None else velocity[order], joint=joint), info.notes)
    info.rows = order[kept]
    base.stamp, base.receive = base.stamp[kept], base.receive[kept]
    samples = samples.with_(**time_base.other_signals(
        scan.around(track.topic), joint, joints, base, torque_per_current, info.notes))
    if fault := implausible(samples, all(values is own for _, values in _moved(scan))):
        raise InputError(f'{scan.path}: ' + f'joint {joint!r}: ' * bool(joint) + fault)
    return samples, info


def usable_joints(scan: Scan | TableRecording, torque_per_current: Callable[[str], float],
                  notes: list[str] | None = None) -> dict[str, tuple[Samples, RecordingInfo]]:
    """Return every usable joint of a scan, and note the others; InputError if there is none."""
    read: dict[str, tuple[Samples, RecordingInfo]] = {}
    reason = None
    wanted: list[str | None] = [*scan.joints] or [None]
    for name in wanted:
        try:
            entry = to_samples(scan, name, torque_per_current(name or ''))
        except InputError as error:
            # An arm is usable even if, for instance, its gripper has no effort.
            reason = error
            if notes is not None:
                notes.append(f'left out: {error}')
            continue
        read[entry[1].joint] = entry
    if not read and reason:
        raise reason
    return read


def without_copies(joints: dict[str, tuple[Samples, RecordingInfo]], info: RecordingInfo
                   ) -> dict[str, tuple[Samples, RecordingInfo]]:
    """Return the joints without those that are the drive of `info` once more, and note them.

    Where a motor is logged on both sides of its gear, position and current of one side are
    multiples of those of the other.
    """
    own = joints[info.joint][0]
    copies = [name for name, (other, _) in joints.items() if name != info.joint and all(
        _is_multiple(getattr(other, signal), getattr(own, signal))
        for signal in ('position', 'current'))]
    if copies:
        info.notes.append(f'{", ".join(copies)}: position and effort are multiples of those of '
                          f'{info.joint}, so that they are the same drive and no other joint')
    return {name: entry for name, entry in joints.items() if name not in copies}


def _is_multiple(values: np.ndarray, of: np.ndarray) -> bool:
    """Return whether values, shape (N,), are a multiple of others, beside a constant."""
    return (len(values) == len(of) and np.ptp(values) > 0.0 < np.ptp(of)
            and bool(np.corrcoef(values, of)[0, 1] ** 2 > 1.0 - _ROUNDED))


def moved_without_effort(scan: Scan | TableRecording, joints: Iterable[str]) -> list[str]:
    """Return the names of joints that moved, but are not among the usable `joints`."""
    return [] if isinstance(scan, TableRecording) else sorted(
        {name for name, _ in _moved(scan)} - set(joints))


def joint_states_at(samples: Samples, info: RecordingInfo,
                    joints: dict[str, tuple[Samples, RecordingInfo]]) -> JointStates:
    """Return the motion of all `joints`, interpolated to the times of one joint's `samples`."""
    positions, speeds = [], []
    for other, other_info in joints.values():
        # Topics may begin at different times.
        time = samples.time + (info.start - other_info.start)
        positions.append(np.interp(time, other.time, other.position))
        if other.velocity is not None:
            speeds.append(np.interp(time, other.time, other.velocity))
    all_have_velocity = len(speeds) == len(positions)
    return JointStates(tuple(joints), np.column_stack(positions),
                       np.column_stack(speeds) if all_have_velocity else None)


def _moved(scan: Scan) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of every joint that moved."""
    for track in scan.of('joint_states'):
        for name, values in track.values.items():
            position = values[np.isfinite(values[:, 0]), 0]
            if len(position) and np.ptp(position) > _MOVED:
                yield name, values


def _select_joint(scan: Scan, joint: str | None) -> tuple[Track, str, list[str], np.ndarray]:
    """Return the joint's track, its name, the track's joints in order, and the joint's values.

    The only joint by default; raises InputError with the choices if it is not clear.
    """
    tracks = scan.of('joint_states')
    if not tracks:
        if any(signal_of(topic, kind) == 'joint_states' for topic, (kind, _) in
               scan.topics.items()):
            raise InputError(f'{scan.path}: its joint_states contain no message')
        wanted = TOPICS['joint_states']
        states = [topic for topic, (kind, _) in scan.topics.items() if kind == wanted]
        raise InputError(
            f'{scan.path}: no joint_states of type {wanted} in it '
            + (f'(of that type are {", ".join(sorted(states))}: name one, with its joint, as '
               '--joint /TOPIC/NAME)'
               if states else f'(topics: {", ".join(sorted(scan.topics)) or "none"})'))
    joints = scan.joints
    if not joints:
        raise InputError(f'{scan.path}: joint_states names no joint')
    # A single joint may have no name in the recording.
    key = '' if joints == [''] else one_of(joints if joint else scan.choices, joint, scan.path)
    joint = joint or key
    matching = [track for track in tracks if key in track.names]
    if len(matching) > 1:
        raise InputError(
            f'{scan.path}: joint {joint!r} is in several topics, name one with --joint: '
            f'{", ".join(f"{track.topic}/{joint}" for track in matching)}')
    track = matching[0]
    return track, joint, list(track.names) if key else [joint], track.values[key]
