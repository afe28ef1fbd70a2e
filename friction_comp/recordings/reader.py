# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads recordings as samples: one joint's signals at the times of its joint states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.facts.timing import gap_length
from friction_comp.recordings import joint_samples, sources
from friction_comp.recordings.scan import Scan, Track
from friction_comp.recordings.sources import Progress
from friction_comp.recordings.storage import AnyPath
from friction_comp.recordings.time_base import GAPS
from friction_comp.samples import RecordingInfo, Samples
from friction_comp.tables.columns import Layout
from friction_comp.tables.table_recording import TableRecording

# Other topics are read this far beyond the end of a stretch, ns: a recorder may write them later.
_MARGIN = 2_000_000_000


def read_recording(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                   torque_constant: float = 1.0, gear_ratio: float = 1.0,
                   progress: Progress | None = None, layout: Layout | None = None
                   ) -> list[Samples]:
    """Read recordings of one joint.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, .mcap files, tables (CSV, Parquet, npz), or folders of recordings that are
        no tables.
    joint : str, optional
        Name of the joint; required if a recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n: current is effort / (k_t · n).
    progress : callable, optional
        Called with the share 0..1 of all recordings that has been read.
    layout : Layout, optional
        Known columns and units of a table, of which others are inferred from the names; or units
        of position, velocity and effort in joint states.

    Returns
    -------
    list of Samples
        One per recording, each with `recording` set to its index. Time starts at the recording's
        first joint state. If a recording has several joints, `arm` is the motion of all.

    Raises
    ------
    InputError
        If a path, the joint, or a recording cannot be used; the text names it and says why.
    """
    return [samples for samples, _ in read_recording_with_info(
        paths, joint, Drive(torque_constant, gear_ratio).torque_per_current, progress, layout)]


def read_recording_with_info(paths: AnyPath | Sequence[AnyPath], joint: str | None = None,
                             torque_per_current: float = 1.0, progress: Progress | None = None,
                             layout: Layout | None = None, others: bool = True
                             ) -> list[tuple[Samples, RecordingInfo]]:
    """Read recordings as `read_recording` does, each with its `RecordingInfo`.

    `torque_per_current` is k_t · n in N·m/A. The motion of all joints is added as `arm` unless
    `others` is false.
    """
    return joint_samples.number_recordings(
        _read_joint(scan, joint, torque_per_current, others)
        for scan in _scan_all(paths, progress, joint, layout, others))


def _read_joint(scan: Scan | TableRecording, joint: str | None, torque_per_current: float,
                others: bool) -> tuple[Samples, RecordingInfo]:
    scan, joint = scan.chosen(joint)
    samples, info = joint_samples.to_samples(scan, joint, torque_per_current)
    if others and len(scan.joints) > 1:
        joints = joint_samples.usable_joints(scan, lambda joint: 1.0)
        samples = samples.with_(arm=joint_samples.joint_states_at(
            samples, info, joint_samples.without_copies(joints, info)))
        idle = joint_samples.moved_without_effort(scan, joints)
        info.notes += [f'the motion of {", ".join(idle)} is left out: no effort belongs to it'] \
            if idle else []
    return samples, info


def read_arm(paths: AnyPath | Sequence[AnyPath],
             torque_per_current: Callable[[str], float] = lambda joint: 1.0,
             progress: Progress | None = None, layout: Layout | None = None
             ) -> dict[str, list[tuple[Samples, RecordingInfo]]]:
    """Read every joint with an effort, as `read_recording` does: an entry for each recording.

    `torque_per_current` returns k_t · n in N·m/A for a joint's name. The samples have the motion of
    all joints as `arm`. Raises InputError if a recording cannot be used, or their joints differ.
    """
    result: dict[str, list[tuple[Samples, RecordingInfo]]] = {}
    for index, scan in enumerate(_scan_all(paths, progress, None, layout)):
        joints = joint_samples.usable_joints(scan, torque_per_current)
        if result and set(joints) != set(result):
            name = sorted(set(joints) ^ set(result))[0]
            raise InputError(f'{scan.path}: joint {name!r} is not in all recordings: an arm needs '
                             'the same joints in each')
        for name, (samples, info) in joints.items():
            samples = samples.with_(recording=np.full(len(samples), index),
                                    arm=joint_samples.joint_states_at(samples, info, joints))
            result.setdefault(name, []).append((samples, info))
    return result


