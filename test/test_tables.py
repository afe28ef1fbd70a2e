# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files of tables: every kind holds the same, what is in them is read in SI units, or asked."""

import gzip
import json
import math
from pathlib import Path
import warnings

from helpers import printed_by, swing, write
import numpy as np
import pytest
from recording_maker import DATA
from scipy.io import savemat

from friction_comp import InputError, Layout, read_frame, read_recording, Samples
from friction_comp.__main__ import main
from friction_comp.recordings.reader import read_recording_with_info, recorded_joints
from friction_comp.recordings.writer import write_samples
from friction_comp.tables.table_files import Table, to_csv
from friction_comp.tables.table_recording import table_of

CASES = DATA.with_name('cases')
TURN = 2.0 * math.pi


def records(path, t, q, tau):
    path.write_text(json.dumps({'kp': 8.0, 'entries': [
        {'timestamp': a, 'position': b, 'torque': c} for a, b, c in zip(t, q, tau)]}))


def json_lines(path, t, q, tau):
    path.write_text('\n'.join(json.dumps(
        {'time': a, 'q': [0.0, b], 'tau': [1.0, c]}) for a, b, c in zip(t, q, tau)))


def parquet(path, t, q, tau):
    arrow, form = pytest.importorskip('pyarrow'), pytest.importorskip('pyarrow.parquet')
    form.write_table(arrow.table({'timestamp': t, 'position': [[b, 0.0] for b in q],
                                  'effort': [[c, 0.0] for c in tau]}), path)


def dates(path, t, q, tau):
    path.write_text('\n'.join(['time,q,tau', *(
        f'2026-03-04T09:59:{10.0 + a:09.6f}Z,{b:.9f},{c:.9f}' for a, b, c in zip(t, q, tau))]))


def hdf5(path, t, q, tau):
    """As MATLAB 7.3 lays them out, with what is no column, and another clock."""
    with pytest.importorskip('h5py').File(path, 'w') as file:
        file.update({
            'log/time': t[None], 'log/q': np.vstack((q, 2.0 * q)), 'log/tau': np.vstack(
                (tau, 2.0 * tau)), 'log/remark': np.array([[102], [111]], np.uint16),
            'log/image': np.zeros((9, 9, 9)), 'log/kp': np.array([[3.0]]),
            'knee/time': t[:250], 'knee/q': q[:250]})


def matlab(path, t, q, tau):
    savemat(path, {'log': {'time': t, 'note': 'knee', 'joint': {'q': q[:, None], 'tau': tau}},
                   'knee': {'t': t[:250], 'q': q[:250], 'tau': tau[:250]}})


def decimal_commas(path, t, q, tau):
    text = '\n'.join(['time;Winkel;tau [mNm]', *(f'{a:.3f};{b:.9f};{1e3 * c:.9f}'
                                               for a, b, c in zip(t, q, tau))]).replace('.', ',')
    path.write_bytes(gzip.compress(text.encode('utf-16')))


ONE, OTHER = {}, {'joint': '1'}


@pytest.mark.parametrize(('name', 'save', 'given'), [
    ('log.json', records, ONE), ('LOG.CSV', dates, ONE), ('log.parquet', parquet, {'joint': '0'}),
    ('log.jsonl', json_lines, {'layout': Layout({'position': 'q_2', 'effort': 'tau_2'})}),
    ('log.h5', hdf5, OTHER), ('log.mat', hdf5, OTHER),
    ('log.csv.gz', decimal_commas, {'layout': Layout({'position': 'Winkel'})}),
    ('log.npz', lambda path, t, q, tau: np.savez(path, t=t, q=np.column_stack((q, -q)), tau=(
        np.column_stack((tau, -tau))), other=np.zeros(7), note=np.array(['x'] * len(t))), OTHER),
    ('log.npy', lambda path, t, q, tau: np.save(path, np.rec.fromarrays(
        (t, q, tau), names='t,q,tau')), ONE),
    ('log.mat', matlab, {'layout': Layout({
        'time': 'log.time', 'position': 'log.joint.q', 'effort': 'log.joint.tau'})})])
