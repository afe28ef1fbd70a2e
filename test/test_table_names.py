# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a name, a unit and a file of a table mean, and what is asked or refused instead."""

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest
from recording_maker import DATA
from scipy.io import savemat
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.recordings import read_recording_with_info
from friction_comp.tables.columns import read_name
from friction_comp.tables.table_files import Table
from friction_comp.tables.units import parse_unit, unit_of

CASES = DATA.with_name('cases')


@pytest.mark.parametrize(('name', 'signal', 'joint', 'unit'), [
    ('time', 'time', '', ''), ('timestamp_ms', 'time', '', 'ms'), ('time [s]', 'time', '', 's'),
    ('time_since_start', 'time', '', ''), ('header.stamp.sec', 'time', '', ''),
    ('rig:timestamp', 'time', '', ''), ('time_constant', '', '', ''),
    ('actual_q_2', 'position', '2', ''), ('a1 position [rad]', 'position', 'a1', 'rad'),
    ('/left/elbow.position', 'position', '/left/elbow', ''), ('encoder_rad', 'position', '', 'rad'),
    ('/joint_states/elbow/position', 'position', 'elbow', ''),
    ('knee[pack]:angle', 'position', 'knee[pack]', ''), ('position_m', 'position', '', 'm'),
    ('q_m', 'position', 'm', ''), ('angle in deg', 'position', '', 'deg'),
    ('/Drive/LeftVelocityRadPerSec', 'velocity', 'Drive/Left', 'Rad/Sec'),
    ('joint_vel_rad_s', 'velocity', '', 'rad/s'), ('actual_qd_1', 'velocity', '1', ''),
    ('tau_Nm', 'effort', '', 'Nm'), ('lift.motor.effort_ticks', 'effort', 'lift.motor', 'ticks'),
    ('effort_pct', 'effort', '', '%'), ('force_N', 'effort', '', 'N'),
    ('Present Current', 'current', '', ''), ('mot_cur_meas_mA', 'current', '', 'mA'),
    ('i_q', 'current', '', ''), ('batt_curr', '', '', ''), ('current_dur_ms', '', '', 'ms'),
    ('Goal Current', 'command', '', ''), ('tau_cmd', 'command', '', ''),
    ('command', 'command', '', ''), ('command [rad]', 'reference_position', '', 'rad'),
    ('target_q_2', 'reference_position', '2', ''), ('posDes', 'reference_position', '', ''),
    ('sensor_torque', 'load', '', ''), ('output_torque [Nm]', 'link_torque', '', 'Nm'),
    ('Present Load', '', '', ''), ('joint_temperatures_0', 'temperature', '0', ''),
    ('d', 'direction', '', ''), ('electrical_angle', '', '', ''), ('acc', '', '', '')])
def test_a_name_tells_signal_joint_and_unit(name, signal, joint, unit):
    reading = read_name(name)
    assert reading.signal == signal
    if signal:
        assert (reading.joint, reading.unit) == (joint, unit)


@pytest.mark.parametrize(('signal', 'text', 'factor'), [
    ('position', 'deg', math.pi / 180.0), ('position', 'counts/4096', 2.0 * math.pi / 4096),
    ('position', 'inch', 0.0254), ('velocity', '0.229rpm', 0.229 * math.pi / 30.0),
    ('velocity', 'deg', math.pi / 180.0), ('velocity', 'rad·s⁻¹', 1.0),
    ('velocity', 'counts/100/s', 0.02 * math.pi), ('velocity', '1/min', math.pi / 30.0),
    ('effort', 'kN·m', 1e3), ('effort', 'N cm', 0.01), ('effort', 'lbft', 1.3558179),
    ('effort', '-1Nm', -1.0), ('effort', '2.69mA', 2.69e-3), ('effort', 'kgf·cm', 0.0980665),
    ('time', 'µs', 1e-6), ('time', 'counts/100', 0.01), ('load', 'mNm', 1e-3)])
def test_units_have_factors_products_and_quotients(signal, text, factor):
    assert unit_of(signal, text).factor == pytest.approx(factor)


