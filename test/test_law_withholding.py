# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Where the continuous law withholds, leads and restores compensation on prescribed motion."""

from dataclasses import replace
import importlib
import math

from helpers import drive_along
import law_ablation
import numpy as np
import pytest

from friction_comp.compensation.law import CompensationLaw, law_parameters
from friction_comp.compensation.law_parameters import EARLY, LEAST_CHANGING, LOWERED, START_TIME
from friction_comp.drive import Drive
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid
from simulated_recordings.small_model import LEVEL, small_model

DEGREE = math.pi / 180.0


def drive_at(law, speeds):
    """Return the currents at speeds in rad/s, a sample each."""
    return drive_along(law, np.cumsum(speeds) * 1e-3, direction=0)


def test_a_joint_that_gains_speed_after_its_start_gets_less_until_it_is_slower_again():
    """Who starts a movement may speed up, and one that keeps its speed loses nothing."""
    law, time = CompensationLaw([small_model()]), np.arange(6000) * 1e-3
    speeds = np.interp(time, [0.0, START_TIME - 0.2, 1.5, 1.8, 2.6, 2.8],
                       [0.1, 0.3, 0.3, 0.33, 0.33, 0.28])
    current, risen = drive_at(law, speeds), 500
    np.testing.assert_allclose(current[risen:1490], 0.9 * LEVEL, rtol=5e-3)
    np.testing.assert_allclose(current[2400:2600], LEAST_CHANGING * 0.9 * LEVEL, rtol=1e-3)
    np.testing.assert_allclose(current[5700:], 0.9 * LEVEL, rtol=1e-3)
    assert law.guards['withheld'][0] < 1e-3


def test_a_joint_that_loses_speed_gets_less_for_as_long_as_it_does():
    """Else the tenth of friction that is left to the gear needs many seconds to stop a rotor."""
    law, time = CompensationLaw([small_model()]), np.arange(6000) * 1e-3
    current = drive_at(law, np.interp(time, [1.0, 3.0], [0.6, 0.2]))
    risen = 500
    np.testing.assert_allclose(current[risen:990], 0.9 * LEVEL, rtol=5e-3)
    np.testing.assert_allclose(current[2000:3000], LEAST_CHANGING * 0.9 * LEVEL, rtol=1e-3)
    np.testing.assert_allclose(current[5700:], 0.9 * LEVEL, rtol=5e-3)


def test_a_stop_too_short_for_a_rest_is_no_new_start():
    """Else a joint that the law drives would gain speed anew after each of them."""
    time = np.arange(3000) * 1e-3
    for pause, share in ((0.05, LEAST_CHANGING), (0.4, 1.0)):
        speeds = np.interp(time, [1.0, 1.1, 1.1 + pause, 1.2 + pause], [0.3, 0.0, 0.0, 0.3])
        current = drive_at(CompensationLaw([small_model()]), speeds)
        again = round(1000 * (1.2 + pause))
        np.testing.assert_allclose(
            current[again + 350:again + 450], share * 0.9 * LEVEL, rtol=6e-3)


def test_a_joint_that_turns_round_starts_anew():
    law = CompensationLaw([small_model()])
    current = drive_at(law, np.repeat([0.1, -0.3], 1000))
    np.testing.assert_allclose(current[1600:], -0.9 * LEVEL, rtol=1e-3)


def test_without_a_direction_a_joint_at_rest_gets_nothing():
    """Whichever way it came, and without breakaway currents with a direction too."""
    for model, direction in ((small_model(), 0), (replace(small_model(), breakaway=None), 1)):
        places = 3e-4 * np.minimum(np.arange(2000), 500)
        assert drive_along(CompensationLaw([model]), places, direction)[-1] == pytest.approx(
            0.0, abs=1e-9)


