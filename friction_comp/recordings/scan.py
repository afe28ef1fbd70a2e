# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a bag as arrays: a track for each topic, and what a compensator reported.

A file, mcap or sqlite3, is read up to its end, or to the first part that is damaged or missing, and
a note says so. Libraries give records; they refuse a file whose end is missing, which the recorder
of a robot that lost its power leaves behind.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from functools import cache
import math
from pathlib import Path, PurePath
import re
import sqlite3
from typing import Any
from urllib.parse import quote

from mcap import records
from mcap.exceptions import EndOfFile
from mcap.stream_reader import breakup_chunk, StreamReader
import numpy as np
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
from rosbags.typesys.store import Typestore
import zstandard

from friction_comp.errors import InputError, one_line, os_errors_name
from friction_comp.files import check_input, check_unpacked, open_input, read_yaml, unpacked_file
from friction_comp.messages import NANO, nanoseconds, TOPICS, TORQUE_UNIT
from friction_comp.recordings import BAGS, METADATA
from friction_comp.tables.columns import STATES

# Files: topic, time of receipt in ns and content of messages that a scan wants; all are counted.

_Messages = Iterator[tuple[str, int, bytes]]

_ZSTD = b'\x28\xb5\x2f\xfd'
# Largest chunk of messages and largest compressed message, bytes when unpacked.
_LARGEST_CHUNK, _LARGEST_MESSAGE = 500_000_000, 1_000_000


def _read_mcap(scan: Scan, file: Path) -> _Messages:
    schemas: dict[int, str] = {}
    # Topic of each channel, and whether its messages are wanted.
    channels: dict[int, tuple[str, bool]] = {}
    with open_input(file) as stream:
        for part in StreamReader(
                stream, emit_chunks=True, record_size_limit=_LARGEST_CHUNK).records:
            if isinstance(part, records.DataEnd):
                return
            for one in _unpacked(part) if isinstance(part, records.Chunk) else [part]:
                if isinstance(one, records.Message):
                    topic, wanted = channels[one.channel_id]
                    scan.counts[topic] += 1
                    if wanted:
                        yield topic, one.log_time, one.data
                elif isinstance(one, records.Schema):
                    schemas[one.id] = one.name
                elif isinstance(one, records.Channel):
                    channels[one.id] = one.topic, scan.wants(
                        one.topic, schemas.get(one.schema_id, ''), one.message_encoding)


def _unpacked(chunk: records.Chunk) -> list[records.McapRecord]:
    """Return a chunk's records; an error if it unpacks to more than it says, or than any holds."""
    size, packed = chunk.uncompressed_size, chunk.data
    check_unpacked('a chunk', size, len(packed))
    said = zstandard.frame_content_size(packed) if chunk.compression == 'zstd' else -1
    if size > _LARGEST_CHUNK or said not in (-1, size):
        raise ValueError(f'a chunk of {max(size, said)} bytes')
    return breakup_chunk(chunk, validate_crc=True)


def _read_sqlite(scan: Scan, file: Path) -> _Messages:
    # Nothing is written beside it, unless it has a log that is not yet merged.
    logged = check_input(file).with_name(f'{file.name}-wal').exists()
    options = 'mode=ro' if logged else 'mode=ro&immutable=1'
    with closing(sqlite3.connect(f'file:{quote(str(file.absolute()))}?{options}', uri=True)
                 ) as database:
        # A view, or a virtual table, could yield rows without end.
        stored = dict(database.execute('SELECT name, sql FROM sqlite_master'))
        if not all(str(stored.get(name)).startswith('CREATE TABLE')
                   for name in ('topics', 'messages')):
            raise ValueError('not a database of rosbag2')
        topics = {key: (str(topic), scan.wants(str(topic), str(kind), encoding))
                  for key, topic, kind, encoding in database.execute(
                      'SELECT id, name, type, serialization_format FROM topics ORDER BY id')}
        for key, time, payload in database.execute(
                'SELECT topic_id, timestamp, data FROM messages ORDER BY id'):
            topic, wanted = topics[key]
            scan.counts[topic] += 1
            if wanted:
                yield topic, int(time), bytes(payload)


