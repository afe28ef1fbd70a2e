# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Each undeclared effect does to the simulated joint what its file says, and nothing else."""

from dataclasses import replace
import math

import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared, undeclared_torque
from friction_comp.statistics import rms
from simulated_recordings.drives import Excitation, random_drive, record, SimulatedDrive

# Formulas as a reader of the file format would write them: torque N·m that the motor has to
# hold, and torque by which friction is higher, as functions of position, velocity, time, load.
HELD = {
    'offset': ({'torque': 0.4}, lambda x, v, t, u: 0.4 + 0 * x),
    'gravity': ({'amplitude': 0.6, 'phase': 0.5}, lambda x, v, t, u: 0.6 * np.sin(x + 0.5)),
    'cogging': ({'amplitude': 0.3, 'frequency': 12.0, 'slope': -0.5},
                lambda x, v, t, u: 0.3 * (1 - 0.5 * np.abs(v)) * np.sin(12 * x)),
}
HIGHER = {
    'stribeck': ({'amplitude': 0.5, 'velocity': 0.4},
                 lambda x, v, t, u: 0.5 * np.exp(-np.abs(v) / 0.4)),
    'viscous_shape': ({'amplitude': 0.5, 'exponent': 0.5},
                      lambda x, v, t, u: 0.5 * np.sqrt(np.abs(v))),
    'direction': ({'coulomb': 0.2, 'viscous': 0.3},
                  lambda x, v, t, u: np.sign(v) * (0.2 + 0.3 * np.abs(v))),
    'friction_ripple': ({'amplitude': 0.3, 'frequency': 12.0, 'phase': 1.0},
                        lambda x, v, t, u: 0.3 * np.sin(12 * x + 1)),
    'bump': ({'amplitude': 0.6, 'position': 0.2, 'width': 0.3},
             lambda x, v, t, u: 0.6 * np.exp(-0.5 * ((x - 0.2) / 0.3) ** 2)),
    'load': ({'coefficient': 0.3}, lambda x, v, t, u: 0.3 * np.abs(u)),
    'warm_up': ({'share': 0.4, 'time_constant': 10.0},
                lambda x, v, t, u: 0.4 * np.exp(-t / 10) * (1.0 + 0.4 * np.abs(v))),
}


def plain_drive(effects, **changes):
    """Return a drive of 1 N·m/A with friction 1 N·m + 0.4 N·m·s/rad, without noise."""
    drive = random_drive(5)
    model = replace(
        drive.model,
        drive=replace(drive.model.drive, torque_constant=0.01, gear_ratio=100.0),
        sigmoid=replace(drive.model.sigmoid, upper=1.0, lower=-1.0, viscous=0.4, steepness=300.0))
    return SimulatedDrive(model=model, effects=effects, noise=0.0, presliding=1e-4,
                          **{'thermal': drive.thermal, **changes})


def moved(effects, servo, load=0.0, **changes):
    """Return steadily moving samples (x, v, t, load, current) of a recording with the effects."""
    drive = plain_drive(effects, **changes)
    samples = record(drive, 4, Excitation(duration=40.0, servo=servo, load=load))[0].samples
    step = samples.sample_time
    velocity = np.gradient(samples.position, step)
    velocity = np.convolve(velocity, np.ones(11) / 11, 'same')
    acceleration = np.convolve(np.gradient(velocity, step), np.ones(41) / 41, 'same')
    steady = (np.abs(velocity) > 0.1) & (np.abs(acceleration) < 0.05)
    steady[:200] = False
    kept = samples.take(steady)
    torque = kept.load if kept.load is not None else np.zeros(len(kept))
    return kept.position, velocity[steady], kept.time - samples.time[0], torque, kept.current


@pytest.mark.parametrize('servo', [False, True], ids=['tracked', 'servo'])
@pytest.mark.parametrize('name', [*HELD, *HIGHER])
def test_the_current_shows_the_effect_as_its_formula_says(name, servo):
    parameters, formula = {**HELD, **HIGHER}[name]
    load = 0.5 if name == 'load' else 0.0
    x, v, t, u, current = moved([{'name': name, 'parameters': parameters}], servo, load)
    extra = formula(x, v, t, u) * (np.sign(v) if name in HIGHER else 1.0)
    expected = np.sign(v) * (1.0 + 0.4 * np.abs(v)) + extra - u
    assert len(x) > 1000
    assert np.std(extra) > 0.04 or name == 'offset'
    # The servo hunts a little, and a human's push is measured with noise.
    assert rms(current - expected) < (0.04 if servo else 0.02)


def test_temperature_scales_friction():
    effect = [{'name': 'temperature', 'parameters': {'coefficient': -0.02, 'reference': 20.0}}]
    # It starts up to 30 K above ambient.
    drive = plain_drive(effect, thermal={'ambient': 20.0, 'heating': 60.0, 'time_constant': 60.0})
    excitation = Excitation(duration=60.0, temperature=True, rests=False)
    warm = record(drive, 4, excitation)[0].samples
    cold = record(replace(drive, effects=[]), 4, excitation)[0].samples
    share = np.median((warm.current / cold.current)[np.abs(cold.current) > 1.0])
    mean = np.mean(warm.temperature)
    assert np.ptp(warm.temperature) > 3.0
    assert share == pytest.approx(1.0 - 0.02 * (mean - 20.0), abs=0.03)


