# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tables without a header, with texts, lists, separators that end lines; states and channels."""

import numpy as np
import pytest
from scipy.io import savemat
from table_maker import swing

from friction_comp import InputError, Layout, read_recording
from friction_comp.recordings import read_recording_with_info
from friction_comp.recordings.table_files import open_table

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
    assert open_table(log).names == ['1', '2', '3', '4']
    samples, = read_recording(log, layout=Layout({'time': '1', 'position': '3', 'current': '4'}))
    np.testing.assert_allclose(samples.position, POSITION, atol=1e-8)


@pytest.mark.parametrize('head', ['t,flags,1,2', 'time,1,2,3', ',1,2,state'])
def test_a_header_may_hold_numbers_above_numbers(tmp_path, head):
    rows = lines_of('{0:.3f},{1:.9f},{2:.9f},7')
    (tmp_path / 'log.csv').write_text('\n'.join([head, *rows]))
    assert open_table(tmp_path / 'log.csv').names == [name for name in head.split(',') if name]


@pytest.mark.parametrize('mark', ['\t', ',', ';'])
@pytest.mark.parametrize('head', ['', '# time{0}q{0}tau\n', '# time{0}q{0}tau{0}\n'])
def test_a_separator_at_the_end_of_each_line_makes_no_column(tmp_path, mark, head):
    log = tmp_path / 'log.txt'
    log.write_text(head.format(mark) + '\n'.join(lines_of(mark.join(['{0:.3f}', '{1:.9f}',
                                                                     '{2:.9f}', '']))))
    assert open_table(log).names == (['time', 'q', 'tau'] if head else ['1', '2', '3'])


@pytest.mark.parametrize('form', [
    '{0:.3f},"[{1:.9f}, {1}]","[{2:.9f}, {2}]"', '{0:.3f},"[ {1:.9f}\n {1}]",[{2:.9f} {2}]',
    '{0:.3f};[{1:.9f}, {1}];({2:.9f}, {2})'])
def test_cells_may_hold_lists(tmp_path, form):
    log = tmp_path / 'log.csv'
    mark = ';' if ';' in form else ','
    log.write_text('\n'.join([mark.join(('time', 'positions', 'torques')), *lines_of(form)]))
    assert open_table(log).names == [
        'time', 'positions[0]', 'positions[1]', 'torques[0]', 'torques[1]']
    for joint in ('0', '1'):
        samples, = read_recording(log, joint)
        np.testing.assert_allclose(samples.position, POSITION, atol=1e-8)
        np.testing.assert_allclose(samples.current, VELOCITY, atol=1e-8)


def test_a_short_list_lacks_values_and_a_text_in_its_place_is_named(tmp_path):
    log = tmp_path / 'log.csv'
    rows = lines_of('{0:.3f},"[0, {1:.9f}]","[0, {2:.9f}]","[\'a\', \'b\']"')
    rows[4] = '0.04,[0],"[0, 1]",'
    log.write_text('\n'.join(['time,q,tau,names', *rows]))
    assert len(read_recording(log, '1')[0]) == len(rows) - 1
    rows[5] = '0.05,[0],"[0, __import__(\'os\')]",'
    log.write_text('\n'.join(['time,q,tau,names', *rows]))
    with pytest.raises(InputError, match=r"line 7, column 'tau\[0\]': .* is not a number"):
        read_recording(log, '1')


@pytest.mark.parametrize('unit', ['V', '%', '0.1 %', 'counts', 'PWM', 'mA', '-1Nm', 'kgf·cm'])
def test_an_effort_may_be_in_units_that_stay_as_they_are(unit):
    assert Layout(units={'effort': unit}).units == {'effort': unit}


@pytest.mark.parametrize('layout', [Layout(), Layout({'position': 'q', 'effort': 'tau'})])
@pytest.mark.parametrize('kind', ['npz', 'hdf5', 'txt'])
def test_states_have_a_value_more_than_inputs(tmp_path, kind, layout):
    columns = {'time': TIME, 'q': POSITION, 'dq': VELOCITY[:-1], 'tau': VELOCITY[:-1]}
    paths = [tmp_path / f'log.{kind}']
    if kind == 'npz':
        np.savez(paths[0], **columns)
    elif kind == 'hdf5':
        with pytest.importorskip('h5py').File(paths[0], 'w') as file:
            file.update(columns)
    else:
        paths = [tmp_path / f'{name}.txt' for name in columns]
        for path, values in zip(paths, columns.values()):
            np.savetxt(path, values)
    (samples, info), = read_recording_with_info(paths, layout=layout)
    np.testing.assert_allclose(samples.position, POSITION[:-1])
    np.testing.assert_allclose(samples.velocity, VELOCITY[:-1])
    assert ('time and 1 more: one value more than the rest, as states beside inputs; the last is '
            'left out') in info.notes


def test_two_values_more_are_refused(tmp_path, refuses):
    np.savez(tmp_path / 'log.npz', time=TIME, q=POSITION, tau=VELOCITY[:-2])
    refuses('differ in length: time 60, q 60, tau 58', 'evaluate', tmp_path / 'log.npz')


@pytest.mark.parametrize(('names', 'read'), [
    (['"Model Root"/"q"', '"Model Root"/"tau"'], ['q', 'tau']),
    (['"Root"/"q"/"Out1"', '"Root"/"tau"/"Out1"'], ['q/Out1', 'tau/Out1'])])
def test_channels_of_structs_are_columns_by_their_names(tmp_path, names, read):
    channels = np.zeros(2, dtype=[('Name', 'O'), ('Data', 'O')])
    channels['Name'][:], channels['Data'][:] = names, [POSITION, VELOCITY]
    savemat(tmp_path / 'log.mat', {'rec': {'X': {'Name': [], 'Data': TIME}, 'Y': channels}})
    assert open_table(tmp_path / 'log.mat').names == ['rec.time', *(f'rec.{one}' for one in read)]
    samples, = read_recording(tmp_path / 'log.mat')
    np.testing.assert_allclose(samples.time, TIME, atol=1e-9)
    np.testing.assert_allclose(samples.position, POSITION)
    np.testing.assert_allclose(samples.current, VELOCITY)


def test_files_of_one_signal_that_are_not_named_after_it_are_told_how(tmp_path, refuses):
    paths = [tmp_path / f'{name}.csv' for name in ('input', 'time', 'trajectory')]
    for path, values in zip(paths, (VELOCITY, TIME, POSITION)):
        np.savetxt(path, values)
    refuses('of several files with a signal each, the names tell it, as in time.csv, q.csv and '
            'tau.csv', 'refine', *paths)
