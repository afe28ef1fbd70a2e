# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a recording as arrays, and their reader for rosbag2 recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, ExitStack
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.recordings.activity import Activity, ActivityLog, DIAGNOSTICS
from friction_comp.recordings.storage import Storage, unpack, unreadable_on_error
from friction_comp.stamps import NANO
from friction_comp.statistics import evenly_spread
from friction_comp.tables.columns import STATES
from friction_comp.tables.units import Unit
from friction_comp.topics import TOPICS, TORQUE_UNIT

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

# Joint states with any interfaces, as ros2_control's joint_state_broadcaster publishes them: used
# where the usual ones have no effort.
_DYNAMIC = 'dynamic_joint_states'
# Column of a track by the name of an interface.
_INTERFACES = {'position': 0, 'velocity': 1, 'effort': 2, 'torque': 2, 'current': 3,
               'temperature': 4, 'motor_temperature': 4}
_EFFORT, _CURRENT, _TEMPERATURE = 2, 3, 4
# Message type of each signal that is read, and those without joint names.
_TYPES = {**TOPICS, _DYNAMIC: 'control_msgs/msg/DynamicJointState'}
_ARRAYS = ('current_command', 'direction')
MOST_NAMES = 200
"""Most joints, or values of a joint, in one message: a corrupt one could fill the memory."""
# Messages that are decoded at once; most numbers of one topic that are kept, and the length of the
# stretches that are kept or left out if there are more, ns.
_BATCH, _MOST, _STRETCH = 20_000, 50_000_000, 10 * NANO


def message_types() -> Typestore:
    """Return the message types of ROS 2, and that of dynamic joint states."""
    # A table needs none of them.
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    # In Jazzy they are the same; its module takes longer to import.
    types = get_typestore(Stores.ROS2_FOXY)
    types.register({
        **get_types_from_msg('string[] interface_names\nfloat64[] values\n',
                             'control_msgs/msg/InterfaceValue'),
        **get_types_from_msg('std_msgs/Header header\nstring[] joint_names\n'
                             'InterfaceValue[] interface_values\n', _TYPES[_DYNAMIC])})
    return types


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
    # none. DynamicJointState: (N, 5), also current and temperature. Wrench and temperature: by
    # frame, arrays (N, 1). Float64MultiArray and Int8MultiArray: an array (N, J) with the key '',
    # or `TORQUE_UNIT` for commands in N·m, NaN in messages of the other unit. If one joint was
    # selected, only values that may belong to it.
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
    """Raw contents of one bag."""

    path: Path
    tracks: list[Track]
    topics: dict[str, tuple[str, int]]     # topic to message type and number of messages
    notes: list[str]                       # on what is missing or damaged
    custom: dict[str, str] = field(default_factory=dict)    # custom_data of rosbag2's metadata
    activity: list[Activity] = field(default_factory=list)
    effort_is_current: bool = False        # whether efforts are in A, as tables may declare
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

    def chosen(self, joint: str | None) -> tuple[Scan, str | None]:
        """Return the scan of the topic of a joint given as /TOPIC/NAME, and the joint's name.

        Both may contain slashes: a joint of that very name goes first, then the longest topic.
        """
        fit = [track.topic for track in self.tracks if track.signal == 'joint_states'
               and joint is not None and joint.startswith(f'{track.topic}/')]
        if joint is None or joint in self.joints or not fit:
            return self, joint
        topic = max(fit, key=len)
        return replace(self, tracks=[track for track in self.tracks if track.topic == topic
                                     or track.signal != 'joint_states']), joint[len(topic) + 1:]

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


