# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Units of tables: in names, under names, given by the user, or told by the values."""

import math

import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.__main__ import main
from friction_comp.columns import assign
from friction_comp.recordings import read_recording_with_info
from friction_comp.recordings.told_units import angle_fault, unit_of_weight

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
    gains = Layout(stiffness=('kp',), damping=(1.0,)).gains([*names, 'kp [N·m/rad]'], 'log')
    assert gains == ('kp [N·m/rad]', 1.0)


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
    assert 'Coulomb                     8.000 %' in capsys.readouterr().out


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
    refuses('give its unit, --unit position=turn, deg or rad', 'refine', path)
    samples, = read_recording(path, layout=Layout(units={'position': 'turn'}))
    np.testing.assert_allclose(samples.position, grid(TURN), atol=1e-9)


@pytest.mark.parametrize('unit', [1.0, 1e3, 1e6, 1e9])
def test_times_that_are_dates_tell_their_unit(tmp_path, unit):
    time, position, velocity = swing(300, 0.004)
    path = write(tmp_path / 'log.csv', t=np.round((1.7e9 + time) * unit, 6), q=position,
                 tau=velocity)
    (samples, info), = read_recording_with_info(path)
    assert info.assumed == ('q in rad', 'tau in N·m')
    np.testing.assert_allclose(samples.time - samples.time[0], time, atol=1e-5)


def test_times_that_cannot_be_seconds_are_asked(tmp_path, refuses):
    time, position, velocity = swing(300, 0.004)
    path = write(tmp_path / 'log.csv', t=1e3 * time, q=position, tau=velocity)
    refuses('has rows 4 apart, which show no motion if these are seconds', 'refine', path)
    for layout in (Layout(units={'time': 'ms'}), Layout(rate=250.0)):
        samples, = read_recording(path, layout=layout)
        np.testing.assert_allclose(samples.time, time, atol=1e-9)


def test_a_stamp_in_two_columns_is_one_time(tmp_path):
    time, position, velocity = swing(3000, 0.001)
    seconds = np.floor(time + 0.5)
    path = write(tmp_path / 'log.csv', **{
        'header.stamp.sec': seconds, 'header.stamp.nanosec': np.round(1e9 * (time + 0.5 - seconds)),
        'q': position, 'tau': velocity})
    samples, = read_recording(path)
    np.testing.assert_allclose(np.diff(samples.time), 0.001, atol=1e-9)


@pytest.mark.parametrize(('turn', 'unit'), [(1.0, 'turn'), (360.0, 'deg'), (TURN, '')])
@pytest.mark.parametrize('weight', [2.0, 0.0])
def test_a_weight_tells_in_which_unit_a_turn_is_one(turn, unit, weight):
    time = 0.005 * np.arange(6000)
    angle = 3.5 * np.sin(time) + 0.4 * np.sin(2.7 * time)
    velocity = 3.5 * np.cos(time) + 1.08 * np.cos(2.7 * time)
    # Ripple and a spring are no weight.
    holds = weight * np.sin(angle) if weight else 0.5 * angle
    effort = (np.sign(velocity) + 0.5 * velocity + holds + 0.2 * np.sin(14.0 * angle)
              + 0.05 * np.random.default_rng(1).normal(size=6000))
    assert unit_of_weight(time, angle * turn / TURN, effort) == (unit if weight else '')


def test_units_taken_for_granted_stand_beside_the_numbers(tmp_path, capsys):
    time, position, velocity = swing(6000, 0.004)
    noise = 0.05 * np.random.default_rng(2).normal(size=len(time))
    path = write(tmp_path / 'log.csv', **{
        't [s]': time, 'angle': 57.3 * position, 'tau': np.sign(velocity) + noise})
    assert main(['refine', str(path), '--output', str(tmp_path / 'out')]) == 0
    said = ('angle in rad, tau in N·m (position covers 45.8 rad, 7.3 turns; rows are 4 ms apart); '
            '--unit gives others')
    printed = capsys.readouterr().out.splitlines()
    assert printed[7].startswith('torque = ')
    assert printed[8] == f'taken for granted: {said}'
    assert said in (tmp_path / 'out' / 'report.html').read_text()
