# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The search among effects, their constants and sums over blocks; intervals, and delays."""

from dataclasses import replace
import math

from helpers import swings
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement import refine
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.intervals import intervals
from friction_comp.refinement.prepare import prepare, Problem
from friction_comp.refinement.search import adjust_constants, Fit, Search
from friction_comp.samples import Samples

COGGING = {'frequency': 14.0, 'growth': 0.0, 'speed': 1.0, 'transition': 0.01}
RAW = {'method': 'zero-phase Butterworth', 'source': 'velocity', 'bandwidth': None}
SEED, BLOCKS = st.integers(0, 2 ** 31), st.integers(2, 9)


def table_of(samples, extra=0.0):
    problem = Problem(samples.with_(current=samples.current + extra), Drive(1.0, 1.0))
    return Table(prepare(problem, RAW), 200.0)


def test_a_search_names_what_is_there_and_no_more():
    samples = swings(2)
    rippled = Search(table_of(samples, 0.1 * np.cos(14.0 * samples.position)))
    found, = rippled.forward([])
    assert found.kind.name == 'cogging'
    assert found.constants['frequency'] == pytest.approx(14.0, abs=1.0)
    for seed in range(20, 24):
        assert Search(table_of(swings(seed))).forward([]) == []


def test_parts_that_cancel_each_other_are_no_choice():
    samples = swings(2)
    table = table_of(samples.with_(position=0.4 * samples.position), 3.0 * samples.position ** 3)
    weight, spring = table.add([Term(EFFECTS['gravity']), Term(EFFECTS['spring'], {
        'position': 0.0})])
    assert [table.cancels(terms) for terms in ([weight], [spring], [weight, spring])] == [
        False, False, True]
    assert len(Search(table).backward([weight, spring])) < 2


def test_the_transition_goes_where_friction_changes_its_sign():
    samples = swings(3)
    found = table_of(samples.with_(current=0.2 * samples.velocity + 0.5 * np.tanh(
        (samples.velocity - 0.006) / 0.05)))
    found.fit_transition([], rounds=12)
    steepness, shift = found.transition
    assert shift == pytest.approx(0.006, abs=0.002)
    assert steepness == pytest.approx(2.0 / 0.05, rel=0.05)


@pytest.mark.parametrize(('name', 'constants', 'shape', 'constant', 'first'), [
    ('cogging', COGGING, lambda s: 0.1 * np.sin(14.0 * s.position), 'frequency', 13.4),
    ('stribeck', {'velocity': 0.15, 'exponent': 1.0, 'transition': 0.01},
     lambda s: 0.3 * np.exp(-np.abs(s.velocity) / 0.15) * np.tanh(s.velocity / 0.01),
     'velocity', 0.3)])
def test_a_constant_between_the_points_of_its_grid_is_found(name, constants, shape, constant,
                                                            first):
    samples = swings(5)
    found = table_of(samples, shape(samples))
    terms = found.add([Term(EFFECTS[name], {**constants, constant: first})])
    terms = adjust_constants(found, terms, rounds=10)
    found.fit_transition(terms)
    terms = adjust_constants(found, terms, rounds=10)
    value = terms[0].constants[constant]
    assert value == pytest.approx(constants[constant], rel=0.01 if name == 'cogging' else 0.15)
    low, high = intervals(Fit(found, terms, 0, RAW)).constants[terms[0], constant]
    assert low < constants[constant] < high


