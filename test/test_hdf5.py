# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""HDF5 files are tables, and what lies between two episodes of a table is no motion."""

import sys

import numpy as np
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabOpaque
from table_maker import swing, write

from friction_comp import Layout, read_recording
from friction_comp.recordings import read_recording_with_info

# Joints, of which each swings as many times as wide as the first.
WIDE = np.array([1.0, 2.0, 3.0])


def h5_file(path, **datasets):
    """Write datasets by name; return the path. Two underscores are a slash."""
    h5py = pytest.importorskip('h5py')
    with h5py.File(path, 'w') as file:
        for name, values in datasets.items():
            file[name.replace('__', '/')] = values
    return path


def joints(later=0.0, count=500):
    """Return position, velocity and effort of three joints, each of shape (T, 3)."""
    _, position, velocity = swing(count, 0.02)
    return (np.outer(position, WIDE) + later, np.outer(velocity, WIDE),
            np.tanh(20.0 * np.outer(velocity, WIDE)))


def test_an_episode_of_teleoperation_needs_the_rate_and_the_joint_only(tmp_path, refuses):
    position, velocity, effort = joints()
    path = h5_file(
        tmp_path / 'episode_0.hdf5', observations__qpos=position, observations__qvel=velocity,
        observations__effort=effort, action=position + 0.1, base_action=np.ones((500, 2)),
        observations__images__top=np.zeros((500, 90), np.uint8), compress_len=np.ones((1, 500)))
    samples, = read_recording(path, '2', layout=Layout(rate=50.0))
    np.testing.assert_allclose(samples.time, 0.02 * np.arange(500))
    np.testing.assert_allclose(samples.position, position[:, 1])
    np.testing.assert_allclose(samples.velocity, velocity[:, 1])
    np.testing.assert_allclose(samples.current, effort[:, 1])
    np.testing.assert_allclose(samples.reference_position, position[:, 1] + 0.1)
    assert samples.arm.joints == ('1', '2', '3')
    refuses('or the rows per second with --rate HZ', 'refine', path)
    refuses("several joints, name one with --joint: '1', '2', '3'", 'refine', path, '--rate', '50')
    refuses(f'must be named, for instance with {tmp_path}/*.hdf5', 'refine', tmp_path)


def test_an_action_is_a_target_beside_what_was_measured(tmp_path):
    position, velocity, effort = joints()
    path = h5_file(
        tmp_path / 'trajectory.h5', action__joint_position=position + 0.1,
        action__joint_velocity=velocity + 0.1,
        observation__robot_state__joint_positions=position,
        observation__robot_state__joint_velocities=velocity,
        observation__robot_state__motor_torques_measured=effort)
    samples, = read_recording(path, '3', layout=Layout(rate=50.0))
    np.testing.assert_allclose(samples.position, position[:, 2])
    np.testing.assert_allclose(samples.velocity, velocity[:, 2])
    np.testing.assert_allclose(samples.reference_position, position[:, 2] + 0.1)


def test_matlab_files_of_version_7_3_have_their_times_along_the_longer_side(tmp_path):
    time, position, velocity = swing()
    path = h5_file(
        tmp_path / 'log.mat', log__t=time[None], log__q=np.outer(WIDE, position),
        log__dq=np.outer(WIDE, velocity), log__tau=np.outer(WIDE, np.sign(velocity)),
        log__remark=np.array([[102], [111]], np.uint16), kp=np.array([[3.0]]))
    samples, = read_recording(path, '2')
    np.testing.assert_allclose(samples.time, time)
    np.testing.assert_allclose(samples.position, 2.0 * position)