def test_every_kind_of_file_holds_the_same(tmp_path, name, save, given):
    time, position, velocity = swing()
    save(tmp_path / name, time, position, velocity)
    samples, = read_recording(tmp_path / name, **given)
    np.testing.assert_allclose(samples.time, time, atol=2e-6)
    np.testing.assert_allclose(samples.position, position, atol=1e-8)
    np.testing.assert_allclose(samples.current, velocity, atol=1e-8)


def test_an_episode_of_teleoperation_needs_the_rate_and_the_joint_only(tmp_path, refuses):
    _, position, velocity = swing(500, 0.02)
    path, wide = tmp_path / 'episode.hdf5', np.array([1.0, 2.0, 3.0])
    with pytest.importorskip('h5py').File(path, 'w') as file:
        file.update({
            'observations/qpos': np.outer(position, wide), 'compress_len': np.ones((1, 500)),
            'observations/qvel': np.outer(velocity, wide), 'observations/effort': np.tanh(
                20.0 * np.outer(velocity, wide)), 'action': np.outer(position, wide) + 0.1})
    samples, = read_recording(path, '2', layout=Layout(rate=50.0))
    np.testing.assert_allclose(samples.time, 0.02 * np.arange(500))
    np.testing.assert_allclose(samples.reference_position, 2.0 * position + 0.1)
    assert samples.arm.joints == ('1', '2', '3')
    refuses('or the rows per second with --rate HZ', 'refine', path)
    refuses("several joints, name one with --joint: '1', '2', '3'", 'refine', path, '--rate', '50')
    refuses('no recording in this folder; tables must be named', 'refine', tmp_path)


# Text. Each form is written for time, position, velocity.

DOT, LIST = '{0:.3f},{1:.9f},{2:.9f}', '{0:.3f},"[{1:.9f}, {1}]","[{2:.9f}, {2}]"'
BARE = Layout({'time': '1', 'position': '3', 'current': '4'})


@pytest.mark.parametrize(('head', 'form', 'names', 'given'), [
    *((f'{above}\ntime,q,tau', DOT, 'time q tau', ONE) for above in (
        'Logger v3\nDate: 2026-03-04\n', 'sep=,', 'Knee', 'Export,of', '\n', 'Patient,7,left',
        '# a comment\nMotion of a joint, measured,twice')),
    *((f't{mark}q{mark}tau', mark.join(('{0:.3f}', '{1:.9f}', '{2:.9f}')), 't q tau', ONE)
      for mark in (',', ';', '\t', ' ')),
    # numpy.savetxt; units below the names; cells without a name; a name in quotes.
    ('# time q tau', '{0:.3f}\t{1:.9f}\t{2:.9f}', 'time q tau', ONE),
    ('Time,Angle,Torque\ns,rad,N·m', DOT, 'Time_[s] Angle_[rad] Torque_[N·m]', ONE),
    ('time;q;tau\n[s];[rad];[Nm]', '{0:.3f};{1:.9f};{2:.9f}', 'time_[s] q_[rad] tau_[Nm]', ONE),
    ('time,q,tau,,', f'{DOT},,', 'time q tau', ONE), ('"time","q","tau"', DOT, 'time q tau', ONE),
    ('# time,q,tau,', f'{DOT},', 'time q tau', ONE),
    ('time,q,tau,note', f'{DOT},"one\ntwo, three"', 'time q tau note', ONE),
    ('time,q,tau,note', f'{DOT},"a ""word"""', 'time q tau note', ONE),
    ('time,q,tau,note', f'{DOT},5"', 'time q tau note', ONE),
    # Texts and lists in cells, without and with names.
    ('% of a robot', '{0:.3f} OK {1:.9f} {2:.9f}', '1 2 3 4', {'layout': BARE}),
    ('% of a robot', '{0:.3f},0x0,{1:.9f},{2:.9f}', '1 2 3 4', {'layout': BARE}),
    ('% of a robot', '{0:.3f}, -, {1:.9f}, {2:.9f}, ', '1 2 3 4', {'layout': BARE}),
    ('t,1,2,state', DOT + ',7', 't 1 2 state', {'layout': Layout(
        {'position': '1', 'current': '2'})}),
    ('time,q,tau', LIST, 'time q[0] q[1] tau[0] tau[1]', OTHER),
    ('time,q,tau', '{0:.3f},"[ {1:.9f}\n {1}]",[{2:.9f} {2}]', 'time q[0] q[1] tau[0] tau[1]',
     OTHER),
    ('time;q;tau', '{0:.3f};[{1:.9f}, {1}];({2:.9f}, {2})', 'time q[0] q[1] tau[0] tau[1]', OTHER)])
