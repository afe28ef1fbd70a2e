# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads long recordings piece by piece, in memory that does not grow with their length."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from friction_comp.columns import Layout
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.recordings.clocks import gap_length, GAPS
from friction_comp.recordings.joint_samples import RecordingInfo, to_samples, with_arm
from friction_comp.recordings.sources import find_recording, open_scanner, Progress
from friction_comp.recordings.storage import AnyPath
from friction_comp.recordings.tracks import Scan, Track
from friction_comp.samples import Samples

# Other topics are read so many ns past a stretch's end: a recorder may write them later.
_MARGIN = 2_000_000_000


def stream_recording_with_info(path: AnyPath, joint: str | None = None,
                               torque_constant: float = 1.0, gear_ratio: float = 1.0,
                               seconds: float = 60.0, layout: Layout | None = None,
                               others: bool = False, progress: Progress | None = None
                               ) -> Iterator[tuple[Samples, RecordingInfo]]:
    """Read one joint of one recording in stretches, each with its `RecordingInfo`.

    Concatenated, the stretches are what `read_recording` returns, except that signals are
    interpolated and checked within each stretch: a signal that covers less than half of a stretch
    is None there. Time starts at the recording's first joint state. The last item has no samples,
    but the notes on the whole recording, such as gaps or a truncated file.

    Parameters
    ----------
    path : path-like
        One recording.
    joint, torque_constant, gear_ratio, layout
        As for `read_recording`.
    seconds : float
        Length of a stretch, s.
    others : bool
        Whether the samples contain the motion of all joints, as `arm`.
    progress : callable, optional
        Called with the share 0..1 of the recording that has been read.

    Yields
    ------
    Samples, RecordingInfo

    Raises
    ------
    InputError
        If the recording, the joint or a value cannot be used.
    """
    gain = Drive(torque_constant, gear_ratio).torque_per_current
    if not seconds > 0:
        raise InputError(f'seconds must be positive, not {seconds}')
    scanner = open_scanner(find_recording(path), None if others else joint, layout)
    clock = _CommonClock()
    info = None
    for scan in _stretches(scanner.scans(), round(seconds * 1e9)):
        if info is not None and not scan.of('joint_states'):
            info.notes = list(scan.notes)
            break
        samples, info = to_samples(scan, joint, gain)
        if others:
            samples = with_arm(samples, info, scan)
        if progress:
            progress(scanner.progress)
        # Gaps are counted over all stretches.
        info.notes = [note for note in info.notes if GAPS not in note]
        samples = clock.convert(samples, info)
        yield samples, info
    assert info is not None
    if clock.gaps:
        info.notes.append(f'{len(clock.gaps)}{GAPS}, the longest of {max(clock.gaps):.3g} s')
    yield samples.take(slice(0, 0)), info


def _stretches(scans: Iterator[Scan], length: int) -> Iterator[Scan]:
    """Yield stretches of a length in ns; the rest comes last, with or without joint states."""
    tracks: dict[str, Track] = {}
    for scan in scans:
        for track in scan.tracks:
            before = tracks.get(track.topic)
            tracks[track.topic] = Track.concatenate([before, track] if before else [track])
        while stretch := _cut(tracks, length):
            yield replace(scan, tracks=stretch)
    yield replace(scan, tracks=[track for track in tracks.values() if len(track)])


def _cut(tracks: dict[str, Track], length: int) -> list[Track]:
    """Take the next stretch off the tracks; empty until enough has been read."""
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
            # Held and interpolated signals must begin before the next stretch.
            earlier = np.flatnonzero(track.receive < end - _MARGIN)
            tracks[topic] = track.take(slice(int(earlier[-1]) if len(earlier) else 0, None))
    return [track for track in stretch if len(track)]


class _CommonClock:
    """Converts the times of stretches to the clock of the first."""

    def __init__(self) -> None:
        self.gaps: list[float] = []
        self._origin: float | None = None
        self._last = 0.0

    def convert(self, samples: Samples, info: RecordingInfo) -> Samples:
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
        info.activity = [(moment + offset, activity) for moment, activity in info.activity]
        return samples.with_(time=time)
