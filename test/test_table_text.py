# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables without a header, with texts, lists, separators that end lines; states and channels."""

import numpy as np
import pytest
from table_maker import swing

from friction_comp import Layout, read_recording
from friction_comp.tables.table_files import Table

TIME, POSITION, VELOCITY = swing(60, 0.01)


def lines_of(form):
    """Return a line for each time with time, position and velocity in a form."""
    return [form.format(*row) for row in zip(TIME, POSITION, VELOCITY)]


@pytest.mark.parametrize('form', [
    '{0:.3f} OK {1:.9f} {2:.9f}', '{0:.3f},0x0,{1:.9f},{2:.9f}',
    '{0:.3f}\tposition\t{1:.9f}\t{2:.9f}\t', '{0:.3f}, -, {1:.9f}, {2:.9f}, '])
def test_a_line_of_numbers_is_no_header_though_a_cell_is_text(tmp_path, form):
    log = tmp_path / 'log.txt'
    log.write_text('\n'.join(['% of a robot', *lines_of(form)]))
    assert Table(log).names == ['1', '2', '3', '4']
    samples, = read_recording(log, layout=Layout({'time': '1', 'position': '3', 'current': '4'}))
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-8)


@pytest.mark.parametrize('head', ['t,flags,1,2', 'time,1,2,3', ',1,2,state'])
def test_a_header_may_hold_numbers_above_numbers(tmp_path, head):
    rows = lines_of('{0:.3f},{1:.9f},{2:.9f},7')
    (tmp_path / 'log.csv').write_text('\n'.join([head, *rows]))
    assert Table(tmp_path / 'log.csv').names == [name for name in head.split(',') if name]


@pytest.mark.parametrize('mark', ['\t', ',', ';'])
@pytest.mark.parametrize('head', ['', '# time{0}q{0}tau\n', '# time{0}q{0}tau{0}\n'])
def test_a_separator_at_the_end_of_each_line_makes_no_column(tmp_path, mark, head):
    log = tmp_path / 'log.txt'
    log.write_text(head.format(mark) + '\n'.join(lines_of(mark.join(['{0:.3f}', '{1:.9f}',
                                                                     '{2:.9f}', '']))))
    assert Table(log).names == (['time', 'q', 'tau'] if head else ['1', '2', '3'])


@pytest.mark.parametrize('form', [
    '{0:.3f},"[{1:.9f}, {1}]","[{2:.9f}, {2}]"', '{0:.3f},"[ {1:.9f}\n {1}]",[{2:.9f} {2}]',
    '{0:.3f};[{1:.9f}, {1}];({2:.9f}, {2})'])
def test_cells_may_hold_lists(tmp_path, form):
    log = tmp_path / 'log.csv'
    mark = ';' if ';' in form else ','
    log.write_text('\n'.join([mark.join(('time', 'positions', 'torques')), *lines_of(form)]))
    assert Table(log).names == [
        'time', 'positions[0]', 'positions[1]', 'torques[0]', 'torques[1]']
    for joint in ('0', '1'):
        samples, = read_recording(log, joint)
        np.testing.assert_allclose(samples.position, POSITION, atol=1e-8)
        np.testing.assert_allclose(samples.current, VELOCITY, atol=1e-8)


@pytest.mark.parametrize('unit', ['V', '%', '0.1 %', 'counts', 'PWM', 'mA', '-1Nm', 'kgf·cm'])
def test_an_effort_may_be_in_units_that_stay_as_they_are(unit):
    assert Layout(units={'effort': unit}).units == {'effort': unit}
