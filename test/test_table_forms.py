# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables as other software writes them: names and units."""

import math

from helpers import printed_by
import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.arm.urdf import match_names
from friction_comp.column_names import read_name
from friction_comp.column_values import date_in_seconds
from friction_comp.columns import assign
from friction_comp.recordings import read_recording_with_info, recorded_joints
from friction_comp.recordings.row_times import fresh_rows, spread_rounded
from friction_comp.units import in_own_units, parse_unit, unit_of

UR = ['timestamp', *(f'{name}_{k}' for name in ('actual_q', 'actual_qd', 'actual_current')
                     for k in (0, 1)), 'target_moment_0', 'actual_robot_current']


@pytest.mark.parametrize(('name', 'signal', 'joint', 'unit'), [
    ('times', 'time', '', ''), ('timestamp_ms', 'time', '', 'ms'),
    ('positions_2', 'position', '2', ''), ('arm_1_position', 'position', 'arm_1', ''),
    ('a1 position [rad]', 'position', 'a1', 'rad'), ('posAct', 'position', '', ''),
    ('actual_q_2', 'position', '2', ''), ('actual_qd_2', 'velocity', '2', ''),
    ('actual_current_2', 'current', '2', ''), ('target_q_2', 'reference_position', '2', ''),
    ('joint_temperatures_2', 'temperature', '2', ''), ('Present Position', 'position', '', ''),
    ('Present Current', 'current', '', ''), ('Goal Current', 'command', '', ''),
    ('observation.state[0]', 'position', '0', ''), ('action[3]', 'reference_position', '3', ''),
    ('tau_meas', 'effort', '', ''), ('sensor_torque', 'load', '', ''),
    ('link_torque', 'link_torque', '', ''), ('elbow.position', 'position', 'elbow', ''),
    ('/joint_states/elbow/position', 'position', 'elbow', ''),
    # Kinds that nobody gave as examples.
    ('Joint 3 Angle (deg)', 'position', 'Joint 3', 'deg'),
    ('r_knee_moment', 'effort', 'r_knee', ''), ('jointCurrent3', 'current', '3', ''),
    ('left_hip_yaw_vel', 'velocity', 'left_hip_yaw', ''),
    ('angular_velocity', 'velocity', '', ''), ('tau_J_0', 'effort', '0', ''),
    ('joint_pos[3]', 'position', '3', ''), ('applied_torque[3]', 'effort', '3', ''),
    ('field.effort0', 'effort', '0', ''), ('PosRef', 'reference_position', '', ''),
    ('tau_h', 'effort', 'h', ''),
    # What looks like a signal and is none.
    ('position_error', '', '', ''), ('target_qdd_0', '', '', ''), ('Present Load', '', '', ''),
    ('torque_limit', '', '', ''), ('actual_execution_time', '', '', ''),
    # The unit tells the quantity where no word does.
    ('encoder_rad', 'position', '', 'rad'), ('Joint 2 (deg)', 'position', 'Joint 2', 'deg'),
    ('motor_rpm', 'velocity', '', 'rpm'), ('M1 [Nm]', 'effort', 'M1', 'Nm'),
    ('ms_today', 'time', '', 'ms'), ('micros', 'time', '', 'micros'),
    ('cmd_deg', 'reference_position', '', 'deg'),
    ('command [rad]', 'reference_position', '', 'rad'),
    # It may stand anywhere, in any spelling.
    ('pos_deg_1', 'position', '1', 'deg'), ('tau_Nm_3', 'effort', '3', 'Nm'),
    ('TORQUE_NM', 'effort', '', 'Nm'), ('current_mA_2', 'current', '2', 'mA'),
    ('i_mA', 'current', '', 'mA'), ('vel_deg_s', 'velocity', '', 'deg/s'),
    ('velocity_rad_per_s', 'velocity', '', 'rad/s'), ('tau_N_m', 'effort', '', 'N·m'),
    ('angle in deg', 'position', '', 'deg'), ('timeMs', 'time', '', 'ms'),
    ('Torque [%]', 'effort', '', '%'), ('Position [ticks]', 'position', '', 'ticks'),
    # What is in brackets may be something else.
    ('Position (actual)', 'position', '', ''), ('position[elbow]', 'position', 'elbow', ''),
    # Words that nothing separates; a time since something; estimates.
    ('qdes', 'reference_position', '', ''), ('actpos_2', 'position', '2', ''),
    ('tauact', 'effort', '', ''), ('time_since_start', 'time', '', ''),
    ('header.stamp.sec', 'time', '', ''), ('pos_estimate', 'position', '', ''),
    ('id_1_present_position', 'position', 'id_1', ''), ('eff_2', 'effort', '2', ''),
    # Abbreviations of firmware; what is of a battery, a gain, or the largest, is none.
    ('mot_ang', 'position', '', ''), ('ank_ang', 'position', 'ank', ''),
    ('mot_cur', 'current', '', ''), ('batt_curr', '', '', ''), ('ki_pos', '', '', ''),
    ('peak_torque_norm', '', '', ''), ('current_dur_ms', '', '', ''),
    ('current_state', '', '', ''), ('cur_mode', '', '', ''), ('cur_pos', 'position', '', ''),
    ('joint_state_current', 'current', '', ''), ('ang_vel', 'velocity', '', ''),
    # German logs.
    ('Zeit [ms]', 'time', '', 'ms'), ('Zeitstempel', 'time', '', ''),
    ('Winkel [°]', 'position', '', '°'), ('Winkel_Ellenbogen', 'position', 'Ellenbogen', ''),
    ('Istposition', 'position', '', ''), ('Position Soll [deg]', 'reference_position', '', 'deg'),
    ('Drehzahl [1/min]', 'velocity', '', '1/min'), ('Drehmoment (Nm)', 'effort', '', 'Nm'),
    ('Strom_A', 'current', '', 'A'), ('Position (Grad)', 'position', '', 'Grad'),
    # No unit, and no signal.
    ('theta_in', 'position', 'in', ''), ('q_m', 'position', 'm', ''), ('phase_A', '', '', ''),
    ('error_deg', '', '', ''),
    # A preposition before a unit is no inch; a unit also holds for a signal that the user names.
    ('Force (in N)', 'effort', '', 'N'), ('position (in deg)', 'position', '', 'deg'),
    ('Torque (in lb)', 'effort', '', 'in lb'), ('Laser (in mm)', '', '', 'mm'),
    ('stroke_mm', '', '', 'mm'), ('latency_ms', '', '', 'ms'), ('id [A]', '', '', 'A'),
    ('us_1', '', '', 'us'), ('test', '', '', ''), ('bus_current', '', '', '')])
