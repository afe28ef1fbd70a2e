# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Raw contents of a bag as arrays: a track for each topic, and what a compensator reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.errors import InputError, one_of, os_errors_name
from friction_comp.messages import NANO, TOPICS, TORQUE_UNIT
from friction_comp.recordings.storage import Storage, unpack
from friction_comp.tables.columns import STATES
from friction_comp.tables.units import Unit

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
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
# Most joints, or values of a joint, in one message: a corrupt one could fill the memory.
_MOST_NAMES = 200
# Messages that are turned into arrays at once, and most numbers of one topic that are kept.
_BATCH, _MOST = 20_000, 50_000_000


def _message_types() -> Typestore:
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
    names: list[str]  # all joints or frames in the messages
    # JointState: by joint, arrays (N, 3) of position, velocity and effort, NaN where a message has
    # none. DynamicJointState: (N, 5), also current and temperature. Wrench and temperature: by
    # frame, arrays (N, 1). Float64MultiArray and Int8MultiArray: an array (N, J) with the key '',
    # or `TORQUE_UNIT` for commands in N·m, NaN in messages of the other unit.
    values: dict[str, np.ndarray]


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

    def add(self, time: int, message: Any, begin: int) -> None:
        """Add a DiagnosticArray received at `time`, ns.

        A compensator's first report also applies to the time before it, back to `begin`, ns.
        """
        before = len(self.changes)
        for status in message.status:
            last = self.changes[-1] if self.changes else None
            activity = _activity_of(status, time, last)
            if activity and (last is None or replace(
                    activity, time=last.time, joints=last.joints) != last):
                self.changes.append(activity)
        if not before and self.changes:
            first = self.changes[0]
            # It reports every second of real time, in which a simulation may advance by several.
            if first.time - begin < 10 * NANO and first.state != 'identification':
                self.changes[0] = replace(first, time=min(first.time, begin))


def _activity_of(status: Any, time: int, last: Activity | None) -> Activity | None:
    """Return what a DiagnosticStatus of a compensator or of identification says, else None."""
    values = {item.key: item.value for item in status.values}
    if 'identification' in status.name:
        # The node reports a phase only while it moves a joint.
        if 'phase' in values:
            return Activity(time, 'identification', '', '', status.hardware_id)
        return Activity(time, '', '', '') if last and last.state == 'identification' else None
    if 'compensator' not in f'{status.name} {status.hardware_id}':
        return None
    # One file per joint is reported as a list: remove its brackets and quotes.
    model = re.sub(r"""['"\[\]]""", '', values.get('model_files', ''))
    return Activity(time, values.get('state', ''), values.get('law', ''), model, status.hardware_id,
                    values.get('settings', ''))


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

    def of(self, signal: str, topic: str = '') -> list[Track]:
        """Return the tracks of a signal: those of topics with exactly its name, otherwise all.

        Those in the namespace of a `topic` go before another robot's.
        """
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        namespace = topic.rpartition('/')[0] + '/'
        return sorted(exact or tracks, key=lambda track: not track.topic.startswith(namespace))

    @property
    def joints(self) -> dict[str, tuple[Track, str]]:
        """Track of each joint, and its name there; /TOPIC/NAME where several topics hold it."""
        found = [(track, name) for track in self.of('joint_states') for name in track.names]
        count = Counter(name for _, name in found)
        return {f'{track.topic}/{name}' if count[name] > 1 else name: (track, name)
                for track, name in found}

    def find(self, joint: str | None) -> tuple[Track, str]:
        """Return the track of a joint, the only one by default, and its name there.

        Raises InputError with the choices if it is not clear.
        """
        joints, wanted = self.joints, TOPICS['joint_states']
        if not joints:
            own = sorted(topic for topic, (kind, _) in self.topics.items() if kind == wanted)
            if any(topic.endswith('joint_states') for topic in own):
                raise InputError(f'{self.path}: its joint_states contain no message, or no joint')
            raise InputError(f'{self.path}: no joint_states of type {wanted} in it ' + (
                f'(of that type are {", ".join(own)}: name one, with its joint, as --joint '
                '/TOPIC/NAME)' if own else f'(topics: {", ".join(sorted(self.topics)) or "none"})'))
        # A single joint may have no name in the recording; any may be named with its topic.
        if [*joints] == ['']:
            return joints['']
        whole = {f'{track.topic}/{name}': (track, name) for track, name in joints.values()}
        return {**whole, **joints}[joint if joint in whole else one_of(
            [*joints], joint, self.path)]

    def siblings(self, joint: str | None) -> list[str]:
        """Return the joints of an arm: of a joint's topic, and of others with other names."""
        own, _ = self.find(joint)
        return [name for name, (track, plain) in self.joints.items()
                if track is own or plain not in own.names]

    @property
    def model(self) -> str | None:
        """Active model file, if recorded: that in the metadata, else the one reported last."""
        named = [activity.model for activity in self.activity if activity.model]
        return self.custom.get('model_file') or (named[-1] if named else None)


def signal_of(topic: str, type_name: str) -> str | None:
    """Return the signal of a topic, found by its type and the ending of its name, or None."""
    return next((signal for signal, wanted in _TYPES.items()
                 if type_name == wanted and topic.endswith(signal)), None)


