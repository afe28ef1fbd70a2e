# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Truncated, damaged and unfinished recordings are read as far as possible, with notes."""

import errno
import os
import random
import shutil
import sqlite3
import time

from hypothesis import given, settings, strategies as st
from mcap.reader import make_reader
import numpy as np
import pytest
from recording_maker import array, BATCH, joint_state, KIND, record, states, STORE, write_states
from rosbags.rosbag2 import CompressionMode, StoragePlugin
import zstandard

from friction_comp.errors import InputError
from friction_comp.recordings import (
    find_recordings,
    read_arm,
    read_joints,
    read_recording,
    read_recording_with_info,
    RecordingWriter,
    stream_recording_with_info,
)

BATCHES = 30


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Make a file of many chunks; return its bytes and where each chunk ends."""
    folder = tmp_path_factory.mktemp('whole') / 'trial'
    with RecordingWriter(folder) as recording:
        write_states(recording, range(BATCH * BATCHES))
    with (folder / 'trial_0.mcap').open('rb') as stream:
        indexes = make_reader(stream).get_summary().chunk_indexes
    ends = [index.chunk_start_offset + index.chunk_length for index in indexes]
    assert len(ends) == BATCHES
    return (folder / 'trial_0.mcap').read_bytes(), ends


@given(st.floats(0.0, 1.0, exclude_max=True))
def test_a_file_cut_anywhere_gives_every_whole_chunk(whole, tmp_path, share):
    content, ends = whole
    cut = int(share * len(content))
    path = tmp_path / 'cut.mcap'
    path.write_bytes(content[:cut])
    expected = BATCH * sum(end <= cut for end in ends)
    if not expected:
        with pytest.raises(InputError, match=r'cut\.mcap: not a readable recording'):
            read_recording(path)
        return
    (samples, info), = read_recording_with_info(path)
    np.testing.assert_array_equal(samples.current, np.arange(float(expected)))
    assert info.notes


@pytest.mark.parametrize('finished', [True, False])
def test_losses_by_a_zeroed_block_are_always_reported(whole, tmp_path, finished):
    content, ends = whole
    if not finished:
        content = content[:ends[-1]]
    draw = random.Random(5)
    kept = []
    for _ in range(40):
        begin, size = draw.randrange(len(content)), draw.choice([16, 512, 4096])
        block = content[begin:begin + size]
        damaged = content[:begin] + bytes(len(block)) + content[begin + len(block):]
        if damaged == content:
            continue
        path = tmp_path / 'zeroed.mcap'
        path.write_bytes(damaged)
        try:
            (samples, info), = read_recording_with_info(path)
        except InputError:
            kept.append(0)
            continue
        assert [note for note in info.notes if 'gaps' not in note], (begin, size)
        # What is left is true, and at most the chunks that the block touches are gone.
        np.testing.assert_allclose(samples.position, 1e-3 * samples.current)
        touched = sum(end >= begin and end - len(content) // BATCHES <= begin + size
                      for end in ends)
        assert len(samples) >= BATCH * (BATCHES - touched - 2)
        kept.append(len(samples))
    assert np.median(kept) >= BATCH * (BATCHES - 6)


def test_one_flipped_bit_costs_its_chunk_and_is_reported(whole, tmp_path):
    content, ends = whole
    damaged = bytearray(content)
    damaged[ends[9] - 400] ^= 0x10
    path = tmp_path / 'flipped.mcap'
    path.write_bytes(damaged)
    (samples, info), = read_recording_with_info(path)
    assert len(samples) == BATCH * (BATCHES - 1)
    assert '1 damaged chunks left out (checksum)' in info.notes
    assert '20 of 600 messages are missing' in info.notes


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


def test_split_recordings_are_one_and_say_what_is_missing(tmp_path):
    with RecordingWriter(tmp_path / 'r', split_duration=0.1) as recording:
        write_states(recording, range(350))
    files = sorted(path.name for path in (tmp_path / 'r').glob('*.mcap'))
    assert files == ['r_0.mcap', 'r_1.mcap', 'r_2.mcap', 'r_3.mcap']
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 350
    assert info.notes == []
    (tmp_path / 'r' / 'r_1.mcap').rename(tmp_path / 'gone')
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 250
    assert '1 of its 4 files are missing: r_1.mcap' in info.notes
    for text in (None, '', '[', 'rosbag2_bagfile_information: 3'):
        (tmp_path / 'r' / 'metadata.yaml').unlink(missing_ok=True)
        if text is not None:
            (tmp_path / 'r' / 'metadata.yaml').write_text(text)
        assert find_recordings(tmp_path) == [tmp_path / 'r']
        (samples, info), = read_recording_with_info(tmp_path)
        assert len(samples) == 250
        assert 'metadata.yaml' in info.notes[0]
    with RecordingWriter(tmp_path / 's', split_size=20_000) as recording:
        write_states(recording, range(1000))
    sizes = [path.stat().st_size for path in (tmp_path / 's').glob('*.mcap')]
    assert 5 < len(sizes) < 20
    assert max(sizes) < 40_000


def test_a_stamp_far_ahead_does_not_end_the_splitting(tmp_path):
    with RecordingWriter(tmp_path / 'r', split_duration=0.1) as recording:
        write_states(recording, [*range(150), 10**9, *range(150, 350)])
    assert len(list((tmp_path / 'r').glob('*.mcap'))) == 5
    (samples, _), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 350


@pytest.mark.parametrize('split', [{'split_size': 0.1}, {'split_duration': 1e-3}])
def test_files_too_small_to_be_made_are_refused_before_anything_is(tmp_path, split):
    with pytest.raises(InputError, match=r'max_file_(size|duration): .* is the least'):
        RecordingWriter(tmp_path / 'r', **split)
    assert not (tmp_path / 'r').exists()


def test_a_message_that_cannot_be_decoded_costs_itself(tmp_path):
    with RecordingWriter(tmp_path / 'r') as recording:
        write_states(recording, range(100))
        for payload in (b'', b'no message', b'\0\1\0\0' + b'\xff' * 30,
                        b'\x28\xb5\x2f\xfd' + b'\xff' * 30):
            recording.write('joint_states', KIND, 1_100_000_000, payload)
        write_states(recording, range(100, 200))
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert len(samples) == 200
    assert any('4 of the messages of /joint_states left out' in note for note in info.notes)


def test_metadata_cannot_point_outside_of_the_recording(tmp_path):
    record(tmp_path / 'secret', states())
    (tmp_path / 'r').mkdir()
    text = (tmp_path / 'secret' / 'metadata.yaml').read_text()
    (tmp_path / 'r' / 'metadata.yaml').write_text(
        text.replace('secret.mcap', '../secret/secret.mcap'))
    with pytest.raises(InputError, match='which is not here'):
        read_recording(tmp_path / 'r')


@pytest.mark.parametrize('plugin', [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_compressed_file_alone_is_read(tmp_path, plugin):
    folder = record(tmp_path / 'r', states(), plugin)
    suffix = 'mcap' if plugin == StoragePlugin.MCAP else 'db3'
    plain = (folder / f'r.{suffix}').read_bytes()
    path = tmp_path / f'alone.{suffix}.zstd'
    path.write_bytes(zstandard.compress(plain))
    samples, = read_recording(path)
    assert len(samples) == 50
    path.write_bytes(b'not compressed at all')
    with pytest.raises(InputError, match='not compressed with zstd'):
        read_recording(path)


def test_the_text_of_qos_may_be_anything(tmp_path):
    folder = record(tmp_path / 'r', states(), StoragePlugin.SQLITE3)
    database = sqlite3.connect(folder / 'r.db3')
    database.execute("UPDATE topics SET offered_qos_profiles = '- history: 42\n  depth: [so'")
    database.commit()
    database.close()
    assert len(read_recording(folder)[0]) == 50
    metadata = (folder / 'metadata.yaml').read_text()
    (folder / 'metadata.yaml').write_text(metadata.replace('volatile', 'whatever'))
    assert len(read_recording(folder)[0]) == 50


@pytest.mark.parametrize('killed', [False, True])
def test_a_database_with_a_log_is_read_where_nothing_can_be_written(tmp_path, monkeypatch, killed):
    """As on a stick or in an archive: SQLite itself needs files beside a database with a log."""
    folder = record(tmp_path / 'r', states(), StoragePlugin.SQLITE3)
    database = sqlite3.connect(folder / 'r.db3')
    database.execute('PRAGMA journal_mode=WAL')
    database.execute('PRAGMA wal_autocheckpoint=0')
    database.execute('INSERT INTO messages SELECT id + 50, topic_id, timestamp, data FROM messages '
                     'WHERE id <= 20')
    database.commit()
    copy = tmp_path / 'copy'
    if killed:
        shutil.copytree(folder, copy, ignore=shutil.ignore_patterns('*-shm'))
    database.close()
    if not killed:
        shutil.copytree(folder, copy)
    before = sorted(copy.iterdir())
    assert ((copy / 'r.db3-wal') in before) == killed
    monkeypatch.setattr(os, 'access', lambda *_: False)
    samples, = read_recording(copy)
    assert sorted(copy.iterdir()) == before
    assert len(samples) == 70


def test_a_damaged_database_gives_what_is_whole(tmp_path):
    folder = record(tmp_path / 'r', states(4000), StoragePlugin.SQLITE3)
    content = bytearray((folder / 'r.db3').read_bytes())
    half = len(content) // 2 // 4096 * 4096
    content[half:half + 8 * 4096] = b'\xff' * (8 * 4096)
    (folder / 'r.db3').write_bytes(content)
    (samples, info), = read_recording_with_info(folder)
    assert 500 < len(samples) < 4000
    assert any('database is damaged' in note for note in info.notes)


def test_a_clock_set_back_mixes_nothing(tmp_path):
    def stamp(k):
        return 100_000_000_000 + k * 1_000_000 - (3_000_000_000 if k >= 600 else 0)
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', states(1000, stamp=stamp)))
    np.testing.assert_array_equal(samples.position, np.arange(1000.0))
    # The receive times went on, so nothing is missing in between.
    np.testing.assert_allclose(np.diff(samples.time), 1e-3, atol=1e-9)
    assert any('set back by 3 s after 0.599 s' in note for note in info.notes)


def test_single_stamps_far_off_are_left_out(tmp_path):
    def stamp(k):
        return 100_000_000_000 + k * 1_000_000 + {70: 10**13, 200: -10**10}.get(k, 0)
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', states(400, stamp=stamp)))
    np.testing.assert_array_equal(samples.position, np.delete(np.arange(400.0), [70, 200]))
    assert '2 joint states left out: stamp far off' in info.notes


def test_gaps_and_wraps_are_reported(tmp_path):
    messages = []
    for k in range(3000):
        time = 1_000_000_000 + (k + (500 if k >= 1200 else 0)) * 1_000_000
        angle = (0.004 * k + np.pi) % (2.0 * np.pi) - np.pi
        messages.append(('/joint_states', time, joint_state(time, ['elbow'], [angle], [], [1.0])))
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    np.testing.assert_allclose(samples.position, 0.004 * np.arange(3000), atol=1e-9)
    assert '1 gaps in the joint states, the longest of 0.501 s after 1.199 s' in info.notes
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


@pytest.mark.slow
@settings(max_examples=8)
@given(st.floats(0.5, 30.0), st.integers(1, 3))
def test_a_stream_is_the_recording_in_stretches(long_recording, seconds, files):
    folder = long_recording[files]
    expected, = read_recording(folder, 'b')
    stretches = list(stream_recording_with_info(folder, 'b', seconds=seconds))
    assert not any(info.notes for _, info in stretches)
    parts = [samples for samples, _ in stretches if len(samples)]
    assert max(part.time[-1] - part.time[0] for part in parts) < 25.0
    for name in ('time', 'position', 'current', 'direction', 'reference_position'):
        np.testing.assert_allclose(
            np.concatenate([getattr(part, name) for part in parts]), getattr(expected, name),
            atol=2e-7, err_msg=name)


@pytest.fixture(scope='module')
def long_recording(tmp_path_factory):
    """Make the same 20 s in one, two and three files."""
    folders = {}
    for files in (1, 2, 3):
        folder = tmp_path_factory.mktemp('long') / 'r'
        folders[files] = folder
        messages = []
        for k in range(4000):
            time = 1_000_000_000 + k * 5_000_000
            values = [np.sin(0.01 * k), np.cos(0.01 * k)]
            messages.append((time, '/joint_states', joint_state(time, ['a', 'b'], values, [],
                                                                values)))
            if k % 2 == 0:
                messages.append((time, '/reference', joint_state(time, ['a', 'b'], values, [], [])))
            if k % 50 == 0:
                messages.append((time, '/direction', array(
                    'std_msgs/msg/Int8MultiArray', [0, k // 50 % 3 - 1])))
        with RecordingWriter(folder, split_duration=20.0 / files + 0.01) as recording:
            for time, topic, (kind, message) in messages:
                recording.write(topic, kind, time, bytes(STORE.serialize_cdr(message, kind)))
    return folders


def test_compressed_by_message_inside_a_damaged_file(tmp_path):
    folder = record(tmp_path / 'r', states(), compression=CompressionMode.MESSAGE)
    shutil.copy(folder / 'r.mcap', tmp_path / 'alone.mcap')
    content = (tmp_path / 'alone.mcap').read_bytes()
    (tmp_path / 'alone.mcap').write_bytes(content[:-200])
    assert len(read_recording(tmp_path / 'alone.mcap')[0]) == 50


def test_positions_that_jump_away_and_back_are_left_out(tmp_path):
    time = 0.005 * np.arange(4000)
    position = 0.6 * np.sin(2.0 * time) + 1e-5 * np.random.default_rng(1).normal(size=len(time))
    odd = np.array([50, 700, 1500, 2333, 3001, 3900])
    glitched = position.copy()
    glitched[odd] += [0.3, -0.2, 0.1, 3.0, -1.0, 0.05]
    table = tmp_path / 'log.csv'

    def read(values):
        np.savetxt(table, np.column_stack((time, values, np.sign(np.cos(2.0 * time)))),
                   delimiter=',', header='time,position,torque', comments='')
        (samples, info), = read_recording_with_info(table)
        return samples, [note for note in info.notes if 'jumps away' in note]
    samples, notes = read(glitched)
    np.testing.assert_allclose(samples.position, np.delete(position, odd), atol=1e-9)
    assert notes == ['6 joint states left out: position jumps away and back within one sample']
    # Neither steps of a coarse encoder nor a jump that stays are glitches.
    for values in (np.round(position * 100.0) / 100.0, position + 0.3 * (time > 10.0), position):
        samples, notes = read(values)
        assert len(samples) == len(time)
        assert not notes
