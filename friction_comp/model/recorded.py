# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a model file keeps of the recordings that the model was fitted to."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from friction_comp.checks import check_list, check_mapping, check_number
from friction_comp.errors import InputError

LINE = ('offset', 'coulomb', 'viscous')
"""Parameters of the line, in A, A and A·s/rad."""


@dataclass(frozen=True)
class Recorded:
    """What a model file keeps of the recordings it was fitted to."""

    speeds: tuple[float, ...] = ()  # quantiles of the speed in motion, rad/s, the lowest first
    # 95 % intervals by parameter, in the model's unit of current, of `LINE`, inertia, transition.
    intervals: tuple[tuple[str, tuple[float, float]], ...] = ()

    @classmethod
    def from_dict(cls, section: Any) -> Recorded:
        """Read the section `recorded` of a model file."""
        check_mapping(section, 'recorded', ('speeds', 'intervals'))
        speeds = tuple(check_number(value, 'recorded.speeds', above=0.0) for value in check_list(
            section.get('speeds'), 'recorded.speeds'))
        intervals = []
        known = (*LINE, 'inertia', 'transition')
        for name, ends in check_mapping(
                section.get('intervals') or {}, 'recorded.intervals', known).items():
            low, high = _two(ends, f'recorded.intervals.{name}')
            intervals.append((name, (low, high)))
        return cls(speeds, tuple(intervals))

    def to_dict(self) -> dict[str, Any]:
        """Return the section as plain values."""
        return {'speeds': list(self.speeds),
                'intervals': {name: list(ends) for name, ends in self.intervals}}

    def interval(self, name: str, value: float) -> tuple[float, float] | None:
        """Return a parameter's interval; None where it is unknown, or does not hold the value.

        A model that was changed after the fit has other values than its intervals.
        """
        low, high = dict(self.intervals).get(name, (math.nan, math.nan))
        return (low, high) if low <= value <= high else None


def _two(ends: Any, name: str) -> tuple[float, float]:
    values = [check_number(end, name) for end in check_list(ends, name)]
    if len(values) != 2 or values[0] > values[1]:
        raise InputError(f'{name} must be two numbers, the lower one first')
    return values[0], values[1]
