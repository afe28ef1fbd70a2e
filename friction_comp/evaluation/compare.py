# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares conditions over their repetitions and from day to day, with confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import date
from itertools import combinations
import math
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.evaluation.repetitions import Compensation, FIGURES, Repetition
from friction_comp.statistics import CONFIDENCE, holm, student_quantile

# Compared where they are known, the trend is of the first; the first two need a torque sensor.
COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'announcement_to_motion', 'onset',
            'smoothness')
_SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Interval:
    """An estimate with the ends of its 95 % interval, None for a single value."""

    mean: float
    low: float | None
    high: float | None
    count: int

    @classmethod
    def around(cls, mean: float, half: float, count: int) -> Interval:
        """Return the interval with half of its width given."""
        return cls(mean, mean - half, mean + half, count)

    @property
    def half(self) -> float | None:
        """Half the width of the interval."""
        return None if self.low is None or self.high is None else 0.5 * (self.high - self.low)

    def as_dict(self) -> dict[str, float | int | None]:
        """Return the entry of report.json."""
        return asdict(self)


def mean_interval(values: Sequence[float]) -> Interval:
    """Return the mean of one or more values with its interval from Student's t."""
    count, mean = len(values), float(np.mean(values))
    if count < 2:
        return Interval(mean, None, None, count)
    half = student_quantile(count - 1) * np.std(values, ddof=1) / np.sqrt(count)
    return Interval.around(mean, float(half), count)


def share_interval(hits: int, count: int) -> Interval:
    """Return the share of hits in `count` with Wilson's interval."""
    ends = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method='wilson')
    return Interval(hits / count, float(ends.low), float(ends.high), count)


@dataclass
class Comparison:
    """One figure under two conditions, by pairs of their n-th repetitions of a movement."""

    figure: str  # a name in `FIGURES`
    first: Compensation
    second: Compensation
    pairs: int  # number of pairs
    mean_first: float  # over the pairs
    mean_second: float
    difference: Interval  # second minus first
    # p-value of Wilcoxon's signed-rank test, with Holm's correction; None for fewer than five
    # pairs.
    p_value: float | None

    @property
    def significant(self) -> bool:
        """Whether the difference is statistically significant."""
        return self.p_value is not None and self.p_value < _SIGNIFICANT

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1],
            'first': self.first.as_dict(), 'second': self.second.as_dict(), 'pairs': self.pairs,
            'mean_first': self.mean_first, 'mean_second': self.mean_second,
            'difference': self.difference.as_dict(), 'p_value': self.p_value}


def _is_informative(first: Compensation, second: Compensation, baseline: Compensation) -> bool:
    """Return whether comparing two conditions answers a question.

    These are: what any condition changes against the baseline, if that has no direction; what any
    condition changes against kinetic compensation with the same model; and what law, model or
    direction alone changes. Other differences in several respects answer no question.
    """
    return ((first == baseline and not first.uses_direction)
            or (first.law == 'kinetic' and first.model == second.model)
            or sum((first.law != second.law, first.model != second.model,
                    first.announced != second.announced)) == 1)


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions with the same movements, where the comparison `_is_informative`.

    Conditions are ordered from no compensation over compensation without a direction to
    compensation with one; each is `first` against those that follow.
    """
    groups = _by_condition(repetitions)
    ordered = sorted(groups, key=lambda condition: (
        condition.uses_direction, condition.law != 'none', condition))
    comparisons = []
    for first, second in combinations(ordered, 2):
        if not _is_informative(first, second, ordered[0]):
            continue
        pairs = [pair for sign in (1, -1) for pair in zip(*(
            [r.figures for r in groups[condition] if r.movement.sign == sign]
            for condition in (first, second)))]
        for figure in COMPARED:
            values = np.array([(a[figure], b[figure]) for a, b in pairs
                               if figure in a and figure in b])
            if len(values):
                comparisons.append(_compare_values(figure, first, second, values))
    for figure in COMPARED:
        tested = [c for c in comparisons if c.figure == figure and c.p_value is not None]
        for comparison, p_value in zip(tested, holm([c.p_value or 0.0 for c in tested])):
            comparison.p_value = float(p_value)
    return comparisons


def _by_condition(repetitions: Sequence[Repetition]) -> dict[Compensation, list[Repetition]]:
    groups: dict[Compensation, list[Repetition]] = {}
    for repetition in repetitions:
        groups.setdefault(repetition.compensation, []).append(repetition)
    return groups


def _compare_values(figure: str, first: Compensation, second: Compensation, values: np.ndarray
                    ) -> Comparison:
    difference = values[:, 1] - values[:, 0]
    p_value = None
    if len(values) >= 5:
        p_value = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
    before, after = values.mean(axis=0)
    return Comparison(figure, first, second, len(values), float(before), float(after),
                      mean_interval(difference.tolist()), p_value)


def effect_size(comparison: Comparison) -> Interval | None:
    """Return Cohen's d_z with the interval of Hedges and Olkin (1985); None without scatter."""
    difference, count = comparison.difference, comparison.pairs
    if not difference.half:
        return None
    size = difference.mean / (difference.half * math.sqrt(count)) * student_quantile(count - 1)
    half = float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) * math.sqrt(
        1.0 / count + size ** 2 / (2.0 * count))
    return Interval.around(size, half, count)


@dataclass
class Trend:
    """One figure under one condition by day."""

    figure: str  # a name in `FIGURES`
    compensation: Compensation
    days: dict[str, Interval]  # mean over the day's repetitions, by ISO date
    # Slope through the daily means, None for fewer than three days.
    per_week: Interval | None
    p_value: float | None  # of the slope

    @property
    def significant(self) -> bool:
        """Whether the slope is statistically significant."""
        return self.p_value is not None and self.p_value < _SIGNIFICANT

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1], **self.compensation.as_dict(),
            'days': {day: value.as_dict() for day, value in self.days.items()},
            'per_week': self.per_week.as_dict() if self.per_week else None,
            'p_value': self.p_value}


def trends(repetitions: Sequence[Repetition]) -> list[Trend]:
    """Return the trend of each condition's leading figure; empty for repetitions of one day."""
    dated = [r for r in repetitions if r.day]
    if len({r.day for r in dated}) < 2:
        return []
    return [_trend(condition, group) for condition, group in sorted(_by_condition(dated).items())]


def _trend(condition: Compensation, repetitions: list[Repetition]) -> Trend:
    figure = next((name for name in COMPARED if any(name in r.figures for r in repetitions)),
                  'smoothness')
    values: dict[str, list[float]] = {}
    for repetition in repetitions:
        if figure in repetition.figures:
            values.setdefault(repetition.day, []).append(repetition.figures[figure])
    days = {day: mean_interval(values[day]) for day in sorted(values)}
    if len(days) < 3:
        return Trend(figure, condition, days, None, None)
    weeks = np.array([date.fromisoformat(day).toordinal() for day in days]) / 7.0
    line = stats.linregress(weeks, [value.mean for value in days.values()])
    slope = Interval.around(
        float(line.slope), student_quantile(len(days) - 2) * float(line.stderr), len(days))
    return Trend(figure, condition, days, slope, float(line.pvalue))
