# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What current ramps show: breakaway, presliding, stiffness, and whether a joint keeps moving."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.identification.excitation import cycle_position
from friction_comp.identification.goal import IdentificationError
from friction_comp.identification.kinetic import acceleration_of_cycle, local_parabolas
from friction_comp.identification.presliding import (
    combined_presliding,
    common_stiffness,
    find_backlash,
    presliding_std,
    ramp_friction,
)
from friction_comp.identification.ramp_evaluation import (
    evaluate_ramps,
    moving_level,
    Ramp,
    STOP_TIME,
    time_of_ramp,
)

LEVEL, RATE, COUNT = 0.3, 60.0, 1.5e-5  # A, rad/s² per A, rad


def ramp(contact, slope=0.2, stops=(), sign=1, before=-1, level=LEVEL, strengthening=0.0):
    """Record a ramp on a joint whose friction is `level` times contact(way), until 0.05 rad/s.

    What a slide takes more at speed is `strengthening`, A, reached within 0.02 rad/s.
    """
    samples, x, v, t = [], 0.0, 0.0, 0.0
    while v < 0.05 and t < 20.0:
        current = slope * time_of_ramp(t, slope, stops)
        samples.append((t, sign * math.floor(x / COUNT) * COUNT, sign * current))
        for _ in range(10):
            friction = level * contact(x) + strengthening * (1.0 - math.exp(-max(v, 0.0) / 0.005))
            # With enough damping, the rotor does not oscillate on its contact.
            friction += 3.0 * math.sqrt(level / 3e-4 / RATE) * v * (1.0 - contact(x))
            v += 1e-4 * RATE * (current - friction)
            if v < 0.0:
                v = 0.0
            x += 1e-4 * v
        t += 1e-3
    return Ramp(sign, before, np.array(samples), tuple(stops))


def dahl(distance):
    """Return Dahl's contact, 95 % of its level at a distance."""
    return lambda x: -math.expm1(-3.0 * x / distance)


def friction_of(recorded):
    time, position, current = recorded.samples.T
    return ramp_friction(time, position, current, recorded.direction, COUNT, RATE)


@pytest.mark.parametrize('distance', [2e-4, 1e-3, 2e-3])
@pytest.mark.parametrize('slope', [0.1, 0.3])
def test_breakaway_does_not_depend_on_the_presliding_distance(distance, slope):
    found = friction_of(ramp(dahl(distance), slope))
    assert found.breakaway == pytest.approx(LEVEL, rel=0.02)
    assert found.presliding(LEVEL) == pytest.approx(distance, rel=0.2)


def test_a_ramp_on_which_the_joint_only_creeps_has_no_breakaway():
    recorded = ramp(dahl(1e-3))
    samples = recorded.samples[recorded.samples[:, 2] < 0.8 * LEVEL]
    assert friction_of(recorded._replace(samples=samples)) is None


def test_an_error_of_the_inertia_hardly_shows():
    time, position, current = ramp(dahl(5e-4)).samples.T
    for factor in (0.8, 1.25):
        found = ramp_friction(time, position, current, 1, COUNT, factor * RATE)
        assert found.breakaway == pytest.approx(LEVEL, rel=0.03)


def test_stiffness_is_the_slope_of_the_first_third():
    distance = 6e-4
    ramps = [friction_of(ramp(dahl(distance), slope)) for slope in (0.1, 0.15, 0.2)]
    way = -math.log(2.0 / 3.0) * distance / 3.0
    assert common_stiffness(ramps, LEVEL, COUNT) == pytest.approx(LEVEL / 3.0 / way, rel=0.2)
    # Motion of a few counts is not significant.
    short = [friction_of(ramp(dahl(1e-4)))]
    assert common_stiffness(short, LEVEL, COUNT) is None


@given(st.lists(st.tuples(st.floats(0.1, 1.0), st.floats(1e-4, 1e-3)), min_size=1, max_size=6))
def test_presliding_is_the_mean_after_slides_in_both_directions(elements):
    """Maxwell-slip elements after a slide either way: by Masing's rule the mean is the farthest."""
    share = np.array([s for s, _ in elements]) / sum(s for s, _ in elements)
    distance = np.array([d for _, d in elements])

    def torque(state):
        return float(np.sum(share * state / distance))

    def moved(state, way):
        return np.clip(state + way, -distance, distance)

    def way_to(state, goal):
        low, high = 0.0, 4e-3
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if torque(moved(state, middle)) >= goal else (middle, high)
        return high

    # At rest after a slide in positive direction: turned back until nothing is left of it.
    back = way_to(-distance, 0.0)
    rest = -moved(-distance, back)
    ways = [(True, way_to(rest, 1.0 - 1e-9)), (False, way_to(-rest, 1.0 - 1e-9))]
    assert combined_presliding(ways) == pytest.approx(float(distance.max()), rel=1e-3)


