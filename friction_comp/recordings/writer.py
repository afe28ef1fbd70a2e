# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writing recordings that `ros2 bag info` and `ros2 bag play` accept: rosbag2, mcap."""

from __future__ import annotations

import os
from pathlib import Path
import shutil

import numpy as np
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import InputError

# What rosbag2 writes for a duration that nobody set.
_NEVER = QosTime(9223372036, 854775807)
_DEFAULT_QOS = Qos(
    QosHistory.KEEP_LAST, 10, QosReliability.RELIABLE, QosDurability.VOLATILE, _NEVER, _NEVER,
    QosLiveliness.AUTOMATIC, _NEVER, False)


class RecordingWriter:
    """A rosbag2 folder with mcap storage, complete or not there at all.

    Messages go into a hidden folder beside the target, which takes the target's name when the
    recording is closed. After an exception inside the ``with`` block nothing is left.

    Parameters
    ----------
    path : path-like
        Folder to create; it must not exist.
    custom_data : dict of str, optional
        Kept in metadata.yaml. ``model_file`` names the model that was active.
    compression : str, optional
        'none', 'message' or 'storage' (chunks inside the mcap file), all with zstd.

    Raises
    ------
    InputError
        If the folder exists or cannot be made.

    Examples
    --------
    >>> with RecordingWriter('trial') as recording:                       # doctest: +SKIP
    ...     recording.write('joint_states', 'sensor_msgs/msg/JointState', stamp_ns, cdr)
    """

    def __init__(self, path, custom_data=None, compression='none'):
        self.path = Path(path)
        if self.path.exists():
            raise InputError(f'{self.path}: exists already, a recording needs a new folder')
        # The writer names its file after its folder, hence a folder of the right name in a
        # hidden one.
        self._room = self.path.parent / f'.{self.path.name}.{os.getpid()}.unfinished'
        self._writer = Writer(
            self._room / self.path.name, version=Writer.VERSION_LATEST,
            storage_plugin=StoragePlugin.MCAP)
        try:
            mode = {'none': CompressionMode.NONE, 'message': CompressionMode.MESSAGE,
                    'storage': CompressionMode.STORAGE}[compression]
        except KeyError:
            raise InputError(
                f'compression must be none, message or storage, not {compression!r}') from None
        self._writer.set_compression(mode, CompressionFormat.ZSTD)
        for key, value in (custom_data or {}).items():
            self._writer.set_custom_data(key, value)
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._connections = {}
        self._open = False
        self.message_count = 0

    def __enter__(self):
        try:
            self._writer.open()
        except OSError as error:
            shutil.rmtree(self._room, ignore_errors=True)
            raise InputError(
                f'{self.path}: cannot be written: {error.strerror or error}') from None
        self._open = True
        return self

    def __exit__(self, kind, value, traceback):
        if kind is None:
            self.close()
        else:
            self.abort()
        return False

    def add_topic(self, topic, type_name):
        """Declare a topic, so that it is listed even where no message follows."""
        name = topic if topic.startswith('/') else f'/{topic}'
        if name not in self._connections:
            if type_name not in self._types.fielddefs:
                raise InputError(f'{type_name}: not a message type of ROS 2 Jazzy')
            self._connections[name] = self._writer.add_connection(
                name, type_name, typestore=self._types, offered_qos_profiles=[_DEFAULT_QOS])
        return self._connections[name]

    def write(self, topic, type_name, stamp_ns, cdr):
        """Append one serialised message.

        Parameters
        ----------
        topic : str
            A relative name becomes absolute.
        type_name : str
            For instance 'sensor_msgs/msg/JointState'.
        stamp_ns : int
            Receive time in nanoseconds.
        cdr : bytes
            The message as it went over the wire, with its encapsulation header.
        """
        self._writer.write(self.add_topic(topic, type_name), int(stamp_ns), cdr)
        self.message_count += 1

    def close(self):
        """Finish the recording and give it its name."""
        if not self._open:
            return
        if not self.message_count:
            self.abort()
            raise InputError(f'{self.path}: nothing was recorded, so nothing is written')
        self._open = False
        try:
            self._writer.close()
            (self._room / self.path.name).rename(self.path)
        except OSError as error:
            raise InputError(
                f'{self.path}: cannot be written: {error.strerror or error}') from None
        finally:
            shutil.rmtree(self._room, ignore_errors=True)

    def abort(self):
        """Give up and leave nothing behind."""
        if self._open:
            self._open = False
            self._writer.abort()
        shutil.rmtree(self._room, ignore_errors=True)


