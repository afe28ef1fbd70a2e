# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One mcap file in the making: whole chunks, put onto the disk as they come."""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
import threading
from typing import Any

from mcap.writer import CompressionType, Writer
import yaml

Qos = dict[str, Any]
_CHUNK = 1 << 20


def span(first: int | None, last: int | None) -> dict[str, Any]:
    """Return a stretch of time in ns in the words of rosbag2's metadata."""
    duration = 0 if first is None or last is None else last - first
    return {'starting_time': {'nanoseconds_since_epoch': first or 0},
            'duration': {'nanoseconds': duration}}


class SyncedFile:
    """A file to which whole blocks are appended, and which a thread keeps putting onto the disk.

    What is written gathers in memory until `flush`; then it goes out at once. If that fails, for
    want of space, the file is cut back to the last whole block.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open('xb', buffering=0)
        self._pending = bytearray()
        self._size = 0
        self._dirty = threading.Event()
        self._closing = False
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._sync, name='sync', daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> int:
        """Take part of a block."""
        if len(self._pending) > _CHUNK:
            self.flush()
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the size with what has not gone out yet."""
        return self._size + len(self._pending)

    def flush(self) -> None:
        """Write the block; raises OSError, and leaves what was there, if it cannot."""
        if self._failure is not None:
            raise self._failure
        block, self._pending = memoryview(self._pending), bytearray()
        try:
            done = 0
            while done < len(block):
                done += self._file.write(block[done:]) or 0
        except OSError:
            self._file.truncate(self._size)
            self._file.seek(self._size)
            raise
        self._size += len(block)
        self._dirty.set()

    def _sync(self) -> None:
        while not self._closing:
            self._dirty.wait()
            self._dirty.clear()
            try:
                os.fsync(self._file.fileno())
            except OSError as error:
                self._failure = error
                return

    def close(self) -> None:
        """Put everything onto the disk and close the file."""
        self._closing = True
        self._dirty.set()
        self._thread.join()
        try:
            if self._failure is None:
                os.fsync(self._file.fileno())
        finally:
            self._file.close()


class McapPart:
    """One mcap file of a recording."""

    def __init__(self, path: Path, compressed: bool) -> None:
        self.path = path
        self.counts: dict[str, int] = {}
        self.first: int | None = None
        self.last: int | None = None
        self._stream = SyncedFile(path)
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK, enable_data_crcs=True,  # type: ignore[arg-type]
            compression=CompressionType.ZSTD if compressed else CompressionType.NONE)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer.start(profile='ros2', library='friction_comp')
        self._stream.flush()

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._stream.tell()

    def declare(self, topic: str, kind: str, definition: str, qos: list[Qos]) -> None:
        """Add a topic with its type, the type's definition, and what its publishers offer."""
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                kind, 'ros2msg', definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic, 'cdr', self._schemas[kind],
            {'offered_qos_profiles': yaml.safe_dump(qos, sort_keys=False).strip()})
        self.counts[topic] = 0

    def write(self, topic: str, time: int, payload: bytes) -> None:
        """Add a message to the chunk in the making."""
        count = self.counts[topic]
        self._writer.add_message(self._channels[topic], time, payload, time, count)
        self.counts[topic] = count + 1
        self.first = time if self.first is None else min(self.first, time)
        self.last = time if self.last is None else max(self.last, time)

    def flush(self) -> None:
        """End the chunk and write it."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self, metadata: str) -> None:
        """End the file with an index and rosbag2's metadata."""
        try:
            self.flush()
            self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.flush()
        finally:
            self._stream.close()

    def drop(self) -> None:
        """Close without an end; what was flushed stays."""
        with suppress(OSError):
            self._stream.close()

    def about(self) -> dict[str, Any]:
        """Return what metadata.yaml says of the file."""
        return {'path': self.path.name, **span(self.first, self.last),
                'message_count': sum(self.counts.values())}
