# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stated intervals hold the truth where current, encoder or motion tell less than they seem to."""

import math

import numpy as np
import pytest

from friction_comp.refinement import refine
from friction_comp.samples import Samples

TRUTH = {'coulomb': 0.6, 'viscous': 0.2, 'inertia': 0.06, 'offset': 0.03}
WEIGHT, STEP, INNER, LOGGED = 0.5, 1e-3, 5, 5


def reference(time, seed):
    """Return positions and velocities of minimum-jerk moves with short rests."""
    rng = np.random.default_rng(seed)
    q, v, start, place = np.zeros_like(time), np.zeros_like(time), 0.0, 0.0
    while start < time[-1]:
        change = rng.uniform(-1.2, 1.2) - place
        length = abs(change) / rng.uniform(0.4, 1.5) + 0.2
        s = np.clip((time - start) / length, 0.0, 1.0)
        q += change * (10 * s ** 3 - 15 * s ** 4 + 6 * s ** 5)
        v += change / length * 30 * s ** 2 * (1 - s) ** 2
        place, start = place + change, start + length + rng.uniform(0.1, 0.5)
    return q, v


def recorded(seed, seconds=20.0, motion=reference, count=5e-5, slow=0.0, delay=0.0):
    """Return a joint under a PD controller that sees the encoder; its torque is late, s."""
    time = np.arange(0.0, seconds, STEP)
    wanted, speed = motion(time, seed)
    gain = (2 * math.pi * 6.0) ** 2 * TRUTH['inertia']
    damping = 2 * 2 * math.pi * 6.0 * TRUTH['inertia']
    q, v, seen, rate, drop = wanted[0], 0.0, wanted[0], 0.0, TRUTH['coulomb'] * STEP / INNER
    positions, torques = np.empty_like(time), np.empty_like(time)
    for k in range(len(time)):
        before, seen = seen, round(q / count) * count
        rate += 0.1 * ((seen - before) / STEP - rate)
        torque = gain * (wanted[k] - seen) + damping * (speed[k] - rate)
        positions[k], torques[k] = seen, torque
        for _ in range(INNER):
            drive = torque - TRUTH['viscous'] * v - WEIGHT * math.sin(q) - TRUTH['offset']
            pushed = TRUTH['inertia'] * v + drive * STEP / INNER
            v = math.copysign(max(abs(pushed) - drop, 0.0), pushed) / TRUTH['inertia']
            q += v * STEP / INNER
    if slow:
        for k in range(1, len(torques)):
            torques[k] = torques[k - 1] + (1.0 - math.exp(-STEP / slow)) * (
                torques[k] - torques[k - 1])
    torques = np.interp(time - delay, time, torques)[::LOGGED]
    noise = 0.015 * np.random.default_rng([seed, 1]).standard_normal(len(torques))
    return Samples(time=time[::LOGGED], position=positions[::LOGGED], current=torques + noise)


def one_sine(time, seed):
    size, rate = 0.5, 2 * math.pi * (0.7 + 0.1 * seed)
    return size * np.sin(rate * time), size * rate * np.cos(rate * time)


def missed(friction):
    """Return the intervals that do not hold the truth, by name."""
    return {name: friction.intervals[name] for name in ('coulomb', 'viscous', 'inertia')
            if not friction.intervals[name][0] <= TRUTH[name] <= friction.intervals[name][1]}


def width(friction, name):
    low, high = friction.intervals[name]
    return (high - low) / TRUTH[name]


def codes(report):
    return {finding.code for finding in report.findings}


def test_intervals_are_narrow_where_nothing_is_in_doubt():
    report = refine([recorded(1)]).report
    assert not missed(report.friction)
    assert width(report.friction, 'inertia') < 0.05
    assert width(report.friction, 'viscous') < 0.08


@pytest.mark.parametrize(('seed', 'slow'), [(1, 0.006), (3, 0.012)])
def test_a_current_that_the_drive_filters_is_in_the_intervals(seed, slow):
    friction = refine([recorded(seed, slow=slow)]).report.friction
    assert not missed(friction)
    assert width(friction, 'inertia') < 0.3


@pytest.mark.parametrize('delay', [0.04, -0.04])
def test_a_delay_of_several_hundredths_of_a_second_is_found(delay):
    result = refine([recorded(3, delay=delay)])
    assert result.model.differentiation['lag'] == pytest.approx(-delay, abs=0.003)
    assert not missed(result.report.friction)


@pytest.mark.parametrize('seed', [1, 3])
def test_one_sine_does_not_tell_inertia_from_weight(seed):
    report = refine([recorded(seed, 3.0, one_sine)]).report
    assert not missed(report.friction)
    assert width(report.friction, 'inertia') > 0.1


def test_a_controller_that_responds_to_encoder_steps_does_not_set_the_inertia():
    report = refine([recorded(1, count=math.radians(0.2))]).report
    assert 0.5 < report.friction.inertia / TRUTH['inertia'] < 2.0
    assert not missed(report.friction)
