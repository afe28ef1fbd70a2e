# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finding recordings on disk and getting their raw signals into arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
import re

import numpy as np
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import InputError
from friction_comp.recordings import cdr

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# Signal name and topic ending to message type.
SIGNALS = {
    'joint_states': cdr.JOINT_STATE,
    'current_command': cdr.FLOAT_ARRAY,
    'direction': cdr.INT8_ARRAY,
    'reference': cdr.JOINT_STATE,
    'interaction_wrench': cdr.WRENCH,
    'motor_temperature': cdr.TEMPERATURE,
}
_STORAGE = ('.mcap', '.db3')
_BATCH = 20_000


def find_recordings(paths):
    """Return the recordings that paths name; folders of recordings are expanded.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, single .mcap (or .db3) files, or folders that hold such things at any
        depth, taken in the order of their names.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a path does not exist or holds no recording.
    """
    if isinstance(paths, (str, Path)):
        paths = [paths]
    found = []
    for path in map(Path, paths):
        try:
            if not path.exists():
                raise InputError(f'{path}: no such file or folder')
            recordings = list(_expand(path))
        except OSError as error:
            raise InputError(f'{path}: cannot be read: {error.strerror or error}') from None
        if not recordings:
            kind = 'no recording in this folder' if path.is_dir() else \
                'not a recording (a rosbag2 folder or an .mcap file is needed)'
            raise InputError(f'{path}: {kind}')
        found.extend(recordings)
    if not found:
        raise InputError('no recording given')
    unique = {}
    for path in found:
        unique.setdefault(path.resolve(), path)
    return list(unique.values())


def _expand(path):
    if path.is_file():
        if path.suffix in _STORAGE:
            yield path
    elif (path / 'metadata.yaml').is_file():
        yield path
    else:
        for child in sorted(path.iterdir()):
            # A hidden folder may be a recording in the making.
            if not child.name.startswith('.'):
                yield from _expand(child)


@dataclass
class Track:
    """One topic's messages of one layout-independent shape.

    Attributes
    ----------
    receive, stamp : ndarray of int64
        Nanoseconds; stamp is 0 throughout where the message has none.
    values : dict of str to ndarray
        JointState: per joint name an array (N, 3) of position, velocity, effort with NaN where a
        message leaves one empty. Wrench and temperature: per frame an array (N,). Arrays: the key
        '' and an array (N, J).
    """

    topic: str
    signal: str
    receive: np.ndarray
    stamp: np.ndarray
    values: dict


@dataclass
class Scan:
    """What one recording holds."""

    path: Path
    tracks: list
    topics: dict = field(default_factory=dict)
    model: str | None = None

    def of(self, signal):
        """Return the tracks of a signal; an exact last name goes before a mere ending."""
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        return exact or tracks


def signal_of(topic, type_name):
    """Return the signal that a topic carries by its type and the ending of its name, or None."""
    for signal, wanted in SIGNALS.items():
        if type_name == wanted and topic.endswith(signal):
            return signal
    return None


def scan_recording(path, signals=tuple(SIGNALS), progress=None):
    """Read the signals of one recording.

    Parameters
    ----------
    path : path-like
        One recording, as `find_recordings` returns it.
    signals : tuple of str
        Which to read.
    progress : callable, optional
        Called with the share 0..1 that has been read.

    Returns
    -------
    Scan

    Raises
    ------
    InputError
        If the recording cannot be read; the reason is named.
    """
    path = Path(path)
    try:
        with Reader(path) as reader:
            return _scan(path, reader, signals, progress)
    except InputError:
        raise
    # Broken files fail in many ways inside the storage libraries, by absurd sizes among them: each
    # is the file's fault.
    except Exception as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InputError(
            f'{path}: not a readable recording, perhaps truncated or still being written: '
            f'{reason}') from None


