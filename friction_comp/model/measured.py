# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a model file keeps of measurements beside friction: at rest, and of the recordings."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from friction_comp.checks import check_interval, check_list, check_mapping, check_number
from friction_comp.errors import InputError


@dataclass(frozen=True)
class Breakaway:
    """Breakaway currents of Eq. 9 and 10, A, signed, and the positions where measured, rad."""

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

    def times(self, factor: float) -> Breakaway:
        """Return them `factor` times as large; the same if their scatter is larger than that."""
        scatter = max(self.positive_std / max(self.positive_mean, 1e-9),
                      self.negative_std / max(-self.negative_mean, 1e-9))
        if abs(factor - 1.0) <= scatter:
            return self
        return replace(self, **{
            f'{side}_{what}': factor * getattr(self, f'{side}_{what}')
            for side in ('positive', 'negative') for what in ('mean', 'std')})


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


# Factor of the highest of the recorded speeds, and share of a motion beyond it, worth a note.
_BEYOND, _FASTER = 1.25, 0.1
LINE = ('offset', 'coulomb', 'viscous')
"""Parameters of the line, in A, A and A·s/rad."""


@dataclass(frozen=True)
class Recorded:
    """What a model file keeps of the recordings it was fitted to."""

    speeds: tuple[float, ...] = ()  # quantiles of the speed in motion, rad/s, the lowest first
    # 95 % intervals by parameter, in the model's unit of current, of `LINE`, inertia, transition.
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, section: Any) -> Recorded:
        """Read the section `recorded` of a model file."""
        check_mapping(section, 'recorded', ('speeds', 'intervals'))
        speeds = tuple(check_number(value, 'recorded.speeds', above=0.0) for value in check_list(
            section.get('speeds'), 'recorded.speeds'))
        intervals = check_mapping(section.get('intervals') or {}, 'recorded.intervals',
                                  (*LINE, 'inertia', 'transition'))
        return cls(speeds, {name: check_interval(ends, f'recorded.intervals.{name}')
                            for name, ends in intervals.items()})

    def faster(self, speed: np.ndarray) -> str:
        """Return a note if much of a motion with these speeds, rad/s, is faster than the recorded.

        Like other effects, friction is believed for a quarter of the range beyond it.
        """
        if not self.speeds or not len(speed):
            return ''
        share = float(np.mean(np.abs(speed) > _BEYOND * self.speeds[-1]))
        return '' if share < _FASTER else (
            f'{100.0 * share:.0f} % of this motion is faster than {_BEYOND * self.speeds[-1]:.3g} '
            f'rad/s, and the model was fitted to speeds of up to {self.speeds[-1]:.3g} rad/s: '
            'friction is extrapolated, and the error may be larger than the report expects')

    def interval(self, name: str, value: float) -> tuple[float, float] | None:
        """Return a parameter's interval; None if it does not hold the value, as after a change."""
        low, high = self.intervals.get(name, (math.nan, math.nan))
        return (low, high) if low <= value <= high else None
