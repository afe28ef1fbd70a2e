# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A guided movement becomes an exercise with its rests, reversals and tempo."""

import math

import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.exercise.exercise_script import load_exercise
from friction_comp.exercise.taught_exercise import teach
from friction_comp.recordings import write_samples
from friction_comp.samples import Samples

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
    taught = teach(['shoulder', 'elbow'], time, path)
    from friction_comp.files import write_yaml
    write_yaml(tmp_path / 'exercise.yaml', taught.document)
    script = load_exercise(tmp_path / 'exercise.yaml')
    # The elbow begins after a second of rest; the hand began at 1.2 s.
    grid = np.arange(0.0, script.duration, 0.01)
    played = np.array([script.at(t)[0] for t in grid]) / DEGREE
    said = np.array([script.at(t)[2] for t in grid])
    offset = taught.time[0] - time[0]
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


def test_a_movement_beyond_limits_of_speed_is_slowed_down_as_a_whole():
    time, path = guided()
    free = teach(['a', 'b'], time, path)
    slow = teach(['a', 'b'], time, path, speeds=[0.3, 10.0])
    assert free.slowed == 1.0
    fastest = 1.875 * 45.0 * DEGREE / 1.5
    assert slow.slowed == pytest.approx(fastest / 0.3, rel=0.1)
    assert np.ptp(slow.waypoints) == pytest.approx(slow.slowed * np.ptp(free.waypoints), rel=0.02)


def test_what_does_not_move_is_no_exercise():
    time = np.arange(0.0, 5.0, 0.01)
    with pytest.raises(InputError, match='no joint moves by more than 1 degree'):
        teach(['a'], time, 0.005 * np.sin(time)[:, None])
    with pytest.raises(InputError, match='too short'):
        teach(['a'], time[:10], time[:10, None])


def test_the_tool_writes_exercise_and_picture_or_nothing(tmp_path, capsys):
    time, path = guided()
    write_samples(tmp_path / 'guided', Samples(
        time=time, position=path[:, 0], current=np.zeros(len(time)) + 0.01 * np.sin(time),
        joint='shoulder'), 0.119, 100.0)
    limits = tmp_path / 'limits.yaml'
    target = tmp_path / 'exercise.yaml'
    entry = 'max_velocity: 2, max_acceleration: 9}}\n'
    limits.write_text('joint_limits: {shoulder: {min_position: -0.1, max_position: 1, ' + entry)
    asked = [str(tmp_path / 'guided'), '--output', str(target), '--limits', str(limits)]
    assert run('teach', asked) == 2
    assert 'shoulder: guided from -0.26' in capsys.readouterr().err
    assert not target.exists()
    limits.write_text('joint_limits: {shoulder: {min_position: -1, max_position: 1, ' + entry)
    assert run('teach', asked) == 0
    assert load_exercise(target).joints == ['shoulder']
    assert '<svg' in target.with_suffix('.svg').read_text(encoding='utf-8')
