# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What names and units of columns mean, and what is asked instead of guessed; no files."""

import math

import pytest

from friction_comp import InputError, Layout
from friction_comp.arm.urdf import match_names
from friction_comp.tables.columns import assign, parse_unit, read_name, unit_of
from friction_comp.terminal import in_own_units


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
    ('target_q_2', 'reference_position', '2', ''),
    ('Position demand value', 'reference_position', '', ''), ('tauDes', 'command', '', ''),
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
    ('velocity', 'deg', math.pi / 180.0),
    ('velocity', 'counts/100/s', 0.02 * math.pi), ('velocity', '1/min', math.pi / 30.0),
    ('effort', 'kN·m', 1e3), ('effort', 'N cm', 0.01), ('effort', 'lbft', 1.3558179),
    ('effort', '-1Nm', -1.0), ('effort', '2.69mA', 2.69e-3), ('effort', 'kgf·cm', 0.0980665),
    ('time', 'µs', 1e-6), ('time', '0.01s', 0.01), ('load', 'mNm', 1e-3),
    # What a signal cannot have, or nobody knows.
    ('position', 'A', None), ('effort', 'rad', None), ('effort', 'V', None), ('load', 'A', None),
    ('position', 'counts/0', None), ('time', 'counts/100', None), ('effort', '0mA', None),
    ('velocity', 'rad/s/s', None),
    ('effort', 'Nm/Nm/s', None), ('position', '', None), ('position', 'furlong', None)])
def test_units_have_a_factor_before_them_and_a_time_behind(signal, text, factor):
    unit = unit_of(signal, text)
    assert unit is None if factor is None else unit.factor == pytest.approx(factor)
    assert parse_unit('V') is None


@pytest.mark.parametrize('unit', ['V', '%', '0.1 %', 'counts', 'PWM', 'mA', '-1Nm', 'kgf·cm'])
def test_an_effort_may_be_in_units_that_stay_as_they_are(unit):
    assert Layout(units={'effort': unit}).units == {'effort': unit}


UR = ['timestamp', *(f'{name}_{k}' for name in ('actual_q', 'actual_qd', 'actual_current')
                     for k in (0, 1)), 'target_moment_0', 'actual_robot_current']
READ = [f'{what}_{k}' for what in ('pos_read', 'curr') for k in (1, 2)]
BOTH = ['t', *(f'{what}{k}' for what in ('Position', 'Torque', 'Cur') for k in (1, 2))]


@pytest.mark.parametrize(('names', 'layout', 'joints', 'chosen', 'used'), [
    (UR, Layout({'position': 'actual_q_1', 'current': 'actual_current_1'}), ['0', '1'], '1',
     # A commanded torque says nothing beside a current without the torque constant.
     {('velocity', '1'): 'actual_qd_1', ('effort', '0'): 'actual_current_0', ('command', '0'): ''}),
    # Names that say nothing are siblings by their numbers; so they are where words differ.
    (['t', 'x7', 'x8', 'y7', 'y8'], Layout({'position': 'x8', 'effort': 'y8'}, {'effort': 'Nm'}),
     ['7', '8'], '8', {('effort', '7'): 'y7'}),
    (READ, Layout({'position': 'pos_read_2', 'effort': 'curr_2'}, rate=1.0), ['1', '2'], '2',
     {('effort', '1'): 'curr_1'}),
    # The current of one joint, beside torques, is named for all.
    *((BOTH, Layout({signal: 'Cur2'}), ['1', '2'], '2', {
        ('effort', '1'): 'Cur1', ('effort', '2'): 'Cur2'}) for signal in ('current', 'effort')),
    # The user may name the joint; alone, it needs no name.
    (UR, Layout({'position': 'actual_q_1', 'current': 'actual_current_1'}, joint='elbow'),
     ['0', 'elbow'], 'elbow', {}),
    (['t', 'q', 'tau'], Layout(joint='elbow'), ['elbow'], None, {}),
    (['t', 'q_2', 'tau_2'], Layout({'position': 'q_2'}), [''], None, {}),
    # The only effort is that of the only position; one without effort is no joint beside others.
    (['t', 'position', 'knee_moment'], None, [''], None, {('effort', ''): 'knee_moment'}),
    (['time', 'q2', 'dq2', 'q2_tau_J_residual'], None, ['2'], None,
     {('effort', '2'): 'q2_tau_J_residual'}),
    (['t', 'q_1', 'tau_1', 'base_position'], None, ['1'], None, {})])
def test_columns_are_told_by_joint(names, layout, joints, chosen, used):
    use = assign(names, layout, 'log')
    assert (use.joints, use.chosen) == (joints, chosen)
    for (signal, joint), name in used.items():
        assert getattr(use.of(signal, joint), 'name', '') == name


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
    effort = assign(LIFT, Layout(columns, units), 'log').of('effort', 'lift' * (not columns))
    assert (effort.name, effort.factor, effort.dimension) == used


def test_a_target_has_the_unit_of_what_it_is_the_target_of():
    use = assign(['timestamp_ms', 'Present Position', 'Present Current', 'Goal Current'],
                 Layout(units={'position': 'counts/4096', 'current': '2.69mA'}), 'log')
    assert use.of('command', '').factor == use.of('effort', '').factor == pytest.approx(2.69e-3)


