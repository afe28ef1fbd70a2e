# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings are read completely, whatever their storage, joints and clocks; damaged ones as far.

Of a damaged, unfinished or odd one, what can be read is read and said, or it is refused in a line.
"""

from contextlib import suppress
import errno
import os
import shutil
import time

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from recording_maker import (
    array,
    BATCH,
    FLOAT_ARRAY,
    header,
    INT8_ARRAY,
    joint_state,
    KIND,
    make_samples,
    record,
    states,
    STORE,
    T,
    wrench,
    write_states,
)
from rosbags.rosbag2 import CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg
import yaml

from friction_comp.errors import InputError
from friction_comp.files import file_names
from friction_comp.messages import TORQUE_UNIT
from friction_comp.recordings.reader import (
    find_recordings,
    read_arm,
    read_joints,
    read_recording,
    read_recording_with_info,
    recorded_joints,
    without_topic,
)
from friction_comp.recordings.scan import Scan
from friction_comp.recordings.writer import RecordingWriter, write_samples

BATCHES = 30
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
STATE = joint_state(1, ['elbow'], [1.0], [], [1.0])


def read(tmp_path, messages, joint=None):
    """Return samples of, and information on, a recording of messages."""
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages), joint)
    return samples, info


def test_what_was_written_is_read_back(tmp_path):
    samples = make_samples()
    write_samples(tmp_path / 'trial', samples, 0.119, 100.0)
    (read, info), = read_recording_with_info(tmp_path / 'trial', 'elbow', 11.9)
    for name in ('position', 'velocity', 'load', 'temperature', 'command', 'direction',
                 'reference_position', 'reference_velocity'):
        np.testing.assert_array_equal(getattr(read, name), getattr(samples, name), name)
    np.testing.assert_allclose(read.current, samples.current, rtol=1e-14)
    np.testing.assert_allclose(read.time, samples.time, atol=1e-12)
    assert read.joint == info.joint == 'elbow'
    assert recorded_joints(tmp_path / 'trial') == ['elbow']
    assert (info.notes, info.start) == ([], pytest.approx(1.0))
    assert Scan(tmp_path / 'trial').counts['/joint_states'] == 200
    np.testing.assert_array_equal(info.rows, np.arange(200))
    np.testing.assert_array_equal(info.stamps, read.time)


@pytest.mark.parametrize(('node', 'value', 'expected'), [
    ('left/compensator', "['a.yaml', 'b.yaml']", 'a.yaml, b.yaml'),
    ('compensator', 'a.yaml', 'a.yaml'), ('compensator', '[]', None), ('plant', 'a.yaml', None)])
def test_the_active_model_is_found_in_diagnostics(tmp_path, node, value, expected):
    status = T['diagnostic_msgs/msg/DiagnosticStatus'](
        0, node, 'active', 'elbow', [T['diagnostic_msgs/msg/KeyValue']('law', 'paper'),
                                     T['diagnostic_msgs/msg/KeyValue']('model_files', value)])
    _, info = read(tmp_path, [*states(), ('/diagnostics', 1, (
        DIAGNOSTICS, T[DIAGNOSTICS](header(1), [status])))])
    assert info.model == expected


@pytest.mark.parametrize(('plugin', 'compression', 'alone'), [
    *((plugin, compression, '') for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3)
      for compression in (None, CompressionMode.FILE, CompressionMode.MESSAGE)),
    (StoragePlugin.MCAP, CompressionMode.STORAGE, ''),
    # A file alone, and one that is not finished.
    (StoragePlugin.SQLITE3, CompressionMode.FILE, 'alone.db3.zstd'),
    (StoragePlugin.MCAP, CompressionMode.MESSAGE, 'alone.mcap')])
def test_every_storage_and_compression_is_read(tmp_path, plugin, compression, alone):
    path = record(tmp_path / 'r', states(), plugin, compression)
    if alone:
        content = next(one for one in path.iterdir() if one.suffix != '.yaml').read_bytes()
        path = tmp_path / alone
        path.write_bytes(content if compression == CompressionMode.FILE else content[:-200])
    samples, = read_recording(path)
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
        messages.append(('/current_command', receive, array(FLOAT_ARRAY, [1.0, 2.0 + k, 3.0])))
        messages.append(('/direction', receive, array(INT8_ARRAY, [0, -1, 7])))
        for j, name in enumerate(names):
            messages.append(('/interaction_wrench', receive,
                             wrench(1_000_000_000 + k * 1_000_000, name, 10.0 * j + k)))
    samples, _ = read(tmp_path, messages, 'elbow')
    np.testing.assert_array_equal(samples.position, 100.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.load, 10.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.command, 2.0 + np.arange(50.0))
    np.testing.assert_array_equal(samples.direction, np.full(50, -1))
    # An invalid direction counts as 0.
    np.testing.assert_array_equal(
        read_recording(tmp_path / 'r', 'wrist')[0].direction, np.zeros(50))
    with pytest.raises(InputError, match=r"'shoulder', 'elbow', 'wrist'"):
        read_recording(tmp_path / 'r')
    with pytest.raises(InputError, match=r"no joint 'hip'.*'elbow'"):
        read_recording(tmp_path / 'r', 'hip')


@pytest.mark.parametrize(('ahead', 'text', 'delay'), [
    (7.0, 'another clock', 0.0), (-7.0, 'another clock', 0.0), (-0.2, None, 0.2),
    (0.01, None, -0.01)])
def test_a_topic_stamped_by_another_clock(tmp_path, ahead, text, delay):
    """A sensor's computer whose clock is wrong must not shift the load against the motion."""
    messages = list(states(2000))
    for k in range(2000):
        stamp = 1_000_000_000 + k * 1_000_000
        messages.append(('/interaction_wrench', stamp + 4_000_000_000, wrench(
            stamp + round(1e9 * ahead), 'elbow', float(k))))
    samples, info = read(tmp_path, messages)
    inner = slice(300, 1700)
    np.testing.assert_allclose(
        (samples.load - samples.position)[inner], 1e3 * delay, atol=1e-6)
    notes = [note for note in info.notes if 'its stamps are' in note]
    assert len(notes) == bool(text)
    assert all(f'{abs(ahead):.2g} s' in note and text in note for note in notes)


