# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings stretch by stretch, in memory that does not grow with their length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from friction_comp.errors import InputError
from friction_comp.recordings.clocks import gap_length, GAPS
from friction_comp.recordings.reader import effort_per_ampere, to_samples, with_states
from friction_comp.recordings.scan import (
    AnyPath,
    find_recordings,
    Scan,
    Scanner,
    SIGNALS,
    Track,
)
from friction_comp.samples import Samples

# s of other topics that are waited for behind a stretch's end: a recorder may write them later.
_MARGIN = 2.0


def stream_recording(path: AnyPath, joint: str | None = None, torque_constant: float = 1.0,
                     gear_ratio: float = 1.0, seconds: float = 60.0,
                     signals: Sequence[str] = tuple(SIGNALS),
                     notes: list[str] | None = None) -> Iterator[Samples]:
    """Read one joint of one recording stretch by stretch.

    The stretches together are what `read_recording` returns, except that a signal is interpolated
    and judged within each stretch: one that covers less than half of it is None there.

    Parameters
    ----------
    path : path-like
        One recording.
    joint : str, optional
        Needed where the recording has several.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n.
    seconds : float
        Length of a stretch.
    signals : sequence of str
        Topics to read besides ``joint_states``.
    notes : list of str, optional
        Gets what a reader of the results should know, each line once.

    Yields
    ------
    Samples
        Time goes on through all stretches, from the recording's first joint state.

    Raises
    ------
    InputError
        If the recording, the joint or a value cannot be used.
    """
    gain = effort_per_ampere(torque_constant, gear_ratio)
    if not seconds > 0:
        raise InputError(f'seconds must be positive, not {seconds}')
    found = find_recordings(path)
    if len(found) != 1:
        raise InputError(f'{path}: holds {len(found)} recordings, one is wanted')
    said: list[str] = [] if notes is None else notes
    scanner = Scanner(found[0], with_states(signals), joint)
    cutter = _Cutter(seconds)
    clock = _OneClock()
    for scan, last in _scans(scanner, cutter):
        if last and not scan.of('joint_states') and clock.any:
            _note(said, scan.notes)
            break
        samples, info = to_samples(scan, joint, gain)
        _note(said, info.notes)
        samples = clock.follow(samples, info.start, said)
        if len(samples):
            yield samples
    if clock.gaps:
        said.append(f'{len(clock.gaps)}{GAPS}, the longest of {max(clock.gaps):.3g} s')


def _note(said: list[str], notes: list[str]) -> None:
    # Gaps are counted over all stretches.
    said.extend(note for note in notes if note not in said and GAPS not in note)


def _scans(scanner: Scanner, cutter: _Cutter) -> Iterator[tuple[Scan, bool]]:
    """Yield what was read for each stretch, and whether it is the last."""
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


class _Cutter:
    """Keeps tracks that have been read and cuts stretches off their front."""

    def __init__(self, seconds: float) -> None:
        self._length = round(seconds * 1e9)
        self._tracks: dict[str, Track] = {}

    def add(self, scan: Scan) -> None:
        for track in scan.tracks:
            before = self._tracks.get(track.topic)
            self._tracks[track.topic] = track if before is None else _join(before, track)

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
                stretch.append(_part(track, slice(0, index)))
                self._tracks[topic] = _part(track, slice(index, None))
                continue
            stretch.append(track)
            # What holds on, or is interpolated, begins before the next stretch.
            earlier = np.nonzero(track.receive < end - round(_MARGIN * 1e9))[0]
            if len(earlier):
                self._tracks[topic] = _part(track, slice(int(earlier[-1]), None))
        return [track for track in stretch if len(track.receive)]

    def rest(self) -> list[Track]:
        return [track for track in self._tracks.values() if len(track.receive)]


def _is_states(track: Track) -> bool:
    return track.signal == 'joint_states'


class _OneClock:
    """Puts the stretches' times, each from its own beginning, onto one clock."""

    def __init__(self) -> None:
        self.any = False
        self.gaps: list[float] = []
        self._origin = self._last = 0.0

    def follow(self, samples: Samples, start: float, notes: list[str]) -> Samples:
        if not self.any:
            self.any, self._origin = True, start
        time = samples.time + (start - self._origin)
        if self._last > 0 and time[0] <= self._last:
            behind = self._last - time[0]
            if behind > 1.0:
                shift = behind + 10.0 * samples.sample_time
                self._origin -= shift
                time = time + shift
                notes.append(f'the clock was set back by {behind:.3g} s after {self._last:.3f} s: '
                             'what follows is put behind')
            else:
                fresh = time > self._last
                samples, time = samples.take(fresh), time[fresh]
        if len(time):
            steps = np.diff(time, prepend=self._last or time[0])
            self.gaps.extend(float(step) for step in steps[steps > gap_length(steps)])
            self._last = float(time[-1])
        return samples.with_(time=time)


def _join(first: Track, second: Track) -> Track:
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


def _part(track: Track, index: slice) -> Track:
    return Track(track.topic, track.signal, track.receive[index], track.stamp[index],
                 track.order[index], track.names,
                 {key: value[index] for key, value in track.values.items()})
