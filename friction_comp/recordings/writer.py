# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes rosbag2 recordings (mcap) that `ros2 bag info` and `ros2 bag play` accept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
from typing import Any

from mcap.writer import CompressionType, Writer
import numpy as np
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import InputError, os_errors_name
from friction_comp.files import AnyPath, new_folder, to_yaml, write_atomically
from friction_comp.messages import NANO, TOPICS
from friction_comp.recordings import METADATA
from friction_comp.samples import Samples

# The quality of service with which topics are played back, which any listener accepts; rosbag2's
# value of a duration that is not set.
_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
_QOS = [{'history': 'keep_last', 'depth': 10, 'reliability': 'reliable', 'durability': 'volatile',
         'deadline': _INFINITE, 'lifespan': _INFINITE, 'liveliness': 'automatic',
         'liveliness_lease_duration': _INFINITE, 'avoid_ros_namespace_conventions': False}]


class RecordingWriter:
    """A rosbag2 folder with one mcap file that is readable at any time while it is written.

    Messages are collected in chunks with checksums, each written whole when it is full or `flush`
    is called. If the process is killed, only messages after the last chunk are lost; a full disk
    loses nothing that was written. ``metadata.yaml`` exists from the beginning.

    `custom_data`, of which ``model_file`` is the active model, is stored in metadata.yaml. Raises
    InputError if the folder `path` exists or cannot be created.
    """

    def __init__(self, path: AnyPath, custom_data: dict[str, str] | None = None) -> None:
        self.path = Path(path)
        self.custom_data = dict(custom_data or {})
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._topics: dict[str, _Topic] = {}
        self._first = self._last = 0    # times of all messages
        self._is_open = True
        self.message_count = 0
        if self.path.exists():
            raise InputError(f'{self.path}: already exists, a recording needs a new folder')
        self._name = f'{self.path.name}_0.mcap'
        with os_errors_name(self.path, 'cannot be written: '):
            self.path.mkdir(parents=True)
            self._file = (self.path / self._name).open('xb', buffering=1 << 21)
        # A thread syncs the file, since who records must not wait for the disk.
        self._thread = ThreadPoolExecutor(1)
        self._sync: Future[None] = self._thread.submit(lambda: None)
        self._is_kept = False   # whether messages are on the disk
        self._mcap = Writer(self._file, enable_data_crcs=True, compression=CompressionType.NONE)
        with self._closed_on_error():
            self._mcap.start(profile='ros2', library='friction_comp')
            self._save_metadata(sync=False)

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None or self.message_count:
            self.close()
        else:
            self.abort()

    def add_topic(self, topic: str, type_name: str) -> str:
        """Declare a topic, so that it is listed even without messages; return its absolute name.

        Raises InputError if it is not a message type of ROS 2 Jazzy.
        """
        name = topic if topic.startswith('/') else f'/{topic}'
        if name not in self._topics:
            if type_name not in self._types.fielddefs:
                raise InputError(f'{type_name}: not a message type of ROS 2 Jazzy')
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            schema = self._mcap.register_schema(type_name, 'ros2msg', definition.encode())
            self._topics[name] = _Topic(type_name, self._mcap.register_channel(
                name, 'cdr', schema, {'offered_qos_profiles': to_yaml(_QOS).strip()}))
        return name

    def write(self, topic: str, type_name: str, stamp_ns: int, cdr: bytes) -> None:
        """Append a message: its time in ns and its CDR with encapsulation header.

        Raises InputError if writing fails, for instance because the disk is full. The recording is
        then closed, and what was written before can be read.
        """
        if not self._is_open:
            raise InputError(f'{self.path}: the recording is closed')
        own, time = self._topics[self.add_topic(topic, type_name)], int(stamp_ns)
        with self._closed_on_error():
            self._mcap.add_message(own.channel, time, cdr, time, own.count)
        self._first = min(self._first, time) if self.message_count else time
        self._last = max(self._last, time)
        own.count += 1
        self.message_count += 1

    def flush(self) -> None:
        """End the current chunk and write it; raises InputError as `write` does.

        Messages survive the end of this process from then on, and that of the machine once synced.
        """
        if self._is_open:
            with self._closed_on_error():
                self._mcap.flush()
                self._file.flush()
                self._is_kept = self.message_count > 0
                if self._sync.done():
                    self._sync.result()
                    self._sync = self._thread.submit(os.fsync, self._file.fileno())

    def close(self) -> None:
        """Finish the recording; raises InputError if nothing was recorded, or the disk is full."""
        if not self._is_open:
            return
        if not self.message_count:
            self.abort()
            raise InputError(f'{self.path}: nothing was recorded, so nothing is written')
        self.flush()
        with self._closed_on_error():
            self._mcap.finish()
            self._file.flush()
            # A failed sync is reported once by the system.
            self._sync.result()
            os.fsync(self._file.fileno())
            self.abort(keep=True)
            self._save_metadata()

    def abort(self, keep: bool = False) -> None:
        """Close the file as it is, and delete the recording unless its chunks are kept."""
        self._is_open = False
        self._thread.shutdown()
        with suppress(OSError):
            self._file.close()
        if not keep:
            shutil.rmtree(self.path, ignore_errors=True)

    @contextmanager
    def _closed_on_error(self) -> Iterator[None]:
        """After an error, close the file, and delete the recording if it has no chunk."""
        try:
            yield
        except (OSError, InputError) as error:
            kept = '; what was written before can be read' if self._is_kept else ''
            self.abort(keep=bool(kept))
            reason = getattr(error, 'strerror', None) or error
            raise InputError(f'{self.path}: cannot be written: {reason}{kept}') from None

    def _save_metadata(self, sync: bool = True) -> None:
        span = {'starting_time': {'nanoseconds_since_epoch': self._first},
                'duration': {'nanoseconds': self._last - self._first},
                'message_count': self.message_count}
        write_atomically(self.path / METADATA, to_yaml({'rosbag2_bagfile_information': {
            'version': 9, 'storage_identifier': 'mcap', 'relative_file_paths': [self._name], **span,
            'topics_with_message_count': [{
                'topic_metadata': {
                    'name': topic, 'type': own.kind, 'serialization_format': 'cdr',
                    'offered_qos_profiles': _QOS,
                    'type_description_hash': self._types.hash_rihs01(own.kind)},
                'message_count': own.count} for topic, own in self._topics.items()],
            'compression_format': '', 'compression_mode': '', 'files': [
                {'path': self._name, **span}],
            'custom_data': self.custom_data or None, 'ros_distro': 'jazzy'}}), sync)


