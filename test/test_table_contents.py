# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What tables hold besides time, position and effort, and in which units they hold it."""

import json
import math

import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording, Samples
from friction_comp.__main__ import main
from friction_comp.drive import Drive
from friction_comp.facts.motion import not_in_radians as angle_fault
from friction_comp.identification.curves import fit_steady_states
from friction_comp.model.friction_model import FrictionModel
from friction_comp.recordings import read_recording_with_info
from friction_comp.tables.columns import assign
from friction_comp.tables.table_recording import read_frame


def sliding(speed, coulomb=0.57, viscous=0.52, offset=0.0, height=0.0, speed_s=0.1):
    return (offset + viscous * speed + np.sign(speed) * (
        coulomb + height * np.exp(-np.abs(speed) / speed_s)))


SPEEDS = np.array([0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6])


def test_a_table_of_steady_states_gives_the_friction_with_intervals():
    speeds = np.concatenate((-SPEEDS, SPEEDS))
    inside = total = 0
    for seed in range(1, 40, 2):
        noise = 0.005 * np.random.default_rng(seed).normal(size=len(speeds))
        fit = fit_steady_states(speeds, sliding(speeds, offset=0.05) + noise, Drive(1.0, 1.0))
        for name, truth in (('coulomb', 0.57), ('viscous', 0.52), ('offset', 0.05)):
            total += 1
            inside += fit.intervals[name][0] <= truth <= fit.intervals[name][1]
    assert inside >= 0.85 * total       # 95 % less what choosing among curves costs
    fit = fit_steady_states(speeds, sliding(speeds, height=0.3) + noise, Drive(1.0, 1.0))
    assert fit.values['stribeck'] == pytest.approx(0.3, abs=0.05)
    assert fit.values['stribeck_speed'] == pytest.approx(0.1, rel=0.2)
    assert fit.left_out_rmse < 0.5 * fit.plain_rmse
    curve = fit.model.current(Samples(speeds, speeds, speeds, velocity=speeds))
    assert curve == pytest.approx(sliding(speeds, height=0.3), abs=0.02)
    skewed = sliding(speeds) + 0.1 * np.abs(speeds) + noise
    assert fit_steady_states(speeds, skewed, Drive(1.0, 1.0)).values['viscous_asymmetry'] == \
        pytest.approx(0.1, abs=0.02)


def test_refine_reads_a_table_of_steady_states(tmp_path, capsys):
    speeds = np.concatenate((-SPEEDS, SPEEDS))
    path = write(tmp_path / 'table.csv', velocity=1e3 * speeds, torque=sliding(speeds))
    output = tmp_path / 'out'
    assert main(['refine', str(path), '--unit', 'velocity=mm/s,effort=N', '--output',
                 str(output)]) == 0
    said = capsys.readouterr().out
    assert '0.5700 N ' in said
    assert '0.5200 N·s/m' in said
    assert 'rad' not in said
    page = (output / 'report.html').read_text()
    assert '0.5700 N<' in page
    assert 'N·m' not in page
    report = json.loads((output / 'report.json').read_text())
    assert report['friction']['coulomb'] == pytest.approx(0.57, abs=1e-6)
    model = FrictionModel.load(output / 'model.yaml')
    assert model.lookup_table['currents'] == pytest.approx(sliding(np.sort(speeds)).tolist())
    # One direction cannot tell Coulomb friction from an offset; too few rows are refused.
    write(path, velocity=SPEEDS, torque=sliding(SPEEDS))
    assert main(['refine', str(path), '--output', str(output)]) == 0
    assert 'in one direction only' in capsys.readouterr().out
    write(path, velocity=SPEEDS[:3], torque=sliding(SPEEDS[:3]))
    assert main(['refine', str(path), '--output', str(output)]) == 2


