# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers that come from outside, checked in one place and refused in one wording."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import Any

from friction_comp.errors import InputError


def check_number(value: Any, name: str, *, above: float = -math.inf, least: float = -math.inf,
                 most: float = math.inf) -> float:
    """Return a number from outside as a float.

    Parameters
    ----------
    value : object
        What was given; True and False are no numbers.
    name : str
        What to call it in the error.
    above, least, most : float
        Bounds: the first excluded, the others included.

    Raises
    ------
    InputError
        If it is no number, not finite, or out of bounds.
    """
    if (isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
            and above < float(value) and least <= float(value) <= most):
        return float(value)
    raise InputError(
        f'{name} must be a {_wanted("finite number", above, least, most)}, not {value!r}')


def check_whole_number(value: Any, name: str, *, least: float = -math.inf,
                       most: float = math.inf) -> int:
    """Return a whole number from outside; parameters and errors are those of `check_number`."""
    if isinstance(value, Integral) and not isinstance(value, bool) and least <= int(value) <= most:
        return int(value)
    raise InputError(
        f'{name} must be a {_wanted("whole number", -math.inf, least, most)}, not {value!r}')


def _wanted(kind: str, above: float, least: float, most: float) -> str:
    if above == 0.0 and most == math.inf:
        return f'positive {kind}'
    words = kind
    if above > -math.inf:
        words += f' above {above:g}'
    if least > -math.inf:
        words += f' from {least:.15g}'
    if most < math.inf:
        words += f' to {most:.15g}' if least > -math.inf else f' of at most {most:.15g}'
    return words
