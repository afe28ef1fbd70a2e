# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares conditions over their repetitions, with confidence intervals.

Repetitions are no independent draws: a person tires, and is for a while stronger or weaker. How
alike neighbours are a few repetitions cannot tell, so every correlation counts by its likelihood.
What fewer than `FEWEST` repetitions show has no interval, and is not tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations, pairwise
import math
from typing import Any

import numpy as np

from friction_comp.evaluation.repetitions import Compensation, FIGURES, ODD, Repetition
from friction_comp.statistics import CONFIDENCE, holm, student_quantile, student_tail

FEWEST = 5
"""Repetitions below which nothing is said of chance."""
# Compared where they are known; the first two need a torque sensor.
_COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'onset')
# A condition scatters no less than this share of both together.
_LEAST_SCATTER = 1e-3
# Correlations of neighbouring repetitions, and how likely they are before any was seen: strong ones
# are rare.
_CORRELATIONS = np.arange(0.0, 0.95, 0.1)
_PRIOR = (1.0 - _CORRELATIONS) ** 1.5
# Share of the values' RMS below which their scatter is rounding, and a square that counts where
# values do not scatter at all, as those of a dead sensor.
_ROUNDING, _NOTHING = 1e-9, 1e-100


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval, None where it is not known."""

    mean: float
    low: float | None
    high: float | None
    count: int

    @property
    def half(self) -> float | None:
        """Half the width of the interval."""
        return None if self.low is None or self.high is None else 0.5 * (self.high - self.low)

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the entry of report.json."""
        return asdict(self)


def mean_interval(values: Sequence[float], order: Sequence[float] | None = None) -> Interval:
    """Return the mean of one or more values with its interval, if they are enough.

    `order` are the values' places in time, ascending; they follow each other without it.
    """
    count, mean = len(values), float(np.mean(values))
    if count < FEWEST:
        return Interval(mean, None, None, count)
    place = np.arange(count) if order is None else np.asarray(order)
    error = standard_error(np.asarray(values), np.ones((count, 1)), place, np.ones(count))
    half = float(student_quantile(count - 1)) * error
    return Interval(mean, mean - half, mean + half, count)


def standard_error(values: np.ndarray, columns: np.ndarray, place: np.ndarray, scatter: np.ndarray
                   ) -> float:
    """Return the standard error of the first coefficient of a least-squares fit.

    `values` are of shape (N,), `columns` (N, P) with rank P < N. `place` (N,) are the values'
    places in time, ascending. Errors, in proportion to `scatter` (N,), are a process of first
    order, and the variance is its mean over all correlations, each by its restricted likelihood.
    """
    count, width = columns.shape
    weights = scatter * np.linalg.pinv(columns)[0]
    gaps = np.diff(place, prepend=-np.inf)
    even = np.column_stack((values, columns)) / scatter[:, np.newaxis]
    least = count * (_ROUNDING * float(np.sqrt(np.mean(even[:, 0] ** 2)))) ** 2 + _NOTHING
    likelihood, variance = [], []
    for correlation in _CORRELATIONS:
        # How alike a value is to the one before it: less that, in equal scale, they are white.
        alike = correlation ** gaps
        scale = 1.0 / np.sqrt(1.0 - alike ** 2)
        before = np.concatenate((np.zeros_like(even[:1]), even[:-1]))
        white = (even - alike[:, np.newaxis] * before) * scale[:, np.newaxis]
        # The last diagonal element is what the fit leaves.
        triangle = np.abs(np.diag(np.linalg.qr(np.roll(white, -1, axis=1), 'r')))
        square = max(float(triangle[-1] ** 2), least) / (count - width)
        likelihood.append(np.sum(np.log(scale)) - np.sum(np.log(triangle[:-1]))
                          - 0.5 * (count - width) * np.log(square))
        variance.append(square * _variance_of(weights, alike))
    share = _PRIOR * np.exp(np.array(likelihood) - max(likelihood))
    return float(np.sqrt(np.average(variance, weights=share)))


