# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares conditions over their repetitions and from day to day, with confidence intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from itertools import combinations, pairwise
import math
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.evaluation.neighbours import first_coefficient, Interval, mean_interval, NOTHING
from friction_comp.evaluation.repetitions import Compensation, FIGURES, ODD, Repetition
from friction_comp.statistics import CONFIDENCE, holm, rms, student_quantile

# Compared where they are known, the trend is of the first; the first two need a torque sensor.
COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'announcement_to_motion', 'onset',
            'smoothness')
_SIGNIFICANT = 0.05
# Values beyond the coefficients that a test needs.
_LEAST_FREEDOM = 2
# A condition scatters no less than this share of both together.
_LEAST_SCATTER = 1e-3
# Of the values' RMS: standard deviation, before any was seen, of a steady change over a day's
# session.
_CHANGE = 0.3


def share_interval(hits: int, count: int) -> Interval:
    """Return the share of hits in `count` with Wilson's interval."""
    ends = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method='wilson')
    return Interval(hits / count, float(ends.low), float(ends.high), count)


@dataclass
class Comparison:
    """One figure under two conditions, by movements of the same day and direction."""

    figure: str  # a name in `FIGURES`
    first: Compensation
    second: Compensation
    pairs: int  # number of pairs that such movements can form
    mean_first: float  # over the days and directions of the pairs
    mean_second: float
    # Second minus first, beside a steady change over each day's session.
    difference: Interval
    p_value: float | None  # of Student's t, with Holm's correction; None where `untested`
    # Whether either condition also came after the other on one day. Else what changed in between,
    # and not steadily, is part of the difference.
    in_turn: bool
    untested: str = ''  # why there is no p-value

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
            'difference': self.difference.as_dict(), 'p_value': self.p_value,
            'in_turn': self.in_turn, 'untested': self.untested or None}


def _is_informative(first: Compensation, second: Compensation, baseline: Compensation) -> bool:
    """Return whether comparing two conditions answers a question.

    These are: what any condition changes against the baseline, if that has no direction; what any
    condition changes against kinetic compensation with the same model; and what law, model,
    settings or direction alone changes. Other differences in several respects answer no question.
    """
    return ((first == baseline and not first.uses_direction)
            or (first.law == 'kinetic' and first.model == second.model)
            or sum((first.law != second.law, first.announced != second.announced, *(
                'none' not in (first.law, second.law) and a != b for a, b in (
                    (first.model, second.model), (first.settings, second.settings))))) == 1)


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions with the same movements, where the comparison `_is_informative`.

    `repetitions` are in order of time. Conditions are ordered from no compensation over
    compensation without a direction to compensation with one; each is `first` against those that
    follow.
    """
    ordered = sorted({r.compensation for r in repetitions}, key=lambda condition: (
        condition.uses_direction, condition.law != 'none', condition))
    comparisons = []
    for first, second in combinations(ordered, 2):
        if not _is_informative(first, second, ordered[0]):
            continue
        for figure in COMPARED:
            both = [[r for r in repetitions if r.compensation == condition and figure in r.figures]
                    for condition in (first, second)]
            signs = set.intersection(*({r.movement.sign for r in own} for own in both))
            if signs:
                comparisons.append(_compare_movements(figure, first, second, [
                    r for r in repetitions if r.compensation in (first, second)
                    and figure in r.figures and r.movement.sign in signs]))
    for figure in COMPARED:
        _correct([c for c in comparisons if c.figure == figure and c.p_value is not None])
    return comparisons


def _correct(tested: Sequence[Comparison | Trend]) -> None:
    """Correct p-values for their number."""
    for one, p_value in zip(tested, holm([one.p_value or 0.0 for one in tested])):
        one.p_value = float(p_value)


def _compare_movements(figure: str, first: Compensation, second: Compensation,
                       repetitions: list[Repetition]) -> Comparison:
    """Compare one figure of repetitions, in order of time, under two conditions.

    Least squares with a mean for each day and direction, the difference of the conditions, and a
    change with every repetition within a day.
    """
    values = np.array([r.figures[figure] for r in repetitions])
    is_second = np.array([r.compensation == second for r in repetitions])
    kinds = [(r.day, r.movement.sign) for r in repetitions]
    index = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    of_kind = np.array([index[kind] for kind in kinds])[:, np.newaxis] == np.arange(len(index))
    pairs = np.minimum(of_kind[is_second].sum(axis=0), of_kind[~is_second].sum(axis=0))
    count = int(pairs.sum())
    before, after = (_mean(values, own, of_kind, pairs) for own in (~is_second, is_second))
    changes = {(a.compensation == second, b.compensation == second)
               for a, b in pairwise(repetitions) if a.day == b.day}
    comparison = Comparison(
        figure, first, second, pairs=count, mean_first=before, mean_second=after,
        difference=Interval(after - before, None, None, count), p_value=None,
        in_turn={(True, False), (False, True)} <= changes)
    place = np.array([r.place for r in repetitions])
    # Within each day, since days lie apart.
    since = place - of_kind @ (place @ of_kind / of_kind.sum(axis=0))
    columns = np.column_stack([is_second, since, of_kind]).astype(float)
    comparison.untested = _obstacle(comparison, repetitions, columns)
    if comparison.untested:
        return comparison
    scatter, freedom = _scatter(values, columns, is_second)
    difference, error = first_coefficient(*_with_change(values, columns, place, scatter))
    comparison.difference = Interval.around(
        difference, float(student_quantile(freedom)) * error, count)
    lower = second if difference < 0.0 else first
    if figure == 'peak_torque' and any(
            not r.moved for r in repetitions if r.compensation == lower):
        comparison.untested = ('the joint did not always move where the torque is lower, so that '
                               'it may not be')
    else:
        comparison.p_value = float(2.0 * stats.t.sf(abs(difference) / error, freedom))
    return comparison


def _with_change(values: np.ndarray, columns: np.ndarray, place: np.ndarray, scatter: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the arguments of `first_coefficient` with one more value: a change of 0, loosely."""
    rate = _CHANGE * rms(values) / max(float(np.ptp(columns[:, 1])), 1.0)
    usual = rms(scatter)
    row = np.zeros(columns.shape[1])
    row[1] = usual / max(rate, math.sqrt(NOTHING))
    return (np.append(values, 0.0), np.vstack([columns, row]), np.append(place, np.inf),
            np.append(scatter, usual))


