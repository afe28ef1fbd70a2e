# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What an identification's cycles and ramps show.

Cycles: mean currents, drift, loads, and doubts. Ramps: breakaway, presliding, backlash; of other
contacts see `test_bench_worlds.py`.
"""

import math
from typing import NamedTuple

from hypothesis import given, strategies as st
from numba import njit
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.identification import measurements as twice
from friction_comp.identification.curves import fit_sigmoid
from friction_comp.identification.goal import cycle_state, IdentificationError, IdentificationGoal
from friction_comp.identification.measurements import (
    evaluate_ramps,
    find_backlash,
    KineticPoint,
    RampFriction,
)
from friction_comp.identification.run import (
    curve_misfit,
    doubts_of_curve,
    doubts_of_cycles,
    doubts_of_ramps,
    IdentificationRun,
    uncertainty_of,
)
from friction_comp.identification.supervised_run import Sample
from friction_comp.model.model_file import Breakaway, Presliding

SPEEDS = np.array([0.09, 0.2, 0.5, 1.0, 1.6])
RANGE, COULOMB, VISCOUS, RATE, STEP = 0.9, 0.5, 0.2, 25.0, 2e-3


def in_ampere(current):
    return f'{current:.3g} A'


def driven(speed, step=STEP):
    """Return duration, time, position and velocity of a cycle."""
    duration = 2.5 * RANGE / speed
    time = np.arange(0.0, duration, step)
    states = np.array([cycle_state(t, speed, duration) for t in time])
    return duration, time, *states.T


def cycles(friction, load=lambda x: 0.0, speeds=SPEEDS, begin=0.0, noise=0.002, sensor=None,
           pace=1.0):
    """Drive cycles of Eq. 3; friction(speed, position, time) and load(position) are in A."""
    random, done = np.random.default_rng(4), []
    for speed in speeds:
        duration, time, x, v = driven(speed)
        command = np.sign(v) * friction(pace * np.abs(v), x, begin + time) + load(x)
        measured = (sensor or (lambda i: i))(command) + noise * random.standard_normal(len(x))
        done.append(twice.Cycle.measured(
            begin, duration, speed, np.column_stack([begin + time, pace * x, measured]), command))
        begin += duration + 2.0
    return done


def plain(speed, x, time):
    return COULOMB + VISCOUS * speed


def warming(speed, x, time):
    warm = np.exp(-time / 60.0)
    return COULOMB * (1.0 + 0.1 * warm) + VISCOUS * (1.0 + 0.5 * warm) * speed


def viscous(points):
    points = sorted(points, key=lambda point: point.speed)
    return fit_sigmoid([p.speed for p in points], [p.current for p in points])[0].viscous


def points_of(done):
    return [point for cycle in done for point in cycle.points]


@given(st.floats(0.05, 2.0), st.floats(0.5, 20.0), st.floats(0.0, 1.0))
def test_the_profile_is_that_of_the_note(speed, duration, share):
    position, velocity = cycle_state(share * duration, speed, duration)
    assert velocity == pytest.approx(np.interp(
        share, [0.0, 0.1, 0.4, 0.6, 0.9, 1.0], speed * np.array([0, 1, 1, -1, -1, 0])), abs=1e-9)
    assert -1e-9 <= position <= 0.4 * speed * duration + 1e-9
    later, _ = cycle_state(share * duration + 1e-6, speed, duration)
    assert later - position == pytest.approx(1e-6 * velocity, abs=2e-11 * speed / duration + 1e-14)


# What is measured twice.

def test_friction_that_falls_while_it_is_measured_is_named_and_that_of_the_end_given():
    first = cycles(warming)
    again = cycles(warming, speeds=SPEEDS[[0, 2, 4]], begin=150.0)
    points, drift = twice.without_drift(first, again)
    end = VISCOUS * (1.0 + 0.5 * np.exp(-again[-1].time / 60.0))
    assert viscous(points_of(first)) > 1.08 * end
    assert viscous(points) == pytest.approx(end, rel=0.04)
    truth = np.array([np.sign(p.speed) * warming(abs(p.speed), 0.0, again[-1].time)
                      for p in points])
    np.testing.assert_allclose([p.current for p in points], truth, rtol=0.015)
    [words] = doubts_of_cycles(first, drift)
    expected = warming(1.6, 0.0, again[-1].time) / warming(1.6, 0.0, first[-1].time) - 1.0
    assert drift[1.6] == pytest.approx(expected, abs=0.005)
    assert f'{drift[1.6]:+.1%} at 1.6 rad/s' in words
    # Twice the deviation of one measurement, since the other differed by the root of two more.
    assert uncertainty_of(first, again, 0.0) > 0.05


@pytest.mark.parametrize(('first', 'again'), [
    ({'noise': 0.05}, {}),
    # Nor is a repeat that did not hold its speed, or oscillated, a drift of the drive.
    ({}, {'pace': 1.11}),
    ({}, {'sensor': lambda i: 0.4 * i + 0.3 * np.sin(np.arange(len(i)))})])
def test_friction_that_stays_is_what_was_measured_first(first, again):
    first = cycles(plain, **first)
    points, drift = twice.without_drift(
        first, done := cycles(plain, speeds=SPEEDS[[0, 2, 4]], begin=150.0, **again))
    assert points == points_of(first)
    assert not drift
    if not again:
        assert not doubts_of_cycles(first, drift)
        assert not doubts_of_cycles(first, {}, twice.position_slopes(first))
        assert uncertainty_of(first, done, 0.0) < 0.02
        assert uncertainty_of(first, done, 0.03) == pytest.approx(0.06, rel=0.1)


@pytest.mark.parametrize('load', [lambda x: 0.4 * x, lambda x: 0.4 * np.sin(x + 0.5)])
def test_neither_a_spring_nor_gravity_is_taken_for_viscous_friction(load):
    done = cycles(plain, load)
    assert viscous(points_of(done)) > 1.1 * VISCOUS
    level = twice.levelled(done, twice.position_slopes(done))
    assert viscous(points_of(level)) == pytest.approx(VISCOUS, rel=0.02)


@pytest.mark.parametrize(('friction', 'load', 'words'), [
    (lambda v, x, t: plain(v, x, t) * (1.0 + 0.15 * x), lambda x: 0.0, 'friction'),
    (plain, lambda x: 0.1 * np.sin(x), 'the load'),
    (lambda v, x, t: plain(v, x, t) * (1.0 + 0.03 * np.sin(20.0 * x)), lambda x: 0.0, None)])
def test_what_rises_over_position_is_named_and_a_ripple_is_not(friction, load, words):
    done = cycles(friction, load)
    said = doubts_of_cycles(done, {}, twice.position_slopes(done))
    assert [word.startswith(words) for word in said] == ([True] if words else [])


@pytest.mark.parametrize(('sensor', 'words'), [
    (lambda i: 0.9 * i, '0.90 times the commanded'), (lambda i: i + 0.1, 'has an offset'),
    (lambda i: i * (1.0 + 0.5 * np.sin(np.arange(len(i)))), 'the current varies by')])
def test_a_sensor_or_a_current_that_is_not_the_commanded_one_is_said(sensor, words):
    [said] = doubts_of_cycles(cycles(plain, sensor=sensor), {})
    assert words in said


@pytest.mark.parametrize(('positive', 'negative', 'std', 'words'), [
    (0.55, -0.45, 0.01, []), (0.65, -0.35, 0.01, ['positive direction needs 0.3 A more']),
    (0.5, -0.5, 0.4, 'touched'), (0.95, -0.1, 0.01, 'somebody leant')])
def test_a_load_that_adds_to_friction_is_told_from_a_hand(positive, negative, std, words):
    points = points_of(cycles(plain, speeds=SPEEDS[:1]))
    found = Breakaway(positive, negative, std, std)

    def doubts(cycles=8, step=1e-3, presliding=None):
        return doubts_of_ramps(found, points, cycles, step, presliding, in_ampere)
    if isinstance(words, str):
        with pytest.raises(IdentificationError, match=words):
            doubts()
        return
    said = doubts()
    assert len(said) == len(words)
    assert all(word in text for word, text in zip(words, said))
    assert any('measured once' in text for text in doubts(cycles=1))
    # The rate that presliding needs is said where it was measured at less.
    assert any('below 500 Hz' in text for text in doubts(step=4e-3, presliding=Presliding(1e-3)))
    assert doubts(step=2e-3, presliding=Presliding(1e-3)) == said


@pytest.mark.parametrize('rise, warned', [(0.0, 0), (0.1, 0), (0.2, 1), (0.5, 1)])
def test_a_curve_that_is_not_the_measured_friction_is_not_passed_off_as_it(rise, warned):
    speeds = np.array([0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
    speeds = np.concatenate((-speeds[::-1], speeds))
    fading = 1.0 + rise * np.exp(-(speeds / 0.08) ** 2)
    currents = 0.2 * np.sign(speeds) * fading + 0.15 * speeds
    sigmoid, _ = fit_sigmoid(speeds, currents)
    points = [KineticPoint(v, i, 0.0, v, 0.0) for v, i in zip(speeds, currents)]
    said = doubts_of_curve(points, sigmoid, curve_misfit(points, sigmoid), in_ampere)
    assert len(said) == warned
    assert all('0.05 rad/s' in line for line in said)


# Ramps.

LEVEL, FREE, COUNT = 0.3, 60.0, 1.5e-5  # A, rad/s² per A of a free joint, rad


class Contact(NamedTuple):
    """Friction of Dahl's kind, 95 % of its level at a distance; of a loose gear, the link's share
    is met only once the teeth touch."""

    distance: float
    backlash: float = 0.0
    link: float = 0.0

    def start(self, level, strengthening):
        # With enough damping, the rotor does not oscillate on its contact.
        damping = 3.0 * math.sqrt(level / 3e-4 / FREE)
        return lambda v, x, current: dragged(v, x, current, level, strengthening, damping, *self)


@njit(cache=True)
def dragged(v, x, current, level, strengthening, damping, distance, backlash, link):
    """Return speed and displacement 1 ms later."""
    for _ in range(10):
        share = -(1.0 - link) * math.expm1(-3.0 * x / distance) + link * min(
            1.0, max(0.0, (x - backlash) / 3e-5))
        friction = (level * share + damping * v * (1.0 - share)
                    + strengthening * (1.0 - math.exp(-max(v, 0.0) / 0.005)))
        v = max(0.0, v + 1e-4 * FREE * (current - friction))
        x += 1e-4 * v
    return v, x


def ramp(contact, slope=0.2, sign=1, before=-1, level=LEVEL, strengthening=0.0):
    """Drive a ramp on a joint whose friction is `level` times that of a contact.

    What a slide takes more at speed is `strengthening`, A, reached within 0.02 rad/s.
    """
    drive = Drive(0.1, 100.0, round(2.0 * math.pi / COUNT / 100.0), 3.0)
    motion = IdentificationRun(IdentificationGoal(
        (0.1, 0.2), ramp_slope=slope, ramp_period=5.0 * LEVEL / slope), drive)
    x, v, t = 0.0, 0.0, 0.0
    motion.sample, motion._slid = Sample(0.0, 0.0, 0.0), before
    steps, move = motion._ramp(sign, 0.85 * level), contact.start(level, strengthening)
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
    return evaluate_ramps(recorded, COUNT, FREE, 0.0)


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
    curves = [RampFriction.of(ramp(contact, sign=sign), COUNT, FREE)
              for contact, sign in zip(contacts, (1, -1))]
    signs, before = np.array([1, -1] * 2), np.zeros(4, dtype=bool)
    assert find_backlash(curves * 2, signs, before, COUNT) == (0.0, [0] * 4)
    if contacts[0].backlash:
        assert find_backlash([curves[0]] * 4, signs, before, COUNT)[0] > 0.0


def test_breakaway_that_backlash_makes_unsure_is_refused_with_that_word():
    ramps = [ramp(loose(1e-3), sign=sign, before=-sign, level=level * LEVEL)
             for level in (0.8, 0.9, 1.0, 1.1) for sign in (1, -1)]
    with pytest.raises(IdentificationError, match=r'backlash of .* rad: breakaway scatters'):
        evaluated(ramps)
