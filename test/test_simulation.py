# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated joints stick, slip and are the same in all uses; the note's experiments."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import json
import math

from helpers import note_model, undocumented
from node_process import shorten_scenes
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.direction.exercise import ReferenceMovement
from friction_comp.errors import InputError
from friction_comp.files import package_file
from friction_comp.note import experiments
from friction_comp.note.experiments import EXPERIMENTS
from friction_comp.recordings.reader import read_arm
from friction_comp.simulation.joint import ARRIVED, Plant
from friction_comp.simulation.mujoco_plant import MujocoPlant
from friction_comp.simulation.undeclared import Undeclared


def still(model, **changes):
    """Return a drive without scatter and noise."""
    both = replace(model.breakaway, positive_std=0.0, negative_std=0.0)
    return replace(model, breakaway=both, simulation={
        **model.simulation, 'current_noise': 0.0, **changes})


@pytest.mark.parametrize('number', [1, 2, 3])
def test_holds_below_breakaway_and_slides_above(number):
    """A current of 98 % of i_b moves nothing for good, one of 112 % does."""
    model = still(note_model(number))
    level = model.breakaway.positive_mean
    for share, slides in ((0.98, False), (1.12, True), (-0.98, False), (-1.12, True)):
        plant = Plant([model])
        for k in range(4000):
            state = plant.step([share * level * min(1.0, k / 2000)])
        gone = abs(state.position[0])
        assert (gone > math.radians(1.0)) == slides
        if not slides:
            for _ in range(1500):
                state = plant.step([0.0])
            assert abs(state.position[0]) <= 2.0 * model.drive.position_resolution


def test_sensors_quantise_and_limit():
    """Position comes in whole counts, commands are limited, what is not finite counts as zero."""
    model = note_model(1)
    plant = Plant([model, model], seed=3)
    for command in ([99.0, math.nan], [99.0, math.inf], [99.0, -math.inf]):
        state = plant.step(command)
    assert state.current[0] == pytest.approx(model.drive.current_limit, abs=0.02)
    assert abs(state.current[1]) < 0.02
    for _ in range(50):
        state = plant.step([0.5, 0.0])
        counts = state.position / model.drive.position_resolution
        assert np.allclose(counts, np.round(counts), atol=1e-6)


def test_same_seed_same_numbers():
    def run(seed):
        plant = Plant([note_model(k) for k in (1, 2, 3)], seed=seed)
        states = [plant.step([0.2, 0.2, 0.5], np.full(3, 0.1), np.zeros(3)) for _ in range(300)]
        return np.array([(s.position, s.current, s.interaction_torque) for s in states])
    assert np.array_equal(run(5), run(5))
    assert not np.array_equal(run(5), run(6))


def test_movement_is_continuous_and_announced_at_standstill():
    """The reference has no jump, comes back, and d is there before the movement."""
    movement = ReferenceMovement(repetitions=3)
    time = np.arange(0.0, movement.duration, 1e-3)
    position, velocity, direction = movement.at(time)
    assert np.abs(np.diff(position)).max() <= 1.01e-3 * movement.speed
    assert np.abs(np.cumsum(velocity) * 1e-3 - position).max() < 1e-3
    assert position[0] == position[-1] == 0.0
    assert np.isclose(position.max(), movement.amplitude)
    for k in range(6):
        begin = movement.begins(k)
        _, speed, d = movement.at(begin - 0.5 * movement.announcement)
        assert speed == 0.0
        assert d == (1 if k % 2 == 0 else -1)
    assert set(np.unique(direction)) == {-1, 0, 1}
    assert not replace(movement, compensated=False).at(time)[2].any()


@pytest.mark.parametrize('changes, words', [
    ({'amplitude': 0.01, 'speed': 1.0}, 'too short'), ({'amplitude': math.nan}, 'amplitude'),
    ({'standstill': 0.0}, 'standstill'), ({'announcement': 60.0}, 'announcement'),
    ({'repetitions': 0}, 'repetitions')])
def test_movement_refuses_what_cannot_be(changes, words):
    with pytest.raises(InputError, match=words):
        ReferenceMovement(**changes)


def test_an_undeclared_torque_beyond_friction_sets_the_joint_in_motion():
    extra = Undeclared.from_effects([{'name': 'offset', 'parameters': {'torque': 2.0}}])
    plant = Plant([note_model(1)], undeclared=[extra])
    for _ in range(500):
        state = plant.step([0.0])
    assert state.position[0] < -0.05


def test_what_is_not_known_of_a_simulation_is_refused():
    with pytest.raises(InputError, match='inertai'):
        Plant([note_model(1, inertai=0.1)])


