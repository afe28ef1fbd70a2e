# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the signals of a rosbag2 recording into arrays."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from friction_comp.errors import InputError, one_line
from friction_comp.recordings import cdr
from friction_comp.recordings.activity import ActivityLog, DIAGNOSTICS
from friction_comp.recordings.storage import Storage, unpack, unreadable
from friction_comp.recordings.tracks import Scan, Track
from friction_comp.topics import TOPICS, TORQUE_UNIT


def signal_of(topic: str, type_name: str) -> str | None:
    """Return the signal of a topic by its type and the ending of its name, or None."""
    for signal, wanted in TOPICS.items():
        if type_name == wanted and topic.endswith(signal):
            return signal
    return None


class MessageScanner:
    """Reads one rosbag2 recording, or only one joint's values of it.

    Messages of a topic are decoded a batch at once.
    """

    def __init__(self, path: Path, joint: str | None = None, batch: int = 20_000) -> None:
        try:
            self._storage = Storage(path)
        except OSError as error:
            raise unreadable(path, one_line(error)) from None
        self._joint, self._batch = joint, batch
        self._topics: dict[str, _TopicReader] = {}
        self._activity = ActivityLog()

    @property
    def progress(self) -> float:
        """Share of the recording that has been read."""
        return self._storage.progress

    def scans(self) -> Iterator[Scan]:
        """Yield what was read since the last one: a batch of joint states, at the end the rest."""
        begin = 0
        try:
            for index, (topic, kind, receive, raw) in enumerate(
                    self._storage.messages(_is_wanted)):
                if not index:
                    begin = receive
                if kind == DIAGNOSTICS:
                    self._activity.add(receive, raw, begin)
                    continue
                reader = self._topics.get(topic)
                if reader is None:
                    signal = signal_of(topic, kind)
                    assert signal is not None
                    reader = self._topics[topic] = _TopicReader(topic, signal, self._joint)
                reader.add(receive, raw, index)
                if len(reader.raw) >= self._batch:
                    reader.decode()
                    if reader.signal == 'joint_states':
                        yield self._scan()
            yield self._scan()
        except InputError:
            raise
        # Corrupt files may raise anything in the storage libraries.
        except Exception as error:
            raise unreadable(self._storage.path, one_line(error)) from None

    def _scan(self) -> Scan:
        storage, readers = self._storage, self._topics.values()
        tracks = [track for reader in readers if (track := reader.take()) is not None]
        notes = storage.notes + [
            f'{reader.broken} of the messages of {reader.topic} left out: broken, or more than '
            f'{cdr.MOST_VALUES} values' for reader in readers if reader.broken]
        return Scan(storage.path, tracks, storage.topics, notes, storage.custom,
                    list(self._activity.changes))


def _is_wanted(topic: str, kind: str) -> bool:
    return kind == DIAGNOSTICS or signal_of(topic, kind) is not None


class _TopicReader:
    """Collects one topic's messages and decodes them together."""

    def __init__(self, topic: str, signal: str, joint: str | None) -> None:
        self.topic, self.signal = topic, signal
        self.raw: list[bytes] = []
        self.broken = 0     # messages that cannot be decoded
        self._joint = joint
        self._receive: list[int] = []
        self._order: list[int] = []
        self._names: dict[str, None] = {}
        self._tracks: list[Track] = []

    def add(self, receive: int, raw: bytes, order: int) -> None:
        self.raw.append(raw)
        self._receive.append(receive)
        self._order.append(order)

    def decode(self) -> None:
        """Decode the collected messages, so that they no longer take memory."""
        size = len(self.raw)
        stamps = np.zeros(size, dtype=np.int64)
        values: dict[str, np.ndarray] = {}
        broken: list[int] = []
        for index, names, fields in cdr.decode(
                TOPICS[self.signal], [unpack(raw) for raw in self.raw], broken):
            if 'stamp' in fields:
                stamps[index] = fields['stamp']
            for key, columns in self._columns(names, fields):
                known = values.get(key, np.empty((size, 0)))
                missing = columns.shape[1] - known.shape[1]
                if key not in values or missing > 0:
                    known = np.pad(known, ((0, 0), (0, max(missing, 0))), constant_values=np.nan)
                    values[key] = known
                known[index, :columns.shape[1]] = columns
        self.broken += len(broken)
        whole = np.delete(np.arange(size), broken)
        receive, order = (np.array(each, dtype=np.int64)[whole]
                          for each in (self._receive, self._order))
        if len(whole):
            self._tracks.append(Track(
                self.topic, self.signal, receive, stamps[whole], order, list(self._names),
                {key: value[whole] for key, value in values.items()}))
        self.raw, self._receive, self._order = [], [], []

    def _columns(self, names: tuple[str, ...], fields: dict[str, Any]
                 ) -> Iterator[tuple[str, np.ndarray]]:
        """Yield each key of `Track.values` with its columns of some messages."""
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
        """Return what was read since the last call; None if that is nothing."""
        if self.raw:
            self.decode()
        tracks, self._tracks = self._tracks, []
        return Track.concatenate(tracks) if tracks else None