def test_presliding_from_one_kind_of_ramp_is_used_if_there_is_no_other():
    assert combined_presliding([(False, 2e-4), (False, 4e-4), (False, 3e-4)]) == 3e-4
    assert combined_presliding([]) == 0.0


def loose(backlash, distance=2e-4, link=0.2):
    """Return a contact whose link's share is met only once the teeth touch."""
    return lambda x: ((1.0 - link) * dahl(distance)(x)
                      + link * min(1.0, max(0.0, (x - backlash) / 3e-5)))


@pytest.mark.parametrize('backlash', [2.5e-4, 1e-3])
def test_backlash_is_reported_with_its_size_and_excluded_from_breakaway(backlash):
    """The longer one is crossed in a slide of the rotor alone."""
    turned, onward = loose(backlash), dahl(2e-4)
    ramps = [ramp(turned if sign != before else onward, slope=slope, sign=sign, before=before)
             for slope in (0.19, 0.2, 0.21)
             for sign, before in [(1, -1), (1, 1), (-1, 1), (-1, -1)]]
    found = evaluate_ramps(ramps, [], 0.2, COUNT, RATE, 0.0)
    assert found.backlash == pytest.approx(backlash, rel=0.2)
    assert found.presliding.backlash == found.backlash
    assert any('backlash of' in warning for warning in found.warnings)
    for sign in (1, -1):
        assert abs(np.mean(found.records.currents(sign))) == pytest.approx(LEVEL, rel=0.05)
    # While the rotor slides through it, this contact's damper adds to its friction.
    assert found.presliding.distance < 2e-4 + 0.15 * backlash


@pytest.mark.parametrize('distance', [1e-4, 5e-4, 2e-3])
def test_a_gear_without_backlash_is_said_to_have_none(distance):
    ramps = [friction_of(ramp(dahl(distance), slope, sign=sign))
             for slope in (0.1, 0.2) for sign in (1, -1)]
    assert find_backlash(ramps, [1, -1, 1, -1], COUNT) == (0.0, [0] * 4)
    assert find_backlash([], [], COUNT) == (0.0, [])


def test_a_contact_that_is_stiffer_to_one_side_is_no_backlash():
    ramps = [friction_of(ramp(contact, sign=sign)) for contact, sign in (
        (loose(3e-4), 1), (dahl(2e-4), -1)) * 2]
    assert find_backlash(ramps, [1, -1, 1, -1], COUNT)[0] == 0.0
    assert find_backlash(ramps, [1, 1, -1, -1], COUNT)[0] > 0.0


def test_breakaway_that_backlash_makes_unsure_is_refused_with_that_word():
    ramps = [ramp(loose(1e-3), sign=sign, before=-sign, level=level * LEVEL)
             for level in (0.8, 0.9, 1.0, 1.1) for sign in (1, -1)]
    with pytest.raises(IdentificationError, match=r'backlash of .* rad: breakaway .* scatters'):
        evaluate_ramps(ramps, [], 0.2, COUNT, RATE, 0.0)


def test_presliding_is_the_less_sure_the_more_ramps_differ_and_the_coarser_the_encoder():
    same = [(side, 3e-4) for side in (True, False)] * 4
    differ = [(side, way) for side in (True, False) for way in (2e-4, 3e-4, 3e-4, 4e-4)]
    few = [presliding_std(ways, 3e-4, COUNT) for ways in (same, differ)]
    assert 0.05 * 3e-4 < few[0] < few[1] < 0.5 * 3e-4
    assert presliding_std(same, 3e-4, 1e-4) > few[0]
    # One ramp a side tells little.
    assert presliding_std(same[:2], 3e-4, COUNT) > few[1]


STOPS = tuple(LEVEL * share for share in np.arange(0.8, 1.3, 0.025))