def rests(person):
    """Return where a joint comes to rest after a movement of 0.5 rad, and what set it in motion.

    The drive is that of configuration 1, whose breakaway the person's spring alone stays below.
    """
    model = still(note_model(1))
    human = {**model.simulation['human'], 'stiffness': 1.0, **person}
    plant = Plant([replace(model, simulation={**model.simulation, 'human': human})])
    states = [plant.step([0.0], [0.5], [0.0]) for _ in range(3000)]
    return states[-1].position[0], max(
        s.interaction_torque[0] for s in states if s.position[0] < 0.001)


def test_the_person_pushes_on_until_the_joint_has_arrived():
    """What sets the joint in motion is its breakaway torque, not what the spring happens to be."""
    model = note_model(1)
    level = model.breakaway.positive_mean * model.drive.torque_per_current
    end, push = rests({})
    assert abs(end - 0.5) <= ARRIVED
    assert push == pytest.approx(level, rel=0.05)
    # A person who does not keep pushing leaves it where it is.
    end, push = rests({'integral_time': 0.0})
    assert abs(end) < 1e-3
    assert push < 0.6


# The plant with links that MuJoCo simulates.

ARM = package_file('config', 'arms', 'guided_arm.xml')
WHEEL = """<mujoco><worldbody><body><inertial pos="0 0 0" mass="1e-6"
diaginertia="1e-9 1e-9 1e-9"/><joint name="a" axis="0 0 1"/></body></worldbody></mujoco>"""


def drive(number, **simulation):
    return note_model(number, current_noise=0.0, **simulation)


def arm(**options):
    return MujocoPlant(ARM, ['turn', 'lift', 'bend'], [drive(1), drive(2), drive(1)], **options)


@pytest.fixture
def engine():
    pytest.importorskip('mujoco', reason='MuJoCo is not in this environment')


@pytest.mark.parametrize('number', [1, 2, 3])
def test_a_joint_without_a_link_moves_as_with_our_own_engine(engine, number, tmp_path):
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


@pytest.mark.parametrize('make, words', [
    (lambda room: MujocoPlant(room / 'missing.xml', ['a'], [drive(1)]), 'there is no such file'),
    (lambda room: MujocoPlant(ARM, ['knee'], [drive(1)]), "no joint 'knee'; it has turn"),
    (lambda room: MujocoPlant(ARM, ['turn'], [drive(1), drive(2)]), 'one model per joint'),
    (lambda room: MujocoPlant(room / 'bad.xml', ['turn'], [drive(1)]), 'MuJoCo cannot read it')])
def test_wrong_input_is_named(engine, make, words, tmp_path):
    (tmp_path / 'bad.xml').write_text('<mujoco><nonsense/></mujoco>', encoding='utf-8')
    with pytest.raises(InputError, match=words):
        make(tmp_path)


@pytest.mark.slow
@pytest.mark.processes
def test_a_guided_arm_is_learnt_and_carried(engine, tmp_path, monkeypatch):
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
    guided = read_arm(tmp_path / 'recordings' / 'taught', lambda joint: 11.9)
    assert not any(parts[0][0].direction.any() for parts in guided.values())


# The note's experiments with few repetitions.

@pytest.mark.slow
def test_the_experiments_of_the_note(tmp_path, monkeypatch):
    """Every floor holds, and the numbers are there."""
    # Two minutes instead of an hour, few samples, and no process: that one is the next
    # test's.
    monkeypatch.setattr(experiments, 'STANDSTILLS', 12)
    monkeypatch.setattr(experiments, 'IDENTIFIED_EVERY', 8e-3)
    monkeypatch.setattr(experiments, 'child_process', lambda: ThreadPoolExecutor(1))
    assert run('reproduce', ['--cycles', '30', '--output', str(tmp_path / 'out')]) == 0
    results = json.loads((tmp_path / 'out' / 'results.json').read_text(encoding='utf-8'))
    assert undocumented(results) == set()
    for experiment in EXPERIMENTS:
        found = results['configurations'][str(experiment.number)]
        peaks, reductions = found['peak_torque'], found['peak_reduction']
        breakaway = found['breakaway']
        assert breakaway['cycles'] == 30
        for side, sign in (('positive', 1.0), ('negative', -1.0)):
            assert sign * breakaway[f'{side}_mean'] == pytest.approx(experiment.breakaway, rel=0.03)
            assert breakaway[f'{side}_std'] == pytest.approx(experiment.breakaway_std, rel=0.5)
        assert len(found['sigmoid']) == 6
        assert len(found['speeds']) == len(found['currents']) == 2 * len(experiment.speeds)
        assert peaks['kinetic'] == pytest.approx(experiment.peak_kinetic, rel=0.05)
        assert abs(reductions['paper'] - experiment.reduction) < 0.15
        friction = peaks['none'] - peaks['inertia']
        assert peaks['none'] - peaks['continuous'] >= 0.8 * friction
        assert peaks['inertia'] < peaks['continuous'] < peaks['kinetic']
        assert peaks['paper'] < peaks['kinetic']
        assert peaks['kinetic'] < peaks['none']
        assert found['false_starts'] == {'paper': 0, 'continuous': 0}