def test_a_joint_that_springs_back_while_its_help_decays_is_not_pushed_on():
    """Else a gear that yields farther than its model knows would swing to and fro for ever."""
    law = CompensationLaw([replace(small_model(), presliding=Presliding(3e-4, std=3e-5))])
    distance = law.parameters['distance'][0]
    slid = drive_along(law, 1e-4 * np.arange(1000), direction=0)
    assert slid[-1] == pytest.approx(0.9 * LEVEL, rel=1e-2)
    back = 0.0999 - 0.9 * distance * np.interp(np.arange(400), [200, 240], [0.0, 1.0])
    assert drive_along(law, back, direction=0, begin=1000).min() >= 0.0
    push = back[-1] - 0.9 * distance * np.interp(np.arange(400), [200, 240], [0.0, 1.0])
    assert drive_along(law, push, direction=0, begin=1400)[300] < -0.5 * LEVEL


@pytest.mark.parametrize('hand', [False, True])
def test_a_turn_is_where_the_joint_is_pushed_back_and_not_where_it_springs_back(hand):
    """Presliding is unknown: 1.3 R is what a compliant gear may spring back.

    Who pushes breaks friction first: the joint hardly moves, and then gains speed.
    """
    law = CompensationLaw([replace(small_model(), presliding=None)])
    time = 1e-3 * np.arange(1000)
    distance = law.parameters['distance'][0]
    to = 0.1 * np.cumsum(np.interp(time[:700], [0.0, 0.5, 0.7], [3e-3, 3e-3, 0.0]))
    assert drive_along(law, to, direction=0)[500] == pytest.approx(0.9 * LEVEL, rel=1e-2)
    if hand:
        back = 2e-4 * np.clip(time / 0.05, 0.0, 1.0) + 0.5 * np.maximum(0.0, time - 0.05)**2
        back = back[back < 0.9 * distance]
    else:
        back = 0.65 * distance * (1.0 - np.cos(math.pi * np.clip(time[:100] / 0.04, 0.0, 1.0)))
    current = drive_along(law, to[-1] - back, direction=0, begin=700)
    if hand:
        assert current[-1] < -0.3 * LEVEL
    else:
        assert current.min() >= 0.0


def test_help_that_is_withdrawn_is_no_push():
    """A gear springs back once more while help decays at a joint at rest, which is no turn."""
    law = CompensationLaw([replace(small_model(), presliding=None)])
    time = 1e-3 * np.arange(400)
    distance = law.parameters['distance'][0]
    slid = drive_along(law, 1e-4 * np.arange(1000), direction=0)
    assert slid[-1] == pytest.approx(0.9 * LEVEL, rel=1e-2)
    # From its first rebound it goes on where z decays from 0.15 s of rest on.
    back = distance * (0.3 * np.clip(time / 0.01, 0.0, 1.0)
                       + 0.5 * np.clip((time - 0.17) / 0.05, 0.0, 1.0)**2)
    assert drive_along(law, slid.size * 1e-4 - 1e-4 - back, direction=0, begin=1000).min() >= 0.0


def test_help_is_given_back_once_a_way_and_a_turn_is_where_the_joint_has_gone_back():
    """Else a heavy joint that a stiff hand leads stops and goes for the whole of its way."""
    law, time = CompensationLaw([small_model()]), 1e-3 * np.arange(4000)
    slows = np.interp(time, [0.0, 0.2, 1.0, 1.1, 1.15, 1.3], [0.0, 0.3, 0.3, 0.01, 0.01, 0.3])
    once = drive_along(law, 1e-3 * np.cumsum(slows[:2000]), direction=0)
    assert once[1140] < 0.7 * LEVEL
    end = 1e-3 * slows[:2000].sum()
    slows = np.interp(time, [0.0, 0.1, 0.15, 0.3], [0.3, 0.01, 0.01, 0.3])
    twice = drive_along(law, end + 1e-3 * np.cumsum(slows[:1000]), direction=0, begin=2000)
    assert twice[50:].min() > 0.8 * LEVEL
    # After a turn, a new way.
    back = end + 1e-3 * slows[:1000].sum() - 1e-3 * np.cumsum(np.full(1000, 0.3))
    assert drive_along(law, back, direction=0, begin=3000)[-1] == pytest.approx(
        -0.9 * LEVEL, rel=1e-2)
    stop = back[-1] - 1e-3 * np.cumsum(np.interp(time[:150], [0.0, 0.1], [0.3, 0.01]))
    assert abs(drive_along(law, stop, direction=0, begin=4000)[-1]) < 0.7 * LEVEL


