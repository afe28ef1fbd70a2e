# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings are read whole, fast, and with a plain word where they cannot be used."""

import os
from pathlib import Path
import shutil
import time

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
import yaml

from friction_comp.errors import InputError
from friction_comp.recordings import (
    cdr,
    find_recordings,
    inspect_recording,
    read_recording,
    read_recording_with_info,
    RecordingWriter,
    write_samples,
)
from friction_comp.samples import Samples

STORE = get_typestore(Stores.ROS2_JAZZY)
T = STORE.types
DATA = Path(os.environ.get(
    'FRICTION_COMP_DATA', Path(__file__).resolve().parents[2] / 'shared' / 'data'))


def make_samples(count=200, joint='elbow', seed=0, **changes):
    random = np.random.default_rng(seed)
    time_ = np.arange(count) * 1e-3
    samples = Samples(
        time=time_, position=random.normal(size=count), velocity=random.normal(size=count),
        current=random.normal(size=count), load=random.normal(size=count),
        temperature=20.0 + time_, command=random.normal(size=count),
        direction=np.sign(np.sin(40.0 * time_)).astype(int),
        reference_position=random.normal(size=count),
        reference_velocity=random.normal(size=count), joint=joint)
    return samples.with_(**changes)


def header(stamp_ns, frame=''):
    return T['std_msgs/msg/Header'](
        T['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 1_000_000_000)), frame)


def joint_state(stamp_ns, names, position, velocity, effort):
    return cdr.JOINT_STATE, T[cdr.JOINT_STATE](
        header(stamp_ns), list(names), *(np.array(v, dtype=float) for v in (
            position, velocity, effort)))


def wrench(stamp_ns, frame, torque):
    vector = T['geometry_msgs/msg/Vector3']
    return cdr.WRENCH, T[cdr.WRENCH](header(stamp_ns, frame), T['geometry_msgs/msg/Wrench'](
        vector(0.0, 0.0, 0.0), vector(0.0, 0.0, torque)))


def array(kind, values):
    layout = T['std_msgs/msg/MultiArrayLayout']([], 0)
    dtype = np.int8 if kind == cdr.INT8_ARRAY else float
    return kind, T[kind](layout, np.array(values, dtype=dtype))


def record(path, messages, plugin=StoragePlugin.MCAP, compression=None, little_endian=True):
    """Write (topic, receive time in ns, (type, message)) with the library's own writer."""
    writer = Writer(path, version=9, storage_plugin=plugin)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, receive, (kind, message) in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], receive,
                         STORE.serialize_cdr(message, kind, little_endian=little_endian))
    return path


def states(count=50, names=('elbow',), stamp=lambda k: 1_000_000_000 + k * 1_000_000,
           velocity=True):
    for k in range(count):
        values = [k + 100.0 * j for j in range(len(names))]
        yield '/joint_states', 5_000_000_000 + k * 1_000_000, joint_state(
            stamp(k), names, values, values if velocity else [], [2.0 * v for v in values])


def test_what_was_written_is_read_back(tmp_path):
    samples = make_samples()
    write_samples(tmp_path / 'trial', samples, 0.119, 100.0, namespace='/robot/left')
    read, = read_recording(tmp_path / 'trial', 'elbow', 0.119, 100.0)
    for name in ('position', 'velocity', 'load', 'command', 'direction', 'reference_position',
                 'reference_velocity'):
        np.testing.assert_array_equal(getattr(read, name), getattr(samples, name), name)
    np.testing.assert_allclose(read.current, samples.current, rtol=1e-14)
    np.testing.assert_allclose(read.time, samples.time, atol=1e-12)
    # Temperature is sent at a lower rate; it rises linearly, so that nothing is lost between.
    np.testing.assert_allclose(read.temperature[:101], samples.temperature[:101], atol=1e-12)
    assert read.joint == 'elbow'


def test_reading_says_what_the_recording_holds(tmp_path):
    write_samples(tmp_path / 'trial', make_samples(), custom_data={'model_file': 'elbow.yaml'})
    (samples, info), = read_recording_with_info(tmp_path / 'trial')
    assert info.model == 'elbow.yaml'
    assert info.start == pytest.approx(1.0)
    assert info.topics['/joint_states'] == (cdr.JOINT_STATE, 200)
    np.testing.assert_array_equal(info.rows, np.arange(200))
    np.testing.assert_array_equal(info.stamps, samples.time)
    assert info.notes == []
    assert inspect_recording(tmp_path / 'trial').joints == ['elbow']


