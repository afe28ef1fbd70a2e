# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings and robots: one that fails costs only itself; units are compared."""

import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time

from helpers import swing, undocumented
from node_process import environment
import numpy as np
import pytest
from recording_maker import joint_state, record as record_bag, wrench
from work_that_may_die import work_that_may_die

from friction_comp.__main__ import run
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.evaluation.fleet import populations_of, units_out
from friction_comp.parallel import Failure, run_each, runner_on_cluster
from friction_comp.recordings.reader import pieces_of
from friction_comp.recordings.writer import write_samples
from friction_comp.reports.other_pages import each_page
from simulated_recordings import excitation_for, random_drive, record


def write_recording(path, seed=40, **options):
    """Write a short recording of one drive that hides gravity."""
    samples = record(random_drive(3, ['gravity']), seed, excitation_for(
        ['gravity'], **{'duration': 4.0, 'rate': 60.0, **options}))[0]
    write_samples(path, samples)


def refined_each(out, *arguments):
    """Run refine on each recording; return the summary."""
    assert run('refine', [*map(str, arguments), '--each', '--output', str(out)]) == 0
    return json.loads((out / 'report.json').read_text())


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Four recordings, and one that cannot be read."""
    room = tmp_path_factory.mktemp('many') / 'sessions'
    for k in range(4):
        write_recording(room / f'day_{k}', 40 + k, duration=8.0, rate=125.0)
    (room / 'broken.mcap').write_bytes(b'no recording')
    return room


@pytest.mark.slow
def test_each_recording_has_its_own_report_and_one_page_tells_of_all(folder, tmp_path, refuses):
    out = tmp_path / 'out'
    content = refined_each(out, folder)
    assert undocumented(content) == set()
    assert [Path(row['recording']).name for row in content['recordings']] == [
        f'day_{k}' for k in range(4)]
    for row in content['recordings']:
        assert row['effects'][0]['name'] == 'gravity'
        assert row['after'] < 0.5 * row['before']
        assert (out / row['folder'] / 'model.yaml').stat().st_size > 0
        own = json.loads((out / row['folder'] / 'report.json').read_text())
        assert own['after']['held_out_rmse'] == row['after']
    failed, = content['failed']
    assert 'broken.mcap' in failed
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert 'href="day_0/report.html"' in page
    assert 'broken.mcap' in page
    joint, = json.loads((out / 'fleet.json').read_text())['joints']
    assert (joint['units'], joint['out']) == ([f'day_{k}' for k in range(4)], {})
    refuses('broken.mcap', 'refine', folder / 'broken.mcap', '--each')


@pytest.mark.slow
def test_each_of_two_robots_in_one_recording_is_a_joint_of_its_own(tmp_path, refuses):
    """Joints of one name, whose signals are in the namespaces of two robots."""
    times, position, velocity = swing(1000, 0.02)
    noise = 0.01 * np.random.default_rng(1).normal(size=len(times))
    messages = []
    for time_, q, tau in zip(times, position, np.tanh(velocity / 0.02) + noise):
        stamp = 10**9 + round(1e9 * time_)
        for scale, robot in ((1.0, 'left'), (2.0, 'right')):
            messages += [(f'/{robot}/joint_states', stamp, joint_state(
                stamp, ['elbow'], [q], [], [scale * tau])), (
                f'/{robot}/interaction_wrench', stamp, wrench(stamp, 'elbow', scale))]
    path = record_bag(tmp_path / 'r', messages)
    robots = [f'/{robot}/joint_states/elbow' for robot in ('left', 'right')]
    pieces, failures = pieces_of([path])
    assert [piece.joint for piece in pieces] == robots
    assert not failures
    assert [{condition.peak_torque for condition in evaluation.conditions}
            for evaluation in evaluate_recordings([path])] == [{1.0}, {2.0}]
    refuses(f"name one with --joint: '{robots[0]}', '{robots[1]}'", 'refine', path)
    rows = refined_each(tmp_path / 'out', path)['recordings']
    assert [(row['joint'], row['folder']) for row in rows] == [
        (name, f'r_{name.replace("/", "_")}') for name in robots]
    assert rows[1]['noise_floor'] == pytest.approx(2.0 * rows[0]['noise_floor'], rel=0.1)


def test_a_bug_costs_one_item_of_many_and_is_raised_for_a_single_one():
    assert list(run_each(lambda x: 1 / x, [1, 0])) == [
        (0, 1.0), (1, Failure('0: ZeroDivisionError: division by zero'))]
    with pytest.raises(ZeroDivisionError):
        list(run_each(lambda x: 1 / x, [0]))


def work_in(folder):
    return [(number, folder / 'died' if number == 2 else None) for number in range(6)]


@pytest.mark.slow
def test_a_killed_process_costs_only_its_item(tmp_path):
    found = {}
    for number, outcome in run_each(work_that_may_die, work_in(tmp_path), jobs=2):
        # Results that were not yet fetched when a process died are not lost either.
        time.sleep(0.0 if found else 1.0)
        found[number] = outcome
    assert sorted(found) == list(range(6))
    assert 'killed' in found[2].reason
    assert found[3] == Failure('3: not this one')
    others = [found[k] for k in (0, 1, 4, 5)]
    assert [number for number, _ in others] == [0, 1, 4, 5]
    assert os.getpid() not in {process for _, process in others}


@pytest.mark.slow
def test_an_interrupt_keeps_what_is_done_and_leaves_no_process(tmp_path):
    room, out = tmp_path / 'r', tmp_path / 'out'
    write_recording(room / 'day_0')
    for day in range(1, 8):
        shutil.copytree(room / 'day_0', room / f'day_{day}')
    process = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'refine', room, '--each', '--output', out],
        env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True)
    end = time.monotonic() + 300.0
    while not list(out.glob('*/model.yaml')):
        assert time.monotonic() < end
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.05)
    # As from a terminal: to all processes.
    os.killpg(process.pid, signal.SIGINT)
    told, errors = process.communicate(timeout=300.0)
    assert (process.returncode, errors) == (130, '')
    assert told == ''
    for model in out.glob('*/model.yaml'):
        report = json.loads((model.parent / 'report.json').read_text())
        assert np.isfinite(report['after']['held_out_rmse'])
    end = time.monotonic() + 60.0
    while subprocess.run(['pgrep', '-s', str(process.pid)], stdout=subprocess.DEVNULL,
                         check=False).returncode == 0:
        assert time.monotonic() < end, 'processes are left behind'
        time.sleep(0.1)


# A fleet.

NOMINAL = {'coulomb': (0.5, 0.08), 'viscous': (0.2, 0.12), 'inertia': (0.05, 0.03)}
ERROR = 0.01    # of measurement, as a share


def drawn(unit):
    """Return the factors of a unit's numbers."""
    rng = np.random.default_rng([unit, 1])
    return {name: np.exp(spread * rng.standard_normal()) for name, (_, spread) in NOMINAL.items()}


