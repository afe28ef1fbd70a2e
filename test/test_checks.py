# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers from outside are accepted or refused with uniform messages."""

import math

from hypothesis import given, strategies as st
import numpy as np
import pytest

from friction_comp.checks import check_number, check_whole_number
from friction_comp.errors import InputError
from friction_comp.samples import Samples


@given(st.floats(), st.floats(-10, 10), st.floats(0, 20))
def test_a_number_is_taken_exactly_when_it_is_finite_and_within_bounds(value, least, width):
    if math.isfinite(value) and least <= value <= least + width:
        assert check_number(value, 'x', least=least, most=least + width) == value
    else:
        with pytest.raises(InputError, match='^x must be a finite number from '):
            check_number(value, 'x', least=least, most=least + width)


@pytest.mark.parametrize('value', [True, None, '1', math.nan, math.inf, 0.0, [1.0], 1j])
def test_numbers_that_are_not_positive_are_refused(value):
    with pytest.raises(InputError, match='^limit must be a positive finite number, not '):
        check_number(value, 'limit', above=0.0)


def test_numbers_of_numpy_are_numbers():
    assert type(check_number(np.float32(0.5), 'x')) is float
    assert type(check_whole_number(np.int8(3), 'x', least=1, most=3)) is int


@pytest.mark.parametrize('value', [0, 1.0, True, '1', 100_001])
def test_numbers_that_are_not_whole_or_in_range_are_refused(value):
    with pytest.raises(InputError, match='^n must be a whole number from 1 to 100000, not '):
        check_whole_number(value, 'n', least=1, most=100_000)


def test_the_smallest_step_is_the_encoders_and_zero_without_motion():
    for position, step in (([0.0, 0.0, 0.2, 0.1, 0.1], 0.1), ([0.0] * 4, 0.0), ([], 0.0)):
        nothing = np.zeros(len(position))
        samples = Samples(time=nothing, position=np.array(position), current=nothing)
        assert samples.position_step == pytest.approx(step)
