# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables whose rows are those of several joints, one after the other."""

import re

import numpy as np
import pytest
from table_maker import swing

from friction_comp import InputError, Layout, read_recording
from friction_comp.__main__ import main
from friction_comp.recordings import recorded_joints

TIME, POSITION, VELOCITY = swing()
EFFORT = 2.0 * np.sign(VELOCITY)


def bus(path, column, one, other, separator=',', late=0.0, apart=False):
    """Write the rows of a joint that hardly moves and of one that swings; return the path."""
    still = [(time, one, 0.3 + 1e-4 * time, 0.5) for time in TIME]
    own = [(time + late, other, *row) for time, *row in zip(TIME, POSITION, EFFORT)]
    rows = [*still, *own] if apart else [row for pair in zip(still, own) for row in pair]
    text = '\n'.join(separator.join(map(str, row)) for row in [
        ('time', column, 'position', 'torque'), *rows])
    path.write_text(text.replace('.', ',') if separator == ';' else text)
    return path


@pytest.mark.parametrize('column, one, other, others', [
    ('joint', 'shoulder', 'elbow', {}), ('Joint_Name', 'shoulder', 'elbow', {'apart': True}),
    ('name', 'shoulder', 'elbow', {'separator': ';'}), ('motor_id', 1, 2, {'late': 2e-4}),
    ('can_id', '0x141', '0x142', {'late': 2e-4}), ('id', 1, 2, {'apart': True})])
def test_rows_of_several_joints_are_told_apart(tmp_path, column, one, other, others):
    path = bus(tmp_path / 'log.csv', column, one, other, **others)
    assert recorded_joints(path) == [str(one), str(other)] or others.get('apart')
    samples, = read_recording(path, str(other))
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-9)
    np.testing.assert_allclose(samples.current, EFFORT, atol=1e-9)
    np.testing.assert_allclose(samples.arm.position[:, 0], 0.3, atol=1e-3)
    with pytest.raises(InputError, match=f"several joints, name one with --joint: '{one}', "):
        read_recording(path)


@pytest.mark.parametrize('column, late', [('leg', 1e-4), ('corner', 0.0)])
def test_a_limb_or_any_text_that_tells_rows_of_one_time_apart_is_whose_row_it_is(
        tmp_path, column, late):
    path = bus(tmp_path / 'log.csv', column, 'FL', 'RR', late=late)
    samples, = read_recording(path, 'RR')
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-9)


@pytest.mark.parametrize('column, values', [
    ('phase', np.where(TIME > 0.5, 'march', 'walk')), ('phase', np.full(len(TIME), 'walk'))])
def test_a_text_of_several_rows_of_one_time_is_no_joint(tmp_path, column, values):
    path = tmp_path / 'log.npz'
    np.savez(path, **{'time': np.round(TIME, 2), column: values, 'position': POSITION,
                      'torque': EFFORT})
    assert recorded_joints(path) == ['']


@pytest.mark.parametrize('column, values', [
    ('motor', TIME > 0.5), ('id', np.arange(len(TIME))), ('id', TIME > 0.5),
    ('name', np.where(TIME > 0.5, 'first', 'second'))])
def test_a_state_a_row_number_and_a_trial_are_no_joints(tmp_path, column, values):
    values = values if values.dtype.kind == 'U' else values.astype(int)
    path = tmp_path / 'log.npz'
    np.savez(path, **{'time': TIME, column: values, 'position': POSITION, 'torque': EFFORT})
    samples, = read_recording(path)
    np.testing.assert_allclose(samples.position, POSITION)
    assert samples.joint == ''


def test_units_hold_for_the_rows_of_all_joints(tmp_path):
    path = bus(tmp_path / 'log.csv', 'joint', 'shoulder', 'elbow')
    samples, = read_recording(path, 'elbow', layout=Layout({}, {'position': 'deg'}))
    np.testing.assert_allclose(samples.position, np.radians(POSITION), atol=1e-9)


def test_steady_states_of_several_joints_are_told_apart(tmp_path, capsys):
    path, rows = tmp_path / 'means.csv', ['joint,velocity,torque']
    for speed in (-1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.6, 1.0):
        rows += [f'shoulder,{speed},{5.0 * np.sign(speed) + speed}',
                 f'elbow,{speed},{0.5 * np.sign(speed) + 0.2 * speed}']
    path.write_text('\n'.join(rows))
    arguments = ['refine', str(path), '--output', str(tmp_path / 'out')]
    assert main(arguments) == 2
    assert "name one with --joint: 'shoulder', 'elbow'" in capsys.readouterr().err
    assert main([*arguments, '--joint', 'elbow']) == 0
    assert 'joint: elbow' in (tmp_path / 'out' / 'model.yaml').read_text()
    assert re.search(r'Coulomb +0\.5000 N·m', capsys.readouterr().out)
