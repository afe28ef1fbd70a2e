# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Tools with pipes, devices, unusual names, folders, and without ROS 2; a private ROS domain."""

from contextlib import ExitStack, suppress
from dataclasses import replace
import io
import json
import os
from pathlib import Path
import signal
import socket
import stat
import subprocess
import sys
import threading

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.__main__ import main, run
from friction_comp.demo import ros_domain
from friction_comp.demo.ros_domain import domains_in_use, leased_domain
from friction_comp.errors import InputError
from friction_comp.files import check_file, check_folder, output_folder, write_atomically
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.recordings import write_samples
from friction_comp.samples import Samples
from friction_comp.tools import demo, evaluate, predict, refine, reproduce
from friction_comp.tools.common import Arguments, folder_names

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


def test_a_name_that_no_terminal_can_show_ends_nothing(tmp_path, monkeypatch):
    output = tmp_path / 'größe'
    # Its name is not UTF-8.
    recording = Path(os.fsdecode(os.fsencode(tmp_path) + b'/gr\xfc\xdfe'))
    time = np.arange(0.0, 12.0, 5e-3)
    # There and back, with a rest before and after each.
    velocity = 0.4 * (np.abs(time - 3.0) < 1.0) - 0.4 * (np.abs(time - 9.0) < 1.0)
    position = np.cumsum(velocity) * 5e-3
    write_samples(recording, Samples(
        time=time, position=position, current=0.1 * np.sign(velocity), load=velocity,
        reference_position=position, reference_velocity=velocity, joint='elbow'))
    terminal = io.TextIOWrapper(io.BytesIO(), encoding='ascii')
    monkeypatch.setattr(sys, 'stdout', terminal)
    assert main(['evaluate', str(recording), '--output', str(output)]) == 0
    assert b'gr\\xf6\\xdfe' in terminal.buffer.getvalue()
    report = json.loads((output / 'report.json').read_text(encoding='utf-8'))
    assert any(recording.name in note for note in report['notes'])
    assert 'gr\\udcfc\\udcdfe' in (output / 'report.html').read_text(encoding='utf-8')


def test_only_ordinary_files_are_replaced(tmp_path):
    pipe, read = tmp_path / 'pipe', []
    os.mkfifo(pipe)
    with pytest.raises(InputError, match='pipe: cannot be written'):
        write_atomically(pipe, 'nobody reads this')
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    while not read and reader.is_alive():
        try:
            # As soon as the other end is there; more than a pipe holds.
            write_atomically(pipe, 'x' * 200_000)
            break
        except InputError:
            continue
    reader.join()
    assert read == ['x' * 200_000]

    def into_the_folder():
        with output_folder(tmp_path) as folder:
            (folder / 'first').write_text('')
            (folder / 'pipe').write_text('')
    with pytest.raises(InputError, match='pipe: exists and is no ordinary'):
        into_the_folder()
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(tmp_path.iterdir()) == [pipe], 'nothing half-written'


@pytest.mark.parametrize('tool', [predict, refine, evaluate, reproduce, demo])
def test_an_output_that_cannot_be_written_is_told_before_the_work(tool, tmp_path):
    (tmp_path / 'file').write_text('')
    for output in (tmp_path / 'file' / 'below', '/proc/nobody_writes_here/below'):
        arguments = [] if tool in (reproduce, demo) else [
            str(tmp_path / 'none.mcap'), '--model', str(tmp_path / 'none.yaml')]
        with pytest.raises(InputError, match='cannot be written to'):
            tool.main([*arguments, '--output', str(output)])
    assert [path.name for path in tmp_path.iterdir()] == ['file']