_READERS = {'.mcap': _read_mcap, '.db3': _read_sqlite}


# Messages.

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
# Those that are not among the types of ROS itself.
_OTHERS = {'control_msgs/msg/InterfaceValue': 'string[] interface_names\nfloat64[] values',
           _TYPES[_DYNAMIC]: 'std_msgs/Header header\nstring[] joint_names\n'
           'InterfaceValue[] interface_values'}
# Most joints, or values of a joint, in one message: a corrupt one could fill the memory.
_MOST_NAMES = 200
# Most numbers of one topic that are kept.
_MOST = 50_000_000


@cache
def _types() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for kind, definition in _OTHERS.items():
        store.register(get_types_from_msg(definition, kind))
    return store


def _message(payload: bytes, kind: str) -> Any:
    """Return a message, decompressed if rosbag2 compressed it and it is not damaged."""
    if payload[:4] == _ZSTD:
        with suppress(zstandard.ZstdError):
            payload = zstandard.ZstdDecompressor().stream_reader(payload).read(_LARGEST_MESSAGE)
    return _types().deserialize_cdr(payload, kind)


def _numbers(message: Any, signal: str) -> list[tuple[str, int, float]]:
    """Return joint or frame, column and value of each number of a message."""
    if signal in ('current_command', 'direction'):
        unit = TORQUE_UNIT * ([one.label for one in message.layout.dim[1:2]] == [TORQUE_UNIT])
        return [(f'{unit}{k}', 0, value) for k, value in enumerate(message.data.tolist())]
    if signal == 'interaction_wrench':
        return [(message.header.frame_id, 0, message.wrench.torque.z)]
    if signal == 'motor_temperature':
        return [(message.header.frame_id, 0, message.temperature)]
    if signal == _DYNAMIC:
        return [(joint, _INTERFACES[name], value)
                for joint, own in zip(message.joint_names, message.interface_values)
                for name, value in zip(own.interface_names, own.values.tolist())
                if name in _INTERFACES]
    # A single joint may have no name.
    names = message.name or ['']
    return [(joint, column, value)
            for column, own in enumerate((message.position, message.velocity, message.effort))
            for joint, value in zip(names, own.tolist())]


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
        self.count = self.broken = 0    # messages
        self._width = 5 if signal == _DYNAMIC else len(STATES)
        self._receive, self._stamp = array('q'), array('q')
        self._values: dict[str, array[float]] = {}  # up to the last message that has the name

    @property
    def numbers(self) -> int:
        """How many numbers the arrays have."""
        return self._width * len(self._receive) * len(self._values)

    def add(self, receive: int, raw: bytes) -> None:
        """Add a message received at a time in ns."""
        self.count += 1
        rows = dict[str, list[float]]()
        # A broken message may raise anything.
        try:
            message = _message(raw, _TYPES[self.signal])
            for name, column, value in _numbers(message, self.signal):
                rows.setdefault(name, [math.nan] * self._width)[column] = value
            stamp = nanoseconds(message.header.stamp) if hasattr(message, 'header') else 0
            if len(rows) > _MOST_NAMES:
                raise ValueError
        except Exception:
            self.broken += 1
            return
        for name, row in rows.items():
            self._rows(name).extend(row)
        self._receive.append(receive)
        self._stamp.append(stamp)

    def _rows(self, name: str) -> array[float]:
        """Return the rows of a name, NaN for the messages without it."""
        rows = self._values.setdefault(name, array('d'))
        rows.extend([math.nan] * (self._width * len(self._receive) - len(rows)))
        return rows

    def track(self) -> Track | None:
        """Return all messages; None if there are none."""
        return Track(self.topic, self.signal, np.array(self._receive), np.array(self._stamp), {
            name: np.array(self._rows(name)).reshape(-1, self._width)
            for name in self._values}) if self._receive else None


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

    def of(self, joint: str) -> Activity:
        """Return the activity with only the model file of one joint, where several are listed."""
        joints, models = self.joints.split(', '), self.model.split(', ')
        return replace(self, model=dict(zip(joints, models)).get(joint, self.model)) if (
            self.model and len(joints) == len(models)) else self


