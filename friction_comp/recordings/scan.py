# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a bag as arrays: a track for each topic, and what a compensator reported.

Messages of a topic mostly have one layout: the same names and lengths, and numbers at the same
places. It is found once, and the numbers of all that share it are taken at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, replace
import math
from pathlib import Path
import re
import struct
from typing import NamedTuple

import numpy as np

from friction_comp.errors import os_errors_name
from friction_comp.messages import NANO, TOPICS, TORQUE_UNIT
from friction_comp.recordings.storage import Storage, unpack
from friction_comp.tables.columns import STATES

_DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# Joint states with any interfaces, as ros2_control's joint_state_broadcaster publishes them: used
# where the usual ones have no effort.
_DYNAMIC = 'dynamic_joint_states'
# Column of a track by the name of an interface.
_INTERFACES = {'position': 0, 'velocity': 1, 'effort': 2, 'torque': 2, 'current': 3,
               'temperature': 4, 'motor_temperature': 4}
_EFFORT, _CURRENT, _TEMPERATURE = 2, 3, 4
# Message type of each signal that is read.
_TYPES = {**TOPICS, _DYNAMIC: 'control_msgs/msg/DynamicJointState'}
# Most joints, or values of a joint, in one message: a corrupt one could fill the memory.
_MOST_NAMES = 200
# Messages that are turned into arrays at once, and most numbers of one topic that are kept.
_BATCH, _MOST = 5_000, 50_000_000


# Messages.

class _Cdr:
    """Reads along a message in the serialisation of DDS, and keeps where its layout stands."""

    def __init__(self, raw: bytes) -> None:
        self.raw, self.at = raw, 4
        self.order = '<' if raw[1] & 1 else '>'
        self.fixed = [*range(4)]    # places of the bytes that say what the others mean

    def place(self, size: int, count: int = 1) -> int:
        """Return where numbers of a size begin, and go to their end; ValueError without them."""
        begin = self.at + (4 - self.at) % size
        self.at = begin + size * count
        if self.at > len(self.raw):
            raise ValueError
        return begin

    def count(self) -> int:
        """Return the number of entries that follow."""
        begin = self.place(4)
        self.fixed.extend(range(begin, self.at))
        return int(struct.unpack_from(f'{self.order}I', self.raw, begin)[0])

    def text(self) -> str:
        """Return a text."""
        begin = self.place(1, self.count())
        self.fixed.extend(range(begin, self.at))
        return self.raw[begin:self.at - 1].decode()

    def texts(self) -> list[str]:
        """Return a list of texts."""
        return [self.text() for _ in range(self.count())]

    def numbers(self, size: int = 8) -> range:
        """Return where the numbers of a list stand."""
        count = self.count()
        begin = self.place(size, count) if count else self.at
        return range(begin, self.at, size)


class _Layout(NamedTuple):
    """What the bytes of a message mean."""

    numbers: list[tuple[str, int, int]]     # joint or frame, column, and place
    stamped: bool
    dtype: np.dtype     # of the whole message: its numbers in this order, and its stamp
    fixed: np.ndarray   # places of the bytes that all messages of this layout share


