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
from scipy import optimize, stats

# Degree of confidence of all intervals.
LEVEL = 0.95
# Fewest units that tell something about their spread, and the largest share of them that may be
# out: with more, they are no exceptions.
FEWEST_UNITS, _LARGEST_SHARE = 4, 0.25


@dataclass(frozen=True)
class Values:
    """A parameter's values, one for each of N units, with standard errors."""

    value: np.ndarray  # (N,)
    error: np.ndarray  # (N,): of measurement, from recording to recording included
    freedom: np.ndarray  # (N,): degrees of freedom of the error


@dataclass(frozen=True)
class Spread:
    """The population of a parameter, without the units that are out.

    All figures are on the scale on which the parameter is compared.
    """

    mean: float
    mean_error: float
    deviation: float  # standard deviation between units
    interval: tuple[float, float]  # of the deviation
    p_same: float  # probability of such differences if all units were the same
    p_out: np.ndarray  # (N,): of such a value of a unit of the population
    out: np.ndarray  # (N,): which units are out

    def range(self, count: int) -> tuple[float, float]:
        """Return the range of a further unit's value, from a population of `count` units."""
        half = float(stats.t.ppf(0.5 + 0.5 * LEVEL, max(count - 2, 1))) * math.hypot(
            self.deviation, self.mean_error)
        return self.mean - half, self.mean + half


def units_from_recordings(values: np.ndarray, errors: np.ndarray, unit: np.ndarray,
                          freedom: float) -> Values:
    """Return the value of each unit from those of its recordings.

    Parameters
    ----------
    values, errors : ndarray, shape (R,)
        Of each recording, with its standard error.
    unit : ndarray of int, shape (R,)
        Index of the unit of each recording.
    freedom : float
        Degrees of freedom of each error.

    Notes
    -----
    How much a unit's recordings differ beyond their errors, for instance because of temperature, is
    assumed to be the same for all units. Where no unit has several recordings, it is part of the
    spread between units.
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
    recordings = np.bincount(unit, minlength=count)
    # The variance of the day is common to all units: more recordings of one tell no more of it.
    return Values(middle, 1.0 / np.sqrt(weights),
                  np.where(day > 0.0, 1.0, recordings) / np.maximum(share, 1e-300))


def spread_of(units: Values, tests: int = 1) -> Spread:
    """Return the spread over units, and which of them are out.

    Parameters
    ----------
    units : Values
        At least `FEWEST_UNITS`.
    tests : int
        How many parameters are tested together: 5 % is the probability that any unit is called out
        in any of them although none is.

    Notes
    -----
    The variance between units is that of Paule and Mandel, its interval the Q-profile [1]_. The
    units that are out are found by the generalised extreme Studentised deviate [2]_: the most
    extreme unit is removed again and again, and all that were removed up to the last significant
    one are out, so that several cannot hide each other. Whether units differ at all is Welch's
    analysis of variance [3]_.

    References
    ----------
    .. [1] W. Viechtbauer, Statistics in Medicine 26(1), 2007.
    .. [2] B. Rosner, Technometrics 25(2), 1983.
    .. [3] B. L. Welch, Biometrika 38, 1951.
    """
    size = len(units.value)
    inside = np.ones(size, dtype=bool)
    removed: list[int] = []
    significant = 0
    for k in range(int(_LARGEST_SHARE * size)):
        p_values = np.where(inside, _p_values(units, inside), np.inf)
        index = int(np.argmin(p_values))
        if p_values[index] * (size - k) < (1.0 - LEVEL) / tests:
            significant = k + 1
        inside[index] = False
        removed.append(index)
    out = np.zeros(size, dtype=bool)
    out[removed[:significant]] = True
    mean, mean_error, variance = _population(units, ~out)
    return Spread(mean, mean_error, math.sqrt(variance), _profile(units, ~out),
                  _p_same(units, ~out), _p_outside(units, ~out), out)


def _variances(units: Values) -> np.ndarray:
    """Return variances of measurement whose inverse is unbiased."""
    return units.error ** 2 * units.freedom / np.maximum(units.freedom - 2.0, 1.0)


def _root(excess: Callable[[float], float], values: np.ndarray) -> float:
    """Return the variance at which a decreasing function is zero, 0 where it begins below."""
    high = 4.0 * float(np.var(values)) + 1e-300
    if excess(0.0) <= 0.0:
        return 0.0
    while excess(high) > 0.0:
        high *= 4.0
    return float(optimize.brentq(excess, 0.0, high, xtol=1e-9 * high))


def _weighted_squares(value: np.ndarray, variance: np.ndarray) -> float:
    mean = np.sum(value / variance) / np.sum(1.0 / variance)
    return float(np.sum((value - mean) ** 2 / variance))


def _population(units: Values, chosen: np.ndarray) -> tuple[float, float, float]:
    """Return mean, its standard error, and the variance between the chosen units."""
    value, own = units.value[chosen], _variances(units)[chosen]
    between = _root(lambda variance: _weighted_squares(value, own + variance) - (len(value) - 1),
                    value)
    weights = 1.0 / (own + between)
    return (float(weights @ value / weights.sum()), float(weights.sum() ** -0.5), between)


def _profile(units: Values, chosen: np.ndarray) -> tuple[float, float]:
    """Return the interval of the standard deviation between the chosen units."""
    value, own = units.value[chosen], _variances(units)[chosen]
    low, high = (
        _root(lambda variance, limit=limit: _weighted_squares(value, own + variance) - limit, value)
        for limit in stats.chi2.ppf([0.5 + 0.5 * LEVEL, 0.5 - 0.5 * LEVEL], len(value) - 1))
    return math.sqrt(low), math.sqrt(high)


def _p_values(units: Values, inside: np.ndarray) -> np.ndarray:
    """Return the probability of each unit's deviation from a population that includes it."""
    mean, _, between = _population(units, inside)
    count = int(inside.sum())
    total = _variances(units) + between
    squares = (units.value - mean) ** 2 / np.maximum(total, 1e-300)
    # The unit is a part of mean and variance; of all deviations none is larger than the limit.
    rest = (count - 1) ** 2 / count - squares
    t = np.sqrt(np.where(rest > 0.0, (count - 2) * squares / np.maximum(rest, 1e-12), np.inf))
    return np.asarray(2.0 * stats.t.sf(t, _freedom(units, between, inside)))