def _take_report(changes: list[Activity], time: int, raw: bytes) -> None:
    """Add to the `changes` of activity what a DiagnosticArray says; `time` of receipt in ns."""
    for status in _message(raw, _DIAGNOSTICS).status:
        name, hardware = status.name, status.hardware_id
        values = {one.key: one.value for one in status.values}
        last = changes[-1] if changes else None
        if 'identification' in name:
            # The node reports a phase only while it moves a joint.
            state = 'identification' if 'phase' in values else ''
            if not state and (last is None or last.state != 'identification'):
                continue
            activity = Activity(time, state, '', '', hardware if state else '')
        elif 'compensator' in f'{name} {hardware}':
            # One file per joint is reported as a list: remove its brackets and quotes.
            model = re.sub(r"""['"\[\]]""", '', values.get('model_files', ''))
            activity = Activity(time, values.get('state', ''), values.get('law', ''), model,
                                hardware, values.get('settings', ''))
        else:
            continue
        if last is None or replace(activity, time=last.time, joints=last.joints) != last:
            changes.append(activity)


# A bag.

class Scan:
    """Raw contents of a rosbag2 folder or a file; `joint` may name a topic of any joint states.

    Only the beginning is read until there are `first` joint states, or more than the memory takes.
    Raises InputError if there is no message before the first damage, or those wanted are not CDR.
    """

    def __init__(self, path: Path, joint: str | None = None, first: float = math.inf) -> None:
        self.path, self._joint = path, joint or ''
        self.kinds = dict[str, str]()   # message type of each topic
        self.notes, self.activity = list[str](), list[Activity]()
        self.counts = Counter[str]()    # messages of each topic
        self.custom: dict[str, str] = {}    # custom_data of rosbag2's metadata
        readers = dict[str, _Reader]()
        with os_errors_name(path, 'cannot be read: '), closing(self._messages()) as messages:
            for topic, receive, raw in messages:
                if self.kinds[topic] == _DIAGNOSTICS:
                    # A broken message may raise anything.
                    with suppress(Exception):
                        _take_report(self.activity, receive, raw)
                    continue
                reader = readers.get(topic)
                if reader is None:
                    reader = readers[topic] = _Reader(topic, self._signal(topic))
                reader.add(receive, raw)
                if reader.numbers > _MOST:
                    self.notes.append('the recording is very long: only its beginning was read, '
                                      f'{reader.count} messages of {topic}')
                    break
                if reader.count >= first and reader.signal in ('joint_states', _DYNAMIC):
                    break
        self.tracks = [track for reader in readers.values() if (track := reader.track())]
        self.notes += [f'{reader.broken} of the messages of {reader.topic} left out: broken, or '
                       f'more than {_MOST_NAMES} joints' for reader in readers.values()
                       if reader.broken]
        # A compensator reports every second of real time, in which a simulation may advance by
        # several; its first report also applies to the time before it.
        begin = min((int(track.receive[0]) for track in self.tracks), default=0)
        if self.activity and self.activity[0].state != 'identification' and (
                0 < self.activity[0].time - begin < 10 * NANO):
            self.activity[0] = replace(self.activity[0], time=begin)
        self.in_ampere = False  # whether efforts are in A
        self._use_dynamic()

    def wants(self, topic: str, kind: str, encoding: str) -> bool:
        """Take note of a topic, and return whether its messages are read."""
        self.kinds.setdefault(topic, kind)
        wanted = kind == _DIAGNOSTICS or bool(self._signal(topic))
        if wanted and encoding not in ('cdr', ''):
            raise ValueError(f'{topic} is not serialised as CDR')
        return wanted

    def _signal(self, topic: str) -> str:
        """Return a topic's signal, '' for none: by type and ending, or by the joint's name."""
        kind = self.kinds[topic]
        named = kind == TOPICS['joint_states'] and self._joint.startswith(f'{topic}/')
        return next((signal for signal, wanted in _TYPES.items()
                     if kind == wanted and topic.endswith(signal)), 'joint_states' * named)

    def _messages(self) -> Generator[tuple[str, int, bytes], None, None]:
        """Yield the messages that are wanted of all files, up to the first damage of each."""
        failed, files = [], [self.path] if self.path.is_file() else self._list_files()
        for file in files:
            before = self.counts.total()
            try:
                with unpacked_file(file) as plain:
                    yield from _READERS[plain.suffix](self, plain)
            # What is damaged may raise anything.
            except Exception as error:
                damage = f'{file.name}: damaged or not finished: ' + (
                    'a part of it is missing' if isinstance(error, (LookupError, EndOfFile))
                    else one_line(error))
                if count := self.counts.total() - before:
                    self.notes.append(f'{damage}: {count} messages before that were read')
                else:
                    failed.append(damage)
        if len(failed) == len(files):
            raise self._unreadable('; '.join(failed))
        self.notes += [f'{reason}: this file is missing' for reason in failed]

    def _list_files(self) -> list[Path]:
        """Return the files listed in the metadata, or else those in the folder."""
        # By their numbers, 2 before 10.
        files = sorted((path for path in self.path.iterdir() if path.name.endswith(BAGS)),
                       key=lambda path: (len(path.name), path.name))
        try:
            about = read_yaml(self.path / METADATA)['rosbag2_bagfile_information']
            # Only the names, in this folder: metadata must not point outside of it.
            listed = [self.path / PurePath(name).name for name in about['relative_file_paths']]
            self.custom = {key: value for key, value in (about.get('custom_data') or {}).items()
                           if isinstance(key, str) and isinstance(value, str)}
        except Exception as error:
            if not files:
                raise self._unreadable(f'{METADATA}: {one_line(error)}') from None
            self.notes.append(f'{METADATA} is damaged: files are read in the order of their names')
            return files
        if missing := [path.name for path in listed if not path.is_file()]:
            self.notes.append(f'{len(missing)} of its {len(listed)} files are missing: '
                              f'{", ".join(missing)}')
        if len(missing) == len(listed):
            raise self._unreadable(f'{METADATA} lists {", ".join(missing) or "a file"}, which is '
                                   'not here')
        return [path for path in listed if path.is_file()]

    def _unreadable(self, reason: str) -> InputError:
        return InputError(f'{self.path}: not a readable recording: {reason}')

    def _use_dynamic(self) -> None:
        """Replace joint states without effort by dynamic ones, if there are any."""
        def known(track: Track, column: int) -> list[str]:
            return [name for name, values in track.values.items()
                    if np.isfinite(values[:, column]).any()]

        usual, dynamic = ([track for track in self.tracks if (track.signal == _DYNAMIC) == own]
                          for own in (False, True))
        self.tracks = usual
        if not dynamic or any(known(track, _EFFORT) for track in usual
                              if track.signal == 'joint_states'):
            return
        self.in_ampere = not any(known(track, _EFFORT) for track in dynamic)
        columns = {'joint_states': [0, 1, _CURRENT if self.in_ampere else _EFFORT],
                   'motor_temperature': [_TEMPERATURE]}
        # Sensors, too, have interfaces.
        self.tracks = [track for track in usual if track.signal != 'joint_states'] + [
            replace(track, signal=signal, values={
                name: track.values[name][:, own] for name in known(track, own[0])})
            for track in dynamic for signal, own in columns.items() if known(track, own[0])]
        self.notes.append(f'{dynamic[0].topic} is used, since no joint_states hold an effort')