@pytest.mark.parametrize(('reported', 'values'), [
    ('elbow', [1]), ('elbow, shoulder', [1, -1]), ('shoulder, elbow', [-1, 1]), ('', [1])])
def test_arrays_follow_the_joints_that_are_reported_or_else_of_the_reference(
        tmp_path, reported, values):
    status = T['diagnostic_msgs/msg/DiagnosticStatus'](
        0, 'compensator: law', 'active', reported, [])
    messages = [*states(names=('shoulder', 'elbow')), ('/diagnostics', 1, (DIAGNOSTICS, T[
        DIAGNOSTICS](header(1), [status] * bool(reported))))]
    for k in range(50):
        receive = 5_000_000_000 + k * 1_000_000
        messages += [('/direction', receive, array(INT8_ARRAY, values)),
                     ('/current_command', receive, array(FLOAT_ARRAY, np.multiply(values, 0.2))),
                     ('/reference', receive, joint_state(
                         1_000_000_000 + k * 1_000_000, ['elbow'], [0.5 * k], [1.0], []))]
    samples, _ = read(tmp_path, messages, 'elbow')
    np.testing.assert_array_equal(samples.direction, np.ones(50))
    np.testing.assert_allclose(samples.command, 0.2)
    np.testing.assert_array_equal(samples.reference_position, 0.5 * np.arange(50.0))
    (other, info), = read_recording_with_info(tmp_path / 'r', 'shoulder')
    assert (other.direction is None) == (len(values) == 1)
    assert any('fits no list of joints' in note for note in info.notes) == (len(values) == 1)