def write_samples(path, samples, torque_constant=1.0, gear_ratio=1.0, joint=None, namespace='',
                  start_ns=1_000_000_000, custom_data=None, compression='none'):
    """Turn samples into a recording as the nodes would have left it.

    Parameters
    ----------
    path : path-like
        Folder to create.
    samples : Samples or list of Samples
        One stretch per joint; several joints must share their time base. Effort is
        current · k_t · n. Signals that are None are not recorded.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n.
    joint : str, optional
        Joint name where the samples carry none.
    namespace : str
        Put before every topic.
    start_ns : int
        Stamp of time zero.
    custom_data, compression
        As for `RecordingWriter`.
    """
    joints = samples if isinstance(samples, (list, tuple)) else [samples]
    first = joints[0]
    for other in joints[1:]:
        if not np.array_equal(other.time, first.time):
            raise InputError('samples: the joints of one recording must share their time base')
    names = [one.joint or joint or f'joint_{k + 1}' for k, one in enumerate(joints)]
    store = get_typestore(Stores.ROS2_JAZZY)
    messages = _Messages(store, names, joints, torque_constant * gear_ratio)
    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    with RecordingWriter(path, custom_data, compression) as recording:
        for k, time in enumerate(np.asarray(first.time, dtype=float)):
            stamp = start_ns + round(time * 1e9)
            for topic, type_name, message in messages.at(k, stamp):
                recording.write(f'{prefix}/{topic}', type_name, stamp,
                                bytes(store.serialize_cdr(message, type_name)))


class _Messages:
    """The messages of one instant, built from samples."""

    def __init__(self, store, names, joints, torque_per_current):
        self._types = store.types
        self._names = names
        self._joints = joints
        self._gain = torque_per_current

    def _make(self, type_name, *fields):
        return self._types[type_name](*fields)

    def _header(self, stamp, frame=''):
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        return self._make(
            'std_msgs/msg/Header',
            self._make('builtin_interfaces/msg/Time', seconds, nanoseconds), frame)

    def _column(self, name, k, gain=1.0):
        values = [getattr(one, name) for one in self._joints]
        if any(value is None for value in values):
            return np.zeros(0)
        return np.array([gain * float(value[k]) for value in values])

    def _joint_state(self, stamp, position, velocity, effort):
        kind = 'sensor_msgs/msg/JointState'
        return kind, self._make(
            kind, self._header(stamp), list(self._names), position, velocity, effort)

    def _array(self, kind, data):
        layout = self._make('std_msgs/msg/MultiArrayLayout', [], 0)
        return kind, self._make(kind, layout, data)

    def at(self, k, stamp):
        """Yield (topic, type, message) of sample number k; joint states come last."""
        # A command, direction or reference that belongs to a joint state is there before it.
        command = self._column('command', k)
        if command.size:
            yield 'current_command', *self._array('std_msgs/msg/Float64MultiArray', command)
        direction = self._column('direction', k)
        if direction.size and self._changed('direction', k):
            yield 'direction', *self._array(
                'std_msgs/msg/Int8MultiArray', direction.astype(np.int8))
        reference = self._column('reference_position', k)
        if reference.size:
            yield 'reference', *self._joint_state(
                stamp, reference, self._column('reference_velocity', k), np.zeros(0))
        yield from self._by_frame(k, stamp)
        yield 'joint_states', *self._joint_state(
            stamp, self._column('position', k), self._column('velocity', k),
            self._column('current', k, self._gain))

    def _changed(self, name, k):
        # Directions are sent at 100 Hz or so; sending each change and one in ten keeps files small.
        return k % 10 == 0 or any(
            getattr(one, name)[k] != getattr(one, name)[k - 1] for one in self._joints)

    def _by_frame(self, k, stamp):
        vector = 'geometry_msgs/msg/Vector3'
        for name, one in zip(self._names, self._joints):
            if one.load is not None:
                kind = 'geometry_msgs/msg/WrenchStamped'
                wrench = self._make(
                    'geometry_msgs/msg/Wrench', self._make(vector, 0.0, 0.0, 0.0),
                    self._make(vector, 0.0, 0.0, float(one.load[k])))
                yield 'interaction_wrench', kind, self._make(
                    kind, self._header(stamp, name), wrench)
            if one.temperature is not None and k % 100 == 0:
                kind = 'sensor_msgs/msg/Temperature'
                yield 'motor_temperature', kind, self._make(
                    kind, self._header(stamp, name), float(one.temperature[k]), 0.0)
