# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The curve of Eq. 6 is compared with the look-up table that it was fitted to."""

import numpy as np
import pytest

from friction_comp.identification.kinetic import KineticPoint
from friction_comp.identification.sigmoid_fit import fit_sigmoid
from friction_comp.identification.supervision import check_curve

SPEEDS = np.array([0.05, 0.1, 0.2, 0.4, 0.7, 1.0])


@pytest.mark.parametrize('rise, warned', [(0.0, 0), (0.1, 0), (0.2, 1), (0.5, 1)])
def test_a_curve_that_is_not_the_measured_friction_is_not_passed_off_as_it(rise, warned):
    speeds = np.concatenate((-SPEEDS[::-1], SPEEDS))
    fading = 1.0 + rise * np.exp(-(speeds / 0.08) ** 2)
    currents = 0.2 * np.sign(speeds) * fading + 0.15 * speeds
    sigmoid, _ = fit_sigmoid(speeds, currents)
    points = [KineticPoint(v, i, 0.0, v, 0.0) for v, i in zip(speeds, currents)]
    said = check_curve(points, sigmoid, 0.03, lambda current: f'{current:.3g} A')
    assert len(said) == warned
    assert all('0.05 rad/s' in line for line in said)
