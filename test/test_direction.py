# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Where a direction comes from: plans, leaders, sensors, exercises; and when there is none."""

import math

from cheap_sensors import CheapForce, FAULTS
from hypothesis import given, strategies as st
import numpy as np
import pytest
import yaml

from friction_comp.__main__ import run
from friction_comp.direction.exercise import exercise_of, load_exercise, ReferenceMovement, teach
from friction_comp.direction.sources import (
    CALIBRATION_TIME,
    ChangeTest,
    DesiredMotion,
    ForceDirection,
    PlannedDirection,
)
from friction_comp.errors import InputError
from friction_comp.files import package_file, write_yaml
from friction_comp.recordings.writer import write_samples
from friction_comp.samples import Samples

COUNTS = (0.0, 1023.0)


class Hand:
    """A sensor of one joint, sampled 100 times per second, and the joint."""

    def __init__(self):
        self.random = np.random.default_rng(5)
        self.source = ForceDirection(COUNTS)
        self.time, self.position = 0.0, 0.0

    def feel(self, value):
        """Take an exact value, to which noise of one unit is added; return the direction."""
        self.time += 0.01
        self.source.motion.add(self.time, self.position)
        self.source.add(self.time, [np.rint(value + self.random.normal())])
        return self.source.at(self.time).direction

    def feel_all(self, values):
        return [self.feel(value) for value in values]

    def calibrated(self):
        self.feel_all([500.0] * 20)
        self.source.begin_calibration()
        assert not any(self.feel_all([500.0] * (round(100 * CALIBRATION_TIME) + 2)))
        assert not self.source.calibrating
        assert not self.source.failure
        assert not any(self.feel_all([500.0] * 40))
        return self

    @property
    def reason(self):
        return self.source.at(self.time).reason


@pytest.mark.parametrize('side', [1, -1])
def test_a_push_is_announced_in_fractions_of_a_second_soon_beyond_doubt_and_until_it_ends(side):
    hand = Hand().calibrated()

    def feel(value):
        return hand.feel(value), hand.source.at(hand.time).is_pushed
    assert {feel(500.0) for _ in range(500)} == {(0, False)}
    said = [feel(500.0 + side * 3.0 * k) for k in range(16)]
    directions = [direction for direction, _ in said]
    assert -side not in directions
    assert directions.index(side) <= 6
    assert 0 <= said.index((side, True)) - directions.index(side) <= 5
    assert {feel(500.0 + side * 40.0) for _ in range(50)} == {(side, True)}
    assert [feel(500.0) for _ in range(30)][-1] == (0, False)
    # Nor does the release count as a push to the other side.
    assert {hand.feel(500.0) for _ in range(201)} == {0}
    assert hand.reason == 'at rest'


PUSH = [500.0 + 3.0 * k for k in range(12)]


def test_the_end_of_the_motion_ends_the_announcement_although_the_hand_still_pushes():
    hand = Hand().calibrated()
    hand.feel_all(PUSH)
    for _ in range(50):
        hand.position += 0.002
        assert hand.feel(540.0) == 1
    assert hand.feel_all([540.0] * 40)[-1] == 0
    # The hand rests on the sensor now; the next push begins from there.
    assert not any(hand.feel_all([540.0] * 100))
    assert hand.feel_all([540.0 - 3.0 * k for k in range(12)])[-1] == -1


def test_what_moves_nothing_is_no_attempt():
    hand = Hand().calibrated()
    hand.feel_all(PUSH)
    said = hand.feel_all([536.0] * 400)
    assert (said[0], said[-1]) == (1, 0)


def test_a_joint_that_moves_the_other_way_three_times_says_that_the_sign_is_wrong():
    hand = Hand().calibrated()
    for _ in range(3):
        hand.feel_all(PUSH)
        for _ in range(20):
            hand.position -= 0.002
            hand.feel(540.0)
        hand.feel_all([500.0] * 150)
    assert 'is its sign reversed' in hand.reason
    assert not any(hand.feel_all(PUSH))


