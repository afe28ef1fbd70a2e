# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings are read completely, whatever their storage, joints and clocks."""

import shutil

import numpy as np
import pytest
from recording_maker import (
    array,
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
)
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from rosbags.typesys import get_types_from_msg

from friction_comp.errors import InputError
from friction_comp.files import file_names
from friction_comp.recordings import (
    find_recordings,
    read_recording,
    read_recording_with_info,
    recorded_joints,
    write_samples,
)
from friction_comp.recordings.reader import without_topic
from friction_comp.tools.common import folder_names


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
    assert info.topics['/joint_states'] == (KIND, 200)
    np.testing.assert_array_equal(info.rows, np.arange(200))
    np.testing.assert_array_equal(info.stamps, samples.time)
    assert info.notes == []
    assert recorded_joints(tmp_path / 'trial') == ['elbow']


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
    samples, = read_recording(record(tmp_path / 'r', states(), plugin, compression))
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
    samples, = read_recording(record(tmp_path / 'r', messages), 'elbow')
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
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    inner = slice(300, 1700)
    np.testing.assert_allclose(
        (samples.load - samples.position)[inner], 1e3 * delay, atol=1e-6)
    notes = [note for note in info.notes if 'its stamps are' in note]
    assert len(notes) == bool(text)
    assert all(f'{abs(ahead):.2g} s' in note and text in note for note in notes)


def test_arrays_follow_the_joints_of_the_reference_where_they_are_fewer(tmp_path):
    messages = list(states(names=('shoulder', 'elbow')))
    for k in range(50):
        receive = 5_000_000_000 + k * 1_000_000
        messages.append(('/reference', receive, joint_state(
            1_000_000_000 + k * 1_000_000, ['elbow'], [0.5 * k], [1.0], [])))
        messages.append(('/direction', receive, array(INT8_ARRAY, [1])))
    samples, = read_recording(record(tmp_path / 'r', messages), 'elbow')
    np.testing.assert_array_equal(samples.direction, np.ones(50))
    np.testing.assert_array_equal(samples.reference_position, 0.5 * np.arange(50.0))
    (other, info), = read_recording_with_info(tmp_path / 'r', 'shoulder')
    assert other.direction is None
    assert any('fits no list of joints' in note for note in info.notes)


@pytest.mark.parametrize(('reported', 'values'), [
    ('elbow', [1]), ('elbow, shoulder', [1, -1]), ('shoulder, elbow', [-1, 1])])
def test_arrays_follow_the_joints_that_the_compensator_reports(tmp_path, reported, values):
    kind = 'diagnostic_msgs/msg/DiagnosticArray'
    status = T['diagnostic_msgs/msg/DiagnosticStatus'](
        0, 'compensator: law', 'active', reported, [])
    messages = [*states(names=('shoulder', 'elbow')),
                ('/diagnostics', 1, (kind, T[kind](header(1), [status])))]
    for k in range(50):
        receive = 5_000_000_000 + k * 1_000_000
        messages += [('/direction', receive, array(INT8_ARRAY, values)),
                     ('/current_command', receive, array(FLOAT_ARRAY, np.multiply(values, 0.2)))]
    samples, = read_recording(record(tmp_path / 'r', messages), 'elbow')
    np.testing.assert_array_equal(samples.direction, np.ones(50))
    np.testing.assert_allclose(samples.command, 0.2)


def test_joint_names_may_change_their_order(tmp_path):
    messages = []
    for k in range(40):
        names = ('a', 'b') if k % 3 else ('b', 'a')
        values = [float(k) if name == 'a' else -float(k) for name in names]
        stamp = 1_000_000_000 + k * 1_000_000
        messages.append(('/joint_states', stamp, joint_state(stamp, names, values, [], values)))
    samples, = read_recording(record(tmp_path / 'r', messages), 'a')
    np.testing.assert_array_equal(samples.position, np.arange(40.0))
    assert samples.velocity is None


def test_empty_stamps_are_replaced_by_receive_times(tmp_path):
    record(tmp_path / 'none', states(stamp=lambda k: 0))
    (samples, info), = read_recording_with_info(tmp_path / 'none')
    np.testing.assert_allclose(np.diff(samples.time), 1e-3, atol=1e-9)
    assert info.start == pytest.approx(5.0)
    # A clock that starts at zero does not cause a gap of years.
    record(tmp_path / 'clock', states(stamp=lambda k: k * 1_000_000))
    (samples, info), = read_recording_with_info(tmp_path / 'clock')
    assert info.start == 0.0
    assert info.notes == []
    np.testing.assert_allclose(np.diff(samples.time), 1e-3, atol=1e-9)


def test_bad_samples_are_left_out_and_counted(tmp_path):
    messages = list(states())
    for k, value in ((3, np.nan), (9, np.inf)):
        messages[k][2][1].position[0] = value
    messages[12][2][1].effort[0] = -np.inf
    # One message occurs twice, and two are interchanged.
    messages.insert(21, messages[20])
    messages[30], messages[31] = (
        (messages[30][0], messages[30][1], messages[31][2]),
        (messages[31][0], messages[31][1], messages[30][2]))
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    expected = np.delete(np.arange(50.0), [3, 9, 12, 29])
    np.testing.assert_array_equal(samples.position, expected)
    np.testing.assert_allclose(samples.time, 1e-3 * expected, atol=1e-12)
    assert '3 joint states left out: not finite' in info.notes
    assert any('2 joint states left out: stamp' in note for note in info.notes)
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