def read_joints(path: AnyPath, joint: str | None = None, progress: Progress | None = None,
                layout: Layout | None = None) -> tuple[list[Samples], RecordingInfo]:
    """Read one or all usable joints of one recording at the times at which all are usable.

    `current` is the effort in N·m, as with k_t = n = 1; the information is that of the first joint,
    with the notes on all. Raises InputError if the recording or a joint cannot be used.
    """
    scan, = _scan_all(sources.find_recording(path), progress, joint, layout)
    scan, joint = scan.chosen(joint)
    notes: list[str] = []
    read = ([joint_samples.to_samples(scan, joint, 1.0)] if joint is not None else
            [*joint_samples.usable_joints(scan, lambda joint: 1.0, notes).values()])
    first = read[0][1]
    # In µs since the first joint's start: joints of several topics may begin at different times.
    times = [np.round(1e6 * (samples.time + (info.start - first.start))) for samples, info in read]
    common = reduce(np.intersect1d, times)
    if not len(common):
        raise InputError(f'{path}: the joints {", ".join(scan.joints)} never have values together')
    joints = [samples.take(np.searchsorted(time, common))
              for (samples, _), time in zip(read, times)]
    first.notes = list(dict.fromkeys([*notes, *(note for _, info in read for note in info.notes)]))
    return [samples.with_(time=joints[0].time) for samples in joints], first


def _scan_all(paths: AnyPath | Sequence[AnyPath], progress: Progress | None, joint: str | None,
              layout: Layout | None, others: bool = True) -> Iterator[Scan | TableRecording]:
    """Yield the scan of each recording, and report the progress of all."""
    recordings = sources.find_recordings(paths)
    for index, path in enumerate(recordings):
        report = sources.part_of(progress, index, len(recordings))
        own = layout and layout.of_recording(index, len(recordings))
        scanner = sources.open_scanner(path, joint, own, others)
        if isinstance(scanner, TableRecording):
            yield scanner
            report(1.0)
            continue
        parts: dict[str, list[Track]] = {}
        for scan in scanner.scans():
            for track in scan.tracks:
                parts.setdefault(track.topic, []).append(track)
            report(scanner.progress)
        yield replace(scan, tracks=[Track.concatenate(tracks) for tracks in parts.values()])
        report(1.0)


def stream_recording_with_info(path: AnyPath, joint: str | None = None,
                               torque_per_current: float = 1.0, seconds: float = 60.0,
                               progress: Progress | None = None, layout: Layout | None = None,
                               others: bool = False) -> Iterator[tuple[Samples, RecordingInfo]]:
    """Read one joint of one recording in stretches of some seconds, each with its `RecordingInfo`.

    Concatenated, the stretches equal the result of `read_recording_with_info`, except that signals
    are interpolated and checked within each: a signal that covers less than half of a stretch is
    None there. The last item has no samples, but the notes on the whole recording. Raises
    InputError if the recording, the joint or a value cannot be used.
    """
    scanner = sources.open_scanner(sources.find_recording(path), joint, layout, others)
    if isinstance(scanner, TableRecording):
        # It is bounded, and read as a whole.
        whole, about = _read_joint(scanner, joint, torque_per_current, others)
        if progress:
            progress(1.0)
        yield whole, about
        yield whole.take(slice(0, 0)), about
        return
    clock, turns = _CommonClock(), _Turns()
    info = None
    for scan in _stretches(scanner.scans(), round(seconds * 1e9)):
        if info is not None and not scan.of('joint_states'):
            info.notes = list(scan.notes)
            break
        samples, info = _read_joint(scan, joint, torque_per_current, others)
        if progress:
            progress(scanner.progress)
        # Gaps are counted over all stretches.
        info.notes = [note for note in info.notes if GAPS not in note]
        samples = turns.continued(clock.convert(samples, info), info)
        yield samples, info
    assert info is not None
    if clock.gaps:
        info.notes.append(f'{len(clock.gaps)}{GAPS}, the longest of {max(clock.gaps):.3g} s')
    yield samples.take(slice(0, 0)), info


