# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables as spreadsheets, laboratory programs and MATLAB write them."""

import math
import re

import numpy as np
import pytest
from table_maker import swing, write

from friction_comp import InputError, Layout, read_recording
from friction_comp.__main__ import main
from friction_comp.recordings import read_recording_with_info
from friction_comp.refinement.judge import other_turn
from friction_comp.refinement.result import FoundEffect
from friction_comp.tables.columns import assign
from friction_comp.tables.table_recording import read_frame

TURN = 2.0 * math.pi


def rows(factor=1.0, offset=0.0):
    """Return rows of time, position and torque with a decimal comma and semicolons."""
    time, position, velocity = swing()
    table = np.column_stack([time + offset, factor * position, 2.0 * np.sign(velocity)])
    return [';'.join(f'{value:.6f}' for value in row).replace('.', ',') for row in table]


def read_lines(folder, *lines, encoding='utf-8'):
    """Return what is read from a file of these lines."""
    (folder / 'log.csv').write_text('\n'.join(lines), encoding=encoding)
    return read_recording(folder / 'log.csv')[0]


@pytest.mark.parametrize('above', [
    ['Logger v3', 'Date: 2026-03-04', ''], ['sep=;'], ['Knee'], ['Export;of'], ['', ''],
    ['Patient;7;left'], ['# a comment', 'Motion of a joint, measured;twice']])
def test_lines_above_the_header_are_no_header(tmp_path, above):
    samples = read_lines(tmp_path, *above, 'Time;Position;Torque', *rows())
    assert len(samples) == 2000
    assert samples.position == pytest.approx(swing()[1], abs=1e-6)


def test_a_header_with_other_cells_than_the_rows_stays_one(tmp_path):
    assert len(read_lines(tmp_path, 'Time;Position;Torque;;', *rows())) == 2000


def test_all_that_is_missing_is_asked_at_once():
    with pytest.raises(InputError, match=r'which columns are the time, the position, the effort or '
                       r'current\? Name them with --columns time=NAME,position=NAME,effort=NAME'):
        assign(['tiempo', 'giro', 'par'], None, 'log')


def test_a_current_without_a_unit_is_taken_for_granted_too(tmp_path):
    time, position, velocity = swing()
    path = write(tmp_path / 'log.csv', time=time, position=position,
                 current=159.5 * np.sign(velocity))
    (_, info), = read_recording_with_info(path)
    assert 'current in A' in info.assumed


@pytest.mark.parametrize(('name', 'said'), [
    ('log.xlsx', 'save its sheet as CSV'), ('log.XLS', 'save its sheet as CSV'),
    ('log.bag', 'log.bag: a bag of ROS 1: rosbags-convert --src ')])
def test_a_workbook_and_a_bag_of_ros_1_are_refused_with_what_to_do(tmp_path, refuses, name, said):
    (tmp_path / name).write_bytes(b'PK')
    refuses(said, 'refine', tmp_path / name)


def ripple(low, high):
    return FoundEffect('cogging', 'position', 1.0, 1.0, {}, {'frequency': [low, high]}, None, '',
                       '')


@pytest.mark.parametrize(('waves', 'said'), [
    # As of a public winch, whose positions are turns: 14 and 12 times 2π.
    ([(87.909, 87.980), (75.350, 75.424)], '14, 12 if position is in turn'),
    ([(0.2440, 0.2445), (0.7329, 0.7332)], '14, 42 if position is in deg'),
    ([(13.99, 14.02), (75.350, 75.424)], ''),         # one is no whole number in turns
    ([(87.96, 88.02), (37.68, 38.01)], ''),           # whole in rad, too
    ([(87.7, 87.98)], ''),                            # by chance
    ([], '')])
def test_ripples_tell_in_which_unit_a_turn_is_one(waves, said):
    found = list(other_turn([ripple(*ends) for ends in waves]))
    assert said in found[0].text if said else not found


def test_ripples_of_any_gear_seldom_tell_another_unit():
    rng = np.random.default_rng(5)
    first = rng.uniform(5.0, 200.0, (2000, 1)) * rng.integers(1, 4, (2000, 2))
    alarms = sum(len(list(other_turn([ripple(k - 0.03, k + 0.03) for k in waves])))
                 for waves in first)
    assert alarms <= 20
    assert sum(len(list(other_turn([ripple(k - 0.03, k + 0.03) for k in TURN * np.round(waves)])))
               for waves in first) > 1900


def test_a_length_is_not_so_many_turns(tmp_path, capsys):
    time, position, velocity = swing()
    noise = 0.05 * np.random.default_rng(2).normal(size=len(time))
    path = write(tmp_path / 'log.csv', **{'elapsed': time, 'x [mm]': 100.0 * position,
                                          'force [N]': np.sign(velocity) + noise})
    assert main(['refine', str(path), '--columns', 'position=x [mm]',
                 '--output', str(tmp_path / 'out')]) == 0
    assert re.search(r'elapsed in s \(position covers \S+ m; rows', capsys.readouterr().out)


def test_the_only_effort_is_not_called_unused():
    found = assign(['time', 'q2', 'dq2', 'q2_tau_J_residual'], None, 'log.csv')
    assert found.of('effort', '2').name == 'q2_tau_J_residual'
    assert not any('not used' in note for note in found.notes)


def test_an_effort_that_was_asked_for_is_no_measurement():
    names = ['time', 'hip_angle', 'hip_cmd_Nm', 'hip_tau_Nm']
    for name, said in (('hip_cmd_Nm', True), ('hip_tau_Nm', False)):
        notes = assign(names, Layout({'effort': name}), 'log.csv').notes
        assert any('asked for, not measured' in note for note in notes) == said


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_torque_behind_the_gear_is_no_part_of_a_current(tmp_path, sign):
    """Ampere minus newton metres is nothing: the torque is the load, whose share is fitted."""
    time, position, velocity = swing()
    carried = 9.0 * np.sin(position)
    columns = {'time': time, 'position': position, 'i': np.sign(velocity) + 0.3 * carried,
               'link_torque': sign * carried}
    (samples, _), = read_recording_with_info(write(tmp_path / 'log.csv', **columns))
    framed = read_frame(columns)
    for read in (samples, framed):
        np.testing.assert_allclose(read.current, columns['i'])
        np.testing.assert_allclose(read.load, -carried)
    given = Layout(units={'effort': '%'})
    np.testing.assert_allclose(read_frame(columns, given).load, -carried)