@pytest.mark.parametrize('follows', [False, True])
def test_the_effort_of_a_position_controller_follows_from_its_gains(tmp_path, follows):
    time, position, velocity = swing(300)
    target = {'target_position': position + 0.1, **({'target_velocity': velocity + 0.2}
                                                    if follows else {})}
    path = write(tmp_path / 'servo.csv', time=time, position=position, kp=np.full(300, 20.0),
                 **target)
    for gain in (20.0, 'kp'):
        (samples, info), = read_recording_with_info(path, layout=Layout(
            stiffness=gain, damping=0.5))
        np.testing.assert_allclose(
            samples.current[1:-1], 2.1 if follows else 2.0 - 0.5 * velocity[1:-1], atol=1e-3)
        assert any('target velocity' in note for note in info.notes) == follows
    with pytest.raises(InputError, match="no column 'gain'"):
        read_recording(path, layout=Layout(stiffness='gain'))


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_torque_behind_the_gear_is_the_load_with_either_sign(tmp_path, sign):
    time, position, velocity = swing()
    friction, carried = 2.0 * np.sign(velocity), 9.0 * np.sin(position)
    path = write(tmp_path / 'log.csv', time=time, position=position, velocity=velocity,
                 tau=friction + carried, link_torque=sign * carried)
    (samples, info), = read_recording_with_info(path)
    np.testing.assert_allclose(samples.current + samples.load, friction, atol=1e-9)
    assert any('is reversed' in note for note in info.notes) == (sign < 0)


@pytest.mark.slow
def test_an_idle_motor_moved_by_hand_shows_friction_in_torque(tmp_path, capsys):
    time = 0.005 * np.arange(6000)
    position = 0.8 * np.sin(time) * np.sin(0.23 * time)
    velocity = np.gradient(position, time)
    load = 1.4 * np.tanh(velocity / 0.01) + 0.9 * velocity
    load += 0.02 * np.random.default_rng(1).normal(size=len(time))
    path = write(tmp_path / 'log.csv', time=time, q=position, dq=velocity,
                 motor_current=0.0 * time, sensor_torque=load)
    assert main(['refine', str(path), '--output', str(tmp_path / 'out')]) == 0
    assert 'the motor was idle' in capsys.readouterr().out
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert report['unit'] == 'N·m'
    assert report['friction']['coulomb'] == pytest.approx(1.4, rel=0.03)
    assert report['friction']['viscous'] == pytest.approx(0.9, rel=0.05)


def test_a_data_frame_means_the_same_as_a_file():
    time, position, velocity = swing()
    friction, carried = 2.0 * np.sign(velocity), 9.0 * np.sin(position)
    notes = []
    samples = read_frame({'t': time, 'q': position, 'dq': velocity,
                                  'tau': friction + carried, 'link_torque': -carried,
                                  'tau_cmd': friction}, torque_constant=0.1, gear_ratio=10.0,
                                 notes=notes)
    np.testing.assert_allclose(samples.current + samples.load, friction, atol=1e-9)
    np.testing.assert_allclose(samples.command, friction)
    assert any('is reversed' in note for note in notes)
    samples = read_frame({'target': position + 0.1, 'q': position},
                                 Layout(rate=1000.0, stiffness=20.0))
    np.testing.assert_allclose(samples.time, time)
    np.testing.assert_allclose(samples.current, 2.0)


TURN = 2.0 * math.pi


@pytest.mark.parametrize('head', ['Time,Angle,Speed,M\n[ms],[deg],[deg/s],[Nm]\n',
                                  'Time [ms],Angle [deg],Speed [deg/s],M [Nm]\n'])
def test_columns_are_named_without_their_unit(tmp_path, head):
    time, position, velocity = swing(300)
    rows = zip(1e3 * time, np.degrees(position), np.degrees(velocity), velocity)
    (tmp_path / 'log.csv').write_text(head + '\n'.join(
        ','.join(f'{value:.12g}' for value in row) for row in rows) + '\n')
    samples, = read_recording(tmp_path / 'log.csv', layout=Layout(
        {'time': 'Time', 'position': 'angle', 'velocity': 'Speed', 'effort': 'M'}))
    np.testing.assert_allclose(samples.position, position, atol=1e-9)
    np.testing.assert_allclose(samples.velocity, velocity, atol=1e-9)
    with pytest.raises(InputError, match="no column 'Angel'"):
        read_recording(tmp_path / 'log.csv', layout=Layout({'position': 'Angel'}))


def test_a_name_that_two_units_share_is_asked():
    names = ['t', 'angle [deg]', 'angle [rad]', 'tau']
    with pytest.raises(InputError, match='no column'):
        assign(names, Layout({'position': 'angle'}), 'log')
    named = Layout(stiffness='kp', damping=1.0).naming([*names, 'kp [N·m/rad]'], 'log')
    assert (named.stiffness, named.damping) == ('kp [N·m/rad]', 1.0)


