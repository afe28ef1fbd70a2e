# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the trend of figures over sessions on several days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.evaluation.intervals import Interval, is_significant, mean_interval, student
from friction_comp.evaluation.repetitions import FIGURES, Help, Repetition

_WEEK = 7.0
# The trend is that of the first of these figures that a condition has.
_FOLLOWED = ('peak_torque', 'residual_current', 'announcement_to_motion', 'onset', 'smoothness')


@dataclass
class Trend:
    """One figure under one condition by day.

    Attributes
    ----------
    figure : str
        A name in `FIGURES`.
    help : Help
    days : dict of str to Interval
        Mean and 95 % interval over the day's repetitions, by ISO date.
    per_week : Interval or None
        Slope of a straight line through the daily means, with its 95 % interval; None for fewer
        than three days. Repetitions of one day are not independent, so days are counted.
    probability : float or None
        p-value of the slope.
    """

    figure: str
    help: Help
    days: dict[str, Interval]
    per_week: Interval | None
    probability: float | None

    @property
    def significant(self) -> bool:
        """Whether the slope is statistically significant."""
        return is_significant(self.probability)

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1], **self.help.as_dict(),
            'days': {day: value.as_dict() for day, value in self.days.items()},
            'per_week': self.per_week.as_dict() if self.per_week else None,
            'p_value': self.probability}


def trends(repetitions: Sequence[Repetition]) -> list[Trend]:
    """Return the trend of each condition's leading figure; empty for repetitions of one day."""
    if len({r.day for r in repetitions if r.day}) < 2:
        return []
    groups: dict[Help, list[Repetition]] = {}
    for repetition in repetitions:
        if repetition.day:
            groups.setdefault(repetition.help, []).append(repetition)
    return [_trend(condition, groups[condition]) for condition in sorted(groups)]


def _trend(condition: Help, repetitions: list[Repetition]) -> Trend:
    figure = next((name for name in _FOLLOWED if any(name in r.figures for r in repetitions)),
                  'smoothness')
    values: dict[str, list[float]] = {}
    for repetition in repetitions:
        if figure in repetition.figures:
            values.setdefault(repetition.day, []).append(repetition.figures[figure])
    days = {day: mean_interval(values[day]) for day in sorted(values)}
    if len(days) < 3:
        return Trend(figure, condition, days, None, None)
    weeks = np.array([date.fromisoformat(day).toordinal() for day in days]) / _WEEK
    line = stats.linregress(weeks, [value.mean for value in days.values()])
    slope = Interval.around(
        float(line.slope), student(len(days) - 2) * float(line.stderr), len(days))
    return Trend(figure, condition, days, slope, float(line.pvalue))