def _layout(raw: bytes, signal: str) -> _Layout:
    """Return the layout of a message; raises an error if it makes no sense."""
    cdr, stamp, kind = _Cdr(raw), dict[str, tuple[str, int]](), 'f8'
    if signal in ('current_command', 'direction'):
        labels = [(cdr.text(), cdr.place(4, 2))[0] for _ in range(cdr.count())]
        cdr.place(4)
        kind = 'i1' if signal == 'direction' else 'f8'
        unit = TORQUE_UNIT * (labels[1:2] == [TORQUE_UNIT])
        found = [(f'{unit}{k}', 0, at) for k, at in enumerate(cdr.numbers(int(kind[1])))]
    else:
        second = cdr.place(4, 2)
        stamp, frame = {'sec': ('i4', second), 'nanosec': ('u4', second + 4)}, cdr.text()
        if signal == 'interaction_wrench':
            found = [(frame, 0, cdr.place(8, 6) + 40)]
        elif signal == 'motor_temperature':
            found = [(frame, 0, cdr.place(8, 2))]
        elif signal == _DYNAMIC:
            joints = cdr.texts()
            found = [(joint, _INTERFACES[name], at) for joint in joints[:cdr.count()]
                     for name, at in zip(cdr.texts(), cdr.numbers()) if name in _INTERFACES]
        else:
            # A single joint may have no name.
            joints = cdr.texts() or ['']
            found = [(joint, column, at) for column in range(len(STATES))
                     for joint, at in zip(joints, cdr.numbers())]
    if len({name for name, _, _ in found}) > _MOST_NAMES or len(raw) - cdr.at > 3:
        raise ValueError
    fields = {**{str(k): (kind, at) for k, (_, _, at) in enumerate(found)}, **stamp}
    return _Layout(found, bool(stamp), np.dtype({
        'names': [*fields], 'formats': [cdr.order + form for form, _ in fields.values()],
        'offsets': [at for _, at in fields.values()], 'itemsize': len(raw)}), np.array(cdr.fixed))


@dataclass
class Track:
    """One topic's messages in the order of the file."""

    topic: str
    signal: str
    receive: np.ndarray  # (N,) of int64: ns
    stamp: np.ndarray  # (N,) of int64: ns, 0 throughout where the message has none
    # Arrays (N, columns) by joint or frame, NaN where a message has none. Of joint states:
    # position, velocity and effort, of dynamic ones also current and temperature. Arrays have no
    # joints, but numbers from 0; commands in N·m have `TORQUE_UNIT` before it.
    values: dict[str, np.ndarray]


class _Reader:
    """Collects the messages of a topic."""

    def __init__(self, topic: str, signal: str) -> None:
        self.topic, self.signal = topic, signal
        self.count = self.broken = self.numbers = 0     # messages, and numbers in them
        self.width = {'joint_states': 3, 'direction_stamped': 3, 'reference': 3, _DYNAMIC: 5}.get(
            signal, 1)
        # Messages that wait to be decoded, and those that were: receipt, stamp and values.
        self._waiting: list[tuple[int, bytes]] = []
        self._parts: list[tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]] = []

    def add(self, receive: int, raw: bytes) -> bool:
        """Add a message received at a time in ns; return whether that completes a batch."""
        self._waiting.append((receive, raw))
        self.count += 1
        if len(self._waiting) < _BATCH:
            return False
        self.decode()
        return True

    def decode(self) -> None:
        """Turn the messages that wait into arrays, and release them."""
        times, messages = zip(*self._waiting) if self._waiting else ((), ())
        receive, stamp = np.array(times, dtype=np.int64), np.zeros(len(times), dtype=np.int64)
        raws, values = [*map(unpack, messages)], dict[str, np.ndarray]()
        sizes, left = np.array([*map(len, raws)]), np.ones(len(raws), dtype=bool)
        good = np.zeros(len(raws), dtype=bool)
        while left.any():
            first = int(np.argmax(left))
            left[first] = False
            try:
                layout = _layout(raws[first], self.signal)
            # A broken message may raise anything.
            except Exception:
                continue
            rows = np.array([first, *np.flatnonzero(left & (sizes == sizes[first]))])
            data = b''.join([raws[k] for k in rows])
            fixed = np.frombuffer(data, np.uint8).reshape(len(rows), -1)[:, layout.fixed]
            own = (fixed == fixed[0]).all(axis=1)
            rows, numbers = rows[own], np.frombuffer(data, layout.dtype)[own]
            left[rows], good[rows] = False, True
            if layout.stamped:
                stamp[rows] = numbers['sec'].astype(np.int64) * NANO + numbers['nanosec']
            for k, (name, column, _) in enumerate(layout.numbers):
                if name not in values:
                    values[name] = np.full((len(raws), self.width), np.nan)
                values[name][rows, column] = numbers[str(k)]
        self.numbers += self.width * len(raws) * len(values)
        self.broken += int(np.count_nonzero(~good))
        self._parts.append((receive[good], stamp[good], {
            name: rows[good] for name, rows in values.items()}))
        self._waiting = []

    def track(self) -> Track | None:
        """Return all messages; None if there are none."""
        self.decode()
        receive, stamp = (np.concatenate([part[k] for part in self._parts]) for k in (0, 1))
        names = dict.fromkeys(name for _, _, values in self._parts for name in values)
        return Track(self.topic, self.signal, receive, stamp, {
            name: np.concatenate([
                values.get(name, np.full((len(times), self.width), np.nan))
                for times, _, values in self._parts]) for name in names}) if len(receive) else None