def _stretches(scans: Iterator[Scan], length: int) -> Iterator[Scan]:
    """Yield stretches of `length` ns; the last contains the rest, perhaps without joint states."""
    tracks: dict[str, Track] = {}
    for scan in scans:
        for track in scan.tracks:
            before = tracks.get(track.topic)
            tracks[track.topic] = Track.concatenate([before, track] if before else [track])
        while stretch := _next_stretch(tracks, length):
            yield replace(scan, tracks=stretch)
    yield replace(scan, tracks=[track for track in tracks.values() if len(track)])


def _next_stretch(tracks: dict[str, Track], length: int) -> list[Track]:
    """Remove the next stretch from the tracks and return it; empty until enough has been read."""
    states = next((track for track in tracks.values() if track.signal == 'joint_states'), None)
    if states is None or not len(states):
        return []
    times = states.receive - states.receive[0]
    size = int(np.argmax(times >= length))
    if not size or times.max() < length + _MARGIN:
        return []
    end = int(states.receive[size])
    stretch = []
    for topic, track in tracks.items():
        late = track.receive >= end
        if track.signal == 'joint_states':
            size = int(np.argmax(late)) if late.any() else len(track)
            stretch.append(track.take(slice(0, size)))
            tracks[topic] = track.take(slice(size, None))
        else:
            stretch.append(track)
            # Keep what signals need to have a value at the beginning of the next stretch.
            earlier = np.flatnonzero(track.receive < end - _MARGIN)
            tracks[topic] = track.take(slice(int(earlier[-1]) if len(earlier) else 0, None))
    return [track for track in stretch if len(track)]


class _CommonClock:
    """Converts times of all stretches to s since the first began; collects lengths of gaps, s."""

    def __init__(self) -> None:
        self.gaps: list[float] = []
        self._origin: float | None = None
        self._last = 0.0

    def convert(self, samples: Samples, info: RecordingInfo) -> Samples:
        """Return the next stretch with converted times, and convert those of its info."""
        if self._origin is None:
            self._origin = info.start
        offset = info.start - self._origin
        time = samples.time + offset
        if self._last > 0 and time[0] <= self._last:
            set_back = self._last - time[0]
            if set_back > 1.0:
                shift = set_back + 10.0 * samples.sample_time
                self._origin -= shift
                offset, time = offset + shift, time + shift
                info.notes.append(f'the clock was set back by {set_back:.3g} s after '
                                  f'{self._last:.3f} s: later times are shifted')
            else:
                fresh = time > self._last
                samples, time = samples.take(fresh), time[fresh]
        if len(time):
            steps = np.diff(time, prepend=self._last or time[0])
            self.gaps.extend(float(step) for step in steps[steps > gap_length(steps)])
            self._last = float(time[-1])
        info.start = self._origin
        info.activity = [(begin + offset, activity) for begin, activity in info.activity]
        return samples.with_(time=time)


class _Turns:
    """Continues a wrapped angle across stretches, within each of which it was unwrapped."""

    def __init__(self) -> None:
        self._offset = 0.0
        self._last: tuple[float, float] | None = None  # time (s) and position of the last sample

    def continued(self, samples: Samples, info: RecordingInfo) -> Samples:
        """Return the next stretch, with the turns of those before it."""
        if not len(samples):
            return samples
        position = samples.position + self._offset
        # As within a stretch, only a jump between neighbours is a wrapped angle.
        if self._last is not None and samples.time[0] - self._last[0] <= gap_length(
                np.diff(samples.time)):
            turns = 2.0 * np.pi * round((position[0] - self._last[1]) / (2.0 * np.pi))
            self._offset, position = self._offset - turns, position - turns
        self._offset += info.turns
        self._last = float(samples.time[-1]), float(position[-1])
        return samples.with_(position=position)
