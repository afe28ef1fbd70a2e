# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The demo as a user starts and stops it, and the processes that it runs."""

import json
import os
from pathlib import Path
import subprocess
import sys
import time

from helpers import undocumented
from node_process import ROOT, shorten_scenes
import pytest

from friction_comp.__main__ import run
from friction_comp.demo.processes import only_user
from friction_comp.errors import InputError

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')

from friction_comp.demo import scenes


def test_a_second_demo_into_the_folder_of_a_running_one_is_refused(tmp_path, capsys):
    def of_ros():
        return {name: value for name, value in os.environ.items()
                if name.startswith(('ROS_', 'FASTRTPS_'))}
    model, before = tmp_path / 'room' / 'models' / 'elbow.yaml', of_ros()
    with only_user(tmp_path / 'room'):
        (tmp_path / 'room' / '.demo').touch()
        model.parent.mkdir()
        model.write_text('of the first demo')
        assert run('demo', ['--output', str(tmp_path / 'room')]) == 2
        assert 'another run is writing there' in capsys.readouterr().err
    assert model.exists()
    # A ROS domain that is no longer reserved may become that of another process.
    assert of_ros() == before
    with only_user(tmp_path / 'room'):
        pass


def test_a_demo_removes_only_results_of_a_demo(tmp_path):
    own = tmp_path / 'recordings' / 'mine.mcap'
    own.parent.mkdir()
    own.write_text('not to be lost')
    with pytest.raises(InputError, match='recordings: is there already and not of a demo'):
        scenes.clear_results(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ['recordings']
    own.unlink()
    scenes.clear_results(tmp_path)
    (tmp_path / 'models' / 'elbow.yaml').write_text('of the first demo')
    scenes.clear_results(tmp_path)
    assert not list((tmp_path / 'models').iterdir())


def alive(folder):
    """Processes that were started for this folder."""
    found = []
    for entry in Path('/proc').iterdir():
        try:
            if entry.name.isdigit() and str(folder).encode() in (entry / 'cmdline').read_bytes():
                found.append(entry.name)
        except OSError:
            pass
    return found


@pytest.mark.slow
@pytest.mark.skipif(not Path('/proc/self/cmdline').exists(), reason='needs /proc')
def test_an_interrupted_demo_leaves_no_process(tmp_path):
    folder = tmp_path / 'room'
    process = subprocess.Popen(
        [sys.executable, '-m', 'friction_comp', 'demo', '--output', str(folder)],
        env=dict(os.environ, PYTHONPATH=str(ROOT)), cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    end = time.monotonic() + 120.0
    while len(alive(folder)) < 3:
        assert time.monotonic() < end, 'the demo starts no nodes'
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.1)
    process.terminate()
    output, _ = process.communicate(timeout=60.0)
    assert process.returncode == 143
    assert 'Traceback' not in output
    assert alive(folder) == []


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """Return what runs a scene, as short as it can be, and returns what it found."""
    shorten_scenes(monkeypatch, tmp_path)

    def play(name):
        assert run('demo', ['--scene', name, '--repetitions', '1', '--output', str(tmp_path)]) == 0
        page = (tmp_path / 'report.html').read_text(encoding='utf-8')
        assert '<svg' in page or '<img' in page
        found = json.loads((tmp_path / 'report.json').read_text(encoding='utf-8'))
        assert undocumented(found) == set()
        return found
    return play


@pytest.mark.slow
def test_a_hand_that_goes_to_and_fro_feels_less_friction_than_with_a_hyperbolic_tangent(
        scene, monkeypatch):
    monkeypatch.setattr(scenes, 'WAYS', [
        way for way in scenes.WAYS if way[0] != 'unknown'])
    found = scene('to_and_fro')
    removed = {one['name']: one['removed'] for one in found['to_and_fro']}
    assert removed['none'] == 0.0
    assert 0.4 < removed['tanh'] < removed['announced'] - 0.05
    # A joint without friction takes the same in all of them.
    rms = {one['name']: one['rms_torque'] for one in found['to_and_fro']}
    assert found['inertia_rms'] < rms['announced'] < 0.5 * rms['none']