def _variance_of(weights: np.ndarray, alike: np.ndarray) -> float:
    """Return the variance of a weighted sum of a process of first order with variance 1."""
    total = carried = 0.0
    for k, weight in enumerate(weights.tolist()):
        carried = alike[k] * (carried + (weights[k - 1] if k else 0.0))
        total += weight * (weight + 2.0 * carried)
    return max(float(total), 0.0)


@dataclass
class Comparison:
    """One figure under two conditions, by movements of the same day and direction."""

    figure: str  # a name in `FIGURES`
    first: Compensation
    second: Compensation
    pairs: int  # number of pairs that such movements can form
    mean_first: float  # over the days and directions of the pairs
    mean_second: float
    without_drift: Interval     # second minus first, beside a steady change over each day's session
    p_value: float | None  # of Student's t, with Holm's correction; None where `untested`
    # Whether either condition also came after the other on one day. Else what changed in between,
    # and not steadily, is part of the difference.
    in_turn: bool
    untested: str = ''  # why there is no p-value

    @property
    def difference(self) -> float:
        """Second mean minus first mean."""
        return self.mean_second - self.mean_first

    @property
    def significant(self) -> bool:
        """Whether the difference is statistically significant."""
        return self.p_value is not None and self.p_value < 1.0 - CONFIDENCE

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1],
            'first': self.first.as_dict(), 'second': self.second.as_dict(), 'pairs': self.pairs,
            'mean_first': self.mean_first, 'mean_second': self.mean_second,
            'difference': self.difference, 'without_drift': self.without_drift.as_dict(),
            'p_value': self.p_value, 'in_turn': self.in_turn, 'untested': self.untested or None}


def _is_informative(first: Compensation, second: Compensation, baseline: Compensation) -> bool:
    """Return whether comparing two conditions answers a question.

    These are: what any condition changes against the baseline, if that has no direction; what any
    condition changes against kinetic compensation with the same model; and what law, model,
    settings or direction alone changes. Other differences in several respects answer no question.
    """
    compensated = 'none' not in (first.law, second.law)
    changes = (first.law != second.law, first.announced != second.announced,
               compensated and first.model != second.model,
               compensated and first.settings != second.settings)
    return ((first == baseline and not first.uses_direction)
            or (first.law == 'kinetic' and first.model == second.model) or sum(changes) == 1)


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions with the same movements, where the comparison `_is_informative`.

    `repetitions` are in order of time. Conditions are ordered from no compensation over
    compensation without a direction to compensation with one; each is `first` against those that
    follow.
    """
    ordered = sorted({r.compensation for r in repetitions}, key=lambda condition: (
        condition.uses_direction, condition.law != 'none', condition))
    comparisons = []
    for figure in _COMPARED:
        own = []
        for first, second in combinations(ordered, 2):
            signs = [{r.movement.sign for r in repetitions if r.compensation == condition
                      and figure in r.figures} for condition in (first, second)]
            both = signs[0] & signs[1]
            if both and _is_informative(first, second, ordered[0]):
                own.append(_compare(figure, first, second, [
                    r for r in repetitions if r.compensation in (first, second)
                    and figure in r.figures and r.movement.sign in both]))
        tested = [c for c in own if c.p_value is not None]
        for one, p_value in zip(tested, holm([c.p_value or 0.0 for c in tested])):
            one.p_value = float(p_value)
        comparisons += own
    return comparisons


def _compare(figure: str, first: Compensation, second: Compensation, repetitions: list[Repetition]
             ) -> Comparison:
    """Compare one figure of repetitions, in order of time, under two conditions.

    Least squares with a mean for each day and direction, the difference of the conditions, and a
    change with every repetition within a day.
    """
    values = np.array([r.figures[figure] for r in repetitions])
    is_second = np.array([r.compensation == second for r in repetitions])
    kinds = [(r.day, r.movement.sign) for r in repetitions]
    of_kind = np.array([[kind == one for one in dict.fromkeys(kinds)] for kind in kinds])
    pairs = np.minimum(of_kind[is_second].sum(axis=0), of_kind[~is_second].sum(axis=0))
    before, after = (_mean(values, own, of_kind, pairs) for own in (~is_second, is_second))
    changes = {(a.compensation == second, b.compensation == second)
               for a, b in pairwise(repetitions) if a.day == b.day}
    count = int(pairs.sum())
    comparison = Comparison(
        figure, first, second, pairs=count, mean_first=before, mean_second=after,
        without_drift=Interval(after - before, None, None, count), p_value=None,
        in_turn={(True, False), (False, True)} <= changes)
    place = np.array([r.place for r in repetitions])
    # Within each day, since days lie apart.
    since = place - of_kind @ (place @ of_kind / of_kind.sum(axis=0))
    columns = np.column_stack([is_second, since, of_kind]).astype(float)
    comparison.untested = _obstacle(count, repetitions, columns)
    if comparison.untested:
        return comparison
    scatter, freedom = _scatter(values, columns, is_second)
    change = float(np.linalg.pinv(columns)[0] @ values)
    error = standard_error(values, columns, place, scatter)
    half = float(student_quantile(freedom)) * error
    comparison.without_drift = Interval(change, change - half, change + half, count)
    lower = second if change < 0.0 else first
    if figure == 'peak_torque' and any(
            not r.moved for r in repetitions if r.compensation == lower):
        comparison.untested = ('the joint did not always move where the torque is lower, so that '
                               'it may not be')
    else:
        comparison.p_value = student_tail(change / error, freedom)
    return comparison


def _mean(values: np.ndarray, own: np.ndarray, of_kind: np.ndarray, pairs: np.ndarray) -> float:
    """Return a condition's mean over the days and directions of the pairs, else over its own."""
    chosen = own[:, np.newaxis] & of_kind
    count = chosen.sum(axis=0)
    weights = pairs if pairs.any() else count
    return float(np.average(values @ chosen / np.maximum(count, 1), weights=weights))


