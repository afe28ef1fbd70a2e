# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes samples as a recording with the topics that the nodes publish."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore, Stores

from friction_comp.errors import InputError
from friction_comp.recordings.storage import AnyPath
from friction_comp.recordings.writer import RecordingWriter
from friction_comp.samples import Samples
from friction_comp.stamps import NANO
from friction_comp.topics import TOPICS

# Samples that are serialised together, and where a message with a header has its stamp, bytes.
_BATCH = 10_000
_STAMP = slice(4, 12)


def write_samples(path: AnyPath, samples: Samples | Sequence[Samples],
                  torque_constant: float = 1.0, gear_ratio: float = 1.0, namespace: str = '',
                  start_ns: int = NANO, custom_data: dict[str, str] | None = None,
                  compression: str = 'none') -> None:
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
    prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
    with RecordingWriter(path, custom_data, compression) as recording:
        try:
            for stamp, topic, payload in _messages(joints, torque_constant * gear_ratio, start_ns):
                recording.write(f'{prefix}/{topic}', TOPICS[topic], stamp, payload)
        except BaseException:
            recording.abort()
            raise


def _messages(joints: list[Samples], torque_per_current: float, start_ns: int
              ) -> Iterator[tuple[int, str, bytes]]:
    """Yield (stamp, topic, serialised message) sample by sample; joint states come last."""
    time, direction = joints[0].time, _columns(joints, 'direction').astype(np.int8)
    # At every change and every tenth sample, similar to the about 100 Hz of a planner.
    told = (np.arange(len(time)) % 10 == 0) | np.append(
        False, (direction[1:] != direction[:-1]).any(axis=1))
    for begin in range(0, len(time), _BATCH):
        some = slice(begin, begin + _BATCH)
        stamps = [start_ns + round(float(moment) * 1e9) for moment in time[some]]
        messages = list(_serialised([each.take(some) for each in joints], direction[some],
                                    torque_per_current, np.array(stamps)))
        for k, stamp in enumerate(stamps):
            for topic, rows in messages:
                if (topic != 'direction' or told[begin + k]) and (
                        topic != 'motor_temperature' or (begin + k) % 100 == 0):
                    yield stamp, topic, rows[k].tobytes()


def _columns(joints: list[Samples], signal: str) -> np.ndarray:
    """Return a signal of all joints, shape (N, J), or (N, 0) where one has none."""
    values = [getattr(each, signal) for each in joints]
    if any(value is None for value in values):
        return np.zeros((len(joints[0]), 0))
    return np.column_stack(values).astype(float)


def _serialised(joints: list[Samples], direction: np.ndarray, torque_per_current: float,
                stamps: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield topics and their messages of all samples, uint8 (N, bytes), in order of sending.

    The command, direction and reference that belong to a joint state precede it.
    """
    names = [each.joint or f'joint_{k + 1}' for k, each in enumerate(joints)]
    types = get_typestore(Stores.ROS2_JAZZY).types
    layout = types['std_msgs/msg/MultiArrayLayout']([], 0)
    vector, wrench = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Wrench']
    make = {topic: types[kind] for topic, kind in TOPICS.items()}
    position, velocity, reference, reference_velocity, command = (
        _columns(joints, signal) for signal in (
            'position', 'velocity', 'reference_position', 'reference_velocity', 'command'))
    effort = torque_per_current * _columns(joints, 'current')

    def header(frame: str = '') -> Any:
        return types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), frame)

    if command.size:
        yield _filled('current_command', lambda data: make['current_command'](layout, data),
                      [command])
    if direction.size:
        yield _filled('direction', lambda data: make['direction'](layout, data), [direction])
    if reference.size:
        yield _filled('reference', lambda *data: make['reference'](
            header(), names, *data, np.zeros(0)), [reference, reference_velocity], stamps)
    for name, each in zip(names, joints):
        if each.load is not None:
            yield _filled('interaction_wrench', lambda data, name=name: make['interaction_wrench'](
                header(name), wrench(vector(0.0, 0.0, 0.0), vector(0.0, 0.0, data[0]))),
                [np.asarray(each.load, dtype=float)[:, None]], stamps)
        if each.temperature is not None:
            yield _filled('motor_temperature', lambda data, name=name: make['motor_temperature'](
                header(name), data[0], 0.0),
                [np.asarray(each.temperature, dtype=float)[:, None]], stamps)
    yield _filled('joint_states', lambda *data: make['joint_states'](header(), names, *data),
                  [position, velocity, effort], stamps)


def _filled(topic: str, make: Callable[..., Any], signals: Sequence[np.ndarray],
            stamps: np.ndarray | None = None) -> tuple[str, np.ndarray]:
    """Return a topic and serialised messages that differ in values of signals and the stamp alone.

    One message with marks is serialised, and the marks are replaced in its copies, which takes a
    quarter or more off the time of writing. `signals` are (N, M) each; a message with `stamps` in
    ns begins with one.
    """
    # No two numbers of a message are the same; the signal that is one of bytes stands last.
    marks = [(np.arange(signal.shape[1]) + 1 + 100 * k).astype(signal.dtype)
             for k, signal in enumerate(signals)]
    pattern = bytes(get_typestore(Stores.ROS2_JAZZY).serialize_cdr(make(*marks), TOPICS[topic]))
    rows = np.tile(np.frombuffer(pattern, np.uint8), (len(signals[0]), 1))
    for mark, signal in zip(marks, signals):
        begin = pattern.rindex(mark.tobytes())
        rows[:, begin:begin + mark.nbytes] = np.ascontiguousarray(signal).view(np.uint8)
    if stamps is not None:
        seconds = np.column_stack(np.divmod(stamps, NANO)).astype(np.uint32)
        rows[:, _STAMP] = seconds.view(np.uint8)
    return topic, rows
