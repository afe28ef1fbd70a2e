# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification with wrong units, broken sensors, loads, slow drives and other faults."""

from collections import deque
from contextlib import suppress
import math
import re

from helpers import note_model
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.identification.run import IdentificationRun
from friction_comp.identification.supervised_run import Supervision
from friction_comp.simulation.joint import Plant

# s; what is decided within milliseconds has twice as many samples
STEP = 4e-3
GOAL = {'speeds': np.radians([20.0, 60.0, 100.0]).tolist(), 'breakaway_cycles': 2,
        'longest_cycle': 3.0, 'ramp_period': 6.0, 'ramp_slope': 0.08, 'motion_range': 0.8}


class Bench:
    """A simulated joint whose sensors, or whose surroundings, may be wrong."""

    def __init__(self, alter=lambda run, sample: sample, torque=lambda run, state: 0.0, seed=3,
                 late=0, step=STEP, drive=None, **goal):
        self.model = note_model()
        self.alter, self.torque = alter, torque
        self.plant = Plant([self.model], seed=seed, sample_time=step)
        self.run = IdentificationRun(
            IdentificationGoal(**{**GOAL, **goal}), drive or self.model.drive)
        self.largest = self.fastest = self.farthest = 0.0
        # Commands that have not yet reached the drive.
        self.waiting = deque([0.0] * late)

    def finish(self, longest=400.0):
        run, state = self.run, self.plant.state
        while not run.finished and state.time < longest:
            self.farthest = max(self.farthest, abs(state.position[0]))
            self.fastest = max(self.fastest, abs(state.velocity[0]))
            command = run.update(*self.alter(run, [
                state.time, state.position[0], state.velocity[0], state.current[0]]))
            self.largest = max(self.largest, abs(command))
            # A torque from outside acts on the joint as a current does, but is not measured.
            push = self.torque(run, state) / self.model.drive.torque_per_current
            self.waiting.append(command)
            state = self.plant.step([self.waiting.popleft() + push])
            state.current[0] -= push
        return run.result()

    def refused(self, words):
        with pytest.raises(IdentificationError, match=words) as caught:
            self.finish()
        assert self.run.phase == 'failed'
        return str(caught.value)


def scaled(factor, place):
    def alter(run, sample):
        sample[place] *= factor
        return sample
    return alter


def shifted(run, sample):
    sample[3] += 0.05
    return sample


def noisy(scale, factor=1.0, smoothing=1.0):
    """The current with noise, behind a filter, and no velocity."""
    random, smooth = np.random.default_rng(5), [0.0]

    def alter(run, sample):
        smooth[0] += smoothing * (sample[3] - smooth[0])
        return [*sample[:2], math.nan, factor * (smooth[0] + scale * random.normal())]
    return alter


def trembling():
    random = np.random.default_rng(7)

    def alter(run, sample):
        sample[1] += 2e-6 * random.normal()
        return sample
    return alter


def low_pass(place, time_constant, step=STEP):
    """A velocity, or a position, behind a low pass."""
    seen = [0.0]

    def alter(run, sample):
        seen[0] -= (sample[place] - seen[0]) * math.expm1(-step / time_constant)
        sample[place] = seen[0]
        if place == 1:
            sample[2] = math.nan
        return sample
    return alter


def late_sensors():
    past = []

    def alter(run, sample):
        past.append(sample[1:3])
        sample[1:3] = past[-2:][0]
        return sample
    return alter


def frozen(phase, delay, velocity):
    """The position as it was when the run had been in a phase for some s."""
    held = {}

    def alter(run, sample):
        if run.phase == phase:
            held.setdefault('since', sample[0])
        if 'since' in held and sample[0] > held['since'] + delay:
            sample[1] = held.setdefault('position', sample[1])
        return sample if velocity else [*sample[:2], math.nan, sample[3]]
    return alter


@pytest.mark.parametrize(('alter', 'late', 'words'), [
    (scaled(0.0, 3), 0, 'not measured'), (scaled(0.0084, 3), 0, 'not measured'),
    (scaled(math.nan, 3), 0, 'not measured'), (scaled(57.3, 2), 0, 'velocity'),
    (scaled(-1.0, 2), 0, 'sign'), (scaled(10.0, 3), 30, 'another unit'),
    (scaled(-1.0, 3), 30, 'wrong sign'), (scaled(0.0, 3), 30, 'not measured')])
def test_wrong_units_and_signs_are_found_before_the_joint_is_driven_far(alter, late, words):
    bench = Bench(alter, late=late)
    bench.refused(words)
    assert bench.largest <= bench.run.goal.ramp_peak


@pytest.mark.parametrize('factor, noise', [
    (0.01, 0.02), (-0.4, 0.02), (3.0, 0.02), (-100.0, 0.02), (10_000.0, 0.02), (-1.0, 0.02),
    (0.4, 0.001), (-3.0, 0.001)])