@pytest.mark.parametrize(('node', 'value', 'expected'), [
    ('left/compensator', "['a.yaml', 'b.yaml']", 'a.yaml, b.yaml'),
    ('compensator', 'a.yaml', 'a.yaml'), ('compensator', '[]', None), ('plant', 'a.yaml', None),
])
def test_the_active_model_is_found_in_diagnostics(tmp_path, node, value, expected):
    kind = 'diagnostic_msgs/msg/DiagnosticArray'
    status = T['diagnostic_msgs/msg/DiagnosticStatus'](
        0, node, 'active', 'elbow', [T['diagnostic_msgs/msg/KeyValue']('law', 'paper'),
                                     T['diagnostic_msgs/msg/KeyValue']('model_files', value)])
    record(tmp_path / 'r', [*states(), ('/diagnostics', 1, (kind, T[kind](header(1), [status])))])
    (_, info), = read_recording_with_info(tmp_path / 'r')
    assert info.model == expected


@pytest.mark.parametrize(('plugin', 'compression'), [
    (StoragePlugin.MCAP, None), (StoragePlugin.MCAP, CompressionMode.FILE),
    (StoragePlugin.MCAP, CompressionMode.MESSAGE), (StoragePlugin.MCAP, CompressionMode.STORAGE),
    (StoragePlugin.SQLITE3, None), (StoragePlugin.SQLITE3, CompressionMode.FILE),
    (StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
])
def test_every_storage_and_compression_is_read(tmp_path, plugin, compression):
    record(tmp_path / 'r', states(), plugin, compression)
    samples, = read_recording(tmp_path / 'r')
    np.testing.assert_array_equal(samples.position, np.arange(50.0))


def test_a_single_file_and_folders_of_recordings(tmp_path):
    for name in ('b', 'a', 'deep/c'):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        record(tmp_path / name, states())
    shutil.copy(tmp_path / 'a' / 'a.mcap', tmp_path / 'single.mcap')
    (tmp_path / 'notes.txt').write_text('not a recording')
    found = find_recordings(tmp_path)
    assert [p.name for p in found] == ['a', 'b', 'c', 'single.mcap']
    parts = read_recording(tmp_path)
    assert [set(p.recording) for p in parts] == [{0}, {1}, {2}, {3}]
    # The same recording is not counted twice.
    assert len(read_recording([tmp_path / 'a', tmp_path / 'b' / '..' / 'a'])) == 1


def test_one_joint_of_several(tmp_path):
    names = ('shoulder', 'elbow', 'wrist')
    messages = list(states(names=names))
    for k in range(50):
        receive = 5_000_000_000 + k * 1_000_000
        messages.append(('/current_command', receive, array(cdr.FLOAT_ARRAY, [1.0, 2.0 + k, 3.0])))
        messages.append(('/direction', receive, array(cdr.INT8_ARRAY, [0, -1, 7])))
        for j, name in enumerate(names):
            messages.append(('/interaction_wrench', receive,
                             wrench(1_000_000_000 + k * 1_000_000, name, 10.0 * j + k)))
    record(tmp_path / 'r', messages)
    samples, = read_recording(tmp_path / 'r', 'elbow')
    np.testing.assert_array_equal(samples.position, 100.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.load, 10.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.command, 2.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.direction, np.full(50, -1))
    # A direction that is none counts as 0.
    np.testing.assert_array_equal(
        read_recording(tmp_path / 'r', 'wrist')[0].direction, np.zeros(50))
    with pytest.raises(InputError, match=r"'shoulder', 'elbow', 'wrist'"):
        read_recording(tmp_path / 'r')
    with pytest.raises(InputError, match=r"no joint 'hip'.*'elbow'"):
        read_recording(tmp_path / 'r', 'hip')


def test_arrays_follow_the_joints_of_the_reference_where_they_are_fewer(tmp_path):
    messages = list(states(names=('shoulder', 'elbow')))
    for k in range(50):
        receive = 5_000_000_000 + k * 1_000_000
        messages.append(('/reference', receive, joint_state(
            1_000_000_000 + k * 1_000_000, ['elbow'], [0.5 * k], [1.0], [])))
        messages.append(('/direction', receive, array(cdr.INT8_ARRAY, [1])))
    record(tmp_path / 'r', messages)
    samples, = read_recording(tmp_path / 'r', 'elbow')
    np.testing.assert_array_equal(samples.direction, np.ones(50))
    np.testing.assert_array_equal(samples.reference_position, 0.5 * np.arange(50.0))
    (other, info), = read_recording_with_info(tmp_path / 'r', 'shoulder')
    assert other.direction is None
    assert any('fits no list of joints' in note for note in info.notes)


def test_joint_names_may_change_their_order(tmp_path):
    messages = []
    for k in range(40):
        names = ('a', 'b') if k % 3 else ('b', 'a')
        values = [float(k) if name == 'a' else -float(k) for name in names]
        stamp = 1_000_000_000 + k * 1_000_000
        messages.append(('/joint_states', stamp, joint_state(stamp, names, values, [], values)))
    record(tmp_path / 'r', messages)
    samples, = read_recording(tmp_path / 'r', 'a')
    np.testing.assert_array_equal(samples.position, np.arange(40.0))
    assert samples.velocity is None


def test_empty_stamps_are_replaced_by_receive_times(tmp_path):
    record(tmp_path / 'none', states(stamp=lambda k: 0))
    (samples, info), = read_recording_with_info(tmp_path / 'none')
    np.testing.assert_allclose(np.diff(samples.time), 1e-3, atol=1e-9)
    assert info.start == pytest.approx(5.0)
    # A clock that starts at zero makes no gap of years.
    record(tmp_path / 'clock', states(stamp=lambda k: k * 1_000_000))
    (samples, info), = read_recording_with_info(tmp_path / 'clock')
    assert info.start == 0.0
    assert info.notes == []
    np.testing.assert_allclose(np.diff(samples.time), 1e-3, atol=1e-9)
    # Single empty stamps are put onto the clock of the others.
    record(tmp_path / 'some', states(
        stamp=lambda k: 0 if k % 7 == 3 else 1_000_000_000 + k * 1_000_000))
    samples, = read_recording(tmp_path / 'some')
    np.testing.assert_allclose(samples.time, 1e-3 * np.arange(50), atol=1e-9)


def test_bad_samples_are_left_out_and_counted(tmp_path):
    messages = list(states())
    for k, value in ((3, np.nan), (9, np.inf)):
        messages[k][2][1].position[0] = value
    messages[12][2][1].effort[0] = -np.inf
    # One message came twice, two came in each other's place.
    messages.insert(21, messages[20])
    messages[30], messages[31] = (
        (messages[30][0], messages[30][1], messages[31][2]),
        (messages[31][0], messages[31][1], messages[30][2]))
    record(tmp_path / 'r', messages)
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    expected = np.delete(np.arange(50.0), [3, 9, 12])
    np.testing.assert_array_equal(samples.position, expected)
    np.testing.assert_allclose(samples.time, 1e-3 * expected, atol=1e-12)
    assert info.dropped == {'not finite': 3, 'duplicate stamp': 1}
    assert any('out of order' in note for note in info.notes)
    assert len(info.stamps) == 51


def test_velocity_full_of_nan_counts_as_empty(tmp_path):
    messages = list(states())
    for _, _, (_, message) in messages:
        message.velocity[0] = np.nan
    samples, = read_recording(record(tmp_path / 'r', messages))
    assert samples.velocity is None
    assert len(samples) == 50


def test_sensor_that_covers_too_little_is_left_out(tmp_path):
    messages = list(states())
    messages += [('/interaction_wrench', 5_000_000_000 + k, wrench(
        1_000_000_000 + k * 1_000_000, 'elbow', 1.0)) for k in range(10)]
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    assert samples.load is None
    assert any('less than half' in note for note in info.notes)


def one_line(error):
    text = str(error.value)
    assert '\n' not in text
    return text


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('missing', None, 'no such file'),
    ('empty.mcap', b'', 'empty'),
    ('text.mcap', b'these are words, not a recording at all', 'magic'),
    ('table.csv', b'time,position\n', 'not a recording'),
    ('broken.db3', b'SQLite format 3\0' + b'x' * 200, 'not a readable recording'),
])
def test_files_that_are_no_recordings(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words) as error:
        read_recording(tmp_path / name)
    assert name in one_line(error)


