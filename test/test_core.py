# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Samples, sigmoid and its fit, differentiation, statistics, and checks of numbers from outside."""

from dataclasses import replace
import math

from helpers import sines, swings
from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.errors import check_number, check_whole_number, InputError
from friction_comp.identification.curves import fit_sigmoid, sigmoid_error
from friction_comp.model.differentiation import differentiate, prepared_signal
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

# Drive, samples, sigmoid, statistics, and the checks of numbers from outside.

# Eq. 11 with the rows of configurations 2 and 3, which it swaps, in the order its text asks for.
EQUATION_11 = {
    1: (0.1101, 1.2456, 0.1359, 1.1671, 1.4959, 0.0008),
    2: (0.3629, 1.1022, 0.3000, 2.2795, 1.8775, 0.0027),
    3: (0.8896, 3.0735, 0.3082, 2.4381, 0.8727, 0.0032),
}


def as_printed(coefficients, omega):
    c1, c2, c3, c4, c5, c6 = coefficients
    growth = np.exp(c2 * omega)
    return c6 * omega + (c1 * growth - c3) / (c4 * growth + c5)


@pytest.mark.parametrize('number', EQUATION_11)
def test_sigmoid_is_equation_6_as_printed(number):
    degrees = np.linspace(-100, 100, 401)
    sigmoid = Sigmoid.from_coefficients(EQUATION_11[number], 'deg/s')
    assert sigmoid(np.radians(degrees)) == pytest.approx(
        as_printed(EQUATION_11[number], degrees), abs=1e-12)
    assert np.all(np.isfinite(sigmoid(np.array([-1e6, 1e6]))))


@given(upper=st.floats(0.01, 1), lower=st.floats(-1, -0.01), steepness=st.floats(0.5, 300),
       shift=st.floats(-0.02, 0.02), viscous=st.floats(0, 0.5))