@pytest.mark.parametrize(('names', 'layout', 'said'), [
    (['t', 'Position [ticks]', 'tau'], Layout(), 'with --unit position=counts/4096'),
    (['t', 'Position [ticks]', 'tau'], Layout({'position': 'Position [ticks]'}),
     'with --unit position=counts/4096'),
    (['t [counts]', 'q', 'tau'], Layout(), "'counts' does not tell what a time of 1 is")])
def test_a_unit_that_is_not_known_is_asked(names, layout, said):
    with pytest.raises(InputError, match=said):
        assign(names, layout, 'log')


def test_a_percentage_stays_one(tmp_path):
    time, position, velocity = swing(300)
    path = write(tmp_path / 'log.csv', **{
        't': time, 'q': position, 'dq [%]': velocity, 'Torque [%]': 7.5 * velocity})
    (samples, info), = read_recording_with_info(path)
    assert (info.effort_unit, samples.velocity) == ('%', None)
    assert info.assumed == ('q in rad', 't in s')


def test_means_in_per_cent_stay_so(tmp_path, capsys):
    speed = np.array([-2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0] * 2)
    path = write(tmp_path / 'means.csv', **{
        'speed [rad/s]': speed, 'Torque [%]': 8.0 * np.sign(speed) + 3.0 * speed})
    assert main(['refine', str(path), '--output', str(tmp_path / 'out')]) == 0
    assert ' 8.000 % ' in capsys.readouterr().out


def grid(turn):
    """Return a swing as an encoder of 14 bits measures it, in units of which a turn has so many."""
    return np.round(swing()[1] / TURN * 2 ** 14) * turn / 2 ** 14


@pytest.mark.parametrize(('position', 'said'), [
    (grid(1.0), 'steps of 6.10352e-05'), (grid(360.0), 'steps of 0.0219727'), (grid(TURN), ''),
    (swing()[1], ''), (np.round(swing()[1], 4), ''), (np.round(np.degrees(swing()[1]), 2), ''),
    ((3.0 * swing()[1] / TURN + 0.9) % 1.0, 'jumps by 1,'),
    (np.degrees((3.0 * swing()[1] - 0.5) % TURN), 'jumps by 360,'),
    ((3.0 * swing()[1] - 0.5) % TURN, ''), (np.float32(swing()[1]).astype(float), '')])
def test_steps_and_jumps_of_a_position_tell_its_unit(position, said):
    fault = angle_fault(position)
    assert fault == '' if not said else said in fault


def test_a_position_that_is_not_in_rad_is_asked_unless_its_unit_is_given(tmp_path, refuses):
    time, _, velocity = swing()
    path = write(tmp_path / 'log.csv', t=time, q=grid(1.0), tau=velocity)
    refuses('give its unit, --unit position=deg, turn, ', 'refine', path)
    samples, = read_recording(path, layout=Layout(units={'position': 'turn'}))
    np.testing.assert_allclose(samples.position, grid(TURN), atol=1e-9)


@pytest.mark.parametrize('order', [[*range(299, -1, -1)], [113 * k % 300 for k in range(300)]])
def test_rows_in_no_order_of_time_are_sorted(tmp_path, order):
    """No clock is set back that often: most rows were left out as far off."""
    time, position, velocity = swing(300, 0.04)
    path = write(tmp_path / 'log.csv', t=time[order], q=position[order], tau=velocity[order],
                 load=position[order])
    (samples, info), = read_recording_with_info(path)
    assert any('in no order of time' in note for note in info.notes)
    assert not any('zero' in note or 'left out' in note for note in info.notes)
    for read, true in ((samples.time, time), (samples.position, position),
                       (samples.current, velocity), (samples.load, position)):
        np.testing.assert_allclose(read, true, atol=1e-9)