def tracks_of(messages: Iterable[tuple[str, int, bytes]]) -> dict[str, Track]:
    """Return the tracks of messages by signal, from signal, time of receipt in ns and content."""
    readers = dict[str, _Reader]()
    for signal, receive, raw in messages:
        if signal not in readers:
            readers[signal] = _Reader(signal, signal)
        readers[signal].add(receive, raw)
    return {signal: track for signal, reader in readers.items() if (track := reader.track())}


# What a compensator reported.

@dataclass(frozen=True)
class Activity:
    """What a compensator reported, valid from `time` on; '' if not reported."""

    time: int           # received at, ns
    state: str          # its lifecycle state; 'identification' while that node moved the joint
    law: str
    model: str          # model files
    joints: str = ''    # joints of the model files, in the same order
    settings: str = ''  # of the law, where they are not the defaults

    @property
    def models(self) -> dict[str, str]:
        """Model file of each joint; empty if they were not reported."""
        joints, models = self.joints.split(', '), self.model.split(', ')
        return dict(zip(joints, models)) if self.model and len(joints) == len(models) else {}

    def of(self, joint: str) -> Activity:
        """Return the activity with only the model file of one joint, where several are listed."""
        return replace(self, model=self.models.get(joint, self.model))


class _ActivityLog:
    """Collects the changes of activity from diagnostics, in the order they were received."""

    def __init__(self) -> None:
        self.changes: list[Activity] = []

    def add(self, time: int, raw: bytes, begin: int) -> None:
        """Add a DiagnosticArray received at `time`, ns.

        A compensator's first report also applies to the time before it, back to `begin`, ns.
        """
        before, cdr = len(self.changes), _Cdr(raw)
        cdr.place(4, 2)
        cdr.text()
        for _ in range(cdr.count()):
            cdr.place(1)
            name, _, hardware = cdr.text(), cdr.text(), cdr.text()
            values = {cdr.text(): cdr.text() for _ in range(cdr.count())}
            last = self.changes[-1] if self.changes else None
            activity = _activity_of(name, hardware, values, time, last)
            if activity and (last is None or replace(
                    activity, time=last.time, joints=last.joints) != last):
                self.changes.append(activity)
        if not before and self.changes:
            first = self.changes[0]
            # It reports every second of real time, in which a simulation may advance by several.
            if first.time - begin < 10 * NANO and first.state != 'identification':
                self.changes[0] = replace(first, time=min(first.time, begin))


def _activity_of(name: str, hardware: str, values: Mapping[str, str], time: int,
                 last: Activity | None) -> Activity | None:
    """Return what a status of a compensator or of identification says, else None."""
    if 'identification' in name:
        # The node reports a phase only while it moves a joint.
        if 'phase' in values:
            return Activity(time, 'identification', '', '', hardware)
        return Activity(time, '', '', '') if last and last.state == 'identification' else None
    if 'compensator' not in f'{name} {hardware}':
        return None
    # One file per joint is reported as a list: remove its brackets and quotes.
    model = re.sub(r"""['"\[\]]""", '', values.get('model_files', ''))
    return Activity(time, values.get('state', ''), values.get('law', ''), model, hardware,
                    values.get('settings', ''))


