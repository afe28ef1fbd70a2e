# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification with wrong units, broken sensors, loads and other faults."""

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
from friction_comp.identification.supervision import Supervision
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared

# s; what is decided within milliseconds has twice as many samples
STEP = 4e-3
GOAL = {'speeds': np.radians([20.0, 60.0, 100.0]).tolist(), 'breakaway_cycles': 2,
        'longest_cycle': 3.0, 'ramp_period': 6.0, 'ramp_slope': 0.08, 'motion_range': 0.8}


class Bench:
    """A simulated joint whose sensors, or whose surroundings, may be wrong."""

    def __init__(self, alter=lambda run, sample: sample, torque=lambda run, state: 0.0, seed=3,
                 late=0, step=STEP):
        self.model = note_model()
        self.alter, self.torque = alter, torque
        load = Undeclared.from_dict({
            'format': 'friction_comp_undeclared', 'version': 1,
            'effects': [{'name': 'gravity', 'parameters': {'amplitude': 0.0, 'phase': 0.0}}]})
        self.plant = Plant([self.model], seed=seed, sample_time=step, undeclared=[load])
        self.run = IdentificationRun(IdentificationGoal(**GOAL), self.model.drive)
        self.largest = self.fastest = 0.0
        # Commands that have not yet reached the drive.
        self.waiting = deque([0.0] * late)

    def finish(self, longest=400.0):
        run, state = self.run, self.plant.state
        while not run.finished and state.time < longest:
            sample = self.alter(run, [
                state.time, state.position[0], state.velocity[0], state.current[0]])
            command = run.update(*sample)
            self.largest = max(self.largest, abs(command))
            self.fastest = max(self.fastest, abs(state.velocity[0]))
            # A torque from outside acts on the joint as a current does, but is not measured.
            push = self.torque(run, state) / self.model.drive.torque_per_current
            self.waiting.append(command)
            state = self.plant.step([self.waiting.popleft() + push])
            state.current[0] -= push
        return run.result()


def scaled(factor, place):
    def alter(run, sample):
        sample[place] *= factor
        return sample
    return alter


def frozen(after):
    """The position as it was when the run entered a phase for some s."""
    held = {}

    def alter(run, sample):
        if run.phase == after[0]:
            held.setdefault('since', sample[0])
        if 'since' in held and sample[0] > held['since'] + after[1]:
            sample[1] = held.setdefault('position', sample[1])
        return sample
    return alter


@pytest.mark.parametrize(('alter', 'words'), [
    (scaled(0.0, 3), 'not measured'), (scaled(0.0084, 3), 'not measured'),
    (scaled(math.nan, 3), 'not measured'),
    (scaled(57.3, 2), 'velocity'), (scaled(-1.0, 2), 'sign')])
def test_wrong_units_and_signs_are_found_before_the_joint_is_driven_far(alter, words):
    bench = Bench(alter)
    with pytest.raises(IdentificationError, match=words):
        bench.finish()
    assert bench.largest <= bench.run.goal.ramp_peak
    with pytest.raises(IdentificationError):
        bench.run.result()


@pytest.mark.parametrize(('phase', 'delay', 'velocity'), [
    ('push', 0.0, True), ('velocity', 0.3, True), ('velocity', 0.3, False),
    ('velocity', 8.0, False), ('breakaway', 1.0, True)])
def test_an_encoder_that_freezes_ends_the_run(phase, delay, velocity):
    freeze = frozen((phase, delay))

    def alter(run, sample):
        sample = freeze(run, sample)
        if not velocity:
            sample[2] = math.nan
        return sample
    bench = Bench(alter)
    with pytest.raises(IdentificationError, match=r'stuck|behind|break free|velocity'):
        bench.finish()
    # The drive's limit is 3 A, and what friction takes is 0.1 A.
    assert bench.largest < 0.7
    assert bench.fastest < 6.0, 'rad/s'


