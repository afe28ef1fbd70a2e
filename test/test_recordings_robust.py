# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Unusable recordings give a clear message; written recordings are complete or absent."""

from hypothesis import given, strategies as st
import numpy as np
import pytest
from recording_maker import (
    array,
    header,
    joint_state,
    make_samples,
    record,
    states,
    STORE,
    T,
    wrench,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
import yaml

from friction_comp.errors import InputError
from friction_comp.recordings import cdr, read_recording, RecordingWriter, write_samples
from friction_comp.topics import TORQUE_UNIT


def one_line(error):
    text = str(error.value)
    assert '\n' not in text
    return text


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('missing', None, 'no such file'),
    ('empty.mcap', b'', 'empty'),
    ('text.mcap', b'these are words, not a recording at all', 'not an mcap file'),
    ('table.csv', b'time,position\n', 'which column is the effort'),
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
    (tmp_path / 'week').mkdir()
    (tmp_path / 'week' / 'log.csv').write_text('t,q,tau\n')
    with pytest.raises(InputError, match='no recording in this folder; tables must be named') as no:
        read_recording(tmp_path)
    assert str(no.value).endswith(f'for instance with {tmp_path}/*/*.csv')
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
    with pytest.raises(InputError, match='contain no message'):
        read_recording(tmp_path / 'none')
    messages = [('/joint_states', k, joint_state(k + 1, ['elbow'], [1.0], [], []))
                for k in range(5)]
    record(tmp_path / 'effort', messages)
    with pytest.raises(InputError, match='no finite effort'):
        read_recording(tmp_path / 'effort')
    with pytest.raises(InputError, match='torque_constant must be a positive'):
        read_recording(tmp_path / 'effort', torque_constant=0.0)


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


def test_labels_that_differ_from_message_to_message_cost_no_more():
    """A label may be the stamp of what it answers: those messages are decoded together."""
    kind = cdr.FLOAT_ARRAY
    raw = [bytes(STORE.serialize_cdr(T[kind](
        T['std_msgs/msg/MultiArrayLayout'](
            [T['std_msgs/msg/MultiArrayDimension'](f'{1000 + k}', 1, 1)], 0),
        np.array([0.5 * k])), kind)) for k in range(50)]
    (index, _, fields), = cdr.decode(kind, raw)
    assert index.tolist() == list(range(50))
    assert fields['data'][:, 0] == pytest.approx(0.5 * np.arange(50))


def test_each_command_is_taken_in_the_unit_that_it_names(tmp_path):
    """Amperes or N·m, also where the commander changed on the way; no unit is amperes."""
    messages = list(states(60))
    for (_, receive, _), labels in zip(messages[:], [()] * 20 + [('joint', TORQUE_UNIT)] * 20
                                       + [('joint', 'A')] * 20):
        value = 3.0 if TORQUE_UNIT in labels else 0.5
        messages.append(('/current_command', receive, array(cdr.FLOAT_ARRAY, [value], labels)))
    messages.sort(key=lambda one: one[1])
    samples, = read_recording(record(tmp_path / 'r', messages), None, 0.06, 100.0)
    np.testing.assert_allclose(samples.command, 0.5)


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
        assert not list(cdr.decode(kind, [raw[:size]]))


def test_big_endian_recording(tmp_path):
    samples, = read_recording(record(tmp_path / 'r', states(), little_endian=False))
    np.testing.assert_array_equal(samples.current, 2.0 * np.arange(50.0))


def test_a_long_recording_is_read_whole(tmp_path):
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
    samples, = read_recording(tmp_path / 'r')
    assert len(samples) == count
    assert samples.time[-1] == pytest.approx(79.999)


def test_writer_keeps_what_was_written_and_nothing_else(tmp_path):
    kind, message = joint_state(1, ['elbow'], [1.0], [], [2.0])
    raw = bytes(STORE.serialize_cdr(message, kind))

    def record_until(error, name):
        with RecordingWriter(tmp_path / name) as recording:
            recording.write('joint_states', kind, 1, raw)
            raise error

    with pytest.raises(RuntimeError, match='pulled'):
        record_until(RuntimeError('plug pulled'), 'kept')
    samples, = read_recording(tmp_path / 'kept')
    assert len(samples) == 1
    with pytest.raises(InputError, match='already exists'):
        RecordingWriter(tmp_path / 'kept')
    with pytest.raises(InputError, match='nothing was recorded'), RecordingWriter(tmp_path / 'n'):
        pass
    with pytest.raises(InputError, match='not a message type'), \
            RecordingWriter(tmp_path / 'n') as recording:
        recording.write('topic', 'some_msgs/msg/Unknown', 1, raw)
    assert [p.name for p in tmp_path.iterdir()] == ['kept']


def test_writer_makes_what_rosbag2_reads(tmp_path):
    write_samples(tmp_path / 'trial', make_samples(20))
    metadata = yaml.safe_load((tmp_path / 'trial' / 'metadata.yaml').read_text())
    info = metadata['rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == 'mcap'
    assert info['relative_file_paths'] == ['trial_0.mcap']
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
