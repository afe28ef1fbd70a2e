# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The L1 fit of Eq. 6, and its comparison with the look-up table that it was fitted to."""

from dataclasses import replace
import math

import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.identification.curves import fit_sigmoid, sigmoid_error
from friction_comp.model.sigmoid import Sigmoid

# Of configuration 2, the steepest of the note.
NOTE = 0.3629, 1.1022, 0.3000, 2.2795, 1.8775, 0.0027
TABLE = np.radians([1, 2, 3, 5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100])
TABLE = np.concatenate([-TABLE[::-1], TABLE])


def random_drive(seed):
    """Return a random curve and its table: up to 50 speeds, noise of several kinds."""
    random = np.random.default_rng(seed)
    speeds = np.radians(np.unique(np.round(
        np.append(random.uniform(0.5, 100.0, random.integers(4, 25)), 100.0), 2)))
    speeds = np.concatenate([-speeds[::-1], speeds])
    sigmoid = Sigmoid(
        upper=random.uniform(0.05, 0.5), lower=-random.uniform(0.05, 0.5),
        steepness=math.degrees(1.0) * 10.0 ** random.uniform(-1.3, 0.7),
        shift=math.radians(1.5 * random.normal()), viscous=random.uniform(0.0, 0.3))
    noise = random.normal if seed % 2 else (lambda size: random.standard_t(2, size))
    scatter = 10.0 ** random.uniform(-4.5, -2.0) * noise(size=speeds.size)
    return sigmoid, speeds, sigmoid(speeds) + scatter


# Of curves that push nowhere: the fit must not, either.
@pytest.mark.parametrize('seed', [0, 2, 4, 10])
def test_no_curve_is_nearer_to_a_table_than_its_fit(seed):
    """Neither the true one, which a local minimum would miss, nor one beside the fit."""
    truth, speeds, currents = random_drive(seed)
    found, error = fit_sigmoid(speeds, currents)
    assert error == pytest.approx(sigmoid_error(found, speeds, currents))
    assert error <= 1.001 * sigmoid_error(truth, speeds, currents)
    for name in ('upper', 'lower', 'steepness', 'shift', 'viscous'):
        value = getattr(found, name)
        for changed in (value + 1e-3, value - 1e-3, 1.01 * value, 0.99 * value):
            other = replace(found, **{name: changed})
            assert error <= 1.001 * sigmoid_error(other, speeds, currents), (name, changed)


@pytest.mark.slow
def test_transition_that_the_table_does_not_resolve_is_centred_and_gentle():
    truth = Sigmoid(upper=0.2, lower=-0.2, steepness=2000.0, shift=0.008, viscous=0.05)
    speeds = np.concatenate([-TABLE[TABLE > 0][::-1], TABLE[TABLE > 0]])
    found, error = fit_sigmoid(speeds, truth(speeds))
    assert error < 1e-6
    assert found.shift == 0.0
    assert abs(float(found(0.0))) < 1e-6
    assert found.steepness < truth.steepness


def test_a_resolved_shift_is_kept_and_an_outlier_does_not_bend_the_curve():
    truth = Sigmoid(upper=0.2, lower=-0.15, steepness=60.0, shift=0.03, viscous=0.05)
    currents = truth(TABLE)
    currents[5] += 0.1
    found, error = fit_sigmoid(TABLE, currents)
    assert error == pytest.approx(0.1, rel=0.01)
    np.testing.assert_allclose(found(TABLE), truth(TABLE), atol=1e-3)
    assert found.shift == pytest.approx(0.03, abs=1e-3)
    assert found.steepness == pytest.approx(60.0, rel=0.01)


@pytest.mark.parametrize(('speeds', 'currents'), [
    ([1.0, 2.0], [1.0, 2.0]), ([-1.0, 1.0, 2.0], [0.0, 1.0, 1.0]),
    ([-2.0, -1.0, 1.0, math.nan], [0.0] * 4), ([-2.0, -1.0, 1.0, 2.0], [0.0] * 3)])
def test_bad_tables_are_refused(speeds, currents):
    with pytest.raises(InputError, match='look-up table'):
        fit_sigmoid(speeds, currents)


@pytest.mark.parametrize('speeds', [[15, 60], [10, 40, 100], [4, 8, 15, 25, 40, 60, 80, 100]])
@pytest.mark.parametrize('noise', [0.001, 0.01])
def test_noise_does_not_make_friction_push_below_the_lowest_speed(speeds, noise):
    truth = Sigmoid.from_coefficients(NOTE, 'deg/s')
    table = np.radians(np.concatenate([-np.array(speeds)[::-1], speeds]))
    for seed in range(3):
        scatter = noise * np.random.default_rng(seed).standard_normal(len(table))
        found, _ = fit_sigmoid(table, truth(table) + scatter * truth(table).max())
        slow = 0.3 * table[[len(speeds) - 1, len(speeds)]]
        assert (found(slow) * slow > 0.0).all()


@pytest.mark.parametrize('speeds', [[5, 50], [80, 100], [10, 40, 100]])
def test_two_or_three_speeds_tell_coulomb_and_viscous_friction(speeds):
    truth = Sigmoid.from_coefficients(NOTE, 'deg/s')
    table = np.radians(np.concatenate([-np.array(speeds)[::-1], speeds]))
    far = np.radians([-100.0, -20.0, -5.0, 5.0, 20.0, 100.0])
    for seed in range(4):
        scatter = 1e-3 * np.random.default_rng(seed).standard_normal(len(table))
        found, _ = fit_sigmoid(table, truth(table) * (1.0 + scatter))
        np.testing.assert_allclose(found(far), truth(far), rtol=0.07)