def _obstacle(pairs: int, repetitions: list[Repetition], columns: np.ndarray) -> str:
    """Return why two conditions cannot be tested against each other, '' if they can.

    `columns`, (N, M), are those fitted to the N values; the first is 1 for the second condition.
    """
    if not pairs:
        return ('they were recorded on different days, and what else changed from day to day is '
                'not known')
    # Durations and distances.
    sizes = np.log([(r.duration, r.movement.travel) for r in repetitions])
    is_second = columns[:, 0] > 0.0
    change = np.median(sizes[is_second], axis=0) - np.median(sizes[~is_second], axis=0)
    if (np.abs(change) > math.log(1.0 + ODD)).any():
        return "movements of one took longer or went farther than the other's"
    if (min(is_second.sum(), (~is_second).sum()) < FEWEST
            or np.linalg.matrix_rank(columns) < columns.shape[1]):
        return f'fewer than {FEWEST} repetitions of each may differ by chance'
    return ''


def _scatter(values: np.ndarray, columns: np.ndarray, is_second: np.ndarray
             ) -> tuple[np.ndarray, float]:
    """Return each value's scatter by its condition, (N,), and the freedom of the first coefficient.

    After Welch and Satterthwaite: of two conditions that scatter differently, a mean over both
    would trust the one with few repetitions too much.
    """
    weights = np.linalg.pinv(columns)
    square = (values - columns @ (weights @ values)) ** 2
    # Each condition loses degrees of freedom to the coefficients in proportion to its repetitions.
    share = 1.0 - columns.shape[1] / len(values)
    least = _LEAST_SCATTER ** 2 * float(square.mean()) + _NOTHING
    scatter, parts, freedoms = np.empty(len(values)), [], []
    for own in (is_second, ~is_second):
        freedoms.append(share * float(own.sum()))
        scatter[own] = math.sqrt(max(float(square[own].sum()) / freedoms[-1], least))
        parts.append(float(np.sum((weights[0] * scatter)[own] ** 2)))
    return scatter, sum(parts) ** 2 / sum(
        part ** 2 / freedom for part, freedom in zip(parts, freedoms))
