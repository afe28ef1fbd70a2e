# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables as other software writes them: names and units."""


from helpers import printed_by
import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.arm.urdf import match_names
from friction_comp.number_text import in_own_units
from friction_comp.recordings import read_recording_with_info, recorded_joints
from friction_comp.tables.columns import assign
from friction_comp.tables.units import parse_unit

UR = ['timestamp', *(f'{name}_{k}' for name in ('actual_q', 'actual_qd', 'actual_current')
                     for k in (0, 1)), 'target_moment_0', 'actual_robot_current']


@pytest.mark.parametrize('text', ['V', 'rad/s/s', 'counts/0', '0mA', 'Nm/Nm/s', ''])
def test_what_is_no_unit_is_none(text):
    assert parse_unit(text) is None


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
