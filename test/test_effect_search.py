# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The search among effects: what it names, their constants, and fits by sums over blocks."""

from dataclasses import replace

from helpers import swings
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.intervals import intervals
from friction_comp.refinement.prepare import prepare
from friction_comp.refinement.search import adjust_constants, Fit, Search

COGGING = {'frequency': 14.0, 'growth': 0.0, 'speed': 1.0, 'transition': 0.01}
RAW = {'method': 'zero-phase Butterworth', 'source': 'velocity', 'bandwidth': None}
SEED, BLOCKS = st.integers(0, 2 ** 31), st.integers(2, 9)


def table_of(samples, extra=0.0):
    rows, _ = prepare(samples.with_(current=samples.current + extra), Drive(1.0, 1.0), RAW)
    return Table(rows, 200.0)


def test_a_search_names_what_is_there_and_no_more():
    samples = swings(2)
    rippled = Search(table_of(samples, 0.1 * np.cos(14.0 * samples.position)))
    found, = rippled.forward([])
    assert found.kind.name == 'cogging'
    assert found.constants['frequency'] == pytest.approx(14.0, abs=1.0)
    for seed in range(20, 24):
        assert Search(table_of(swings(seed))).forward([]) == []


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
