# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification with filters, delays, rates and coarse encoders between it and the joint."""

import math
import re

from helpers import note_model
import numpy as np
import pytest
from test_identification_supervision import Bench, GOAL, scaled, STEP

from friction_comp.drive import Drive
from friction_comp.identification.goal import IdentificationError, IdentificationGoal
from friction_comp.identification.run import IdentificationRun


def test_a_position_behind_a_low_pass_slows_the_controller_and_is_said():
    state = [0.0]

    def alter(run, sample):
        state[0] += (1.0 - math.exp(-2e-3 / 0.025)) * (sample[1] - state[0])
        return [sample[0], state[0], math.nan, sample[3]]
    result = Bench(alter, step=2e-3).finish()
    truth = note_model().sigmoid(result.speeds)
    np.testing.assert_allclose(result.currents, truth, rtol=0.03)
    assert any('position is 0.02' in word for word in result.warnings)


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


@pytest.mark.parametrize(('pause', 'words'), [
    (1, 'arrive evenly, so the drive is late'), (15, 'machine is overloaded')])
def test_an_overloaded_machine_is_told_from_a_late_drive(pause, words):
    """Samples arrive one by one, or so many at a time."""
    count = [0]

    def alter(run, sample):
        count[0] += 1
        run.supervision.arrivals.take(sample[0], STEP * pause * math.ceil(count[0] / pause) + 7.0)
        return sample
    bench = Bench(alter, late=15)
    with pytest.raises(IdentificationError, match=words):
        bench.finish()


@pytest.mark.parametrize('samples', [10, 20, 62])
def test_a_drive_that_answers_late_is_not_told_to_have_another_unit(samples):
    """As on a machine that is busy with something else; not even the first current was right."""
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