@pytest.mark.parametrize(('signal', 'text'), [
    ('position', 'A'), ('effort', 'rad'), ('effort', 'V'), ('time', 'counts/0'), ('load', 'A')])
def test_a_signal_cannot_have_the_unit_of_another(signal, text):
    assert unit_of(signal, text) is None
    assert parse_unit('furlong') is None


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
    with pytest.importorskip('h5py').File(path, 'w') as file:
        file.update({'states/time': t, 'states/q': np.vstack((q, 2.0 * q)), 'states/tau': np.vstack(
            (tau, 2.0 * tau)), 'states/image': np.zeros((9, 9, 9))})


def decimal_commas(path, t, q, tau):
    text = '\n'.join(['time;Winkel;tau [mNm]', *(f'{a:.3f};{b:.9f};{1e3 * c:.9f}'
                                               for a, b, c in zip(t, q, tau))]).replace('.', ',')
    path.write_bytes(gzip.compress(text.encode('utf-16')))


ONE, OTHER, NAMED = {}, {'joint': '1'}, {'layout': Layout({'position': 'Winkel'})}


@pytest.mark.parametrize(('name', 'save', 'given'), [
    ('log.json', records, ONE), ('log.jsonl', json_lines, OTHER), ('log.csv', dates, ONE),
    ('log.parquet', parquet, {'joint': '0'}), ('log.h5', hdf5, OTHER),
    ('log.csv.gz', decimal_commas, NAMED),
    ('log.npz', lambda path, t, q, tau: np.savez(path, t=t, q=np.column_stack((q, -q)), tau=(
        np.column_stack((tau, -tau))), other=np.zeros(7)), OTHER),
    ('log.npy', lambda path, t, q, tau: np.save(path, np.rec.fromarrays(
        (t, q, tau), names='t,q,tau')), ONE),
    ('log.mat', lambda path, t, q, tau: savemat(path, {'log': {
        'time': t, 'note': 'knee', 'joint': {'q': q[:, None], 'tau': tau}}}), ONE)])
def test_every_kind_of_file_holds_the_same(tmp_path, name, save, given):
    time, position, velocity = swing()
    save(tmp_path / name, time, position, velocity)
    if save is json_lines:
        given = {'layout': Layout({'position': 'q_2', 'effort': 'tau_2'})}
    samples, = read_recording(tmp_path / name, **given)
    np.testing.assert_allclose(samples.time, time, atol=2e-6)
    np.testing.assert_allclose(samples.position, position, atol=1e-8)
    np.testing.assert_allclose(samples.current, velocity, atol=1e-8)


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


def test_times_that_begin_anew_are_episodes(tmp_path):
    time, position, velocity = swing(400, 0.01)
    path = write(tmp_path / 'log.csv', time=np.tile(time, 3), q=np.tile(position, 3),
                 tau=np.tile(velocity, 3))
    (samples, info), = read_recording_with_info(path)
    assert len(samples.segments()) == 3
    assert any('times begin anew 2 times' in note for note in info.notes)


def external(path, t, q):
    secret = path.with_name('secret')
    secret.write_bytes(bytes(range(256)) * 20)
    with pytest.importorskip('h5py').File(path, 'w') as file:
        file.update({'time': t, 'position': q})
        file.create_dataset('effort', (len(t),), 'f8', external=[(str(secret), 0, 8 * len(t))])


def linked(path, t, q):
    h5py = pytest.importorskip('h5py')
    with h5py.File(path.with_name('other.h5'), 'w') as file:
        file['effort'] = q
    with h5py.File(path, 'w') as file:
        file.update({'time': t, 'position': q, 'effort': h5py.ExternalLink('other.h5', 'effort')})


def sparse(path, t, q):
    with pytest.importorskip('h5py').File(path, 'w') as file:
        for name in ('time', 'position', 'effort'):
            file.create_dataset(name, (10**9,), 'f8', chunks=(1000,))