def test_every_form_of_text_holds_the_same(tmp_path, head, form, names, given):
    time, position, velocity = swing(60, 0.01)
    log = tmp_path / 'log.csv'
    log.write_text('\n'.join([head, *(form.format(*row) for row in zip(time, position, velocity))]))
    assert Table(log).names == [name.replace('_', ' ') for name in names.split()]
    samples, = read_recording(log, **given)
    for found, true in ((samples.time, time), (samples.position, position),
                        (samples.current, velocity)):
        np.testing.assert_allclose(found, true, atol=1e-8)


def test_whole_numbers_have_no_decimal_comma(tmp_path):
    (tmp_path / 'log.csv').write_text('t;q;tau\n0;0;0\n0,01;0,1;0,2\n')
    np.testing.assert_array_equal(read_recording(tmp_path / 'log.csv')[0].current, [0.0, 0.2])


def text(line):
    def save(path, t, q):
        path.write_text('\n'.join(['time;q;tau [mNm]', *(
            f'{a:.3f};{b:.6f};1.5' for a, b in zip(t, q)), line]))
    return save


@pytest.mark.parametrize(('name', 'save', 'said'), [
    ('log.csv.gz', lambda path, t, q: path.write_bytes(gzip.compress(b'1' * 10_000_000)),
     'a line has more than'),
    ('log.csv.gz', lambda path, t, q: path.write_bytes(gzip.compress('\n'.join(
        ['t,q,tau', *[f'{a},{a},{a}' for a in t] * 99]).encode())[:-900]), 'is damaged: '),
    ('log.csv', text('9,0;0.1;3,314'), "'9,0' is not a number"),
    ('log.csv', text('9.0;0.1;3,314'), "column 'tau [mNm]': '3,314' is not a number"),
    ('log.csv', lambda path, t, q: path.write_text('\n'.join(['time;q;tau', *(
        f'{k};{k};{k + 1},{k + 100}' for k in range(50))])), 'decimal mark, or of thousands'),
    ('log.csv', lambda path, t, q: path.write_text('time,q,tau\n'), 'has no row below'),
    ('log.csv', lambda path, t, q: write(path, time=np.nan * t, q=q, tau=q),
     "column 'time' holds no time"),
    ('log.csv', lambda path, t, q: write(path, time=t, q=q, tau=np.round(30.0 * q)),
     "column 'tau' holds whole numbers: give its unit, --unit effort=2.69mA"),
    ('log.csv', lambda path, t, q: write(path, time=t, q=np.round(99 * q), tau=np.round(30 * q)),
     "deg, turn or rad; column 'tau' holds whole numbers"),
    ('log.csv', lambda path, t, q: write(
        path, time=t, q=np.round(q / TURN * 2 ** 14) / 2 ** 14, tau=q),
     'give its unit, --unit position=counts/4096'),
    ('log.csv', lambda path, t, q: write(path, time=t, q=np.degrees(q), tau=q),
     'as if it were in degrees or that of the motor before the gear: give its unit'),
    ('log.npz', lambda path, t, q: path.write_text('time,q,tau'), 'not a readable table'),
    ('log.xlsx', lambda path, t, q: path.write_text('PK'), 'save its sheet as CSV'),
    ('log.bag', lambda path, t, q: path.write_text('#ROS'), 'rosbags-convert --src ')])