def test_groups_called_as_episodes_are_one_table_with_pauses_in_their_order(tmp_path):
    parts = {f'data__demo_{k}__obs__': joints(k) for k in (0, 10, 2)}
    path = h5_file(tmp_path / 'demos.hdf5', **{
        prefix + name: values for prefix, part in parts.items()
        for name, values in zip(('joint_pos', 'joint_vel', 'joint_torque'), part)},
        mask__train=np.array([b'demo_0']), data__demo_0__rewards=np.zeros(500))
    (samples, info), = read_recording_with_info(path, '1', layout=Layout(rate=50.0))
    steps = np.diff(samples.time)
    assert np.flatnonzero(steps > 0.5).tolist() == [499, 999]
    assert samples.position[[0, 500, 1000]].tolist() == [0.0, 2.0, 10.0]
    assert any('2 gaps in the joint states' in note for note in info.notes)


def test_what_stands_beside_episodes_holds_for_all_or_is_left_out(tmp_path):
    position, velocity, effort = joints()
    path = h5_file(tmp_path / 'log.h5', fps=50, summary=np.zeros(3), **{
        f'episode_{k}__{name}': values[:, 0] for k in range(2)
        for name, values in (('q', position), ('dq', velocity), ('tau', effort))})
    samples, = read_recording(path, layout=Layout(rate=50.0))
    assert len(samples) == 1000
    path = h5_file(tmp_path / 'one.h5', t=swing(500, 0.02)[0], trajectory__q=position[:, 0],
                   trajectory__tau=effort[:, 0])
    samples, = read_recording(path)
    np.testing.assert_allclose(samples.position, position[:, 0])


def test_blocks_of_an_hdf5_file_are_its_whole(tmp_path):
    from friction_comp.recordings.table_files import open_table

    table = open_table(h5_file(tmp_path / 'x.h5', **{
        f'demo_{k}__q': np.arange(7.0) + 7.0 * k for k in range(5)}, demo_0__only=np.ones(7)))
    assert table.names == ['q', 'episode']
    for rows in (1, 3, 7, 9, 100):
        blocks, shares = zip(*table.blocks(table.names, rows))
        np.testing.assert_array_equal(np.concatenate([b['q'] for b in blocks]), np.arange(35.0))
        np.testing.assert_array_equal(
            np.concatenate([b['episode'] for b in blocks]), np.repeat(np.arange(5.0), 7))
        assert list(shares) == sorted(shares)
        assert shares[-1] == 1.0
    assert len(table.whole(['episode'])['episode']) == 35


@pytest.mark.parametrize(('datasets', 'said'), [
    ({'picture': np.zeros((9, 9, 9))}, 'holds no table of numbers'),
    ({'t': np.arange(5.0), 'q': np.arange(7.0), 'tau': np.arange(5.0)},
     'its arrays differ in length: t 5, q 7, tau 5; name those of one clock with --columns'),
    ({'t': np.arange(5.0), 'q': np.arange(5.0)}, 'which column is the effort or current?')])
def test_what_cannot_be_read_is_said(tmp_path, refuses, datasets, said):
    refuses(said, 'refine', h5_file(tmp_path / 'log.h5', **datasets))


@pytest.mark.parametrize('suffix', ['h5', 'mat'])
def test_signals_of_another_clock_than_the_named_ones_are_left_out(tmp_path, suffix):
    time, position, velocity = swing(300, 0.004)
    signals = {'hip__t': time, 'hip__q': position, 'hip__tau': velocity, 'knee__t': time[:250],
               'knee__q': position[:250], 'knee__tau': velocity[:250]}
    if suffix == 'h5':
        path = h5_file(tmp_path / 'log.h5', **signals)
    else:
        path = tmp_path / 'log.mat'
        savemat(path, {leg: {name: signals[f'{leg}__{name}'] for name in ('t', 'q', 'tau')}
                       for leg in ('hip', 'knee')})
    for leg, rows in (('hip', 300), ('knee', 250)):
        samples, = read_recording(path, layout=Layout(
            {signal: f'{leg}.{name}' for signal, name in (
                ('time', 't'), ('position', 'q'), ('effort', 'tau'))}))
        np.testing.assert_allclose(samples.current, velocity[:rows])