def test_a_name_tells_signal_joint_and_unit(name, signal, joint, unit):
    reading = read_name(name)
    assert (reading.signal, reading.joint, reading.unit) == (signal, joint, unit)


@pytest.mark.parametrize(('text', 'signal', 'factor'), [
    ('2.69mA', 'current', 2.69e-3), ('0.229rpm', 'velocity', 0.229 * math.pi / 30.0),
    ('inch', 'position', 0.0254), ('inch/min', 'velocity', 0.0254 / 60.0),
    ('kip', 'effort', 4448.2216), ('kN·m', 'effort', 1e3), ('lbf·in', 'effort', 0.1129848),
    ('Ncm', 'effort', 1e-2), ('Nmm', 'effort', 1e-3), ('mNm', 'effort', 1e-3),
    ('lbft', 'load', 1.3558179), ('ozin', 'effort', 7.0615518e-3), ('kg*cm', 'effort', 0.0980665),
    ('U/min', 'velocity', math.pi / 30.0), ('1/min', 'velocity', math.pi / 30.0),
    ('deg', 'velocity', math.pi / 180.0), ('counts/4096', 'position', 2.0 * math.pi / 4096.0),
    ('counts/100', 'time', 0.01), ('-1Nm', 'link_torque', -1.0), ('0.01mm', 'position', 1e-5)])
