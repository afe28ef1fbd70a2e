# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the values of a column tell of its unit, where neither its name nor the user gives one.

Friction in a wrong unit of position or time fits a recording as well as in the right one. So what
values tell against rad and s is asked, and what is taken for granted stands beside the results.
"""

from __future__ import annotations

import math

import numpy as np

# Turns of units other than rad.
_TURNS = {'turn': 1.0, 'deg': 360.0}
# Dates of recordings, s since 1970: 1990 to 2040; and the times between two rows of one, s.
_DATES, _ROWS = (6.3e8, 2.2e9), (1e-6, 1.0)
# A weight in another unit must leave so much less than one in rad, and than none, of the variance.
_LESS = 0.25
# Time over which rates are averaged before accelerations are compared, s.
_SMOOTHING = 0.05
_UNITS_OF_TIME = {'s': 1.0, 'ms': 1e-3, 'µs': 1e-6, 'ns': 1e-9}


def unit_of_weight(time: np.ndarray, position: np.ndarray, effort: np.ndarray) -> str:
    """Return the unit in which a link's weight repeats every turn and explains the effort.

    It is '' where a weight in rad does as well, or none shows. Signals have shape (N,).
    """
    half = max(round(0.5 * _SMOOTHING / max(float(np.median(np.diff(time))), 1e-6)), 1)
    average = np.full(2 * half + 1, 1.0 / (2 * half + 1))
    velocity = np.convolve(np.gradient(position, time), average, 'same')
    # A spring, in proportion to position, tells no unit.
    base = [velocity, np.sign(velocity), np.gradient(velocity, time), position,
            np.ones_like(time)]

    def unexplained(*weight: np.ndarray) -> float:
        """Return the variance of effort that remains, without the ends, which have no average."""
        columns = np.column_stack([*base, *weight])[half:-half]
        coefficients = np.linalg.lstsq(columns, effort[half:-half], rcond=None)[0]
        return float(np.var(effort[half:-half] - columns @ coefficients))

    def with_weight(turn: float) -> float:
        angle = position * (2.0 * math.pi / turn)
        return unexplained(np.sin(angle), np.cos(angle))

    variances = {unit: with_weight(turn) for unit, turn in _TURNS.items()}
    best = min(variances, key=lambda unit: variances[unit])
    least = min(unexplained(), with_weight(2.0 * math.pi))
    return best if variances[best] < _LESS * least else ''


def unit_of_dates(time: np.ndarray) -> str:
    """Return the unit in which times, shape (N,), are dates; '' if none is a plausible one."""
    time = time[np.isfinite(time)]
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    for unit, factor in _UNITS_OF_TIME.items():
        if (time.size and steps.size and _DATES[0] < factor * np.median(time) < _DATES[1]
                and _ROWS[0] < factor * np.median(steps) < _ROWS[1]):
            return unit
    return ''
