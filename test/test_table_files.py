# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Kinds of files that hold a table: CSV, JSON, Parquet, MAT, NumPy and bags of ROS 1."""

import json
import math
import re

import numpy as np
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabOpaque
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.__main__ import main
from friction_comp.recordings import read_recording_with_info
from friction_comp.recordings.sources import find_recordings


def save_json(path, columns):
    path.write_text(json.dumps({'kp': 8.0, 'motor': 'x', 'entries': [
        {'timestamp': t, 'position': q, 'torque': e} for t, q, e in zip(*columns.values())]}))


def save_lists(path, columns):
    path.write_text(json.dumps({name: list(values) for name, values in columns.items()}))


def save_vectors(path, columns):
    path.write_text(json.dumps([
        {'t': t, 'q': [0.0, q], 'tau': [1.0, e]} for t, q, e in zip(*columns.values())]))


def save_lines(path, columns):
    path.write_text('\n'.join(json.dumps(
        {'time': t, 'position': q, 'torque': e}) for t, q, e in zip(*columns.values())))


def save_structs(path, columns):
    time, position, effort = (values[:, None] for values in columns.values())
    savemat(path, {'log': {'time': time, 'note': 'knee', 'joint': {
        'q': position, 'motor': {'tau': effort}}}})


def save_axes(path, columns):
    np.savez(path, time=columns['t'], **{name: np.column_stack((2.0 * columns[name], columns[name]))
                                         for name in ('q', 'tau')})


def save_parquet(path, columns):
    arrow = pytest.importorskip('pyarrow')
    parquet = pytest.importorskip('pyarrow.parquet')
    parquet.write_table(arrow.table({
        'timestamp': columns['t'], 'observation.state': [[q, 0.0] for q in columns['q']],
        'observation.effort': [[e, 0.0] for e in columns['tau']]}), path)


@pytest.mark.parametrize(('name', 'save', 'layout', 'joint'), [
    ('log.json', save_json, {}, None), ('log.json', save_lists, {}, None),
    ('log.json', save_vectors, {}, '2'), ('log.jsonl', save_lines, {}, None),
    ('log.parquet', save_parquet, {}, '0'), ('log.npz', save_axes, {}, '2'),
    ('log.mat', save_structs, {}, None),
    ('log.mat', lambda path, columns: savemat(path, {'log': {
        name: values[:, None] for name, values in columns.items()}}), {}, None),
    ('log.npy', lambda path, columns: np.save(path, np.column_stack(list(columns.values()))),
     {'time': '1', 'position': '2', 'current': '3'}, None),
    ('log.npy', lambda path, columns: np.save(path, np.rec.fromarrays(
        list(columns.values()), names=list(columns))), {}, None),
    ('log.txt', lambda path, columns: np.savetxt(
        path, np.column_stack(list(columns.values())), header=' '.join(columns), comments='% '),
     {}, None)])
def test_every_kind_of_file_holds_the_same(tmp_path, name, save, layout, joint):
    time, position, velocity = swing(300)
    effort = np.sign(velocity)
    save(tmp_path / name, {'t': time, 'q': position, 'tau': effort})
    samples, = read_recording(tmp_path / name, joint, layout=Layout(layout))
    np.testing.assert_allclose(samples.time, time, atol=1e-9)
    np.testing.assert_allclose(samples.position, position, atol=1e-9)
    np.testing.assert_allclose(samples.current, effort)


def test_files_of_one_signal_each_are_one_recording(tmp_path):
    time, position, velocity = swing(300)
    values = {'time': time, 'q': np.column_stack((position, 2.0 * position)),
              'tau': np.column_stack((np.sign(velocity), np.cos(velocity)))}
    paths = [tmp_path / f'{name}.txt' for name in values]
    for path, columns in zip(paths, values.values()):
        np.savetxt(path, columns)
    assert len(find_recordings(paths)) == 1
    samples, = read_recording(paths, '2')
    np.testing.assert_allclose(samples.position, 2.0 * position)
    np.testing.assert_allclose(samples.current, np.cos(velocity))
    # Whole recordings that are named alike stay apart.
    whole = [write(tmp_path / f'position_{k}.csv', t=time, q=position, tau=velocity)
             for k in (1, 2)]
    assert find_recordings(whole) == whole


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


