# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a recording as arrays, and their reader for rosbag2 recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from friction_comp.column_names import is_target
from friction_comp.layout import STATES
from friction_comp.recordings import cdr
from friction_comp.recordings.activity import Activity, ActivityLog, DIAGNOSTICS
from friction_comp.recordings.storage import Storage, unpack, unreadable_on_error
from friction_comp.topics import TOPICS, TORQUE_UNIT
from friction_comp.units import Unit

# Joint states with any interfaces, as ros2_control's joint_state_broadcaster publishes them: used
# where the usual ones have no effort.
_DYNAMIC = 'dynamic_joint_states'
# Column of a track to the names of an interface, the first that is there.
_INTERFACES = (('position',), ('velocity',), ('effort', 'torque'), ('current',),
               ('temperature', 'motor_temperature'))
_EFFORT, _CURRENT, _TEMPERATURE = 2, 3, 4
# Messages in which every topic and joint occurs at least once, even with several publishers.
_FIRST_MESSAGES = 1000
# Message type of each signal that is read.
_TYPES = {**TOPICS, _DYNAMIC: cdr.DYNAMIC_STATE}


@dataclass
class Track:
    """One topic's messages in the order of the file."""

    topic: str
    signal: str
    receive: np.ndarray  # (N,) of int64: ns
    stamp: np.ndarray  # (N,) of int64: ns, 0 throughout where the message has none
    order: np.ndarray  # (N,) of int64: index of each message among all that were read
    names: list[str]  # all joints or frames in the messages
    # JointState: by joint, arrays (N, 3) of position, velocity and effort, NaN where a message has
    # none; a table may have a fourth column, the torque behind the gear. DynamicJointState: (N, 5),
    # also current and temperature. Wrench and temperature: by frame, arrays (N, 1).
    # Float64MultiArray and Int8MultiArray: an array (N, J) with the key '', or `TORQUE_UNIT` for
    # commands in N·m, NaN in messages of the other unit. If one joint was selected, only values
    # that may belong to it.
    values: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.receive)

    def take(self, index: slice | np.ndarray) -> Track:
        """Return the selected messages."""
        return Track(self.topic, self.signal, self.receive[index], self.stamp[index],
                     self.order[index], self.names,
                     {key: value[index] for key, value in self.values.items()})

    @staticmethod
    def concatenate(parts: Sequence[Track]) -> Track:
        """Concatenate parts of one topic, and empty their `values` to save memory."""
        first = parts[0]
        if len(parts) == 1:
            return first
        starts = np.cumsum([0, *map(len, parts)])
        values = {}
        for key in dict.fromkeys(key for part in parts for key in part.values):
            width = max(part.values[key].shape[1] for part in parts if key in part.values)
            values[key] = np.full((starts[-1], width), np.nan)
            for start, part in zip(starts, parts):
                if key in part.values:
                    own = part.values.pop(key)
                    values[key][start:start + len(own), :own.shape[1]] = own
        return Track(
            first.topic, first.signal, np.concatenate([part.receive for part in parts]),
            np.concatenate([part.stamp for part in parts]),
            np.concatenate([part.order for part in parts]),
            list(dict.fromkeys(name for part in parts for name in part.names)), values)


