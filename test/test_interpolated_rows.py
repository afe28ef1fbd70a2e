# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Logs whose values were interpolated to more rows than were measured."""

import numpy as np
import pytest
from recording_maker import DATA, needs_data
from table_maker import write

from friction_comp import read_recording, Samples
from friction_comp.recordings import read_recording_with_info
from friction_comp.recordings.row_times import measured_rows
from friction_comp.refinement import refine

COUNT = 2.0 * np.pi / 4096.0


def motion(time):
    return 0.5 * np.sin(1.3 * time) + 0.3 * np.sin(3.1 * time + 1.0) + 0.1 * np.sin(7.7 * time)


def log(rate, count=0.0, jitter=0.0, seed=0):
    """Return time, position and effort of 30 s, as they were measured."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 30.0, 1.0 / rate)
    time = np.sort(time + jitter / rate * rng.uniform(-1.0, 1.0, len(time)))
    position = np.round(motion(time) / count) * count if count else motion(time)
    velocity = (motion(time + 1e-5) - motion(time - 1e-5)) / 2e-5
    return time, position, (np.tanh(20.0 * velocity) + 0.5 * velocity
                            + 0.1 * rng.normal(size=len(time)))


def interpolated(time, *signals, rate):
    """Return evenly spaced rows of signals, in straight lines between what was measured."""
    rows = np.arange(time[0], time[-1], 1.0 / rate)
    return rows, *(np.interp(rows, time, values) for values in signals)


@pytest.mark.parametrize('digits', [None, 6])
@pytest.mark.parametrize(('count', 'jitter'), [(0.0, 0.0), (COUNT, 0.0), (COUNT, 0.2)])
@pytest.mark.parametrize(('measured', 'rate'), [(20.0, 250.0), (33.3, 500.0), (100.0, 1000.0)])
def test_the_rows_near_measured_values_are_used(measured, rate, count, jitter, digits):
    time, *signals = interpolated(*log(measured, count, jitter), rate=rate)
    if digits:
        time, *signals = (np.round(values, digits) for values in (time, *signals))
    notes = []
    rows = measured_rows(time, *signals, notes)
    assert (len(rows) - 1) / 30.0 == pytest.approx(measured, rel=0.05)
    assert notes[0].startswith('position was interpolated, in straight lines over')
    assert np.all(np.diff(rows) >= 1)


def test_what_was_measured_comes_back(tmp_path):
    time, position, effort = log(50.0, COUNT)
    path = write(tmp_path / 'log.csv', **dict(zip(
        ('time', 'q', 'tau'), interpolated(time, position, effort, rate=500.0))))
    (samples, info), = read_recording_with_info(path)
    assert any('50 Hz' in note and 'interpolated' in note for note in info.notes)
    # The last row ends a line, but may be before the value.
    near = np.searchsorted(time, samples.time - 1e-6)[:-1]
    np.testing.assert_allclose(samples.current[:-1], effort[near], atol=1e-9)
    np.testing.assert_allclose(samples.position[:-1], position[near], atol=1e-9)


def test_an_effort_alone_may_be_interpolated():
    time, position, _ = log(1000.0)
    slow, _, effort = log(50.0)
    notes = []
    rows = measured_rows(time, position, np.interp(time, slow, effort), notes)
    assert len(rows) == pytest.approx(1500, abs=50)
    assert notes[0].startswith('effort was interpolated')


@pytest.mark.parametrize('count', [0.0, 1e-5, 2.0 * np.pi / 2 ** 14, COUNT, 2.0 * np.pi / 1000.0])
@pytest.mark.parametrize('rate', [100.0, 1000.0])
@pytest.mark.parametrize('noise', [0.0, 1e-5, 1e-3])
def test_smooth_motion_and_steps_of_an_encoder_are_no_lines(rate, count, noise):
    time, step = np.arange(0.0, 30.0, 1.0 / rate), 1.0 / rate
    rng = np.random.default_rng(1)
    moves = {
        'sines': motion(time), 'one sine': 0.4 * np.sin(2.0 * time),
        'trapezoids': step * np.cumsum(np.clip(3.0 * np.sin(0.5 * time), -1.0, 1.0)),
        'triangles': np.arcsin(np.sin(0.9 * time)), 'rest': 0.0 * time,
        'constant speeds': step * np.cumsum(np.round(2.0 * np.sin(0.7 * time))),
        'parabolas': step ** 2 * np.cumsum(np.cumsum(np.sign(np.sin(2.0 * time))))}
    for name, position in moves.items():
        position = position + noise * rng.normal(size=len(time))
        position = np.round(position / count) * count if count else position
        effort = np.sign(np.gradient(position)) + 0.3 * np.gradient(motion(time), time)
        notes = []
        measured_rows(time, position, effort, notes)
        assert not any('interpolated' in note for note in notes), name


@needs_data
@pytest.mark.parametrize('name', [
    'ak80_load', 'ak80_no_load', 'bam_xl330', 'bldc_under_speed_control', 'emps',
    'kinova_gen3_joint7', 'kuka_kr300_axis1', 'ur10e_joint1', 'ur10e_joint2'])
def test_no_measured_recording_is_called_interpolated(name):
    for part in ('fit', 'score'):
        (_, info), = read_recording_with_info(DATA / name / part)
        assert not any('interpolated' in note for note in info.notes)


@needs_data
def test_a_measured_recording_that_was_interpolated_is_as_certain_as_before(tmp_path):
    samples, = read_recording(DATA / 'ur10e_joint1' / 'fit')
    time, position, current = interpolated(
        samples.time, samples.position, samples.current, rate=1000.0)
    path = write(tmp_path / 'log.csv', time=time, q=position, i=current)
    plain, seen = (refine(one).report for one in (
        [Samples(time=samples.time, position=samples.position, current=samples.current)],
        read_recording(path)))
    assert seen.after.elsewhere_rmse == pytest.approx(plain.after.elsewhere_rmse, rel=0.05)
    assert [effect.name for effect in seen.effects] == [effect.name for effect in plain.effects]