def stamped(stamp):
    """Return states of a stamp in ms each."""
    return [*states(1000, stamp=lambda k: 1_000_000 * stamp(k))]


def spoiled():
    """Return states of which some are not finite, and others sent twice or interchanged."""
    messages = [*states()]
    for k, signal, value in ((3, 'position', np.nan), (9, 'position', np.inf),
                             (12, 'effort', -np.inf)):
        getattr(messages[k][2][1], signal)[0] = value
    for _, _, (_, message) in messages:
        message.velocity[0] = np.nan    # counts as empty
    messages.insert(21, messages[20])
    (topic, early, first), (_, late, second) = messages[30:32]
    messages[30:32] = (topic, early, second), (topic, late, first)
    return messages


@pytest.mark.parametrize(('messages', 'kept', 'said'), [
    # Without stamps; by a clock that starts at zero.
    (stamped(lambda k: 0), range(1000), 'stamps are zero: receive times are used'),
    (stamped(lambda k: k), range(1000), ''),
    (spoiled(), np.delete(np.arange(50), [3, 9, 12, 29]), '3 joint states left out: not finite'),
    (spoiled(), np.delete(np.arange(50), [3, 9, 12, 29]), '2 joint states left out: stamp'),
    # The clock is set back; single stamps are far off, or empty.
    (stamped(lambda k: 10**5 + k - (300 if k >= 600 else 0)), range(600),
     '400 joint states left out: stamp'),
    (stamped(lambda k: 10**5 + k + {70: 10**7, 200: -10**4}.get(k, 0)),
     np.delete(np.arange(1000), [70, 200]), '2 joint states left out: stamp far off'),
    (stamped(lambda k: 0 if k % 7 == 3 else 10**5 + k),
     np.flatnonzero(np.arange(1000) % 7 != 3), '143 joint states left out: stamp far off'),
    (stamped(lambda k: k + (500 if k >= 400 else 0)), range(1000),
     '1 gaps, the longest of 0.501 s after 0.399 s')])
def test_what_no_joint_or_clock_in_order_says_is_left_out_and_said(tmp_path, messages, kept, said):
    samples, info = read(tmp_path, messages)
    np.testing.assert_array_equal(samples.position, kept)
    assert any(said in note for note in info.notes) if said else not info.notes
    assert len(info.stamps) == len(messages)
    if 'gaps' not in said:
        np.testing.assert_allclose(samples.time, 1e-3 * (np.array(kept) - kept[0]), atol=1e-12)


def test_messages_of_other_joints_are_not_left_out_as_not_finite(tmp_path):
    messages = [('/joint_states', 10 ** 7 * k + late, joint_state(
        10 ** 7 * k + late, [name], [0.001 * k], [], [np.nan if (k, name) == (7, 'b') else 1.0]))
        for k in range(1, 201) for name, late in (('a', 0), ('b', 10 ** 5))]
    samples, info = read(tmp_path, messages, 'b')
    assert len(samples) == 199
    assert [note for note in info.notes if 'left out' in note] == [
        '1 joint states left out: not finite']


@pytest.mark.parametrize(('count', 'said'), [
    (20, 'of them, and not used'), (141, 'load is not known at 39 of them')])
def test_after_a_sensor_has_fallen_silent_its_value_is_not_known(tmp_path, count, said):
    samples, info = read(tmp_path, [*states(200), *(
        ('/interaction_wrench', 5_000_000_000 + k, wrench(
            1_000_000_000 + k * 1_000_000, 'elbow', 0.1 * k)) for k in range(count))])
    assert any(said in note for note in info.notes)
    assert (samples.load is None) == (count == 20)
    if count > 20:
        # Until a gap after it, the last one holds.
        assert samples.load[160] == pytest.approx(14.0)
        np.testing.assert_array_equal(np.isnan(samples.load), np.arange(200) > 160)