def fleet(units, odd, days=1):
    """Return rows of a fleet's recordings; `odd` has further factors of some units."""
    rows = []
    for unit in range(units):
        for day in range(days):
            rng = np.random.default_rng([unit, day, 2])
            numbers = {name: value * drawn(unit)[name] * odd.get(unit, {}).get(name, 1.0)
                       * (1.0 + ERROR * rng.standard_normal())
                       for name, (value, _) in NOMINAL.items()}
            friction = {name: [value, value * (1.0 - 2.0 * ERROR), value * (1.0 + 2.0 * ERROR)]
                        for name, value in numbers.items()}
            offset = 0.001 * rng.standard_normal()
            friction['offset'] = [offset, offset - 0.002, offset + 0.002]
            rows.append({'joint': 'elbow', 'unit': 'A', 'robot': f'unit_{unit:02d}',
                         'friction': friction})
    return rows


@pytest.fixture(scope='module', params=[1, 2], ids=['one day', 'two days'])
def population(request):
    found, = populations_of(fleet(
        40, {4: {'coulomb': 1.6}, 31: {'inertia': 1.4}}, request.param))
    return found


def test_odd_units_of_forty_are_found_and_no_other(population):
    assert population.out == {'unit_04': ['Coulomb'], 'unit_31': ['inertia']}
    page = each_page({'recordings': [], 'failed': []}, [population]).html()
    for text in ('Look at 2 of 40 units', 'unit_31', 'fleet.json'):
        assert text in page
    assert populations_of(fleet(3, {})) == []