def test_what_is_no_table_or_means_two_things_is_refused(tmp_path, name, save, said):
    save(tmp_path / name, *swing()[:2])
    with pytest.raises(InputError) as error:
        read_recording(tmp_path / name)
    assert said in str(error.value)


def test_a_refusal_comes_before_anything_slow_is_imported(tmp_path):
    (tmp_path / 'log.csv').write_text('time,position\n0,1\n')
    loaded = printed_by(f"""
        import sys
        from friction_comp.__main__ import main
        assert main(['refine', {str(tmp_path / 'log.csv')!r}, '--output', 'no']) == 2
        print(*sys.modules)""").split()
    assert not {'scipy', 'numba', 'matplotlib', 'pandas'} & set(loaded)


# Rows and times.

@pytest.mark.parametrize('late', [0.0, 0.003])
def test_files_with_a_signal_each_are_joined_by_a_plus(tmp_path, late):
    time, position, velocity = swing(300, 0.01)
    own = {} if not late else {'time': time}
    np.savetxt(tmp_path / 'time.txt', time)
    write(tmp_path / 'q.csv', **own, value=position)
    write(tmp_path / 'tau.csv', **({'time': time + late} if late else {}), tau=velocity)
    names = ['q.csv', 'tau.csv', *(['time.txt'] if not late else [])]
    samples, = read_recording(Path('+'.join(str(tmp_path / name) for name in names)))
    at = samples.time
    np.testing.assert_allclose(samples.position, 0.4 * np.sin(2.0 * (at + late)), atol=2e-4)
    np.testing.assert_allclose(samples.current, 0.8 * np.cos(2.0 * at), atol=1e-4)
    assert len(samples) > 298


def test_joined_files_keep_the_names_of_their_columns_in_order(tmp_path):
    time, own = 0.01 * np.arange(300), np.ones(300)
    write(tmp_path / 'q.csv', time=time, hip=own, knee=own, toe=own)
    write(tmp_path / 'tau.csv', time=time + 0.003, toe=own, hip=own)
    assert Table(Path(f'{tmp_path / "q.csv"}+{tmp_path / "tau.csv"}')).names == [
        'time', 'q_hip', 'q_knee', 'q_toe', 'tau_toe', 'tau_hip']


def test_the_arrays_that_are_named_are_read_though_most_have_another_length(tmp_path, refuses):
    rest, others = np.ones(300), {f'other_{k}': np.zeros(7) for k in range(9)}
    np.savez(tmp_path / 'log.npz', t=0.01 * np.arange(300), q=rest, tau=rest, **others)
    refuses('never moves', 'refine', tmp_path / 'log.npz', '--columns', 'time=t,position=q')


def test_rows_that_hold_a_value_each_are_one_recording(tmp_path):
    """As topics come: an angle every 2 ms, an effort every 5 ms, and a hole in the angles."""
    t, e = 0.002 * np.arange(1500), 0.0013 + 0.005 * np.arange(600)
    # It wraps around; between rows there are no means across that.
    rows = [(s, f'{(3.0 * math.degrees(s) + 180.0) % 360.0 - 180.0:.9f}', '') for s in t
            if not 1.0 < s < 1.2]
    rows += [(s, '', f'{math.cos(s):.12g}') for s in e]
    (tmp_path / 'log.csv').write_text('\n'.join(['time_s,elbow_pos_deg,tau_meas', *(
        f'{s:.9f},{q},{tau}' for s, q, tau in sorted(rows))]))
    (samples, info), = read_recording_with_info(tmp_path / 'log.csv')
    assert any('those with tau_meas are used' in note for note in info.notes)
    kept = e[(e < 1.0) | (e > 1.2)]
    np.testing.assert_allclose(samples.time, kept - kept[0], atol=1e-6)
    turned = np.where(kept > 1.1, samples.position[-1] - 3.0 * kept[-1], 0.0)
    np.testing.assert_allclose(samples.position - turned, 3.0 * kept, atol=1e-5)
    np.testing.assert_allclose(turned / TURN, np.round(turned / TURN), atol=1e-6)
    np.testing.assert_allclose(samples.current, np.cos(kept), atol=1e-9)