def test_units_have_factors_products_and_quotients(text, signal, factor):
    assert unit_of(signal, text).factor == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize('text', ['V', 'rad/s/s', 'counts/0', '0mA', 'Nm/Nm/s', ''])
def test_what_is_no_unit_is_none(text):
    assert parse_unit(text) is None


@pytest.mark.parametrize(('position', 'factor'), [
    ('Laser (in mm)', 1e-3), ('stroke_mm', 1e-3), ('Reading [deg]', math.pi / 180.0), ('x7', 1.0)])
def test_a_column_that_the_user_names_has_the_unit_in_its_name(position, factor):
    use = assign(['time', position, 'Force (in V)', 'Force (in N)'],
                 Layout({'position': position}), 'log')
    assert use.of('position', '').factor == pytest.approx(factor)
    assert use.linear == (factor == 1e-3)
    # Of one quantity in two units, the one that is a unit of it.
    assert use.of('effort', '').name == 'Force (in N)'
    with pytest.raises(InputError, match="'V' does not tell what a position of 1 is"):
        assign(['time', 'Laser (in V)', 'tau'], Layout({'position': 'Laser (in V)'}), 'log')


@pytest.mark.parametrize(('names', 'layout', 'linear'), [
    ('position_m,force_N', {}, True), ('q_m,tau_N', {}, True), ('pos_m,kraft', {}, True),
    ('position_m,velocity_mps,current_A', {}, True), ('axis_position_1_m,effort_1_N', {}, True),
    ('x_m,f_N', {'position': 'x_m', 'effort': 'f_N'}, True),
    ('q_m,tau_m', {}, False), ('q_m,tau_m,force_N', {}, False), ('theta_m,force_N', {}, False),
    ('position_m,current_A', {}, False)])
def test_m_is_metres_beside_a_force_and_motor_beside_a_torque(names, layout, linear):
    use = assign(['time', *names.split(',')], Layout(layout), 'log')
    position = use.columns[1]
    assert (use.linear, position.unit) == (linear, 'm' if linear else 'rad')
    assert position.stated == linear
    assert 'm' not in use.joints or not linear


def test_siblings_of_named_columns_are_other_joints():
    use = assign(UR, Layout({'position': 'actual_q_1', 'current': 'actual_current_1'}), 'log')
    assert (use.joints, use.chosen) == (['0', '1'], '1')
    assert use.of('velocity', '1').name == 'actual_qd_1'
    assert use.of('effort', '0').name == 'actual_current_0'
    # A commanded torque says nothing beside a current without the torque constant.
    assert use.of('command', '0') is None
    # Names that say nothing are siblings by their numbers.
    layout = Layout({'position': 'x8', 'effort': 'y8'}, {'effort': 'Nm'})
    other = assign(['t', 'x7', 'x8', 'y7', 'y8'], layout, 'log')
    assert (other.joints, other.chosen, other.of('effort', '7').name) == (['7', '8'], '8', 'y7')
    # So they are where words beside the numbers differ.
    read = [f'{what}_{k}' for what in ('pos_read', 'curr') for k in (1, 2)]
    motor = assign(read, Layout({'position': 'pos_read_2', 'effort': 'curr_2'}, rate=1.0), 'log')
    assert len(motor.joints) == 2
    assert motor.of('effort', motor.joints[0]).name == 'curr_1'
    # The user may name the joint.
    layout = Layout({'position': 'actual_q_1', 'current': 'actual_current_1'}, joint='elbow')
    assert assign(UR, layout, 'log').joints == ['0', 'elbow']
    assert assign(['t', 'q', 'tau'], Layout(joint='elbow'), 'log').joints == ['elbow']
    # Alone, a joint needs no name.
    assert assign(['t', 'q_2', 'tau_2'], Layout({'position': 'q_2'}), 'log').joints == ['']


