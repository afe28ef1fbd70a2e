# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""HDF5 files are tables, and what lies between two episodes of a table is no motion."""


import numpy as np
import pytest
from scipy.io import savemat
from table_maker import swing, write

from friction_comp import Layout, read_recording

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
    refuses('no recording in this folder; tables must be named', 'refine', tmp_path)


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


def episodes_csv(path, time, name):
    """Write three episodes, between which the joint jumps by 1 rad."""
    _, position, velocity = swing(500, 0.02)
    return write(path, t=time, q=np.concatenate([position + k for k in range(3)]),
                 tau=np.tile(np.sign(velocity), 3), **{name: np.repeat(np.arange(3.0), 500)})
