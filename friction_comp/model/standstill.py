# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction of a joint at rest: breakaway currents and presliding displacement."""

from __future__ import annotations

from dataclasses import dataclass
import math

from friction_comp.checks import check_number
from friction_comp.errors import InputError


@dataclass(frozen=True)
class Breakaway:
    """Breakaway currents of Eq. 9 and 10 in A; the negative direction's mean is negative.

    The positions in rad at which they were measured, where known, allow effects of position to be
    subtracted.
    """

    positive_mean: float
    negative_mean: float
    positive_std: float = 0.0
    negative_std: float = 0.0
    positive_position: float | None = None
    negative_position: float | None = None

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None or name.endswith('_mean'):
                check_number(value, f'breakaway.{name}',
                             least=0.0 if name.endswith('_std') else -math.inf)
        if self.positive_mean < 0 or self.negative_mean > 0:
            raise InputError(
                'breakaway currents must have the sign of their direction, not '
                f'{self.positive_mean} and {self.negative_mean}')


@dataclass(frozen=True)
class Presliding:
    """Displacement of the gear before it slides, from current ramps."""

    distance: float     # rad, from rest without load until friction is at 95 % of breakaway
    stiffness: float | None = None      # A/rad, of friction up to a third of breakaway
    std: float | None = None            # standard deviation between single rests, rad
    backlash: float | None = None       # rad, not part of distance; 0 if there is none

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == 'backlash' and value is not None:
                check_number(value, 'presliding.backlash', least=0.0)
            elif value is not None or name == 'distance':
                check_number(value, f'presliding.{name}', above=0.0)
