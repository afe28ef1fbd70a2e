# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads long recordings piece by piece, in memory that does not grow with their length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from friction_comp.columns import Layout
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.recordings.clocks import gap_length, GAPS
from friction_comp.recordings.joint_motion import joint_states_at
from friction_comp.recordings.reader import (
    RecordingInfo,
    to_samples,
    usable_joints,
    with_states,
)
from friction_comp.recordings.scan import (
    AnyPath,
    find_recording,
    Progress,
    Scan,
    Scanner,
    Track,
)
from friction_comp.recordings.sources import open_scanner
from friction_comp.recordings.tables import TableScanner
from friction_comp.samples import Samples
from friction_comp.topics import TOPICS

# Other topics are read so many s past a stretch's end: a recorder may write them later.
_MARGIN = 2.0


def stream_recording_with_info(path: AnyPath, joint: str | None = None,
                               torque_constant: float = 1.0, gear_ratio: float = 1.0,
                               seconds: float = 60.0, signals: Sequence[str] = tuple(TOPICS),
                               layout: Layout | None = None, others: bool = False,
                               progress: Progress | None = None
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
    joint : str, optional
        Required if the recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n.
    seconds : float
        Length of a stretch, s.
    signals : sequence of str
        Topics to read besides ``joint_states``.
    layout : Layout, optional
        Known columns and units of a table.
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
    scanner = open_scanner(
        find_recording(path), with_states(signals), None if others else joint, layout)
    cutter = _StretchCutter(seconds)
    clock = _CommonClock()
    info, samples = None, None
    for scan, last in _scans(scanner, cutter):
        if last and info is not None and not scan.of('joint_states'):
            info.notes = list(scan.notes)
            break
        samples, info = to_samples(scan, joint, gain)
        if others and len(info.joints) > 1:
            samples = samples.with_(arm=joint_states_at(samples, info, usable_joints(scan)))
        if progress:
            progress(scanner.progress)
        # Gaps are counted over all stretches.
        info.notes = [note for note in info.notes if GAPS not in note]
        samples = clock.convert(samples, info)
        yield samples, info
    if info is not None and samples is not None:
        if clock.gaps:
            info.notes.append(f'{len(clock.gaps)}{GAPS}, the longest of {max(clock.gaps):.3g} s')
        yield samples.take(slice(0, 0)), info


def _scans(scanner: Scanner | TableScanner, cutter: _StretchCutter) -> Iterator[tuple[Scan, bool]]:
    """Yield the scan of each stretch, and whether it is the last."""
    for store in scanner.batches():
        if store.signal != 'joint_states':
            continue
        for other in scanner.stores.values():
            other.flush()
        scan = scanner.finish()
        cutter.add(scan)
        while (tracks := cutter.cut()) is not None:
            scan.tracks = tracks
            yield scan, False
    scan = scanner.finish()
    cutter.add(scan)
    while (tracks := cutter.cut()) is not None:
        scan.tracks = tracks
        yield scan, False
    scan.tracks = cutter.rest()
    yield scan, True


class _StretchCutter:
    """Collects tracks and cuts stretches off their beginning."""

    def __init__(self, seconds: float) -> None:
        self._length = round(seconds * 1e9)
        self._tracks: dict[str, Track] = {}

    def add(self, scan: Scan) -> None:
        for track in scan.tracks:
            before = self._tracks.get(track.topic)
            self._tracks[track.topic] = track if before is None else _concatenate(before, track)

    def cut(self) -> list[Track] | None:
        """Return the tracks of the next stretch; None until enough has been read."""
        states = [track for track in self._tracks.values() if _is_states(track)]
        if not states:
            return None
        times = states[0].receive - states[0].receive[0]
        if times.max() < self._length + round(_MARGIN * 1e9):
            return None
        size = int(np.argmax(times >= self._length))
        if not size:
            return None
        end = int(states[0].receive[size])
        stretch = []
        for topic, track in self._tracks.items():
            if _is_states(track):
                index = int(np.argmax(track.receive >= end)) if (track.receive >= end).any() \
                    else len(track.receive)
                stretch.append(_slice_track(track, slice(0, index)))
                self._tracks[topic] = _slice_track(track, slice(index, None))
                continue
            stretch.append(track)
            # Held and interpolated signals must begin before the next stretch.
            earlier = np.nonzero(track.receive < end - round(_MARGIN * 1e9))[0]
            if len(earlier):
                self._tracks[topic] = _slice_track(track, slice(int(earlier[-1]), None))
        return [track for track in stretch if len(track.receive)]

    def rest(self) -> list[Track]:
        return [track for track in self._tracks.values() if len(track.receive)]


def _is_states(track: Track) -> bool:
    return track.signal == 'joint_states'


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


def _concatenate(first: Track, second: Track) -> Track:
    size, more = len(first.receive), len(second.receive)
    values = {}
    for key in dict.fromkeys((*first.values, *second.values)):
        parts = [first.values.get(key), second.values.get(key)]
        width = max(part.shape[1] for part in parts if part is not None)
        full = np.full((size + more, width), np.nan)
        for start, part in zip((0, size), parts):
            if part is not None:
                full[start:start + len(part), :part.shape[1]] = part
        values[key] = full
    return Track(first.topic, first.signal, np.concatenate((first.receive, second.receive)),
                 np.concatenate((first.stamp, second.stamp)),
                 np.concatenate((first.order, second.order)),
                 list(dict.fromkeys((*first.names, *second.names))), values)


def _slice_track(track: Track, index: slice) -> Track:
    return Track(track.topic, track.signal, track.receive[index], track.stamp[index],
                 track.order[index], track.names,
                 {key: value[index] for key, value in track.values.items()})
