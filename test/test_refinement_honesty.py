# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement must see through: hidden inertia, blurred velocities, one-sided crossings."""

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.differentiation import differentiate
from friction_comp.model.effects.rest_time import RestTime
from friction_comp.model.effects.scene import Scene
from friction_comp.refinement import refine
from friction_comp.refinement.fit.robust_regression import solve
from friction_comp.refinement.judge.control import Control
from friction_comp.refinement.judge.evidence import ranks_tail
from friction_comp.refinement.judge.residual_dependence import inseparable
from friction_comp.refinement.judge.verdict import lower_report, verdict_of
from friction_comp.refinement.prepare.differentiation_choice import velocity_against_position
from friction_comp.samples import Samples

DRIVE = Drive(0.1, 100.0)
NOISE = 0.003


def strokes(seed, duration=100.0, rate=200.0):
    """Return time, position, velocity and acceleration of minimum-jerk strokes."""
    rng = np.random.default_rng(seed)
    parts, place = [], 0.0
    while sum(map(len, parts)) < duration * rate:
        goal = rng.uniform(-0.8, 0.8)
        length = max(40, int(rate * 1.875 * abs(goal - place) / rng.uniform(0.15, 0.9)))
        s = np.arange(length) / length
        parts.append(place + (goal - place) * (10 * s ** 3 - 15 * s ** 4 + 6 * s ** 5))
        place = goal
    q = np.concatenate(parts)[:int(duration * rate)]
    t = np.arange(len(q)) / rate
    v = np.gradient(q, t)
    return t, q, v, np.gradient(v, t)


def recorded(t, q, current, seed, counts=100_000, **signals):
    """Return samples with noise and an encoder's steps."""
    rng = np.random.default_rng([seed, 7])
    step = 2.0 * np.pi / counts
    return Samples(
        time=t, position=np.round(q / step) * step,
        current=current + NOISE * rng.standard_normal(len(t)),
        recording=np.zeros(len(t), dtype=int), **signals)


def friction(v):
    return 0.12 * np.tanh(v / 0.02) + 0.06 * v


def names(report):
    return [effect['name'] for effect in report['effects']]


def traced(report):
    return [entry['variable'] for entry in report['unexplained']]


def test_inertia_is_found_beside_a_larger_effect_without_a_name():
    t, q, v, a = strokes(3)
    rough = 0.08 * np.sign(np.sin(9.0 * q) + 0.3) * np.where(q > 0.1, 1.0, -0.4)
    step = np.where(t > 61.0, 0.08, 0.0) * np.tanh(v / 0.02)
    report = refine([recorded(t, q, friction(v) + 0.05 * a + rough + step, 3)],
                    drive=DRIVE).report
    inertia = next(e for e in report['effects'] if e['name'] == 'inertia')
    assert inertia['parameters']['coefficients'][0] == pytest.approx(0.05, rel=0.2)
    assert report['unexplained']


def test_a_change_at_one_moment_is_traced_to_time():
    t, q, v, _ = strokes(5)
    current = friction(v) + np.where((t > 40.0) & (t < 70.0), 0.05, 0.0) * np.tanh(v / 0.02)
    report = refine([recorded(t, q, current, 5)], drive=DRIVE).report
    assert 'time' in traced(report)


def test_a_lasting_change_is_not_called_warm_up():
    t, q, v, _ = strokes(5)
    changed = friction(v) * np.where(t > 55.0, 1.4, 1.0)
    report = refine([recorded(t, q, changed, 5)], drive=DRIVE).report
    assert names(report) == []
    assert traced(report)[0] == 'time'


def test_warming_up_is_not_called_a_change_at_one_moment():
    t, q, v, _ = strokes(5)
    fading = friction(v) * (1.0 + 0.5 * np.exp(-t / 30.0))
    report = refine([recorded(t, q, fading, 5)], drive=DRIVE).report
    assert names(report) == ['warm_up']


def test_a_product_of_position_and_velocity_gets_no_wrong_name():
    t, q, v, _ = strokes(4)
    report = refine([recorded(t, q, friction(v) + 0.08 * q * v, 4)], drive=DRIVE).report
    assert names(report) == []
    assert set(traced(report)[:2]) == {'position', 'velocity'}
    assert 'product of position and velocity' in report['unexplained'][0]['note']


def test_friction_of_the_size_of_acceleration_is_traced_to_it():
    t, q, v, a = strokes(6)
    report = refine([recorded(t, q, friction(v) + 0.03 * np.abs(a), 6)], drive=DRIVE).report
    assert traced(report)[0] == 'acceleration'
    assert 'direction_asymmetry' not in names(report)


def test_coarse_velocities_are_not_mistaken_for_a_lag():
    t, q, v, _ = strokes(7)
    report = refine([recorded(t, 0.4 * q, friction(0.4 * v), 7, counts=20_000)],
                    drive=DRIVE).report
    assert names(report) == []