@pytest.mark.parametrize(('value', 'speed', 'words'), [
    (lambda k: 500.0, 0.0, 'flat'), (lambda k: 1023.0, 0.0, 'saturated'),
    (lambda k: math.nan, 0.0, 'not finite'), (lambda k: 500.0 + k % 5, 0.1, 'the joint moved'),
    (lambda k: 500.0 + k % 5, math.nan, 'missing')])
def test_a_calibration_needs_a_sensor_that_lives_and_a_joint_at_rest(value, speed, words):
    source = ForceDirection(COUNTS)
    source.begin_calibration()
    for k in range(340):
        source.motion.add(0.01 * k, 0.01 * k * speed)
        source.add(0.01 * k, [value(k)])
    assert words in source.failure
    said = source.at(3.4)
    assert said.fault
    assert words in said.reason or source.calibrating


def test_a_range_of_values_is_needed():
    with pytest.raises(InputError, match='sensor_range'):
        ForceDirection((0.0, 0.0))


@pytest.mark.parametrize('kind', ['white', 'tremor'])
def test_three_seconds_show_the_scatter_well_enough(kind):
    random, false = np.random.default_rng(1), 0
    for _ in range(20):
        noise = random.normal(size=300 + 100 * 60)
        if kind == 'tremor':
            noise += 4.0 * np.sin(0.5 * np.arange(len(noise)) + random.uniform(0.0, 6.0))
        test = ChangeTest(noise[:300], 100.0)
        for value in noise[300:].tolist():
            if test.add(value):
                false += 1
                test.settle(0.0)
            test.follow(value)
    # 20 minutes at 0.25 an hour.
    assert false <= 1


def test_a_jump_is_no_push():
    hand = Hand().calibrated()
    assert not any(hand.feel_all([560.0] * 300))
    # It is the new rest.
    assert hand.feel_all([560.0 + 3.0 * k for k in range(12)])[-1] == 1


def simulated(fault, seed=0):
    """Return what is announced, and why, in two seconds after a fault that begins at rest."""
    plant = CheapForce(np.ones(1), seed, 100.0)
    source, said = ForceDirection(plant.range), []
    for k in range(750):
        time = 0.01 * (k + 1)
        source.motion.add(time, 0.0)
        values = plant.sample(np.zeros((10, 1)))
        if len(values) and np.isfinite(values).all():
            source.add(time, values[:, 0])
        if k == 100:
            source.begin_calibration()
        elif k == 500:
            plant.faults = {0: fault}
        said.append(source.at(time))
    assert not any(one.fault for one in said[411:500])
    return said[500:]


@pytest.mark.parametrize('fault', FAULTS)
def test_a_faulty_sensor_announces_nothing_and_is_told(fault):
    said = simulated(fault)
    assert not any(one.direction for one in said)
    assert any(one.fault for one in said)


# Plans.

class Plan:
    """A plan of two joints, of which one is the node's, and where it should be."""

    def __init__(self, times, positions, tolerance=0.2):
        self.source = PlannedDirection(['elbow'], 0.5, tolerance)
        self.times, self.positions = np.array(times, float), np.array(positions, float)
        both = np.column_stack([np.zeros(len(times)), self.positions])
        self.source.take(['other', 'elbow'], times, both, 0.0, 0.0, self.positions[:1])

    def direction(self, time, position=None):
        """Return direction and end at a time, at the plan's position or another."""
        place = [np.interp(time, self.times, self.positions)] if position is None else position
        said, = self.source.at(time, np.array(place))
        return said.direction, said.end


