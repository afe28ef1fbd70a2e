# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes rosbag2 recordings (mcap) that `ros2 bag info` and `ros2 bag play` accept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import shutil
from types import TracebackType
from typing import Any, Literal

from mcap.writer import CompressionType, Writer
from rosbags.typesys import get_typestore, Stores
import zstandard

from friction_comp.errors import InputError, os_errors_name
from friction_comp.files import dump_yaml, write_atomically
from friction_comp.recordings.storage import AnyPath, METADATA

Qos = dict[str, Any]
_VERSION = 9
# rosbag2's value of a duration that is not set.
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
# Smallest size and duration of a file, bytes and s: each file needs an index and a thread.
_MIN_SIZE, _MIN_DURATION = 10_000, 0.1
_COMPRESSIONS = ('none', 'message', 'storage')
_CHUNK = 1 << 20


def qos_profile(reliability: str = 'reliable', durability: str = 'volatile') -> Qos:
    """Return a publisher's quality of service as rosbag2's metadata store it."""
    return {'history': 'keep_last', 'depth': 10, 'reliability': reliability,
            'durability': durability, 'deadline': _INFINITE, 'lifespan': _INFINITE,
            'liveliness': 'automatic', 'liveliness_lease_duration': _INFINITE,
            'avoid_ros_namespace_conventions': False}