def made(seed, blocks, columns):
    """Return columns, a target and the block of each row; blocks of different lengths."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(columns + 2, columns + 20, blocks)
    matrix = rng.standard_normal((rows.sum(), columns)) * rng.uniform(0.01, 100.0, columns)
    target = matrix @ (rng.standard_normal(columns) / np.abs(matrix).mean(axis=0))
    target = target + rng.standard_normal(len(target))
    block = np.repeat(np.arange(blocks), rows)
    return matrix, target, block, BlockSums.over(np.vstack((matrix.T, target)), block)


def least_squares(matrix, target):
    return np.linalg.lstsq(matrix, target, rcond=None)[0]


@given(SEED, BLOCKS, st.integers(1, 6))
def test_a_block_left_out_is_predicted_as_by_a_fit_to_the_others(seed, blocks, columns):
    matrix, target, block, sums = made(seed, blocks, columns)
    found = sums.held_out_errors(range(columns))
    for k in range(blocks):
        fit = least_squares(matrix[block != k], target[block != k])
        expected = np.sum((target - matrix @ fit)[block == k] ** 2)
        assert found[k] == pytest.approx(expected, rel=1e-3, abs=1e-6)


@given(SEED, BLOCKS, st.integers(1, 5), st.data())
def test_a_coefficient_never_has_the_sign_that_physics_rules_out(seed, blocks, columns, data):
    matrix, target, _, sums = made(seed, blocks, columns)
    signs = np.array(data.draw(st.lists(
        st.sampled_from([0, 1]), min_size=columns, max_size=columns)))
    found = replace(sums, signs=signs).fit(range(columns))
    assert (found[signs > 0] >= 0.0).all()
    # Coefficients within their bounds are the least-squares fit without the others.
    free = np.nonzero((signs == 0) | (found > 0.0))[0]
    if len(free):
        assert found[free] == pytest.approx(
            least_squares(matrix[:, free], target), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize('broken', [0.0, 1e-200])
def test_columns_of_zeros_explain_nothing_and_do_no_harm(broken):
    x = np.random.default_rng(0).standard_normal(200)
    sums = BlockSums.over(np.vstack((x, np.full(200, broken), 2.0 * x)), np.repeat([0, 1], 100))
    assert sums.fit((0, 1)) @ (1.0, broken) == pytest.approx(2.0, abs=1e-5)
    assert sums.fit((0,)) == pytest.approx([2.0], abs=1e-5)


# Stated intervals hold the truth where current, encoder or motion tell less than they seem to.

TRUTH = {'coulomb': 0.6, 'viscous': 0.2, 'inertia': 0.06, 'offset': 0.03}
WEIGHT, STEP, INNER, LOGGED, NOISE = 0.5, 1e-3, 5, 5, 0.02


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


def one_sine(time, seed):
    size, rate = 0.5, 2 * math.pi * (0.7 + 0.1 * seed)
    return size * np.sin(rate * time), size * rate * np.cos(rate * time)


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
    for k in range(1, len(torques) if slow else 1):
        torques[k] = torques[k - 1] + (1.0 - math.exp(-STEP / slow)) * (torques[k] - torques[k - 1])
    torques = np.interp(time - delay, time, torques)[::LOGGED]
    noise = 0.015 * np.random.default_rng([seed, 1]).standard_normal(len(torques))
    return Samples(time=time[::LOGGED], position=positions[::LOGGED], current=torques + noise)


@pytest.mark.parametrize(('seed', 'changes', 'widths'), [
    (1, {}, {'inertia': (0.0, 0.05), 'viscous': (0.0, 0.08)}),
    # The drive filters its current.
    (1, {'slow': 0.006}, {'inertia': (0.0, 0.3)}), (3, {'slow': 0.012}, {'inertia': (0.0, 0.3)}),
    # One sine does not tell inertia from weight.
    (1, {'seconds': 3.0, 'motion': one_sine}, {'inertia': (0.1, np.inf)}),
    (3, {'seconds': 3.0, 'motion': one_sine}, {'inertia': (0.1, np.inf)}),
    # Several hundredths of a second of delay; the controller responds to encoder steps.
    (3, {'delay': 0.04}, {}), (3, {'delay': -0.04}, {}),
    (1, {'count': math.radians(0.2)}, {})])
def test_intervals_hold_the_truth_and_are_as_wide_as_the_doubt(seed, changes, widths):
    result = refine([recorded(seed, **changes)])
    friction = result.report.friction
    for name in ('coulomb', 'viscous', 'inertia'):
        low, high = friction.intervals[name]
        assert low <= TRUTH[name] <= high, name
        least, most = widths.get(name, (0.0, np.inf))
        assert least <= (high - low) / TRUTH[name] < most, name
    assert 0.5 < friction.inertia / TRUTH['inertia'] < 2.0 or 'motion' in changes
    if 'delay' in changes:
        assert result.model.differentiation['lag'] == pytest.approx(-changes['delay'], abs=0.003)


def turning(seed, step, duration):
    return swings(seed, duration, step, np.geomspace(0.15, 2.0, 7), size=0.35, coulomb=0.8,
                  viscous=0.3, inertia=0.05, width=0.1, noise=0.0)


def late(seed, delay):
    """Return a joint whose torque follows the current late, s, every 4 ms."""
    samples = turning(seed, 1e-3, 24.0)
    samples = samples.with_(
        velocity=None, acceleration=None,
        current=np.interp(samples.time + delay, samples.time, samples.current))
    samples = samples.take(slice(None, None, 4))
    return samples.with_(current=samples.current + NOISE * np.random.default_rng(
        seed).standard_normal(len(samples)))


@pytest.mark.parametrize('delay', [0.03, -0.03, 0.0])
def test_a_delay_of_the_torque_is_found_and_one_of_the_sensor_is_no_effect(delay):
    result = refine([late(2, delay)], drive=Drive(0.1, 100.0))
    assert result.report.differentiation.get('lag', 0.0) == pytest.approx(delay, abs=0.003)
    found = {effect.name for effect in result.report.effects}
    assert 'inertia' in found
    assert ('actuation_lag' in found) == (delay > 0.0)
    assert result.report.friction.coulomb == pytest.approx(0.8, rel=0.01)
    assert result.report.friction.inertia == pytest.approx(0.05, rel=0.05)
    assert result.report.after.held_out_rmse < 1.7 * NOISE


def test_noise_of_a_torque_sensor_does_not_change_what_the_load_does():
    # As recorded, noise of 1 N·m makes it -0.18 A/(N·m), and an inertia takes the rest.
    rng, samples = np.random.default_rng(2), turning(2, 0.004, 40.0)
    load = -0.1 * samples.acceleration
    for frequency in rng.uniform(0.1, 3.0, 6):
        load += 0.5 * np.sin(2 * np.pi * frequency * samples.time + rng.uniform(0.0, 6.28))
    noise = rng.standard_normal((2, len(samples)))
    result = refine([samples.with_(
        velocity=None, acceleration=None, load=load + noise[0], current=(
            samples.current - 0.05 * samples.acceleration - 0.30 * load + 0.05 * noise[1]))],
        drive=Drive(1.0, 1.0 / 0.3))
    found = {effect.name: effect for effect in result.report.effects}
    coefficient, = found['load_torque'].parameters['coefficients']
    assert coefficient == pytest.approx(-0.30, abs=0.012)
    # The model says how its load is prepared, so that it predicts another recording as well.
    assert 'load' in result.report.differentiation['signals']