def test_inertia_requires_torque_proportional_to_acceleration():
    fast = Excitation(duration=40.0, rate=1000.0, rests=False)
    drive = plain_drive([{'name': 'inertia', 'parameters': {'inertia': 0.2}}])
    heavy = record(drive, 4, fast)[0]
    light = record(replace(drive, effects=[]), 4, fast)[0]
    position = np.convolve(heavy.samples.position, np.ones(41) / 41, 'same')
    acceleration = np.gradient(np.gradient(position, 1e-3), 1e-3)
    inner = slice(200, -200)
    difference = (heavy.noise_free - light.noise_free)[inner]
    slope = np.polyfit(acceleration[inner], difference, 1)[0]
    assert slope == pytest.approx(0.2, rel=0.03)


def test_stiction_grows_with_rest_and_is_lost_by_sliding():
    effect = {'name': 'rest', 'parameters': {'share': 0.5, 'time_constant': 1.0, 'distance': 0.1}}

    def breakaway(rest):
        plant = Plant([replace(plain_drive([]).model, simulation={'current_noise': 0.0})],
                      undeclared=[Undeclared.from_effects([effect])])
        for _ in range(round(rest / 1e-3)):
            plant.step([0.0])
        for k in range(2000):
            if plant.step([0.9 + k * 1e-3]).position[0] > 1e-3:
                return 0.9 + k * 1e-3
        raise AssertionError('never started')

    short, long = breakaway(0.01), breakaway(5.0)
    # A plant starts as a joint that has rested for 1 s; the ramp of 1 A/s then meets the level
    # that grows meanwhile at 1.39 A, and after a long rest at 1.5 A.
    assert short == pytest.approx(1.39, abs=0.06)
    assert long == pytest.approx(1.5, abs=0.06)

    table, memory = _table([effect])
    levels = [undeclared_torque(table, memory, 0.0, 0.0, 0.0, 0.0, 25.0, 10.0, 2.0)[1]]
    levels += [undeclared_torque(table, memory, 0.0, x, 0.1, 0.0, 25.0, 0.0, 2.0)[1]
               for x in (0.1, 0.2)]
    np.testing.assert_allclose(levels, [1.0, math.exp(-1), math.exp(-2)], rtol=1e-4)


def test_friction_behind_a_backlash_is_absent_across_the_gap_after_a_reversal():
    effect = {'name': 'backlash', 'parameters': {'torque': 0.5, 'gap': 0.02, 'stiffness': 100.0}}
    table, memory = _table([effect])

    def torque(x):
        return -undeclared_torque(table, memory, 0.0, x, 1.0, 0.0, 25.0, 0.0, 1.0)[0]
    # It starts in the middle; 0.5 N·m at 100 N·m/rad are another 5 mrad.
    assert [torque(x) for x in (0.0, 0.009, 0.0125, 0.015, 0.3)] == pytest.approx(
        [0.0, 0.0, 0.25, 0.5, 0.5])
    # Back: released over 5 mrad, nothing over 20, taken up over 5 again.
    assert [torque(x) for x in (0.2975, 0.295, 0.275, 0.2725, 0.27, 0.1)] == pytest.approx(
        [0.25, 0.0, 0.0, -0.25, -0.5, -0.5])


def test_friction_never_turns_into_drive():
    effect = [{'name': 'direction', 'parameters': {'coulomb': -50.0}}]
    plant = Plant([plain_drive([]).model], undeclared=[Undeclared.from_effects(effect)])
    for _ in range(300):
        plant.step([0.2])
    moving = plant.state.velocity[0]
    for _ in range(3000):
        plant.step([0.0])
    assert moving > 0.01
    assert abs(plant.state.velocity[0]) < 1e-9


@pytest.mark.parametrize(('text', 'reason'), [
    ('', 'not a file of undeclared effects'),
    ('format: friction_comp_undeclared\nversion: 2', 'version 2'),
    ('[', 'not a YAML document'),
    ('{format: friction_comp_undeclared, version: 1, effects: 3}', 'not a list'),
    ('{format: friction_comp_undeclared, version: 1, effect: []}', 'unknown entries: effect;'),
    ('{format: friction_comp_undeclared, version: 1, effects: [{name: magic}]}', "'magic'"),
    ('{format: friction_comp_undeclared, version: 1, effects: [{name: [magic]}]}', 'magic'),
    ('{format: friction_comp_undeclared, version: 1, effects: [{name: offset}]}', 'needs torque'),
    ('{format: friction_comp_undeclared, version: 1, effects: '
     '[{name: offset, parameters: {torque: .nan}}]}', 'torque must be a finite number'),
    ('{format: friction_comp_undeclared, version: 1, effects: '
     '[{name: offset, parameters: {torque: 1, size: 2}}]}', 'unknown entries: size;'),
    ('{format: friction_comp_undeclared, version: 1, thermal: {time_constant: 0}}',
     'time_constant'),
])
def test_a_file_that_cannot_be_used_says_why(tmp_path, text, reason):
    path = tmp_path / 'hidden.yaml'
    path.write_text(text)
    with pytest.raises(InputError) as error:
        Undeclared.from_file(path)
    assert str(error.value).startswith(str(path))
    assert reason in str(error.value)
    assert '\n' not in str(error.value)


def _table(effects):
    extra = Undeclared.from_effects(effects)
    return extra.table, np.zeros(extra.memory_size)