def test_the_later_of_two_directions_counts(tmp_path):
    messages = list(states(60))
    stamp = [m[2][1].header.stamp for m in messages]
    times = [s.sec * 10**9 + s.nanosec for s in stamp]
    for k, values in ((5, [1.0]), (40, [3.0]), (50, [0.0])):
        messages.append(('/direction_stamped', messages[k][1], joint_state(
            times[k], ['elbow'], [], values, [])))
    messages.append(('/direction', messages[20][1], array(INT8_ARRAY, [-1])))
    messages.append(('/direction', messages[45][1], array(INT8_ARRAY, [7])))
    messages.sort(key=lambda message: message[1])
    samples, _ = read(tmp_path, messages)
    # The topic without stamps is dated by its receive times.
    expected = np.zeros(60, dtype=int)
    expected[5:20], expected[20:40], expected[40:45] = 1, -1, 1
    np.testing.assert_array_equal(samples.direction, expected)


@pytest.mark.parametrize(('topics', 'joints', 'given', 'place', 'name'), [
    # One joint in two topics, or joint states of any name.
    (['/leader/joint_states', '/follower/joint_states'], ['elbow', 'wrist'],
     '/follower/joint_states/elbow', 1, 'elbow'),
    (['/leader/state'], ['elbow', 'wrist'], '/leader/state/elbow', 0, 'elbow'),
    # A namespace in the name, with and without the topic.
    (['/joint_states'], ['/left/elbow', '/left/wrist'], '/left/elbow', 0, '/left/elbow'),
    (['/joint_states'], ['/left/elbow', 'wrist'], '/joint_states//left/elbow', 0, '/left/elbow'),
    # Of two topics the longest, but first of all a joint that is called so.
    (['/a', '/a/joint_states'], ['joint_states/elbow', 'elbow'], '/a/joint_states/elbow', 1,
     'elbow'),
    (['/joint_states', '/left'], ['/left/elbow', 'elbow'], '/left/elbow', 0, '/left/elbow')])
def test_a_joint_may_be_named_with_its_topic(tmp_path, topics, joints, given, place, name):
    path = record(tmp_path / 'r', [(topic, stamp, joint_state(
        stamp, joints, [np.sin(0.04 * k) + 0.5 * j + 2.0 * i for j in range(len(joints))], [],
        [1.0, 0.0])) for k, stamp in enumerate(range(10**9, 7 * 10**9, 20_000_000))
        for i, topic in enumerate(topics)])
    (samples, info), = read_recording_with_info(path, given)
    assert samples.joint == info.joint == name
    np.testing.assert_allclose(
        samples.position, np.sin(0.04 * np.arange(300)) + 0.5 * joints.index(name) + 2.0 * place)
    assert samples.arm.joints == tuple(joints)
    assert without_topic(path, given) == name


def test_the_file_of_a_joint_is_in_the_folder_where_it_is_written():
    names = ['elbow', 'r1_elbow', 'linkes Knie', '/left/elbow', 'right/elbow', 'right_elbow']
    assert file_names(names) == [
        'elbow', 'r1_elbow', 'linkes_Knie', 'left_elbow', 'right_elbow', 'right_elbow_']
    assert file_names(['/etc/x', '../x', '/']) == ['etc_x', '_x', '_']


def test_dynamic_joint_states_give_the_current_that_joint_states_lack(tmp_path):
    value, kind = 'control_msgs/msg/InterfaceValue', 'control_msgs/msg/DynamicJointState'
    STORE.register({
        **get_types_from_msg('string[] interface_names\nfloat64[] values', value),
        **get_types_from_msg('std_msgs/Header header\nstring[] joint_names\n'
                             'InterfaceValue[] interface_values', kind)})
    messages, names = [], ['velocity', 'current', 'position', 'temperature']
    for k in range(50):
        stamp = 10 ** 9 + 10 ** 6 * k
        messages += [('/joint_states', stamp, joint_state(
            stamp, ['elbow'], [0.1 * k], [100.0], [np.nan])), (
            '/dynamic_joint_states', stamp, (kind, T[kind](header(stamp), ['gpio', 'elbow'], [
                T[value](['on'], np.ones(1)),
                T[value](names, np.array([100.0, 0.5, 0.1 * k, 31.0]))])))]
    (samples, info), = read_recording_with_info(record(tmp_path / 'bag', messages))
    assert (samples.joint, info.effort_is_current) == ('elbow', True)
    np.testing.assert_allclose(samples.current, 0.5)
    np.testing.assert_allclose(samples.position, 0.1 * np.arange(50))
    np.testing.assert_allclose(samples.temperature, 31.0)


