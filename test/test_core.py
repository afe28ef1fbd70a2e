# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Drive, samples, sigmoid, statistics, and the checks of numbers from outside."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.checks import check_number, check_whole_number
from friction_comp.errors import InputError
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.statistics import holm, top_speed

# Eq. 11 with the rows of configurations 2 and 3 in the order its own text asks for; test_docs.py
# says that they are swapped.
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
    for unit in ('rad/s', 'deg/s'):
        back = Sigmoid.from_coefficients(sigmoid.coefficients(unit), unit)
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


@given(rests=st.integers(0, 100_000), seed=st.integers(0, 100))
def test_rests_lower_the_top_speed_by_no_more_than_half(rests, seed):
    random = np.random.default_rng(seed)
    speed = np.abs(np.sin(np.arange(2000) * 0.01)) * 0.5
    noise = 1e-6 * random.random(rests)
    assert 0.2 < top_speed(np.concatenate((speed, noise))) <= top_speed(speed) < 0.5
    assert top_speed(np.zeros(rests)) == 0.0


def test_holm_adjusts_each_p_value_for_the_tests_that_are_left():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.9]).tolist() == [1.0, 1.0]
    assert holm([]).size == 0


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