def test_mean_spread_and_range_are_those_of_the_population(population):
    by_name = {one.name: one for one in population.parameters}
    usual = [drawn(unit) for unit in range(40)]
    for title, name, odd in (('Coulomb', 'coulomb', 4), ('viscous', 'viscous', None),
                             ('inertia', 'inertia', 31)):
        true = np.log([NOMINAL[name][0] * factors[name] for unit, factors in enumerate(usual)
                       if unit != odd])
        one = by_name[title]
        assert one.scale == 'logarithmic'
        assert one.spread == pytest.approx(true.std(ddof=1), rel=0.15)
        assert np.log(one.mean) == pytest.approx(true.mean(), abs=0.03)
        assert one.varies
        # 95 % of units: two spreads on either side.
        assert np.log(one.range[1] / one.mean) == pytest.approx(2.03 * one.spread, rel=0.1)
    assert not by_name['offset'].varies


def test_odd_units_do_not_hide_each_other_and_a_clean_fleet_has_none():
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(60):
        value, error = rng.standard_normal(30), np.full(30, 0.3)
        value += error * rng.standard_normal(30)
        alarms += units_out(value, error).any()
    assert alarms <= 8
    # Three at the same place shift mean and spread so far that none of them is extreme alone.
    value[:3] = 7.0
    assert np.nonzero(units_out(value, error, 8))[0].tolist() == [0, 1, 2]
    assert not (np.abs(value - value.mean()) > 3 * value.std(ddof=1)).any()


# On a Dask cluster: the same results as here, and none is lost where a worker is killed.


def cluster(workers, processes):
    """Return workers of this machine; Dask takes a second to import."""
    distributed = pytest.importorskip('distributed', reason='Dask is not installed')
    return distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=processes, dashboard_address=None)


@pytest.mark.slow
def test_a_killed_worker_costs_nothing(tmp_path):
    with cluster(2, True) as made, runner_on_cluster(made.scheduler_address) as work_on:
        found = dict(work_on(work_that_may_die, work_in(tmp_path)))
    assert (tmp_path / 'died').exists()
    assert found.pop(3) == Failure('3: not this one')
    assert {index: outcome[0] for index, outcome in found.items()} == {0: 0, 1: 1, 2: 2, 4: 4, 5: 5}


@pytest.mark.slow
def test_recordings_are_refined_on_the_cluster_as_here(tmp_path):
    """On a worker in this process: that work and results pass between processes, others say."""
    write_recording(tmp_path / 'robots' / 'one_day', 4)
    with cluster(1, False) as made:
        here, there = (refined_each(tmp_path / where, tmp_path / 'robots', *more)['recordings']
                       for where, more in (('here', []), ('there', [
                           '--scheduler', made.scheduler_address])))
    assert here == there
    assert (tmp_path / 'there' / 'one_day' / 'model.yaml').is_file()


def test_a_scheduler_that_does_not_answer_is_named(tmp_path, refuses, monkeypatch):
    pytest.importorskip('distributed', reason='Dask is not installed')
    monkeypatch.setattr('friction_comp.parallel._PATIENCE', 0.2)
    write_recording(tmp_path / 'day')
    for words, address, *each in (
            ('no Dask scheduler answers', 'tcp://127.0.0.1:1', '--each'),
            ('--scheduler goes with --each', 'tcp://127.0.0.1:1')):
        refuses(words, 'refine', tmp_path / 'day', *each, '--scheduler', address)