def test_folders_that_are_no_recordings(tmp_path):
    with pytest.raises(InputError, match='no recording in this folder'):
        read_recording(tmp_path)
    for text in ('', 'rosbag2_bagfile_information: 3', '[', 'rosbag2_bagfile_information: {}'):
        (tmp_path / 'metadata.yaml').write_text(text)
        with pytest.raises(InputError, match='not a readable recording') as error:
            read_recording(tmp_path)
        one_line(error)


def test_recording_without_what_is_needed(tmp_path):
    record(tmp_path / 'topic', [('/direction', 1, array(cdr.INT8_ARRAY, [0]))])
    with pytest.raises(InputError, match=r'no joint_states.*topics: /direction'):
        read_recording(tmp_path / 'topic')
    with Writer(tmp_path / 'none', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection('/joint_states', cdr.JOINT_STATE, typestore=STORE)
    with pytest.raises(InputError, match='hold no message'):
        read_recording(tmp_path / 'none')
    messages = [('/joint_states', k, joint_state(k + 1, ['elbow'], [1.0], [], []))
                for k in range(5)]
    record(tmp_path / 'effort', messages)
    with pytest.raises(InputError, match='no finite effort'):
        read_recording(tmp_path / 'effort')
    with pytest.raises(InputError, match='torque constant'):
        read_recording(tmp_path / 'effort', torque_constant=0.0)


@pytest.mark.parametrize('share', [0.0, 0.01, 0.3, 0.7, 0.99])
def test_truncated_files(tmp_path, share):
    whole = (record(tmp_path / 'r', states()) / 'r.mcap').read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(whole[:int(share * len(whole))])
    with pytest.raises(InputError, match=r'cut\.mcap.*not a readable recording') as error:
        read_recording(cut)
    one_line(error)


def test_damaged_bytes_never_end_in_a_traceback(tmp_path):
    whole = (record(tmp_path / 'r', states()) / 'r.mcap').read_bytes()
    random = np.random.default_rng(4)
    refusals = []
    for _ in range(150):
        damaged = bytearray(whole)
        for at in random.integers(0, len(whole), 6):
            damaged[at] = random.integers(0, 256)
        (tmp_path / 'damaged.mcap').write_bytes(damaged)
        try:
            read_recording(tmp_path / 'damaged.mcap')
        except InputError as error:
            refusals.append(str(error))
    assert len(refusals) > 20
    assert not any('\n' in text for text in refusals)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(
    st.lists(st.text('abc_é', max_size=9), max_size=3), st.booleans(), st.booleans(),
    st.integers(0, 2**31 - 1), st.integers(0, 999_999_999), st.text('xy', max_size=5)),
    min_size=1, max_size=8), st.booleans())
