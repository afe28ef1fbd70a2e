# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads ROS 1 bags with rosbags, as messages of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rosbags.rosbag1 import Reader, ReaderError
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import one_line
from friction_comp.recordings.mcap_file import DamagedError, Message, Wanted


class Ros1Bag:
    """One .bag file, with the interface of `McapFile`.

    Raises DamagedError if it cannot be read; `rosbag reindex` repairs a bag without an index.
    """

    def __init__(self, path: Path) -> None:
        self.notes: list[str] = []
        self.custom: dict[str, str] = {}
        self.encodings: dict[str, str] = {}
        self.progress = 0.0
        # Its types are those of the messages after conversion.
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._reader = Reader(path)
        try:
            self._reader.open()
        except (ReaderError, ValueError, OSError) as error:
            raise DamagedError(f'not a readable ROS 1 bag: {one_line(error)}') from None
        self.topics: dict[str, tuple[str, int]] = {
            connection.topic: (connection.msgtype, 0) for connection in self._reader.connections}

    def close(self) -> None:
        """Close the file."""
        if self._reader.bio is not None:
            self._reader.close()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        """Yield the messages in the order of time, as `McapFile.messages` does, as CDR."""
        for connection in self._reader.connections:
            kind, count = self.topics[connection.topic]
            self.topics[connection.topic] = kind, count + connection.msgcount
        chosen = [c for c in self._reader.connections if wanted(c.topic, c.msgtype)]
        total = max(sum(connection.msgcount for connection in chosen), 1)
        if chosen:
            try:
                for k, (connection, time, raw) in enumerate(self._reader.messages(chosen)):
                    self.progress = k / total
                    yield (connection.topic, connection.msgtype, int(time),
                           bytes(self._types.ros1_to_cdr(raw, connection.msgtype)))
            except (ReaderError, ValueError, OSError) as error:
                raise DamagedError(f'damaged: {one_line(error)}') from None
        self.progress = 1.0