class RecordingWriter:
    """A rosbag2 folder with mcap storage that is readable at any time while it is written.

    Messages are collected in chunks with checksums, each written whole when it is full or `flush`
    is called. If the process is killed, only messages after the last chunk are lost; a full disk
    loses nothing that was written. ``metadata.yaml`` exists from the beginning.

    `custom_data`, of which ``model_file`` is the active model, is stored in metadata.yaml.
    `compression` is 'none', 'message' or 'storage' (chunks inside the mcap file), all with zstd.
    The next file begins after `split_size` bytes (from 10,000) and `split_duration` s (from 0.1);
    0: never. Raises InputError if the folder `path` exists or cannot be created, or files would be
    too small.
    """

    def __init__(self, path: AnyPath, custom_data: dict[str, str] | None = None,
                 compression: str = 'none', split_size: float = 0,
                 split_duration: float = 0.0) -> None:
        self.path = Path(path)
        if compression not in _COMPRESSIONS:
            raise InputError(f'compression must be none, message or storage, not {compression!r}')
        if 0.0 < split_size < _MIN_SIZE:
            raise InputError(f'max_file_size: {1e-6 * split_size:g} MB is too small: '
                             f'{1e-6 * _MIN_SIZE:g} MB is the least, 0 writes a single file')
        if 0.0 < split_duration < _MIN_DURATION:
            raise InputError(f'max_file_duration: {split_duration:g} s is too short: '
                             f'{_MIN_DURATION:g} s is the least, 0 writes a single file')
        self.custom_data = dict(custom_data or {})
        self._compression = compression
        self._split_size, self._split_duration = split_size, 1e9 * split_duration
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[str, tuple[str, str, list[Qos]]] = {}
        self._files: list[_McapFile] = []
        self._is_open = True
        self.message_count = 0
        if self.path.exists():
            raise InputError(f'{self.path}: already exists, a recording needs a new folder')
        with os_errors_name(self.path, 'cannot be written: '):
            self.path.mkdir(parents=True)
        with self._closed_on_error():
            self._begin_file()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 traceback: TracebackType | None) -> Literal[False]:
        if kind is None or self.message_count:
            self.close()
        else:
            self.abort()
        return False

    def add_topic(self, topic: str, type_name: str, qos: Sequence[Qos] = ()) -> str:
        """Declare a topic, so that it is listed even without messages; return its absolute name.

        `qos` are the profiles of its publishers, see `qos_profile`; rosbag2's default when empty.
        Raises InputError if it is not a message type of ROS 2 Jazzy.
        """
        name = topic if topic.startswith('/') else f'/{topic}'
        if name not in self._topics:
            if type_name not in self._types.fielddefs:
                raise InputError(f'{type_name}: not a message type of ROS 2 Jazzy')
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            self._topics[name] = type_name, definition, list(qos) or [qos_profile()]
            self._files[-1].declare(name, *self._topics[name])
        return name

    def write(self, topic: str, type_name: str, stamp_ns: int, cdr: bytes) -> None:
        """Append a message: its time in ns and its CDR with encapsulation header.

        Raises InputError if writing fails, for instance because the disk is full. The recording is
        then closed, and what was written before can be read.
        """
        if not self._is_open:
            raise InputError(f'{self.path}: the recording is closed')
        name = self.add_topic(topic, type_name)
        if self._compression == 'message':
            cdr = zstandard.compress(cdr)
        with self._closed_on_error():
            if self._is_full(stamp_ns):
                self._finish_file()
                self._begin_file()
            self._files[-1].write(name, int(stamp_ns), cdr)
        self.message_count += 1

    def flush(self) -> None:
        """End the current chunk and write it; raises InputError as `write` does."""
        if self._is_open:
            with self._closed_on_error():
                self._files[-1].flush()

    def close(self) -> None:
        """Finish the recording; raises InputError if nothing was recorded, or the disk is full."""
        if not self._is_open:
            return
        if not self.message_count:
            self.abort()
            raise InputError(f'{self.path}: nothing was recorded, so nothing is written')
        with self._closed_on_error():
            self._finish_file()
            for file in self._files:
                file.stream.join()
            self._save_metadata()
        self._is_open = False

    def abort(self) -> None:
        """Close and delete the recording."""
        if self._is_open:
            self._drop_files()
        shutil.rmtree(self.path, ignore_errors=True)

    def _begin_file(self) -> None:
        file = _McapFile(self.path / f'{self.path.name}_{len(self._files)}.mcap',
                         self._compression == 'storage')
        self._files.append(file)
        for topic, description in self._topics.items():
            file.declare(topic, *description)
        # Not synced: the caller is recording and must not wait for the disk.
        self._save_metadata(sync=False)

    def _is_full(self, time: int) -> bool:
        file = self._files[-1]
        if file.first is None:
            return False
        # The absolute value: the first stamp may be far ahead of all others.
        elapsed = abs(time - file.first)
        return bool((self._split_size and file.stream.tell() >= self._split_size)
                    or (self._split_duration and elapsed >= self._split_duration))

    def _finish_file(self) -> None:
        self._files[-1].finish(dump_yaml(self._metadata(self._files[-1:])))

    def _drop_files(self) -> None:
        """Close all files without writing an index; flushed chunks remain."""
        self._is_open = False
        for file in self._files:
            with suppress(OSError):
                file.stream.join()

    @contextmanager
    def _closed_on_error(self) -> Iterator[None]:
        """After an error, close the files, and delete the recording if it has no message."""
        try:
            yield
        except (OSError, InputError) as error:
            self._drop_files()
            kept = '; what was written before can be read' if self.message_count else ''
            if not kept:
                shutil.rmtree(self.path, ignore_errors=True)
            reason = getattr(error, 'strerror', None) or error
            raise InputError(f'{self.path}: cannot be written: {reason}{kept}') from None

    def _metadata(self, files: Sequence[_McapFile]) -> dict[str, Any]:
        counts = {topic: sum(file.counts.get(topic, 0) for file in files) for topic in self._topics}
        compressed = self._compression == 'message'
        return {
            'version': _VERSION, 'storage_identifier': 'mcap',
            'relative_file_paths': [file.path.name for file in files],
            **_span(files), 'message_count': sum(counts.values()),
            'topics_with_message_count': [{
                'topic_metadata': {
                    'name': topic, 'type': kind, 'serialization_format': 'cdr',
                    'offered_qos_profiles': qos,
                    'type_description_hash': self._types.hash_rihs01(kind)},
                'message_count': counts[topic]} for topic, (kind, _, qos) in self._topics.items()],
            'compression_format': 'zstd' if compressed else '',
            'compression_mode': 'message' if compressed else '',
            'files': [{'path': file.path.name, **_span([file]),
                       'message_count': sum(file.counts.values())} for file in files],
            'custom_data': self.custom_data or None, 'ros_distro': 'jazzy',
        }

    def _save_metadata(self, sync: bool = True) -> None:
        write_atomically(self.path / METADATA, dump_yaml(
            {'rosbag2_bagfile_information': self._metadata(self._files)}), sync)


