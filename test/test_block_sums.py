# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits to sums over blocks equal fits to the samples."""

from dataclasses import replace

from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.refinement.block_sums import BlockSums

SEED, BLOCKS, COLUMNS = st.integers(0, 2 ** 31), st.integers(2, 9), st.integers(1, 6)


def sums_of(matrix, target, block):
    return BlockSums.over(np.vstack((matrix.T, target)), block)


def made(seed, blocks, columns):
    """Return columns, a target and the block of each row; blocks of different lengths."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(columns + 2, columns + 20, blocks)
    matrix = rng.standard_normal((rows.sum(), columns)) * rng.uniform(0.01, 100.0, columns)
    target = matrix @ (rng.standard_normal(columns) / np.abs(matrix).mean(axis=0))
    return matrix, target + rng.standard_normal(len(target)), np.repeat(np.arange(blocks), rows)


@given(SEED, BLOCKS, COLUMNS)
def test_a_block_left_out_is_predicted_as_by_a_fit_to_the_others(seed, blocks, columns):
    matrix, target, block = made(seed, blocks, columns)
    found = sums_of(matrix, target, block).held_out_errors(range(columns))
    for k in range(blocks):
        fit = np.linalg.lstsq(matrix[block != k], target[block != k], rcond=None)[0]
        expected = np.sum((target - matrix @ fit)[block == k] ** 2)
        assert found[k] == pytest.approx(expected, rel=1e-3, abs=1e-6)


@given(SEED, BLOCKS, st.integers(1, 5), st.data())
def test_a_coefficient_never_has_the_sign_that_physics_rules_out(seed, blocks, columns, data):
    matrix, target, block = made(seed, blocks, columns)
    signs = np.array(data.draw(st.lists(
        st.sampled_from([0, 1]), min_size=columns, max_size=columns)))
    sums = replace(sums_of(matrix, target, block), signs=signs)
    found = sums.fit(range(columns))
    assert (found[signs > 0] >= 0.0).all()
    # Coefficients within their bounds are the least-squares fit without the others.
    free = np.nonzero((signs == 0) | (found > 0.0))[0]
    if len(free):
        alone = np.linalg.lstsq(matrix[:, free], target, rcond=None)[0]
        assert found[free] == pytest.approx(alone, rel=1e-3, abs=1e-6)


def test_a_weight_counts_a_block_that_many_times():
    matrix, target, block = made(3, 5, 2)
    weights = np.array([2.0, 0.0, 1.0, 3.0, 0.0])
    drawn = np.concatenate([np.nonzero(block == k)[0] for k in (0, 0, 2, 3, 3, 3)])
    found, = sums_of(matrix, target, block).fits(range(2), weights[None])
    assert found == pytest.approx(
        np.linalg.lstsq(matrix[drawn], target[drawn], rcond=None)[0], rel=1e-5)


@pytest.mark.parametrize('broken', [0.0, 1e-200])
def test_columns_of_zeros_explain_nothing_and_do_no_harm(broken):
    rng = np.random.default_rng(0)
    x = rng.standard_normal(200)
    sums = sums_of(np.column_stack((x, np.full(200, broken))), 2.0 * x, np.repeat([0, 1], 100))
    assert isinstance(sums, BlockSums)
    assert sums.fit((0, 1)) @ (1.0, broken) == pytest.approx(2.0, abs=1e-5)
    assert sums.fit((0,)) == pytest.approx([2.0], abs=1e-5)
