# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Makes recordings for the tests of the recordings room."""

import os
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

from friction_comp.recordings.writer import RecordingWriter, write_samples
from friction_comp.samples import Samples

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
KIND, WRENCH = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/WrenchStamped'
FLOAT_ARRAY, INT8_ARRAY = 'std_msgs/msg/Float64MultiArray', 'std_msgs/msg/Int8MultiArray'
BATCH = 20
DATA = Path(os.environ.get(
    'FRICTION_COMP_DATA', Path(__file__).resolve().parents[2] / 'shared' / 'data'))
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason='measured recordings are not here (FRICTION_COMP_DATA)')


def make_samples(count=200, **changes):
    random = np.random.default_rng(0)
    time_ = np.arange(count) * 1e-3
    samples = Samples(
        time=time_, position=random.normal(size=count), velocity=random.normal(size=count),
        current=random.normal(size=count), load=random.normal(size=count),
        temperature=20.0 + time_, command=random.normal(size=count),
        direction=np.sign(np.sin(40.0 * time_)).astype(int),
        reference_position=random.normal(size=count),
        reference_velocity=random.normal(size=count), joint='elbow')
    return samples.with_(**changes)


def header(stamp_ns, frame=''):
    return T['std_msgs/msg/Header'](
        T['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 1_000_000_000)), frame)


def joint_state(stamp_ns, names, position, velocity, effort):
    return KIND, T[KIND](
        header(stamp_ns), list(names), *(np.array(v, dtype=float) for v in (
            position, velocity, effort)))


def wrench(stamp_ns, frame, torque):
    vector = T['geometry_msgs/msg/Vector3']
    return WRENCH, T[WRENCH](header(stamp_ns, frame), T['geometry_msgs/msg/Wrench'](
        vector(0.0, 0.0, 0.0), vector(0.0, 0.0, torque)))


def array(kind, values, labels=()):
    layout = T['std_msgs/msg/MultiArrayLayout'](
        [T['std_msgs/msg/MultiArrayDimension'](label, 1, 1) for label in labels], 0)
    dtype = np.int8 if kind == INT8_ARRAY else float
    return kind, T[kind](layout, np.array(values, dtype=dtype))


def record(path, messages, plugin=StoragePlugin.MCAP, compression=None):
    """Write (topic, receive time in ns, (type, message)) with the library's own writer."""
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, receive, (kind, message) in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], receive, STORE.serialize_cdr(message, kind))
    return path


def states(count=50, names=('elbow',), stamp=lambda k: 1_000_000_000 + k * 1_000_000):
    for k in range(count):
        values = [k + 100.0 * j for j in range(len(names))]
        yield '/joint_states', 5_000_000_000 + k * 1_000_000, joint_state(
            stamp(k), names, values, values, [2.0 * v for v in values])


def write_states(recording, numbers):
    """Write numbered states, and flush to the disk after every `BATCH` of them."""
    for k in numbers:
        stamp = 1_000_000_000 + k * 1_000_000
        _, message = joint_state(stamp, ['elbow'], [1e-3 * k], [], [float(k)])
        recording.write('joint_states', KIND, stamp, bytes(STORE.serialize_cdr(message, KIND)))
        if k % BATCH == BATCH - 1:
            recording.flush()


def record_with_diagnostics(path, samples, changes):
    """Write samples with what a compensator says of itself once a second."""
    draft = path.with_name(f'{path.name}_draft')
    write_samples(draft, samples)
    kind = 'diagnostic_msgs/msg/DiagnosticArray'
    types = STORE.types
    with Reader(draft) as reader, RecordingWriter(path) as recording:
        said = 0
        for connection, when, payload in reader.messages():
            recording.write(connection.topic, connection.msgtype, when, bytes(payload))
            second = when // 1_000_000_000
            active = [pair for since, pair in changes if second - 1 >= since]
            if second > said and active:
                said = second
                law, model = active[-1]
                items = [types['diagnostic_msgs/msg/KeyValue'](key, value) for key, value in (
                    ('state', 'active'), ('law', law), ('model_files', f"['{model}']"))]
                status = types['diagnostic_msgs/msg/DiagnosticStatus'](
                    0, 'arm/compensator: compensation', 'compensating', '', items)
                header = types['std_msgs/msg/Header'](
                    types['builtin_interfaces/msg/Time'](second, 0), '')
                message = types[kind](header, [status])
                recording.write('/diagnostics', kind, when, bytes(STORE.serialize_cdr(
                    message, kind)))
