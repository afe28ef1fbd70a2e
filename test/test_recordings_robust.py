# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Damaged, unfinished and odd recordings: read up to the damage and said, or refused in a line."""

from contextlib import suppress
import errno
import os
import sqlite3
import time

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from recording_maker import (
    array,
    BATCH,
    FLOAT_ARRAY,
    INT8_ARRAY,
    joint_state,
    KIND,
    make_samples,
    record,
    states,
    STORE,
    write_states,
)
from rosbags.rosbag2 import CompressionMode, Reader, StoragePlugin, Writer
import yaml
import zstandard

from friction_comp.errors import InputError
from friction_comp.recordings import (
    find_recordings,
    read_arm,
    read_joints,
    read_recording,
    read_recording_with_info,
    RecordingWriter,
    write_samples,
)
from friction_comp.topics import TORQUE_UNIT

BATCHES = 30


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('missing', None, 'no such file'),
    ('empty.mcap', b'', 'empty'),
    ('text.mcap', b'these are words, not a recording at all', 'not an mcap file'),
    ('table.csv', b'time,position\n', 'which column is the effort'),
    ('broken.db3', b'SQLite format 3\0' + b'x' * 200, 'not a readable recording'),
    ('text.mcap.zstd', b'not compressed at all', 'cannot be unpacked'),
])
def test_files_that_are_no_recordings(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words) as error:
        read_recording(tmp_path / name)
    assert name in str(error.value)
    assert '\n' not in str(error.value)


def test_folders_that_are_no_recordings(tmp_path):
    (tmp_path / 'week').mkdir()
    (tmp_path / 'week' / 'log.csv').write_text('t,q,tau\n')
    with pytest.raises(InputError, match='no recording in this folder; tables must be named'):
        read_recording(tmp_path)
    for text in ('', 'rosbag2_bagfile_information: 3', '[', 'rosbag2_bagfile_information: {}'):
        (tmp_path / 'metadata.yaml').write_text(text)
        with pytest.raises(InputError, match='not a readable recording') as error:
            read_recording(tmp_path)
        assert '\n' not in str(error.value)