def test_an_encoder_that_never_worked_costs_one_ramp_and_is_named():
    """Position and velocity from it: nothing else tells it from a blocked joint."""
    def alter(run, sample):
        return [sample[0], 0.0, 0.0, sample[3]]
    bench = Bench(alter)
    with pytest.raises(IdentificationError, match='encoder is stuck'):
        bench.finish()
    assert bench.largest <= 0.4 * GOAL['ramp_slope'] * GOAL['ramp_period'] + 1e-9
    assert bench.fastest < 2.5, 'rad/s, of a joint that nobody sees move'


def test_a_stop_in_the_way_ends_the_run():
    def torque(run, state):
        beyond = state.position[0] - 0.15
        return -4000.0 * beyond - 40.0 * state.velocity[0] if beyond > 0.0 else 0.0
    bench = Bench(torque=torque)
    with pytest.raises(IdentificationError, match=r'blocked|stop|behind|oscillates'):
        bench.finish()
    assert bench.largest < 0.7


@pytest.mark.slow
def test_a_steady_load_is_reported():
    result = Bench(torque=lambda run, state: 0.3).finish()
    assert any('leant' in text for text in result.warnings)


def test_somebody_who_leans_on_the_joint_for_a_part_of_the_run_ends_it():
    bench = Bench(torque=lambda run, state: 0.95 if run.phase == 'breakaway' else 0.0,
                  step=0.5 * STEP)
    with pytest.raises(IdentificationError, match=r'leant|pushed|rest|touched'):
        bench.finish()


def filtered(time_constant):
    """The velocity behind a low pass, as many drives give it."""
    seen = [0.0]

    def alter(run, sample):
        seen[0] += (sample[2] - seen[0]) * STEP / time_constant
        sample[2] = seen[0]
        return sample
    return alter


def late(samples):
    """Position and velocity as they were some samples before."""
    past = []

    def alter(run, sample):
        past.append(sample[1:3])
        sample[1:3] = past[max(0, len(past) - 1 - samples)]
        return sample
    return alter


def trembling(way):
    """A position that trembles at random, seen by an encoder of finest counts."""
    random = np.random.default_rng(7)

    def alter(run, sample):
        sample[1] += way * random.normal()
        return sample
    return alter


@pytest.mark.parametrize('alter', [filtered(0.06), late(1)])
def test_a_filtered_velocity_and_a_delay_are_no_faults(alter):
    result = Bench(alter).finish()
    truth = note_model().sigmoid(result.speeds)
    np.testing.assert_allclose(result.currents, truth, rtol=0.03)


def test_a_rotor_that_trembles_by_many_counts_is_at_rest():
    bench = Bench(trembling(2e-6), step=0.5 * STEP)
    drive = Drive(bench.model.drive.torque_constant, bench.model.drive.gear_ratio, 2 ** 20,
                  bench.model.drive.current_limit)
    bench.run = IdentificationRun(IdentificationGoal(**GOAL), drive)
    assert drive.position_resolution < 1e-7
    result = bench.finish()
    assert result.breakaway.positive_mean == pytest.approx(0.0995, rel=0.1)


@pytest.mark.parametrize('factor, noise', [
    (0.01, 0.02), (-0.4, 0.02), (3.0, 0.02), (-100.0, 0.02), (10_000.0, 0.02), (-1.0, 0.02),
    (0.4, 0.001), (-3.0, 0.001)])
def test_the_first_push_reveals_any_factor_and_sign_of_effort(factor, noise):
    """Noise is scaled as well; the velocity may not be measured at all."""
    random, farthest = np.random.default_rng(5), [0.0]

    def alter(run, sample):
        farthest[0] = max(farthest[0], abs(sample[1]))
        return [sample[0], sample[1], math.nan, factor * (sample[3] + noise * random.normal())]
    bench = Bench(alter)
    with pytest.raises(IdentificationError, match=r'effort'):
        bench.finish()
    assert farthest[0] < math.radians(1.0)
    assert bench.run.phase == 'failed'
    # Friction takes 0.1 A.
    assert bench.largest < 0.12


def test_a_sensor_whose_zero_is_off_is_no_wrong_unit():
    def alter(run, sample):
        sample[3] += 0.05
        return sample
    result = Bench(alter).finish()
    half = 0.5 * (result.currents[-1] - result.currents[0])
    assert half == pytest.approx(float(note_model().sigmoid(result.speeds[-1])), rel=0.03)


