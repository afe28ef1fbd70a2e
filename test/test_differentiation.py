# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration from recorded positions with regular and irregular stamps."""

import numpy as np
import pytest
from test_prepare import swings

from friction_comp.model.differentiation import differentiate
from friction_comp.samples import Samples

SETTINGS = {'source': 'position', 'bandwidth': 20.0}


def moved(time):
    """Return position, velocity and acceleration of two sines."""
    terms = ((0.8, 2.0, 0.3), (0.2, 7.0, 1.1))
    return tuple(sum(a * w ** k * wave(w * time + p, k) for a, w, p in terms) for k in range(3))


def wave(angle, order):
    return (np.sin, np.cos, lambda x: -np.sin(x))[order](angle)


@pytest.mark.parametrize('late', [True, False])
@pytest.mark.parametrize('jitter', [0.05, 0.3])
def test_uneven_stamps_do_not_blur_the_motion(late, jitter):
    """Whether the samples came unevenly, or only their stamps did."""
    rng = np.random.default_rng(3)
    even = np.arange(4000) * 1e-3
    stamps = even + jitter * 1e-3 * rng.uniform(-1.0, 1.0, len(even))
    position, velocity, acceleration = moved(even if late else stamps)
    found = differentiate(Samples(time=stamps, position=position, current=0 * even), SETTINGS)
    inner = slice(200, -200)
    assert np.max(np.abs(found.velocity - velocity)[inner]) < 0.01 * np.ptp(velocity)
    assert np.max(np.abs(found.acceleration - acceleration)[inner]) < (
        0.03 + 0.25 * jitter) * np.ptp(acceleration)


def test_a_lost_sample_shows_neither_in_velocity_nor_in_acceleration():
    time = np.delete(np.arange(2000) * 1e-3, [700, 701, 1100])
    position, velocity, acceleration = moved(time)
    found = differentiate(Samples(time=time, position=position, current=0 * time), SETTINGS)
    inner = slice(200, -200)
    assert np.max(np.abs(found.velocity - velocity)[inner]) < 0.01 * np.ptp(velocity)
    assert np.max(np.abs(found.acceleration - acceleration)[inner]) < 0.05 * np.ptp(acceleration)


def test_samples_that_arrive_together_are_no_burst_of_acceleration():
    samples = swings(8, duration=20.0)
    stamps = samples.time.copy()
    # Every hundredth message is delayed until the next one.
    stamps[100::100] = stamps[101::100] - 1e-6
    settings = {'source': 'velocity', 'bandwidth': None}
    late = differentiate(samples.with_(time=stamps), settings)
    assert np.abs(late.acceleration).max() < 5.0 * np.abs(samples.acceleration).max()
    even = differentiate(samples, settings)
    assert even.acceleration[5:-5] == pytest.approx(samples.acceleration[5:-5], abs=0.02)
