# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes samples as a recording with the topics that the nodes publish."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import InputError
from friction_comp.recordings.storage import AnyPath
from friction_comp.recordings.writer import RecordingWriter
from friction_comp.samples import Samples


def write_samples(path: AnyPath, samples: Samples | Sequence[Samples],
                  torque_constant: float = 1.0, gear_ratio: float = 1.0, joint: str | None = None,
                  namespace: str = '', start_ns: int = 1_000_000_000,
                  custom_data: dict[str, str] | None = None, compression: str = 'none') -> None:
    """Write samples as a recording with the same topics as the nodes'.

    Parameters
    ----------
    path : path-like
        Folder to create.
    samples : Samples or list of Samples
        One per joint; several joints must share their time base. Effort is current · k_t · n.
        Signals that are None are not recorded.
    torque_constant, gear_ratio : float
        k_t in N·m/A and n.
    joint : str, optional
        Joint name where the samples have none.
    namespace : str
        Prefix of every topic.
    start_ns : int
        Stamp of time zero.
    custom_data, compression
        As for `RecordingWriter`.
    """
    joints = [samples] if isinstance(samples, Samples) else list(samples)
    if not joints:
        raise InputError('no samples to write')
    first = joints[0]
    for other in joints[1:]:
        if not np.array_equal(other.time, first.time):
            raise InputError('samples: the joints of one recording must share their time base')
    names = [each.joint or joint or f'joint_{k + 1}' for k, each in enumerate(joints)]
    store = get_typestore(Stores.ROS2_JAZZY)
    messages = _Messages(store, names, joints, torque_constant * gear_ratio)
    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    with RecordingWriter(path, custom_data, compression) as recording:
        try:
            for k, time in enumerate(np.asarray(first.time, dtype=float)):
                stamp = start_ns + round(time * 1e9)
                for topic, type_name, message in messages.at(k, stamp):
                    recording.write(f'{prefix}/{topic}', type_name, stamp,
                                    bytes(store.serialize_cdr(message, type_name)))
        except BaseException:
            recording.abort()
            raise


class _Messages:
    """Builds the messages of one time from samples."""

    def __init__(self, store: Any, names: list[str], joints: list[Samples],
                 torque_per_current: float) -> None:
        self._types = store.types
        self._names = names
        self._joints = joints
        self._gain = torque_per_current

    def _make(self, type_name: str, *fields: Any) -> Any:
        return self._types[type_name](*fields)

    def _header(self, stamp: int, frame: str = '') -> Any:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        return self._make(
            'std_msgs/msg/Header',
            self._make('builtin_interfaces/msg/Time', seconds, nanoseconds), frame)

    def _column(self, name: str, k: int, gain: float = 1.0) -> np.ndarray:
        values = [getattr(each, name) for each in self._joints]
        if any(value is None for value in values):
            return np.zeros(0)
        return np.array([gain * float(value[k]) for value in values])

    def _joint_state(self, stamp: int, position: np.ndarray, velocity: np.ndarray,
                     effort: np.ndarray) -> tuple[str, Any]:
        kind = 'sensor_msgs/msg/JointState'
        return kind, self._make(
            kind, self._header(stamp), list(self._names), position, velocity, effort)

    def _array(self, kind: str, data: np.ndarray) -> tuple[str, Any]:
        layout = self._make('std_msgs/msg/MultiArrayLayout', [], 0)
        return kind, self._make(kind, layout, data)

    def at(self, k: int, stamp: int) -> Iterator[tuple[str, str, Any]]:
        """Yield (topic, type, message) of sample k; joint states come last."""
        # The command, direction and reference that belong to a joint state precede it.
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

    def _changed(self, name: str, k: int) -> bool:
        # Every change and every tenth sample are enough: a direction is published at some 100 Hz.
        return k % 10 == 0 or any(
            getattr(each, name)[k] != getattr(each, name)[k - 1] for each in self._joints)

    def _by_frame(self, k: int, stamp: int) -> Iterator[tuple[str, str, Any]]:
        vector = 'geometry_msgs/msg/Vector3'
        for name, each in zip(self._names, self._joints):
            if each.load is not None:
                kind = 'geometry_msgs/msg/WrenchStamped'
                wrench = self._make(
                    'geometry_msgs/msg/Wrench', self._make(vector, 0.0, 0.0, 0.0),
                    self._make(vector, 0.0, 0.0, float(each.load[k])))
                yield 'interaction_wrench', kind, self._make(
                    kind, self._header(stamp, name), wrench)
            if each.temperature is not None and k % 100 == 0:
                kind = 'sensor_msgs/msg/Temperature'
                yield 'motor_temperature', kind, self._make(
                    kind, self._header(stamp, name), float(each.temperature[k]), 0.0)
