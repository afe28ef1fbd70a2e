# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What noise, lag and a slow rate of a load sensor do to the coefficient of the load."""

from helpers import sines
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.statistics import rms


def with_torque_sensor(seed, noise=0.0, lag=0.0, held=1):
    """Return a joint whose sensor carries a link: 0.8 A Coulomb, 0.3 viscous, -0.30 A/(N·m)."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 40.0, 0.004)
    position, velocity, acceleration = sines(time, (
        (0.35 / frequency ** 1.3, 2 * np.pi * frequency * rng.uniform(0.9, 1.1),
         rng.uniform(0.0, 6.28)) for frequency in np.geomspace(0.15, 2.0, 7)))
    load = -0.1 * acceleration
    for frequency in rng.uniform(0.1, 3.0, 6):
        load += 0.5 * np.sin(2 * np.pi * frequency * time + rng.uniform(0.0, 6.28))
    current = 0.8 * np.tanh(velocity / 0.02) + 0.3 * velocity - 0.30 * load
    sensed = np.interp(time - lag, time, load) + noise * rng.standard_normal(len(time))
    return Samples(time=time, position=position,
                   current=current + 0.05 * rng.standard_normal(len(time)),
                   load=sensed[np.arange(len(time)) // held * held])


@pytest.mark.parametrize('sensor', [
    {'noise': 1.0}, {'noise': 0.2, 'lag': 0.02}, {'noise': 0.05, 'held': 10}])
def test_noise_and_lag_of_a_torque_sensor_do_not_change_what_the_load_does(sensor):
    # As recorded, noise of 1 N·m makes it -0.18 A/(N·m), and an inertia takes the rest.
    result = refine([with_torque_sensor(2, **sensor)], drive=Drive(1.0, 1.0 / 0.3))
    found = {effect.name: effect for effect in result.report.effects}
    coefficient, = found['load_torque'].parameters['coefficients']
    assert coefficient == pytest.approx(-0.30, abs=0.012)
    assert 'actuation_lag' not in found
    inertia = found['inertia'].parameters['coefficients'][0] if 'inertia' in found else 0.0
    assert inertia < 0.002
    own = result.report.differentiation['signals']['load']
    assert own['lag'] == pytest.approx(sensor.get('lag', 0.0), abs=0.003)
    # The model says how its load is prepared, so that it predicts another recording as well.
    other = with_torque_sensor(5, **sensor)
    assert rms(other.current - result.model.predict(other)) < 1.6 * 0.05