@pytest.mark.parametrize('late', [0.0, 0.003])
def test_files_of_one_signal_with_a_time_each_are_one_recording(tmp_path, late):
    time, position, velocity = swing(300, 0.01)
    paths = [write(tmp_path / f'run_{name}.csv', t=own, **{
        f'- arm_1_{name}': values, f'- arm_2_{name}': 2.0 * values}) for name, own, values in (
            ('position', time, position), ('effort', time + late, velocity))]
    samples, = read_recording(paths, 'arm_2')
    shared = time[:-1] + late if late else time
    np.testing.assert_allclose(samples.current, 2.0 * velocity[:len(shared)])
    np.testing.assert_allclose(samples.position, 0.8 * np.sin(2.0 * shared), atol=1e-4)


def test_a_tool_for_one_recording_takes_its_files(tmp_path, refuses):
    from friction_comp.__main__ import main

    time, position, velocity = swing(300, 0.01)
    paths = [str(write(tmp_path / f'{name}.csv', t=time, **{name: values}))
             for name, values in (('q', position), ('tau', velocity))]
    assert main(['convert', *paths, '--output', str(tmp_path / 'log.npz')]) == 0
    with np.load(tmp_path / 'log.npz') as file:
        np.testing.assert_allclose(file['effort'], velocity)
    other = write(tmp_path / 'other.csv', t=time, q=position, tau=velocity)
    refuses('a recording too many: give one, or the tables with a signal each', 'convert',
            paths[0], other)


def test_a_bag_of_ros_1_is_read(tmp_path):
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS1_NOETIC)
    types, kind = store.types, 'sensor_msgs/msg/JointState'
    time, position, velocity = swing(50)
    with Writer(tmp_path / 'log.bag') as bag:
        connection = bag.add_connection('/arm/joint_states', kind, typestore=store)
        for k in range(len(time)):
            stamp = 1_000_000_000 + round(1e9 * time[k])
            header = types['std_msgs/msg/Header'](k, types['builtin_interfaces/msg/Time'](
                *divmod(stamp, 1_000_000_000)), '')
            message = types[kind](header, ['elbow'], position[[k]], velocity[[k]], np.array([3.0]))
            bag.write(connection, stamp, store.serialize_ros1(message, kind))
    samples, = read_recording(tmp_path / 'log.bag')
    assert samples.joint == 'elbow'
    np.testing.assert_allclose(samples.time, time, atol=1e-9)
    np.testing.assert_allclose(samples.velocity, velocity)
    (tmp_path / 'log.bag').write_bytes((tmp_path / 'log.bag').read_bytes()[:700])
    with pytest.raises(InputError, match=r'log\.bag: not a readable recording'):
        read_recording(tmp_path / 'log.bag')


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


@pytest.mark.parametrize('sizes', [(300, 200, 400), (300, 300)])
def test_records_of_json_that_hold_lists_are_trials(tmp_path, sizes):
    trials = [{'kind': 'sine', 'targets': ['kp'] * 3, 'pos': np.sin(0.02 * np.arange(n)).tolist(),
               'tau': np.cos(0.02 * np.arange(n)).tolist()} for n in sizes]
    (tmp_path / 'log.json').write_text(json.dumps({'robot': 'one', 'data': trials}))
    (samples, info), = read_recording_with_info(tmp_path / 'log.json', layout=Layout(rate=50.0))
    assert samples.position == pytest.approx(np.concatenate([one['pos'] for one in trials]))
    assert "column 'episode' says which episode each row is of" in info.notes
    assert np.count_nonzero(np.diff(samples.time) > 0.5) == len(sizes) - 1