@dataclass
class Scan:
    """Raw contents of one recording, or of a stretch of it with the notes so far."""

    path: Path
    tracks: list[Track]
    topics: dict[str, tuple[str, int]]     # topic to message type and number of messages
    notes: list[str]                       # on what is missing or damaged
    custom: dict[str, str] = field(default_factory=dict)    # custom_data of rosbag2's metadata
    activity: list[Activity] = field(default_factory=list)
    effort_is_current: bool = False        # whether efforts are in A, as tables may declare
    effort_unit: str = ''                  # of efforts that are neither torques nor currents
    assumed: tuple[str, ...] = ()          # columns without a unit, with the one taken for it
    selected: str | None = None            # the joint to read if none is named
    states: str | None = None              # the topic of joint states, where the user names it
    linear: bool = False                   # whether positions are in m and efforts in N

    def of(self, signal: str) -> list[Track]:
        """Return the tracks of a signal: those of topics with exactly its name, otherwise all."""
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        return exact or tracks

    def around(self, topic: str) -> Scan:
        """Return a scan in which signals in the namespace of a topic go before another robot's."""
        namespace = topic.rpartition('/')[0] + '/'
        return replace(self, tracks=sorted(
            self.tracks, key=lambda track: not track.topic.startswith(namespace)))

    @property
    def joints(self) -> list[str]:
        """Names of all joints in the joint states."""
        return list(dict.fromkeys(n for track in self.of('joint_states') for n in track.names))

    @property
    def choices(self) -> list[str]:
        """All joints as a user may name them: as /TOPIC/NAME where several topics hold the name."""
        tracks = self.of('joint_states')
        count = Counter(name for track in tracks for name in set(track.names))
        return list(dict.fromkeys(
            f'{track.topic}/{name}' if count[name] > 1 else name
            for track in tracks for name in track.names))

    @property
    def model(self) -> str | None:
        """Active model file, if recorded: that in the metadata, else the one reported last."""
        named = [activity.model for activity in self.activity if activity.model]
        return self.custom.get('model_file') or (named[-1] if named else None)


def signal_of(topic: str, type_name: str) -> str | None:
    """Return the signal of a topic, found by its type and the ending of its name, or None."""
    for signal, wanted in _TYPES.items():
        if type_name == wanted and topic.endswith(signal):
            return signal
    return None


def in_topic(path: Path, joint: str | None) -> tuple[str | None, str | None]:
    """Return topic and name of a joint given as /TOPIC/NAME; else it has no topic.

    Both may contain slashes, so the recording decides: a joint of that very name goes first, then
    the longest topic that fits.
    """
    if not joint or not joint.startswith('/'):
        return None, joint
    payloads: dict[tuple[str, str], list[bytes]] = {}
    with unreadable_on_error(path):
        for topic, kind, _, raw in islice(Storage(path).messages(
                lambda _, kind: kind in (cdr.JOINT_STATE, cdr.DYNAMIC_STATE)), _FIRST_MESSAGES):
            payloads.setdefault((topic, kind), []).append(unpack(raw))
    names = {name for (topic, kind), own in payloads.items()
             for _, listed, fields in cdr.decode(kind, own)
             for name in values_of(signal_of(topic, kind) or 'joint_states', listed, fields)[0]}
    if joint in names:
        return None, joint
    fit = [topic for topic, _ in payloads if joint.startswith(f'{topic}/')]
    topic = max(fit, key=len) if fit else joint.rpartition('/')[0]
    # A name is more likely to be wrong than a topic where all names begin with a slash.
    return (None, joint) if not topic or (not fit and names and all(
        name.startswith('/') for name in names)) else (topic, joint[len(topic) + 1:])


def values_of(signal: str, names: tuple[str, ...], fields: dict[str, np.ndarray],
              joint: str | None = None) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
    """Return names and values, as in a `Track`, of decoded messages of one layout.

    `joint` selects the values that may belong to it.
    """
    if 'data' in fields:
        unit = TORQUE_UNIT if names == (TORQUE_UNIT,) else ''
        return (), {unit: fields['data'].astype(float)}
    if signal == _DYNAMIC:
        values = _interface_values(names, fields)
        if joint in values:
            values = {joint: values[joint]}
        return tuple(values), values
    if 'wrench' in fields:
        return names, {names[0]: fields['wrench'][:, 5:6].copy()}
    if 'temperature' in fields:
        return names, {names[0]: fields['temperature'][:, :1].copy()}
    # A single joint may have no name.
    names = names or ('',) * min(fields['position'].shape[1], 1)
    values = {}
    for k, name in enumerate(names):
        if joint in (None, name) or not name:
            values[name] = np.full((len(fields['position']), 3), np.nan)
            for column, part in enumerate(('position', 'velocity', 'effort')):
                if k < fields[part].shape[1]:
                    values[name][:, column] = fields[part][:, k]
    return names, values


