# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Finds recordings on disk and reads their raw signals into arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.columns import TABLES
from friction_comp.errors import InputError, one_line
from friction_comp.recordings import cdr
from friction_comp.recordings.activity import Activity, DIAGNOSTICS, from_diagnostics, SOURCES
from friction_comp.recordings.storage import (
    belongs_to_folder,
    is_storage,
    METADATA,
    Storage,
    unpack,
    unreadable,
)
from friction_comp.topics import TOPICS, TORQUE_UNIT

AnyPath = str | PathLike[str]
Progress = Callable[[float], None]

_BATCH = 20_000


def find_recordings(paths: AnyPath | Sequence[AnyPath]) -> list[Path]:
    """Return the recordings at paths; folders are searched for recordings.

    Parameters
    ----------
    paths : path-like or list of path-like
        Rosbag2 folders, single .mcap (or .db3) files, tables (.csv, .parquet, .npz), or folders
        that hold recordings at any depth, in the order of their names.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a path does not exist or holds no recording.
    """
    expanded: list[Path] = []
    for path in map(Path, [paths] if isinstance(paths, (str, PathLike)) else paths):
        try:
            if not path.exists():
                raise InputError(f'{path}: no such file or folder')
            recordings = list(_expand(path))
        except OSError as error:
            raise InputError(f'{path}: cannot be read: {error.strerror or error}') from None
        if not recordings:
            kind = 'no recording in this folder' if path.is_dir() else \
                'not a recording (a rosbag2 folder, an .mcap file or a table is needed: ' + (
                    ', '.join(TABLES) + ')')
            raise InputError(f'{path}: {kind}')
        expanded.extend(recordings)
    if not expanded:
        raise InputError('no recording given')
    unique: dict[Path, Path] = {}
    for path in expanded:
        unique.setdefault(path.resolve(), path)
    return list(unique.values())


def find_recording(path: AnyPath) -> Path:
    """Return the only recording at a path; raises InputError if there are none or several."""
    recordings = find_recordings(path)
    if len(recordings) != 1:
        raise InputError(f'{path}: holds {len(recordings)} recordings, expected one')
    return recordings[0]


def _expand(path: Path) -> Iterator[Path]:
    if path.is_file():
        if is_storage(path) or path.name.lower().endswith(TABLES):
            yield path
    elif (path / METADATA).is_file() or belongs_to_folder(path):
        yield path
    else:
        for child in sorted(path.iterdir()):
            # A hidden folder may be an unfinished recording. Tables in folders are results rather
            # than recordings.
            if not child.name.startswith('.') and (child.is_dir() or is_storage(child)):
                yield from _expand(child)


@dataclass
class Track:
    """One topic's messages in the order of the file.

    Attributes
    ----------
    receive, stamp : ndarray of int64
        Nanoseconds; stamp is 0 throughout where the message has none.
    order : ndarray of int64
        Index of each message among all that were read.
    names : list of str
        All joints or frames in the messages.
    values : dict of str to ndarray
        JointState: for each joint an array (N, 3) of position, velocity and effort, NaN where a
        message has none. Wrench and temperature: for each frame an array (N,). Arrays: the key ''
        and an array (N, J); for commands in N·m the key `TORQUE_UNIT`, with NaN for messages of the
        other unit. With a selected joint, only the values that may be its own.
    """

    topic: str
    signal: str
    receive: np.ndarray
    stamp: np.ndarray
    order: np.ndarray
    names: list[str]
    values: dict[str, np.ndarray]


