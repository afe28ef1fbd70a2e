# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What current ramps show: breakaway, presliding, backlash, rest."""

import math
from typing import NamedTuple

from hypothesis import given, strategies as st
from numba import njit
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.identification.ramps import (
    combined_presliding,
    evaluate_ramps,
    find_backlash,
    first_stair,
    RampFriction,
    rests,
)
from friction_comp.identification.run import IdentificationRun
from friction_comp.identification.supervised_run import Sample

LEVEL, RATE, COUNT = 0.3, 60.0, 1.5e-5  # A, rad/s² per A, rad
ONE_EACH = np.array([True, False])      # which ramps follow a slide in their own direction


class Contact(NamedTuple):
    """Friction of Dahl's kind, 95 % of its level at a distance; of a loose gear, the link's share
    is met only once the teeth touch."""

    distance: float
    backlash: float = 0.0
    link: float = 0.0

    def start(self, level, strengthening):
        # With enough damping, the rotor does not oscillate on its contact.
        damping = 3.0 * math.sqrt(level / 3e-4 / RATE)
        return lambda v, x, current: dragged(v, x, current, level, strengthening, damping, *self)


@njit(cache=True)
def dragged(v, x, current, level, strengthening, damping, distance, backlash, link):
    """Return speed and displacement 1 ms later."""
    for _ in range(10):
        share = -(1.0 - link) * math.expm1(-3.0 * x / distance) + link * min(
            1.0, max(0.0, (x - backlash) / 3e-5))
        friction = (level * share + damping * v * (1.0 - share)
                    + strengthening * (1.0 - math.exp(-max(v, 0.0) / 0.005)))
        v = max(0.0, v + 1e-4 * RATE * (current - friction))
        x += 1e-4 * v
    return v, x


class LuGre(NamedTuple):
    """A LuGre contact, 95 % of its level at a distance; `damping` is a share of critical."""

    distance: float
    damping: float

    def start(self, level, _):
        reach, z = self.distance / 3.0, 0.0
        damping = 2.0 * self.damping * math.sqrt(level / reach / RATE)

        def move(v, x, current):
            nonlocal z
            v, x, z = shaken(v, x, z, current, reach, level / reach, damping)
            return v, x
        return move


@njit(cache=True)
def shaken(v, x, z, current, reach, stiffness, damping):
    """Return speed, displacement and the bristles' deflection 1 ms later."""
    for _ in range(10):
        rate = v - abs(v) * z / reach
        z += 1e-4 * rate
        v += 1e-4 * RATE * (current - stiffness * z - damping * rate - 0.1 * v)
        x += 1e-4 * v
    return v, x, z


def ramp(contact, slope=0.2, sign=1, before=-1, level=LEVEL, strengthening=0.0, first=0.85):
    """Drive a ramp on a joint whose friction is `level` times that of a contact.

    What a slide takes more at speed is `strengthening`, A, reached within 0.02 rad/s.
    """
    drive = Drive(0.1, 100.0, round(2.0 * math.pi / COUNT / 100.0), 3.0)
    motion = IdentificationRun(IdentificationGoal(
        (0.1, 0.2), ramp_slope=slope, ramp_period=5.0 * LEVEL / slope), drive)
    x, v, t = 0.0, 0.0, 0.0
    motion.sample, motion._slid = Sample(0.0, 0.0, 0.0), before
    steps, move = motion._ramp(sign, first * level), contact.start(level, strengthening)
    command = next(steps)
    try:
        while True:
            v, x = move(v, x, sign * command)
            t += 1e-3
            command = steps.send(Sample(t, sign * math.floor(x / COUNT) * COUNT, command))
    except StopIteration as end:
        return end.value[0]


def loose(backlash):
    return Contact(2e-4, backlash, 0.2)


def evaluated(recorded):
    return evaluate_ramps(recorded, COUNT, RATE, 0.0)


def friction_of(recorded):
    return RampFriction.of(recorded, COUNT, RATE)


@pytest.mark.parametrize('strengthening', [-0.05, 0.05, 0.15, 0.5])
def test_breakaway_is_the_largest_current_that_holds_however_friction_goes_on(strengthening):
    """Whether friction rises from standstill, as in configuration 2 of the note, or falls."""
    recorded = [ramp(Contact(distance), sign=sign, strengthening=strengthening * LEVEL)
                for distance in (1e-4, 3e-4) for sign in (1, -1)]
    found = evaluated(recorded)
    np.testing.assert_allclose(
        found.breakaways, LEVEL * np.array([1, -1, 1, -1]), rtol=0.035)
    # Between that and where it goes, it moves so slowly that a gear may also creep there.
    assert ('gives way slowly' in ' '.join(found.warnings)) == (strengthening > 0.2)