def test_times_that_begin_anew_are_episodes(tmp_path):
    time, position, velocity = swing(400, 0.01)
    path = write(tmp_path / 'log.csv', time=np.tile(time, 3), q=np.tile(position, 3),
                 tau=np.tile(velocity, 3))
    (samples, info), = read_recording_with_info(path)
    assert len(samples.segments()) == 3
    assert any('times begin anew 2 times' in note for note in info.notes)


@pytest.mark.parametrize('order', [[*range(299, -1, -1)], [113 * k % 300 for k in range(300)]])
def test_rows_in_no_order_of_time_are_sorted(tmp_path, order):
    time, position, velocity = swing(300, 0.04)
    path = write(tmp_path / 'log.csv', t=time[order], q=position[order], tau=velocity[order],
                 load=position[order])
    (samples, info), = read_recording_with_info(path)
    assert any('in no order of time' in note for note in info.notes)
    for read, true in ((samples.time, time), (samples.position, position),
                       (samples.current, velocity), (samples.load, position)):
        np.testing.assert_allclose(read, true, atol=1e-9)


@pytest.mark.parametrize(('per_second', 'unit'), [(1e3, 'ms'), (1e6, 'µs'), (1e9, 'ns')])
def test_times_that_cannot_be_seconds_are_asked(tmp_path, refuses, per_second, unit):
    time, position, velocity = swing(300, 0.004)
    path = write(tmp_path / 'log.csv', t=np.round(per_second * time), q=position, tau=velocity)
    refuses(f'for instance --unit time={unit}, or time=s', 'refine', path)
    path = write(tmp_path / 'log.csv', **{'time [ms]': time, 'q': position, 'tau': velocity})
    refuses('too close for this unit: give its unit, for instance --unit time=s', 'refine', path)
    path = write(tmp_path / 'log.csv', t=1e3 * time, q=position, tau=velocity)
    refuses('has rows 4 apart, which show no motion if these are seconds', 'refine', path)
    for layout in (Layout(units={'time': 'ms'}), Layout(rate=250.0), Layout(
            {'time': 't'}, {'time': '0.001s'})):
        samples, = read_recording(path, layout=layout)
        np.testing.assert_allclose(samples.time, time, atol=1e-9)


def test_a_wrong_rate_is_told_with_the_true_one(tmp_path, refuses):
    _, position, velocity = swing(6000, 0.005)
    path = write(tmp_path / 'log.csv', q=position, dq=velocity, tau=velocity)
    refuses('the rate is really 0.25 times the one given', 'refine', path, '--rate', '800')
    samples, = read_recording(path, layout=Layout({'velocity': ''}, rate=800.0))
    assert samples.velocity is None


def test_rows_without_a_number_are_left_out_and_warn_of_nothing(tmp_path):
    time, position, velocity = swing()
    path = write(tmp_path / 'log.csv', t=time, tau=velocity, q=np.where(
        np.arange(2000) % 500 < 50, np.inf, position))
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        samples, = read_recording(path)
    assert len(samples) == 1800


# Signals and units.

SIGNALS = ('time', 'position', 'current', 'velocity', 'load', 'temperature', 'command', 'direction',
           'reference_position', 'reference_velocity')


def moving(count=2000, **changes):
    """Return samples of a joint that swings as a joint can; `make_samples` is noise."""
    time, position, velocity = swing(count)
    samples = Samples(
        time=time, position=position, velocity=velocity, current=0.3 * np.tanh(20.0 * velocity),
        load=0.1 * velocity, temperature=20.0 + time, command=0.2 * np.sign(velocity),
        direction=np.sign(velocity), reference_position=position, reference_velocity=velocity,
        joint='elbow')
    return samples.with_(**changes)