def test_the_first_push_reveals_any_factor_and_sign_of_effort(factor, noise):
    """Noise is scaled as well; the velocity is not measured at all."""
    bench = Bench(noisy(noise, factor))
    bench.refused('effort')
    assert bench.farthest < math.radians(1.0)
    # Friction takes 0.1 A.
    assert bench.largest < 0.12


@pytest.mark.parametrize(('phase', 'delay', 'velocity'), [
    ('push', 0.0, True), ('velocity', 0.3, True), ('velocity', 0.3, False),
    ('velocity', 8.0, False), ('breakaway', 1.0, True)])
def test_an_encoder_that_freezes_ends_the_run(phase, delay, velocity):
    bench = Bench(frozen(phase, delay, velocity))
    bench.refused('stuck|behind|break free|velocity')
    # The drive's limit is 3 A, and what friction takes is 0.1 A.
    assert bench.largest < 0.7
    assert bench.fastest < 6.0, 'rad/s'


@pytest.mark.parametrize(('slope', 'words', 'largest'), [
    (GOAL['ramp_slope'], 'encoder is stuck', 0.4 * GOAL['ramp_slope'] * GOAL['ramp_period']),
    (None, 'not counted once up to 0.3', 0.1 * 3.0)])
def test_an_encoder_that_never_worked_costs_one_ramp_and_is_named(slope, words, largest):
    """Position and velocity from it: nothing else tells it from a blocked joint."""
    bench = Bench(lambda run, sample: [sample[0], 0.0, 0.0, sample[3]], ramp_slope=slope)
    bench.refused(words)
    assert bench.largest <= largest + 1e-9
    assert bench.fastest < 8.0, 'rad/s, of a joint that nobody sees move'


def stop(run, state):
    beyond = state.position[0] - 0.15
    return -4000.0 * beyond - 40.0 * state.velocity[0] if beyond > 0.0 else 0.0


@pytest.mark.parametrize(('torque', 'words'), [
    (stop, 'blocked|stop|behind|oscillates'),
    (lambda run, state: 0.95 if run.phase == 'breakaway' else 0.0, 'leant|pushed|rest|touched')])
def test_a_stop_or_a_person_in_the_way_ends_the_run(torque, words):
    bench = Bench(torque=torque, step=0.5 * STEP)
    bench.refused(words)
    assert bench.largest < 0.7


@pytest.mark.slow
def test_a_steady_load_is_reported():
    result = Bench(torque=lambda run, state: 0.3).finish()
    assert any('leant' in text for text in result.warnings)


@pytest.mark.parametrize(('changes', 'error'), [
    ({'alter': low_pass(2, 0.06)}, 0.03), ({'alter': late_sensors()}, 0.03),
    ({'alter': low_pass(1, 0.025, 2e-3), 'step': 2e-3}, 0.03), ({'alter': shifted}, 0.5),
    ({'alter': trembling(), 'step': 2e-3, 'drive': Drive(0.119, 100.0, 2 ** 20)}, 0.05),
    ({'alter': noisy(0.02, 1.0, 0.33), 'step': 2e-3, 'seed': 4}, 0.05),
    # The current comes 8 to 24 ms after the command.
    ({'late': 2}, 0.05), ({'late': 6}, 0.05)])
def test_what_is_no_fault_is_tolerated(changes, error):
    """Filters, delays, offsets, a rotor that trembles by many counts, and noise."""
    result = Bench(**changes).finish()
    model = note_model()
    np.testing.assert_allclose(result.currents, model.sigmoid(result.speeds), rtol=error)
    half = 0.5 * (result.currents[-1] - result.currents[0])
    assert half == pytest.approx(float(model.sigmoid(result.speeds[-1])), rel=0.05)
    assert not any('backlash' in warning for warning in result.warnings)
    breakaway = result.breakaway.friction
    assert breakaway == pytest.approx(0.0995, rel=0.1)


def test_a_coarse_encoder_shows_no_speed_in_a_single_count():
    step = math.radians(0.2)
    drive = Drive(11.9, 1.0, round(2.0 * math.pi / step))
    result = Bench(lambda run, sample: [
        sample[0], math.floor(sample[1] / step) * step, math.nan, sample[3]],
        step=2e-3, drive=drive).finish()
    np.testing.assert_allclose(result.currents, note_model().sigmoid(result.speeds), rtol=0.04)


def test_noise_that_hides_the_current_is_said_to_do_so():
    bench = Bench(noisy(1.0), step=1e-3)
    bench.refused('too noisy')
    assert bench.largest <= bench.run.goal.ramp_peak


def test_no_measured_current_changes_what_is_commanded(monkeypatch):
    """Whatever passes the supervision: neither feed-forward nor limits come from it."""
    monkeypatch.setattr(Supervision, 'check', lambda *_: True)
    monkeypatch.setattr(Supervision, 'is_current_confirmed', lambda _: True)
    commands = []
    for factor in (1.0, 1000.0):
        bench, heard = Bench(scaled(factor, 3)), []
        update = bench.run.update
        monkeypatch.setattr(bench.run, 'update', lambda *sample, update=update, heard=heard: (
            heard.append(update(*sample)) or heard[-1]))
        with suppress(IdentificationError):
            bench.finish()
        commands.append(heard)
    assert len(commands[0]) > 5_000
    assert commands[0] == commands[1]


