# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The plant with links that MuJoCo simulates."""

import json

from helpers import note_model
from node_process import shorten_scenes
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.package_files import package_file
from friction_comp.recordings import read_arm
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.mujoco_plant import MujocoPlant
from friction_comp.simulation.undeclared import Undeclared

ARM = package_file('config', 'arms', 'guided_arm.xml')
WHEEL = """<mujoco><worldbody><body><inertial pos="0 0 0" mass="1e-6"
diaginertia="1e-9 1e-9 1e-9"/><joint name="a" axis="0 0 1"/></body></worldbody></mujoco>"""


def drive(number, **simulation):
    return note_model(number, current_noise=0.0, **simulation)


def arm(**options):
    return MujocoPlant(ARM, ['turn', 'lift', 'bend'], [drive(1), drive(2), drive(1)], **options)


@pytest.fixture(autouse=True)
def engine():
    pytest.importorskip('mujoco', reason='MuJoCo is not in this environment')


@pytest.mark.parametrize('number', [1, 2, 3])
def test_a_joint_without_a_link_moves_as_with_our_own_engine(number, tmp_path):
    (tmp_path / 'wheel.xml').write_text(WHEEL, encoding='utf-8')
    model = drive(number)
    level = model.breakaway.positive_mean
    ripple = Undeclared.from_effects([{'name': 'friction_ripple', 'parameters': {
        'amplitude': 0.2 * level * model.drive.torque_per_current, 'frequency': 24.0}}])
    plants = (MujocoPlant(tmp_path / 'wheel.xml', ['a'], [model], 3, [ripple]),
              Plant([model], 3, [ripple]))
    moved = []
    for plant in plants:
        rows = []
        for k in range(3000):
            # Half of a period below breakaway, then over it, both ways.
            current = 1.6 * level * np.sin(2.0 * np.pi * k / 1500.0)
            state = plant.step([current])
            rows.append([state.position[0], state.current[0]])
        moved.append(np.array(rows))
    own, other = moved
    assert np.ptp(other[:, 0]) > 0.05
    np.testing.assert_allclose(own[:, 0], other[:, 0], atol=0.02 * np.ptp(other[:, 0]))
    np.testing.assert_array_equal(own[:, 1], other[:, 1])
    # Both stick until the current breaks them free.
    assert np.abs(own[:100, 0]).max() < 0.02 * np.ptp(other[:, 0])


def test_the_same_seed_gives_the_same_numbers():
    one, other = arm(seed=4), arm(seed=4)
    for k in range(300):
        currents = [0.1, 0.4, -0.1] if k < 200 else [0.0, 0.0, 0.0]
        a, b = one.step(currents), other.step(currents)
    np.testing.assert_array_equal(a.position, b.position)
    np.testing.assert_array_equal(a.current, b.current)


@pytest.mark.parametrize('make, words', [
    (lambda room: MujocoPlant(room / 'missing.xml', ['a'], [drive(1)]), 'there is no such file'),
    (lambda room: MujocoPlant(ARM, ['knee'], [drive(1)]), "no joint 'knee'; it has turn"),
    (lambda room: MujocoPlant(ARM, ['turn'], [drive(1), drive(2)]), 'one model per joint'),
    (lambda room: MujocoPlant(ARM, ['turn'], [drive(1, gear='clamp')]), 'simulates the links'),
    (lambda room: MujocoPlant(room / 'bad.xml', ['turn'], [drive(1)]), 'MuJoCo cannot read it')])
def test_wrong_input_is_named(make, words, tmp_path):
    (tmp_path / 'bad.xml').write_text('<mujoco><nonsense/></mujoco>', encoding='utf-8')
    with pytest.raises(InputError, match=words):
        make(tmp_path)


@pytest.mark.slow
@pytest.mark.processes
def test_a_guided_arm_is_learnt_and_carried(tmp_path, monkeypatch):
    """The demo's scene: taught, replayed alone, refined from that, replayed with help."""
    pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')
    pytest.importorskip('pinocchio', reason='Pinocchio is not in this environment')
    shorten_scenes(monkeypatch, tmp_path)
    assert run('demo', ['--scene', 'arm', '--output', str(tmp_path)]) == 0
    report = json.loads((tmp_path / 'report.json').read_text(encoding='utf-8'))
    alone, helped = (np.array([own[name]['rms'] for own in report['joints'].values()])
                     for name in ('alone', 'helped'))
    assert (helped < 0.4 * alone).all()
    assert np.hypot.reduce(helped) < 0.25 * np.hypot.reduce(alone)
    masses = {body['joint']: body['mass'] for body in report['arm']['rigid_bodies']}
    # The cuff's 0.6 kg, which the URDF does not know of, beside the forearm's 0.7.
    assert masses['bend'] == pytest.approx(1.3, abs=0.15)
    # What was guided is what is played: each waypoint and each reversal, which nobody announced.
    taught = report['taught']
    assert taught['farthest']['guided'] < 1.0
    assert taught['farthest']['helped'] < 1.0
    assert taught['announced'] == taught['reversals'] > 3
    guided = read_arm(tmp_path / 'recordings' / 'taught', lambda joint: 11.9)
    assert not any(parts[0][0].direction.any() for parts in guided.values())
    assert 'discs at shoulder and elbow' in (tmp_path / 'report.html').read_text(encoding='utf-8')
