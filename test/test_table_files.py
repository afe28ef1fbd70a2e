# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Kinds of files that hold a table: CSV, JSON, Parquet, MAT, NumPy and bags of ROS 1."""

import math

import numpy as np
import pytest
from scipy.io.matlab import MatlabOpaque
from table_maker import swing, write

from friction_comp import Layout, read_recording
from friction_comp.__main__ import main
from friction_comp.recordings import read_recording_with_info


def lines(path, names, rows):
    """Write rows of texts below names; return the path."""
    path.write_text('\n'.join(','.join(row) for row in (names, *rows)) + '\n')
    return path


def test_rows_that_hold_a_value_each_are_one_recording(tmp_path):
    # As topics come: a position every 2 ms, an effort every 5 ms, and a hole in the positions.
    t, e = 0.002 * np.arange(1500), 0.0013 + 0.005 * np.arange(600)
    rows = [(s, f'{math.sin(s):.12g}', '') for s in t if not 1.0 < s < 1.2]
    rows += [(s, '', f'{math.cos(s):.12g}') for s in e]
    path = lines(tmp_path / 'log.csv', ('time_s', 'elbow_pos', 'tau_meas'),
                 [(f'{s:.9f}', *cells) for s, *cells in sorted(rows)])
    (samples, info), = read_recording_with_info(path)
    assert any('those with tau_meas are used' in note for note in info.notes)
    kept = e[(e < 1.0) | (e > 1.2)]
    np.testing.assert_allclose(samples.time, kept - kept[0], atol=1e-6)
    np.testing.assert_allclose(samples.position, np.sin(kept), atol=1e-5)
    np.testing.assert_allclose(samples.current, np.cos(kept), atol=1e-9)


def test_rows_of_one_joint_each_stay_as_they_were_measured(tmp_path):
    time, position, velocity = swing(600, 0.005)
    rows = [(f'{t:.3f}', *['', ''] * (k % 2), repr(q), repr(v), *['', ''] * (1 - k % 2))
            for k, (t, q, v) in enumerate(zip(time, position.tolist(), velocity.tolist()))]
    path = lines(tmp_path / 'log.csv', ('t', 'q_1', 'tau_1', 'q_2', 'tau_2'), rows)
    for joint in (1, 2):
        samples, = read_recording(path, str(joint))
        np.testing.assert_allclose(samples.current, velocity[joint - 1::2])


@pytest.mark.parametrize(('name', 'head', 'mark'), [
    ('savetxt.txt', '# time pos vel tau\n', '\t'),
    ('units.csv', 'Time,Angle,Velocity,Torque\ns,deg,deg/s,N·m\n', ','),
    ('brackets.csv', 'time;q;dq;tau\n[s];[deg];[deg/s];[Nm]\n', ';')])
def test_names_in_a_comment_and_units_below_the_names_are_read(tmp_path, name, head, mark):
    time = 0.01 * np.arange(400)
    angle = np.sin(time)
    scale = 1.0 if 'savetxt' in name else 180.0 / math.pi
    rows = np.column_stack([time, scale * angle, scale * np.cos(time), 2.0 * np.cos(time)])
    (tmp_path / name).write_text(head + '\n'.join(
        mark.join(f'{value:.9g}' for value in row) for row in rows) + '\n')
    samples, = read_recording(tmp_path / name)
    assert samples.position == pytest.approx(angle, abs=1e-6)
    assert samples.velocity == pytest.approx(np.cos(time), abs=1e-6)


def bench(path, sign=1.0, **others):
    """Write means of a gear on a test bench, whose motor turns nine times as fast as its output."""
    speed = np.concatenate((-np.linspace(0.2, 3.0, 6), np.linspace(0.2, 3.0, 6)))
    return write(path, motor_speed=9.0 * speed, motor_torque=sign * (
        0.3 * np.sign(speed) + 0.01 * speed), **others)


@pytest.mark.parametrize(('sign', 'verdict'), [(1.0, 'TRUST: '), (-1.0, 'RECORD AGAIN: ')])
def test_friction_that_would_push_is_not_trusted_in_means_either(tmp_path, capsys, sign, verdict):
    assert main(['refine', str(bench(tmp_path / 'means.csv', sign)), '--output', str(
        tmp_path / 'out')]) == 0
    said = capsys.readouterr().out
    assert verdict in said
    assert ('would have to push' in said) == (sign < 0.0)


TIME = 0.01 * np.arange(600)


def rows_with(*cells):
    """Return the lines of a log with more cells in each row."""
    return [f'{t:.2f},{np.sin(t):.6f},{0.3 * np.sign(np.cos(t)):.3f},{",".join(cells)}'
            for t in TIME]


@pytest.mark.parametrize('cells', [
    ('"one\ntwo, three"', '7'), ('"a ""word"""', '7'), ('5"', '7')])
def test_a_quoted_cell_may_have_lines_and_a_quote_alone_is_a_character(tmp_path, cells):
    log = tmp_path / 'log.csv'
    log.write_text('\n'.join(['time,position,current,note,x', *rows_with(*cells)]))
    (samples, _), = read_recording_with_info(log)
    np.testing.assert_allclose(samples.time, TIME, atol=1e-9)


def test_the_current_of_a_table_that_also_has_torques_is_named_for_all_joints(tmp_path):
    time, position, velocity = swing(500)
    path = write(tmp_path / 'log.csv', Time=time, Position1=position, Position2=2.0 * position,
                 Torque1=velocity, Torque2=velocity, Cur1=3.0 * velocity, Cur2=2.0 * velocity)
    for layout in (Layout(columns={'position': 'Position2', 'current': 'Cur2'}),
                   Layout(columns={'current': 'Cur2'}), Layout(columns={'effort': 'Cur2'})):
        for joint, size in (('2', 2.0), ('1', 3.0)):
            samples, info = read_recording_with_info(path, joint=joint, layout=layout)[0]
            assert info.effort_is_current
            assert np.ptp(samples.current) == pytest.approx(size * np.ptp(velocity))


def test_objects_within_a_struct_of_matlab_are_no_columns(tmp_path, monkeypatch):
    time, position, velocity = swing(500)
    symbol = MatlabOpaque(np.array([(b'q', b'MCOS', b'sym', 3)], dtype=[
        ('s0', 'O'), ('s1', 'O'), ('s2', 'O'), ('arr', 'O')]))
    monkeypatch.setattr('scipy.io.loadmat', lambda *_, **__: {
        'gen': {'q': symbol}, 't': time, 'q': position, 'tau': velocity})
    (tmp_path / 'log.mat').write_bytes(b'')
    samples, = read_recording(tmp_path / 'log.mat')
    assert len(samples) == 500
