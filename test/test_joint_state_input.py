# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joint states whose publishers contradict each other, or that name a joint twice."""

from helpers import joint_state
import pytest

from friction_comp.control.joint_states import CONTESTED, JointStateInput, MALFORMED, NEW

SECOND = 1_000_000_000


def judged(numbers, publishers, names=('elbow',), joints=('elbow',)):
    """Return the verdicts on states with their publishers' numbers, a millisecond apart."""
    states = JointStateInput(list(joints), SECOND // 20)
    states.publishers = publishers
    return [states.take(joint_state(SECOND + k * 1_000_000, names, [0.1] * len(names)),
                        SECOND + k * 1_000_000, 0, number)
            for k, number in enumerate(numbers)], states


@pytest.mark.parametrize(('numbers', 'publishers', 'expected'), [
    ([7, 8, 10, 11], ['/a', '/b'], NEW),          # one of them is lost, the other silent
    ([7, 8, 1, 2], [], NEW),                      # started again
    ([0, 0, 0, 0], ['/a', '/b'], NEW),            # a middleware without numbers
    ([7, 8, 1, 9], ['/a', '/b'], CONTESTED),
    ([7, 7, 8, 8], ['/a', '/b'], CONTESTED)])
def test_publishers_of_a_joint_are_distinguished_by_their_numbers(numbers, publishers, expected):
    verdicts, states = judged(numbers, publishers)
    assert verdicts[-1] == expected
    assert ('/a, /b' in states.wrong) == (expected == CONTESTED)


def test_publishers_of_different_joints_and_one_that_is_alone_again_are_believed():
    states = JointStateInput(['elbow'], SECOND // 20)
    states.publishers = ['/a', '/b']
    verdicts = []
    for k, (name, number) in enumerate((('elbow', 9), ('knee', 2), ('elbow', 10), ('knee', 3))):
        stamp = SECOND + k * 1_000_000
        verdicts.append(states.take(joint_state(stamp, [name], [0.1]), stamp, 0, number))
    assert verdicts[::2] == [NEW, NEW]
    late = [SECOND + delay for delay in (SECOND // 10, SECOND // 2, 2 * SECOND)]
    assert [states.take(joint_state(stamp, ['elbow'], [0.1]), stamp, 0, number)
            for stamp, number in zip(late, (5, 11, 12))] == [CONTESTED, CONTESTED, NEW]


def test_a_joint_named_twice_is_malformed_only_if_it_is_used():
    assert judged([1], [], ('elbow', 'elbow'))[0] == [MALFORMED]
    assert judged([1], [], ('elbow', 'knee', 'knee'))[0] == [NEW]
