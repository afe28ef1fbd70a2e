# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tools with pipes, devices, unusual names, folders, and without ROS 2; a private ROS domain."""

from dataclasses import replace
import json
import os
from pathlib import Path
import subprocess
import sys

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.files import output_folder
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.recordings import write_samples
from friction_comp.results import to_json
from friction_comp.samples import Samples
from friction_comp.tools import demo, evaluate, predict, refine, reproduce
from friction_comp.tools.common import Arguments

MODEL = ROOT / 'config' / 'armin_configuration_1.yaml'
# Stands for an environment in which nothing of ROS 2 is installed.
WITHOUT_ROS = """
import importlib.abc, sys

class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        first = name.partition('.')[0]
        if first == 'rclpy' or first.endswith(('_msgs', '_srvs', '_interfaces')):
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

sys.meta_path.insert(0, Absent())
from friction_comp.__main__ import main, run
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_a_closed_pipe_costs_only_printed_text(tmp_path):
    end, begin = os.pipe()
    os.close(end)
    try:
        done = subprocess.run(
            [sys.executable, '-m', 'friction_comp', 'export', MODEL, '--to', 'csv', '--output',
             tmp_path / 'friction.csv'], cwd=ROOT, timeout=120, check=False, stdout=begin,
            stderr=subprocess.PIPE)
    finally:
        os.close(begin)
    assert (done.returncode, done.stderr) == (0, b'')
    assert len((tmp_path / 'friction.csv').read_text().splitlines()) > 9


@pytest.mark.parametrize('tool', [predict, refine, evaluate, reproduce, demo])
def test_an_output_that_cannot_be_written_is_told_before_the_work(tool, tmp_path):
    (tmp_path / 'file').write_text('')
    for output in (tmp_path / 'file' / 'below', '/proc/nobody_writes_here/below'):
        arguments = [] if tool in (reproduce, demo) else [
            str(tmp_path / 'none.mcap'), '--model', str(tmp_path / 'none.yaml')]
        with pytest.raises(InputError, match='cannot be written to'):
            tool.main([*arguments, '--output', str(output)])
    assert [path.name for path in tmp_path.iterdir()] == ['file']


@pytest.mark.slow
@pytest.mark.parametrize('name', ['compensator', 'demo'])
def test_without_ros_it_says_in_a_line_what_is_missing(name):
    done = subprocess.run([sys.executable, '-c', WITHOUT_ROS, name], cwd=ROOT, timeout=60,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 1
    line, = done.stderr.splitlines()
    assert line.startswith(f'{name}: ROS 2 is missing')
    assert 'make setup' in line


@pytest.mark.parametrize(('tool', 'arguments'), [
    ('convert', ['log.csv', '--output', 'log.csv']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'log.csv']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'model.yaml']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'linked.csv']),
    ('export', ['model.yaml', '--to', 'csv', '--output', './model.yaml'])])
def test_no_output_is_written_over_an_input(tmp_path, monkeypatch, capsys, tool, arguments):
    monkeypatch.chdir(tmp_path)
    time = 0.01 * np.arange(2000)
    np.savetxt('log.csv', np.column_stack([time, np.sin(time), np.cos(time)]), delimiter=',',
               header='t,q,tau', comments='')
    Path('model.yaml').write_bytes(MODEL.read_bytes())
    Path('linked.csv').hardlink_to('log.csv')
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert run(tool, arguments) == 2
    assert ('already exists' if tool == 'convert' else 'is the input itself') in (
        capsys.readouterr().err)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.fixture
def swinging(tmp_path):
    """A recording of an elbow, and a model of a wrist."""
    time = np.arange(2000) * 0.01
    write_samples(tmp_path / 'elbow', Samples(
        time=time, position=np.sin(time), current=np.sign(np.cos(time)), joint='elbow'))
    replace(FrictionModel.load(MODEL), joint='wrist').save(tmp_path / 'wrist.yaml')
    return tmp_path


@pytest.mark.parametrize(('tool', 'arguments'), [
    *((tool, ['elbow', '--model', 'wrist.yaml']) for tool in ('evaluate', 'predict', 'refine')),
    ('export', ['arm.yaml', '--to', 'urdf', '--joint', 'knee']),
    ('excite', ['--model', 'arm.yaml', '--joint', 'knee', '--position', -1, 1, '--velocity', 1,
                '--acceleration', 5])])
def test_a_model_of_another_joint_is_refused(swinging, monkeypatch, refuses, tool, arguments):
    monkeypatch.chdir(swinging)
    write_arm(Path('arm.yaml'), dict.fromkeys(('elbow', 'wrist'), FrictionModel.load(MODEL)))
    refuses("arm.yaml: no joint 'knee' in it, but 'elbow', 'wrist'" if 'knee' in arguments else
            "wrist.yaml: is of joint 'wrist', not 'elbow'", tool, *arguments)


def test_an_option_given_twice_is_joined_where_it_lists_and_refused_where_it_does_not(capsys):
    parser = Arguments('tool', 'x').add_recordings()
    given = ['log.csv', '--unit', 'position=deg', '--unit', 'time=ms', '--columns', 'time=t']
    parsed = parser.parse(given)
    assert (parsed.unit, parsed.columns) == ('position=deg,time=ms', 'time=t')
    assert parser.parse(given).unit == parsed.unit
    with pytest.raises(SystemExit):
        parser.parse(['log.csv', '--joint', 'a', '--joint', 'b'])
    assert '--joint is given twice' in capsys.readouterr().err


def test_output_appears_only_when_all_is_done(tmp_path):
    def write(text, ending):
        with output_folder(tmp_path / 'a' / 'b') as folder:
            (folder / 'deep').mkdir()
            (folder / 'deep' / 'one.txt').write_text(text)
            assert text != 'whole' or not (tmp_path / 'a' / 'b' / 'deep').exists()
            if ending:
                raise ending

    with pytest.raises(InputError, match='no good'):
        write('half', InputError('no good'))
    assert list(tmp_path.iterdir()) == []
    write('whole', None)
    with pytest.raises(InputError, match='no good'):
        write('half', InputError('no good'))
    one, = (path for path in tmp_path.rglob('*') if path.is_file())
    assert (one.name, one.read_text()) == ('one.txt', 'whole')


def test_arguments_that_are_wrong_take_one_line(capsys):
    def parse(*argv):
        return Arguments('tool', 'Does things.').add_recordings().add_output().parse(
            list(argv))

    for argv, words in (
            ((), 'RECORDING'), (('r',), '--output'),
            (('r', '--output', 'o', '--rate', '-3'), 'positive finite number'),
            (('r', '--output', 'o', '--rate', 'x'), 'positive finite number'),
            (('r', '--output', 'o', '--what'), '--what')):
        with pytest.raises(SystemExit) as exit_:
            parse(*argv)
        assert exit_.value.code == 2
        error = capsys.readouterr().err
        assert error.count('\n') == 1
        assert error.startswith('tool: ')
        assert words in error
    arguments = parse('r', 's', '--output', 'o', '--rate', '100', '--ros-args', '-r', 'x:=y')
    assert arguments.recordings == [Path('r'), Path('s')]
    assert arguments.rate == 100.0
    assert arguments.joint is None


def test_json_has_no_values_that_others_cannot_read():
    text = to_json({'a': np.float64('nan'), 'b': np.arange(3), 'c': [np.int8(1), np.bool_(True)],
                    'd': Path('x'), 1: float('inf'), 'τ': 0.5})
    assert json.loads(text) == {
        'version': 1, 'a': None, 'b': [0, 1, 2], 'c': [1, True], 'd': 'x', '1': None, 'τ': 0.5}
    assert 'τ' in text