def test_an_effort_is_of_the_joint_that_its_name_gives():
    # A joint may be called by a quantity: phi is an angle elsewhere.
    use = assign(['t', 'phi_meas_ang_pos', 'phi_meas_ang_vel', 'phi_meas_tau', 'tail_meas_ang_pos',
                  'tail_meas_tau', 'boom_meas_ang_pos', 'temperature'], None, 'log')
    assert use.joints == ['phi', 'tail']
    assert [use.of('effort', name).name for name in use.joints] == ['phi_meas_tau', 'tail_meas_tau']
    assert use.of('velocity', 'phi').name == 'phi_meas_ang_vel'
    assert use.of('velocity', 'tail') is None
    assert use.of('temperature', 'tail').name == 'temperature'
    assert any('motion of boom_meas_ang_pos is left out' in note for note in use.notes)
    assert assign(['t', 'phi', 'phi_vel', 'phi_tau'], None, 'log').joints == ['']
    # What names no joint is not that of all beside efforts that name theirs.
    use = assign(['t', 'q1', 'q2', 'tau1', 'tau2', 'torque'], None, 'log')
    assert [use.of('effort', name).name for name in use.joints] == ['tau1', 'tau2']
    with pytest.raises(InputError, match="which effort is of which joint.*'tau_right', 'torque'"):
        assign(['t', 'q1', 'q2', 'tau_left', 'tau_right', 'torque'], None, 'log')
    # A torque beside a current that says that it is measured may be a request.
    use = assign(['t', 'mot_ang_rad', 'tau_Nm', 'mot_cur_meas_mA'], None, 'log')
    assert use.of('effort', '').name == 'mot_cur_meas_mA'
    assert assign(['t', 'q', 'i', 'tau'], None, 'log').of('effort', '').name == 'tau'
    use = assign(['t', 'pos', 'vel', 'tau', 'pos_2', 'tau_2'], None, 'log')
    assert use.of('velocity', '2') is None


def test_the_joint_whose_columns_are_named_is_read_with_the_motion_of_its_siblings(tmp_path):
    time, position, velocity = swing()
    path = write(tmp_path / 'arm.csv', time=time, q_0=2.0 * position, q_1=position,
                 i_0=np.sign(velocity) + position, i_1=0.5 * np.sign(velocity))
    layout = Layout({'position': 'q_1', 'current': 'i_1'})
    samples, = read_recording(path, layout=layout)
    assert samples.joint == '1'
    assert samples.arm.joints == ('0', '1')
    np.testing.assert_allclose(samples.current, 0.5 * np.sign(velocity))
    assert recorded_joints(path, layout) == ['1']


def test_a_target_has_the_unit_of_what_it_is_the_target_of():
    use = assign(['timestamp_ms', 'Present Position', 'Present Current', 'Goal Current'],
                 Layout(units={'position': 'counts/4096', 'current': '2.69mA'}), 'log')
    assert use.of('command', '').factor == use.of('effort', '').factor == pytest.approx(2.69e-3)


def test_whole_numbers_without_a_unit_are_no_si_values(tmp_path):
    time, position, velocity = swing(300)
    counts = {'time': time, 'Present Position': np.round(4096.0 * position / 6.283),
              'Present Velocity': np.round(41.7 * velocity),
              'Present Current': np.round(50.0 * velocity)}
    path = write(tmp_path / 'log.csv', **counts)
    with pytest.raises(InputError, match='holds whole numbers'):
        read_recording(path)
    (samples, info), = read_recording_with_info(path, layout=Layout(
        units={'position': 'counts/4096'}))
    assert samples.velocity is None
    assert info.effort_unit == 'counts'
    units = {'position': 'counts/4096', 'velocity': '0.229rpm', 'current': '2.69mA'}
    (samples, info), = read_recording_with_info(path, layout=Layout(units=units))
    assert not info.effort_unit
    np.testing.assert_allclose(samples.velocity, velocity, atol=0.02)
    # Signs are whole numbers in any unit.
    write(path, time=time, q=position, tau=np.sign(velocity))
    assert not read_recording_with_info(path)[0][1].effort_unit