def test_a_joint_at_rest_has_its_preload_within_a_sixth_of_a_second():
    """So that an announcement that comes with the push is of use."""
    law = CompensationLaw([small_model()])
    drive_along(law, np.zeros(500), direction=0)
    current = drive_along(law, np.zeros(170), begin=500)
    assert current[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)


def test_a_joint_that_moves_against_the_announcement_keeps_its_help_until_it_stops():
    """As in the note, where friction in motion is compensated whatever is announced."""
    law = CompensationLaw([small_model()])
    forward = np.arange(2000) * 2e-4
    assert drive_along(law, forward[:1000])[-1] == pytest.approx(0.9 * LEVEL, rel=1e-2)
    against = drive_along(law, forward[1000:], direction=-1, begin=1000)
    np.testing.assert_allclose(against, 0.9 * LEVEL, rtol=1e-2)
    stopped = drive_along(law, np.full(250, forward[-1]), direction=-1, begin=2000)
    assert stopped[-1] == pytest.approx(-0.9 * LEVEL, rel=1e-2)


def test_slow_motion_against_the_announcement_is_no_stop():
    """Half a degree a second keeps its help all along."""
    law = CompensationLaw([small_model()])
    forward = np.arange(12000) * 5e-6
    drive_along(law, forward[:500])
    against = drive_along(law, forward[500:], direction=-1, begin=500)
    np.testing.assert_allclose(against, 0.89 * LEVEL, rtol=1e-2)


def test_who_pushes_against_the_preload_is_not_held_by_it():
    """Within a fifth of R, where displacement alone would take off a tenth; led again at rest."""
    law = CompensationLaw([small_model()])
    assert drive_along(law, np.zeros(700))[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)
    pushed = -0.2 * law_parameters(small_model())['distance'][0]
    current = drive_along(law, np.linspace(0.0, pushed, 100), begin=700)
    assert (np.diff(current) <= 1e-12).all()
    rests = drive_along(law, np.full(400, pushed), begin=800)
    assert rests[70:100].max() <= 0.0
    assert rests[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)


def test_a_preload_that_a_movement_left_is_held_wherever_an_earlier_one_was():
    """Led and held at 0, moved back by 8 R, and on by 4 R in the announced direction."""
    law, distance = CompensationLaw([small_model()]), law_parameters(small_model())['distance'][0]
    drive_along(law, np.zeros(700))
    places = distance * np.interp(np.arange(1501), [0, 1000, 1500], [0.0, -8.0, -4.0])
    drive_along(law, places, begin=700)
    rests = drive_along(law, np.full(600, places[-1]), begin=2201)
    np.testing.assert_allclose(rests, 0.9 * LEVEL, rtol=2e-2)