def bench(path, sign=1.0, **others):
    """Write means of a gear on a test bench, whose motor turns nine times as fast as its output."""
    speed = np.concatenate((-np.linspace(0.2, 3.0, 6), np.linspace(0.2, 3.0, 6)))
    return write(path, motor_speed=9.0 * speed, motor_torque=sign * (
        0.3 * np.sign(speed) + 0.01 * speed), **others)


def test_of_two_speeds_nobody_guesses_whose_torque_it_is(tmp_path, refuses, capsys):
    path = bench(tmp_path / 'means.csv', output_speed=np.linspace(-3.0, 3.0, 12),
                 output_torque=np.zeros(12))
    refuses('which speed is that of motor_torque', 'refine', path)
    assert main(['refine', str(path), '--columns', 'velocity=motor_speed,effort=motor_torque',
                 '--output', str(tmp_path / 'out')]) == 0
    said = capsys.readouterr().out
    assert re.search(r'viscous +0\.001111', said)
    # The torque of the other side is part of what the motor gives.
    assert 'output_torque: not taken into account' in said
    assert 'TRUST IN PART: ' in said


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


def test_columns_that_share_a_name_are_left_out(tmp_path, refuses):
    log = tmp_path / 'log.csv'
    log.write_text('\n'.join(['time,position,current,target,target', *rows_with('1', '2')]))
    (samples, info), = read_recording_with_info(log)
    np.testing.assert_allclose(samples.position, np.sin(TIME), atol=1e-6)
    assert any("several columns have this name: 'target'" in note for note in info.notes)
    log.write_text('\n'.join(['time,position,current,position,x', *rows_with('1', '2')]))
    refuses("two columns called 'position'", 'evaluate', log)


@pytest.mark.parametrize('cells', [
    ('"one\ntwo, three"', '7'), ('"a ""word"""', '7'), ('5"', '7')])
def test_a_quoted_cell_may_have_lines_and_a_quote_alone_is_a_character(tmp_path, cells):
    log = tmp_path / 'log.csv'
    log.write_text('\n'.join(['time,position,current,note,x', *rows_with(*cells)]))
    (samples, _), = read_recording_with_info(log)
    np.testing.assert_allclose(samples.time, TIME, atol=1e-9)


@pytest.mark.parametrize('parts', [
    {'header.stamp.sec': (1000, 10**9), 'header.stamp.nanosec': (1e-6, 1000)},
    {'hour': (3600000, 24), 'minute': (60000, 60), 'second': (1000, 60), 'msec': (1, 1000)},
    {'Hours': (3600000, 24), 'Minutes': (60000, 60), 'Seconds': (1000, 60),
     'Milliseconds': (1, 1000)},
    {'t_sec': (1000, 10**9), 't_us': (1e-3, 1000)}])
def test_the_reading_of_a_clock_in_several_columns_is_one_time(tmp_path, parts):
    """Columns are given by their unit in ms, and how many of these there are."""
    time, position, velocity = swing(3000, 0.001)
    # Over the end of an hour.
    clock = np.round(1000.0 * (14.0 * 3600.0 + 3598.5 + time)).astype(int)
    path = write(tmp_path / 'log.csv', q=position, tau=velocity, **{
        name: clock // size % count if size >= 1 else np.round(clock % count / size)
        for name, (size, count) in parts.items()})
    (samples, info), = read_recording_with_info(path)
    np.testing.assert_allclose(np.diff(samples.time), 0.001, atol=1e-6)
    assert any(all(name in note for name in parts) for note in info.notes)


@pytest.mark.parametrize('count', [5, 70])
def test_other_whole_numbers_beside_seconds_are_no_part_of_a_clock(tmp_path, count):
    """The hours of a machine, and minutes that do not end at 60."""
    time, position, velocity = swing(3000, 0.001)
    path = write(tmp_path / 'log.csv', h=np.full(3000, count), minute=np.arange(3000) % 90,
                 sec=time, q=position, tau=velocity)
    samples, = read_recording(path)
    np.testing.assert_allclose(np.diff(samples.time), 0.001, atol=1e-9)