@pytest.mark.parametrize(('name', 'content', 'words'), [
    ('missing', None, 'no such file'),
    ('empty.mcap', b'', 'empty'),
    ('text.mcap', b'these are words, not a recording at all', 'not a valid MCAP file'),
    ('table.csv', b'time,position\n', 'which column is the effort'),
    ('broken.db3', b'SQLite format 3\0' + b'x' * 200, 'not a readable recording'),
    ('text.mcap.zstd', b'not compressed at all', 'is damaged'),
    *(('metadata.yaml', text, 'not a readable recording') for text in (
        b'', b'rosbag2_bagfile_information: 3', b'[', b'rosbag2_bagfile_information: {}')),
])
def test_what_is_no_recording_is_refused_in_a_line(tmp_path, name, content, words):
    if content is not None:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    path = tmp_path if 'metadata' in name else tmp_path / name
    with pytest.raises(InputError, match=words) as error:
        read_recording(path)
    assert path.name in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize(('messages', 'said'), [
    ([('/direction', 1, array(INT8_ARRAY, [0]))], 'no joint_states.*topics: /direction'),
    ([('/leader/state', 1, STATE)], 'of that type are /leader/state: name one, with its joint'),
    ([('/a/joint_states', 1, STATE), ('/b/joint_states', 1, STATE)],
     "no joint 'elbow' in it, but '/a/joint_states/elbow'"),
    ([('/joint_states', 1, joint_state(1, ['elbow'], [1.0], [], []))], 'no finite effort'),
    ([], 'or no joint in them')])
def test_a_recording_without_what_is_needed_says_so(tmp_path, messages, said):
    record(tmp_path / 'r', messages)
    if not messages:
        shutil.rmtree(tmp_path / 'r')
        with Writer(tmp_path / 'r', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            writer.add_connection('/joint_states', KIND, typestore=STORE)
    with pytest.raises(InputError, match=said):
        read_recording(tmp_path / 'r', 'elbow')


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Make a file of many chunks; return its bytes."""
    folder = tmp_path_factory.mktemp('whole') / 'trial'
    with RecordingWriter(folder) as recording:
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
        with RecordingWriter(tmp_path / f'r{part}') as recording:
            write_states(recording, range(100 * part, 100 * (part + 1)))
        (tmp_path / f'r{part}' / f'r{part}_0.mcap').rename(tmp_path / 'r' / f'r_{part}.mcap')
        about = (tmp_path / f'r{part}' / 'metadata.yaml')
        about.rename(tmp_path / 'r' / 'metadata.yaml')
    about = tmp_path / 'r' / 'metadata.yaml'
    about.write_text(about.read_text().replace(
        '[r3_0.mcap]', '[r_0.mcap, r_1.mcap, r_2.mcap, r_3.mcap]', 1))
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    np.testing.assert_array_equal(samples.current, np.arange(400.0))
    assert info.notes == []
    (tmp_path / 'r' / 'r_1.mcap').unlink()
    (samples, info), = read_recording_with_info(tmp_path / 'r')
    assert '1 of its 4 files are missing: r_1.mcap' in info.notes
    for text in ('', '[', 'rosbag2_bagfile_information: 3'):
        about.write_text(text)
        (samples, info), = read_recording_with_info(tmp_path)
        assert (len(samples), 'metadata.yaml' in info.notes[0]) == (300, True)


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