def test_decoding_agrees_with_the_library(contents, little):
    messages, raw = [], []
    for k, (names, velocity, effort, seconds, nanoseconds, frame) in enumerate(contents):
        message = T[cdr.JOINT_STATE](
            header(seconds * 1_000_000_000 + nanoseconds, frame), names,
            np.arange(len(names)) + 0.25 * k,
            np.arange(len(names)) * -1.5 if velocity else np.zeros(0),
            np.arange(len(names)) * 3.5 if effort else np.zeros(0))
        messages.append(message)
        raw.append(bytes(STORE.serialize_cdr(message, cdr.JOINT_STATE, little_endian=little)))
    seen = []
    for index, names, fields in cdr.decode(cdr.JOINT_STATE, raw):
        for row, k in enumerate(index):
            seen.append(k)
            expected = messages[k]
            assert list(names) == expected.name
            for name in ('position', 'velocity', 'effort'):
                np.testing.assert_array_equal(fields[name][row], getattr(expected, name))
            stamp = expected.header.stamp
            assert fields['stamp'][row] == stamp.sec * 1_000_000_000 + stamp.nanosec
    assert sorted(seen) == list(range(len(messages)))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.lists(st.integers(-128, 127), max_size=5), min_size=1, max_size=6),
       st.lists(st.text('abc', max_size=6), max_size=2))
def test_arrays_and_sensors_decode_like_the_library(rows, labels):
    layout = T['std_msgs/msg/MultiArrayLayout'](
        [T['std_msgs/msg/MultiArrayDimension'](label, 3, 4) for label in labels], 5)
    for kind, dtype in ((cdr.INT8_ARRAY, np.int8), (cdr.FLOAT_ARRAY, float)):
        raw = [bytes(STORE.serialize_cdr(T[kind](layout, np.array(row, dtype=dtype)), kind))
               for row in rows]
        for index, _, fields in cdr.decode(kind, raw):
            for at, k in enumerate(index):
                np.testing.assert_array_equal(fields['data'][at], rows[k])
    kind, message = wrench(1_500_000_000, 'elbow', -2.5)
    (_, names, fields), = cdr.decode(kind, [bytes(STORE.serialize_cdr(message, kind))])
    assert (names, fields['wrench'][0, 5], fields['stamp'][0]) == (('elbow',), -2.5, 1_500_000_000)


def test_messages_too_short_for_their_fields(tmp_path):
    kind, message = joint_state(1, ['elbow'], [1.0], [], [2.0])
    raw = bytes(STORE.serialize_cdr(message, kind))
    for size in range(len(raw) - 1):
        with pytest.raises(ValueError, match=r'shorter|encapsulation'):
            list(cdr.decode(kind, [raw[:size]]))