class _McapFile:
    def __init__(self, path: Path, compressed: bool) -> None:
        self.path = path
        self.counts: dict[str, int] = {}
        self.first: int | None = None
        self.last: int | None = None
        self.stream = _SyncedFile(path)
        self._writer = Writer(
            self.stream, chunk_size=_CHUNK, enable_data_crcs=True,  # type: ignore[arg-type]
            compression=CompressionType.ZSTD if compressed else CompressionType.NONE)
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer.start(profile='ros2', library='friction_comp')
        self.stream.flush()

    def declare(self, topic: str, kind: str, definition: str, qos: list[Qos]) -> None:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, 'ros2msg', definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic, 'cdr', self._schemas[kind], {'offered_qos_profiles': dump_yaml(qos).strip()})
        self.counts[topic] = 0

    def write(self, topic: str, time: int, payload: bytes) -> None:
        count = self.counts[topic]
        self._writer.add_message(self._channels[topic], time, payload, time, count)
        self.counts[topic] = count + 1
        self.first = time if self.first is None else min(self.first, time)
        self.last = time if self.last is None else max(self.last, time)

    def flush(self) -> None:
        self._writer.flush()
        self.stream.flush()

    def finish(self, metadata: str) -> None:
        """End the file with an index and rosbag2's metadata."""
        self.flush()
        self._writer.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._writer.finish()
        self.stream.flush()
        self.stream.close()


class _SyncedFile:
    """A new file of whole blocks, which a thread syncs to the disk."""

    def __init__(self, path: Path) -> None:
        self._file = path.open('xb', buffering=0)
        self._block = bytearray()
        self._written = 0
        self._thread = ThreadPoolExecutor(1)
        self._sync: Future[None] = self._thread.submit(lambda: None)

    def write(self, data: bytes) -> int:
        if len(self._block) > _CHUNK:
            self.flush()
        self._block += data
        return len(data)

    def tell(self) -> int:
        """Return the size, including what is not yet written."""
        return self._written + len(self._block)

    def flush(self) -> None:
        """Write the block, and begin to sync unless that is under way; raises OSError if it fails.

        Data survive the end of this process from then on, and that of the machine once synced.
        """
        remaining, self._block = memoryview(self._block), bytearray()
        size = len(remaining)
        try:
            while remaining:
                remaining = remaining[self._file.write(remaining):]
        except OSError:
            self._file.truncate(self._written)
            raise
        self._written += size
        if self._sync.done():
            self._sync.result()
            self._sync = self._thread.submit(os.fsync, self._file.fileno())

    def close(self) -> None:
        """Begin to sync and close the file; `join` waits for it."""
        self._sync = self._thread.submit(self._sync_and_close, self._sync)
        self._thread.shutdown(wait=False)

    def join(self) -> None:
        """Wait until the file is synced, and close it; raises OSError if the sync failed."""
        self._thread.shutdown()
        self._file.close()
        self._sync.result()

    def _sync_and_close(self, before: Future[None]) -> None:
        # A failed sync is reported once by the system.
        before.result()
        os.fsync(self._file.fileno())
        self._file.close()


def _span(files: Sequence[_McapFile]) -> dict[str, Any]:
    """Return the start and duration of files as rosbag2's metadata store them."""
    first = min((file.first for file in files if file.first is not None), default=0)
    last = max((file.last for file in files if file.last is not None), default=0)
    return {'starting_time': {'nanoseconds_since_epoch': first},
            'duration': {'nanoseconds': last - first}}