def _interface_values(names: Sequence[str], fields: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the values of each joint, shape (N, 5), in the order of `_INTERFACES`; NaN if none."""
    values: dict[str, np.ndarray] = {}
    column: dict[str, int] = {}
    for name in names:
        joint, _, interface = name.rpartition('/')
        k = column[joint] = column.get(joint, -1) + 1
        own = values.setdefault(joint, np.full((len(fields[joint]), len(_INTERFACES)), np.nan))
        for place, known in enumerate(_INTERFACES):
            if interface in known and k < fields[joint].shape[1]:
                own[:, place] = fields[joint][:, k]
    return {joint: own for joint, own in values.items() if np.isfinite(own[:, 0]).any()}


def _with_effort(tracks: Sequence[Track]) -> tuple[list[Track], bool, list[str]]:
    """Replace joint states without effort by dynamic ones.

    Returns the tracks, whether efforts are currents in A, and notes.
    """
    usual = [track for track in tracks if track.signal != _DYNAMIC]
    dynamic = [track for track in tracks if track.signal == _DYNAMIC]
    known = any(np.isfinite(values[:, 2]).any() for track in usual
                if track.signal == 'joint_states' for values in track.values.values())
    if not dynamic or known:
        return usual, False, []
    in_ampere = not any(np.isfinite(values[:, _EFFORT]).any() for track in dynamic
                        for values in track.values.values())
    effort = _CURRENT if in_ampere else _EFFORT
    kept = [track for track in usual if track.signal != 'joint_states']
    for track in dynamic:
        kept.append(replace(track, signal='joint_states', values={
            joint: values[:, [0, 1, effort]] for joint, values in track.values.items()}))
        warm = {joint: values[:, [_TEMPERATURE]] for joint, values in track.values.items()
                if np.isfinite(values[:, _TEMPERATURE]).any()}
        if warm and not any(one.signal == 'motor_temperature' for one in usual):
            kept.append(replace(track, topic=f'{track.topic}, temperature',
                                signal='motor_temperature', values=warm))
    return kept, in_ampere, [f'{dynamic[0].topic} is used, since no joint_states hold an effort']


class MessageScanner:
    """Reads one rosbag2 recording in batches of messages per topic.

    All joints are read or only one, with the `others` of its topic if these are wanted.
    """

    def __init__(self, path: Path, joint: str | None = None, batch: int = 20_000,
                 units: Mapping[str, Unit] | None = None, others: bool = False) -> None:
        with unreadable_on_error(path):
            self._storage = Storage(path)
        self._batch, self._units = batch, units or {}
        self._topics: dict[str, _TopicReader] = {}
        self._activity = ActivityLog()
        # The topic that holds the joint states, if the user names it or it has another name.
        self._states, name = in_topic(path, joint)
        self._joint = None if others else name or None

    @property
    def progress(self) -> float:
        """Share of the recording that has been read."""
        return self._storage.progress

    def scans(self) -> Iterator[Scan]:
        """Yield a scan after each batch of joint states, and the rest at the end."""
        begin = 0
        with unreadable_on_error(self._storage.path):
            for index, (topic, kind, receive, raw) in enumerate(
                    self._storage.messages(self._is_wanted)):
                if not index:
                    begin = receive
                if kind == DIAGNOSTICS:
                    self._activity.add(receive, raw, begin)
                    continue
                reader = self._topics.get(topic)
                if reader is None:
                    signal = self._signal(topic, kind)
                    assert signal is not None
                    reader = self._topics[topic] = _TopicReader(topic, signal, self._joint)
                reader.messages.append((receive, index, raw))
                if len(reader.messages) >= self._batch:
                    reader.decode()
                    if reader.signal in ('joint_states', _DYNAMIC):
                        yield self._scan()
            if self._called_otherwise():
                yield from self.scans()
            else:
                yield self._scan()

    def _signal(self, topic: str, kind: str) -> str | None:
        signal = signal_of(topic, kind)
        if self._states is None or signal not in (None, 'joint_states', _DYNAMIC):
            return signal
        own = signal or ('joint_states' if kind == cdr.JOINT_STATE else None)
        return own if topic == self._states else None

    def _is_wanted(self, topic: str, kind: str) -> bool:
        return kind == DIAGNOSTICS or self._signal(topic, kind) is not None

    def _called_otherwise(self) -> bool:
        """Begin anew if the only topic of measured joint states has another name."""
        states = {signal_of(topic, kind) for topic, (kind, _) in self._storage.topics.items()}
        others = [topic for topic, (kind, _) in self._storage.topics.items()
                  if kind == cdr.JOINT_STATE and not is_target(topic.rsplit('/', 1)[-1])]
        if (self._states or len(others) != 1
                or {'joint_states', _DYNAMIC} & states):
            return False
        self._states, = others
        self._storage, self._topics = Storage(self._storage.path), {}
        self._activity = ActivityLog()
        self._storage.notes.append(
            f'{self._states} is read as joint_states: no other topic holds joint states')
        return True

    def _scan(self) -> Scan:
        storage, readers = self._storage, self._topics.values()
        tracks = [track for reader in readers if (track := reader.take()) is not None]
        notes = storage.notes + [
            f'{reader.broken} of the messages of {reader.topic} left out: broken, or more than '
            f'{cdr.MOST_VALUES} values' for reader in readers if reader.broken]
        tracks, in_ampere, more = _with_effort(tracks)
        dimensions = {unit.dimension for unit in self._units.values()}
        return Scan(
            storage.path, [self._in_si(track) for track in tracks], storage.topics, notes + more,
            storage.custom, list(self._activity.changes),
            effort_is_current=in_ampere or 'current' in dimensions,
            linear=bool(dimensions & {'length', 'length/time', 'force'}), states=self._states)

    def _in_si(self, track: Track) -> Track:
        if track.signal != 'joint_states' or not self._units:
            return track
        factors = [self._units[signal].factor if signal in self._units else 1.0
                   for signal in STATES]
        return replace(track, values={
            joint: values[:, :len(factors)] * factors for joint, values in track.values.items()})


class _TopicReader:
    def __init__(self, topic: str, signal: str, joint: str | None) -> None:
        self.topic, self.signal = topic, signal
        self.messages: list[tuple[int, int, bytes]] = []    # (receive time in ns, index, payload)
        self.broken = 0                                     # messages that cannot be decoded
        self._joint = joint
        self._tracks: list[Track] = []

    def decode(self) -> None:
        """Decode the collected messages into a track, and release them."""
        receive, order, payloads = zip(*self.messages)
        times, orders = np.array(receive, dtype=np.int64), np.array(order, dtype=np.int64)
        parts = []
        for index, names, fields in cdr.decode(
                _TYPES[self.signal], [unpack(payload) for payload in payloads]):
            names, values = values_of(self.signal, names, fields, self._joint)
            stamps = fields.get('stamp', np.zeros(len(index), dtype=np.int64))
            parts.append(Track(self.topic, self.signal, times[index], stamps, orders[index],
                               list(names), values))
        self.broken += len(payloads) - sum(map(len, parts))
        self.messages = []
        if parts:
            track = Track.concatenate(parts)
            self._tracks.append(track if len(parts) == 1 else track.take(np.argsort(track.order)))

    def take(self) -> Track | None:
        """Return the messages since the last call; None if there are none."""
        if self.messages:
            self.decode()
        tracks, self._tracks = self._tracks, []
        return Track.concatenate(tracks) if tracks else None
