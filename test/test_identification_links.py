# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia of a joint whose link swings, or whose encoder is coarse: right, or said to be unsure."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.signal import lsim

from friction_comp import IdentificationGoal
from friction_comp.identification.agreement import say_swing
from friction_comp.identification.inertia import Inertia, steadiest_inertia
from friction_comp.identification.profiles import cycle_position

GOAL = IdentificationGoal(speeds=(0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5), motion_range=1.0)
RATE = 25.0     # by which the whole joint accelerates, rad/s² per A


def cycles(hertz, link_share=0.35, damping=0.02, noise=2e-3):
    """Return cycles of a motor that follows its reference, with a share of inertia on a spring."""
    driven = []
    for speed in GOAL.speeds:
        duration, _ = GOAL.cycle(speed)
        time = np.arange(0.0, duration, 1e-3)
        motor = np.array([cycle_position(t, speed, duration) for t in time])
        velocity = np.gradient(motor, time)
        w = 2.0 * np.pi * hertz
        ring = ([2.0 * damping * w, w ** 2], [1.0, 2.0 * damping * w, w ** 2])
        _, link, _ = lsim(ring, motor - motor[0], time)
        twist = motor - motor[0] - link
        torque = link_share * (w ** 2 * twist + 2.0 * damping * w * np.gradient(twist, time))
        current = 0.5 * np.tanh(velocity / 0.01) + 0.15 * velocity + (
            (1.0 - link_share) * np.gradient(velocity, time) + torque) / RATE
        current += noise * np.random.default_rng(int(100 * speed)).standard_normal(len(time))
        driven.append(np.column_stack([time, motor, current]))
    return driven


@pytest.mark.parametrize('link_share', [0.2, 0.35, 0.5])
@pytest.mark.parametrize('hertz', [3.0, 4.0, 5.0, 6.0, 8.0])
def test_a_link_that_swings_is_said_where_inertia_is_not_right(hertz, link_share):
    found = steadiest_inertia(cycles(hertz, link_share))
    # None is said as well. What is off is about as far off as is said.
    if found is not None:
        off = abs(np.log(found.acceleration_per_current / RATE))
        assert off < 0.2
        assert off < 0.04 or (
            say_swing(found) and off < 1.5 * max(found.differs, found.unexplained))


def test_the_fastest_cycles_alone_were_wrong():
    driven = cycles(4.0, 0.2)
    fastest, found = steadiest_inertia(driven[-3:]), steadiest_inertia(driven)
    assert fastest.acceleration_per_current > 1.08 * RATE
    assert found.acceleration_per_current == pytest.approx(RATE, rel=0.02)
    assert 'may be off by' in say_swing(found)[0]


@pytest.mark.parametrize('noise', [1e-3, 5e-3, 0.02])
def test_nothing_is_said_of_a_rigid_joint(noise):
    found = steadiest_inertia(cycles(60.0, 0.35, 0.1, noise))
    assert found.acceleration_per_current == pytest.approx(RATE, rel=0.02)
    assert not say_swing(found)
    assert not say_swing(None)


def test_two_speeds_are_enough():
    driven = cycles(60.0, 0.35, 0.1)
    for count in (1, 2, 3, 4):
        assert steadiest_inertia(driven[-count:]).acceleration_per_current == pytest.approx(
            RATE, rel=0.03)
    assert say_swing(Inertia(RATE, 0.0, unexplained=0.1))


@pytest.mark.parametrize('counts', [700, 1200])
def test_counts_of_an_encoder_and_what_the_controller_makes_of_them_do_not_bias_inertia(counts):
    driven = []
    for time, motor, current in (cycle.T for cycle in cycles(60.0, 0.35, 0.1)):
        step = 2.0 * np.pi / counts
        counted = np.round(motor / step) * step
        # The controller answers to a speed that is none.
        wrong = np.gradient(uniform_filter1d(counted - motor, 20), time)
        driven.append(np.column_stack([time, counted, current - 0.3 * wrong]))
    found = steadiest_inertia(driven)
    assert found.acceleration_per_current == pytest.approx(RATE, rel=0.04)
    assert found.lag == 0.0
