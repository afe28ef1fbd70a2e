# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Delays between current and motion, and noise of a load."""

from helpers import sines
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.statistics import rms

STEP, NOISE = 0.004, 0.02


def motion(rng, step, duration):
    """Return time, position, velocity and acceleration of a sum of seven sines."""
    time = np.arange(0.0, duration, step)
    return time, *sines(time, (
        (0.35 / frequency ** 1.3, 2 * np.pi * frequency * rng.uniform(0.9, 1.1),
         rng.uniform(0.0, 6.28)) for frequency in np.geomspace(0.15, 2.0, 7)))


def recorded(seed, delay):
    """Return a joint with 0.8 A of Coulomb friction, whose torque follows the current late, s."""
    rng, step = np.random.default_rng(seed), 1e-3
    time, position, velocity, acceleration = motion(rng, step, 24.0)
    current = 0.8 * np.tanh(velocity / 0.1) + 0.3 * velocity + 0.05 * acceleration
    current = np.interp(time + delay, time, current)
    kept = slice(None, None, round(STEP / step))
    return Samples(time=time[kept], position=position[kept],
                   current=current[kept] + NOISE * rng.standard_normal(len(time[kept])))


@pytest.mark.parametrize('delay', [0.03, -0.03, 0.0])
def test_a_delay_of_the_torque_is_found_and_one_of_the_sensor_is_no_effect(delay, tmp_path):
    result = refine([recorded(2, delay)], drive=Drive(0.1, 100.0))
    assert result.report.differentiation.get('lag', 0.0) == pytest.approx(delay, abs=0.006)
    found = {effect.name for effect in result.report.effects}
    assert 'inertia' in found
    assert ('actuation_lag' in found) == (delay > 0.0)
    assert result.report.friction.coulomb == pytest.approx(0.8, rel=0.01)
    assert result.report.friction.inertia == pytest.approx(0.05, rel=0.05)
    # The file says it, too: it predicts as the report states.
    result.model.save(tmp_path / 'model.yaml')
    samples = recorded(2, delay)
    error = samples.current - FrictionModel.load(tmp_path / 'model.yaml').predict(samples)
    assert rms(error[result.usable]) == pytest.approx(result.report.after.fit_rmse, rel=1e-6)
    assert result.report.after.held_out_rmse < 1.7 * NOISE


def test_noise_of_a_torque_sensor_does_not_change_what_the_load_does():
    # As recorded, noise of 1 N·m makes it -0.18 A/(N·m), and an inertia takes the rest.
    rng = np.random.default_rng(2)
    time, position, velocity, acceleration = motion(rng, STEP, 40.0)
    load = -0.1 * acceleration
    for frequency in rng.uniform(0.1, 3.0, 6):
        load += 0.5 * np.sin(2 * np.pi * frequency * time + rng.uniform(0.0, 6.28))
    current = 0.8 * np.tanh(velocity / 0.02) + 0.3 * velocity - 0.30 * load
    result = refine([Samples(
        time=time, position=position, current=current + 0.05 * rng.standard_normal(len(time)),
        load=load + 1.0 * rng.standard_normal(len(time)))], drive=Drive(1.0, 1.0 / 0.3))
    found = {effect.name: effect for effect in result.report.effects}
    coefficient, = found['load_torque'].parameters['coefficients']
    assert coefficient == pytest.approx(-0.30, abs=0.012)
    # The model says how its load is prepared, so that it predicts another recording as well.
    assert 'load' in result.report.differentiation['signals']