@pytest.mark.parametrize(('per_second', 'unit'), [(1e3, 'ms'), (1e6, 'µs'), (1e9, 'ns')])
def test_times_that_cannot_be_seconds_are_asked(tmp_path, refuses, per_second, unit):
    time, position, velocity = swing(300, 0.004)
    path = write(tmp_path / 'log.csv', t=np.round(per_second * time), q=position, tau=velocity)
    refuses(f'for instance --unit time={unit}, or time=s', 'refine', path)
    path = write(tmp_path / 'log.csv', t=1e3 * time, q=position, tau=velocity)
    refuses('has rows 4 apart, which show no motion if these are seconds', 'refine', path)
    for layout in (Layout(units={'time': 'ms'}), Layout(rate=250.0)):
        samples, = read_recording(path, layout=layout)
        np.testing.assert_allclose(samples.time, time, atol=1e-9)


def test_times_too_close_for_the_unit_in_their_name_are_asked(tmp_path, refuses):
    time, position, velocity = swing(300, 0.004)
    columns = {'time [ms]': time, 'q': position, 'tau': velocity}
    path = write(tmp_path / 'log.csv', **columns)
    refuses('too close for this unit: give its unit, for instance --unit time=s', 'refine', path)
    # Rows of several joints may follow each other at once.
    burst = np.repeat(time, 3) + np.tile([0.0, 1e-6, 2e-6], len(time))
    path = write(tmp_path / 'bus.csv', t=burst, motor_id=np.tile([1.0, 2.0, 3.0], len(time)),
                 q=np.repeat(position, 3), tau=np.repeat(velocity, 3))
    samples, = read_recording(path, joint='2')
    assert samples.sample_time == pytest.approx(0.004)


def test_steady_states_of_another_form_are_not_simply_trusted():
    speeds, alarms = np.concatenate((-SPEEDS, SPEEDS)), 0
    for seed in range(15):
        noise = 0.01 * np.random.default_rng(seed).normal(size=len(speeds))
        alarms += fit_steady_states(speeds, sliding(speeds) + noise, Drive(1.0, 1.0)).is_curved
        # Viscous friction of a lubricant that thins with the speed.
        thinning = 0.57 * np.sign(speeds) + 0.3 * np.arcsinh(speeds / 0.1)
        assert fit_steady_states(speeds, thinning + noise, Drive(1.0, 1.0)).is_curved
    assert alarms <= 2


LIFT = ['timestamp', 'lift.pos', 'lift.vel', 'lift.motor.effort_ticks', 'lift.motor.current',
        'lift.motor.effort_pct']


@pytest.mark.parametrize(('columns', 'units', 'used'), [
    ({}, {}, ('lift.motor.current', 1.0, 'current')),
    ({}, {'position': 'm', 'effort': '62N'}, ('lift.motor.current', 62.0, 'force')),
    ({'effort': 'lift.motor.current'}, {'effort': '62N'}, ('lift.motor.current', 62.0, 'force')),
    ({'effort': 'lift.motor.effort_ticks'}, {}, ('lift.motor.effort_ticks', 1.0, '')),
    ({'effort': 'lift.motor.effort_ticks'}, {'effort': '0.5N'},
     ('lift.motor.effort_ticks', 0.5, 'force'))])
def test_a_unit_does_not_change_which_column_is_used(columns, units, used):
    effort = next(c for c in assign(LIFT, Layout(columns, units), 'log').columns
                  if c.signal == 'effort')
    assert (effort.name, effort.factor, effort.dimension) == used


@pytest.mark.parametrize('name', ['x', '3', 'output', 'field.data'])
def test_the_unit_of_an_effort_whose_name_tells_none_is_asked(name):
    names = ['t', 'q', name]
    with pytest.raises(InputError, match=f'{name}.*--unit effort=N·m'):
        assign(names, Layout({'effort': name}), 'log')
    assert not assign(names, Layout({'effort': name}, {'effort': 'mA'}), 'log').notes[1:]
    assert assign(names, Layout({'current': name}), 'log').effort_is_current


@pytest.mark.parametrize(('ratio', 'told'), [(100.0, True), (1.0, False)])
def test_a_missing_gear_ratio_is_hinted_at(ratio, told):
    time, position, velocity = swing()
    carried, notes = 40.0 * np.sin(position), []
    read_frame({'t': time, 'q': position, 'dq': velocity, 'link_torque': -carried,
                        'tau': (carried + 1.2 * np.sign(velocity)) / ratio}, notes=notes)
    assert any('before a gear' in note for note in notes) == told