def test_an_effort_of_one_joint_belongs_to_the_only_position():
    assert assign(['t', 'position', 'knee_moment'], None, 'log').joints == ['']
    # A position without effort is no joint beside one that has it.
    assert assign(['t', 'q_1', 'tau_1', 'base_position'], None, 'log').joints == ['1']


@pytest.mark.parametrize(('names', 'said'), [
    (['q', 'tau'], '--rate HZ'), (['t', 'target_position', 'q'], '--stiffness and --damping'),
    (['t', 'q', 'tau_cmd'], 'a command only if the drive is known to follow it')])
def test_what_is_missing_is_said_with_the_remedy(names, said):
    with pytest.raises(InputError, match=said):
        assign(names, None, 'log')


def test_empty_columns_of_spreadsheets_are_ignored(tmp_path):
    (tmp_path / 'log.csv').write_text('time,position,effort,,\n0,0,1,,\n0.1,1,2,,\n')
    assert len(read_recording(tmp_path / 'log.csv')[0]) == 2


def test_a_header_may_be_marked_as_a_comment(tmp_path):
    (tmp_path / 'log.csv').write_text('%time,field.name0,field.position0,field.effort0\n'
                                      '1500000000,elbow,0.1,1\n1510000000,elbow,0.2,2\n')
    samples, = read_recording(tmp_path / 'log.csv', layout=Layout(units={'time': 'ns'}))
    np.testing.assert_allclose(samples.current, [1.0, 2.0])


def test_dates_are_times(tmp_path):
    assert date_in_seconds('1970-01-01T01:00:00.25+01:00') == pytest.approx(0.25)
    (tmp_path / 'log.csv').write_text('time,q,tau\n2025-12-09T16:16:01.586Z,0,1\n'
                                      '2025-12-09T16:16:01.596Z,0.1,2\n')
    (samples, info), = read_recording_with_info(tmp_path / 'log.csv')
    np.testing.assert_allclose(samples.time, [0.0, 0.01], atol=1e-6)
    assert info.start == pytest.approx(1765296961.586, abs=1e-3)
    # Times of the day, with a decimal comma.
    (tmp_path / 'log.csv').write_text('Zeit;q;tau\n16:16:01,586;0;1\n16:16:01,596;0,1;2\n')
    samples, = read_recording(tmp_path / 'log.csv')
    np.testing.assert_allclose(samples.time, [0.0, 0.01], atol=1e-6)
    (tmp_path / 'log.csv').write_text('time,q,tau\n2025-13-09T16:16:01Z,0,1\n')
    with pytest.raises(InputError, match='is not a number'):
        read_recording(tmp_path / 'log.csv')


def test_rows_at_a_known_rate_need_no_time(tmp_path):
    path = write(tmp_path / 'log.csv', q=np.arange(5.0), tau=np.arange(5.0), n=np.arange(5.0))
    np.testing.assert_allclose(read_recording(path, layout=Layout(rate=50.0))[0].time,
                               0.02 * np.arange(5))
    samples, = read_recording(path, layout=Layout({'time': 'n'}, {'time': 'counts/100'}))
    np.testing.assert_allclose(samples.time, 0.01 * np.arange(5))