def test_noise_of_the_current_is_not_taken_for_backlash():
    """A fifth of breakaway, on a current that is filtered over 5 ms."""
    random, smooth = np.random.default_rng(4), [0.0]

    def alter(run, sample):
        smooth[0] += (1.0 - math.exp(-2e-3 / 5e-3)) * (sample[3] - smooth[0])
        sample[3] = smooth[0] + 0.02 * random.normal()
        return sample
    result = Bench(alter, seed=4, step=2e-3).finish()
    assert not any('backlash' in warning for warning in result.warnings)
    assert result.breakaway.positive_mean == pytest.approx(0.0995, rel=0.1)


def test_noise_that_hides_the_current_is_said_to_do_so():
    random = np.random.default_rng(5)

    def alter(run, sample):
        sample[3] += 1.0 * random.normal()
        return sample
    bench = Bench(alter, step=1e-3)
    with pytest.raises(IdentificationError, match='too noisy'):
        bench.finish()
    assert bench.largest <= bench.run.goal.ramp_peak


def test_no_measured_current_changes_what_is_commanded(monkeypatch):
    """Whatever passes the supervision: neither feed-forward nor limits come from it."""
    monkeypatch.setattr(Supervision, 'check', lambda *_: True)
    monkeypatch.setattr(Supervision, 'is_current_confirmed', lambda _: True)
    commands = []
    for factor in (1.0, 1000.0):
        bench = Bench(scaled(factor, 3))
        update, heard = bench.run.update, []
        monkeypatch.setattr(bench.run, 'update', lambda *sample, update=update, heard=heard: (
            heard.append(update(*sample)) or heard[-1]))
        with suppress(IdentificationError):
            bench.finish()
        commands.append(heard)
    assert len(commands[0]) > 5_000
    assert commands[0] == commands[1]


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


def brake(speeds):
    """Check a joint that four times its breakaway current brakes from 0.1 s on."""
    supervision = supervised(4.0)
    for k, position in enumerate(np.cumsum(speeds) * 1e-3):
        supervision.check(
            1e-3 * k, position, None, (0.6 if k < 100 else -2.0, math.nan))


def test_a_rotor_that_its_link_pushes_on_through_backlash_is_not_blocked():
    """For 15 ms a braked rotor keeps its speed; one that never slows down is a fault."""
    brake(np.concatenate((np.full(115, 0.6), np.linspace(0.6, -0.4, 100))))
    for speed in (0.0, 0.6):
        with pytest.raises(IdentificationError, match='does not move'):
            brake(np.full(400, speed))


def test_a_controller_that_rattles_is_no_wrong_unit():
    """As on a rotor that is much lighter than its link, until the run tries lower gains."""
    look_at_rattle(0.008)
    with pytest.raises(IdentificationError, match='another unit'):
        look_at_rattle(0.2)


def commanded(currents, response):
    """Check currents in A that a drive answers by `response`, on a joint that is not looked at."""
    supervision = supervised()
    supervision.least = 0.002
    random = np.random.default_rng(8)
    for k, current in enumerate(currents):
        measured = response(current) + 1e-3 * random.normal()
        supervision.check(1e-3 * k, 0.0, None, (current, measured))
        if k == 900:
            supervision.is_current_confirmed()


def test_a_drive_that_limits_its_current_is_no_wrong_unit():
    for rise, words in (
            (2000, 'stays at 0.4.* limits its current'), (1, 'late.* Or .* limits its')):
        currents = np.concatenate(
            (np.linspace(0.0, 0.3, 1000), np.linspace(0.3, 1.5, rise), np.full(2000, 1.5)))
        with pytest.raises(IdentificationError, match=words) as caught:
            commanded(currents, lambda current: min(current, 0.4))
        assert 'unit' not in str(caught.value)


@pytest.mark.parametrize('band', [0.3, 0.02])
def test_a_dead_band_is_a_cause_where_small_currents_have_no_answer(band):
    with pytest.raises(IdentificationError, match='dead band') as caught:
        commanded(np.linspace(0.0, 0.2, 2000), lambda current: max(current - band, 0.0))
    assert 'sign' not in str(caught.value)