@pytest.mark.parametrize(('damping', 'distance'), [(0.0, 4e-3), (0.05, 1.5e-3), (1.0, 1.5e-3)])
def test_a_contact_of_little_damping_does_not_creep_under_the_stairs(damping, distance):
    """LuGre and Dahl: shaken by each stair, they would be read 20 to 90 % too long."""
    recorded, held = [], {1: [], -1: []}
    for sign in (1, 1, -1, -1) * 3:
        first = first_stair(held[sign] or [0.85 * LEVEL]) / LEVEL
        recorded.append(ramp(LuGre(distance, damping), sign=sign, first=first,
                             before=recorded[-1].direction if recorded else -1))
        held[sign].append(abs(recorded[-1].breakaway))
    found = evaluated(recorded)
    np.testing.assert_allclose(np.abs(found.breakaways), LEVEL, rtol=0.03)
    assert found.presliding.distance == pytest.approx(distance, rel=0.1)
    assert found.presliding.std < (0.25 if damping else 0.6) * distance


def test_a_ramp_whose_first_stair_does_not_hold_is_no_ramp():
    assert ramp(Contact(3e-4), first=1.05) is None


def test_a_joint_rests_if_it_slows_down_and_slides_if_it_does_not():
    time = np.arange(0.0, 0.4, 1e-3)

    def moved(way):
        return rests(time, np.floor(way / COUNT) * COUNT, 1, COUNT)
    assert moved(3e-4 * -np.expm1(-time / 0.1))
    assert not moved(3e-4 * -np.expm1(-time / 0.5)), 'a longer pause will tell'
    assert not moved(1e-3 * time)
    assert moved(2e-4 * time), 'contacts creep steadily'
    assert not moved(0.1 * time ** 2)
    trembling = 5.0 * COUNT * np.random.default_rng(1).normal(size=time.size)
    assert moved(3e-4 + trembling)
    assert not moved(5e-3 * time + trembling)


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
    ways = np.array([way_to(rest, 1.0 - 1e-9), way_to(-rest, 1.0 - 1e-9)])
    assert combined_presliding(ways, ONE_EACH, COUNT)[0] == pytest.approx(
        float(distance.max()), rel=1e-3)


def test_presliding_of_a_loose_gear_is_between_that_of_memory_and_that_of_backlash():
    ways = np.array([2e-4, 6e-4])
    distance, deviation = combined_presliding(ways, ONE_EACH, COUNT, loose=True)
    assert distance == pytest.approx(3e-4)
    # All that ramps against the slide yield more may be backlash, or memory.
    assert deviation > 1e-4
    assert combined_presliding(ways, ONE_EACH, COUNT)[0] == pytest.approx(4e-4)
    assert combined_presliding(ways, np.zeros(2, bool), COUNT)[0] == pytest.approx(4e-4)


@pytest.mark.parametrize('backlash', [2.5e-4, 1e-3])
def test_backlash_is_reported_with_its_size_and_excluded_from_breakaway(backlash):
    """The longer one is crossed in a slide of the rotor alone."""
    turned, onward = loose(backlash), Contact(2e-4)
    ramps = [ramp(turned if sign != before else onward, slope=slope, sign=sign, before=before)
             for slope in (0.19, 0.2, 0.21)
             for sign, before in [(1, -1), (1, 1), (-1, 1), (-1, -1)]]
    found = evaluated(ramps)
    assert found.backlash == pytest.approx(backlash, rel=0.2)
    assert found.presliding.backlash == found.backlash
    assert any('backlash of' in warning for warning in found.warnings)
    assert np.mean(np.abs(found.breakaways)) == pytest.approx(LEVEL, rel=0.05)
    presliding = found.presliding
    assert presliding.distance < 2e-4 + 0.15 * backlash
    assert abs(presliding.distance - 2e-4) < 2.0 * presliding.std


@pytest.mark.parametrize('contacts', [
    (Contact(1e-4), Contact(1e-4)), (Contact(2e-3), Contact(2e-3)), (loose(3e-4), Contact(2e-4))])
def test_neither_a_gear_without_backlash_nor_one_that_is_stiffer_to_one_side_is_loose(contacts):
    curves = [friction_of(ramp(contact, sign=sign)) for contact, sign in zip(contacts, (1, -1))]
    signs, before = np.array([1, -1] * 2), np.zeros(4, dtype=bool)
    assert find_backlash(curves * 2, signs, before, COUNT) == (0.0, [0] * 4)
    if contacts[0].backlash:
        assert find_backlash([curves[0]] * 4, signs, before, COUNT)[0] > 0.0


def test_breakaway_that_backlash_makes_unsure_is_refused_with_that_word():
    ramps = [ramp(loose(1e-3), sign=sign, before=-sign, level=level * LEVEL)
             for level in (0.8, 0.9, 1.0, 1.1) for sign in (1, -1)]
    with pytest.raises(IdentificationError, match=r'backlash of .* rad: breakaway scatters'):
        evaluated(ramps)


def test_presliding_is_the_less_sure_the_more_ramps_differ_and_the_coarser_the_encoder():
    def deviation(*ways, count=COUNT):
        onward = np.arange(2 * len(ways)) < len(ways)
        return combined_presliding(np.array(ways * 2), onward, count)[1]
    same, differ = deviation(*[3e-4] * 4), deviation(2e-4, 3e-4, 3e-4, 4e-4)
    assert 0.05 * 3e-4 < same < differ < 0.5 * 3e-4
    assert deviation(*[3e-4] * 4, count=1e-4) > same
    assert deviation(3e-4) > differ, 'one ramp a side tells little'
