# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the values of a column tell of its unit, where neither its name nor the user gives one.

Friction in a wrong unit of position or time fits a recording as well as in the right one. So what
values tell against rad and s is asked, and what is taken for granted stands beside the results.
"""

from __future__ import annotations

import math

import numpy as np

from friction_comp.statistics import rms, smallest_step
from friction_comp.units import unit_factor

# Turns of units other than rad: values wrap around at them, and encoders divide them.
_TURNS = {'turn': 1.0, 'deg': 360.0}
# Bits of encoders; more are rounding errors of floating-point numbers.
_BITS = range(8, 21)
# Distance of values from the steps of an encoder, in steps, RMS: on them if below the first; values
# that are not on them have 0.29.
_ON_GRID, _OFF_GRID = 0.05, 0.2
# Steps that values must cover, so that the sizes of steps of two units cannot be confused.
_FEWEST_STEPS = 100
# Dates of recordings, s since 1970: 1990 to 2040; and the times between two rows of one, s.
_DATES, _ROWS = (6.3e8, 2.2e9), (1e-6, 1.0)
# Shortest time from row to row that the states of a joint have, on average, s.
_SHORTEST = 1e-5
# A weight in another unit must leave so much less than one in rad, and than none, of the variance.
_LESS = 0.25
# Time over which rates are averaged before accelerations are compared, s.
_SMOOTHING = 0.05
_UNITS_OF_TIME = {'s': 1.0, 'ms': 1e-3, 'µs': 1e-6, 'ns': 1e-9}


def angle_fault(position: np.ndarray) -> str:
    """Return what tells that positions, shape (N,), are not in rad; '' if nothing does."""
    position = position[np.isfinite(position)]
    if len(position) < _FEWEST_STEPS:
        return ''
    size = np.abs(np.diff(position))
    for unit, turn in _TURNS.items():
        around = np.ptp(position) <= 1.001 * turn and size.max() > 0.9 * turn
        if around and np.quantile(size, 0.9) < 0.05 * turn:
            return f'jumps by {turn:g}, as an angle in {unit} that wraps around'
    if _distance(position, 2.0 * math.pi) < _OFF_GRID:
        return ''
    for unit, turn in _TURNS.items():
        if _distance(position, turn) < _ON_GRID:
            return (f'moves in steps of {smallest_step(position):.6g}, a turn divided by a power '
                    f'of two if it is in {unit}')
    return ''


def _distance(position: np.ndarray, turn: float) -> float:
    """Return how far values are from the steps of an encoder, in steps, RMS; 0.5 without steps."""
    step = smallest_step(position)
    bits = round(math.log2(turn / step)) if step else 0
    if bits not in _BITS or abs(step * 2.0 ** bits / turn - 1.0) > 0.02:
        return 0.5
    steps = (position - position[0]) * 2.0 ** bits / turn
    if np.ptp(steps) <= _FEWEST_STEPS:
        return 0.5
    return rms(steps - np.round(steps))


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


def rate_fault(time: np.ndarray, unit: str) -> str:
    """Return what tells that times, shape (N,), are not in the unit that their name says, or in s.

    It is '' if nothing does.
    """
    time = time[np.isfinite(time)]
    mean = float(np.ptp(time)) / (len(time) - 1) if len(time) > 1 else 0.0
    if not 0.0 < mean * unit_factor('time', unit) < _SHORTEST:
        return ''
    other = next(other for other in reversed(_UNITS_OF_TIME) if (
        other == 's' or _UNITS_OF_TIME[other] * mean >= _SHORTEST))
    return (f'has rows {mean:.3g} apart, too close to be {unit}: give its unit, for instance '
            f'--unit time={other}, or time={unit}')


def time_fault(time: np.ndarray) -> str:
    """Return what tells that times, shape (N,), are not in s; '' if nothing does."""
    steps = np.diff(time[np.isfinite(time)])
    # Half of the rows or more share their time with others if times are rounded to seconds.
    usual = float(np.median(steps)) if steps.size else 0.0
    if usual < _ROWS[1]:
        return ''
    unit = next((unit for unit, factor in _UNITS_OF_TIME.items() if factor * usual < _ROWS[1]),
                'ns')
    return (f'has rows {usual:.3g} apart, which show no motion if these are seconds: give its '
            f'unit, for instance --unit time={unit}, or time=s')