def test_a_joint_that_swings_is_not_blocked_but_oscillates():
    supervision = supervised(4.0)
    for k in range(400):
        position = 0.002 * math.sin(2.0 * math.pi * 10.0 * 1e-3 * k)
        command = -2.0 * math.copysign(1.0, math.sin(2.0 * math.pi * 10.0 * 1e-3 * k - 1.2))
        supervision.check(1e-3 * k, position, None, (command, math.nan))
    assert supervision.oscillates()
    supervision.forget_oscillation()
    assert not supervision.oscillates()


def test_a_joint_that_leaves_its_range_is_told_from_one_that_is_pushed():
    for aim, words in ((0.4, 'rad from its reference.*elastic'), (math.nan, 'a person')):
        supervision = supervised()
        supervision.bounds, supervision.aim = (-0.5, 0.5), aim
        supervision.check(0.0, 0.0, None, (0.0, 0.0))
        with pytest.raises(IdentificationError, match=words):
            supervision.check(0.01, 0.6, None, (0.0, 0.0))


# Rate, delay, filters and encoders.

def test_a_position_behind_a_low_pass_slows_the_controller():
    state = [0.0]

    def alter(run, sample):
        state[0] += (1.0 - math.exp(-2e-3 / 0.025)) * (sample[1] - state[0])
        return [sample[0], state[0], math.nan, sample[3]]
    result = Bench(alter, step=2e-3).finish()
    truth = note_model().sigmoid(result.speeds)
    np.testing.assert_allclose(result.currents, truth, rtol=0.03)


def test_a_coarse_encoder_shows_no_speed_in_a_single_count():
    step = math.radians(0.2)
    model = note_model()
    drive = Drive(model.drive.torque_constant * model.drive.gear_ratio, 1.0,
                  round(2.0 * math.pi / step), model.drive.current_limit)

    def alter(run, sample):
        return [sample[0], math.floor(sample[1] / step) * step, math.nan, sample[3]]
    bench = Bench(alter, step=2e-3)
    bench.run = IdentificationRun(IdentificationGoal(**GOAL), drive)
    result = bench.finish()
    np.testing.assert_allclose(result.currents, model.sigmoid(result.speeds), rtol=0.04)


@pytest.mark.parametrize('samples', [2, 6])
def test_a_drive_that_is_slow_but_in_time_is_identified_with_lower_gains(samples):
    """At 250 Hz the current comes 8 to 24 ms after the command."""
    result = Bench(late=samples).finish()
    truth = note_model().sigmoid(result.speeds)
    np.testing.assert_allclose(result.currents, truth, rtol=0.05)
    assert result.breakaway.positive_mean == pytest.approx(0.0995, rel=0.1)


def test_joint_states_that_come_too_seldom_are_refused_with_the_rate_it_takes():
    def alter(run, sample):
        return [2.0 * sample[0], sample[1], math.nan, sample[3]]
    bench = Bench(alter, step=0.01)
    with pytest.raises(IdentificationError, match='50 times per second; .* takes 100'):
        bench.finish()


@pytest.mark.parametrize('samples', [10, 15, 62])
def test_a_drive_that_answers_late_is_not_told_to_have_another_unit(samples):
    bench = Bench(late=samples)
    with pytest.raises(IdentificationError, match='right size') as caught:
        bench.finish()
    said = float(re.search(r'one (\S+) s late', str(caught.value))[1])
    assert said == pytest.approx(STEP * samples, rel=0.1, abs=0.005)
    assert bench.largest < 0.4


@pytest.mark.parametrize(('factor', 'words'), [
    (10.0, 'another unit'), (-1.0, 'wrong sign'), (0.0, 'not measured')])
def test_a_wrong_unit_is_told_from_delay(factor, words):
    bench = Bench(scaled(factor, 3), late=30)
    with pytest.raises(IdentificationError, match=words):
        bench.finish()
    assert bench.largest <= bench.run.goal.ramp_peak