# The comparisons alone, on currents and positions that are made here.

def supervised(acceleration=math.nan):
    supervision = Supervision(note_model().drive, IdentificationGoal(**GOAL).ramp_peak)
    supervision.friction, supervision.acceleration = (0.5, -0.5), acceleration
    return supervision


def look_at_rattle(mean):
    """Command a current that rattles about a mean, of which the amplifier gives two fifths."""
    supervision = supervised()
    rattle = 0.4 * np.sign(np.sin(2.0 * math.pi * (np.arange(3000) + 0.5) / 6.0))
    for k, command in enumerate(rattle + mean):
        supervision.check(1e-3 * k, 0.0, None, (command, 0.4 * command))


def test_a_controller_that_rattles_is_no_wrong_unit():
    """As on a rotor that is much lighter than its link, until the run tries lower gains."""
    look_at_rattle(0.008)
    with pytest.raises(IdentificationError, match='another unit'):
        look_at_rattle(0.2)


def brake(speeds):
    """Check a joint that four times its breakaway current brakes from 0.1 s on."""
    supervision = supervised(4.0)
    for k, position in enumerate(np.cumsum(speeds) * 1e-3):
        supervision.check(1e-3 * k, position, None, (0.6 if k < 100 else -2.0, math.nan))


def test_a_rotor_that_its_link_pushes_on_through_backlash_is_not_blocked():
    """For 15 ms a braked rotor keeps its speed; one that never slows down is a fault."""
    brake(np.concatenate((np.full(115, 0.6), np.linspace(0.6, -0.4, 100))))
    for speed in (0.0, 0.6):
        with pytest.raises(IdentificationError, match='does not move'):
            brake(np.full(400, speed))


def test_a_joint_that_swings_is_not_blocked_but_oscillates():
    supervision = supervised(4.0)
    for k in range(400):
        angle = 2.0 * math.pi * 10.0 * 1e-3 * k
        command = -2.0 * math.copysign(1.0, math.sin(angle - 1.2))
        supervision.check(1e-3 * k, 0.002 * math.sin(angle), None, (command, math.nan))
    assert supervision.oscillates()
    supervision.forget_oscillation()
    assert not supervision.oscillates()


RAMP = np.linspace(0.0, 0.2, 2000)
LIMITED = [np.concatenate((np.linspace(0.0, 0.3, 1000), np.linspace(0.3, 1.5, rise),
                           np.full(2000, 1.5))) for rise in (2000, 1)]


@pytest.mark.parametrize(('currents', 'response', 'words', 'not_said'), [
    (LIMITED[0], lambda i: min(i, 0.4), 'stays at 0.4.* limits its current', 'unit'),
    (LIMITED[1], lambda i: min(i, 0.4), 'late.* Or .* limits its', 'unit'),
    (RAMP, lambda i: max(i - 0.3, 0.0), 'dead band', 'sign'),
    (RAMP, lambda i: max(i - 0.02, 0.0), 'dead band', 'sign')])
def test_a_limit_or_a_dead_band_of_a_drive_is_no_wrong_unit(currents, response, words, not_said):
    supervision, random = supervised(), np.random.default_rng(8)
    supervision.least = 0.002

    def command_all():
        for k, current in enumerate(currents):
            measured = response(current) + 1e-3 * random.normal()
            supervision.check(1e-3 * k, 0.0, None, (current, measured))
            if k == 900:
                supervision.is_current_confirmed()
    with pytest.raises(IdentificationError, match=words) as caught:
        command_all()
    assert not_said not in str(caught.value)


def test_a_joint_that_leaves_its_range_is_told_from_one_that_is_pushed():
    for aim, words in ((0.4, 'rad from its reference.*elastic'), (math.nan, 'a person')):
        supervision = supervised()
        supervision.bounds, supervision.aim = (-0.5, 0.5), aim
        supervision.check(0.0, 0.0, None, (0.0, 0.0))
        with pytest.raises(IdentificationError, match=words):
            supervision.check(0.01, 0.6, None, (0.0, 0.0))


def test_joint_states_that_come_too_seldom_are_refused_with_the_rate_it_takes():
    Bench(lambda run, sample: [2.0 * sample[0], sample[1], math.nan, sample[3]], step=0.01).refused(
        '50 times per second; .* takes 100')


@pytest.mark.parametrize('samples', [10, 15, 62])
def test_a_drive_that_answers_late_is_not_told_to_have_another_unit(samples):
    bench = Bench(late=samples)
    said = float(re.search(r'one (\S+) s late', bench.refused('right size'))[1])
    assert said == pytest.approx(STEP * samples, rel=0.1, abs=0.005)
    assert bench.largest < 0.4