def test_objects_of_matlab_are_refused_with_what_to_do(tmp_path, refuses, monkeypatch):
    h5py = pytest.importorskip('h5py')
    said = 'an object of MATLAB, which only MATLAB reads: save it as a table, for instance'
    with h5py.File(tmp_path / 'log.mat', 'w', userblock_size=512) as file:
        data = file.create_dataset('data', data=np.arange(6, dtype='uint32')[None])
        data.attrs['MATLAB_object_decode'] = np.int32(3)
    refuses(said, 'refine', tmp_path / 'log.mat')
    savemat(tmp_path / 'old.mat', {'q': 1.0})
    monkeypatch.setattr('scipy.io.loadmat', lambda *_, **__: {'data': MatlabOpaque(np.zeros(
        (), dtype=[(name, object) for name in ('s0', 's1', 's2', 'arr')]))})
    refuses(said, 'refine', tmp_path / 'old.mat')


def test_a_broken_file_and_a_missing_library_are_no_traceback(tmp_path, refuses, monkeypatch):
    path = tmp_path / 'log.h5'
    path.write_text('none')
    monkeypatch.setitem(sys.modules, 'h5py', None)
    refuses('pip install "friction_comp[hdf5]"', 'refine', path)
    monkeypatch.undo()
    pytest.importorskip('h5py')
    refuses('not a readable recording', 'refine', path)


def episodes_csv(path, time, name):
    """Write three episodes, between which the joint jumps by 1 rad."""
    _, position, velocity = swing(500, 0.02)
    return write(path, t=time, q=np.concatenate([position + k for k in range(3)]),
                 tau=np.tile(np.sign(velocity), 3), **{name: np.repeat(np.arange(3.0), 500)})


@pytest.mark.parametrize('name', ['episode_index', 'trial', 'demo no'])
@pytest.mark.parametrize('time', [np.tile(swing(500, 0.02)[0], 3), swing(1500, 0.02)[0],
                                  np.tile(swing(500, 0.001)[0], 3)])
def test_a_jump_between_episodes_is_no_motion(tmp_path, name, time):
    path = episodes_csv(tmp_path / 'log.csv', time, name)
    for batch in ({}, {'batch': 130}):
        from friction_comp.recordings.sources import open_scanner

        stamp = np.concatenate([scan.of('joint_states')[0].stamp
                                for scan in open_scanner(path, **batch).scans()])
        steps = 1e-9 * np.diff(stamp)
        assert np.flatnonzero(steps > 0.5).tolist() == [499, 999]
        assert steps.min() > 0.0
    (samples, info), = read_recording_with_info(path)
    assert len(samples) == 1500
    assert f'column {name!r} says which episode each row is of' in info.notes


def test_a_column_that_changes_with_every_row_tells_no_episode(tmp_path):
    path = episodes_csv(tmp_path / 'log.csv', swing(1500, 0.02)[0], 'other')
    text = path.read_text().splitlines()
    path.write_text('\n'.join([text[0] + ',trajectory'] + [
        f'{line},{k % 7}' for k, line in enumerate(text[1:])]))
    samples, = read_recording(path)
    np.testing.assert_allclose(np.diff(samples.time), 0.02)


@pytest.mark.parametrize('step', [0.02, 0.001])
def test_a_clock_that_begins_anew_leaves_a_gap_at_any_rate(tmp_path, step):
    path = episodes_csv(tmp_path / 'log.csv', 5.0 + np.tile(swing(500, step)[0], 3), 'other')
    (_, info), = read_recording_with_info(path)
    assert any(note.startswith('2 gaps in the joint states') for note in info.notes)


def test_notes_on_many_recordings_are_said_once(tmp_path):
    from friction_comp.recorded_drive.refine_recordings import notes_on

    paths = [episodes_csv(tmp_path / f'log_{k}.csv', swing(1500, 0.02)[0], 'trial')
             for k in range(3)]
    notes = notes_on(read_recording_with_info(paths))
    assert len(notes) == len(set(notes)) == 3
    assert all(note.startswith(f'{paths[0]} and 2 more: ') for note in notes)