def test_a_flicker_of_one_count_does_not_take_the_preload():
    law, count = CompensationLaw([small_model()]), law_parameters(small_model())['resolution'][0]
    drive_along(law, np.zeros(700))
    flicker = drive_along(law, -count * (np.arange(600) // 7 % 2), begin=700)
    np.testing.assert_allclose(flicker, 0.9 * LEVEL, rtol=2e-2)


@pytest.mark.parametrize('low', [-1, 0])
@pytest.mark.parametrize('period', [0.2, 0.4])
def test_announcements_that_flicker_at_rest_do_not_shake_the_joint(period, low):
    """What was announced first counts, until another one lasts."""
    law, time = CompensationLaw([small_model()]), 1e-3 * np.arange(4000)
    currents = drive_along(law, np.zeros(4000), np.where(time % period < 0.5 * period, 1, low))
    np.testing.assert_allclose(currents[1500:], 0.9 * LEVEL, rtol=1e-3)
    assert drive_along(law, np.zeros(1000), -1, begin=4000)[-1] == pytest.approx(
        -0.9 * LEVEL, rel=1e-2)


def slip(law, places, after=150):
    """Let a joint give way under its preload and go on along the places, from the last one.

    The whole preload is there 100 ms after the announcement; here a slip within 125 ms is early.
    """
    drive_along(law, np.zeros(500), direction=0)
    preloading = np.concatenate((np.zeros(after), np.linspace(0.0, 1e-3, 30)))
    drive_along(law, preloading, begin=500)
    assert law.guards['slips'][0] == 1
    return drive_along(law, 1e-3 + np.asarray(places), begin=500 + len(preloading))


def test_preload_lost_by_a_slip_is_not_regained_by_creeping():
    """It slips, stops farther on, and creeps by half of what the operator needs to turn over."""
    law = CompensationLaw([small_model()])
    rest = np.zeros(600)
    assert slip(law, rest)[-1] == pytest.approx(LOWERED ** 2 * 0.9 * LEVEL, rel=0.02)
    creep = 1e-3 + np.linspace(0.0, 2.4e-4, 1200)
    current = drive_along(law, creep, begin=1280)
    assert current.max() <= LOWERED ** 2 * 0.9 * LEVEL * 1.02


def test_a_joint_that_creeps_from_rest_to_rest_under_its_preload_slips():
    law = CompensationLaw([small_model()])
    distance = law_parameters(small_model())['slip'][0]
    places = np.interp(np.arange(5000), [1000, 1050, 2000, 2050, 3000, 3050],
                       distance * np.array([0.0, 0.7, 0.7, 1.4, 1.4, 2.1]))
    current = drive_along(law, places)
    assert law.guards['slips'][0] == 1
    assert current[-1] == pytest.approx(LOWERED * current[1900], rel=1e-6)


@pytest.mark.parametrize('backlash', [None, 3e-3])
def test_a_motor_that_moves_through_known_backlash_has_not_slipped(backlash):
    model = replace(small_model(), presliding=Presliding(3e-4, std=3e-5, backlash=backlash))
    law = CompensationLaw([model])
    drive_along(law, np.zeros(500), direction=0)
    current = drive_along(law, np.interp(np.arange(700), [50, 300], [0.0, 2.5e-3]), begin=500)
    slipped = backlash is None
    assert bool(law.guards['slips'][0]) is slipped
    assert bool(current[-1] < 0.9 * 0.9 * LEVEL) is slipped
    if not slipped:
        assert current[-1] == pytest.approx(0.9 * LEVEL, rel=1e-3)


def test_a_person_who_keeps_pushing_regains_the_preload_lost_by_a_slip():
    law = CompensationLaw([small_model()])
    time = np.arange(250) * 1e-3
    current = slip(law, 0.03 * time + 0.5 * 0.8 * time ** 2)
    assert current.min() == pytest.approx(LOWERED * 0.9 * LEVEL, rel=1e-3)
    assert current[-1] == pytest.approx(0.9 * LEVEL, rel=0.02)


@pytest.mark.parametrize('after', [85, 100])
def test_a_drive_that_slips_early_gets_less_from_then_on(after):
    """It lost friction: later rests and movements get less, and each movement restores some."""
    law = CompensationLaw([small_model()])
    stopped = slip(law, np.zeros(600), after)[-1]
    assert 0.5 * LEVEL < stopped < 1.001 * EARLY * 0.9 * LEVEL
    carried = 1e-3 + np.concatenate((np.linspace(0.0, 0.3, 1000), np.full(800, 0.3)))
    current = drive_along(law, carried, begin=1130 + after)
    assert stopped < current[1000:].max() < stopped + 1.01 * (1.0 - LOWERED) * 0.9 * LEVEL
    assert law.guards['taken back'][0] > 0.15


def test_pushing_before_the_preload_is_reached_costs_little_of_it():
    law = CompensationLaw([small_model()])
    time = np.arange(400) * 1e-3
    current = slip(law, 0.03 * time + 0.5 * 0.8 * time ** 2, after=85)
    assert current.min() < EARLY * 0.9 * LEVEL
    assert current[-1] == pytest.approx(0.9 * LEVEL, rel=0.02)
    assert law.guards['taken back'][0] == 0.0


@pytest.mark.parametrize('then', ['pushed', 'slower', 'faster'])
def test_a_slip_under_a_push_that_is_felt_tells_nothing_until_nobody_pushes(then):
    """Who gains speed although nobody pushes has less friction than is fed forward."""
    law, time = CompensationLaw([small_model()]), np.arange(500) * 1e-3
    drive_along(law, np.zeros(500), direction=0)
    speed = np.interp(time, [0.05, 0.1, 0.25, 0.5],
                      [0.0, 0.3, 0.3, 0.25 if then == 'slower' else 0.36])
    felt = (time < 0.25) | (then == 'pushed')
    current = drive_along(law, np.cumsum(speed) * 1e-3, begin=500, is_pushed=felt)
    assert law.guards['slips'][0] == (then == 'faster')
    assert current[240] > 0.85 * LEVEL
    lost = 1.0 - EARLY if then == 'faster' else 0.0
    assert law.guards['taken back'][0] == pytest.approx(lost, abs=1e-6)


@pytest.mark.parametrize('felt', [1, -1, 0])
def test_a_push_counts_for_the_direction_that_is_acted_on_alone(felt):
    """Another announcement counts at rest when it has lasted; the joint still slips in the first.
    """
    law = CompensationLaw([small_model()])
    drive_along(law, np.zeros(500), direction=0)
    drive_along(law, np.zeros(50), begin=500)
    drive_along(law, np.linspace(0.0, 5e-3, 50), felt, begin=550, is_pushed=True)
    assert law.guards['slips'][0] == (felt != 1)


def test_a_joint_that_was_too_fast_gets_less_after_it_has_slowed_down():
    """Otherwise a drive that lost friction would hum along at the identified speeds."""
    law, time = CompensationLaw([small_model()]), np.arange(4000) * 1e-3
    current = drive_at(law, np.interp(time, [0.0, 0.5, 1.2, 1.5], [0.1, 2.2, 2.2, 1.0]))
    assert np.all(current[1600:] <= 0.6 * 0.9 * LEVEL)


def test_a_brisk_movement_that_is_a_little_too_fast_for_a_moment_keeps_its_help():
    """At 102 deg/s at most, where 100 are identified, for 50 ms."""
    law, time = CompensationLaw([small_model()]), np.arange(2000) * 1e-3
    speed = np.interp(time, [0.0, 0.5, 0.525, 0.55, 0.9], [6.0, 100.0, 102.0, 100.0, 60.0])
    current = drive_at(law, speed * DEGREE)
    assert np.all(current[1000:] >= 0.8 * 0.9 * LEVEL)


@pytest.mark.parametrize('knock', [0.05, -0.05])
@pytest.mark.parametrize('factor', [1.0, 1.1])
def test_a_joint_with_its_preload_does_not_ring_on_after_a_knock(factor, knock):
    """Presliding of nine counts, and sliding friction above breakaway friction."""
    count = 2.0 * math.pi / 25_000
    drive = Drive(0.1, 100.0, 250)
    model = FrictionModel(
        drive=drive, sigmoid=Sigmoid(factor * LEVEL, -factor * LEVEL, 200.0, viscous=0.3 * factor),
        breakaway=Breakaway(0.85 * factor * LEVEL, -0.85 * factor * LEVEL),
        presliding=Presliding(9.5 * count))
    law, step = CompensationLaw([model]), 1e-4
    shares, distances = (0.4, 0.35, 0.25), (2.85 * count, 5.7 * count, 9.5 * count)
    position = speed = current = 0.0
    elements, speeds = [0.0, 0.0, 0.0], []
    for k in range(3000):
        speed += knock * (k == 800)
        late, current = current, law.update(
            1e-3 * k, [round(position / count) * count], None, [1])[0]
        for _ in range(10):
            position += speed * step
            elements = [min(1.0, max(-1.0, z + speed * step / r))
                        for z, r in zip(elements, distances)]
            level = LEVEL * (1.0 - 0.15 * math.exp(-(speed / 0.03) ** 2))
            friction = level * sum(w * z for w, z in zip(shares, elements)) + 0.3 * speed
            speed += 70.0 * (late - friction) * step
        speeds.append(speed)
    assert np.std(speeds[2500:]) < 0.05 * DEGREE


def test_every_rule_that_the_ablation_switches_off_is_one_of_the_law():
    for rule, constants in law_ablation.RULES.items():
        for path in constants:
            module, _, name = path.rpartition('.')
            assert hasattr(importlib.import_module(module), name), rule
