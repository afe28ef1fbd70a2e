# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law: passive on every path, also with gears and people other than modelled."""

from dataclasses import replace
import math

from helpers import drive_along
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw, law_parameters
from friction_comp.compensation.law_kernel import END_MARGIN
from friction_comp.compensation.law_parameters import knows_presliding, LONGER, START_TIME
from friction_comp.model.effects.history_effects import Hysteresis
from friction_comp.model.friction_model import Presliding
from friction_comp.model.measured import Recorded
from friction_comp.simulation.joint_parameters import GEARS
from simulated_recordings.gear_batch import push, run_gears
from simulated_recordings.random_gears import random_gear
from simulated_recordings.small_model import LEVEL, small_model

DEGREE = math.pi / 180.0
COUNT = 2.0 * math.pi / 400_000


def maxwell_slip(path, shares, distances):
    """Force of parallel elastic-plastic elements of total level 0.1 A along a path, shape (N,)."""
    force = np.zeros(len(path))
    for share, distance in zip(shares, distances):
        z = 0.0
        for k in range(1, len(path)):
            z = min(1.0, max(-1.0, z + (path[k] - path[k - 1]) / distance))
            force[k] += share * LEVEL * z
    return force


@given(seed=st.integers(0, 10 ** 6), factor=st.floats(0.7, 1.1), share=st.floats(0.05, 1.0),
       longest=st.floats(1e-4, 3e-4), size=st.floats(0.2, 20.0), speed=st.floats(0.01, 0.3),
       std=st.sampled_from([None, 1e-5]), end=st.sampled_from([math.nan, -0.5, 0.0, 0.5]))
def test_over_closed_paths_the_law_gives_less_energy_than_the_gear_dissipates(
        seed, factor, share, longest, size, speed, std, end):
    """Random to and fro, through the encoder, friction over-estimated by a tenth at most.

    Also about the place where nothing pushes outwards any more, beyond the end of a movement.
    """
    rng = np.random.default_rng(seed)
    turns = np.concatenate(([0.0], longest * size * rng.uniform(-1.0, 1.0, 12), [0.0]))
    times = np.cumsum(np.abs(np.diff(turns, prepend=0.0))) / speed
    path = np.interp(np.arange(0.0, times[-1], 1e-3), times, turns)
    # The same loop again and again: what is stored at the beginning counts once.
    path = np.tile(path, 3)
    shares = np.array([share, 1.0 - share])
    gear = maxwell_slip(path, shares, (longest, rng.uniform(0.1, 1.0) * longest))
    model = replace(small_model(factor=factor), presliding=Presliding(3e-4, std=std))
    law = CompensationLaw([model])
    law.update(-1e-3, [0.0], None, [1.0], end=[end * longest * size - END_MARGIN])
    current = drive_along(law, np.round(path / COUNT) * COUNT, 0)
    steps = np.diff(path)
    given_back = np.cumsum(current[:-1] * steps)
    taken = np.cumsum(0.5 * (gear[1:] + gear[:-1]) * steps)
    # What both may hold at most, and one sample of travel against a current that is a sample old.
    stored = 0.5 * LEVEL * (LONGER * 3e-4 + longest) * 1.2 + 2.0 * LEVEL * speed * 1e-3
    assert np.max(given_back - taken) <= stored
    loop = len(path) // 3
    assert given_back[-1] - given_back[-loop - 1] <= (
        taken[-1] - taken[-loop - 1]) + 2.0 * LEVEL * speed * 1e-3


@settings(max_examples=6)
@given(seed=st.integers(0, 10 ** 6), distance=st.floats(5e-3, 3e-2), error=st.floats(0.7, 1.4),
       size=st.floats(0.1, 5.0), speed=st.floats(0.1, 0.4))