def test_presliding_comes_to_rest_at_a_stop_and_a_slide_does_not():
    for distance in (2e-4, 1e-3, 2e-3):
        assert moving_level(ramp(dahl(distance), stops=STOPS), 0.2, COUNT) == pytest.approx(
            LEVEL, rel=0.04)
    sliding = ramp(dahl(2e-4), stops=STOPS, strengthening=0.15 * LEVEL)
    assert moving_level(sliding, 0.2, COUNT) == pytest.approx(LEVEL, rel=0.05)
    assert friction_of(sliding).breakaway > 1.1 * LEVEL


def test_a_ramp_waits_at_its_stops():
    times = [time_of_ramp(t, 0.1, [0.1, 0.2]) for t in (
        0.5, 1.0, 1.0 + STOP_TIME, 1.5 + STOP_TIME, 2.0 + 1.5 * STOP_TIME, 3.0 + 2 * STOP_TIME)]
    assert times == pytest.approx([0.5, 1.0, 1.0, 1.5, 2.0, 3.0])


@pytest.mark.parametrize(('distance', 'strengthening'), [(2e-4, 0.15), (1.5e-3, 0.0)])
def test_friction_that_grows_with_speed_is_told_from_presliding(distance, strengthening):
    """Both look alike on a plain ramp; the ramps with stops decide."""
    random = np.random.default_rng(1)
    levels = LEVEL * (1.0 + 0.02 * random.normal(size=8))
    ramps = [ramp(dahl(distance), sign=sign, before=before, level=level,
                  strengthening=strengthening * LEVEL)
             for level, (sign, before) in zip(levels, [(1, -1), (1, 1), (-1, 1), (-1, -1)] * 2)]
    stopping = [ramp(dahl(distance), stops=STOPS, strengthening=strengthening * LEVEL)]
    found = evaluate_ramps(ramps, stopping, 0.2, COUNT, RATE, 0.0)
    for sign in (1, -1):
        assert abs(np.mean(found.records.currents(sign))) == pytest.approx(LEVEL, rel=0.04)
    assert found.presliding.distance == pytest.approx(distance, rel=0.25)
    assert len(found.records) == 8
    assert found.warnings == []


@pytest.mark.parametrize('count', [1, 5])
def test_ramps_with_stops_that_contradict_each_other_leave_the_lower_breakaway(count):
    """Two that scatter prove nothing, ten do."""
    ramps = [ramp(dahl(2e-4), sign=sign, before=before, strengthening=0.15 * LEVEL)
             for sign, before in [(1, -1), (1, 1), (-1, 1), (-1, -1)]]
    stopping = [ramp(dahl(2e-4), stops=STOPS, strengthening=part * LEVEL)
                for part in (0.0, 0.1)] * count
    found = evaluate_ramps(ramps, stopping, 0.2, COUNT, RATE, 0.0)
    borne = abs(np.mean(found.records.currents(1)))
    if count == 1:
        assert borne == pytest.approx(LEVEL, rel=0.04)
    else:
        assert borne > 1.1 * LEVEL


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_parabolas_are_exact_on_a_parabola(place, slope, bend):
    t = 0.01 * np.arange(40)
    value, first, second = local_parabolas(place + slope * t + 0.5 * bend * t ** 2, 7, 0.01)
    middle = t[3:-3]
    np.testing.assert_allclose(value, place + slope * middle + 0.5 * bend * middle ** 2, atol=1e-9)
    np.testing.assert_allclose(first, slope + bend * middle, atol=1e-8)
    np.testing.assert_allclose(second, bend, atol=1e-6)


@pytest.mark.parametrize('friction', [
    lambda v: 0.1 * np.tanh(v / 0.02), lambda v: 0.1 * np.tanh(v / 0.3) + 0.05 * v,
    lambda v: 0.1 * np.sign(v) * (1.0 + np.exp(-np.abs(v) / 0.1))])
def test_the_inertia_is_what_getting_faster_takes_more_than_getting_slower(friction):
    duration, speed = 2.0, 1.2
    time = np.arange(0.0, duration, 1e-3)
    position = np.array([cycle_position(t, speed, duration) for t in time])
    velocity = np.gradient(position, time)
    current = friction(velocity) + np.gradient(velocity, time) / RATE
    current += 2e-3 * np.random.default_rng(3).normal(size=time.size)
    counted = np.floor(position / COUNT) * COUNT
    assert acceleration_of_cycle(np.column_stack([time, counted, current])) == pytest.approx(
        RATE, rel=0.05)