def test_after_a_sensor_has_fallen_silent_its_value_is_not_known(tmp_path):
    messages = list(states(200))
    messages += [('/interaction_wrench', 5_000_000_000 + k, wrench(
        1_000_000_000 + k * 1_000_000, 'elbow', 0.1 * k)) for k in range(141)]
    (samples, info), = read_recording_with_info(record(tmp_path / 'r', messages))
    # Until a gap after it, the last one holds.
    assert samples.load[160] == pytest.approx(14.0)
    assert np.isfinite(samples.load[:161]).all()
    assert np.isnan(samples.load[161:]).all()
    assert any('load is not known at 39 of them' in note for note in info.notes)


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
    samples, = read_recording(record(tmp_path / 'r', messages))
    # The topic without stamps is dated by its receive times.
    expected = np.zeros(60, dtype=int)
    expected[5:20], expected[20:40], expected[40:45] = 1, -1, 1
    np.testing.assert_array_equal(samples.direction, expected)


def test_joint_states_of_another_name_are_named_with_their_joint(tmp_path):
    path = record(tmp_path / 'r', [
        ('/leader/state', k + 1, joint_state(10 ** 7 * (k + 1), ['elbow'], [0.001 * k], [], [1.0]))
        for k in range(100)])
    samples, = read_recording(path, '/leader/state/elbow')
    np.testing.assert_allclose(samples.position, 0.001 * np.arange(100))
    with pytest.raises(InputError, match=r'of that type are /leader/state: name one, with its joi'):
        read_recording(path)


def test_messages_of_other_joints_are_not_left_out_as_not_finite(tmp_path):
    messages = []
    for k in range(200):
        for name, late in (('shoulder', 0), ('elbow', 10 ** 5)):
            time = 10 ** 7 * (k + 1) + late
            effort = np.nan if k == 7 and name == 'elbow' else 1.0
            messages.append(('/joint_states', time, joint_state(
                time, [name], [0.001 * k], [], [effort])))
    (samples, info), = read_recording_with_info(record(tmp_path / 'log', messages), 'elbow')
    assert len(samples) == 199
    assert [note for note in info.notes if 'left out' in note] == [
        '1 joint states left out: not finite']


def test_one_joint_in_two_topics_is_named_with_its_topic(tmp_path):
    messages = [(f'/{name}/joint_states', stamp, joint_state(
        stamp, ['elbow', 'wrist'], [np.sin(0.04 * k) + place, 0.0], [], [1.0, 0.0]))
        for k, stamp in enumerate(range(10**9, 7 * 10**9, 20_000_000))
        for place, name in enumerate(('leader', 'follower'))]
    path = record(tmp_path / 'r', messages)
    with pytest.raises(InputError, match="no joint 'elbow' in it, but '/leader/joint_states/elb"):
        read_recording(path, 'elbow')
    for place, name in enumerate(('leader', 'follower')):
        samples, = read_recording(path, f'/{name}/joint_states/elbow')
        np.testing.assert_allclose(samples.position, np.sin(0.04 * np.arange(300)) + place)
        assert samples.joint == 'elbow'
        assert samples.arm.joints == ('elbow', 'wrist')
    with pytest.raises(InputError, match="no joint '/other/joint_states/elbow' in it"):
        read_recording(path, '/other/joint_states/elbow')


@pytest.mark.parametrize(('topics', 'joints', 'given', 'place', 'name'), [
    # A namespace in the name, with and without the topic.
    (['/joint_states'], ['/left/elbow', '/left/wrist'], '/left/elbow', 0, '/left/elbow'),
    (['/joint_states'], ['/left/elbow', 'wrist'], '/joint_states//left/elbow', 0, '/left/elbow'),
    (['/a/joint_states', '/b/joint_states'], ['left/elbow', 'wrist'],
     '/b/joint_states/left/elbow', 1, 'left/elbow'),
    # Of two topics the longest, but first of all a joint that is called so.
    (['/a', '/a/joint_states'], ['joint_states/elbow', 'elbow'], '/a/joint_states/elbow', 1,
     'elbow'),
    (['/joint_states', '/left'], ['/left/elbow', 'elbow'], '/left/elbow', 0, '/left/elbow')])
def test_joint_and_topic_may_both_hold_slashes(tmp_path, topics, joints, given, place, name):
    messages = [(topic, stamp, joint_state(
        stamp, joints, [np.sin(0.04 * k) + 0.5 * j + 2.0 * i for j in range(len(joints))], [],
        [1.0, 0.0])) for k, stamp in enumerate(range(10**9, 7 * 10**9, 20_000_000))
        for i, topic in enumerate(topics)]
    path = record(tmp_path / 'r', messages)
    (samples, info), = read_recording_with_info(path, given)
    assert samples.joint == info.joint == name
    np.testing.assert_allclose(
        samples.position, np.sin(0.04 * np.arange(300)) + 0.5 * joints.index(name) + 2.0 * place)
    assert samples.arm.joints == tuple(joints)
    assert without_topic(path, given) == name


def test_the_file_of_a_joint_is_in_the_folder_where_it_is_written():
    names = ['elbow', 'r1_elbow', 'linkes Knie', '/left/elbow', 'right/elbow', 'right_elbow']
    assert file_names(names) == [
        'elbow', 'r1_elbow', 'linkes Knie', 'left_elbow', 'right_elbow', 'right_elbow_']
    assert not any('/' in name for name in folder_names(['/etc/x', '../x', '/../x', '/']))


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