def _mean(values: np.ndarray, own: np.ndarray, of_kind: np.ndarray, pairs: np.ndarray) -> float:
    """Return a condition's mean over the days and directions of the pairs, else over its own."""
    chosen = own[:, np.newaxis] & of_kind
    count = chosen.sum(axis=0)
    weights = pairs if pairs.any() else count
    return float(np.average(values @ chosen / np.maximum(count, 1), weights=weights))


def _obstacle(comparison: Comparison, repetitions: list[Repetition], columns: np.ndarray) -> str:
    """Return why two conditions cannot be tested against each other, '' if they can.

    `columns`, (N, M), are those fitted to the N values; the first is 1 for the second condition.
    """
    if not comparison.pairs:
        return ('they were recorded on different days, and what else changed from day to day is '
                'not known')
    # Durations and distances.
    sizes = np.log([(r.duration, r.movement.travel) for r in repetitions])
    is_second = columns[:, 0] > 0.0
    change = np.median(sizes[is_second], axis=0) - np.median(sizes[~is_second], axis=0)
    if (np.abs(change) > math.log(1.0 + ODD)).any():
        return "movements of one took longer or went farther than the other's"
    count, width = columns.shape
    if count - width < _LEAST_FREEDOM or np.linalg.matrix_rank(columns) < width:
        return 'the repetitions are too few to tell it from chance'
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
    least = _LEAST_SCATTER ** 2 * float(square.mean()) + NOTHING
    scatter, parts, freedoms = np.empty(len(values)), [], []
    for own in (is_second, ~is_second):
        freedoms.append(share * float(own.sum()))
        scatter[own] = math.sqrt(max(float(square[own].sum()) / freedoms[-1], least))
        parts.append(float(np.sum((weights[0] * scatter)[own] ** 2)))
    return scatter, sum(parts) ** 2 / sum(
        part ** 2 / freedom for part, freedom in zip(parts, freedoms))


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
    found = [_trend(condition, [r for r in dated if r.compensation == condition])
             for condition in sorted({r.compensation for r in dated})]
    _correct([trend for trend in found if trend.p_value is not None])
    return found


def _trend(condition: Compensation, repetitions: list[Repetition]) -> Trend:
    figure = next((name for name in COMPARED if any(name in r.figures for r in repetitions)),
                  'smoothness')
    known = [r for r in repetitions if figure in r.figures]
    # Without the difference between the two directions of movement, which is no trend.
    usual = {sign: float(np.mean([r.figures[figure] for r in known if r.movement.sign == sign]))
             for sign in {r.movement.sign for r in known}}
    middle = sum(usual.values()) / max(len(usual), 1)
    days = {day: mean_interval(
        [r.figures[figure] - usual[r.movement.sign] + middle for r in known if r.day == day],
        [r.place for r in known if r.day == day]) for day in sorted({r.day for r in known})}
    if len(days) < 3:
        return Trend(figure, condition, days, None, None)
    weeks = np.array([date.fromisoformat(day).toordinal() for day in days]) / 7.0
    line = stats.linregress(weeks, [value.mean for value in days.values()])
    slope = Interval.around(
        float(line.slope), student_quantile(len(days) - 2) * float(line.stderr), len(days))
    return Trend(figure, condition, days, slope, float(line.pvalue))
