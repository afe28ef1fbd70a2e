# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How long an announced direction and a temperature hold, by the clock of the joint states."""

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not in this environment')

from friction_comp.nodes.slow_inputs import Direction, MotorTemperature

SECOND = 1_000_000_000


@pytest.mark.parametrize('behind', [0.005, 0.3])
def test_a_driver_whose_clock_is_behind_does_not_keep_a_direction_alive(behind):
    first = 100 * SECOND
    direction = Direction(['elbow', 'wrist'], 0.2)
    # By the node's clock; there is no other before the first joint state.
    assert direction.take([1, -1], first + round(behind * SECOND))
    direction.begin(first)
    assert direction.at(first).tolist() == [1.0, -1.0]
    assert direction.at(first + SECOND // 5 + 1).tolist() == [0.0, 0.0]
    assert direction.take([0, 1], first), 'the later announcement holds'
    assert direction.at(first + SECOND // 10).tolist() == [0.0, 1.0]


def test_a_direction_that_was_old_before_the_first_joint_state_stays_old():
    first = 100 * SECOND
    direction = Direction(['elbow'], 0.2)
    assert direction.take([1], first - SECOND)
    direction.begin(first)
    assert direction.at(first).tolist() == [0.0]


def test_a_temperature_counts_for_a_minute_whatever_was_asked_before():
    held = MotorTemperature(['a', 'b'])
    assert held.before(9 * SECOND) is None
    held.take('a', 30.0, 10 * SECOND)
    held.take('b', 40.0, 30 * SECOND)
    np.testing.assert_array_equal(held.before(20 * SECOND), [30.0, np.nan])
    for now, expected in ((40, [30.0, 40.0]), (70, [30.0, 40.0]), (71, [np.nan, 40.0]),
                          (90, [np.nan, 40.0])):
        np.testing.assert_array_equal(held.before(now * SECOND), expected)
    assert held.before(91 * SECOND) is None
    assert held.before(92 * SECOND) is None
    held.forget()
    assert held.before(41 * SECOND) is None