def write_csv(path, samples, names='t q dq tau', factors=(1.0, 1.0, 1.0, 1.0)):
    values = samples.time, samples.position, samples.velocity, samples.current
    return write(path, **{name: factor * own for name, factor, own in zip(
        names.split(), factors, values)})


def assert_alike(found, wanted, signals=('time', 'position', 'velocity', 'current')):
    assert len(found) == len(wanted)
    for name in signals:
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-9,
                                   err_msg=name)


def test_a_table_holds_all_that_the_recording_held(tmp_path):
    (tmp_path / 'log.csv').write_text(to_csv(table_of([moving()]), 12))
    (found, info), = read_recording_with_info(tmp_path / 'log.csv')
    assert_alike(found, moving(), SIGNALS)
    assert info.joint == 'elbow'
    assert not any('guessed' in note for note in info.notes)


def test_a_recording_becomes_a_table_and_a_recording_again(tmp_path, capsys):
    write_samples(tmp_path / 'bag', moving(300))
    assert main(['convert', str(tmp_path / 'bag'), '--output', str(tmp_path / 'log.csv')]) == 0
    assert main(['convert', str(tmp_path / 'log.csv'), '--output', str(tmp_path / 'again')]) == 0
    first, again = read_recording([tmp_path / 'bag', tmp_path / 'again'])
    assert_alike(again, first, SIGNALS)
    # A table is no more overwritten than a recording.
    for source, output in (('log.csv', 'again'), ('again', 'log.csv')):
        before = (tmp_path / 'log.csv').read_bytes()
        assert main(['convert', str(tmp_path / source), '--output', str(tmp_path / output)]) == 2
        assert 'already exists; recordings are not overwritten' in capsys.readouterr().err
        assert (tmp_path / 'log.csv').read_bytes() == before


def test_a_converted_recording_keeps_its_date_and_the_joints_that_are_usable(tmp_path, capsys):
    joints = [moving(300), moving(300).with_(joint='grip', current=np.full(300, np.nan))]
    write_samples(tmp_path / 'bag', joints, start_ns=1_700_000_000_000_000_000)
    assert main(['convert', str(tmp_path / 'bag'), '--output', str(tmp_path / 'again')]) == 0
    assert 'left out' in capsys.readouterr().out
    (_, info), = read_recording_with_info(tmp_path / 'again')
    assert (info.joint, info.start) == ('elbow', 1.7e9)
    assert main(['convert', str(tmp_path / 'bag'), '--joint', 'grip',
                 '--output', str(tmp_path / 'no')]) == 2
    assert 'no finite effort' in capsys.readouterr().err


@pytest.mark.parametrize(('names', 'factors', 'given', 'current'), [
    ('t_ms q[deg] dq[deg/s] tau', (1e3, 360.0 / TURN, 360.0 / TURN, 1.0), {}, 1.0),
    ('t q dq tau', (1e3, 4096.0 / TURN, 60.0 / TURN, 1e3), {'layout': Layout(units={
        'time': 'ms', 'position': 'counts/4096', 'velocity': 'rpm', 'effort': 'mNm'})}, 1.0),
    ('t q dq tau', (1.0,) * 4, {'torque_constant': 0.1, 'gear_ratio': 100}, 0.1),
    # A current is not divided by the torque constant.
    ('t q dq i', (1.0,) * 4, {'torque_constant': 0.1, 'gear_ratio': 100}, 1.0),
    ('t q dq tau', (1.0,) * 4, {'torque_constant': 5.0, 'layout': Layout(
        units={'effort': 'mA'})}, 1e-3)])
def test_units_become_si(tmp_path, names, factors, given, current):
    path = write_csv(tmp_path / 'log.csv', moving(), names, factors)
    assert_alike(read_recording(path, **given)[0], moving(current=current * moving().current))


