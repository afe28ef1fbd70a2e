# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""From joint states, directions and temperatures to currents, without ROS.

Which input is valid, and for how long, and what the loop makes of them on a clock that the test
moves.
"""

from dataclasses import replace
import math
from types import SimpleNamespace

from helpers import joint_state, note_model
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw
from friction_comp.control.compensation_loop import CompensationLoop
from friction_comp.control.faults import Faults
from friction_comp.control.feed_forward import feed_forward
from friction_comp.control.inputs import Direction, MotorTemperature
from friction_comp.control.joint_states import CONTESTED, JointStateInput, MALFORMED, NEW, PART
from friction_comp.control.model_trial import Loaded

SECOND = 1_000_000_000


@pytest.mark.parametrize(('behind', 'expected'), [(0.005, [1, -1]), (0.3, [1, -1]), (-1.0, [0, 0])])
def test_a_driver_whose_clock_is_behind_does_not_keep_a_direction_alive(behind, expected):
    """And one that was old before the first joint state stays old."""
    first = 100 * SECOND
    direction = Direction(['elbow', 'wrist'], 0.2)
    # By the node's clock, since there is no other before the first joint state.
    assert direction.take([1, -1], first + round(behind * SECOND))
    direction.begin(first)
    assert direction.at(first).tolist() == expected
    assert direction.at(first + SECOND // 5 + 1).tolist() == [0.0, 0.0]
    assert direction.take([0, 1], first), 'the later announcement holds'
    assert direction.at(first + SECOND // 10).tolist() == [0.0, 1.0]


def test_a_temperature_counts_for_a_minute_whatever_was_asked_before():
    held = MotorTemperature(['a', 'b'])
    assert held.before(9 * SECOND) is None
    held.take('a', 30.0, 10 * SECOND)
    held.take('b', 40.0, 30 * SECOND)
    for now, expected in ((20, [30.0, np.nan]), (40, [30.0, 40.0]), (70, [30.0, 40.0]),
                          (71, [np.nan, 40.0]), (90, [np.nan, 40.0]), (91, None), (92, None)):
        found = held.before(now * SECOND)
        assert (found is None) == (expected is None)
        assert expected is None or found.tolist() == pytest.approx(expected, nan_ok=True)
    held.forget()
    assert held.before(41 * SECOND) is None


@pytest.mark.parametrize(('words', 'planners', 'expected'), [
    # A single planner may reverse as often as it likes; two planners that agree may alternate.
    ([(1.0, 1), (1.1, -1), (1.2, 1)], [], 1.0),
    ([(1.0, 1), (1.1, 1), (1.2, 1)], ['/a', '/b'], 1.0),
    ([(1.0, 1), (1.1, -1)], ['/a', '/b'], -1.0),
    ([(1.0, 1), (1.1, -1), (1.2, 1)], ['/a', '/b'], 0.0),
    ([(1.0, 1), (1.1, 0), (1.2, 1)], ['/a', '/b'], 0.0),
    # A movement there and back takes longer than a word holds; so does a dispute that is over.
    ([(1.0, 1), (1.1, -1), (1.9, 1)], ['/a', '/b'], 1.0),
    ([(1.0, 1), (1.1, -1), (1.2, 1), (1.6, 1), (2.3, 1)], ['/a', '/b'], 1.0)])
def test_planners_contradict_each_other_if_an_earlier_direction_returns(words, planners, expected):
    direction = Direction(['elbow', 'wrist'], 0.5)
    direction.planners = planners
    for time, value in words:
        direction.take([value, 0], round(time * SECOND))
    now = round(words[-1][0] * SECOND)
    assert direction.at(now)[0] == expected
    assert direction.disputed(now) == ([] if expected else ['elbow'])


BEFORE, NAN = (None, [-1, 1]), math.nan
ENDED = (['wrist', 'elbow'], [-1.0, 1.0], [NAN, 0.4])


@pytest.mark.parametrize(('messages', 'expected', 'why'), [
    ([BEFORE, (None, [1, -1])], [1, -1], ''), ([BEFORE, (None, [2, -1])], [0, -1], 'other than'),
    ([BEFORE, (None, [1])], [0, 0], '1 values for 2'), ([BEFORE, (None, [])], [0, 0], '0 values'),
    # Others keep theirs.
    ([BEFORE, (['elbow', 'knee', 'elbow', 'knee'], [1.0, 1.0, -1.0, NAN])], [0, 1],
     'a joint named twice'),
    ([BEFORE, (['knee', 'wrist'], [NAN, -3.0])], [-1, -1], ''),
    # By the planner's age: one was overtaken, and of one nobody knows how old it is.
    ([BEFORE, (['elbow'], [1.0], [], 59)], [-1, 1], ''),
    ([BEFORE, (['elbow'], [1.0], [], -600)], [0, 1], 'ahead of time'),
    # The end that a planner says is kept until another direction or end comes.
    ([ENDED], [1, -1, 0.4, -9], ''), ([ENDED, (None, [1, -1])], [1, -1, 0.4, -9], ''),
    ([ENDED, (['elbow'], [1.0], [0.9])], [1, -1, 0.9, -9], ''),
    ([ENDED, (None, [-1, -1])], [-1, -1, -9, -9], ''),
    ([ENDED, (['elbow'], [1.0], [0.9, 0.1])], [0, 0], '2 positions for 1 names')])
def test_what_a_message_says_of_directions_holds_and_what_it_cannot_say_is_zero(
        messages, expected, why):
    direction = Direction(['elbow', 'wrist'], 60.0)
    for k, (names, values, *more) in enumerate(messages):
        now, (ends, age) = 1000 * SECOND + k, [*more, *([], 0)[len(more):]]
        valid = direction.take(values, now) if names is None else direction.take_stamped(
            names, values, now - age * SECOND, now, ends)
    found = [*direction.at(now), *np.nan_to_num(direction.ends, nan=-9.0)]
    assert found[:len(expected)] == expected
    assert valid == (not why)
    assert why in direction.why


def test_joints_are_found_by_name_whatever_is_said_of_others():
    states = JointStateInput(['elbow', 'wrist'], SECOND // 20)
    assert states.take(joint_state(
        SECOND, ['knee', 'wrist', 'elbow', 'knee'], [1e300, 0.2, 0.1, math.nan],
        [9.0, 2.0, 1.0, 9.0]), SECOND) == NEW
    assert (states.position.tolist(), states.velocity.tolist()) == ([0.1, 0.2], [1.0, 2.0])
    # ros2_control says so of a velocity that is not measured.
    for velocity in ([], [math.nan, math.nan]):
        states.forget()
        assert states.take(
            joint_state(SECOND, ['elbow', 'wrist'], [0.1, 0.2], velocity), SECOND) == NEW
        assert states.velocity is None


@pytest.mark.parametrize(('notes', 'told'), [
    ({}, []), ({'warnings': ['It falls.']}, ['identification says: It falls']),
    ({'verdict': 'trust in part', 'reasons': ['It falls.'], 'warnings': ['old']},
     ['refine says `trust in part`: It falls']),
    ({'verdict': 'record again'}, ['refine says `record again`: it says no reason'])])
def test_what_its_file_says_against_a_model_is_told(notes, told):
    model = replace(note_model(1), notes=notes)
    assert Loaded(model, feed_forward(model)).told() == told


class Port:
    """The port of a loop; `last` are the commanded currents."""

    ready, ticket, repeated = True, 0, 0

    def __init__(self, count):
        self.zero = lambda: setattr(self, 'last', [0.0] * count)
        self.zero()

    def set_limits(self, limits, torques):
        self.limits, self.torques = list(limits), torques

    def answer(self, currents, *_):
        self.last = np.asarray(currents).tolist()
        return True

    def repeat(self, sent):
        self.repeated += 1


class Desk:
    """A compensator's loop in a world where each joint moves at 0.3 rad/s, as was announced."""

    def __init__(self, joints=('elbow',), simulated=False):
        self.time, self.joints, self.logged = 100.0, list(joints), []
        log = SimpleNamespace(
            info=lambda text: None, warning=self.logged.append, error=self.logged.append)
        self.port = Port(len(joints))
        self.faults = Faults(log, lambda: self.time)
        self.loop = CompensationLoop(
            self.joints, CompensationLaw([note_model(2)] * len(joints)), self.port, self.faults,
            SECOND // 20, 0.5, simulated, lambda: self.time)
        self.inputs = self.loop.inputs

    def state(self, names=None, change=lambda message: None):
        names, stamp = names or self.joints, round(self.time * SECOND)
        message = joint_state(
            stamp, names, [0.3 * math.fmod(self.time, 100.0)] * len(names), [0.3] * len(names))
        change(message)
        self.loop.take(message, stamp)
        return self.port.last

    def move(self, seconds=0.5, **changes):
        for _ in range(round(1e3 * seconds)):
            self.time += 1e-3
            self.inputs.take_direction([1] * len(self.joints), round(self.time * SECOND))
            self.state(**changes)
        return self.port.last

    def fall_silent(self, seconds):
        """Let the watchdog notice that there are no states."""
        self.time += 0.05
        self.inputs.watchdog.check()
        assert not any(self.port.last)
        self.time += seconds - 0.05


@pytest.mark.parametrize('begin', [
    lambda desk: setattr(desk, 'time', 1.0),
    lambda desk: desk.fall_silent(0.06)])
def test_the_transition_to_another_law_ends_with_what_it_continues(begin):
    desk = Desk(simulated=True)
    assert desk.move()[0] > 0.1
    desk.loop.retune('none', 0.9, 1000.0)
    desk.time += 1e-3
    assert desk.state()[0] > 0.1, 'no step'
    begin(desk)
    assert desk.state() == [0.0]


@pytest.mark.parametrize('last', [None, lambda message: message.position.pop()])
def test_a_driver_that_restarts_is_a_latched_fault_whatever_it_said_last(last):
    desk = Desk()
    assert desk.move()[0] > 0.1
    if last:
        desk.time += 1e-3
        assert desk.state(change=last) == [0.0]
    desk.fall_silent(5.0)
    assert desk.move() == [0.0]
    assert desk.faults.latched


@pytest.mark.parametrize(('change', 'moved', 'words'), [
    ({'position': [0.1, 1e300]}, [True, False], 'wrist: a position of 1e+300 rad is impossible'),
    ({'position': [math.nan, 0.1]}, [False, True], 'not finite'),
    ({'velocity': [0.3, math.inf]}, [True, False], 'not finite'),
    ({'position': [0.1]}, [False, False], 'arrays of different lengths'),
    ({'name': ['elbow', 'wrist', 'elbow'], 'position': [0.1, 0.1, 0.5], 'velocity': [],
      'effort': []}, [False, False], 'elbow twice'),
    ({'header': joint_state(40 * SECOND, [], []).header}, [False, False], 's old')])
def test_a_state_that_cannot_be_is_told_and_gives_its_joint_zero_current(change, moved, words):
    desk = Desk(['elbow', 'wrist'])
    assert min(desk.move()) > 0.1
    desk.time += 1e-3
    current = desk.state(change=lambda message: vars(message).update(change))
    assert [value != 0.0 for value in current] == moved
    assert words in desk.faults.worst[1]
    assert min(desk.move(0.3)) > 0.1


def test_a_late_or_repeated_state_changes_nothing():
    desk = Desk()
    assert desk.move()[0] > 0.1
    for stamp in (desk.time - 3e-3, desk.time):
        desk.port.last = ['as it was']
        desk.loop.take(joint_state(stamp * SECOND, ['elbow'], [9.0]), round(desk.time * SECOND))
        assert desk.port.last == ['as it was']
    assert desk.port.repeated == 1


@pytest.mark.parametrize(('factor', 'words'), [
    (math.degrees(1.0), 'elbow: velocity is 57.3 times the rate of position: velocity is in deg/s'),
    (-1.0, 'wrong sign'), (0.0, 'not measured')])
def test_a_velocity_that_contradicts_the_position_is_told_until_none_is_sent(factor, words):
    desk = Desk(['elbow', 'wrist'])

    def wrong(message):
        message.velocity[0] *= factor
    current = desk.move(1.0, change=wrong)
    assert current[0] == 0.0 < 0.1 < current[1]
    assert words in desk.faults.worst[1]
    # The driver is started again without it.
    desk.fall_silent(0.5)
    assert min(desk.move(change=lambda message: message.velocity.clear())) > 0.1


def test_an_encoder_that_sticks_gives_zero_current_until_it_moves_again():
    desk = Desk()
    assert desk.move(0.5)[0] > 0.1
    assert desk.move(0.6, change=lambda message: message.position.__setitem__(0, 0.15)) == [0.0]
    assert 'the encoder is stuck' in desk.faults.worst[1]
    assert desk.move(1.0)[0] > 0.1


def test_joints_that_no_driver_sends_are_named_once_others_had_time_to_start():
    desk = Desk(['elbow', 'wrist'])
    desk.inputs.set_sources(['/a', '/b'], [])
    for name in 2 * desk.joints:
        desk.move(0.001, names=[name])
    assert desk.logged == []
    # One of the drivers stops.
    desk.move(0.1, names=['elbow'])
    assert desk.logged == ['joint_states lack wrist']
    assert desk.port.last[0] > 0.0 == desk.port.last[1]
    # A single driver lacks a joint at once.
    desk = Desk(['elbow', 'wrist'])
    desk.move(0.001, names=['elbow'])
    assert desk.logged == ['joint_states lack wrist']
    # That there are states of other joints only is said.
    for publishers, patience in (([], 0.0), (['/a', '/b'], 0.04)):
        desk = Desk()
        desk.inputs.set_sources(publishers, [])
        desk.move(patience, names=['wrist'])
        assert desk.logged == []
        desk.move(0.04, names=['wrist'])
        assert desk.logged == ['joint_states lack elbow']


def test_a_temperature_has_the_stamp_of_the_newest_state_and_an_impossible_one_is_passed_over():
    desk = Desk()
    desk.state()
    desk.inputs.take_temperature('elbow', 30.0, 0, 1)
    for value in (-300.0, math.inf):
        desk.inputs.take_temperature('elbow', value, 0, 1)
        assert 'impossible' in desk.faults.worst[1]
    desk.time += 1e-3
    desk.state()
    assert desk.inputs.temperature.tolist() == [30.0]


def test_a_push_that_a_sensor_feels_is_told_with_its_direction():
    desk = Desk()

    def felt(*efforts, direction=1.0):
        desk.inputs.take_stamped_direction(
            ['elbow'], [direction], desk.inputs.states.stamp, 0, [math.nan], efforts)
        desk.time += 1e-3
        desk.state()
        return desk.inputs.direction.tolist(), desk.inputs.is_pushed.tolist()
    desk.state()
    assert felt(1.0) == ([1.0], [True])
    assert felt(math.nan) == ([1.0], [False])
    assert felt(2.5, direction=-1.0) == ([-1.0], [True])
    assert felt(direction=-1.0) == ([-1.0], [False])
    # Nor does an announcement that cannot be read say anything.
    assert felt(1.0) == ([1.0], [True])
    assert felt(1.0, 1.0) == ([0.0], [False])


def judged(rows, publishers, joints=('elbow',)):
    """Return the verdicts on states at times in ms, with their joints and publishers' numbers."""
    states = JointStateInput(list(joints), SECOND // 20)
    states.publishers = publishers
    verdicts = []
    for milliseconds, joints_of, number in rows:
        stamp = SECOND + round(1e6 * milliseconds)
        verdicts.append(states.take(
            joint_state(stamp, joints_of, [0.1] * len(joints_of)), stamp, 0, number))
    return verdicts, states


ELBOW, BOTH = ['elbow'], ['/a', '/b']


@pytest.mark.parametrize(('numbers', 'publishers', 'expected'), [
    ([7, 8, 10, 11], BOTH, NEW),          # one of them is lost, the other silent
    ([7, 8, 1, 2], [], NEW),              # started again
    ([0, 0, 0, 0], BOTH, NEW),            # a middleware without numbers
    ([7, 8, 1, 9], BOTH, CONTESTED),
    ([7, 7, 8, 8], BOTH, CONTESTED)])
def test_publishers_of_a_joint_are_distinguished_by_their_numbers(numbers, publishers, expected):
    verdicts, states = judged([(k, ELBOW, n) for k, n in enumerate(numbers)], publishers)
    assert verdicts[-1] == expected
    assert ('/a, /b' in states.wrong) == (expected == CONTESTED)


@pytest.mark.parametrize(('rows', 'publishers', 'joints', 'expected'), [
    # Publishers of different joints are believed, and one that is alone again.
    ([(0, ELBOW, 9), (1, ['knee'], 2), (2, ELBOW, 10), (3, ['knee'], 3), (100, ELBOW, 5),
      (500, ELBOW, 11), (2000, ELBOW, 12)], BOTH, ELBOW,
     {0: NEW, 2: NEW, 4: CONTESTED, 5: CONTESTED, 6: NEW}),
    # A joint named twice is malformed only if it is used.
    ([(0, ['elbow', 'elbow'], 1)], [], ELBOW, {0: MALFORMED}),
    ([(0, ['elbow', 'knee', 'knee'], 1)], [], ELBOW, {0: NEW}),
    # Of a round that is not complete, nothing is left after a restart.
    ([(8000, ['wrist'], 0), (8000, ELBOW, 0), (8001, ELBOW, 0), (0, ['wrist'], 0),
      (0, ELBOW, 0)], BOTH, ['elbow', 'wrist'], dict(enumerate((PART, NEW, PART, PART, NEW))))])
def test_states_of_several_publishers_are_new_only_if_all_of_them_agree(
        rows, publishers, joints, expected):
    verdicts, _ = judged(rows, publishers, joints)
    assert {k: verdicts[k] for k in expected} == expected