def test_a_dense_plan_is_announced_ahead_changes_at_the_turn_and_ends_before_the_rest():
    # A trapezoid of speed to 0.4 rad, back to 0.1 without a rest, 100 points a second.
    time = np.arange(0.0, 6.0, 0.01)
    speed = np.interp(time, [0, 1.5, 2, 3, 3.5, 4, 4.5, 5, 9],
                      [0, 0, 0.4 / 1.5, 0.4 / 1.5, 0, -0.3, -0.3, 0, 0])
    path = np.concatenate([[0.0], np.cumsum(speed[:-1]) * 0.01])
    plan = Plan(time, path)
    top, last = path.max(), path[-1]
    assert plan.direction(0.9)[0] == 0
    assert plan.direction(1.1) == (1, pytest.approx(top, abs=1e-6))
    assert plan.direction(3.45)[0] == 1
    assert plan.direction(3.55) == (-1, pytest.approx(last, abs=1e-6))
    assert plan.direction(4.45)[0] == -1
    assert plan.direction(4.6)[0] == 0
    assert plan.direction(7.0)[0] == 0


def test_a_plan_that_is_not_followed_is_none_even_if_the_joint_comes_across_it():
    plan = Plan([0.0, 1.0, 3.0], [0.0, 0.5, 1.5], tolerance=0.1)
    assert plan.direction(1.0)[0] == 1
    assert plan.direction(1.1, [0.3])[0] == 0
    assert plan.direction(1.5)[0] == 0
    assert 'not followed' in plan.source.at(1.5, np.array([0.75]))[0].reason
    plan.source.take(['elbow'], [1.0], [[0.0]], 1.5, 1.5, np.array([0.75]))
    assert plan.direction(1.6, [0.7])[0] == -1
    plan.source.take(['elbow'], [], [], 1.6, 1.6, np.array([0.7]))
    assert plan.direction(1.7, [0.7])[0] == 0


@pytest.mark.parametrize(('times', 'positions', 'words'), [
    ([0.5, 0.5], [[0.0], [1.0]], 'increase'), ([0.5, 1.0], [[0.0], [math.nan]], 'finite'),
    ([0.5], [[0.0, 1.0]], 'a position of each')])
def test_an_unusable_plan_is_refused_and_leaves_none(times, positions, words):
    plan = Plan([0.0, 1.0, 3.0], [0.0, 0.5, 1.5])
    with pytest.raises(InputError, match=words):
        plan.source.take(['elbow'], times, positions, 0.0, 0.0, np.zeros(1))
    assert plan.direction(0.5)[0] == 0


# Leaders and references.

def led(desired, positions=None, step=None):
    """Return what is announced for a stream of desired positions."""
    source, said = DesiredMotion(), []
    for k, value in enumerate(desired):
        time = 0.01 * k
        if step:
            value = step * round(value / step)
        source.motion.add(time, value if positions is None else positions[k])
        source.take(time, value)
        said.append(source.at(time, value if positions is None else positions[k]).direction)
    return np.array(said)


@pytest.mark.parametrize('speed', [0.01, 0.05, 0.2])
@pytest.mark.parametrize('step', [None, 25.0 / 2**16])
def test_a_slow_reference_has_the_sign_of_its_speed_and_does_not_chatter(speed, step):
    time = np.arange(0.0, 12.0, 0.01)
    path = np.interp(time, [0, 2, 6, 8, 12], [0.0, 0.0, 4 * speed, 4 * speed, 0.0])
    said = led(path, step=step)
    changes = np.flatnonzero(np.diff(said))
    assert said[changes + 1].tolist() == [1, 0, -1]
    # Within 0.15 s, or two millimetres of a radian.
    late = max(0.3, 0.003 / speed)
    assert np.all(time[changes + 1] - [2.0, 6.0, 8.0] < late)


def test_a_leader_at_rest_whose_encoder_flickers_announces_nothing():
    random = np.random.default_rng(2)
    flicker = 0.3 + 0.0015 * random.integers(0, 2, 1000)
    assert set(led(flicker)[50:]) == {0}


def test_a_joint_that_is_ahead_of_its_reference_is_not_helped_on():
    time = np.arange(0.0, 3.0, 0.01)
    path = np.interp(time, [0, 1, 3], [0.0, 0.0, 0.1])
    assert set(led(path, path + 0.02)[150:]) == {0}
    assert set(led(path, path - 0.02)[150:]) == {1}


# Exercises from YAML or from a guided movement: positions and announced directions of joints.

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
