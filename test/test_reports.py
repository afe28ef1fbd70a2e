# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Files that tools write are complete or absent, and arguments are checked."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.files import output_folder
from friction_comp.results import to_json
from friction_comp.terminal import progress
from friction_comp.tools.common import Arguments, positive, whole_number


def test_output_appears_only_when_all_is_done(tmp_path):
    with output_folder(tmp_path / 'a' / 'b') as folder:
        (folder / 'one.txt').write_text('1')
        (folder / 'deep').mkdir()
        (folder / 'deep' / 'two.txt').write_text('2')
        assert not (tmp_path / 'a' / 'b' / 'one.txt').exists()
    assert sorted(p.name for p in (tmp_path / 'a' / 'b').rglob('*')) == [
        'deep', 'one.txt', 'two.txt']

    def fail(path):
        with output_folder(path) as folder:
            (folder / 'one.txt').write_text('half')
            raise InputError('no good')

    with pytest.raises(InputError, match='no good'):
        fail(tmp_path / 'a' / 'b')
    assert (tmp_path / 'a' / 'b' / 'one.txt').read_text() == '1'
    with pytest.raises(InputError, match='no good'):
        fail(tmp_path / 'fresh' / 'deeper')
    assert [p.name for p in tmp_path.iterdir()] == ['a']
    (tmp_path / 'file').write_text('')
    for path in (tmp_path / 'file', tmp_path / 'file' / 'below'):
        with pytest.raises(InputError, match='file'):
            fail(path)


def test_arguments_that_are_wrong_take_one_line(capsys):
    def parse(*argv):
        return Arguments('tool', 'Does things.').add_recordings().add_drive().add_output().parse(
            list(argv))

    for argv, words in (
            ((), 'RECORDING'), (('r',), '--output'),
            (('r', '--output', 'o', '--gear-ratio', '-3'), 'positive finite number'),
            (('r', '--output', 'o', '--torque-constant', 'x'), 'positive finite number'),
            (('r', '--output', 'o', '--what'), '--what')):
        with pytest.raises(SystemExit) as exit_:
            parse(*argv)
        assert exit_.value.code == 2
        error = capsys.readouterr().err
        assert error.count('\n') == 1
        assert error.startswith('tool: ')
        assert words in error
    arguments = parse('r', 's', '--output', 'o', '--gear-ratio', '100', '--ros-args', '-r', 'x:=y')
    assert arguments.recordings == [Path('r'), Path('s')]
    assert arguments.gear_ratio == 100.0
    assert arguments.torque_constant is None


def test_number_arguments():
    assert positive('0.5') == 0.5
    assert whole_number()('3') == 3
    for read, text in ((positive, 'nan'), (positive, 'inf'), (whole_number(), '0'),
                       (whole_number(2), '1'), (whole_number(), '1.5')):
        with pytest.raises(argparse.ArgumentTypeError):
            read(text)


def test_json_has_no_values_that_others_cannot_read():
    text = to_json({'a': np.float64('nan'), 'b': np.arange(3), 'c': [np.int8(1), np.bool_(True)],
                    'd': Path('x'), 1: float('inf'), 'τ': 0.5})
    assert json.loads(text) == {
        'version': 1, 'a': None, 'b': [0, 1, 2], 'c': [1, True], 'd': 'x', '1': None, 'τ': 0.5}
    assert 'τ' in text


def test_progress_is_silent_where_nobody_watches(capsys):
    with progress('reading') as report:
        report(0.5)
        report(2.0, 'done')
    assert capsys.readouterr() == ('', '')
