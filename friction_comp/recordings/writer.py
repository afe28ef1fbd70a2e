# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes rosbag2 recordings (mcap) that `ros2 bag info` and `ros2 bag play` accept."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import shutil
from types import TracebackType
from typing import Any, Literal

from rosbags.typesys import get_typestore, Stores
import yaml
import zstandard

from friction_comp.errors import InputError
from friction_comp.recordings.mcap_part import McapPart, Qos, span
from friction_comp.recordings.storage import AnyPath, METADATA

_VERSION = 9
# rosbag2's value of a duration that is not set.
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
# Smallest limits of size and duration, bytes and s: every file needs an index and two threads.
_MIN_SIZE, _MIN_DURATION = 10_000, 0.1
_COMPRESSIONS = ('none', 'message', 'storage')


def qos_profile(reliability: str = 'reliable', durability: str = 'volatile',
                depth: int = 10) -> Qos:
    """Return a publisher's quality of service as rosbag2's metadata hold it."""
    return {'history': 'keep_last', 'depth': depth, 'reliability': reliability,
            'durability': durability, 'deadline': _INFINITE, 'lifespan': _INFINITE,
            'liveliness': 'automatic', 'liveliness_lease_duration': _INFINITE,
            'avoid_ros_namespace_conventions': False}


class RecordingWriter:
    """A rosbag2 folder with mcap storage that is readable at any time while it is written.

    Messages are collected in chunks. Each chunk has a checksum, and is written whole and synced
    when it is full or `flush` is called. If the process is killed, only messages after the last
    chunk are lost; a full disk loses nothing that was written. ``metadata.yaml`` exists from the
    beginning and lists every file.

    Parameters
    ----------
    path : path-like
        Folder to create; it must not exist.
    custom_data : dict of str, optional
        Stored in metadata.yaml. ``model_file`` is the active model.
    compression : str, optional
        'none', 'message' or 'storage' (chunks inside the mcap file), all with zstd.
    split_size : float, optional
        Size in bytes after which the next file begins, at least 10,000; 0: never.
    split_duration : float, optional
        Duration in s of message time after which the next file begins, at least 0.1; 0: never.

    Raises
    ------
    InputError
        If the folder exists or cannot be created, or files would be too small.

    Examples
    --------
    >>> with RecordingWriter('trial') as recording:                       # doctest: +SKIP
    ...     recording.write('joint_states', 'sensor_msgs/msg/JointState', stamp_ns, cdr)
    """

    def __init__(self, path: AnyPath, custom_data: dict[str, str] | None = None,
                 compression: str = 'none', split_size: float = 0,
                 split_duration: float = 0.0) -> None:
        self.path = Path(path)
        if compression not in _COMPRESSIONS:
            raise InputError(
                f'compression must be none, message or storage, not {compression!r}')
        if 0.0 < split_size < _MIN_SIZE:
            raise InputError(f'max_file_size: files of {1e-6 * split_size:g} MB are too small, '
                             f'{1e-6 * _MIN_SIZE:g} MB is the least; 0 makes one file')
        if 0.0 < split_duration < _MIN_DURATION:
            raise InputError(f'max_file_duration: files of {split_duration:g} s are too short, '
                             f'{_MIN_DURATION:g} s is the least; 0 makes one file')
        self.custom_data = dict(custom_data or {})
        self._compression = compression
        self._split_size = split_size
        self._split_duration = split_duration * 1e9
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[str, tuple[str, str, list[Qos]]] = {}
        self._finished: list[McapPart] = []
        self._part: McapPart | None = None
        self.message_count = 0
        if self.path.exists():
            raise InputError(f'{self.path}: already exists, a recording needs a new folder')

    def __enter__(self) -> RecordingWriter:
        try:
            self.path.mkdir(parents=True)
            self._part = self._begin()
        except OSError as error:
            raise self._close_with_error(error) from None
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

        Parameters
        ----------
        topic, type_name : str
        qos : sequence of dict, optional
            QoS of its publishers, as `qos_profile` returns it; rosbag2's default when empty.

        Raises
        ------
        InputError
            If it is not a message type of ROS 2 Jazzy.
        """
        name = topic if topic.startswith('/') else f'/{topic}'
        if name not in self._topics:
            if type_name not in self._types.fielddefs:
                raise InputError(f'{type_name}: not a message type of ROS 2 Jazzy')
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            self._topics[name] = type_name, definition, list(qos) or [qos_profile()]
            if self._part is not None:
                self._part.declare(name, *self._topics[name])
        return name

    def write(self, topic: str, type_name: str, stamp_ns: int, cdr: bytes) -> None:
        """Append one serialised message, with its encapsulation header, that came at a time in ns.

        Raises
        ------
        InputError
            If writing fails, for instance because the disk is full. The recording is then closed,
            and what was written before can be read.
        """
        name = self.add_topic(topic, type_name)
        if self._part is None:
            raise InputError(f'{self.path}: the recording is closed')
        if self._compression == 'message':
            cdr = zstandard.compress(cdr)
        try:
            if self._is_full(self._part, stamp_ns):
                self._end(self._part)
                self._part = self._begin()
            self._part.write(name, int(stamp_ns), cdr)
        except OSError as error:
            raise self._close_with_error(error) from None
        self.message_count += 1

    def flush(self, wait: bool = False) -> None:
        """End the present chunk and write it; raises InputError as `write` does.

        Parameters
        ----------
        wait : bool
            Whether to wait until it is written, so that it survives the end of this process.
        """
        if self._part is not None:
            try:
                self._part.flush(wait)
            except OSError as error:
                raise self._close_with_error(error) from None

    def close(self) -> None:
        """Finish the recording.

        Raises
        ------
        InputError
            If nothing was recorded (then nothing is left behind), or the disk is full.
        """
        if self._part is None:
            return
        if not self.message_count:
            self.abort()
            raise InputError(f'{self.path}: nothing was recorded, so nothing is written')
        try:
            self._end(self._part)
            for part in self._finished:
                part.join()
            self._save_metadata(self._finished, sync=True)
        except OSError as error:
            raise self._close_with_error(error) from None

    def abort(self) -> None:
        """Close and delete the recording."""
        if self._part is not None:
            self._part.drop()
            self._part = None
        shutil.rmtree(self.path, ignore_errors=True)

    def _begin(self) -> McapPart:
        part = McapPart(self.path / f'{self.path.name}_{len(self._finished)}.mcap',
                        self._compression == 'storage')
        for topic, about in self._topics.items():
            part.declare(topic, *about)
        self._save_metadata([*self._finished, part])
        return part

    def _is_full(self, part: McapPart, time: int) -> bool:
        if part.first is None:
            return False
        # In either direction: one stamp may be far ahead of all others.
        elapsed = abs(time - part.first)
        return bool((self._split_size and part.size >= self._split_size)
                    or (self._split_duration and elapsed >= self._split_duration))

    def _end(self, part: McapPart) -> None:
        self._part = None
        self._finished.append(part)
        part.finish(_yaml(self._metadata([part])))

    def _close_with_error(self, error: OSError) -> InputError:
        """Close the files and return the error."""
        for part in self._finished if self._part is None else [*self._finished, self._part]:
            part.drop()
        self._part = None
        kept = ''
        if self.message_count:
            kept = '; what was written before can be read'
        else:
            shutil.rmtree(self.path, ignore_errors=True)
        return InputError(f'{self.path}: cannot be written: {error.strerror or error}{kept}')

    def _metadata(self, parts: list[McapPart]) -> dict[str, Any]:
        first = [part.first for part in parts if part.first is not None]
        last = [part.last for part in parts if part.last is not None]
        counts = {topic: sum(part.counts.get(topic, 0) for part in parts) for topic in self._topics}
        compressed = self._compression == 'message'
        return {
            'version': _VERSION, 'storage_identifier': 'mcap',
            'relative_file_paths': [part.path.name for part in parts],
            **span(min(first, default=None), max(last, default=None)),
            'message_count': sum(counts.values()),
            'topics_with_message_count': [{
                'topic_metadata': {
                    'name': topic, 'type': kind, 'serialization_format': 'cdr',
                    'offered_qos_profiles': qos,
                    'type_description_hash': self._types.hash_rihs01(kind)},
                'message_count': counts[topic]} for topic, (kind, _, qos) in self._topics.items()],
            'compression_format': 'zstd' if compressed else '',
            'compression_mode': 'message' if compressed else '',
            'files': [part.about() for part in parts],
            'custom_data': self.custom_data or None, 'ros_distro': 'jazzy',
        }

    def _save_metadata(self, parts: list[McapPart], sync: bool = False) -> None:
        """Write metadata.yaml; an unfinished recording does not wait for the disk."""
        draft = self.path / f'{METADATA}.new'
        try:
            with draft.open('w', encoding='utf-8') as stream:
                stream.write(_yaml({'rosbag2_bagfile_information': self._metadata(parts)}))
                stream.flush()
                if sync:
                    os.fsync(stream.fileno())
            draft.replace(self.path / METADATA)
        finally:
            draft.unlink(missing_ok=True)


def _yaml(document: dict[str, Any]) -> str:
    return str(yaml.safe_dump(document, sort_keys=False, allow_unicode=True))
