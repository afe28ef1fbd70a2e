# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings in tables: columns and units are recognised, and guesses are reported."""

import math
import warnings

import numpy as np
import pytest
from table_maker import write

from friction_comp import InputError, Layout, read_recording, Samples
from friction_comp.__main__ import main
from friction_comp.recordings import read_recording_with_info, recorded_joints, write_samples
from friction_comp.tables.table_files import write_columns
from friction_comp.tables.table_recording import table_of

SIGNALS = ('time', 'position', 'current', 'velocity', 'load', 'temperature', 'command', 'direction',
           'reference_position', 'reference_velocity')


def moving(count=2000, **changes):
    """Return samples of a joint that swings as a joint can; `make_samples` is noise."""
    time = 0.001 * np.arange(count)
    position = 0.4 * np.sin(2.0 * time)
    velocity = 0.8 * np.cos(2.0 * time)
    samples = Samples(
        time=time, position=position, velocity=velocity, current=0.3 * np.tanh(20.0 * velocity),
        load=0.1 * velocity, temperature=20.0 + time, command=0.2 * np.sign(velocity),
        direction=np.sign(velocity), reference_position=position, reference_velocity=velocity,
        joint='elbow')
    return samples.with_(**changes)


def write_csv(path, samples, separator=',', names='t q dq tau', factors=(1.0, 1.0, 1.0, 1.0)):
    values = samples.time, samples.position, samples.velocity, samples.current
    return write(path, separator, **{name: factor * own for name, factor, own in zip(
        names.split(), factors, values)})


def assert_alike(found, wanted, signals=('time', 'position', 'velocity', 'current')):
    assert len(found) == len(wanted)
    for name in signals:
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-9,
                                   err_msg=name)


@pytest.mark.parametrize('suffix', ['csv', 'npz', 'parquet'])
def test_a_table_holds_all_that_the_recording_held(tmp_path, suffix):
    if suffix == 'parquet':
        pytest.importorskip('pyarrow')
    wanted = moving()
    path = tmp_path / f'log.{suffix}'
    write_columns(path, table_of([wanted]))
    (found, info), = read_recording_with_info(path)
    assert_alike(found, wanted, SIGNALS)
    assert info.joint == 'elbow'
    assert not any('guessed' in note for note in info.notes)


def test_a_recording_becomes_a_table_and_a_recording_again(tmp_path, capsys):
    wanted = moving(300)
    write_samples(tmp_path / 'bag', wanted)
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


def test_guessed_columns_are_reported(tmp_path):
    path = write_csv(tmp_path / 'log.csv', moving(), names='t_ms q[deg] dq[deg/s] tau',
                     factors=(1e3, 180 / np.pi, 180 / np.pi, 1.0))
    (found, info), = read_recording_with_info(path)
    assert_alike(found, moving())
    said, = (note for note in info.notes if 'guessed' in note)
    assert 'time=t_ms in ms' in said
    assert 'position=q[deg] in deg' in said


@pytest.mark.parametrize('separator', [',', ';', '\t', ' '])
def test_any_separator_will_do(tmp_path, separator):
    path = write_csv(tmp_path / 'log.csv', moving(), separator)
    assert_alike(read_recording(path)[0], moving())


def test_whole_numbers_have_no_decimal_comma(tmp_path):
    (tmp_path / 'log.csv').write_text('t;q;tau\n0;0;0\n0,001;0,1;0,2\n')
    samples, = read_recording(tmp_path / 'log.csv')
    np.testing.assert_array_equal(samples.current, [0.0, 0.2])


# A packed file is read in pieces of up to 128 kB.


def test_columns_that_are_not_used_may_be_text(tmp_path):
    one = moving()
    np.savez(tmp_path / 'log.npz', t=one.time, q=one.position, tau=one.current,
             remark=np.array(['x'] * len(one)))
    assert len(read_recording(tmp_path / 'log.npz')[0]) == len(one)


@pytest.mark.parametrize(('units', 'factors'), [
    ({'time': 'ms', 'position': 'deg', 'velocity': 'rpm'}, (1e3, 180 / np.pi, 30 / np.pi, 1.0)),
    ({'position': 'counts/4096', 'velocity': 'counts/4096/s', 'effort': 'mNm'},
     (1.0, 4096 / (2 * np.pi), 4096 / (2 * np.pi), 1e3)),
    ({'time': 'µs', 'position': 'turn', 'velocity': 'turn/s', 'effort': 'N·m'},
     (1e6, 0.5 / np.pi, 0.5 / np.pi, 1.0))])
