# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers, intervals and quantities as text, for people."""

from __future__ import annotations

from collections.abc import Sequence
import math
import re
from typing import TypeVar

import numpy as np

T = TypeVar('T')


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with few significant digits (thousands in full); a dash for None or NaN."""
    if value is None or math.isnan(value):
        return '–'
    if isinstance(value, (int, np.integer)):
        return str(value)
    if value == 0 or math.isinf(value):
        return f'{value:g}'
    magnitude = math.floor(math.log10(abs(value)))
    form = f'.{max(digits - 1 - magnitude, 0)}f' if -4 <= magnitude < 6 else f'.{digits - 1}e'
    return format(value, form).replace('-', '\u2212')


def interval_text(ends: Sequence[float | None]) -> str:
    """Return an interval as text."""
    low, high = ends
    if low is None or high is None:
        return 'not determined'
    return f'{number(low)} to {number(high)}'


def quantity(value: float, unit: str) -> str:
    """Return a number with its unit, small currents in mA, and a dash for NaN.

    Examples
    --------
    >>> quantity(0.0123, 'A')
    '12.3 mA'
    >>> quantity(0.0123, 'N·m')
    '0.0123 N·m'
    """
    if unit == 'A' and abs(value) < 0.1:
        value, unit = 1e3 * value, 'mA'
    return '–' if math.isnan(value) else f'{number(value)} {unit}'


def aligned(rows: Sequence[Sequence[str]], before: str = '') -> list[str]:
    """Return rows of text as lines whose columns begin below each other."""
    widths = [max(map(len, column)) for column in zip(*rows)]
    return [before + '  '.join(f'{text:<{width}}' for text, width in zip(row, widths)).rstrip()
            for row in rows]


def in_own_units(content: T, linear: bool) -> T:
    """Return text, or the texts of a report, with m and N instead of rad and N·m if `linear`."""
    if not linear:
        return content
    if isinstance(content, str):
        # Waves over a length are per metre, not per turn of 2π.
        text = re.sub(r'([\d.]+) times a turn', lambda match: (
            f'{float(match[1]) / (2.0 * math.pi):.4g} times a metre'), content)
        text = text.replace('kg·m²', 'kg').replace('N·m', 'N')
        return re.sub(r'\brad\b', 'm', text)  # type: ignore[return-value]
    if isinstance(content, dict):
        return {key: in_own_units(value, True)      # type: ignore[return-value]
                for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [in_own_units(value, True) for value in content]     # type: ignore[return-value]
    return content