def test_a_line_of_units_may_have_one_that_is_not_known(tmp_path, refuses):
    time, position, velocity = swing(500)
    rows = '\n'.join(f'{t:.9g},{57.29578 * q:.9g},{v:.9g},{v:.9g}'
                     for t, q, v in zip(time, position, velocity))
    path = tmp_path / 'log.csv'
    path.write_text(f't,q,v,tau\ns,Grad,rad s-1,N.mm\n{rows}\n')
    samples, = read_recording(path)
    assert np.ptp(samples.position) == pytest.approx(np.ptp(position), rel=1e-6)
    assert np.ptp(samples.current) == pytest.approx(1e-3 * np.ptp(velocity), rel=1e-6)
    path.write_text(f't,q,v,tau\ns,deg,flops,N.mm\n{rows}\n')
    with pytest.raises(InputError, match="'flops.' does not tell what a velocity of 1 is"):
        read_recording(path, layout=Layout(columns={'velocity': 'v'}))


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


def test_a_current_beside_the_torque_that_is_used_is_mentioned(tmp_path):
    time, position, velocity = swing(500)
    path = write(tmp_path / 'log.csv', time=time, q_1=position, q_2=position, tau_1=velocity,
                 tau_2=velocity, current_1=velocity, current_2=velocity)
    _, info = read_recording_with_info(path, joint='2')[0]
    assert any('current_1 and 1 alike: not used beside a torque' in note for note in info.notes)
    _, info = read_recording_with_info(path, layout=Layout(columns={
        'position': 'q_1', 'current': 'current_1', 'link_torque': 'tau_1'}))[0]
    assert not any('not used' in note for note in info.notes)


def test_other_columns_of_one_array_are_mentioned(tmp_path):
    _, position, velocity = swing(500)
    savemat(tmp_path / 'log.mat', {'log1': np.column_stack(
        (position, velocity, velocity, position, velocity, velocity))})
    _, info = read_recording_with_info(tmp_path / 'log.mat', layout=Layout(
        columns={'position': 'log1_1', 'current': 'log1_3'}, rate=1000.0))[0]
    assert any('4 other columns have no names' in note for note in info.notes)


def test_objects_within_a_struct_of_matlab_are_no_columns(tmp_path, monkeypatch):
    time, position, velocity = swing(500)
    symbol = MatlabOpaque(np.array([(b'q', b'MCOS', b'sym', 3)], dtype=[
        ('s0', 'O'), ('s1', 'O'), ('s2', 'O'), ('arr', 'O')]))
    monkeypatch.setattr('scipy.io.loadmat', lambda *_, **__: {
        'gen': {'q': symbol}, 't': time, 'q': position, 'tau': velocity})
    (tmp_path / 'log.mat').write_bytes(b'')
    samples, = read_recording(tmp_path / 'log.mat')
    assert len(samples) == 500


def test_a_row_without_the_part_of_a_clock_does_not_take_it_from_the_others(tmp_path):
    time, position, velocity = swing(3000, 0.001)
    part = np.round(1e9 * (time % 1.0))
    part[7] = np.nan
    path = write(tmp_path / 'log.csv', sec=np.floor(time), nanosec=part, q=position, tau=velocity)
    samples, = read_recording(path)
    assert len(samples) == 2999
    assert np.sum(np.diff(samples.time) > 0.0015) == 1


def test_hours_without_minutes_are_no_part_of_a_clock(tmp_path):
    time, position, velocity = swing(3000, 0.001)
    path = write(tmp_path / 'log.csv', sec=time, hour=np.arange(3000) % 7, q=position, tau=velocity)
    samples, = read_recording(path)
    np.testing.assert_allclose(np.diff(samples.time), 0.001, atol=1e-9)