# A bag.

@dataclass
class Scan:
    """Raw contents of one bag."""

    tracks: list[Track]
    topics: dict[str, tuple[str, int]]     # topic to message type and number of messages
    notes: list[str]                       # on what is missing or damaged
    custom: dict[str, str]                 # custom_data of rosbag2's metadata
    activity: list[Activity]
    in_ampere: bool                        # whether efforts are in A


def scan_bag(path: Path, joint: str | None = None, first: float = math.inf) -> Scan:
    """Return what a bag holds; `joint` may name a topic of joint states of any name.

    Only the beginning is read until there are `first` joint states, or more than the memory takes.
    Raises InputError if it cannot be read.
    """
    def signal(topic: str, kind: str) -> str:
        # Topics have the type and name ending of a signal; joint states any name if it is given.
        named = kind == TOPICS['joint_states'] and (joint or '').startswith(f'{topic}/')
        return next((signal for signal, wanted in _TYPES.items()
                     if kind == wanted and topic.endswith(signal)), 'joint_states' * named)

    readers, activity, begin, notes = dict[str, _Reader](), _ActivityLog(), 0, list[str]()
    with os_errors_name(path, 'cannot be read: '):
        storage = Storage(path)
        with closing(storage.messages(
                lambda topic, kind: kind == _DIAGNOSTICS or bool(signal(topic, kind)))
        ) as messages:
            for topic, kind, receive, raw in messages:
                begin = begin or receive
                if kind == _DIAGNOSTICS:
                    # A broken message may raise anything.
                    with suppress(Exception):
                        activity.add(receive, unpack(raw), begin)
                    continue
                reader = readers.get(topic)
                if reader is None:
                    reader = readers[topic] = _Reader(topic, signal(topic, kind))
                if reader.add(receive, raw) and reader.numbers > _MOST:
                    notes.append('the recording is very long: only its first '
                                 f'{(receive - begin) / NANO:.0f} s were read')
                    break
                if reader.count >= first and reader.signal in ('joint_states', _DYNAMIC):
                    break
    tracks, in_ampere, noted = _with_effort([
        track for reader in readers.values() if (track := reader.track()) is not None])
    notes += noted + [
        f'{reader.broken} of the messages of {reader.topic} left out: broken, or more than '
        f'{_MOST_NAMES} joints' for reader in readers.values() if reader.broken]
    return Scan(tracks, {topic: (kind, storage.counts[topic])
                         for topic, kind in storage.kinds.items()},
                storage.notes + notes, storage.custom, activity.changes, in_ampere)


def _with_effort(tracks: Sequence[Track]) -> tuple[list[Track], bool, list[str]]:
    """Replace joint states without effort by dynamic ones.

    Returns the tracks, whether efforts are currents in A, and notes.
    """
    def known(track: Track, column: int) -> list[str]:
        return [name for name, values in track.values.items()
                if np.isfinite(values[:, column]).any()]

    usual = [track for track in tracks if track.signal != _DYNAMIC]
    dynamic = [track for track in tracks if track.signal == _DYNAMIC]
    if not dynamic or any(known(track, _EFFORT) for track in usual
                          if track.signal == 'joint_states'):
        return usual, False, []
    in_ampere = not any(known(track, _EFFORT) for track in dynamic)
    kept = [track for track in usual if track.signal != 'joint_states']
    for track in dynamic:
        # Sensors, too, have interfaces.
        moving = known(track, 0)
        kept.append(replace(track, signal='joint_states', values={
            name: track.values[name][:, [0, 1, _CURRENT if in_ampere else _EFFORT]]
            for name in moving}))
        if warm := known(track, _TEMPERATURE):
            kept.append(replace(
                track, topic=f'{track.topic}, temperature', signal='motor_temperature',
                values={name: track.values[name][:, [_TEMPERATURE]] for name in warm}))
    return kept, in_ampere, [f'{dynamic[0].topic} is used, since no joint_states hold an effort']