def _content(message: Any) -> tuple[tuple[str, ...], np.ndarray]:
    """Return the joints or frames of a message, and a row of values for each, as in a `Track`."""
    if hasattr(message, 'data'):
        labels = [dimension.label for dimension in message.layout.dim[1:2]]
        return (TORQUE_UNIT if labels == [TORQUE_UNIT] else '',), message.data[None].astype(float)
    if hasattr(message, 'wrench'):
        return (message.header.frame_id,), np.array([[message.wrench.torque.z]])
    if hasattr(message, 'temperature'):
        return (message.header.frame_id,), np.array([[message.temperature]])
    if hasattr(message, 'interface_values'):
        rows = np.full((len(message.joint_names), len(set(_INTERFACES.values()))), np.nan)
        for row, own in zip(rows, message.interface_values):
            for name, value in zip(own.interface_names, own.values):
                if name in _INTERFACES:
                    row[_INTERFACES[name]] = value
        return tuple(message.joint_names), rows
    # A single joint may have no name.
    names = tuple(message.name) or ('',) * min(len(message.position), 1)
    rows = np.full((len(names), 3), np.nan)
    for column, values in enumerate((message.position, message.velocity, message.effort)):
        rows[:len(values), column] = values[:len(names)]
    return names, rows


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
        # Sensors, too, have interfaces.
        moving = {joint: values[:, [0, 1, effort]] for joint, values in track.values.items()
                  if np.isfinite(values[:, 0]).any()}
        kept.append(replace(track, signal='joint_states', names=[*moving], values=moving))
        warm = {joint: values[:, [_TEMPERATURE]] for joint, values in track.values.items()
                if np.isfinite(values[:, _TEMPERATURE]).any()}
        if warm and not any(one.signal == 'motor_temperature' for one in usual):
            kept.append(replace(track, topic=f'{track.topic}, temperature',
                                signal='motor_temperature', values=warm))
    return kept, in_ampere, [f'{dynamic[0].topic} is used, since no joint_states hold an effort']