def _scan(path, reader, signals, progress):
    topics, wanted, diagnostics = {}, {}, []
    for connection in reader.connections:
        kind, count = topics.get(connection.topic, (connection.msgtype, 0))
        topics[connection.topic] = (kind, count + connection.msgcount)
        signal = signal_of(connection.topic, connection.msgtype)
        if signal in signals:
            if connection.ext.serialization_format not in ('cdr', ''):
                raise InputError(f'{path}: {connection.topic} is not serialised as CDR')
            wanted.setdefault((connection.topic, signal), []).append(connection)
        elif connection.msgtype == DIAGNOSTICS:
            diagnostics.append(connection)
    total = max(sum(topics[topic][1] for topic, _ in wanted), 1)
    stores = {topic: _Store(topic, signal) for topic, signal in wanted}
    connections = [c for group in wanted.values() for c in group]
    done = 0
    if connections:
        for connection, receive, raw in reader.messages(connections):
            if stores[connection.topic].add(receive, raw) and progress:
                done += _BATCH
                progress(min(done / total, 1.0))
    tracks = [track for store in stores.values() if (track := store.finish()) is not None]
    custom = getattr(reader.storage, 'metadata', None)
    model = _model_in_custom_data(custom.custom if custom else None)
    if model is None and diagnostics:
        model = _model_in_diagnostics(reader, diagnostics)
    return Scan(path, tracks, topics, model)


class _Store:
    """Collects one topic, decoding a batch at a time so that raw messages do not pile up."""

    def __init__(self, topic, signal):
        self.topic, self.signal = topic, signal
        self._raw, self._receive = [], []
        self._receives, self._stamps = [], []
        self._parts = {}
        self._size = 0

    def add(self, receive, raw):
        self._raw.append(raw)
        self._receive.append(receive)
        if len(self._raw) < _BATCH:
            return False
        self._flush()
        return True

    def _flush(self):
        size = len(self._raw)
        stamps = np.zeros(size, dtype=np.int64)
        batch = {}
        try:
            for index, names, fields in cdr.decode(SIGNALS[self.signal], self._raw):
                if 'stamp' in fields:
                    stamps[index] = fields['stamp']
                for key, value in self._columns(names, fields):
                    if key not in batch or batch[key].shape[1:] != value.shape[1:]:
                        width = max(value.shape[1], batch[key].shape[1] if key in batch else 0)
                        wide = np.full((size, width), np.nan)
                        if key in batch:
                            wide[:, :batch[key].shape[1]] = batch[key]
                        batch[key] = wide
                    batch[key][index, :value.shape[1]] = value
        except ValueError as error:
            raise ValueError(f'a message of {self.topic} is broken: {error}') from None
        for key, value in batch.items():
            self._parts.setdefault(key, []).append((self._size, value))
        self._receives.append(np.array(self._receive, dtype=np.int64))
        self._stamps.append(stamps)
        self._size += size
        self._raw, self._receive = [], []

    def _columns(self, names, fields):
        if 'position' in fields:
            # A lone joint may come without a name.
            names = names or ('',) * min(fields['position'].shape[1], 1)
            for k, name in enumerate(names):
                columns = np.full((len(fields['position']), 3), np.nan)
                for column, part in enumerate(('position', 'velocity', 'effort')):
                    if k < fields[part].shape[1]:
                        columns[:, column] = fields[part][:, k]
                yield name, columns
        elif 'data' in fields:
            yield '', fields['data'].astype(float)
        elif 'wrench' in fields:
            yield names[0], fields['wrench'][:, 5:6]
        else:
            yield names[0], fields['temperature'][:, :1]

    def finish(self):
        if self._raw:
            self._flush()
        if not self._size:
            return None
        values = {}
        for key, parts in self._parts.items():
            width = max(part.shape[1] for _, part in parts)
            full = np.full((self._size, width), np.nan)
            while parts:
                start, part = parts.pop()
                full[start:start + len(part), :part.shape[1]] = part
            values[key] = full
        return Track(self.topic, self.signal, np.concatenate(self._receives),
                     np.concatenate(self._stamps), values)


def _model_in_custom_data(custom):
    if isinstance(custom, dict):
        for key in ('model_file', 'model_files', 'model'):
            if custom.get(key):
                return str(custom[key])
    return None


def _model_in_diagnostics(reader, connections):
    """Return the last model file that a compensator reported, or None."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found = None
    for _, _, raw in reader.messages(connections):
        # Most messages are other nodes' and say nothing of a model.
        if b'model' not in raw:
            continue
        for status in store.deserialize_cdr(raw, DIAGNOSTICS).status:
            if 'compensator' not in f'{status.name} {status.hardware_id}':
                continue
            for item in status.values:
                if item.key in ('model_file', 'model_files', 'model') and item.value.strip('[] '):
                    # One file a joint comes as a list: its brackets and quotes are no names.
                    found = re.sub(r"""['"\[\]]""", '', item.value)
    return found