def test_recordings_without_what_is_needed(tmp_path):
    record(tmp_path / 'topic', [('/direction', 1, array(INT8_ARRAY, [0]))])
    with pytest.raises(InputError, match=r'no joint_states.*topics: /direction'):
        read_recording(tmp_path / 'topic')
    with Writer(tmp_path / 'none', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection('/joint_states', KIND, typestore=STORE)
    with pytest.raises(InputError, match='contain no message'):
        read_recording(tmp_path / 'none')
    record(tmp_path / 'effort', [('/joint_states', k, joint_state(k + 1, ['elbow'], [1.0], [], []))
                                 for k in range(5)])
    with pytest.raises(InputError, match='no finite effort'):
        read_recording(tmp_path / 'effort')
    with pytest.raises(InputError, match='torque_constant must be a positive'):
        read_recording(tmp_path / 'effort', torque_constant=0.0)


@pytest.fixture(scope='module', params=['none', 'storage'])
def whole(request, tmp_path_factory):
    """Make a file of many chunks; return its bytes."""
    folder = tmp_path_factory.mktemp('whole') / 'trial'
    with RecordingWriter(folder, compression=request.param) as recording:
        write_states(recording, range(BATCH * BATCHES))
    content = (folder / 'trial_0.mcap').read_bytes()
    assert len(read_recording(folder)[0]) == BATCH * BATCHES
    return content


@settings(max_examples=40)
@given(st.floats(0.0, 1.0, exclude_max=True), st.sampled_from(['cut', 'bit', 'zeros']))
def test_what_stands_before_a_damage_is_read_and_said(whole, tmp_path, share, kind):
    """The numbers that are read are those that were written; chunks have checksums."""
    at, path = int(share * len(whole)), tmp_path / 'damaged.mcap'
    content = bytearray(whole[:at] if kind == 'cut' else whole)
    if kind == 'bit':
        content[at] ^= 0x10
    elif kind == 'zeros':
        content[at:at + 512] = bytes(len(content[at:at + 512]))
    path.write_bytes(content)
    if share < 0.1:
        with suppress(InputError):
            read_recording(path)
        return
    (samples, info), = read_recording_with_info(path)
    np.testing.assert_array_equal(samples.current, np.arange(float(len(samples))))
    assert len(samples) >= BATCH * (int(0.9 * share * BATCHES) - 1)
    assert len(samples) == BATCH * BATCHES or 'damaged or not finished' in info.notes[0]


def test_a_damaged_database_is_read_as_far_as_it_is_whole(tmp_path):
    folder = record(tmp_path / 'r', states(4000), StoragePlugin.SQLITE3)
    content = bytearray((folder / 'r.db3').read_bytes())
    half = len(content) // 2 // 4096 * 4096
    content[half:half + 8 * 4096] = b'\xff' * (8 * 4096)
    (folder / 'r.db3').write_bytes(content)
    (samples, info), = read_recording_with_info(folder)
    np.testing.assert_array_equal(samples.position, np.arange(float(len(samples))))
    assert 500 < len(samples) < 4000
    assert any('damaged or not finished: database disk image' in note for note in info.notes)


def test_a_sync_that_fails_while_the_recording_ends_is_reported(tmp_path, monkeypatch):
    sync, failures = os.fsync, [OSError(errno.EIO, 'Input/output error')]

    def fail_once(number):
        if failures:
            time.sleep(0.1)     # The disk is slow: the recording is closed meanwhile.
            raise failures.pop()
        sync(number)
    monkeypatch.setattr(os, 'fsync', fail_once)
    # The system reports the failure to the first sync only; later ones succeed.
    with pytest.raises(InputError, match='Input/output error; what was written'), \
            RecordingWriter(tmp_path / 'r') as recording:
        write_states(recording, range(BATCH))
    assert len(read_recording(tmp_path / 'r')[0]) == BATCH


def test_of_several_files_it_is_said_which_are_missing(tmp_path):
    """As rosbag2 splits a recording."""
    (tmp_path / 'r').mkdir()
    for part in range(4):
        with RecordingWriter(tmp_path / f'part{part}') as recording:
            write_states(recording, range(100 * part, 100 * (part + 1)))
        (tmp_path / f'part{part}' / f'part{part}_0.mcap').rename(
            tmp_path / 'r' / f'r_{part}.mcap')
    about = (tmp_path / 'part0' / 'metadata.yaml').read_text().replace(
        '[part0_0.mcap]', '[r_0.mcap, r_1.mcap, r_2.mcap, r_3.mcap]', 1)
    for part in range(4):
        (tmp_path / f'part{part}' / 'metadata.yaml').unlink()
    (tmp_path / 'r' / 'metadata.yaml').write_text(about)
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    np.testing.assert_array_equal(samples.current, np.arange(400.0))
    assert info.notes == []
    (tmp_path / 'r' / 'r_1.mcap').unlink()
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 300
    assert '1 of its 4 files are missing: r_1.mcap' in info.notes
    for text in ('', '[', 'rosbag2_bagfile_information: 3'):
        (tmp_path / 'r' / 'metadata.yaml').write_text(text)
        assert find_recordings(tmp_path) == [tmp_path / 'r']
        (samples, info), = read_recording_with_info(tmp_path)
        assert len(samples) == 300
        assert 'metadata.yaml' in info.notes[0]


def test_metadata_cannot_point_outside_of_the_recording(tmp_path):
    record(tmp_path / 'secret', states())
    (tmp_path / 'r').mkdir()
    text = (tmp_path / 'secret' / 'metadata.yaml').read_text()
    (tmp_path / 'r' / 'metadata.yaml').write_text(
        text.replace('secret.mcap', '../secret/secret.mcap'))
    with pytest.raises(InputError, match='which is not here'):
        read_recording(tmp_path / 'r')


def test_a_message_that_cannot_be_decoded_costs_itself(tmp_path):
    with RecordingWriter(tmp_path / 'r') as recording:
        write_states(recording, range(100))
        raw = bytes(STORE.serialize_cdr(joint_state(1, ['elbow'], [1.0], [], [2.0])[1], KIND))
        for payload in (b'', b'no message', b'\0\1\0\0' + b'\xff' * 30, raw[:-9],
                        b'\x28\xb5\x2f\xfd' + b'\xff' * 30):
            recording.write('joint_states', KIND, 1_100_000_000, payload)
        write_states(recording, range(100, 200))
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 200
    assert any('5 of the messages of /joint_states left out' in note for note in info.notes)


@pytest.mark.parametrize(('plugin', 'name', 'change'), [
    (StoragePlugin.MCAP, 'alone.mcap.zstd', zstandard.compress),
    (StoragePlugin.SQLITE3, 'alone.db3.zstd', zstandard.compress),
    # Compressed by message, and not finished.
    (StoragePlugin.MCAP, 'alone.mcap', lambda content: content[:-200])])
def test_a_compressed_or_unfinished_file_alone_is_read(tmp_path, plugin, name, change):
    folder = record(tmp_path / 'r', states(), plugin,
                    CompressionMode.MESSAGE if 'zstd' not in name else None)
    content = next(path for path in folder.iterdir() if path.suffix != '.yaml').read_bytes()
    (tmp_path / name).write_bytes(change(content))
    assert len(read_recording(tmp_path / name)[0]) == 50


def test_big_endian_messages_and_any_text_of_qos(tmp_path):
    folder = record(tmp_path / 'r', states(), StoragePlugin.SQLITE3, little_endian=False)
    database = sqlite3.connect(folder / 'r.db3')
    database.execute("UPDATE topics SET offered_qos_profiles = '- history: 42\n  depth: [so'")
    database.commit()
    database.close()
    metadata = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(metadata.replace('volatile', 'whatever'))
    samples, = read_recording(folder)
    np.testing.assert_array_equal(samples.current, 2.0 * np.arange(50.0))


def test_each_command_is_taken_in_the_unit_that_it_names(tmp_path):
    """Amperes or N·m, also where the commander changed on the way; no unit is amperes."""
    messages = list(states(60))
    for (_, receive, _), labels in zip(messages[:], [()] * 20 + [('joint', TORQUE_UNIT)] * 20
                                       + [('joint', 'A')] * 20):
        value = 3.0 if TORQUE_UNIT in labels else 0.5
        messages.append(('/current_command', receive, array(FLOAT_ARRAY, [value], labels)))
    messages.sort(key=lambda one: one[1])
    samples, = read_recording(record(tmp_path / 'r', messages), None, 0.06, 100.0)
    np.testing.assert_allclose(samples.command, 0.5)


def test_the_writer_keeps_what_was_written_and_nothing_else(tmp_path):
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


def test_the_writer_makes_what_rosbag2_reads(tmp_path):
    write_samples(tmp_path / 'trial', make_samples(20))
    info = yaml.safe_load((tmp_path / 'trial' / 'metadata.yaml').read_text())[
        'rosbag2_bagfile_information']
    assert (info['version'], info['storage_identifier']) == (9, 'mcap')
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


@pytest.mark.parametrize(('stamp', 'kept', 'said'), [
    # The clock is set back; single stamps are far off, or empty.
    (lambda k: k - (300 if k >= 600 else 0), range(600), '400 joint states left out: stamp'),
    (lambda k: k + {70: 10**7, 200: -10**4}.get(k, 0), np.delete(np.arange(1000), [70, 200]),
     '2 joint states left out: stamp far off'),
    (lambda k: -100_000 if k % 7 == 3 else k, np.flatnonzero(np.arange(1000) % 7 != 3),
     '143 joint states left out: stamp far off')])
def test_what_no_clock_in_order_says_is_left_out_and_said(tmp_path, stamp, kept, said):
    messages = states(1000, stamp=lambda k: (100_000 + stamp(k)) * 1_000_000)
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    np.testing.assert_array_equal(samples.position, kept)
    assert any(said in note for note in info.notes)


def test_gaps_and_wraps_are_reported(tmp_path):
    messages = []
    for k in range(3000):
        time = 1_000_000_000 + (k + (500 if k >= 1200 else 0)) * 1_000_000
        angle = (0.004 * k + np.pi) % (2.0 * np.pi) - np.pi
        messages.append(('/joint_states', time, joint_state(time, ['elbow'], [angle], [], [1.0])))
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    np.testing.assert_allclose(samples.position, 0.004 * np.arange(3000), atol=1e-9)
    assert '1 gaps, the longest of 0.501 s after 1.199 s' in info.notes
    assert 'position wraps around 2 times: turns are added' in info.notes


def test_joints_are_read_together(tmp_path):
    messages = []
    for k in range(100):
        time = 1_000_000_000 + k * 1_000_000
        values = [float(k), np.nan if k == 40 else -float(k)]
        messages.append(('/joint_states', time, joint_state(
            time, ['a', 'b'], [1e-3 * v for v in values], [], values)))
    record(tmp_path / 'r', messages)
    joints = read_arm(tmp_path / 'r', {'a': 1.0, 'b': 10.0}.__getitem__)
    assert list(joints) == ['a', 'b']
    (first, _), = joints['a']
    (second, _), = joints['b']
    np.testing.assert_array_equal(first.current, np.arange(100.0))
    np.testing.assert_array_equal(second.current, -np.delete(np.arange(100.0), 40) / 10.0)
    np.testing.assert_allclose(second.arm.position[:, 0], -second.arm.position[:, 1], atol=1e-9)


def test_joints_of_several_topics_are_converted_at_the_same_times(tmp_path):
    messages = []
    for k in range(100):
        time = 1_000_000_000 + k * 1_000_000
        for name in ('left', 'right') if k >= 10 else ('left',):
            messages.append((f'/{name}/joint_states', time, joint_state(
                time, [name], [1e-3 * k], [], [1.0])))
    joints, _ = read_joints(record(tmp_path / 'r', messages))
    for samples in joints:
        np.testing.assert_array_equal(samples.position, 1e-3 * np.arange(10, 100))
        np.testing.assert_array_equal(samples.time, joints[0].time)
    # The motion of all joints belongs to each of them.
    samples, = read_recording(tmp_path / 'r', 'right')
    np.testing.assert_allclose(samples.arm.position[:, 0], samples.position, atol=1e-9)


def test_a_recording_whose_only_values_are_far_off_is_refused(tmp_path):
    messages = []
    for k in range(20):
        time = 1_000_000_000 + k * 1_000_000 + (10**12 if k == 10 else 0)
        messages.append(('/joint_states', time, joint_state(
            time, ['elbow'], [0.1 if k == 10 else np.nan], [], [1.0])))
    with pytest.raises(InputError, match='never has position and effort'):
        read_recording(record(tmp_path / 'r', messages))
