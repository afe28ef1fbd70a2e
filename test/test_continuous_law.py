# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The continuous law: passive on every path, and what a hand, a gear and a planner get from it."""

from dataclasses import replace
import importlib
import math
import os
from pathlib import Path

from helpers import drive_along, LEVEL, note_model, small_model
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from friction_comp import compensation, simulation
from friction_comp.compensation.law import CompensationLaw, law_parameters
from friction_comp.compensation.law_kernel import EARLY, FILL, LATE, LATER, REST_TIME
from friction_comp.compensation.law_parameters import LARGEST_SHARE, LEAST_SHARE, SHARE
from friction_comp.compensation.safety import END_BRAKE, END_MARGIN
from friction_comp.drive import Drive
from friction_comp.model.effects import Hysteresis
from friction_comp.model.friction_model import Presliding
from friction_comp.model.model_file import Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.simulation.joint import Plant
from law_judge.alone import release, untouched
from law_judge.bank import make_bank
from law_judge.hands import peak
import world.gear

COUNT, DEGREE = 2.0 * math.pi / 400_000, math.pi / 180.0


def maxwell_slip(path, shares, distances):
    """Force of parallel elastic-plastic elements of total level 0.1 A along a path, shape (N,)."""
    force = np.zeros(len(path))
    for share, distance in zip(shares, distances):
        z = 0.0
        for k in range(1, len(path)):
            z = min(1.0, max(-1.0, z + (path[k] - path[k - 1]) / distance))
            force[k] += share * LEVEL * z
    return force


@given(seed=st.integers(0, 10 ** 6), factor=st.floats(0.7, 1.08), share=st.floats(0.05, 1.0),
       longest=st.floats(1e-4, 9e-4), size=st.floats(0.2, 60.0), speed=st.floats(0.01, 0.3),
       rest=st.sampled_from([0.0, 0.05, 0.4]), announced=st.sampled_from([-1, 0, 1, None]))
