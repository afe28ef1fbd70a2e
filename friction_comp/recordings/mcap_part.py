# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes one mcap file in whole chunks, each synced to the disk as soon as it is complete."""

from __future__ import annotations

from collections import deque
from contextlib import suppress
import os
from pathlib import Path
import threading
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
    """A file to which whole blocks are appended, and which is synced to the disk as it grows.

    Data are collected in memory until `flush`. Then one thread writes them and another syncs the
    file, so that a slow disk does not block the caller and a killed process loses only what was not
    written yet. If a block cannot be written, for instance because the disk is full, the file is
    truncated to the blocks before it.

    Parameters
    ----------
    path : Path
        Must not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = path.open('xb', buffering=0)
        self._pending = bytearray()
        self._size = 0
        self._written = 0
        self._change = threading.Condition()
        self._blocks: deque[bytes] = deque()
        self._failure: OSError | None = None
        self._closing = False
        self._threads = [threading.Thread(target=work, name=f'{name} {path.name}', daemon=True)
                         for name, work in (('write', self._write), ('sync', self._sync))]
        for thread in self._threads:
            thread.start()

    def write(self, data: bytes) -> int:
        """Append to the present block."""
        if len(self._pending) > _CHUNK:
            self.flush()
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the size, including what is not yet written."""
        return self._size + len(self._pending)

    def flush(self) -> None:
        """End the block and write it; raises OSError if an earlier one could not be written."""
        block, self._pending = bytes(self._pending), bytearray()
        with self._change:
            self._raise_failure()
            self._size += len(block)
            self._blocks.append(block)
            self._change.notify_all()
            while self._size - self._written > _MAX_PENDING and self._failure is None:
                self._change.wait()

    def wait(self) -> None:
        """Wait until all blocks are written; raises OSError if one could not be."""
        with self._change:
            while self._written < self._size and self._failure is None:
                self._change.wait()
            self._raise_failure()

    def close(self) -> None:
        """Write the remaining blocks and close the file; `join` waits for it."""
        with self._change:
            self._closing = True
            self._change.notify_all()

    def join(self) -> None:
        """Wait until the file is synced; raises OSError if it cannot be."""
        for thread in self._threads:
            thread.join()
        self._raise_failure()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _write(self) -> None:
        while True:
            with self._change:
                while not self._blocks and not self._closing:
                    self._change.wait()
                if not self._blocks:
                    return
                block = memoryview(self._blocks.popleft())
            try:
                done = 0
                while done < len(block):
                    done += self._file.write(block[done:]) or 0
            except OSError as error:
                self._file.truncate(self._written)
                self._fail(error)
                return
            with self._change:
                self._written += len(block)
                self._change.notify_all()

    def _sync(self) -> None:
        synced = 0
        while True:
            with self._change:
                while self._written == synced and not self._closing and self._failure is None:
                    self._change.wait()
                target = self._written
                ended = self._failure is not None or (self._closing and not self._blocks
                                                      and target == self._size)
            if target > synced:
                try:
                    os.fsync(self._file.fileno())
                except OSError as error:
                    self._fail(error)
                synced = target
            elif not ended:
                # Closing while the last blocks are being written.
                with self._change:
                    self._change.wait(0.1)
            if ended and target == synced:
                break
        self._threads[0].join()
        self._file.close()

    def _fail(self, error: OSError) -> None:
        with self._change:
            self._failure = self._failure or error
            self._change.notify_all()


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

    def flush(self) -> None:
        """End the chunk and write it."""
        self._writer.flush()

    def wait(self) -> None:
        """Wait until flushed data are written."""
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
