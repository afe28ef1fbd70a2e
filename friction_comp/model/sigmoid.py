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

from friction_comp.errors import Checked, InputError, number, stated

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

        Raises InputError if there are not six finite numbers with c2, c4 and c5 positive.
        """
        unit = _unit(velocity_unit)
        try:
            values = [float(value) for value in coefficients]
        except (TypeError, ValueError):
            raise InputError(f'sigmoid coefficients must be numbers: {coefficients!r}') from None
        if len(values) != 6 or not all(map(math.isfinite, values)):
            raise InputError(f'sigmoid needs six finite coefficients, not {coefficients!r}')
        c1, c2, c3, c4, c5, c6 = values
        if c2 <= 0 or c4 <= 0 or c5 <= 0:
            raise InputError('sigmoid coefficients c2, c4 and c5 must be positive')
        return cls(
            upper=c1 / c4, lower=-c3 / c5, steepness=c2 / unit,
            shift=-math.log(c4 / c5) / c2 * unit, viscous=c6 / unit)

    def coefficients(self, velocity_unit: str = 'rad/s') -> tuple[float, ...]:
        """Return c1..c6 of Eq. 6; the sum c4 + c5, which Eq. 6 leaves free, is 2."""
        unit = _unit(velocity_unit)
        with np.errstate(over='ignore'):
            # The transition's share at standstill.
            share = kinetic_current(0.0, 1.0, 0.0, self.steepness, self.shift, 0.0)
        c4 = 2.0 * float(share)
        c4, c5 = max(c4, 2e-12), max(2.0 - c4, 2e-12)
        return (self.upper * c4, self.steepness * unit, -self.lower * c5, c4, c5,
                self.viscous * unit)


def _unit(name: str) -> float:
    if not isinstance(name, str) or name not in VELOCITY_UNITS:
        raise InputError(f'velocity unit must be one of {sorted(VELOCITY_UNITS)}, not {name!r}')
    return VELOCITY_UNITS[name]