def test_guessed_columns_and_assumed_units_are_reported(tmp_path):
    (_, info), = read_recording_with_info(write_csv(
        tmp_path / 'log.csv', moving(), 't_ms q dq tau', (1e3, 1.0, 1.0, 1.0)))
    assert any('guessed' in note and 'time=t_ms in ms' in note for note in info.notes)
    assert info.assumed == ('q in rad', 'dq in rad/s', 'tau in N·m')


def test_a_percentage_stays_one(tmp_path):
    time, position, velocity = swing(300)
    path = write(tmp_path / 'log.csv', **{
        't': time, 'q': position, 'dq [%]': velocity, 'Torque [%]': 7.5 * velocity})
    (samples, info), = read_recording_with_info(path)
    assert (info.effort_unit, samples.velocity) == ('%', None)
    assert info.assumed == ('q in rad', 't in s')


def test_joints_of_one_table_are_told_apart(tmp_path):
    time, position, velocity = swing()
    path = write(tmp_path / 'arm.csv', time=time, q_0=2.0 * position, q_1=position,
                 i_0=np.sign(velocity) + position, i_1=0.5 * np.sign(velocity))
    assert recorded_joints(path) == ['0', '1']
    with pytest.raises(InputError, match="several joints, name one with --joint: '0', '1'"):
        read_recording(path)
    layout = Layout({'position': 'q_1', 'current': 'i_1'})
    assert recorded_joints(path, layout) == ['1']
    for given in ({'joint': '1'}, {'layout': layout}):
        samples, = read_recording(path, **given)
        assert (samples.joint, samples.arm.joints) == ('1', ('0', '1'))
        np.testing.assert_allclose(samples.current, 0.5 * np.sign(velocity))


@pytest.mark.parametrize('follows', [False, True])
def test_the_effort_of_a_position_controller_follows_from_its_gains(tmp_path, follows):
    time, position, velocity = swing(300)
    target = {'target_position': position + 0.1, **({'target_velocity': velocity + 0.2}
                                                    if follows else {})}
    path = write(tmp_path / 'servo.csv', time=time, position=position, **target)
    (samples, info), = read_recording_with_info(path, layout=Layout(stiffness=20.0, damping=0.5))
    np.testing.assert_allclose(
        samples.current[1:-1], 2.1 if follows else 2.0 - 0.5 * velocity[1:-1], atol=1e-3)
    assert any('target velocity' in note for note in info.notes) == follows


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_torque_behind_the_gear_is_the_load_with_either_sign(tmp_path, sign):
    """In N·m it is: of a current, whose share of it is fitted, it is no part."""
    time, position, velocity = swing()
    friction, carried = 2.0 * np.sign(velocity), 9.0 * np.sin(position)
    columns = {'time': time, 'position': position, 'velocity': velocity,
               'tau': friction + carried, 'link_torque': sign * carried}
    (samples, info), = read_recording_with_info(write(tmp_path / 'log.csv', **columns))
    np.testing.assert_allclose(samples.current + samples.load, friction, atol=1e-9)
    assert any('is reversed' in note for note in info.notes) == (sign < 0)
    for unit in ('A', '%'):
        framed = read_frame(columns, Layout(units={'effort': unit}))
        np.testing.assert_allclose(framed.load, -carried)
        np.testing.assert_allclose(framed.current, columns['tau'])


@pytest.mark.parametrize(('ratio', 'told'), [(100.0, True), (1.0, False)])
def test_a_missing_gear_ratio_is_hinted_at(ratio, told):
    time, position, velocity = swing()
    carried, notes = 40.0 * np.sin(position), []
    read_frame({'t': time, 'q': position, 'dq': velocity, 'link_torque': -carried,
                'tau': (carried + 1.2 * np.sign(velocity)) / ratio}, notes=notes)
    assert any('before a gear' in note for note in notes) == told