def test_a_bump_that_a_fold_crosses_one_way_only_is_still_found():
    t, q, v, _ = strokes(8)
    bump = 0.05 * np.exp(-((q - 0.74) / 0.05) ** 2) * np.tanh(v / 0.02)
    result = refine([recorded(t, q, friction(v) + bump, 8)], drive=DRIVE)
    assert names(result.report)[0] == 'bump'
    t, q, v, _ = strokes(9)
    current = friction(v) + 0.05 * np.exp(-((q - 0.74) / 0.05) ** 2) * np.tanh(v / 0.02)
    other = recorded(t, q, current, 9)
    moving = np.abs(v) > 0.02
    error = (result.model.predict(other) - other.current)[moving]
    assert np.sqrt(np.mean(error ** 2)) < 1.3 * NOISE


def test_what_went_with_another_variable_all_along_is_named_beside_it():
    t = np.arange(0.0, 20.0, 0.01)
    q = 0.3 * t + 0.02 * t ** 2
    samples = differentiate(recorded(t, q, 0.1 + 0.0 * t, 1), {'source': 'position',
                                                                'bandwidth': 10.0})
    usable = np.ones(len(t), dtype=bool)
    assert set(inseparable('position', samples, usable)) >= {'time'}
    assert inseparable('acceleration', samples, usable) == []
    shuffled = samples.with_(time=np.random.default_rng(0).permutation(t))
    assert 'time' not in inseparable('position', shuffled, usable)


@pytest.mark.parametrize('scale, said', [(1.0, False), (1.02, False), (1.13, True), (0.8, True)])
def test_velocity_that_is_not_the_slope_of_position_is_said(scale, said):
    t, q, v, _ = strokes(2, duration=30.0)
    sentence = velocity_against_position(recorded(t, q, friction(v), 2, velocity=v / scale))
    assert (sentence is not None) == said
    if said:
        assert f'{scale:.3g}' in sentence


def test_a_model_whose_speed_is_at_odds_with_position_is_not_trusted():
    t, q, v, _ = strokes(2, duration=30.0)
    good = {'held_out_rmse': NOISE, 'held_out_r2': 0.99}
    words = []
    for scale in (1.0, 1.6):
        line = velocity_against_position(recorded(t, q, friction(v), 2, velocity=v / scale))
        report = {'after': good, 'noise_floor': NOISE, 'unexplained': [], 'ambiguous': [],
                  'warnings': [line] if line else []}
        words.append(verdict_of(report, Control(), False, '').word)
    assert words == ['trust', 'trust in part']


def test_a_reason_against_trust_takes_the_place_of_those_for_it():
    report = {'verdict': 'trust', 'reasons': ['near the noise'], 'record_again': []}
    lower_report(report, 'trust in part', 'motion that repeats', 'another motion')
    assert report == {'verdict': 'trust in part', 'reasons': ['motion that repeats'],
                      'record_again': ['another motion']}
    lower_report(report, 'trust in part', 'too short', 'another motion')
    assert report['reasons'] == ['motion that repeats', 'too short']


def test_a_joint_that_turns_round_slowly_has_not_rested():
    t, q, v, _ = strokes(2, duration=60.0)
    samples = recorded(t, q, friction(v), 2, velocity=v, acceleration=0.0 * v)
    scene = Scene(transition=0.02, speed=0.8, slowest=0.01, lowest=-0.8, highest=0.8,
                  duration=60.0, sample_time=0.005)
    grown = []
    for threshold in sorted({point['velocity'] for point in RestTime.grid(scene)}):
        constants = {'time_constant': 0.5, 'distance': 0.1, 'velocity': threshold,
                     'transition': 0.02}
        grown.append(float(np.max(np.abs(RestTime.matrix(samples, constants)))))
    # Minimum jerk passes through zero speed at every reversal, for a moment each.
    assert grown[0] < 0.5 * grown[-1]


def test_no_velocity_recorded_is_no_contradiction():
    t, q, v, _ = strokes(2, duration=30.0)
    assert velocity_against_position(recorded(t, q, friction(v), 2)) is None


def test_columns_that_are_zero_or_infinite_explain_nothing():
    rng = np.random.default_rng(0)
    x = rng.standard_normal(200)
    for broken in (np.zeros(200), np.full(200, np.inf), np.full(200, 1e-200)):
        found = solve(np.column_stack((x, broken)), 2.0 * x, np.ones(200))
        assert found == pytest.approx([2.0, 0.0], abs=1e-6)


def test_many_small_signs_alike_weigh_more_than_one_large_one():
    few = np.array([100.0, -0.1, -0.2, -0.1, -0.3, -0.2, -0.1, -0.2])
    many = np.array([100.0, 0.1, 0.2, 0.1, 0.3, 0.2, 0.1, 0.2])
    assert ranks_tail(many) < 0.02 < 0.2 < ranks_tail(few)
    assert ranks_tail(np.zeros(10)) == 1.0
