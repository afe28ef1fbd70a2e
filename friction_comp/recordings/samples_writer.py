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
from friction_comp.stamps import NANO
from friction_comp.topics import TOPICS


def write_samples(path: AnyPath, samples: Samples | Sequence[Samples],
                  torque_constant: float = 1.0, gear_ratio: float = 1.0, namespace: str = '',
                  start_ns: int = NANO, custom_data: dict[str, str] | None = None
                  ) -> None:
    """Write samples, one per joint, as a recording with the topics that the nodes publish.

    Several joints must share their time base; those without a name become ``joint_1`` and so on.
    Effort is current · k_t · n, with k_t in N·m/A. `namespace` is the prefix of every topic, and
    `start_ns` the stamp of time zero; the rest is as for `RecordingWriter`.
    """
    joints = [samples] if isinstance(samples, Samples) else list(samples)
    if not joints:
        raise InputError('no samples to write')
    if any(not np.array_equal(other.time, joints[0].time) for other in joints[1:]):
        raise InputError('samples: the joints of one recording must share their time base')
    store = get_typestore(Stores.ROS2_JAZZY)
    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    with RecordingWriter(path, custom_data) as recording:
        try:
            for stamp, topic, message in _messages(
                    store.types, joints, torque_constant * gear_ratio, start_ns):
                recording.write(f'{prefix}/{topic}', TOPICS[topic], stamp,
                                bytes(store.serialize_cdr(message, TOPICS[topic])))
        except BaseException:
            recording.abort()
            raise


def _messages(types: dict[str, Any], joints: list[Samples], torque_per_current: float,
              start_ns: int) -> Iterator[tuple[int, str, Any]]:
    """Yield (stamp, topic, message) sample by sample; joint states come last."""
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

    position, velocity, reference, reference_velocity, command = map(columns, (
        'position', 'velocity', 'reference_position', 'reference_velocity', 'command'))
    effort = torque_per_current * columns('current')
    direction = columns('direction').astype(np.int8)
    vector, wrench = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Wrench']
    layout = types['std_msgs/msg/MultiArrayLayout']([], 0)
    make = {topic: types[kind] for topic, kind in TOPICS.items()}
    for k, time in enumerate(joints[0].time):
        stamp = start_ns + round(float(time) * 1e9)
        # The command, direction and reference that belong to a joint state precede it.
        if np.isfinite(command[k]).any():
            yield stamp, 'current_command', make['current_command'](layout, command[k])
        # At every change and every tenth sample, similar to the about 100 Hz of a planner.
        if direction.size and (k % 10 == 0 or (direction[k] != direction[k - 1]).any()):
            yield stamp, 'direction', make['direction'](layout, direction[k])
        if reference.size:
            yield stamp, 'reference', make['reference'](
                header(), names, reference[k], reference_velocity[k], np.zeros(0))
        for name, each in zip(names, joints):
            if each.load is not None:
                torque = vector(0.0, 0.0, float(each.load[k]))
                yield stamp, 'interaction_wrench', make['interaction_wrench'](
                    header(name), wrench(vector(0.0, 0.0, 0.0), torque))
            if each.temperature is not None and k % 100 == 0:
                yield stamp, 'motor_temperature', make['motor_temperature'](
                    header(name), float(each.temperature[k]), 0.0)
        yield stamp, 'joint_states', make['joint_states'](
            header(), names, position[k], velocity[k], effort[k])