def test_a_data_frame_means_the_same_as_a_file():
    time, position, velocity = swing()
    samples = read_frame({'t': time, 'q': position, 'dq': velocity, 'tau': velocity,
                          'tau_cmd': 2.0 * velocity}, torque_constant=0.1, gear_ratio=10.0)
    np.testing.assert_allclose(samples.command, 2.0 * velocity)
    samples = read_frame({'target': position + 0.1, 'q': position},
                         Layout(rate=1000.0, stiffness=20.0))
    np.testing.assert_allclose(samples.time, time)
    np.testing.assert_allclose(samples.current, 2.0)


# Bags in other units, and of what is no table.

def test_columns_and_units_of_what_is_no_table_are_not_ignored(tmp_path, refuses):
    write_samples(tmp_path / 'bag', moving(300))
    for option, value in (('--columns', 'position=q_2'), ('--unit', 'position=deg,time=ms'),
                          ('--unit', 'effort=V'), ('--rate', '100')):
        for tool in ('refine', 'evaluate', 'convert'):
            refuses('describe tables, and this is none', tool, tmp_path / 'bag', option, value)


@pytest.mark.parametrize(('unit', 'position', 'effort'), [
    ('position=deg,velocity=deg/s', math.degrees(1.0), 1.0), ('effort=-1Nm', 1.0, -1.0),
    ('effort=mA', 1.0, 1e3 / 5.0), ('effort=-1A', 1.0, -1.0 / 5.0)])
def test_messages_in_other_units_are_read_as_the_units_say(tmp_path, unit, position, effort):
    one = moving(3000)
    write_samples(tmp_path / 'bag', one.with_(
        position=position * one.position, velocity=position * one.velocity,
        current=effort * one.current), 0.05, 100)
    layout = Layout(units=dict(entry.split('=') for entry in unit.split(',')))
    assert_alike(*read_recording(tmp_path / 'bag', None, 0.05, 100, layout=layout), one)


@pytest.mark.skipif(not CASES.is_dir(), reason='inputs from public reports are not here')
@pytest.mark.parametrize(('file', 'layout', 'fact'), [
    ('csv_trailing_commas/log.csv', {}, ('', 'N·m', 12000)),
    ('export_unit_not_torque/dxl.csv', {
        'columns': {'time': 'timestamp_ms', 'position': 'Present Position',
                    'effort': 'Present Current'},
        'units': {'position': 'counts/4096', 'effort': 'LSB'}}, ('', 'LSB', None)),
    ('lift_units/lift.csv', {'units': {'position': 'm', 'velocity': 'm/s', 'effort': '62N'}},
     ('lift', 'N', 1500)),
    ('lift_units/lift.csv', {'columns': {'effort': 'lift.motor.current'},
                             'units': {'position': 'm', 'effort': '62N'}}, ('', 'N', 1500)),
    ('volts/log.csv', {'columns': {'effort': '/Drive/LeftAppliedVolts'}, 'joint': 'Drive/Left'},
     ('Drive/Left', 'V', 1260)),
    ('gear_dynamometer/dyno.csv', {'units': {'effort': '100Nm'}}, ('', 'N·m', 4000)),
    ('one_joint_of_arm_trusts/robot_data.csv', {'joint': '2'}, ('2', 'A', None)),
    ('position_only_servo/servo.csv', {'stiffness': 20.0, 'damping': 0.5}, ('', 'N·m', 2000)),
    ('file_forms/episode_000000.parquet', {
        'columns': {'position': 'observation.state[0]', 'effort': 'observation.effort[0]'},
        'units': {'position': 'deg', 'velocity': 'deg/s', 'effort': 'N·m'}}, ('0', 'N·m', None)),
    ('file_forms/dyn', {}, ('elbow', 'A', None))])
def test_inputs_of_public_reports_mean_what_they_say(file, layout, fact):
    given = Layout(**layout)
    (samples, info), = read_recording_with_info(
        CASES / file, given.joint if fact[0] == '2' else None, layout=given)
    unit = info.effort_unit or ('A' if info.effort_is_current else 'N' if info.linear else 'N·m')
    assert (info.joint, unit) == fact[:2]
    assert fact[2] in (None, len(samples))