def _p_outside(units: Values, chosen: np.ndarray) -> np.ndarray:
    """Return the probability of each unit's deviation from the population of the chosen ones."""
    mean, error, between = _population(units, chosen)
    inside = _p_values(units, chosen)
    t = np.abs(units.value - mean) / np.sqrt(_variances(units) + between + error ** 2 + 1e-300)
    other = 2.0 * stats.t.sf(t, _freedom(units, between, chosen))
    return np.where(chosen, inside, other)


def _freedom(units: Values, between: float, inside: np.ndarray) -> np.ndarray:
    """Return the degrees of freedom of a variance between units plus one of measurement.

    The one between units is as uncertain as the deviations of all chosen units make it.
    """
    total = _variances(units) + between + 1e-300
    common = float(np.mean(total[inside])) ** 2 / max(int(inside.sum()) - 2, 1)
    return np.asarray(total ** 2 / (common + _variances(units) ** 2 / units.freedom))


def _p_same(units: Values, chosen: np.ndarray) -> float:
    """Return the probability of such differences between the chosen units if they were equal."""
    value, own = units.value[chosen], np.maximum(units.error[chosen] ** 2, 1e-300)
    count, weights = len(value), 1.0 / own
    spare = float(np.sum((1.0 - weights / weights.sum()) ** 2 / units.freedom[chosen]))
    ratio = _weighted_squares(value, own) / (count - 1) / (
        1.0 + 2.0 * (count - 2) / (count ** 2 - 1) * spare)
    return float(stats.f.sf(ratio, count - 1, (count ** 2 - 1) / max(3.0 * spare, 1e-300)))