def test_dynamic_joint_states_give_the_current_that_joint_states_lack(tmp_path):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    value, kind = 'control_msgs/msg/InterfaceValue', 'control_msgs/msg/DynamicJointState'
    store.register(get_types_from_msg('string[] interface_names\nfloat64[] values', value))
    store.register(get_types_from_msg(
        'std_msgs/Header header\nstring[] joint_names\n'
        'control_msgs/InterfaceValue[] interface_values', kind))
    types, usual = store.types, 'sensor_msgs/msg/JointState'
    time, position, velocity = swing(50)
    with Writer(tmp_path / 'bag', version=9) as bag:
        plain = bag.add_connection('/joint_states', usual, typestore=store)
        dynamic = bag.add_connection('/dynamic_joint_states', kind, typestore=store)
        for k in range(len(time)):
            stamp = 1_000_000_000 + round(1e9 * time[k])
            header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](
                *divmod(stamp, 1_000_000_000)), '')
            bag.write(plain, stamp, store.serialize_cdr(types[usual](
                header, ['elbow'], position[[k]], velocity[[k]], np.array([np.nan])), usual))
            bag.write(dynamic, stamp, store.serialize_cdr(types[kind](
                header, ['gpio', 'elbow'], [types[value](['on'], np.ones(1)), types[value](
                    ['velocity', 'current', 'position', 'temperature'],
                    np.array([velocity[k], 0.5, position[k], 31.0]))]), kind))
    (samples, info), = read_recording_with_info(tmp_path / 'bag')
    assert (samples.joint, info.effort_is_current) == ('elbow', True)
    np.testing.assert_allclose(samples.current, 0.5)
    np.testing.assert_allclose(samples.position, position)
    np.testing.assert_allclose(samples.temperature, 31.0)


def test_a_wrong_rate_is_told_with_the_true_one(tmp_path, refuses):
    _, position, velocity = swing(6000, 0.005)
    path = write(tmp_path / 'log.csv', q=position, dq=velocity, tau=velocity)
    refuses('a rate that is really 0.25 times the one given', 'refine', path, '--rate', '800')


def test_rounded_times_are_spread_over_their_rows():
    time = 0.008 * np.arange(1000)
    notes = []
    spread = spread_rounded(np.round(1e9 * np.floor(10.0 * time) / 10.0).astype(np.int64),
                            np.sin(time), notes)
    assert np.diff(spread) == pytest.approx(8e6, rel=1e-2)
    assert 'rounded to 0.1 s' in notes[0]


def test_values_that_are_held_are_found_but_not_slow_motion():
    time = 0.001 * np.arange(8000)
    notes = []
    rows = fresh_rows(time, np.sin(0.008 * np.floor(time / 0.008)), notes)
    np.testing.assert_array_equal(rows, np.arange(0, 8000, 8))
    assert 'position is held over 8 rows: 1000 of 8000 rows are used, 125 Hz' in notes[0]
    coarse = np.round(200.0 * np.sin(time)) / 200.0
    assert len(fresh_rows(time, coarse, [])) == 8000


def test_a_linear_axis_is_reported_in_metres_and_newtons():
    use = assign(['t', 'pos', 'force'], Layout(units={'position': 'mm', 'effort': 'N'}), 'log')
    assert use.linear
    assert in_own_units({'a': ['3 N·m·s/rad', 2.0]}, True) == {'a': ['3 N·s/m', 2.0]}
    assert in_own_units('Cogging: 628.3 times a turn', True) == 'Cogging: 100 times a metre'
    assert in_own_units('3 N·m', False) == '3 N·m'


def test_numbered_columns_are_the_joints_of_a_urdf_in_order():
    arm = ['shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint']
    assert match_names(['0', '1', '2'], arm, 'arm.urdf')[0] == dict(zip('012', arm))
    # Counting from 0, number 1 is the second joint, not joint_1.
    numbered = ['joint_1', 'joint_2', 'joint_3']
    assert match_names(['0', '1', '2'], numbered, 'arm.urdf')[0]['1'] == 'joint_2'


def test_a_refusal_comes_before_anything_slow_is_imported(tmp_path):
    (tmp_path / 'log.csv').write_text('time,position\n0,1\n')
    loaded = printed_by(f"""
        import sys
        from friction_comp.__main__ import main
        assert main(['refine', {str(tmp_path / 'log.csv')!r}, '--output', 'no']) == 2
        print(*sys.modules)""").split()
    assert not {'scipy', 'numba', 'matplotlib'} & set(loaded)