def read_bag(path: Path, joint: str | None = None, units: Mapping[str, Unit] | None = None,
             first: float = math.inf) -> Scan:
    """Return what a bag holds; `joint` may name a topic of joint states of any name.

    Only the beginning is read until there are `first` joint states, or more than the memory takes.
    Raises InputError if it cannot be read.
    """
    def signal(topic: str, kind: str) -> str | None:
        # Joint states may have any name if the user gives it.
        named = kind == TOPICS['joint_states'] and (joint or '').startswith(f'{topic}/')
        return signal_of(topic, kind) or ('joint_states' if named else None)

    types, readers, activity, begin = _message_types(), dict[str, _Reader](), _ActivityLog(), 0
    notes: list[str] = []
    with os_errors_name(path, 'cannot be read: '):
        storage = Storage(path)
        with closing(storage.messages(
                lambda topic, kind: kind == _DIAGNOSTICS or signal(topic, kind) is not None)
        ) as messages:
            for topic, kind, receive, raw in messages:
                begin = begin or receive
                if topic not in readers:
                    readers[topic] = _Reader(topic, signal(topic, kind) or '')
                reader = readers[topic]
                try:
                    message = types.deserialize_cdr(unpack(raw), kind)
                    if kind == _DIAGNOSTICS:
                        activity.add(receive, message, begin)
                    else:
                        reader.add(receive, message)
                # A broken message may raise anything.
                except Exception:
                    reader.broken += 1
                if reader.waiting >= _BATCH:
                    reader.decode()
                    if reader.numbers > _MOST:
                        notes.append('the recording is very long: only its first '
                                     f'{(receive - begin) / NANO:.0f} s were read')
                        break
                if reader.signal in ('joint_states', _DYNAMIC) and reader.count >= first:
                    break
    tracks, in_ampere, noted = _with_effort([
        track for reader in readers.values() if (track := reader.track()) is not None])
    notes += noted + [
        f'{reader.broken} of the messages of {reader.topic} left out: broken, or more than '
        f'{_MOST_NAMES} joints' for reader in readers.values() if reader.broken]
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


def _content(message: Any) -> tuple[Sequence[str], Any]:
    """Return the joints or frames of a message, and columns of values: one of each, or fewer."""
    if hasattr(message, 'data'):
        labels = [dimension.label for dimension in message.layout.dim[1:2]]
        return [TORQUE_UNIT if labels == [TORQUE_UNIT] else ''], message.data[:, None]
    if hasattr(message, 'wrench'):
        return [message.header.frame_id], [[message.wrench.torque.z]]
    if hasattr(message, 'temperature'):
        return [message.header.frame_id], [[message.temperature]]
    if hasattr(message, 'interface_values'):
        rows = np.full((len(message.joint_names), len(set(_INTERFACES.values()))), np.nan)
        for row, own in zip(rows, message.interface_values):
            for name, value in zip(own.interface_names, own.values):
                if name in _INTERFACES:
                    row[_INTERFACES[name]] = value
        return message.joint_names, rows.T
    # A single joint may have no name.
    return message.name or [''] * min(len(message.position), 1), (
        message.position, message.velocity, message.effort)


class _Reader:
    """Collects the messages of a topic."""

    def __init__(self, topic: str, signal: str) -> None:
        self.topic, self.signal = topic, signal
        # Messages, those that wait to be decoded and without sense, and numbers that were decoded.
        self.count = self.waiting = self.broken = self.numbers = 0
        # Times of receipt, stamps and columns of messages with the same names and lengths.
        self._rows: dict[Any, list[tuple[Any, ...]]] = {}
        # Index of the messages, their times, and values by name.
        self._parts: list[tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]] = []

    def add(self, receive: int, message: Any) -> None:
        """Add a message, received at a time in ns; raises an error if it makes no sense."""
        names, columns = _content(message)
        shape = *names, *map(len, columns)
        if max(len(names), len(columns)) > _MOST_NAMES or receive >= 2 ** 63:
            raise ValueError
        stamp = message.header.stamp if hasattr(message, 'header') else None
        self._rows.setdefault((len(names), shape), []).append((
            self.count, receive, stamp.sec * NANO + stamp.nanosec if stamp else 0, *columns))
        self.waiting += 1
        self.count += 1

    def decode(self) -> None:
        """Turn the messages that wait into arrays, and release them."""
        for (count, shape), messages in self._rows.items():
            index, receive, stamp, *columns = zip(*messages)
            rows = np.full((len(index), count, len(columns)), np.nan)
            for k, column in enumerate(columns):
                values = np.array(column)[:, :count]
                rows[:, :values.shape[1], k] = values
            self.numbers += rows.size
            self._parts.append((np.array(index), np.array([receive, stamp]), {
                name: rows[:, k] for k, name in enumerate(shape[:count])}))
        self._rows, self.waiting = {}, 0

    def track(self) -> Track | None:
        """Return all messages; None if there are none."""
        self.decode()
        if not self._parts:
            return None
        receive, stamp = np.empty((2, self.count), dtype=np.int64)
        widths = Counter[str]()
        for _, _, own in self._parts:
            widths |= Counter({name: rows.shape[1] for name, rows in own.items()})
        values = {name: np.full((self.count, width), np.nan) for name, width in widths.items()}
        while self._parts:
            index, times, own = self._parts.pop()
            receive[index], stamp[index] = times
            for name, rows in own.items():
                values[name][index, :rows.shape[1]] = rows
        names = [] if self.signal in _ARRAYS else [*widths]
        return Track(self.topic, self.signal, receive, stamp, names, values)


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
        kept.append(replace(track, signal='joint_states', names=moving, values={
            name: track.values[name][:, [0, 1, _CURRENT if in_ampere else _EFFORT]]
            for name in moving}))
        if warm := known(track, _TEMPERATURE):
            kept.append(replace(
                track, topic=f'{track.topic}, temperature', signal='motor_temperature',
                values={name: track.values[name][:, [_TEMPERATURE]] for name in warm}))
    return kept, in_ampere, [f'{dynamic[0].topic} is used, since no joint_states hold an effort']