def text(line):
    def save(path, t, q):
        path.write_text('\n'.join(['time;q;tau [mNm]', *(
            f'{a:.3f};{b:.6f};1.5' for a, b in zip(t, q)), line]))
    return save


@pytest.mark.parametrize(('name', 'save', 'said'), [
    ('log.h5', external, 'which column is the effort'), ('log.h5', linked, 'which column is the'),
    ('log.h5', sparse, 'would unpack to'),
    ('log.csv.gz', lambda path, t, q: path.write_bytes(gzip.compress(b'1' * 10_000_000)),
     'a line has more than'),
    ('log.csv', text('9,0;0.1;3,314'), "'9,0' is not a number"),
    ('log.csv', text('9.0;0.1;3,314'), "column 'tau [mNm]': '3,314' is not a number"),
    ('log.csv', lambda path, t, q: path.write_text('\n'.join(['time;q;tau', *(
        f'{k};{k};{k + 1},{k + 100}' for k in range(50))])), 'decimal mark, or of thousands'),
    ('log.csv', lambda path, t, q: path.write_text('time,q,tau\n'), 'has no row below'),
    ('log.csv', lambda path, t, q: write(path, time=t, q=q, tau=np.round(30.0 * q)),
     "column 'tau' holds whole numbers: give its unit, --unit effort=2.69mA"),
    ('log.npz', lambda path, t, q: path.write_text('time,q,tau'), 'not a readable table'),
    ('log.mat', lambda path, t, q: path.write_text('time,q,tau'), 'not a readable table')])
def test_what_is_no_table_or_means_two_things_is_refused(tmp_path, name, save, said):
    save(tmp_path / name, *swing()[:2])
    with pytest.raises(InputError, match='.*') as error:
        read_recording(tmp_path / name)
    assert said in str(error.value)


def test_a_wide_sheet_is_read_in_time_that_grows_with_its_columns(tmp_path):
    cells = ','.join(['0'] * 5000)
    (tmp_path / 'log.csv').write_text('\n'.join([
        'time,q,tau,' + ','.join(f'x_{k}' for k in range(5000)) + ',note', *(
            f'{t:.2f},{math.sin(t)},{math.cos(t)},{cells},"a, quoted cell"'
            for t in 0.01 * np.arange(100))]))
    assert len(Table(tmp_path / 'log.csv').names) == 5004
    assert len(read_recording(tmp_path / 'log.csv')[0]) == 100


@pytest.mark.skipif(not CASES.is_dir(), reason='inputs from public reports are not here')
@pytest.mark.parametrize(('file', 'layout', 'fact'), [
    ('csv_trailing_commas/log.csv', {}, ('', 'N·m', 12000)),
    ('lift_units/lift.csv', {'units': {'position': 'm', 'velocity': 'm/s', 'effort': '62N'}},
     ('lift', 'N', 1500)),
    ('lift_units/lift.csv', {'columns': {'effort': 'lift.motor.current'},
                             'units': {'position': 'm', 'effort': '62N'}}, ('', 'N', 1500)),
    ('volts/log.csv', {'columns': {'effort': '/Drive/LeftAppliedVolts'}, 'joint': 'Drive/Left'},
     ('Drive/Left', 'V', 1260)),
    ('gear_dynamometer/dyno.csv', {'units': {'effort': '100Nm'}}, ('', 'N·m', 4000)),
    ('one_joint_of_arm_trusts/robot_data.csv', {'joint': '2'}, ('2', 'A', None)),
    ('position_only_servo/servo.csv', {'stiffness': 20.0, 'damping': 0.5},
     ('', 'N·m', 2000))])
def test_inputs_of_public_reports_mean_what_they_say(file, layout, fact):
    given = Layout(**layout)
    (samples, info), = read_recording_with_info(
        CASES / file, given.joint if fact[0] == '2' else None, layout=given)
    unit = info.effort_unit or ('A' if info.effort_is_current else 'N' if info.linear else 'N·m')
    assert (info.joint, unit) == fact[:2]
    assert fact[2] in (None, len(samples))
