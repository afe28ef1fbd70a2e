# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The spread of one parameter over units by a random-effects model, and the units outside of it.

A recording's value is that of the population, plus a deviation of the unit, one of the day, and an
error of measurement. Only the last is known; the others follow from how much more units, and a
unit's recordings, differ than their errors explain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.statistics import CONFIDENCE, student_quantile, student_tail

# Fewest units that tell something about their spread, and the largest share of them that may be
# out: with more, they are no exceptions.
FEWEST_UNITS, _LARGEST_SHARE = 4, 0.25
_TINY = 1e-300


@dataclass(frozen=True)
class Values:
    """A parameter's values, one for each of N units, with standard errors."""

    value: np.ndarray  # (N,)
    error: np.ndarray  # (N,): of measurement, from recording to recording included
    freedom: np.ndarray  # (N,): degrees of freedom of the error

    @property
    def variance(self) -> np.ndarray:
        """Variances of measurement whose inverse is unbiased, (N,)."""
        return self.error ** 2 * self.freedom / np.maximum(self.freedom - 2.0, 1.0)


@dataclass(frozen=True)
class Spread:
    """The population of a parameter, without the units that are out, as it is compared."""

    mean: float
    mean_error: float
    deviation: float  # standard deviation between units
    interval: tuple[float, float]  # of the deviation
    p_out: np.ndarray  # (N,): probability of such a value of a unit of the population
    out: np.ndarray  # (N,): which units are out

    @property
    def half_range(self) -> float:
        """Half the range in which 95 % of further units lie."""
        freedom = max(int((~self.out).sum()) - 2, 1)
        return float(student_quantile(freedom)) * math.hypot(self.deviation, self.mean_error)


def units_from_recordings(values: np.ndarray, errors: np.ndarray, unit: np.ndarray,
                          freedom: float) -> Values:
    """Return the value of each unit from those of its recordings, all of shape (R,).

    `errors` are standard errors, with `freedom` degrees of freedom each, and `unit` is the index of
    each recording's unit. How much a unit's recordings differ beyond their errors, for instance
    because of temperature, is assumed to be the same for all units. Where no unit has several
    recordings, it is part of the spread between units.
    """
    count, repeated = int(unit.max()) + 1, len(values) - len(np.unique(unit))

    def means(variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weights = np.bincount(unit, 1.0 / variance, count)
        return np.bincount(unit, values / variance, count) / weights, weights

    def excess(between: float) -> float:
        variance = between + errors ** 2
        return float(np.sum((values - means(variance)[0][unit]) ** 2 / variance)) - repeated
    day = _root(excess, values) if repeated else 0.0
    middle, weights = means(day + errors ** 2)
    # Welch and Satterthwaite, for the sum of a variance of the day and one of measurement.
    own = errors ** 2
    parts = day ** 2 / max(repeated, 1) + own ** 2 / freedom
    share = np.bincount(unit, parts, count) / np.bincount(unit, (day + own) ** 2, count)
    # The variance of the day is common to all units: more recordings of one tell no more of it.
    recordings = np.ones(count) if day > 0.0 else np.bincount(unit, minlength=count)
    return Values(middle, 1.0 / np.sqrt(weights), recordings / np.maximum(share, _TINY))


def spread_of(units: Values, tests: int = 1) -> Spread:
    """Return the spread over at least `FEWEST_UNITS` units, and which of them are out.

    The variance between units is that of Paule and Mandel, its interval the Q-profile (Viechtbauer
    2007). The units that are out are found by the generalised extreme Studentised deviate (Rosner
    1983): the most extreme unit is removed again and again, and all that were removed up to the
    last significant one are out, so that several cannot hide each other. With `tests` parameters,
    5 % is the probability that any unit is called out in any of them although none is.
    """
    size, every = len(units.value), np.arange(len(units.value))
    inside, removed, significant = np.ones(size, dtype=bool), [], 0
    for k in range(int(_LARGEST_SHARE * size)):
        mean, _, variance = _population(units, inside)
        index = int(np.argmax(np.where(
            inside, (units.value - mean) ** 2 / (units.variance + variance + _TINY), -1.0)))
        inside[index] = False
        removed.append(index)
        if _p_outside(units, inside, index) * (size - k) < (1.0 - CONFIDENCE) / tests:
            significant = k + 1
    out = np.isin(every, removed[:significant])
    mean, mean_error, variance = _population(units, ~out)
    p_values = np.array([_p_outside(units, ~out & (every != k), k) for k in range(size)])
    return Spread(mean=mean, mean_error=mean_error, deviation=math.sqrt(variance),
                  interval=_profile(units, ~out), p_out=p_values, out=out)


def _root(excess: Callable[[float], float], values: np.ndarray) -> float:
    """Return the variance at which a decreasing function is zero, 0 where it begins below."""
    from scipy.optimize import brentq

    high = 4.0 * float(np.var(values)) + _TINY
    if excess(0.0) <= 0.0:
        return 0.0
    while excess(high) > 0.0:
        high *= 4.0
    return float(brentq(excess, 0.0, high, xtol=1e-9 * high))


def _weighted_squares(value: np.ndarray, variance: np.ndarray) -> float:
    mean = np.sum(value / variance) / np.sum(1.0 / variance)
    return float(np.sum((value - mean) ** 2 / variance))


def _population(units: Values, chosen: np.ndarray) -> tuple[float, float, float]:
    """Return mean, its standard error, and variance between units, after Paule and Mandel."""
    value, own = units.value[chosen], units.variance[chosen]
    between = _root(lambda variance: _weighted_squares(value, own + variance) - (len(value) - 1),
                    value)
    weights = 1.0 / (own + between)
    return float(weights @ value / weights.sum()), float(weights.sum() ** -0.5), between


def _profile(units: Values, chosen: np.ndarray) -> tuple[float, float]:
    """Return the interval of the standard deviation between the chosen units."""
    from scipy.special import chdtri

    value, own = units.value[chosen], units.variance[chosen]

    def end(share: float) -> float:
        limit = float(chdtri(len(value) - 1, share))
        return math.sqrt(_root(
            lambda variance: _weighted_squares(value, own + variance) - limit, value))
    return end(0.5 - 0.5 * CONFIDENCE), end(0.5 + 0.5 * CONFIDENCE)


def _p_outside(units: Values, chosen: np.ndarray, index: int) -> float:
    """Return the probability of a unit's deviation from the population of the chosen others.

    Its degrees of freedom are those of the variance between units plus the unit's own.
    """
    mean, error, between = _population(units, chosen)
    own = units.variance
    total = own[index] + between + error ** 2 + _TINY
    common = float(np.median(own[chosen]) + between) ** 2 / max(int(chosen.sum()) - 1, 1)
    freedom = total ** 2 / (common + own[index] ** 2 / units.freedom[index] + _TINY)
    return student_tail((units.value[index] - mean) / math.sqrt(total), freedom)
