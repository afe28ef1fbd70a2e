# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The range in which an effect is valid; beyond it the effect keeps its value at the edge."""

from __future__ import annotations

from collections.abc import Collection
import copy
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.checks import check_number
from friction_comp.errors import InputError

if TYPE_CHECKING:
    from friction_comp.model.effects.base import Effect
    from friction_comp.samples import Samples

# Percentage of the samples below the low edge and above the high one: a few outlying values are
# sensor errors, not a range that was moved through.
_TAIL = 0.1


def checked_range(ranges: Any, held: Collection[str]) -> dict[str, tuple[float, float]]:
    """Return the lowest and highest value by signal of an effect's entry in a model file."""
    if ranges is None:
        return {}
    if not isinstance(ranges, dict) or not set(ranges) <= set(held):
        raise InputError(f'valid_range must be a mapping of {", ".join(held) or "nothing"}, '
                         f'not {ranges!r}')
    checked = {}
    for name, ends in ranges.items():
        if not isinstance(ends, (list, tuple)) or len(ends) != 2:
            raise InputError(f'valid_range.{name} must be two numbers, the lower one first')
        low, high = (check_number(end, f'valid_range.{name}') for end in ends)
        if low > high:
            raise InputError(f'valid_range.{name} must have the lower number first')
        checked[name] = (low, high)
    return checked


def with_range(effect: Effect, samples: Samples) -> Effect:
    """Return an effect with the range in which samples with velocity show it, and some more."""
    if not effect.held:
        return effect
    ranges = {}
    for name, beyond in effect.held.items():
        values = getattr(samples, name)
        if values is not None and len(values):
            low, high = np.percentile(values, (_TAIL, 100.0 - _TAIL))
            more = beyond * (high - low)
            ranges[name] = (float(low - more), float(high + more))
    twin = copy.copy(effect)
    twin.valid_range = ranges
    return twin


def inside(samples: Samples, ranges: dict[str, tuple[float, float]]) -> Samples:
    """Return samples whose signals stay at the edge of a range where they are beyond it."""
    known = {name: np.clip(getattr(samples, name), *ends) for name, ends in ranges.items()
             if getattr(samples, name) is not None}
    return samples.with_(**known) if known else samples