def read_bag(path: Path, joint: str | None = None, others: bool = True,
             units: Mapping[str, Unit] | None = None,
             progress: Callable[[float], None] = lambda share: None,
             first: float = math.inf) -> Scan:
    """Return what a bag holds of all joints, or of `joint` and, if wanted, the `others`.

    Only the beginning is read until there are `first` joint states. Of a very long recording, only
    stretches evenly spread over it are kept. Raises InputError if it cannot be read.
    """
    def signal(topic: str, kind: str) -> str | None:
        # Joint states may have any name if the user gives it.
        named = kind == TOPICS['joint_states'] and (joint or '').startswith(f'{topic}/')
        return signal_of(topic, kind) or ('joint_states' if named else None)

    types, readers, activity = message_types(), dict[str, _TopicReader](), ActivityLog()
    share, begin = 1.0, 0
    with unreadable_on_error(path), ExitStack() as stack:
        storage = Storage(path)
        messages = stack.enter_context(closing(storage.messages(
            lambda topic, kind: kind == DIAGNOSTICS or signal(topic, kind) is not None)))
        for index, (topic, kind, receive, raw) in enumerate(messages):
            begin = begin or receive
            if share < 1.0 and evenly_spread(receive // _STRETCH) >= share:
                continue
            reader = readers.get(topic)
            if reader is None:
                reader = readers[topic] = _TopicReader(
                    topic, kind, signal(topic, kind) or '', None if others else joint, types)
            try:
                if kind == DIAGNOSTICS:
                    activity.add(receive, types.deserialize_cdr(unpack(raw), kind), begin)
                else:
                    reader.add(receive, index, unpack(raw))
            # A broken message may raise anything.
            except Exception:
                reader.broken += 1
            if reader.waiting >= _BATCH:
                reader.decode()
                progress(storage.progress)
                if storage.progress > 0.01:
                    share = min(share, _MOST * storage.progress / max(reader.values, 1))
            if reader.signal in ('joint_states', _DYNAMIC) and reader.count >= first:
                break
    tracks, in_ampere, notes = _with_effort([
        track for reader in readers.values() if (track := reader.track()) is not None])
    notes += [f'{reader.broken} of the messages of {reader.topic} left out: broken, or more than '
              f'{MOST_NAMES} joints' for reader in readers.values() if reader.broken]
    if share < 1.0:
        notes.append(f'the recording is very long: {100.0 * share:.3g} % of it were read, in '
                     f'stretches of {_STRETCH / NANO:g} s')
    dimensions = {unit.dimension for unit in (units or {}).values()}
    return Scan(
        path, [_in_si(track, units or {}) for track in tracks], storage.topics,
        storage.notes + notes, storage.custom, activity.changes,
        effort_is_current=in_ampere or 'current' in dimensions,
        linear=bool(dimensions & {'length', 'length/time', 'force'}))


def _in_si(track: Track, units: Mapping[str, Unit]) -> Track:
    if track.signal != 'joint_states' or not units:
        return track
    factors = [units[signal].factor if signal in units else 1.0 for signal in STATES]
    return replace(track, values={
        joint: values[:, :len(factors)] * factors for joint, values in track.values.items()})


class _TopicReader:
    def __init__(self, topic: str, kind: str, signal: str, joint: str | None,
                 types: Typestore) -> None:
        self.topic, self.signal = topic, signal
        # Messages, those that wait to be decoded and without sense, and numbers that were decoded.
        self.count = self.waiting = self.broken = self.values = 0
        self._kind, self._joint, self._types = kind, joint, types
        # Times of receipt and stamps in ns, index and rows of messages that hold the same names.
        self._rows: dict[Any, list[tuple[int, int, int, np.ndarray]]] = {}
        self._states: list[_States] = []
        self._tracks: list[Track] = []

    def add(self, receive: int, index: int, raw: bytes) -> None:
        """Add a message, received at a time in ns; raises an error if it makes no sense."""
        self.waiting += 1
        self.count += 1
        if self._states and self._states[-1].add(receive, index, raw):
            return
        message: Any = self._types.deserialize_cdr(raw, self._kind)
        names, rows = _content(message)
        if max(rows.shape) > MOST_NAMES:
            raise ValueError
        if self._kind == TOPICS['joint_states']:
            self._states.append(_States(names, message, raw))
            self._states[-1].add(receive, index, raw)
            return
        stamp = message.header.stamp if hasattr(message, 'header') else None
        self._rows.setdefault((names, rows.shape), []).append((
            receive, stamp.sec * NANO + stamp.nanosec if stamp else 0, index, rows))

    def decode(self) -> None:
        """Decode the messages that wait, and release them."""
        parts = [self._part(names, *map(np.array, zip(*messages)))
                 for (names, _), messages in self._rows.items()]
        parts += [self._part(states.names, *states.decoded()) for states in self._states]
        self._rows, self._states, self.waiting = {}, [], 0
        if parts:
            track = Track.concatenate(parts)
            self._tracks.append(track if len(parts) == 1 else track.take(np.argsort(track.order)))
            self.values += sum(values.size for values in self._tracks[-1].values.values())

    def track(self) -> Track | None:
        """Return all messages; None if there are none."""
        self.decode()
        return Track.concatenate(self._tracks) if self._tracks else None

    def _part(self, names: tuple[str, ...], receive: np.ndarray, stamp: np.ndarray,
              order: np.ndarray, rows: np.ndarray) -> Track:
        return Track(self.topic, self.signal, receive, stamp, order,
                     [] if self.signal in _ARRAYS else list(names), {
                         name: rows[:, k].copy() for k, name in enumerate(names)
                         if self._joint is None or self._joint.endswith(name)})


class _States:
    """Successive JointStates that are laid out alike, decoded together.

    They are most of a recording, and one by one would take four times as long.
    """

    def __init__(self, names: tuple[str, ...], message: Any, raw: bytes) -> None:
        self.names = names
        self._messages: list[tuple[int, int, bytes]] = []
        # After the stamp, each text has its length before it, each array its number of values.
        at, self._places = 16 + len(message.header.frame_id.encode()) + 1, [slice(4, 12)]
        at += -at % 4 + 4
        for name in message.name:
            at += -at % 4 + 4 + len(name.encode()) + 1
        for values in (message.position, message.velocity, message.effort):
            at += -at % 4 + 4
            at += -(at - 4) % 8 if len(values) else 0
            self._places.append(slice(at, at + 8 * len(values)))
            at += 8 * len(values)
        ends = [0, *(end for place in self._places for end in (place.start, place.stop)), len(raw)]
        self._fixed = [slice(*pair) for pair in zip(ends[::2], ends[1::2])]
        self._same = [raw[part] for part in self._fixed]

    def add(self, receive: int, index: int, raw: bytes) -> bool:
        """Add a message if all but its stamp and values is as in the first; return whether."""
        alike = [raw[part] for part in self._fixed] == self._same
        if alike:
            self._messages.append((receive, index, raw))
        return alike

    def decoded(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return times of receipt and stamps in ns, indices, and rows, as in a `Track`."""
        receive, order, payloads = zip(*self._messages)
        block = np.frombuffer(b''.join(payloads), np.uint8).reshape(len(payloads), -1)
        end = '<' if block[0, 1] else '>'
        seconds, nanoseconds = (block[:, part].copy().view(end + kind)[:, 0].astype(np.int64)
                                for part, kind in ((slice(4, 8), 'i4'), (slice(8, 12), 'u4')))
        rows = np.full((len(payloads), len(self.names), 3), np.nan)
        for column, place in enumerate(self._places[1:]):
            values = block[:, place].copy().view(end + 'f8')[:, :len(self.names)]
            rows[:, :values.shape[1], column] = values
        return np.array(receive), seconds * NANO + nanoseconds, np.array(order), rows