@pytest.mark.parametrize(('names', 'layout', 'said'), [
    (['q', 'tau'], None, '--rate HZ'),
    (['t', 'target_position', 'q'], None, '--stiffness and --damping'),
    (['t', 'q', 'tau_cmd'], None, 'a command only if the drive is known to follow it'),
    (['tiempo', 'giro', 'par'], None, 'which column is the time, the position, the effort or '
     'current? Name it with --columns time=NAME,position=NAME,effort=NAME'),
    (['t', 'angle [deg]', 'angle [rad]', 'tau'], Layout({'position': 'angle'}), 'no column'),
    (['t', 'motor_pos', 'joint_pos', 'tau'], None, "which column is the position, 'motor_pos' or "
     "'joint_pos'? Name it with --columns position=motor_pos"),
    (['t', 'Position [ticks]', 'tau'], Layout({'position': 'Position [ticks]'}),
     'with --unit position=counts/4096'),
    (['t', 'q [deg]', 'force [N]'], None, '--unit effort=0.1Nm'),
    (['t', 'q [mm]', 'torque [Nm]'], None, '--unit effort=628N'),
    (['t [counts]', 'q', 'tau'], None, "'counts' does not tell what a time of 1 is")])
def test_what_is_not_clear_is_asked_with_the_remedy(names, layout, said):
    with pytest.raises(InputError) as error:
        assign(names, layout, 'log')
    assert said in str(error.value)


def test_what_nothing_depends_on_is_not_asked_and_may_be_declared_absent():
    names = ['t', 'q', 'dq', 'tau', 'tau_ext', 'motor temp [C]', 'rotor temp [C]']
    use = assign(names, Layout({'velocity': '', 'load': ''}), 'log')
    assert {c.signal for c in use.columns} == {'time', 'position', 'effort'}
    assert any('--columns temperature=motor temp [C]' in note for note in use.notes)


def test_a_name_may_be_given_without_its_unit():
    assert Layout({'position': 'Q'}).naming(['t', 'q [deg]'], 'log').columns == {
        'position': 'q [deg]'}


@pytest.mark.parametrize('name', ['x', '3', 'output', 'field.data'])
def test_the_unit_of_an_effort_whose_name_tells_none_is_asked(name):
    names = ['t', 'q', name]
    with pytest.raises(InputError, match=f'{name}.*--unit effort=N·m'):
        assign(names, Layout({'effort': name}), 'log')
    use = assign(names, Layout({'effort': name}, {'effort': 'mA'}), 'log')
    assert use.of('effort', '').factor == pytest.approx(1e-3)
    assert assign(names, Layout({'current': name}), 'log').effort_is_current


@pytest.mark.parametrize(('name', 'said'), [('hip_cmd_Nm', True), ('hip_tau_Nm', False)])
def test_an_effort_that_was_asked_for_is_no_measurement(name, said):
    notes = assign(['time', 'hip_angle', 'hip_cmd_Nm', 'hip_tau_Nm'],
                   Layout({'effort': name}), 'log.csv').notes
    assert any('asked for, not measured' in note for note in notes) == said


def test_a_linear_axis_is_reported_in_metres_and_newtons():
    for units in ({'position': 'mm', 'effort': 'N'}, {'effort': 'N'}):
        assert assign(['t', 'pos', 'force'], Layout(units=units), 'log').linear
    assert in_own_units({'a': ['3 N·m·s/rad', 2.0]}, True) == {'a': ['3 N·s/m', 2.0]}
    assert in_own_units('Cogging: 628.3 times a turn', True) == 'Cogging: 100 times a metre'
    assert in_own_units('3 N·m', False) == '3 N·m'


def test_numbered_columns_are_the_joints_of_a_urdf_in_order():
    arm = ['shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint']
    assert match_names(['0', '1', '2'], arm, 'arm.urdf')[0] == dict(zip('012', arm))
    # Counting from 0, number 1 is the second joint, not joint_1.
    numbered = ['joint_1', 'joint_2', 'joint_3']
    assert match_names(['0', '1', '2'], numbered, 'arm.urdf')[0]['1'] == 'joint_2'


@pytest.mark.parametrize(('arguments', 'said'), [
    (['--columns', 'time'], 'SIGNAL=COLUMN'), (['--columns', 'when=t'], "no signal 'when'"),
    (['--columns', 'time=when'], "no column 'when'"),
    (['--unit', 'position=furlong'], 'rad, mrad, deg'),
    (['--unit', 'effort=furlong'], 'N, kN, lbf, A, mA'), (['--unit', 'current=%'], 'A, mA'),
    (['--unit', 'ms'], "--unit: 'ms' is not of the form SIGNAL=UNIT"),
    (['--columns', 'effort=tau,current=tau'], 'both effort and current')])
def test_errors_in_arguments_say_what_is_valid(tmp_path, refuses, arguments, said):
    (tmp_path / 'log.csv').write_text('t,q,dq,tau\n0,0,0,0\n')
    refuses(said, 'evaluate', tmp_path / 'log.csv', *arguments)


@pytest.mark.parametrize('unit', ['deg', 'position:deg', 'counts/4096'])
def test_a_unit_alone_is_that_of_effort(refuses, unit):
    refuses(f'for instance position={unit.split(":")[-1]}', 'refine', 'log.csv', '--unit', unit)