@dataclass
class Scan:
    """Raw contents of one recording."""

    path: Path
    tracks: list[Track]
    topics: dict[str, tuple[str, int]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    custom: dict[str, str] = field(default_factory=dict)
    activity: list[Activity] = field(default_factory=list)
    effort_is_current: bool = False     # already in A, as tables may declare

    def of(self, signal: str) -> list[Track]:
        """Return the tracks of a signal; an exact topic name takes precedence over its ending."""
        tracks = [track for track in self.tracks if track.signal == signal]
        exact = [t for t in tracks if t.topic.rsplit('/', 1)[-1] == signal]
        return exact or tracks

    @property
    def model(self) -> str | None:
        """Active model file, if recorded."""
        for key in ('model_file', 'model_files', 'model'):
            if self.custom.get(key):
                return self.custom[key]
        named = [activity.model for activity in self.activity if activity.model]
        return named[-1] if named else None


def signal_of(topic: str, type_name: str) -> str | None:
    """Return the signal of a topic by its type and the ending of its name, or None."""
    for signal, wanted in TOPICS.items():
        if type_name == wanted and topic.endswith(signal):
            return signal
    return None


class Scanner:
    """Reads one recording batch by batch into its tracks.

    Parameters
    ----------
    path : Path
    signals : sequence of str
    joint : str, optional
        As for `scan_recording`.
    batch : int
        Messages that are decoded at once.
    """

    def __init__(self, path: Path, signals: Sequence[str] = tuple(TOPICS),
                 joint: str | None = None, batch: int = _BATCH) -> None:
        self._batch = batch
        self.path = path
        self.stores: dict[str, Store] = {}
        self._signals = signals
        self._joint = joint
        self._storage: Storage | None = None
        self._diagnostics: list[tuple[int, bytes]] = []
        self._begin = 0

    @property
    def progress(self) -> float:
        """Share of the recording that has been read."""
        return self._storage.progress if self._storage else 0.0

    def batches(self) -> Iterator[Store]:
        """Read the messages, and yield each store when it has decoded another batch."""
        try:
            self._storage = Storage(self.path)
            for index, (topic, kind, receive, raw) in enumerate(
                    self._storage.messages(self._wanted)):
                if not index:
                    self._begin = receive
                if kind == DIAGNOSTICS:
                    if any(node in raw for node in SOURCES):
                        self._diagnostics.append((receive, raw))
                    continue
                store = self.stores.get(topic)
                if store is None:
                    signal = signal_of(topic, kind)
                    assert signal is not None
                    store = self.stores[topic] = Store(
                        topic, signal, self._joint, self._batch)
                if store.add(receive, raw, index):
                    yield store
            for store in self.stores.values():
                store.flush()
        except InputError:
            raise
        # Corrupt files may raise anything in the storage libraries.
        except Exception as error:
            raise unreadable(self.path, one_line(error)) from None

    def _wanted(self, topic: str, kind: str) -> bool:
        return kind == DIAGNOSTICS or signal_of(topic, kind) in self._signals

    def finish(self) -> Scan:
        """Return what was read since the beginning, or since the last call."""
        assert self._storage is not None
        tracks = [track for store in self.stores.values() if (track := store.take()) is not None]
        notes = self._storage.notes + [
            f'{store.broken} of the messages of {store.topic} left out: broken, or more than '
            f'{cdr.MOST_VALUES} values' for store in self.stores.values() if store.broken]
        return Scan(
            self.path, tracks, self._storage.topics, notes, self._storage.custom,
            from_diagnostics(self._diagnostics, self._begin))


class Store:
    """Collects one topic and decodes it in batches, to limit the raw messages in memory.

    Parameters
    ----------
    topic, signal : str
    joint : str, optional
        Keep only this joint's values, where messages name joints.
    batch : int
        Messages that are decoded at once.
    """

    def __init__(self, topic: str, signal: str, joint: str | None = None,
                 batch: int = _BATCH) -> None:
        self._batch = batch
        self.topic, self.signal = topic, signal
        self._joint = joint
        self._raw: list[bytes] = []
        self._receive_times: list[int] = []
        self._order: list[int] = []
        self._names: dict[str, None] = {}
        self.broken = 0     # messages that cannot be decoded
        self._clear()

    def _clear(self) -> None:
        self._receives: list[np.ndarray] = []
        self._stamps: list[np.ndarray] = []
        self._orders: list[np.ndarray] = []
        self._parts: dict[str, list[tuple[int, np.ndarray]]] = {}
        self._size = 0

    def add(self, receive: int, raw: bytes, order: int) -> bool:
        """Add a message; return whether this completed and decoded a batch."""
        self._raw.append(raw)
        self._receive_times.append(receive)
        self._order.append(order)
        if len(self._raw) < self._batch:
            return False
        self.flush()
        return True

    def flush(self) -> None:
        """Decode the collected messages."""
        size = len(self._raw)
        if not size:
            return
        stamps = np.zeros(size, dtype=np.int64)
        batch: dict[str, np.ndarray] = {}
        broken: list[int] = []
        for index, names, fields in cdr.decode(
                TOPICS[self.signal], [unpack(raw) for raw in self._raw], broken):
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
        self.broken += len(broken)
        whole = np.delete(np.arange(size), broken)
        for key, value in batch.items():
            self._parts.setdefault(key, []).append((self._size, value[whole]))
        self._receives.append(np.array(self._receive_times, dtype=np.int64)[whole])
        self._orders.append(np.array(self._order, dtype=np.int64)[whole])
        self._stamps.append(stamps[whole])
        self._size += len(whole)
        self._raw, self._receive_times, self._order = [], [], []

    def _columns(self, names: tuple[str, ...], fields: dict[str, Any]
                 ) -> Iterator[tuple[str, np.ndarray]]:
        if 'data' in fields:
            yield TORQUE_UNIT if names == (TORQUE_UNIT,) else '', fields['data'].astype(float)
            return
        if 'position' in fields:
            # A single joint may have no name.
            names = names or ('',) * min(fields['position'].shape[1], 1)
        self._names.update(dict.fromkeys(names))
        for k, name in enumerate(names):
            if 'wrench' in fields:
                yield name, fields['wrench'][:, 5:6]
            elif 'temperature' in fields:
                yield name, fields['temperature'][:, :1]
            elif self._joint in (None, name) or not name:
                columns = np.full((len(fields['position']), 3), np.nan)
                for column, part in enumerate(('position', 'velocity', 'effort')):
                    if k < fields[part].shape[1]:
                        columns[:, column] = fields[part][:, k]
                yield name, columns

    def take(self) -> Track | None:
        """Return the decoded messages and clear them; None if there are none."""
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
        track = Track(self.topic, self.signal, np.concatenate(self._receives),
                      np.concatenate(self._stamps), np.concatenate(self._orders),
                      list(self._names), values)
        self._clear()
        return track