def test_units_become_si(tmp_path, units, factors):
    path = write_csv(tmp_path / 'log.csv', moving(), factors=factors)
    assert_alike(read_recording(path, layout=Layout(units=units))[0], moving())


def test_a_current_is_not_divided_by_the_torque_constant(tmp_path):
    torque = write_csv(tmp_path / 'torque.csv', moving())
    current = write_csv(tmp_path / 'current.csv', moving(), names='t q dq i')
    assert_alike(read_recording(current, torque_constant=0.1, gear_ratio=100)[0], moving())
    assert_alike(read_recording(torque, layout=Layout(units={'effort': 'mA'}), torque_constant=5.0)
                 [0], moving(current=1e-3 * moving().current))
    assert_alike(read_recording(torque, torque_constant=0.1, gear_ratio=100)[0],
                 moving(current=0.1 * moving().current))


def test_joints_of_one_table_are_told_apart(tmp_path):
    columns = {}
    for k in (1, 2):
        part = moving(current=k * moving().current)
        columns.update({'t': part.time, f'q_{k}': part.position, f'tau_{k}': part.current})
    np.savez(tmp_path / 'arm.npz', **columns)
    assert recorded_joints(tmp_path / 'arm.npz') == ['1', '2']
    np.testing.assert_allclose(read_recording(tmp_path / 'arm.npz', '2')[0].current,
                               2 * moving().current)
    named, = read_recording(tmp_path / 'arm.npz', layout=Layout(
        {'position': 'q_2', 'effort': 'tau_2'}))
    np.testing.assert_allclose(named.current, 2 * moving().current)
    with pytest.raises(InputError, match="several joints, name one with --joint: '1', '2'"):
        read_recording(tmp_path / 'arm.npz')


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--columns', 'time'], 'SIGNAL=NAME'),
    (['--columns', 'when=t'], "no signal 'when'"),
    (['--columns', 'time=when'], "no column 'when'"),
    (['--unit', 'position=furlong'], 'rad, mrad, deg'),
    (['--unit', 'effort=furlong'], 'N, kN, lbf, A, mA'),
    (['--unit', 'current=%'], 'A, mA'),
    (['--unit', 'deg'], "--unit: 'deg' is not of the form SIGNAL=UNIT"),
    (['--columns', 'effort=tau,current=tau'], 'both effort and current')])
def test_errors_in_columns_arguments_say_what_is_valid(tmp_path, refuses, arguments, said):
    refuses(said, 'evaluate', write_csv(tmp_path / 'log.csv', moving()), *arguments)


@pytest.mark.parametrize(('unit', 'said'), [
    ('deg', 'for instance position=deg'), ('ms', 'given as SIGNAL=UNIT'),
    ('position:deg', 'for instance position=deg'), ('counts/4096', 'position=counts/4096')])
def test_a_unit_alone_is_that_of_effort(refuses, unit, said):
    refuses(said, 'refine', 'log.csv', '--unit', unit)


def test_columns_and_units_of_what_is_no_table_are_not_ignored(tmp_path, refuses):
    write_samples(tmp_path / 'bag', moving(300))
    for option, value in (('--columns', 'position=q_2'), ('--unit', 'position=deg,time=ms'),
                          ('--unit', 'position=deg,load=kN'), ('--rate', '100')):
        for tool in ('refine', 'evaluate', 'convert'):
            refuses('describe tables, and this is none', tool, tmp_path / 'bag', option, value)
    refuses('effort, which is in N·m, N or A', 'refine', tmp_path / 'bag', '--unit', 'effort=V')


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


def test_what_is_no_number_in_a_table_is_named_and_warns_of_nothing(tmp_path, refuses):
    one = moving()
    position = np.where(np.arange(2000) % 500 < 50, np.inf, one.position)
    path = write_csv(tmp_path / 'log.csv', one.with_(position=position))
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        samples, = read_recording(path)
    assert len(samples) == 1800
    path = write(tmp_path / 'none.csv', t=np.full(300, np.nan), q=one.position[:300],
                 tau=one.current[:300])
    refuses("column 't' holds no time", 'refine', path)


def test_commands_of_a_converted_recording_keep_their_unit(tmp_path):
    one = moving(command=moving().current)
    write_samples(tmp_path / 'bag', one, 0.1, 50.0)
    assert main(['convert', str(tmp_path / 'bag'), '--output', str(tmp_path / 'log.csv')]) == 0
    samples, = read_recording(tmp_path / 'log.csv', torque_constant=0.1, gear_ratio=50.0,
                              layout=Layout({}, {'effort': 'N·m', 'command': 'A'}))
    np.testing.assert_allclose(samples.command, samples.current, atol=1e-6)