def test_what_the_law_gives_is_what_the_gear_takes_and_a_bounded_amount(
        seed, factor, share, longest, size, speed, rest, announced):
    """The bound of docs/law_proof.md: on any path, whatever is announced, through the encoder."""
    rng = np.random.default_rng(seed)
    turns = np.concatenate(([0.0], longest * size * rng.uniform(-1.0, 1.0, 10), [0.0]))
    times = np.cumsum(np.abs(np.diff(turns, prepend=0.0)) / speed + rng.choice([0.0, rest], 12))
    path = np.tile(np.interp(np.arange(0.0, times[-1], 1e-3), times, turns), 3)
    shares = np.array([share, 1.0 - share])
    gear = maxwell_slip(path, shares, (longest, rng.uniform(0.1, 1.0) * longest))
    law = CompensationLaw([replace(
        small_model(factor=factor), presliding=Presliding(3e-4, std=1e-5))])
    directions = (np.full(len(path), announced) if announced is not None
                  else np.repeat(rng.integers(-1, 2, len(path) // 150 + 1), 150)[:len(path)])
    current = drive_along(law, np.round(path / COUNT) * COUNT, directions)
    steps = np.diff(path)
    given_back = np.cumsum(current[:-1] * steps)
    taken = np.cumsum(0.5 * (gear[1:] + gear[:-1]) * steps)
    level, distance = SHARE * factor * LEVEL, law.parameters['distance'][0]
    reversal = 2.0 * (distance + law.parameters['play'][0])
    rested = np.abs(np.diff(path, prepend=0.0)).astype(bool).size - np.count_nonzero(steps)
    fills = 1.0 + 1e-3 * (rested + 300.0 * np.count_nonzero(np.diff(directions))) / REST_TIME / 2.0
    # A gear that yields farther than R gives back at each turn what the element does not hold.
    farther = 2.0 * max(0.0, longest - distance) * (3 * 12 + np.count_nonzero(np.diff(directions)))
    # A current is a sample old, and a count off.
    late = 2.0 * speed * 1e-3 * 36 + 2.0 * COUNT * 36
    bound = level * (0.5 * distance + reversal * fills + farther + late) + 0.5 * LEVEL * longest
    assert level * (1.0 + FILL) <= LEVEL
    assert np.max(given_back - taken) <= bound


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


@pytest.mark.parametrize('low', [-1, 0])
@pytest.mark.parametrize('period', [0.2, 0.4])
def test_announcements_that_flicker_at_rest_do_not_shake_the_joint(period, low):
    """What was announced first counts, until another one lasts."""
    law, time = CompensationLaw([small_model()]), 1e-3 * np.arange(4000)
    currents = drive_along(law, np.zeros(4000), np.where(time % period < 0.5 * period, 1, low))
    np.testing.assert_allclose(np.abs(currents[1500:]), 0.9 * LEVEL, rtol=1e-3)
    assert np.ptp(currents[1500:]) == 0.0
    assert drive_along(law, np.zeros(1000), -1, begin=4000)[-1] == pytest.approx(
        -0.9 * LEVEL, rel=1e-2)
    # Nor does a flicker of one count take the preload.
    flicker = drive_along(law, COUNT * (np.arange(600) // 7 % 2), -1, begin=5000)
    np.testing.assert_allclose(flicker, -0.9 * LEVEL, rtol=2e-2)


@pytest.mark.parametrize('speed', [3e-5, 1e-4])
def test_announcements_that_flicker_do_not_lead_a_joint_that_creeps_to_and_fro(speed):
    """Creep is no way: it ends no rest but for a moment, as in a gear that settles by a count."""
    law, time = CompensationLaw([small_model()]), 1e-3 * np.arange(6000)
    places = np.floor(speed * np.maximum(0.0, time - 0.6) / COUNT) * COUNT
    flickers = np.where((time < 0.6) | (time % 0.5 < 0.25), 1, -1)
    assert drive_along(law, places, flickers)[600:].min() > 0.8 * LEVEL


def test_who_pushes_against_the_preload_is_not_held_by_it():
    """Within a fifth of R, where displacement alone would take off a tenth; led again at rest."""
    law = CompensationLaw([small_model()])
    assert drive_along(law, np.zeros(700))[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)
    pushed = -0.2 * law.parameters['distance'][0]
    current = drive_along(law, np.linspace(0.0, pushed, 100), begin=700)
    assert (np.diff(current) <= 1e-12).all()
    rests = drive_along(law, np.full(500, pushed), begin=800)
    assert rests[70:100].max() <= 0.01 * LEVEL
    assert rests[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)


def slip(law, places, after=150):
    """Let a joint give way under its preload and go on along the places, from the last one.

    The whole preload is there 100 ms after the announcement; here a slip within 125 ms is early.
    """
    drive_along(law, np.zeros(500), direction=0)
    preloading = np.concatenate((np.zeros(after), np.linspace(0.0, 1e-3, 30)))
    drive_along(law, preloading, begin=500)
    assert law.guards['taken back'][0] > 0.05
    return drive_along(law, 1e-3 + np.asarray(places), begin=500 + len(preloading))


@pytest.mark.parametrize('after', [85, 100])
def test_a_drive_that_slips_early_gets_less_and_each_movement_restores_some(after):
    """It lost friction: trust is kept from rest to rest."""
    law = CompensationLaw([small_model()])
    stopped = slip(law, np.zeros(600), after)[-1]
    assert 0.5 * LEVEL < stopped < 1.001 * EARLY * 0.9 * LEVEL
    carried = 1e-3 + np.concatenate((np.linspace(0.0, 0.3, 1000), np.full(800, 0.3)))
    current = drive_along(law, carried, begin=1130 + after)
    assert stopped < current[1000:].max() < stopped + 1.01 * (1.0 - LATER) * 0.9 * LEVEL
    assert law.guards['taken back'][0] > 0.15


def test_what_a_slip_took_is_regained_by_pushing_on_but_not_by_creeping():
    law = CompensationLaw([small_model()])
    assert slip(law, np.zeros(600))[-1] == pytest.approx(LATER * 0.9 * LEVEL, rel=0.02)
    current = drive_along(law, 1e-3 + np.linspace(0.0, 2.4e-4, 1200), begin=1280)
    assert current.max() <= LATER * 0.9 * LEVEL * 1.02
    law, time = CompensationLaw([small_model()]), np.arange(400) * 1e-3
    current = slip(law, 0.03 * time + 0.5 * 0.8 * time ** 2)
    assert current.min() < 1.001 * LATER * 0.9 * LEVEL
    assert current[-1] == pytest.approx(0.9 * LEVEL, rel=0.03)
    assert law.guards['taken back'][0] == 0.0


def stirred(counts):
    """Return the way of a held joint that is stirred by some counts before it breaks loose."""
    way = counts * COUNT * np.clip((np.arange(760) - 500) / 60.0, 0.0, 1.0)
    return np.concatenate((way, way[-1] + np.linspace(0.0, 4e-3, 130)))


THROUGH_BACKLASH = np.interp(np.arange(700), [50, 300], [0.0, 2.5e-3])
PUSHED = np.concatenate((np.zeros(50), np.linspace(0.0, 5e-3, 50)))


@pytest.mark.parametrize(('way', 'changes', 'felt', 'is_slip'), [
    *((stirred(counts), {'uncertainty': 0.01}, False, False) for counts in (6, 12, 20)),
    (THROUGH_BACKLASH, {'presliding': Presliding(3e-4, std=3e-5)}, False, True),
    (THROUGH_BACKLASH, {'presliding': Presliding(3e-4, std=3e-5, backlash=3e-3)}, False, False),
    # Under a push that a sensor feels, a joint has not slipped.
    (PUSHED, {}, False, True), (PUSHED, {}, True, False)])
def test_what_is_a_slip_and_what_is_none(way, changes, felt, is_slip):
    law = CompensationLaw([replace(small_model(), **changes)])
    drive_along(law, np.zeros(500), direction=0)
    drive_along(law, way, 1, begin=500, is_pushed=felt & (np.arange(len(way)) >= 50))
    assert bool(law.guards['taken back'][0]) is is_slip


def test_without_a_direction_a_joint_at_rest_gets_nothing():
    """Whichever way it came, and without breakaway currents with a direction too."""
    for model, direction in ((small_model(), 0), (replace(small_model(), breakaway=None), 1)):
        places = 3e-4 * np.minimum(np.arange(2000), 500)
        assert drive_along(CompensationLaw([model]), places, direction)[-1] == pytest.approx(
            0.0, abs=1e-9)


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


@pytest.mark.parametrize('reported', [0.0, 3.0, math.nan, math.inf])
def test_no_reported_velocity_can_mislead_the_law(reported):
    places = 3e-4 * np.arange(800)
    wrong, none = (drive_along(CompensationLaw([small_model()]), places, 0, velocity=velocity)
                   for velocity in (reported, None))
    np.testing.assert_allclose(wrong, none, atol=1e-3 * LEVEL)


def test_the_share_follows_what_the_model_says_of_its_certainty():
    for unknown, share in ((None, SHARE), (0.0, LARGEST_SHARE), (0.05, 0.9), (0.5, LEAST_SHARE)):
        law = CompensationLaw([replace(small_model(), uncertainty=unknown)])
        assert law.guards['share'] == pytest.approx([share])
        assert drive_along(law, 3e-4 * np.arange(400))[-1] == pytest.approx(share * LEVEL, rel=0.01)


@pytest.mark.parametrize('room', [compensation, simulation])
def test_who_edits_the_law_does_not_run_what_was_compiled_before(room):
    """Numba looks at a function's own file only."""
    folder = Path(room.__file__).parent / '__pycache__'
    folder.mkdir(exist_ok=True)
    old, new = folder / 'old.nbi', folder / 'new.nbi'
    old.touch()
    new.touch()
    os.utime(old, (0.0, 0.0))
    importlib.reload(compensation)
    assert new.exists()
    assert not old.exists()
    new.unlink()


@pytest.mark.parametrize('presliding, known', [
    (Presliding(3e-4, std=3e-5), True), (Presliding(3e-4), False),
    (Presliding(3e-4, std=7e-5), True), (Presliding(9.0 * COUNT, std=COUNT), True),
    (Presliding(9.0 * COUNT), False)])
def test_a_push_that_nobody_announced_is_helped_from_its_first_displacement(presliding, known):
    """The more, the better presliding is known."""
    model = replace(small_model(), presliding=presliding)
    distance = float(law_parameters(model)['distance'][0]) - 2.0 * COUNT
    assert distance == pytest.approx(1.5 * presliding.distance if not known
                                     else presliding.distance + presliding.std)
    # After 0.4 s of rest, the way is gone within 0.06 s.
    way = presliding.distance * np.clip((1e-3 * np.arange(461) - 0.4) / 0.06, 0.0, 1.0)
    helped = drive_along(CompensationLaw([model]), np.floor(way / COUNT) * COUNT, 0)[-1]
    assert helped > (0.5 if known else 0.2) * LEVEL


@pytest.mark.parametrize('known, counts, helped', [
    (Presliding(4.0 * COUNT, std=0.5 * COUNT), 1, 0.9),
    (Presliding(20.0 * COUNT, std=0.5 * COUNT), 1, 0.0), (None, 3, 0.9)])
def test_a_rested_joint_is_helped_from_its_first_counts(known, counts, helped):
    """The first, where presliding is few counts; where nobody knows it, as if it were short."""
    model = replace(small_model(), presliding=known)
    share = drive_along(CompensationLaw([model]), counts * COUNT * (np.arange(450) >= 400), 0)
    assert share[420] / LEVEL == pytest.approx(helped, abs=0.01)
    flickers = COUNT * (np.arange(3000) // 400 % 2)
    assert not drive_along(CompensationLaw([model]), flickers, 0)[1200:].any()


@pytest.mark.parametrize('rate', [0.03, 0.3, 1.3])
def test_motion_that_an_encoder_of_12_bit_shows_is_neither_stops_nor_faster(rate):
    model = replace(small_model(), drive=Drive(0.1, 100.0, 41), sigmoid=Sigmoid(
        LEVEL, -LEVEL, 200.0, viscous=0.2 * LEVEL))
    count = model.drive.position_resolution
    current = drive_along(CompensationLaw([model]), np.floor(
        rate * 1e-3 * np.arange(3000) / count) * count, 0)[1500:]
    assert current.mean() == pytest.approx((SHARE - LATE) * LEVEL * (1.0 + 0.2 * rate), rel=0.02)
    assert current.min() > 0.8 * LEVEL


@pytest.fixture(scope='module')
def bank():
    """A drive of the note and gears of four kinds of friction, without code of the package."""
    return make_bank(world.gear, ('armin_1', *world.gear.FRICTIONS), 1, 0)


def test_a_joint_let_go_never_gains_speed_and_rests(bank):
    for row in release(bank, 'continuous'):
        is_slow = 'rest' in row.floor or 'still' in row.floor
        assert row.value <= (0.1 * row.joints if is_slow else 0), row


def test_an_untouched_joint_stays(bank):
    """Also with a tenth too much; Dahl's friction yields to unknown weights, as to a push."""
    for row in untouched(bank, 'continuous'):
        assert row.value <= (0.2 if 'weight' in row.floor else 0.1) * row.joints, row


def test_most_of_frictions_part_of_the_peak_is_taken_away(bank):
    """And who moves against the announcement starts hardly harder: planners are wrong."""
    removed = {row.floor: row.value for row in peak(bank, 'continuous')}
    assert removed['peak, 1 s ahead'] > 75.0
    assert removed['peak, wrongly announced, 1 s ahead'] > -25.0


@pytest.mark.parametrize('gain', [0.0, 0.25, 0.5, 0.75, 0.9])
@pytest.mark.parametrize('direction', [-1, 1])
def test_announced_at_rest_the_current_is_the_gain_times_breakaway(gain, direction):
    """So that who starts with a small gain, and raises it, is given little at first."""
    for factor in (0.8, 1.0, 1.3):
        base = small_model()
        model = replace(base, breakaway=base.breakaway.times(factor))
        current = drive_along(CompensationLaw([model], breakaway_gain=gain), np.zeros(900),
                              direction)
        assert np.abs(current).max() <= gain * factor * LEVEL + 1e-12
        assert current[-1] == pytest.approx(direction * gain * factor * LEVEL)


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


@pytest.mark.parametrize(('changes', 'start', 'step', 'after', 'least', 'most'), [
    # Within and beyond the end of the range.
    ({'position_limits': (-1.0, 1.0)}, -0.3, 3e-4, 1000, 0.99 * (SHARE - LATE),
     1.01 * (SHARE - LATE)),
    ({'position_limits': (-1.0, 1.0)}, 0.8, 3e-4, 1000, 0.0, 0.0),
    ({'position_limits': (0.2, 0.2)}, 0.0, 3e-4, 1000, 0.0, 0.0),
    # Faster than identified, unless faster motion was recorded.
    ({}, 0.0, 2.7e-3, 1000, 0.0, 0.0),
    ({'recorded': Recorded((0.5, 1.0))}, 0.0, 2.4e-3, 400, 0.0, 0.5),
    ({'recorded': Recorded((0.5, 2.5))}, 0.0, 2.4e-3, 400, 0.891, 0.909)])
def test_nothing_is_fed_forward_beyond_what_is_known(changes, start, step, after, least, most):
    law = CompensationLaw([replace(small_model(), **changes)])
    current = drive_along(law, start + step * np.arange(after))[-1]
    assert least * LEVEL <= current <= most * LEVEL
    if not changes:
        assert law.guards['taken back'][0] > 0.25


def test_a_hurried_movement_costs_no_help_and_a_joint_that_goes_on_and_on_is_trusted_less():
    """At 1.12 of the identified 100 deg/s, 50 degrees to and fro, and as far one way."""
    step, turn = 1.12e-3 * math.radians(100.0), 450
    there = step * np.arange(turn)
    hurry, runaway = CompensationLaw([small_model()]), CompensationLaw([small_model()])
    drive_along(hurry, np.tile(np.concatenate([there, there[::-1]]), 3), direction=0)
    assert hurry.guards['taken back'][0] == 0.0
    drive_along(runaway, step * np.arange(6 * turn), direction=0)
    assert runaway.guards['taken back'][0] == pytest.approx(0.3)


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
    # Equal and older times, by less than a silence may last, change nothing.
    law = CompensationLaw([small_model()])
    current = drive_along(law, 3e-4 * np.arange(500), velocity=0.3)[-1]
    for time in (0.499, 0.45):
        assert law.update(time, [0.15], [0.3], [1])[0] == current


# Beyond the announced end of a movement nothing pushes on.

HELP = SHARE - 0.5 * LATE     # some is withheld of a way that has lasted


class Led:
    """A law whose joint is led along a path."""

    def __init__(self, law='continuous'):
        self.law = CompensationLaw([small_model()], law=law)
        self.place, self.time = 0.0, 0.0

    def to(self, place, direction, end=math.nan, speed=0.2):
        """Go there in a straight line, or rest for half a second; return the last current, A."""
        count = round(abs(place - self.place) / speed * 1e3) or 500
        for where in np.linspace(self.place, place, count + 1)[1:]:
            self.time += 1e-3
            current = self.law.update(self.time, [where], None, [direction], end=[end])[0]
        self.place = place
        return current

    @property
    def beyond(self):
        return bool(self.law.guards['beyond the end'][0])


def test_outside_the_announced_movement_help_is_inwards_only():
    path = Led()
    assert path.to(0.3, 1, 0.5) == pytest.approx(HELP * LEVEL, rel=0.03)
    # As the direction ceases where a movement decelerates, its end remains.
    within = path.to(0.51, 0)
    assert within == pytest.approx(HELP * LEVEL * (1.0 - 0.01 / END_MARGIN), rel=0.03)
    assert path.to(0.5 + 1.1 * END_MARGIN, 0) == 0.0
    assert path.beyond
    assert path.to(0.4, 0) == pytest.approx(-HELP * LEVEL, rel=0.03)
    # A movement without an end has none.
    assert path.to(0.6, 1) == pytest.approx(HELP * LEVEL, rel=0.03)
    assert path.to(0.8, 0) == pytest.approx(HELP * LEVEL, rel=0.03)


def test_who_brakes_gently_to_the_end_keeps_all_help_and_who_runs_to_it_does_not():
    path, endless, brake = Led(), Led(), 0.9 * END_BRAKE
    for left in np.arange(0.45, 0.04, -1e-3):
        place, speed = 1.0 - 0.5 * brake * left**2, brake * left
        assert path.to(place, 1, 1.0, speed) == endless.to(place, 1, speed=speed) > 0.5 * LEVEL
    # At such a speed as far before the place where all help ends, half of it is enough.
    speed = 2.0 * END_BRAKE * 0.4
    path = Led()
    path.to(0.0, 1, 1.0)
    place = 1.0 + END_MARGIN - 0.25 * speed**2 / END_BRAKE
    assert path.to(place, 1, 1.0, speed=speed) == pytest.approx(0.45 * LEVEL, rel=0.05)


def test_the_end_holds_until_another_movement_is_announced_or_the_joint_rests():
    path = Led()
    path.to(0.5, 1, 0.4)
    assert path.beyond
    # Nor does the same announcement count again, at rest or inside.
    assert abs(path.to(0.5, 1, 0.4)) < 1e-3
    path.to(0.3, 1, 0.4)
    assert abs(path.to(0.3, 1, 0.4)) < 1e-3
    assert path.to(0.3, 1, 0.7) == pytest.approx(HELP * LEVEL, rel=0.03)
    assert not path.beyond
    path.to(0.8, 1, 0.7)
    path.to(0.8, 0)
    assert not path.beyond
    assert path.to(0.9, 0) == pytest.approx(HELP * LEVEL, rel=0.03)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_a_joint_let_go_whose_friction_is_lower_than_its_model_stays_near_the_end(side):
    """The model is that of a drive whose friction is 0.70 of what was identified."""
    model = note_model(2)
    identified = replace(model, sigmoid=replace(model.sigmoid, **{
        name: getattr(model.sigmoid, name) / 0.7 for name in ('upper', 'lower', 'viscous')}))
    farthest = {}
    for end in (side * 20.0 * DEGREE, math.nan):
        plant, law = Plant([model], 1), CompensationLaw([identified])
        for k in range(6000):
            state = plant.state
            current = law.update(1e-3 * k, state.position, None, [side], end=[end])
            wish = (side * 0.35e-3 * k, side * 0.35) if k < 800 else (math.nan, math.nan)
            plant.step(current, [wish[0]], [wish[1]], [k < 800])
        farthest[end] = side * plant.state.position[0] / DEGREE
    assert farthest[side * 20.0 * DEGREE] < 25.0
    assert farthest[math.nan] > 40.0


def test_the_laws_without_memory_lose_the_direction_beyond_the_end():
    path = Led('paper')
    start = path.to(0.0, 1, 0.4, 1.0)
    assert start > 0.5 * LEVEL
    path.to(0.5, 1, 0.4)
    assert path.to(0.5, 1, 0.4) == 0.0
    # They know no rest: the movement is over as soon as nothing is announced.
    path.to(0.0, 0)
    assert path.to(0.0, 1, 0.4) == start
