# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Signals of Eq. 3-5 and 8, and what cycles show: parabolas, inertia, plateaus."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest
from scipy.signal import lfilter

from friction_comp.identification.goal import IdentificationGoal
from friction_comp.identification.inertia import steadiest_inertia
from friction_comp.identification.profiles import (
    constant_velocity_windows,
    cycle_position,
    cycle_velocity,
    local_parabolas,
    ramp_current,
    travel_state,
)

RATE, COUNT = 60.0, 1.5e-5  # rad/s² per A, rad


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_parabolas_are_exact_on_a_parabola(place, slope, bend):
    t = 0.01 * np.arange(40)
    value, first, second = local_parabolas(place + slope * t + 0.5 * bend * t ** 2, 7, 0.01)
    middle = t[3:-3]
    np.testing.assert_allclose(value, place + slope * middle + 0.5 * bend * middle ** 2, atol=1e-9)
    np.testing.assert_allclose(first, slope + bend * middle, atol=1e-8)
    np.testing.assert_allclose(second, bend, atol=1e-6)


def cycle():
    """Return time, position and velocity of a cycle at 1.2 rad/s."""
    time = np.arange(0.0, 2.0, 1e-3)
    position = np.array([cycle_position(t, 1.2, 2.0) for t in time])
    return time, position, np.gradient(position, time)


def sliding(v):
    return 0.1 * np.sign(v) + 0.05 * v


@pytest.mark.parametrize(('friction', 'lag'), [
    (lambda v: 0.1 * np.tanh(v / 0.02), 0.0),
    (lambda v: 0.1 * np.tanh(v / 0.3) + 0.05 * v, 0.0),
    (lambda v: 0.1 * np.sign(v) * (1.0 + np.exp(-np.abs(v) / 0.1)), 0.0),
    *((sliding, lag) for lag in (-0.015, 0.01, 0.03, 0.05))])
def test_inertia_is_what_getting_faster_takes_more_than_getting_slower_behind_any_low_pass(
        friction, lag):
    """A low pass of the current, or of the position where the lag is negative, is found."""
    time, position, velocity = cycle()
    current = friction(velocity) + np.gradient(velocity, time) / RATE
    if lag:
        share = 1.0 - np.exp(-1e-3 / abs(lag))
        late = lfilter([share], [1.0, share - 1.0], (position, current)[lag > 0.0])
        position, current = (position, late) if lag > 0.0 else (late, current)
    current = current + 2e-3 * np.random.default_rng(3).normal(size=time.size)
    counted = np.floor(position / COUNT) * COUNT
    found = steadiest_inertia([np.column_stack([time, counted, current])])
    assert found.acceleration_per_current == pytest.approx(RATE, rel=0.04)
    assert found.lag == pytest.approx(lag, rel=0.1, abs=2e-3)


def test_a_current_one_sample_late_is_late_by_that_also_at_a_low_rate():
    time, position, velocity = (values[::10] for values in cycle())
    current = sliding(velocity) + np.gradient(velocity, time) / RATE
    rows = np.column_stack([time[1:], position[1:], current[:-1]])
    assert steadiest_inertia([rows]).lag == pytest.approx(0.01, abs=1e-3)


def test_inertia_that_hardly_takes_current_is_not_given():
    time, position, velocity = cycle()
    current = 0.1 * np.sign(velocity) + 0.02 * np.random.default_rng(3).normal(size=time.size)
    assert steadiest_inertia([np.column_stack([time, position, current])]) is None


velocity_reference, position_reference, current_ramp = (
    np.vectorize(formula, otypes=[float])
    for formula in (cycle_velocity, cycle_position, ramp_current))
speeds = st.floats(0.01, 1.745) | st.floats(-1.745, -0.01)
ranges = st.floats(0.05, 6.0)


@pytest.mark.parametrize(('time', 'velocity'), [
    (0.0, 0.0), (0.5, 0.25), (1.0, 0.5), (2.5, 0.5), (4.0, 0.5), (4.5, 0.25), (5.0, 0.0),
    (5.5, -0.25), (6.0, -0.5), (7.5, -0.5), (9.0, -0.5), (9.5, -0.25), (10.0, 0.0)])
def test_profile_of_equation_3(time, velocity):
    assert velocity_reference(time, 0.5, 10.0) == pytest.approx(velocity, abs=1e-12)


@given(speed=speeds, width=ranges)
def test_cycle_uses_the_range_exactly_returns_and_does_not_jump(speed, width):
    duration = 2.5 * width / abs(speed)
    time = np.linspace(0.0, duration, 4001)
    velocity = velocity_reference(time, speed, duration)
    position = position_reference(time, speed, duration)
    assert position[0] == 0.0
    assert position[-1] == pytest.approx(0.0, abs=1e-9)
    assert position[2000] == pytest.approx(math.copysign(width, speed), rel=1e-9)
    assert np.max(np.abs(position)) <= width * (1.0 + 1e-9)
    assert np.min(position * math.copysign(1.0, speed)) >= -1e-9
    # The steepest slope is α = 10·ω_c/T.
    assert np.max(np.abs(np.diff(velocity))) <= 10.0 * abs(speed) / 4000 * 1.001
    summed = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time))
    np.testing.assert_allclose(position[1:], summed, atol=1e-6 * width)
    assert np.max(np.abs(velocity)) <= abs(speed) * (1.0 + 1e-12)


@given(slope=st.floats(0.001, 5.0), period=st.floats(1.0, 100.0))
def test_ramps_of_equation_8(slope, period):
    time = np.linspace(0.0, period, 10001)
    current = current_ramp(time, slope, period)
    goal = IdentificationGoal((0.1, 0.2), ramp_slope=slope, ramp_period=period)
    assert np.max(current) == pytest.approx(goal.ramp_peak, rel=1e-3)
    assert np.min(current) == pytest.approx(-goal.ramp_peak, rel=1e-3)
    rest = ((time > 0.4001 * period) & (time < 0.4999 * period)) | (time > 0.9001 * period)
    assert np.all(current[rest] == 0.0)
    rising = (time > 0.0) & (time < 0.3999 * period)
    np.testing.assert_allclose(current[rising], slope * time[rising], rtol=1e-12)
    half = current_ramp(time[rising] + 0.5 * period, slope, period)
    np.testing.assert_allclose(half, -current[rising], rtol=1e-9, atol=1e-9 * slope * period)


def test_constant_velocity_windows_lie_on_the_plateaus():
    for window, sign in zip(constant_velocity_windows(10.0, 0.5), (1.0, -1.0)):
        np.testing.assert_allclose(
            velocity_reference(np.linspace(*window, 50), 0.3, 10.0), 0.3 * sign)
    (begin, end), _ = constant_velocity_windows(1.0, 5.0)
    assert end - begin == pytest.approx(0.4 * 0.3)


def test_travel_starts_and_ends_at_rest():
    places = np.array([travel_state(t, -0.4, 2.0) for t in np.linspace(0.0, 2.0, 2001)])
    assert places[0].tolist() == [0.0, 0.0]
    assert places[-1] == pytest.approx([-0.4, 0.0], abs=1e-12)
    assert np.max(np.abs(places[:, 1])) == pytest.approx(1.875 * 0.4 / 2.0, rel=1e-5)
    np.testing.assert_allclose(np.gradient(places[:, 0], 1e-3)[1:-1], places[1:-1, 1], atol=1e-5)
