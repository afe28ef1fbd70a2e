# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Reads ROS 1 bags with rosbags, as messages of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rosbags.rosbag1 import Reader, ReaderError
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import one_line
from friction_comp.recordings.mcap_file import DamagedError, Message, MessageFile, Wanted


class Ros1Bag(MessageFile):
    """One .bag file, with messages as CDR in the order of time.

    Raises DamagedError if it cannot be read; `rosbag reindex` repairs a bag without an index.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        # Its types are those of the messages after conversion.
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._reader = Reader(path)
        try:
            self._reader.open()
        except (ReaderError, ValueError, OSError) as error:
            raise DamagedError(f'not a readable ROS 1 bag: {one_line(error)}') from None
        self.topics = {one.topic: (one.msgtype, 0) for one in self._reader.connections}

    def close(self) -> None:
        if self._reader.bio is not None:
            self._reader.close()

    def messages(self, wanted: Wanted) -> Iterator[Message]:
        for connection in self._reader.connections:
            self.count(connection.topic, connection.msgcount)
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
