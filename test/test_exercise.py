# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Exercises from YAML or from a guided movement: positions and announced directions of joints."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
import yaml

from friction_comp.__main__ import run
from friction_comp.direction.exercise import exercise_of, load_exercise, ReferenceMovement, teach
from friction_comp.errors import InputError
from friction_comp.files import package_file, write_yaml
from friction_comp.recordings import write_samples
from friction_comp.samples import Samples

EXAMPLE = package_file('config', 'exercises', 'two_joints.yaml')


def test_one_joint_turns_round_while_the_other_goes_on_and_both_are_announced():
    script = load_exercise(EXAMPLE)
    time = np.arange(0.0, script.duration, 0.005)
    position, velocity, direction = map(np.array, zip(*(script.at(t) for t in time)))
    assert {(1, 1), (1, -1), (0, 0)} <= {tuple(row) for row in direction.tolist()}
    turns = [k for k in range(1, len(time)) if direction[k, 1] == -direction[k - 1, 1] != 0]
    assert turns
    for k in turns:
        assert abs(velocity[k, 1]) < 0.01, 'the direction changes where the joint turns round'
        assert abs(velocity[k, 0]) > 0.1, 'the other joint goes on'
        assert direction[k, 0] != 0
    np.testing.assert_allclose(position.max(axis=0), np.radians([30.0, 20.0]), atol=1e-3)
    np.testing.assert_allclose(position[-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(np.gradient(position, time, axis=0), velocity, atol=0.02)
    # Movements from rest are announced a second ahead.
    for joint in range(2):
        moving = np.abs(velocity[:, joint]) > 1e-6
        for start in np.nonzero(moving[1:] & ~moving[:-1])[0] + 1:
            if np.abs(velocity[max(0, start - 200):start, joint]).max() < 1e-6:
                assert direction[start - 190:start, joint].all()


def test_a_node_with_more_joints_holds_the_others():
    script = load_exercise(EXAMPLE).of(['wrist', 'elbow', 'shoulder'])
    position, velocity, direction = script.at(2.0)
    plain = load_exercise(EXAMPLE).at(2.0)
    assert position[0] == velocity[0] == direction[0] == 0
    np.testing.assert_array_equal(position[[2, 1]], plain[0])
    np.testing.assert_array_equal(direction[[2, 1]], plain[2])
    with pytest.raises(InputError, match='shoulder'):
        load_exercise(EXAMPLE).of(['elbow'])


@given(st.lists(st.tuples(st.floats(-90, 90), st.floats(0.3, 5.0), st.booleans()),
                min_size=1, max_size=8), st.floats(0.0, 3.0))
def test_any_movement_is_announced_only_in_its_own_direction(points, announcement):
    steps, here = [{'hold': 1.0}], 0.0
    for angle, seconds, rest in points:
        if abs(angle - here) < 1e-3:
            continue
        steps.append({'to': {'elbow': angle}, 'time': seconds})
        here = angle
        if rest:
            steps.append({'hold': 0.5})
    script = exercise_of({'format': 'friction_comp_exercise', 'version': 1, 'unit': 'deg',
                          'joints': ['elbow'], 'announcement': announcement, 'steps': steps})
    for t in np.linspace(-0.1, script.duration + 0.1, 400):
        position, velocity, direction = script.at(t)
        assert np.isfinite([*position, *velocity]).all()
        assert velocity[0] * direction[0] >= -1e-9
    assert script.at(script.duration)[1] == pytest.approx(0.0, abs=1e-9)
    assert script.at(script.duration + 1.0)[2][0] == 0


@pytest.mark.parametrize(('path', 'value', 'words'), [
    (['format'], 'other', 'format'), (['version'], 2, 'version'), (['unit'], ['deg'], 'unit'),
    (['joints'], ['elbow', 'elbow'], 'joints'), (['repetitions'], 10**9, 'to 10000'),
    (['announcement'], -1, 'announcement'), (['speed'], 1, 'unknown'), (['steps'], [], 'steps'),
    (['steps', 0], {'hold': 0}, r'steps\[1\].hold'),
    (['steps', 0], {'to': {'elbow': 10}, 'time': 1.0}, 'must be a hold'),
    (['steps', 1], {'to': {'knee': 10}, 'time': 1.0}, r'steps\[2\].to has unknown entries: knee;'),
    (['steps', 1], {'to': {'elbow': float('nan')}, 'time': 1.0}, r'steps\[2\].to.elbow'),
    (['steps', 1], {'to': {'elbow': 10}, 'time': 1.0, 'speed': 2.0}, r'steps\[2\]'),
    (['steps', 1], {'to': {'elbow': 0}, 'time': 1.0}, 'moves nothing'),
    (['steps', 4], {'to': {'elbow': 5}, 'time': 1.0}, 'lead back')])
def test_what_cannot_be_used_is_named(path, value, words):
    document = place = yaml.safe_load(EXAMPLE.read_text(encoding='utf-8'))
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(InputError, match=words):
        exercise_of(document)
    with pytest.raises(InputError, match='not an exercise'):
        exercise_of([value])


def test_the_end_of_each_movement_is_known_while_it_is_announced():
    movement = ReferenceMovement(amplitude=-0.5)
    assert movement.end(-1) == -0.5
    assert movement.end(1) == 0.0
    assert math.isnan(movement.end(0))
    script = exercise_of({
        'format': 'friction_comp_exercise', 'version': 1, 'unit': 'rad', 'joints': ['a', 'b'],
        'announcement': 0.5, 'steps': [
            {'hold': 1.0}, {'to': {'a': 0.2, 'b': 0.1}, 'time': 1.0},
            {'to': {'a': 0.5, 'b': 0.0}, 'time': 1.0}, {'hold': 1.0}]})
    assert np.isnan(script.ends(0.4)).all()
    # The first joint passes the waypoint, the second turns there.
    assert script.ends(0.6).tolist() == [0.5, 0.1]
    assert script.ends(2.1).tolist() == [0.5, 0.0]
    assert np.isnan(script.ends(3.5)).all()


DEGREE = math.pi / 180.0


def bell(time, begin, end):
    """Return 0 before, 1 after, and a smooth movement between."""
    share = np.clip((time - begin) / (end - begin), 0.0, 1.0)
    return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)


def guided():
    """Return time and positions of two joints that a trembling hand guides."""
    time = np.arange(0.0, 12.0, 2e-3)
    shoulder = 30.0 * bell(time, 2.0, 3.5) - 45.0 * bell(time, 3.5, 5.0) + 15.0 * bell(time, 8, 9)
    elbow = 5.0 - 40.0 * bell(time, 1.2, 4.2) + 12.0 * bell(time, 8.0, 9.0)
    tremor = 0.1 * np.sin(2.0 * math.pi * 8.0 * time)
    path = np.column_stack([shoulder + tremor, elbow - tremor]) * DEGREE
    return time, np.round(path / 1e-4) * 1e-4


def test_the_exercise_rests_turns_and_hurries_as_the_hand_did(tmp_path):
    time, path = guided()
    document, begin = teach(['shoulder', 'elbow'], time, path)
    write_yaml(tmp_path / 'exercise.yaml', document)
    script = load_exercise(tmp_path / 'exercise.yaml')
    # The elbow begins after a second of rest; the hand began at 1.2 s.
    grid = np.arange(0.0, script.duration, 0.01)
    played = np.array([script.at(t)[0] for t in grid]) / DEGREE
    said = np.array([script.at(t)[2] for t in grid])
    offset = time[0] - begin
    shown = np.column_stack([np.interp(grid - offset, time, own) for own in path.T]) / DEGREE
    inside = grid < time[-1] + offset
    assert np.abs(played - shown + shown[0])[inside].max() < 1.0

    def turns(own):
        signs = own[own != 0]
        return signs[np.concatenate([[True], np.diff(signs) != 0])].tolist()
    assert turns(said[:, 0]) == [1, -1, 1]
    assert turns(said[:, 1]) == [-1, 1]
    at_turn = grid[np.argmax(said[:, 0] < 0)] - offset
    assert at_turn == pytest.approx(3.5, abs=0.1)
    # Where the announced movement ends.
    assert script.ends(at_turn + offset + 0.1)[0] == pytest.approx(-15.0 * DEGREE, abs=DEGREE)


def test_the_tool_writes_an_exercise_or_nothing(tmp_path, capsys):
    time, path = guided()
    write_samples(tmp_path / 'guided', Samples(
        time=time, position=path[:, 0], current=np.zeros(len(time)) + 0.01 * np.sin(time),
        joint='shoulder'), 0.119, 100.0)
    target = tmp_path / 'exercise.yaml'
    asked = [str(tmp_path / 'guided'), '--output', str(target)]
    assert run('teach', [*asked, '--joint', 'elbow']) == 2
    assert "no joint 'elbow'" in capsys.readouterr().err
    assert not target.exists()
    assert run('teach', asked) == 0
    assert load_exercise(target).joints == ['shoulder']