def test_coefficients_give_the_same_curve_back(upper, lower, steepness, shift, viscous):
    sigmoid = Sigmoid(upper, lower, steepness, shift, viscous)
    back = Sigmoid.from_coefficients(sigmoid.coefficients())
    velocity = np.linspace(-2, 2, 41)
    assert back(velocity) == pytest.approx(sigmoid(velocity), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize('coefficients', [
    (1, 2, 3), (1, 2, 3, 4, 5, float('nan')), ('a',) * 6, (1, 0, 1, 1, 1, 0), (1, 1, 1, -1, 1, 0)])
def test_sigmoid_refuses_what_is_not_equation_6(coefficients):
    with pytest.raises(InputError):
        Sigmoid.from_coefficients(coefficients)
    with pytest.raises(InputError, match='deg/s'):
        Sigmoid.from_coefficients(EQUATION_11[1], 'rpm')


def stretch(start, count, **signals):
    time = start + 0.001 * np.arange(count)
    return Samples(time=time, position=np.zeros(count), current=np.ones(count), **signals)


def test_segments_break_at_gaps_and_at_recordings():
    parts = [stretch(0.0, 10), stretch(1.0, 20), stretch(0.5, 5)]
    joined = Samples.concatenate(parts)
    assert [s.stop - s.start for s in joined.segments()] == [10, 20, 5]
    assert joined.sample_time == pytest.approx(0.001)
    assert list(np.unique(joined.recording)) == [0, 1, 2]
    # A signal that one part lacks is dropped.
    assert Samples.concatenate([stretch(0, 3, load=np.ones(3)), stretch(1, 3)]).load is None
    with pytest.raises(InputError, match='velocity'):
        stretch(0, 3, velocity=np.zeros(4))


@given(st.floats(), st.floats(-10, 10), st.floats(0, 20))
def test_a_number_is_taken_exactly_when_it_is_finite_and_within_bounds(value, least, width):
    if math.isfinite(value) and least <= value <= least + width:
        assert check_number(value, 'x', least=least, most=least + width) == value
    else:
        with pytest.raises(InputError, match='^x must be a finite number from '):
            check_number(value, 'x', least=least, most=least + width)


@pytest.mark.parametrize('value', [True, None, '1', math.nan, math.inf, 0.0, [1.0], 1j])
def test_numbers_that_are_not_positive_or_not_whole_are_refused(value):
    with pytest.raises(InputError, match='^limit must be a positive finite number, not '):
        check_number(value, 'limit', above=0.0)
    with pytest.raises(InputError, match='^n must be a whole number from 1 to 100000, not '):
        check_whole_number(value, 'n', least=1, most=100_000)
    assert type(check_whole_number(np.int8(3), 'x', least=1, most=3)) is int


def test_the_smallest_step_is_the_encoders_and_zero_without_motion():
    for position, step in (([0.0, 0.0, 0.2, 0.1, 0.1], 0.1), ([0.0] * 4, 0.0), ([], 0.0)):
        nothing = np.zeros(len(position))
        samples = Samples(time=nothing, position=np.array(position), current=nothing)
        assert samples.position_step == pytest.approx(step)


# The L1 fit of Eq. 6, and its comparison with the look-up table that it was fitted to.

# Of configuration 2, the steepest of the note.
NOTED = Sigmoid.from_coefficients((0.3629, 1.1022, 0.3000, 2.2795, 1.8775, 0.0027), 'deg/s')


def both_ways(speeds):
    """Return speeds in rad/s, of some in degrees, in both directions."""
    return np.radians(np.concatenate([-np.flip(speeds), speeds]))


TABLE = both_ways([1, 2, 3, 5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100])


def random_drive(seed):
    """Return a random curve and its table: up to 50 speeds, noise of several kinds."""
    random = np.random.default_rng(seed)
    speeds = both_ways(np.unique(np.round(
        np.append(random.uniform(0.5, 100.0, random.integers(4, 25)), 100.0), 2)))
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
    found, error = fit_sigmoid(TABLE, truth(TABLE))
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
    table = both_ways(speeds)
    for seed in range(3):
        scatter = noise * np.random.default_rng(seed).standard_normal(len(table))
        found, _ = fit_sigmoid(table, NOTED(table) + scatter * NOTED(table).max())
        slow = 0.3 * table[[len(speeds) - 1, len(speeds)]]
        assert (found(slow) * slow > 0.0).all()


@pytest.mark.parametrize('speeds', [[5, 50], [80, 100], [10, 40, 100]])
def test_two_or_three_speeds_tell_coulomb_and_viscous_friction(speeds):
    table = both_ways(speeds)
    far = np.radians([-100.0, -20.0, -5.0, 5.0, 20.0, 100.0])
    for seed in range(4):
        scatter = 1e-3 * np.random.default_rng(seed).standard_normal(len(table))
        found, _ = fit_sigmoid(table, NOTED(table) * (1.0 + scatter))
        np.testing.assert_allclose(found(far), NOTED(far), rtol=0.07)


# Velocity and acceleration from recorded positions with regular and irregular stamps.

SETTINGS = {'source': 'position', 'bandwidth': 20.0}


def moved(time):
    return sines(time, ((0.8, 2.0, 0.3), (0.2, 7.0, 1.1)))


@pytest.mark.parametrize('late', [True, False])
@pytest.mark.parametrize(('jitter', 'lost'), [(0.05, []), (0.3, []), (0.0, [700, 701, 1100])])
def test_uneven_stamps_and_lost_samples_do_not_blur_the_motion(late, jitter, lost):
    """Whether the samples came unevenly, or only their stamps did."""
    rng = np.random.default_rng(3)
    even = np.delete(np.arange(4000) * 1e-3, lost)
    stamps = even + jitter * 1e-3 * rng.uniform(-1.0, 1.0, len(even))
    position, velocity, acceleration = moved(even if late else stamps)
    found = differentiate(Samples(time=stamps, position=position, current=0 * even), SETTINGS)
    inner = slice(200, -200)
    assert np.max(np.abs(found.velocity - velocity)[inner]) < 0.01 * np.ptp(velocity)
    assert np.max(np.abs(found.acceleration - acceleration)[inner]) < (
        0.05 if lost else 0.03 if late else 0.03 + 0.25 * jitter) * np.ptp(acceleration)


def test_samples_that_arrive_together_are_no_burst_of_acceleration():
    samples = swings(8, duration=20.0)
    stamps = samples.time.copy()
    # Every hundredth message is delayed until the next one.
    stamps[100::100] = stamps[101::100] - 1e-6
    settings = {'source': 'velocity', 'bandwidth': None}
    late = differentiate(samples.with_(time=stamps), settings)
    assert np.abs(late.acceleration).max() < 5.0 * np.abs(samples.acceleration).max()
    even = differentiate(samples, settings)
    assert even.acceleration[5:-5] == pytest.approx(samples.acceleration[5:-5], abs=0.02)


def test_the_acceleration_of_a_measured_velocity_is_that_of_fast_motion():
    """At a fifth of the rate, with stamps as uneven as a bus makes them."""
    time = np.cumsum(np.where(np.arange(3000) % 3, 1.0, 1.4)) * 4e-3
    velocity = np.sin(2.0 * np.pi * 40.0 * time + 0.1)
    found = differentiate(Samples(time=time, position=0.0 * time, current=0.0 * time,
                                  velocity=velocity), {'source': 'velocity', 'bandwidth': None})
    true = 80.0 * np.pi * np.cos(2.0 * np.pi * 40.0 * time + 0.1)
    assert np.sqrt(np.mean((found.acceleration - true)[5:-5] ** 2)) < 0.1 * 80.0 * np.pi


def slow_signal(time):
    return np.sin(2.0 * time) + 0.5 * np.cos(5.0 * time)


@pytest.mark.parametrize('rest', [False, True])
def test_a_value_that_is_held_is_interpolated_and_a_signal_at_rest_stays(rest):
    time = np.arange(2000) * 1e-3
    truth = np.where(rest & (time > 0.7) & (time < 1.3), slow_signal(0.7), slow_signal(time))
    held = truth[np.arange(len(time)) // 20 * 20]
    samples = Samples(time=time, position=time, current=0 * time, load=held)
    found = prepared_signal(samples, held)
    smooth = slice(0, 1980) if not rest else slice(0, 1250)
    assert np.abs(found - truth)[smooth].max() < 0.1 * np.abs(held - truth)[smooth].max() + (
        0.02 * rest)


def test_a_measured_signal_is_freed_of_noise_and_keeps_what_is_missing():
    time = np.arange(4000) * 1e-3
    noisy = slow_signal(time) + np.random.default_rng(1).standard_normal(len(time))
    noisy[1000:1010] = np.nan
    samples = Samples(time=time, position=time, current=0 * time, load=noisy)
    found = differentiate(samples, {**SETTINGS, 'signals': {'load': {'bandwidth': 5.0}}}).load
    assert np.isnan(found[1000:1010]).all()
    assert np.isfinite(found).sum() == 3990
    error = (found - slow_signal(time))[200:-200]
    assert np.sqrt(np.nanmean(error ** 2)) < 0.15
