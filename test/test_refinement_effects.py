# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement finds on simulated drives, and how much easier the drive is then to move.

First a small part of bench/refine_table.py: drives, strengths and constants are random; error is
taken on recordings that were not fitted. Then the loop closed in behaviour: a drive with an
undeclared effect is recorded and refined, starting from its declared model, and a person moves it
twice: compensated by the declared model, and by the refined one.
"""

from dataclasses import replace
import functools

from closed_loop import closed_loop
from helpers import note_model
import numpy as np
import pytest
from refine_table import error

from friction_comp.compensation.law import CompensationLaw
from friction_comp.direction.exercise import ReferenceMovement
from friction_comp.refinement import refine
from friction_comp.simulation.joint import Plant
from friction_comp.simulation.undeclared import Undeclared
from simulated_recordings import CASES, excitation_for, random_drive, record, SimulatedDrive

pytestmark = pytest.mark.slow

SEED = 31
# As much as each of these takes to be found, s; bench/refine_table.py has twice that.
RECORDED = {'rate': 100.0, 'duration': 60.0}
# How friction grows within a rest is told from place by more samples.
MORE = {'rest': {'rate': 125.0, 'duration': 75.0}}


@functools.cache
def refined(cases, seed):
    """Return the report, and the error on a fresh recording in parts of the noise floor."""
    drive = random_drive(seed, cases)
    changes = {**RECORDED, **MORE.get('+'.join(cases), {})}
    fit, score = (record(drive, 10 * seed + k, excitation_for(cases, **changes)) for k in (1, 2))
    result = refine(fit, model=None, drive=drive.model.drive)
    return result.report, error(result.model, score) / drive.noise_floor


def variables(report):
    """Return the variables of the effects found, in the order of finding."""
    return [effect.variable for effect in report.effects]


# Lags are found in test_effect_search.py, and inertia in test_friction_numbers.py.
@pytest.mark.parametrize('case', [
    case for case in CASES if case not in ('actuation_lag', 'inertia')])
def test_the_undeclared_effect_is_named_and_removed(case):
    report, ratio = refined((case,), SEED)
    assert set(variables(report)) == {CASES[case].variable}
    assert ratio <= 1.3


@pytest.mark.parametrize(('pair', 'seed', 'names'), [
    (('friction_ripple', 'inertia'), 33, None), (('bump', 'sub_linear'), 33, None),
    # A backlash is no hysteresis though inertia was not known when it was found.
    (('backlash', 'inertia'), 35, {'backlash', 'inertia'})])
def test_both_of_a_pair_are_named(pair, seed, names):
    report, ratio = refined(pair, seed)
    assert set(variables(report)) == {CASES[name].variable for name in pair}
    assert names in (None, {effect.name for effect in report.effects})
    assert ratio <= 1.3


def test_nothing_is_found_where_nothing_is():
    report, ratio = refined((), 40)
    assert report.effects == []
    assert report.unexplained == []
    assert report.verdict == 'trust'
    assert report.reasons
    assert ratio <= 1.3


THERMAL = {'ambient': 22.0, 'heating': 200.0, 'time_constant': 60.0}
# Effect, and the variable under which it must be found: one each of speed, place, temperature and
# history. The drive's friction is 1.2 N·m.
FED_BACK = {
    'stribeck': ({'amplitude': 0.5, 'velocity': 0.15}, 'velocity'),
    'friction_ripple': ({'amplitude': 0.5, 'frequency': 14.0, 'phase': 0.7}, 'position'),
    'temperature': ({'coefficient': 0.025, 'reference': 25.0}, 'temperature'),
    'hysteresis': ({'torque': 0.6, 'stiffness': 12.0}, 'history'),
}
SAMPLE_TIME = 4e-3  # s, of plant and law in the loop


def effect_of(name):
    return [{'name': name, 'parameters': FED_BACK[name][0]}]


def trials(declared, name, seed):
    """Return recordings of a drive with an effect that its model does not declare."""
    drive = SimulatedDrive(model=declared, effects=effect_of(name), noise=0.002,
                           thermal=THERMAL)
    excitation = excitation_for((name,), rate=125.0, duration=60.0)
    return record(drive, seed, excitation)


def identified(declared, name):
    """Return the declared model with the breakaway current that ramps would have shown."""
    if name != 'stribeck':
        return declared
    more = FED_BACK[name][0]['amplitude'] / declared.drive.torque_per_current
    both = declared.breakaway
    return replace(declared, breakaway=replace(
        both, positive_mean=both.positive_mean + more, negative_mean=both.negative_mean - more))


def plant_of(declared, name):
    """Return the simulated joint with the effect that its model file does not declare."""
    warm = dict(THERMAL, initial=50.0) if name == 'temperature' else None
    return Plant([declared], seed=3, undeclared=[
        Undeclared.from_effects(effect_of(name), warm)], sample_time=SAMPLE_TIME)


def moved_by_hand(declared, model, name):
    """Return RMS over the movements and mean of their peaks of the person's torque, N·m."""
    movement = ReferenceMovement(repetitions=1, standstill=1.5)
    log = closed_loop(plant_of(declared, name), CompensationLaw([model], sample_time=SAMPLE_TIME),
                      movement, movement.duration)
    squares, peaks = [], []
    for number in range(2):
        begin = movement.begins(number)
        torque = log['interaction_torque'][
            (log['time'] > begin) & (log['time'] < begin + movement.movement_time), 0]
        squares.append(np.mean(torque ** 2))
        peaks.append(np.abs(torque).max())
    return float(np.sqrt(np.mean(squares))), float(np.mean(peaks))


def farthest_untouched(declared, model, name, direction):
    """Return how far the joint goes, rad, while a direction is announced and nobody touches it."""
    plant, farthest = plant_of(declared, name), 0.0
    law = CompensationLaw([model], sample_time=SAMPLE_TIME)
    for _ in range(round(3.0 / SAMPLE_TIME)):
        state = plant.state
        farthest = max(farthest, abs(state.position[0]))
        announced = [direction if state.time > 0.3 else 0]
        plant.step(law.update(state.time, state.position, state.velocity, announced,
                              temperature=state.temperature))
    return farthest


@pytest.mark.parametrize('name', FED_BACK)
def test_the_refined_model_makes_the_drive_easier_to_move(name):
    declared = note_model(1)
    known = identified(declared, name)
    result = refine(trials(declared, name, 1), model=known)
    assert FED_BACK[name][1] in {effect.variable for effect in result.report.effects}
    rms_before, peak_before = moved_by_hand(declared, known, name)
    rms_after, peak_after = moved_by_hand(declared, result.model, name)
    # Displacement alone takes much of a ripple; the law's breakaway term is at work anyway.
    assert rms_after < {'temperature': 0.75, 'friction_ripple': 0.85}.get(name, 1.0) * rms_before
    # Starting is hardly easier where breakaway currents do not follow.
    assert peak_after < (1.1 if name == 'temperature' else 0.95) * peak_before
    # Help of 0.99 of breakaway friction, whose single values scatter by 2 %, may slip once.
    for direction in (-1, 1):
        stronger = replace(result.model, breakaway=result.model.breakaway.times(1.1))
        assert farthest_untouched(declared, stronger, name, direction) < np.radians(0.3)
