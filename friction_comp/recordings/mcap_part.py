# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes one mcap file in whole chunks, each synced to the disk as soon as it is complete."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
import os
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer
import yaml

Qos = dict[str, Any]
_CHUNK = 1 << 20
# Bytes that may wait for a slow disk before the writer blocks.
_MAX_PENDING = 1 << 28


def span(first: int | None, last: int | None) -> dict[str, Any]:
    """Return an interval of time in ns as rosbag2's metadata hold it."""
    duration = 0 if first is None or last is None else last - first
    return {'starting_time': {'nanoseconds_since_epoch': first or 0},
            'duration': {'nanoseconds': duration}}


class SyncedFile:
    """A new file to which whole blocks are appended, and which is synced to the disk as it grows.

    Data are collected in memory until `flush`. Then one thread writes them and another syncs the
    file, so that a slow disk does not block the caller and a killed process loses only what was not
    written yet. If a block cannot be written, for instance because the disk is full, the file is
    truncated to the blocks before it.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open('xb', buffering=0)
        self._block = bytearray()
        self._size = self._written = 0
        self._failure: OSError | None = None
        self._sync_is_due = self._closing = False
        self._writing, self._syncing = ThreadPoolExecutor(1), ThreadPoolExecutor(1)

    def write(self, data: bytes) -> int:
        """Append to the present block."""
        if len(self._block) > _CHUNK:
            self.flush()
        self._block += data
        return len(data)

    def tell(self) -> int:
        """Return the size, including what is not yet written."""
        return self._size + len(self._block)

    def flush(self) -> None:
        """End the block and write it; raises OSError if an earlier one could not be written."""
        self._raise_failure()
        block, self._block = bytes(self._block), bytearray()
        self._size += len(block)
        self._writing.submit(self._write, block)
        if self._size - self._written > _MAX_PENDING:
            self.wait()

    def wait(self) -> None:
        """Wait until all blocks are written; raises OSError if one could not be."""
        self._writing.submit(int).result()
        self._raise_failure()

    def close(self) -> None:
        """Close the file after the remaining blocks; `join` waits for it."""
        if not self._closing:
            self._closing = True
            self._writing.submit(self._end)
            self._writing.shutdown(wait=False)

    def join(self) -> None:
        """Wait until the file is synced; raises OSError if it cannot be."""
        self._writing.shutdown()
        self._syncing.shutdown()
        self._raise_failure()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _write(self, block: bytes) -> None:
        if self._failure is not None:
            return
        left = memoryview(block)
        try:
            while left:
                left = left[self._file.write(left):]
        except OSError as error:
            self._failure = error
            self._file.truncate(self._written)
        else:
            self._written += len(block)
            if not self._sync_is_due:
                self._sync_is_due = True
                self._syncing.submit(self._sync)

    def _sync(self) -> None:
        self._sync_is_due = False
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            self._failure = self._failure or error

    def _end(self) -> None:
        self._syncing.submit(self._file.close)
        self._syncing.shutdown(wait=False)


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
        """Add a topic with its type, the type's definition, and its publishers' QoS."""
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                kind, 'ros2msg', definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic, 'cdr', self._schemas[kind],
            {'offered_qos_profiles': yaml.safe_dump(qos, sort_keys=False).strip()})
        self.counts[topic] = 0

    def write(self, topic: str, time: int, payload: bytes) -> None:
        """Add a message to the present chunk."""
        count = self.counts[topic]
        self._writer.add_message(self._channels[topic], time, payload, time, count)
        self.counts[topic] = count + 1
        self.first = time if self.first is None else min(self.first, time)
        self.last = time if self.last is None else max(self.last, time)

    def flush(self, wait: bool = False) -> None:
        """End the chunk and write it; return at once, or when it is written."""
        self._writer.flush()
        if wait:
            self._stream.wait()

    def finish(self, metadata: str) -> None:
        """End the file with an index and rosbag2's metadata; `join` waits until it is synced."""
        try:
            self.flush()
            self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
            self._writer.finish()
            self._stream.flush()
        finally:
            self._stream.close()

    def join(self) -> None:
        """Wait until the file is synced."""
        self._stream.join()

    def drop(self) -> None:
        """Close without an index; flushed chunks remain."""
        self._stream.close()
        with suppress(OSError):
            self._stream.join()

    def about(self) -> dict[str, Any]:
        """Return the file's entry in metadata.yaml."""
        return {'path': self.path.name, **span(self.first, self.last),
                'message_count': sum(self.counts.values())}
