# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Lags of current and load: a delay, or a first-order low pass of drive or sensor, and noise."""

from helpers import sines
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.differentiation import as_recorded, settings_of
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement import refine
from friction_comp.samples import Samples
from friction_comp.statistics import rms

STEP, NOISE = 0.004, 0.02


def followed(signal, step, time_constant):
    """Return what follows a signal by a first-order low pass, by its exact step response."""
    result, weight = np.array(signal), 1.0 - np.exp(-step / time_constant)
    for k in range(1, len(signal)):
        result[k] = result[k - 1] + weight * (signal[k] - result[k - 1])
    return result


def motion(rng, step, duration):
    """Return time, position, velocity and acceleration of a sum of seven sines."""
    time = np.arange(0.0, duration, step)
    return time, *sines(time, (
        (0.35 / frequency ** 1.3, 2 * np.pi * frequency * rng.uniform(0.9, 1.1),
         rng.uniform(0.0, 6.28)) for frequency in np.geomspace(0.15, 2.0, 7)))


def recorded(seed, delay=0.0, drive=0.0, sensor=0.0):
    """Return a joint with 0.8 A of Coulomb friction, late by a delay or a low pass, in s."""
    rng, step = np.random.default_rng(seed), 1e-3
    time, position, velocity, acceleration = motion(rng, step, 24.0)
    current = 0.8 * np.tanh(velocity / 0.1) + 0.3 * velocity + 0.05 * acceleration
    if drive:
        current += drive * np.gradient(current, step)
    if sensor:
        current = followed(current, step, sensor)
    current = np.interp(time + delay, time, current)
    kept = slice(None, None, round(STEP / step))
    return Samples(time=time[kept], position=position[kept],
                   current=current[kept] + NOISE * rng.standard_normal(len(time[kept])))


@pytest.mark.parametrize(('late', 'name', 'value'), [
    ({'drive': 0.03}, 'time_constant', 0.03), ({'sensor': 0.03}, 'time_constant', -0.03),
    ({'delay': 0.03}, 'lag', 0.03), ({}, None, 0.0)])
def test_a_low_pass_is_told_from_a_delay_and_named_only_if_the_drive_has_it(
        late, name, value, tmp_path):
    # As a delay alone, the low pass of the drive made Coulomb friction 0.98 A, and a hysteresis.
    result = refine([recorded(2, **late)], drive=Drive(0.1, 100.0))
    found = {effect.name: effect for effect in result.report.effects}
    settings = result.report.differentiation
    assert {key for key in ('lag', 'time_constant') if key in settings} == ({name} - {None})
    if name:
        assert settings[name] == pytest.approx(value, rel=0.2)
    named = value > 0.0
    assert set(found) == ({'inertia', 'actuation_lag'} if named else {'inertia'})
    if named:
        assert found['actuation_lag'].parameters == {name: settings[name]}
        assert ('low pass' in found['actuation_lag'].in_words) == (name == 'time_constant')
        assert ('d/dt' in found['actuation_lag'].formula) == (name == 'time_constant')
    told = [one.text for one in result.report.findings if one.code == 'late_current']
    assert len(told) == (value < 0.0)
    assert result.report.friction.coulomb == pytest.approx(0.8, rel=0.01)
    assert result.report.friction.inertia == pytest.approx(0.05, rel=0.05)
    # The file says it, too: it predicts as the report states.
    result.model.save(tmp_path / 'model.yaml')
    samples = recorded(2, **late)
    error = samples.current - FrictionModel.load(tmp_path / 'model.yaml').predict(samples)
    assert rms(error[result.usable]) == pytest.approx(result.report.after.fit_rmse, rel=1e-6)
    assert rms(error[result.usable]) < 1.7 * NOISE
    assert result.report.after.held_out_rmse < 1.7 * NOISE


def test_a_low_pass_is_undone_and_ends_with_the_recording():
    time = np.arange(4000) * 1e-3
    samples = Samples(time=time, position=time, current=0 * time,
                      recording=(np.arange(4000) >= 2000).astype(int))
    torque = np.sin(2.0 * time) + (time >= 2.0)
    # The current follows the torque: each recording begins in its own state.
    late = as_recorded(torque, samples, -0.05)
    for part in (slice(0, 2000), slice(2000, 4000)):
        assert late[part] == pytest.approx(followed(torque[part], 1e-3, 0.05), abs=2e-3)
    # The torque follows the current: what it followed comes back; columns are as good.
    columns = as_recorded(np.column_stack((late, -2.0 * late)), samples, 0.05)
    for part in (slice(10, 1990), slice(2010, 3990)):
        assert columns[part, 0] == pytest.approx(torque[part], abs=2e-3)
        assert columns[part, 1] == pytest.approx(-2.0 * torque[part], abs=4e-3)
    assert as_recorded(torque, samples, None) is torque


def test_a_wrong_time_constant_is_named():
    with pytest.raises(InputError, match='differentiation.time_constant'):
        settings_of({'time_constant': 'slow'}, 'differentiation')


def with_torque_sensor(seed, noise=0.0, lag=0.0):
    """Return a joint whose sensor carries a link: 0.8 A Coulomb, 0.3 viscous, -0.30 A/(N·m)."""
    rng = np.random.default_rng(seed)
    time, position, velocity, acceleration = motion(rng, STEP, 40.0)
    load = -0.1 * acceleration
    for frequency in rng.uniform(0.1, 3.0, 6):
        load += 0.5 * np.sin(2 * np.pi * frequency * time + rng.uniform(0.0, 6.28))
    current = 0.8 * np.tanh(velocity / 0.02) + 0.3 * velocity - 0.30 * load
    sensed = np.interp(time - lag, time, load) + noise * rng.standard_normal(len(time))
    return Samples(time=time, position=position,
                   current=current + 0.05 * rng.standard_normal(len(time)),
                   load=sensed)


@pytest.mark.parametrize('sensor', [
    {'noise': 1.0}, {'noise': 0.2, 'lag': 0.02}])
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
