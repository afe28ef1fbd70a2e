# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings: one that fails costs only itself, and processes do not change results."""

import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from node_process import environment, ROOT
import numpy as np
import pytest
from recording_maker import joint_state, record as record_bag, wrench
from report_pages import assert_documented
from table_maker import swing, write
from test_evaluate import trial
from work_that_may_die import work_that_may_die

from friction_comp import parallel
from friction_comp.__main__ import run
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.parallel import Failure, run_each
from friction_comp.recordings import write_samples
from friction_comp.recordings.pieces import pieces_of
from simulated_recordings.drives import excitation_for, random_drive, record


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Short recordings of one drive that hides gravity, and one that cannot be read."""
    room = tmp_path_factory.mktemp('many') / 'sessions'
    drive = random_drive(3, ['gravity'])
    for k in range(2):
        samples = record(drive, 40 + k, excitation_for(
            ['gravity'], duration=8.0, rate=125.0))[0].samples
        write_samples(room / f'day_{k}', samples)
    (room / 'broken.mcap').write_bytes(b'no recording')
    return room


def trials(room, count):
    for k in range(count):
        # A hundred a second are enough for what is not about their number.
        write_samples(room / f't{k}', trial([1.0 + 0.1 * k] * 4, directions=[1, -1] * 2, step=1e-2))
    return room


@pytest.mark.slow
def test_each_recording_has_its_own_report_and_one_page_tells_of_all(folder, tmp_path, capsys):
    out = tmp_path / 'out'
    assert run('refine', [str(folder), '--each', '--output', str(out)]) == 0
    content = json.loads((out / 'report.json').read_text())
    assert_documented(content, 'refine --each')
    assert [Path(row['recording']).name for row in content['recordings']] == ['day_0', 'day_1']
    for row in content['recordings']:
        assert row['effects'][0]['name'] == 'gravity'
        assert row['after'] < 0.5 * row['before']
        for name in ('report.json', 'report.html', 'model.yaml'):
            assert (out / row['folder'] / name).stat().st_size > 0
        own = json.loads((out / row['folder'] / 'report.json').read_text())
        assert own['after']['held_out_rmse'] == row['after']
    assert len(content['failed']) == 1
    assert 'broken.mcap' in content['failed'][0]
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert 'href="day_0/report.html"' in page
    for text in (page, (out / 'day_0' / 'report.html').read_text(encoding='utf-8')):
        assert 'friction_comp refine' in text
    assert 'broken.mcap' in page
    told = capsys.readouterr().out
    assert told.startswith('2 of 3 refined')


ROBOTS = [f'/{robot}/joint_states/elbow' for robot in ('left', 'right')]


@pytest.fixture(scope='module')
def two_robots(tmp_path_factory):
    """A recording of joints with one name, whose signals are in the namespaces of two robots."""
    times, position, velocity = swing(1000, 0.02)
    noise = 0.01 * np.random.default_rng(1).normal(size=len(times))
    messages = []
    for time_, q, tau in zip(times, position, np.tanh(velocity / 0.02) + noise):
        stamp = 10**9 + round(1e9 * time_)
        for scale, robot in ((1.0, 'left'), (2.0, 'right')):
            messages += [(f'/{robot}/joint_states', stamp, joint_state(
                stamp, ['elbow'], [q], [], [scale * tau])), (
                f'/{robot}/interaction_wrench', stamp, wrench(stamp, 'elbow', scale))]
    return record_bag(tmp_path_factory.mktemp('two') / 'r', messages)


def test_each_of_two_robots_in_one_recording_is_a_joint_of_its_own(two_robots, tmp_path, capsys):
    pieces, failures = pieces_of([two_robots])
    assert [piece.joint for piece in pieces] == ROBOTS
    assert not failures
    found = evaluate_recordings([two_robots])
    assert [evaluation.joint for evaluation in found] == ROBOTS
    for evaluation, load in zip(found, (1.0, 2.0)):
        assert {condition.peak_torque for condition in evaluation.conditions} == {load}
    assert run('refine', [str(two_robots), '--output', str(tmp_path / 'one')]) == 2
    assert f"name one with --joint: '{ROBOTS[0]}', '{ROBOTS[1]}'" in capsys.readouterr().err


@pytest.mark.slow
def test_each_of_two_robots_in_one_recording_is_refined(two_robots, tmp_path):
    assert run('refine', [str(two_robots), '--each', '--output', str(tmp_path / 'out')]) == 0
    rows = json.loads((tmp_path / 'out' / 'report.json').read_text())['recordings']
    assert [(row['joint'], row['folder']) for row in rows] == [
        (name, f'r_{name.replace("/", "_")}') for name in ROBOTS]
    assert rows[1]['noise_floor'] == pytest.approx(2.0 * rows[0]['noise_floor'], rel=0.1)


def test_a_linear_axis_is_in_metres_and_newtons_on_every_page(tmp_path):
    times, position, velocity = swing(3000, 0.005)
    rng = np.random.default_rng(1)
    for name in 'ab':
        write(tmp_path / f'{name}.csv', **{
            't': times, 'pos [mm]': 100.0 * position,
            'force [N]': 30.0 * np.tanh(velocity / 0.02) + rng.standard_normal(len(times))})
    for command in (['--each'], []):
        out = tmp_path / f'out{len(command)}'
        assert run('refine', [*map(str, tmp_path.glob('*.csv')), *command, '--output', str(out)]
                   ) == 0
        for page in out.rglob('report.*'):
            text = page.read_text(encoding='utf-8')
            assert 'm/s' in text or page.parent == out
            assert 'N·m' not in text
            assert 'rad/s' not in text


@pytest.mark.slow
def test_an_interrupted_run_is_continued_and_what_changed_is_done_again(tmp_path):
    out, room = tmp_path / 'out', tmp_path / 'sessions'
    for day in range(2):
        write_samples(room / f'day_{day}', record(random_drive(3, ['gravity']), 40, excitation_for(
            ['gravity'], duration=4.0, rate=60.0))[0].samples)
    command = [str(room), '--each', '--jobs', '1', '--output', str(out)]
    assert run('refine', command) == 0
    first = {path: path.stat().st_mtime_ns for path in out.glob('*/report.json')}
    before = json.loads((out / 'report.json').read_text())
    # As after an interrupt, one recording is not done; another is not the same any more.
    (out / 'day_0' / 'resume.json').unlink()
    assert run('refine', command) == 0
    content = json.loads((out / 'report.json').read_text())
    assert content['taken_over'] == 1
    assert [row['after'] for row in content['recordings']] == [
        row['after'] for row in before['recordings']]
    changed = {path.parent.name for path, when in first.items() if path.stat().st_mtime_ns != when}
    assert changed == {'day_0'}
    for file in (room / 'day_1').iterdir():
        os.utime(file, (1e9, 1e9))
    assert run('refine', [*command, '--current-limit', '2']) == 0
    assert json.loads((out / 'report.json').read_text())['taken_over'] == 0


def test_a_program_gets_the_report_on_standard_output(tmp_path, capsys):
    write_samples(tmp_path / 't', trial([1.0] * 4, directions=[1, -1] * 2, step=1e-2))
    assert run('evaluate', [str(tmp_path / 't'), '--output', str(tmp_path / 'o'), '--json']) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(
        (tmp_path / 'o' / 'report.json').read_text())


def test_nothing_to_be_used_is_an_error(tmp_path, refuses):
    (tmp_path / 'a.mcap').write_bytes(b'no recording')
    (tmp_path / 'b.mcap').write_bytes(b'nor this')
    refuses('a.mcap', 'refine', tmp_path, '--each')


def test_many_processes_are_for_many_models(folder, refuses):
    refuses('--each', 'refine', folder, '--jobs', '2')


def test_a_bug_costs_one_item_of_many_and_is_raised_for_a_single_one():
    assert list(run_each(lambda x: 1 / x, [1, 0])) == [
        (0, 1.0), (1, Failure('0: ZeroDivisionError: division by zero'))]
    with pytest.raises(ZeroDivisionError):
        list(run_each(lambda x: 1 / x, [0]))


@pytest.mark.slow
def test_a_killed_process_costs_only_its_item():
    found = {}
    for number, outcome in run_each(work_that_may_die, list(range(6)), jobs=2):
        # Results that were not yet fetched when a process died are not lost either.
        time.sleep(0.0 if found else 1.0)
        found[number] = outcome
    assert sorted(found) == list(range(6))
    assert 'killed' in found[2].reason
    assert found[3] == Failure('3: not this one')
    others = [0, 1, 4, 5]
    assert [found[k][0] for k in others] == [k ** 2 for k in others]
    assert os.getpid() not in {found[k][1] for k in others}


def test_processes_are_started_only_where_they_save_time(tmp_path, monkeypatch):
    def no_process(*_):
        raise AssertionError('a process was started')
    monkeypatch.setattr(parallel, 'child_process', no_process)
    monkeypatch.setattr('os.cpu_count', lambda: 2)
    room = trials(tmp_path / 'r', 1)
    for k in range(1, 8):
        shutil.copytree(room / 't0', room / f't{k}')
    arguments = [str(room), '--output', str(tmp_path / 'out')]
    assert run('evaluate', arguments) == 0
    with pytest.raises(AssertionError, match='was started'):
        run('refine', [*arguments, '--each'])


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_done_and_leaves_no_process(tmp_path):
    """One of two processes has begun the last recording when the first one is done."""
    room, out = tmp_path / 'r', tmp_path / 'out'
    write_samples(room / 'day_0', record(random_drive(3, ['gravity']), 0, excitation_for(
        ['gravity'], duration=4.0, rate=60.0))[0].samples)
    for day in range(1, 3):
        shutil.copytree(room / 'day_0', room / f'day_{day}')
    process = subprocess.Popen(
        [sys.executable, str(ROOT / 'test' / 'work_that_may_die.py'), 'refine', str(room), '--each',
         '--jobs', '2', '--output', str(out)], env=environment(), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True)
    end = time.monotonic() + 300.0
    while not list(out.glob('*/model.yaml')):
        assert time.monotonic() < end
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    # As from a terminal: to all processes.
    os.killpg(process.pid, signal.SIGINT)
    told, errors = process.communicate(timeout=300.0)
    assert process.returncode == 130
    assert errors == ''
    content = json.loads((out / 'report.json').read_text())
    assert content['not_done'] == 2
    assert 'Interrupted' in told
    row, = content['recordings']
    assert np.isfinite(row['after'])
    end = time.monotonic() + 60.0
    while subprocess.run(['pgrep', '-s', str(process.pid)], stdout=subprocess.DEVNULL,
                         check=False).returncode == 0:
        assert time.monotonic() < end, 'processes are left behind'
        time.sleep(0.1)
