# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables with a velocity and an effort, but no position."""

import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.recordings import read_recording_with_info
from friction_comp.recordings.reader import stream_recording_with_info
from friction_comp.recordings.tables import TableScanner

TIME, POSITION, VELOCITY = swing(2000, 0.005)


def log_of(path, **others):
    """Write a table of time, velocity and effort; return its path."""
    return write(path, **{'time': TIME, 'velocity': VELOCITY, 'torque': np.sign(VELOCITY)} | others)


def test_without_a_position_it_is_the_integral_of_velocity(tmp_path):
    (samples, info), = read_recording_with_info(log_of(tmp_path / 'log.csv'))
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-5)
    np.testing.assert_allclose(samples.velocity, VELOCITY)
    note, = (note for note in info.notes if 'no column holds the position' in note)
    assert 'the integral of velocity, zero at the start, and drifts' in note
    assert 'is not to be believed' in note


@pytest.mark.parametrize(('names', 'layout', 'linear'), [
    (('t_ms', 'speed_rpm', 'measured_current_a'), {}, False),
    (('t_ms', 'velocity_mps', 'force_N'), {}, True),
    (('t_ms', 'v', 'x'), {'velocity': 'v', 'current': 'x'}, False)])
def test_the_unit_of_the_position_is_that_of_the_velocity(tmp_path, names, layout, linear):
    factor = 30.0 / np.pi if 'rpm' in names[1] else 1.0
    path = write(tmp_path / 'log.csv', **dict(zip(names, (
        1e3 * TIME, factor * VELOCITY, np.sign(VELOCITY)))))
    (samples, info), = read_recording_with_info(path, layout=Layout(layout))
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-5)
    assert info.linear == linear


def test_no_motion_is_added_over_gaps_and_missing_values_and_order_do_no_harm(tmp_path):
    kept = (TIME < 2.0) | (TIME > 5.0)
    columns = {'time': TIME[kept], 'velocity': VELOCITY[kept], 'torque': np.sign(VELOCITY[kept])}
    columns['velocity'][50] = np.nan
    mixed = np.random.default_rng(1).permutation(kept.sum())
    samples, = read_recording(write(tmp_path / 'log.csv', **{
        name: values[mixed] for name, values in columns.items()}))
    late = samples.time > 2.0
    np.testing.assert_allclose(samples.position[~late], POSITION[TIME < 2.0][
        np.arange(400) != 50], atol=1e-4)
    moved = np.interp(samples.time[late], TIME, POSITION) - POSITION[TIME > 5.0][0]
    np.testing.assert_allclose(samples.position[late], samples.position[~late][-1] + moved,
                               atol=1e-4)


def test_blocks_and_stretches_go_on_where_the_one_before_ended(tmp_path):
    path = log_of(tmp_path / 'log.csv')
    blocks = [track.values[''][:, 0] for scan in TableScanner(path, batch=300).scans()
              for track in scan.of('joint_states')]
    np.testing.assert_allclose(np.concatenate(blocks), POSITION, atol=1e-5)
    parts = [samples.position for samples, _ in stream_recording_with_info(path, seconds=3.0)]
    np.testing.assert_allclose(np.concatenate(parts), POSITION, atol=1e-5)


def test_joints_each_have_their_own(tmp_path):
    path = write(tmp_path / 'log.csv', time=TIME, dq_1=VELOCITY, dq_2=2.0 * VELOCITY,
                 tau_1=np.sign(VELOCITY), tau_2=VELOCITY)
    samples, = read_recording(path, '2')
    np.testing.assert_allclose(samples.position, 2.0 * POSITION, atol=1e-5)
    np.testing.assert_allclose(samples.arm.position[:, 0], POSITION, atol=1e-5)


@pytest.mark.parametrize(('other', 'layout'), [
    ('position_ticks', Layout()), ('target_position', Layout()), ('stroke_mm', Layout()),
    ('remark', Layout(stiffness=[20.0]))])
def test_where_a_column_may_be_the_position_it_is_asked_for(tmp_path, other, layout):
    with pytest.raises(InputError, match=r'position'):
        read_recording(log_of(tmp_path / 'log.csv', **{other: POSITION}), layout=layout)


def test_means_with_times_are_no_motion(tmp_path, refuses):
    path = write(tmp_path / 'log.csv', t_ms=1100.0 * np.arange(300), speed_rpm=VELOCITY[:300],
                 torque=VELOCITY[:300])
    refuses('means at constant speeds are read without their times', 'refine', path)
