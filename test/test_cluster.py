# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Work on a Dask cluster: the same results as here, and none is lost where a worker is killed."""

import json

import pytest
from work_that_may_die import work_that_ends_a_worker_once

from friction_comp.__main__ import run
from friction_comp.cluster import runner_on_cluster
from friction_comp.parallel import Failure
from friction_comp.recordings import write_samples
from simulated_recordings.drives import excitation_for, random_drive, record


def write_recording(path):
    write_samples(path, record(random_drive(3, ['gravity']), 4, excitation_for(
        ['gravity'], duration=4.0, rate=60.0))[0].samples)


@pytest.fixture(autouse=True)
def distributed():
    """Dask, which takes a second: not imported by every process that collects this module."""
    return pytest.importorskip('distributed', reason='Dask is not installed')


def cluster(workers, processes):
    from distributed import LocalCluster
    return LocalCluster(n_workers=workers, threads_per_worker=1, processes=processes,
                        dashboard_address=None)


@pytest.mark.slow
def test_a_killed_worker_costs_nothing(tmp_path):
    items = [(number, tmp_path / 'died' if number == 2 else None) for number in range(6)]
    with cluster(2, True) as made, runner_on_cluster(made.scheduler_address) as work_on:
        found = dict(work_on(work_that_ends_a_worker_once, items))
    assert (tmp_path / 'died').exists()
    assert found.pop(3) == Failure('3: not this one')
    assert {index: outcome[0] for index, outcome in found.items()} == {0: 0, 1: 1, 2: 2, 4: 4, 5: 5}


@pytest.mark.slow
def test_recordings_are_refined_on_the_cluster_as_here(tmp_path):
    """On a worker in this process: that work and results pass between processes, others say."""
    write_recording(tmp_path / 'robots' / 'one_day')
    rows = {}
    with cluster(1, False) as made:
        for where, more in (('here', ['--jobs', '1']), ('there', [
                '--scheduler', made.scheduler_address])):
            out = tmp_path / where
            assert run('refine', [
                str(tmp_path / 'robots'), '--each', '--output', str(out), *more]) == 0
            rows[where] = [{name: value for name, value in row.items() if name != 'seconds'}
                           for row in json.loads((out / 'report.json').read_text())['recordings']]
    assert rows['here'] == rows['there']
    assert (tmp_path / 'there' / 'one_day' / 'model.yaml').is_file()


def test_a_scheduler_that_does_not_answer_is_named(tmp_path, refuses, monkeypatch):
    monkeypatch.setattr('friction_comp.cluster._PATIENCE', 0.2)
    write_recording(tmp_path / 'day')
    refuses('no Dask scheduler answers', 'refine', tmp_path / 'day', '--each',
            '--scheduler', 'tcp://127.0.0.1:1')
    for incomplete in ('nonsense', 'tcp://host', 'host:eight'):
        refuses('an address has a host and a port', 'refine', tmp_path / 'day', '--each',
                '--scheduler', incomplete)
    refuses('--scheduler goes with --each', 'refine', tmp_path / 'day',
            '--scheduler', 'tcp://127.0.0.1:1')
