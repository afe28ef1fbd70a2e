# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The note's kinetic friction model, Eq. 6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from friction_comp.errors import Checked, InputError, listed, number, stated

VELOCITY_UNITS = {'rad/s': 1.0, 'deg/s': math.pi / 180.0}


def kinetic_current(velocity: Any, upper: float, lower: float, steepness: float, shift: float,
                    viscous: float) -> Any:
    """Return Eq. 6 at a velocity, array or number, rad/s, in the unit of the plateaus."""
    return viscous * velocity + lower + (upper - lower) / (
        1.0 + np.exp(-steepness * (velocity - shift)))


@dataclass(frozen=True)
class Sigmoid(Checked):
    """Current that overcomes kinetic friction, as a function of joint velocity (Eq. 6).

    Eq. 6 has six coefficients but five degrees of freedom: c1, c3, c4 and c5 may be multiplied
    by any number. They are stored as these parameters:

    ``i(ω) = viscous·ω + lower + (upper - lower) / (1 + exp(-steepness·(ω - shift)))``

    with ``upper = c1/c4``, ``lower = -c3/c5``, ``steepness = c2``,
    ``shift = -ln(c4/c5)/c2`` and ``viscous = c6``.
    """

    upper: float = stated(number())             # A, to which it tends at high positive velocity
    lower: float = stated(number())             # A, the same at high negative velocity
    steepness: float = stated(number(above=0.0))    # s/rad
    shift: float = stated(number(), 0.0)        # velocity of the transition's middle, rad/s
    viscous: float = stated(number(), 0.0)      # A·s/rad

    def __call__(self, velocity: ArrayLike) -> Any:
        """Return the current in A at joint velocity in rad/s, of the same shape."""
        # Far below the transition the exponential is infinite, and the quotient zero as it should.
        with np.errstate(over='ignore'):
            return kinetic_current(np.asarray(velocity, dtype=float), self.upper, self.lower,
                                   self.steepness, self.shift, self.viscous)

    @property
    def line(self) -> tuple[float, float, float]:
        """Offset (A), Coulomb (A) and viscous friction (A·s/rad), with a sudden sign change."""
        return 0.5 * (self.upper + self.lower), 0.5 * (self.upper - self.lower), self.viscous

    @classmethod
    def from_coefficients(cls, coefficients: Sequence[float],
                          velocity_unit: str = 'rad/s') -> Sigmoid:
        """Make a sigmoid from c1..c6 of Eq. 6, with ω in rad/s or, as in Eq. 11, in deg/s.

        Raises InputError if they are not six finite numbers with c2, c4 and c5 positive.
        """
        unit = VELOCITY_UNITS.get(str(velocity_unit))
        if unit is None:
            raise InputError(f'velocity unit must be one of {sorted(VELOCITY_UNITS)}, not '
                             f'{velocity_unit!r}')
        values = listed(number())(coefficients, 'sigmoid.coefficients')
        if len(values) != 6 or min(values[1], *values[3:5]) <= 0.0:
            raise InputError('sigmoid.coefficients must be six numbers, of which c2, c4 and c5 are '
                             f'positive, not {coefficients!r}')
        c1, c2, c3, c4, c5, c6 = values
        return cls(
            upper=c1 / c4, lower=-c3 / c5, steepness=c2 / unit,
            shift=-math.log(c4 / c5) / c2 * unit, viscous=c6 / unit)

    def coefficients(self) -> tuple[float, ...]:
        """Return c1..c6 of Eq. 6, ω in rad/s; the sum c4 + c5, which Eq. 6 leaves free, is 2."""
        with np.errstate(over='ignore'):
            # The transition's share at standstill.
            share = kinetic_current(0.0, 1.0, 0.0, self.steepness, self.shift, 0.0)
        c4 = 2.0 * float(share)
        c4, c5 = max(c4, 2e-12), max(2.0 - c4, 2e-12)
        return self.upper * c4, self.steepness, -self.lower * c5, c4, c5, self.viscous