def test_what_can_be_written_is_not_refused_and_not_made_by_looking(tmp_path):
    check_folder(tmp_path / 'new' / 'folder')
    check_file(tmp_path / 'new' / 'file.csv')
    check_file('/dev/null')
    with pytest.raises(InputError, match='is a folder, not a file'):
        check_file(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize('name', ['compensator', 'demo'])
def test_without_ros_it_says_in_a_line_what_is_missing(name):
    done = subprocess.run([sys.executable, '-c', WITHOUT_ROS, name], cwd=ROOT, timeout=60,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 1
    line, = done.stderr.splitlines()
    assert line.startswith(f'{name}: ROS 2 is missing')
    assert 'make setup' in line


@pytest.mark.slow
def test_recordings_need_nothing_that_windows_lacks(tmp_path):
    program = tmp_path / 'program.py'
    program.write_text("""
import os, signal, sys
for name in ('fcntl', 'grp', 'pwd', 'resource', 'syslog', 'termios'):
    sys.modules[name] = None
for module, names in ((os, 'O_DIRECTORY getloadavg getuid killpg sched_getaffinity'),
                      (signal, 'SIGHUP SIGKILL SIGTSTP SIGTTIN pthread_sigmask setitimer')):
    for name in names.split():
        delattr(module, name)
from friction_comp.__main__ import main
if __name__ == '__main__':  # child processes import this file
    from friction_comp.parallel import run_each
    print(sorted(size for _, size in run_each(abs, [-2, -3], 2)))
    sys.exit(main(sys.argv[1:]))
""")
    log = ROOT / 'examples' / 'log.csv'
    done = subprocess.run([sys.executable, program, 'refine', log, '--output', tmp_path / 'out'],
                          cwd=ROOT, timeout=120, capture_output=True, text=True, check=False,
                          env={**os.environ, 'PYTHONPATH': str(ROOT)})
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('[2, 3]')
    assert (tmp_path / 'out' / 'model.yaml').exists()


@pytest.mark.slow
def test_without_a_home_the_variable_is_named_that_helps():
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    done = subprocess.run(
        [sys.executable, '-m', 'friction_comp', 'exercise'], cwd=ROOT, timeout=120, text=True,
        capture_output=True, check=False,
        env={**os.environ, 'HOME': '/dev/null/home', 'ROS_HOME': '', 'ROS_LOG_DIR': ''})
    assert done.returncode == 2
    line = done.stderr.splitlines()[-1]
    assert line.startswith('exercise: ROS 2 cannot write its log')
    assert 'ROS_LOG_DIR' in line
    assert 'Traceback' not in done.stderr


def test_recordings_with_and_without_a_load_are_not_mixed(tmp_path, refuses):
    time = np.arange(2000) * 0.01
    samples = Samples(time=time, position=np.sin(time), current=np.sign(np.cos(time)),
                      joint='elbow')
    write_samples(tmp_path / 'without', samples)
    write_samples(tmp_path / 'with', samples.with_(load=np.cos(time)))
    refuses(f'with: has a load (interaction_wrench), and {tmp_path / "without"} has none',
            'refine', tmp_path / 'without', tmp_path / 'with')


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


@pytest.mark.parametrize('tool', ['evaluate', 'predict', 'refine'])
def test_the_model_of_another_joint_is_refused(swinging, refuses, tool):
    refuses("wrist.yaml: is of joint 'wrist', not 'elbow'", tool, swinging / 'elbow', '--model',
            swinging / 'wrist.yaml')


def test_one_constant_of_the_drive_is_not_enough(swinging, refuses):
    for option in ('--torque-constant', '--gear-ratio'):
        refuses('belong together: give 1 for', 'refine', swinging / 'elbow', option, 5)


@pytest.mark.parametrize('tool, arguments', [
    ('export', ['--to', 'urdf', '--joint', 'knee']),
    ('excite', ['--joint', 'knee', '--position', -1, 1, '--velocity', 1, '--acceleration', 5])])
def test_of_the_file_of_an_arm_the_joint_is_used_that_was_named(swinging, refuses, tool, arguments):
    write_arm(swinging / 'arm.yaml', dict.fromkeys(('elbow', 'wrist'), FrictionModel.load(MODEL)))
    path = [swinging / 'arm.yaml'] if tool != 'excite' else ['--model', swinging / 'arm.yaml']
    refuses("arm.yaml: no joint 'knee' in it, but 'elbow', 'wrist'", tool, *path, *arguments)


def test_a_recording_of_one_sample_has_no_movement(tmp_path, refuses):
    for name, rows in (('one', '0,0,1'), ('equal', '0,0,1\n0,1,1')):
        (tmp_path / f'{name}.csv').write_text(f'time,position,effort\n{rows}\n')
        refuses('no movement of joint', 'evaluate', tmp_path / f'{name}.csv')


def test_names_that_differ_only_in_odd_letters_get_folders_of_their_own():
    assert folder_names(['left/elbow', 'left_elbow', 'left elbow', '..', 'x']) == [
        'left_elbow', 'left_elbow_', 'left_elbow__', '_', 'x']


HOLD = """
import sys
from friction_comp.demo.ros_domain import leased_domain
with leased_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


def test_a_leased_domain_is_exclusive_and_freed_if_its_process_is_killed(monkeypatch):
    monkeypatch.setattr(ros_domain, '_DOMAINS', range(95, 98))
    free = set(ros_domain._DOMAINS) - domains_in_use()
    with ExitStack() as stack:
        def lease():
            held.append(stack.enter_context(leased_domain()))
            return lease()
        held = []
        with pytest.raises(InputError, match='in use'):
            lease()
        assert len(held) == len(set(held)) <= len(free)
    other = subprocess.Popen(
        [sys.executable, '-c', HOLD.replace(
            'with', 'from friction_comp.demo import ros_domain\n'
            'ros_domain._DOMAINS = range(95, 98)\nwith')],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    number = int(other.stdout.readline())
    try:
        assert ros_domain._reserve(number) is None
    finally:
        other.send_signal(signal.SIGKILL)
        other.communicate()
    with ros_domain._reserve(number) as again:
        assert again is not None


@pytest.mark.skipif(not ros_domain._SOCKETS[0].exists(), reason='needs /proc')
def test_a_domain_in_use_without_a_lease_is_found_by_its_sockets():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        # Other tests may be in some of these domains.
        for domain in range(99, 60, -1):
            with suppress(OSError):
                # Of the first participant in the domain, for unicast discovery.
                one.bind(('127.0.0.1', 7400 + 250 * domain + 10))
                break
        assert domain in domains_in_use()


def test_an_option_given_twice_is_joined_where_it_lists_and_refused_where_it_does_not(capsys):
    parser = Arguments('tool', 'x').add_recordings()
    given = ['log.csv', '--unit', 'position=deg', '--unit', 'time=ms', '--columns', 'time=t']
    parsed = parser.parse(given)
    assert (parsed.unit, parsed.columns) == ('position=deg,time=ms', 'time=t')
    assert parser.parse(given).unit == parsed.unit
    with pytest.raises(SystemExit):
        parser.parse(['log.csv', '--joint', 'a', '--joint', 'b'])
    assert '--joint is given twice' in capsys.readouterr().err
