# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Velocity and acceleration from recorded positions with regular and irregular stamps."""

from helpers import sines
import numpy as np
import pytest
from test_prepare import swings

from friction_comp.model.differentiation import differentiate, prepared_signal
from friction_comp.samples import Samples

SETTINGS = {'source': 'position', 'bandwidth': 20.0}


def moved(time):
    return sines(time, ((0.8, 2.0, 0.3), (0.2, 7.0, 1.1)))


@pytest.mark.parametrize('late', [True, False])
@pytest.mark.parametrize(('jitter', 'lost'), [(0.05, []), (0.3, []), (0.0, [700, 701, 1100])])
def test_uneven_stamps_and_lost_samples_do_not_blur_the_motion(late, jitter, lost):
    """Whether the samples came unevenly, or only their stamps did."""
    rng = np.random.default_rng(3)
    even = np.delete(np.arange(4000) * 1e-3, lost)
    stamps = even + jitter * 1e-3 * rng.uniform(-1.0, 1.0, len(even))
    position, velocity, acceleration = moved(even if late else stamps)
    found = differentiate(Samples(time=stamps, position=position, current=0 * even), SETTINGS)
    inner = slice(200, -200)
    assert np.max(np.abs(found.velocity - velocity)[inner]) < 0.01 * np.ptp(velocity)
    assert np.max(np.abs(found.acceleration - acceleration)[inner]) < (
        0.05 if lost else 0.03 if late else 0.03 + 0.25 * jitter) * np.ptp(acceleration)


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


def test_the_acceleration_of_a_measured_velocity_is_that_of_fast_motion():
    """At a fifth of the rate, with stamps as uneven as a bus makes them."""
    time = np.cumsum(np.where(np.arange(3000) % 3, 1.0, 1.4)) * 4e-3
    velocity = np.sin(2.0 * np.pi * 40.0 * time + 0.1)
    found = differentiate(Samples(time=time, position=0.0 * time, current=0.0 * time,
                                  velocity=velocity), {'source': 'velocity', 'bandwidth': None})
    true = 80.0 * np.pi * np.cos(2.0 * np.pi * 40.0 * time + 0.1)
    assert np.sqrt(np.mean((found.acceleration - true)[5:-5] ** 2)) < 0.1 * 80.0 * np.pi


def slow_signal(time):
    return np.sin(2.0 * time) + 0.5 * np.cos(5.0 * time)


@pytest.mark.parametrize('rest', [False, True])
def test_a_value_that_is_held_is_interpolated_and_a_signal_at_rest_stays(rest):
    time = np.arange(2000) * 1e-3
    truth = np.where(rest & (time > 0.7) & (time < 1.3), slow_signal(0.7), slow_signal(time))
    held = truth[np.arange(len(time)) // 20 * 20]
    samples = Samples(time=time, position=time, current=0 * time, load=held)
    found = prepared_signal(samples, held)
    smooth = slice(0, 1980) if not rest else slice(0, 1250)
    assert np.abs(found - truth)[smooth].max() < 0.1 * np.abs(held - truth)[smooth].max() + (
        0.02 * rest)


def test_a_measured_signal_is_freed_of_noise_and_keeps_what_is_missing():
    time = np.arange(4000) * 1e-3
    noisy = slow_signal(time) + np.random.default_rng(1).standard_normal(len(time))
    noisy[1000:1010] = np.nan
    samples = Samples(time=time, position=time, current=0 * time, load=noisy)
    found = differentiate(samples, {**SETTINGS, 'signals': {'load': {'bandwidth': 5.0}}}).load
    assert np.isnan(found[1000:1010]).all()
    assert np.isfinite(found).sum() == 3990
    error = (found - slow_signal(time))[200:-200]
    assert np.sqrt(np.nanmean(error ** 2)) < 0.15