@dataclass
class _Topic:
    kind: str
    channel: int
    count: int = 0  # of its messages


def write_samples(path: AnyPath, samples: Samples | Sequence[Samples],
                  torque_constant: float = 1.0, gear_ratio: float = 1.0, start_ns: int = NANO
                  ) -> None:
    """Write samples, one per joint, as a recording with the topics that the nodes publish.

    Several joints must share their time base; those without a name become ``joint_1`` and so on.
    Effort is current · k_t · n, with k_t in N·m/A. `start_ns` is the stamp of time zero. The
    recording is whole or absent; raises InputError as `RecordingWriter`.
    """
    joints = [samples] if isinstance(samples, Samples) else list(samples)
    if not joints:
        raise InputError('no samples to write')
    if any(not np.array_equal(other.time, joints[0].time) for other in joints[1:]):
        raise InputError('samples: the joints of one recording must share their time base')
    last = 1e-9 * start_ns + float(joints[0].time.max(initial=0.0))
    if not 0.0 <= 1e-9 * start_ns <= last < 2.0 ** 31:
        raise InputError(f'{path}: a time of {last:g} s is beyond the stamps of ROS')
    store = get_typestore(Stores.ROS2_JAZZY)
    with new_folder(Path(path)) as draft, RecordingWriter(draft) as recording:
        for stamp, topic, fields in _messages(
                store.types, joints, torque_constant * gear_ratio, start_ns):
            message = store.types[TOPICS[topic]](*fields)
            recording.write(topic, TOPICS[topic], stamp,
                            bytes(store.serialize_cdr(message, TOPICS[topic])))


def _messages(types: dict[str, Any], joints: list[Samples], torque_per_current: float,
              start_ns: int) -> Iterator[tuple[int, str, tuple[Any, ...]]]:
    """Yield stamp, topic and fields of messages, sample by sample; joint states come last."""
    names = [each.joint or f'joint_{k + 1}' for k, each in enumerate(joints)]

    def columns(signal: str) -> np.ndarray:
        """Return a signal of all joints, shape (N, J), or (N, 0) where one has none."""
        values = [getattr(each, signal) for each in joints]
        if any(value is None for value in values):
            return np.zeros((len(joints[0]), 0))
        return np.column_stack(values).astype(float)

    def header(frame: str = '') -> Any:
        return types['std_msgs/msg/Header'](
            types['builtin_interfaces/msg/Time'](*divmod(stamp, NANO)), frame)

    position, velocity, reference, reference_velocity, command, direction = map(columns, (
        'position', 'velocity', 'reference_position', 'reference_velocity', 'command', 'direction'))
    effort, direction = torque_per_current * columns('current'), direction.astype(np.int8)
    vector, wrench = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Wrench']
    layout, none = types['std_msgs/msg/MultiArrayLayout']([], 0), np.zeros(0)
    for k, time in enumerate(joints[0].time):
        stamp = start_ns + round(float(time) * 1e9)
        # The command, direction and reference that belong to a joint state precede it.
        if np.isfinite(command[k]).any():
            yield stamp, 'current_command', (layout, command[k])
        if direction.size:
            yield stamp, 'direction', (layout, direction[k])
        if reference.size:
            yield stamp, 'reference', (
                header(), names, reference[k], reference_velocity[k], none)
        for name, each in zip(names, joints):
            if each.load is not None:
                yield stamp, 'interaction_wrench', (header(name), wrench(
                    vector(0.0, 0.0, 0.0), vector(0.0, 0.0, float(each.load[k]))))
            if each.temperature is not None:
                yield stamp, 'motor_temperature', (header(name), float(each.temperature[k]), 0.0)
        yield stamp, 'joint_states', (header(), names, position[k], velocity[k], effort[k])