def test_slow_reversals_of_the_gear_are_not_compensated_early(seed, distance, error, size, speed):
    """Half of the gear's friction is Dahl's over a distance that the model knows to 40 %."""
    rng = np.random.default_rng(seed)
    turns = np.concatenate(([0.0], distance * size * rng.uniform(-1.0, 1.0, 8), [0.0]))
    times = np.cumsum(np.abs(np.diff(turns, prepend=0.0))) / speed
    path = np.tile(np.interp(np.arange(0.0, times[-1], 1e-3), times, turns), 4)
    bristles = Hysteresis({'coefficients': [LEVEL, 0.0], 'distance': distance, 'exponent': 1.0,
                           'transition': 1e-3})
    law = CompensationLaw([replace(small_model(), effects=[bristles])])
    current = drive_along(law, path, 0)
    gear, z = maxwell_slip(path, [1.0], [3e-4]), 0.0
    for k, step in enumerate(np.diff(path), 1):
        side = math.copysign(1.0, step)
        z = side * (1.0 - (1.0 - side * z) * math.exp(-abs(step) / (error * distance)))
        gear[k] += LEVEL * z
    steps, last = np.diff(path)[-len(path) // 4:], slice(-len(path) // 4, None)
    taken = np.sum(0.5 * (gear[1:] + gear[:-1])[last] * steps)
    assert np.sum(current[:-1][last] * steps) <= taken + 4.0 * LEVEL * speed * 1e-3


@pytest.mark.parametrize(('std', 'most'), [(3e-5, 2.0), (None, 3.5)])
def test_a_turn_after_a_long_way_costs_the_hand_friction_alone_and_help_is_soon_back(std, most):
    """Not announced: what helped is gone at the turn, and back in 2 R; later if R is uncertain."""
    model = replace(small_model(), presliding=Presliding(3e-4, std=std))
    law, time = CompensationLaw([model]), 1e-3 * np.arange(3000)
    places = 0.2 * (1.0 - np.cos(2.0 * math.pi * 0.5 * time))
    share = drive_along(law, places, 0) / (0.9 * LEVEL)
    assert share[900] > 0.95
    turn = 1000
    assert abs(share[turn]) < 0.35
    back = np.flatnonzero(share[turn:] < -0.9)[0] + turn
    assert places[turn] - places[back] < most * law.parameters['distance'][0]


def test_help_at_a_turn_is_paid_by_the_way_before():
    """Short ways leave the operator as it is: it reverses over 2 R, whoever pushes."""
    law = CompensationLaw([small_model()])
    distance = law.parameters['distance'][0]
    short, time = 2.5 * distance, 1e-3 * np.arange(4000)
    places = short * (1.0 - np.cos(2.0 * math.pi * 4.0 * time))
    current = drive_along(law, places, 0)
    steps = np.diff(places)[-1000:]
    operator = np.zeros(len(places))
    z = 0.0
    for k in range(1, len(places)):
        z = min(1.0, max(-1.0, z + (places[k] - places[k - 1]) / distance))
        operator[k] = 0.9 * LEVEL * z
    given = np.sum(current[-1001:-1] * steps)
    saved = 0.1 * LEVEL * np.sum(np.abs(steps))
    assert given <= np.sum(operator[-1001:-1] * steps) + saved


def test_a_moment_without_an_announcement_changes_nothing():
    """At rest and in motion: a planner passes through 0."""
    for places in (np.zeros(2000), np.maximum(0.0, 3e-4 * (np.arange(2000) - 900))):
        directions = np.ones(2000)
        steady = drive_along(CompensationLaw([small_model()]), places, directions)
        directions[1200:1300] = 0.0
        np.testing.assert_allclose(
            drive_along(CompensationLaw([small_model()]), places, directions), steady,
            atol=1e-9)


def slow_push():
    """Return the share of the way after 0.4 s of rest, until it is gone within 0.06 s."""
    return np.clip((1e-3 * np.arange(461) - 0.4) / 0.06, 0.0, 1.0)


@pytest.mark.parametrize('presliding, known', [
    (Presliding(3e-4, std=3e-5), True), (Presliding(3e-4), False),
    (Presliding(3e-4, std=7e-5), True), (Presliding(9.0 * COUNT, std=COUNT), True),
    (Presliding(9.0 * COUNT), False)])
def test_a_push_that_nobody_announced_is_helped_from_its_first_displacement(presliding, known):
    """The more, the better presliding is known."""
    model = replace(small_model(), presliding=presliding)
    distance = float(law_parameters(model)['distance'][0]) - 2.0 * COUNT
    assert distance == pytest.approx(presliding.distance * LONGER if not known
                                     else presliding.distance + presliding.std)
    way = presliding.distance * slow_push()
    helped = drive_along(CompensationLaw([model]), np.floor(way / COUNT) * COUNT, 0)[-1]
    assert helped > (0.5 if known else 0.2) * LEVEL


def test_presliding_that_the_encoder_does_not_resolve_is_not_known():
    for counts, known in ((1.9, False), (2.1, True)):
        assert knows_presliding(replace(
            small_model(), presliding=Presliding(counts * COUNT, std=0.5 * COUNT))) == known


def test_a_hand_that_trembles_at_rest_does_not_spoil_the_push():
    """The hand of who waits moves the joint by some counts, without an announcement."""
    distance = 3e-4
    model = replace(small_model(), presliding=Presliding(distance, std=3e-5))
    way = distance * slow_push()
    helped = [drive_along(CompensationLaw([model]),
                          way + tremor * np.sin(0.06 * np.arange(len(way))), 0)[-1]
              for tremor in (0.0, 0.15 * distance)]
    assert helped[1] > 0.8 * helped[0] > 0.4 * LEVEL


@pytest.fixture(scope='module')
def gears():
    return [random_gear(seed, kind) for kind in GEARS for seed in (11, 12)]


def let_go(gears, factor, speed, direction):
    reference = np.zeros((3, 6000))
    reference[2] = direction
    return run_gears([g.parameters for g in gears],
                     [law_parameters(g.wrong_by(factor)) for g in gears], reference,
                     speed=speed * DEGREE)


@pytest.mark.parametrize('direction', [0.0, 1.0])
@pytest.mark.parametrize('speed', [5.0, 40.0, 80.0])
def test_a_joint_let_go_never_gains_speed_and_rests(gears, speed, direction):
    for factor in (1.05, 1.1):
        log, _ = let_go(gears, factor, speed, direction)
        assert log['link_speed'][:, 100:].max() < (speed + 0.5) * DEGREE
        if factor == 1.05:
            assert np.ptp(log['rotor'][:, -300:], axis=1).max() < 0.05 * DEGREE


def test_overestimated_friction_is_noticed_and_reduced(gears):
    log, guards = let_go(gears, 1.5, 40.0, 1.0)
    fastest = log['link_speed'].max(axis=1)
    assert fastest.max() < 125.0 * DEGREE
    assert np.all(guards['trust'][fastest > 101.0 * DEGREE] < 0.9)
    assert np.all(guards['overspeed'][fastest > 101.0 * DEGREE] > 0.0)


def test_an_untouched_joint_stays(gears):
    """Where friction is over-estimated by a tenth, what helps comes closest to it."""
    chosen = [gear for gear in gears for _ in range(10)]
    reference = np.zeros((3, 10000))
    reference[2, 300:] = 1.0
    log, _ = run_gears([g.parameters for g in chosen],
                       [law_parameters(g.wrong_by(1.1)) for g in chosen], reference, seed=3)
    assert np.abs(log['rotor']).max() < 1.5 * DEGREE
    assert np.mean(np.abs(log['rotor']).max(axis=1) > DEGREE) < 0.02


def test_most_of_frictions_part_of_the_peak_is_taken_away_and_nothing_vibrates(gears):
    reference = push(0.5, 20.0 * DEGREE, 2.0, 3.5, 1.0)
    parameters = [gear.held_by(0.05) for gear in gears]
    torque = {}
    for law in ('continuous', 'none'):
        log, _ = run_gears(parameters, [law_parameters(g.model, law) for g in gears], reference,
                           released=10 ** 9)
        torque[law] = np.abs(log['interaction_torque']).max(axis=1)
        if law == 'continuous':
            at_rest = log['rotor_speed'][:, 1500:2000]
    assert np.median(torque['continuous'] / torque['none']) < 0.22
    assert at_rest.std(axis=1).max() < 0.2 * DEGREE


GAINS = 0.0, 0.25, 0.5, 0.75, 0.9


@pytest.mark.parametrize('gain', GAINS)
@pytest.mark.parametrize('direction', [-1, 1])
def test_announced_at_rest_the_current_is_the_gain_times_breakaway(gain, direction):
    """So that who starts with a small gain, and raises it, is given little at first."""
    for factor in (0.8, 1.0, 1.3):
        base = small_model()
        model = replace(base, breakaway=replace(
            base.breakaway, positive_mean=factor * LEVEL, negative_mean=-factor * LEVEL))
        current = drive_along(CompensationLaw([model], breakaway_gain=gain), np.zeros(900),
                              direction)
        assert np.abs(current).max() <= gain * factor * LEVEL + 1e-12
        assert current[-1] == pytest.approx(direction * gain * factor * LEVEL)


def test_a_hand_feels_the_breakaway_gain(gears):
    """The more, the less it has to push at the start; a small step is a small difference."""
    reference = push(0.5, 20.0 * DEGREE, 2.0, 3.5, 1.0)
    peaks = []
    for gain in GAINS:
        log, _ = run_gears([gear.held_by(0.05) for gear in gears],
                           [law_parameters(g.model, breakaway_gain=gain) for g in gears],
                           reference, released=10 ** 9)
        torque = np.abs(log['interaction_torque'])[:, 2000:2600].max(axis=1)
        peaks.append(np.median(torque / [g.parameters['upper'] for g in gears]))
    assert (np.diff(peaks) < -0.03).all()
    assert np.abs(np.diff(peaks)).max() < 0.4


def test_who_moves_against_the_announcement_starts_no_harder_than_without_help(gears):
    """Planners are wrong, and patients do not always follow."""
    reference = push(0.5, 20.0 * DEGREE, 2.0, 3.5, 1.0)
    reference[2] *= -1.0
    peaks = {}
    for law in ('continuous', 'none'):
        log, _ = run_gears([gear.held_by(0.05) for gear in gears],
                           [law_parameters(g.model, law) for g in gears], reference,
                           released=10 ** 9)
        peaks[law] = np.abs(log['interaction_torque'])[:, 2000:2600].max(axis=1)
    assert np.median(peaks['continuous'] / peaks['none']) < 0.8


@pytest.mark.parametrize('spoil', [
    lambda k, x: (x + 2.0 * math.pi if k == 2000 else x, 0.0),
    lambda k, x: (x + 2.0 * math.pi if k >= 2000 else x, 0.0),
    lambda k, x: (1e307 if k == 2000 else x, 0.0),
    lambda k, x: (math.nan if k == 2000 else x, 0.0),
    lambda k, x: (x, math.inf if k == 2000 else 0.0)])
@pytest.mark.parametrize('direction', [0.0, 1.0])
def test_bad_samples_pass(spoil, direction):
    """At rest on a gear that gives: the current stays bounded and is the old one half a second on.
    """
    law, current, currents = CompensationLaw([small_model()]), 0.0, []
    for k in range(2800):
        place = round(current / LEVEL * 2e-4 / COUNT) * COUNT
        position, velocity = spoil(k, place)
        current = law.update(1e-3 * k, [position], [velocity], [direction])[0]
        currents.append(current)
    assert np.all(np.isfinite(currents))
    assert np.abs(currents).max() <= 0.9 * LEVEL + 1e-12
    assert currents[2500] == pytest.approx(currents[1990], abs=0.02 * LEVEL)


def test_position_limits_end_softly():
    """No friction is fed forward beyond the end of the range, all of it well within."""
    model = replace(small_model(), position_limits=(-1.0, 1.0))
    within, beyond = (drive_along(CompensationLaw([model]), start + 3e-4 * np.arange(1000))[-1]
                      for start in (-0.3, 0.8))
    assert within == pytest.approx(0.9 * LEVEL, rel=0.01)
    assert beyond == 0.0


def test_faster_than_identified_nothing_is_fed_forward():
    law = CompensationLaw([small_model()])
    assert drive_along(law, 2.7e-3 * np.arange(1000))[-1] == 0.0
    assert law.guards['taken back'][0] > 0.4
    assert law.guards['beyond identified speeds'][0] > 0.5


def test_a_hurried_movement_costs_no_help_and_a_joint_that_goes_on_and_on_is_trusted_less():
    """At 1.12 of the identified 100 deg/s, 50 degrees to and fro, and as far one way."""
    step, turn = 1.12e-3 * math.radians(100.0), 450
    there = step * np.arange(turn)
    hurry, runaway = CompensationLaw([small_model()]), CompensationLaw([small_model()])
    drive_along(hurry, np.tile(np.concatenate([there, there[::-1]]), 3), direction=0)
    assert hurry.guards['beyond identified speeds'][0] > 1.0
    assert hurry.guards['taken back'][0] == 0.0
    drive_along(runaway, step * np.arange(6 * turn), direction=0)
    assert runaway.guards['taken back'][0] == pytest.approx(0.5)


def test_a_recording_of_faster_motion_counts_as_identified():
    slow, fast = (drive_along(
        CompensationLaw([replace(small_model(), recorded=Recorded((0.5, top)))]),
        2.4e-3 * np.arange(400), direction=0)[-1] for top in (1.0, 2.5))
    assert fast == pytest.approx(0.9 * LEVEL, rel=0.01)
    assert slow < 0.5 * LEVEL


def test_a_joint_on_friction_below_its_model_by_more_than_the_share_stops_gaining_speed(gears):
    """In the model it is 1.14 times as large: more is fed forward than the gear takes."""
    log, _ = let_go(gears, 1.14, 20.0, 1.0)
    speed, started = log['link_speed'], round(1e3 * (START_TIME + 0.5))
    assert np.all(speed[:, started:].max(axis=1) < speed[:, :started].max(axis=1))
    assert speed[:, -1].max() < 0.5 * 20.0 * DEGREE


def test_equal_and_older_times_change_nothing():
    law = CompensationLaw([small_model()])
    current = drive_along(law, 3e-4 * np.arange(500), velocity=0.3)[-1]
    for time in (0.499, 0.45):
        assert law.update(time, [0.15], [0.3], [1])[0] == current


def follow_with_stamps(stamps):
    """Return the currents along a steady motion that turns round after 0.6 s, (N,)."""
    law = CompensationLaw([small_model()])
    return np.array([law.update(stamp, [3e-4 * min(k, 1200 - k)], None, [0])[0]
                     for k, stamp in enumerate(stamps)])


def test_a_joint_that_turns_round_as_announced_has_its_preload_without_a_rest():
    """It has help as long as it moves, and the other way before it moves there."""
    # Announced 0.2 s before it stops; friction then holds it for 0.3 s while the person pushes.
    k = np.arange(1600)
    speed = np.where(k < 1500, np.interp(k, [1000, 1200], [0.3, 0.0]), -0.1)
    share = drive_along(CompensationLaw([small_model()]), 1e-3 * np.cumsum(speed),
                        np.where(k < 1000, 1, -1)) / (0.9 * LEVEL)
    assert share[1150] > 0.8
    # From full help in one direction to full help in the other: 0.2 s.
    assert np.flatnonzero(share < -0.9)[0] <= 1200 + 220
    assert np.all(share[1420:1500] < -0.9)


def test_an_announcement_is_spent_by_a_movement_in_its_direction():
    """A joint that swings to and fro by itself gets what d = 0 gives at every later turn."""
    time = 1e-3 * np.arange(5000)
    places = 0.1 * (1.0 - np.cos(2.0 * math.pi * 0.5 * np.maximum(0.0, time - 0.5)))
    later = slice(1600, None)
    found, wanted = (drive_along(CompensationLaw([small_model()]), places, d)[later]
                     for d in (1, 0))
    np.testing.assert_allclose(found, wanted, atol=0.07 * LEVEL)


@pytest.mark.parametrize('leap', [10.0, -10.0])
def test_a_jump_of_the_stamps_does_not_stop_the_law(leap):
    """Else the current stays as it is until the clock has caught up, wherever the joint goes."""
    stamps = 100.0 + 1e-3 * np.arange(1200)
    expected = follow_with_stamps(stamps)
    once, for_good = stamps.copy(), stamps.copy()
    once[500] += leap
    for_good[500:] += leap
    for spoiled in (once, for_good):
        found = follow_with_stamps(spoiled)
        assert np.all(np.abs(found) <= LEVEL)
        np.testing.assert_allclose(found[900:], expected[900:], atol=1e-3 * LEVEL)
    assert expected[-1] == pytest.approx(-0.9 * LEVEL, rel=0.01)