def test_big_endian_recording(tmp_path):
    record(tmp_path / 'r', states(), little_endian=False)
    samples, = read_recording(tmp_path / 'r')
    np.testing.assert_array_equal(samples.current, 2.0 * np.arange(50.0))


def test_reading_is_fast(tmp_path):
    count = 80_000
    kind, message = joint_state(1, ['elbow'], [1.0], [2.0], [3.0])
    raw = np.frombuffer(STORE.serialize_cdr(message, kind), dtype=np.uint8)
    block = np.tile(raw, (count, 1))
    stamps = np.arange(count, dtype=np.int64) * 1_000_000 + 1_000_000_000
    block[:, 4:8] = (stamps // 1_000_000_000).astype('<i4')[:, None].view(np.uint8)
    block[:, 8:12] = (stamps % 1_000_000_000).astype('<u4')[:, None].view(np.uint8)
    with RecordingWriter(tmp_path / 'r') as recording:
        for stamp, row in zip(stamps.tolist(), block):
            recording.write('joint_states', kind, stamp, row.tobytes())
    begin = time.perf_counter()
    samples, = read_recording(tmp_path / 'r')
    elapsed = time.perf_counter() - begin
    assert len(samples) == count
    assert samples.time[-1] == pytest.approx(79.999)
    # 0.2 s where nothing else runs; decoding message by message takes over 5 s.
    assert elapsed < 3.0


def test_writer_leaves_a_whole_recording_or_nothing(tmp_path):
    kind, message = joint_state(1, ['elbow'], [1.0], [], [2.0])
    raw = bytes(STORE.serialize_cdr(message, kind))

    def record_until(error):
        with RecordingWriter(tmp_path / 'r') as recording:
            recording.write('joint_states', kind, 1, raw)
            raise error

    with pytest.raises(RuntimeError, match='pulled'):
        record_until(RuntimeError('plug pulled'))
    assert list(tmp_path.iterdir()) == []
    with RecordingWriter(tmp_path / 'r') as recording:
        recording.write('joint_states', kind, 1, raw)
        assert find_recordings_or_none(tmp_path) is None
    assert [p.name for p in tmp_path.iterdir()] == ['r']
    with pytest.raises(InputError, match='exists already'):
        RecordingWriter(tmp_path / 'r')
    with pytest.raises(InputError, match='nothing was recorded'), RecordingWriter(tmp_path / 'n'):
        pass
    with pytest.raises(InputError, match='not a message type'), \
            RecordingWriter(tmp_path / 'n') as recording:
        recording.write('topic', 'some_msgs/msg/Unknown', 1, raw)
    assert [p.name for p in tmp_path.iterdir()] == ['r']


def find_recordings_or_none(path):
    try:
        return find_recordings(path)
    except InputError:
        return None


def test_writer_makes_what_rosbag2_reads(tmp_path):
    write_samples(tmp_path / 'trial', make_samples(20))
    metadata = yaml.safe_load((tmp_path / 'trial' / 'metadata.yaml').read_text())
    info = metadata['rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == 'mcap'
    assert info['relative_file_paths'] == ['trial.mcap']
    assert info['starting_time']['nanoseconds_since_epoch'] == 1_000_000_000
    assert info['duration']['nanoseconds'] == 19_000_000
    topics = {t['topic_metadata']['name']: t for t in info['topics_with_message_count']}
    assert topics['/joint_states']['message_count'] == 20
    about = topics['/joint_states']['topic_metadata']
    # The hash that every Jazzy installation has for this type.
    assert about['type_description_hash'] == (
        'RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e')
    assert about['offered_qos_profiles'][0]['reliability'] == 'reliable'
    with Reader(tmp_path / 'trial') as reader:
        connection = next(c for c in reader.connections if c.topic == '/joint_states')
        _, stamp, raw = next(reader.messages([connection]))
        assert STORE.deserialize_cdr(raw, connection.msgtype).name == ['elbow']
        assert stamp == 1_000_000_000


@pytest.mark.skipif(not DATA.is_dir(), reason='the measured recordings are not here')
@pytest.mark.parametrize(('name', 'joint', 'count', 'step', 'velocity'), [
    ('ur10e_joint1', 'shoulder_pan_joint', 2427, 0.01, True),
    ('emps', 'carriage', 24841, 0.001, False),
    ('kinova_gen3_joint7', 'joint_7', 31812, 0.001, True),
])
def test_measured_recordings(name, joint, count, step, velocity):
    samples, = read_recording(DATA / name / 'fit')
    assert (samples.joint, len(samples)) == (joint, count)
    assert samples.sample_time == pytest.approx(step, rel=1e-3)
    assert (samples.velocity is not None) == velocity
