# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Trend of the measures over sessions of many days."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.evaluation.compare import SIGNIFICANT
from friction_comp.evaluation.intervals import CONFIDENCE, Interval, mean_interval
from friction_comp.evaluation.repetitions import FIGURES, Help, Repetition

_WEEK = 7.0
# Of these, the first that a condition has is followed.
_FOLLOWED = ('peak_torque', 'residual_current', 'announcement_to_motion', 'onset', 'smoothness')


@dataclass
class Trend:
    """One figure under one condition, day by day.

    Attributes
    ----------
    figure : str
        By its name in `FIGURES`.
    help : Help
    days : dict of str to Interval
        ISO date to mean and 95 % interval over the day's repetitions.
    per_week : Interval or None
        Slope of a straight line through the days' means, with its 95 % interval; None below
        three days. Repetitions of one day have that day's mood in common, so days are counted.
    probability : float or None
        Of such a slope by chance.
    """

    figure: str
    help: Help
    days: dict[str, Interval]
    per_week: Interval | None
    probability: float | None

    @property
    def sure(self) -> bool:
        """Whether the slope is more than chance."""
        return self.probability is not None and self.probability < SIGNIFICANT

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json holds."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1], **self.help.as_dict(),
            'days': {day: value.as_dict() for day, value in self.days.items()},
            'per_week': self.per_week.as_dict() if self.per_week else None,
            'p_value': self.probability}


def trends(repetitions: Sequence[Repetition]) -> list[Trend]:
    """Return the trend of each condition's leading figure over the days.

    Parameters
    ----------
    repetitions : sequence of Repetition
        Of one joint.

    Returns
    -------
    list of Trend
        Empty unless repetitions are of at least two days.
    """
    if len({r.day for r in repetitions if r.day}) < 2:
        return []
    groups: dict[Help, list[Repetition]] = {}
    for repetition in repetitions:
        if repetition.day:
            groups.setdefault(repetition.help, []).append(repetition)
    return [_trend(known, groups[known]) for known in sorted(groups)]


def _trend(known: Help, repetitions: list[Repetition]) -> Trend:
    figure = next((name for name in _FOLLOWED if any(name in r.figures for r in repetitions)),
                  'smoothness')
    values: dict[str, list[float]] = {}
    for repetition in repetitions:
        if figure in repetition.figures:
            values.setdefault(repetition.day, []).append(repetition.figures[figure])
    days = {day: mean_interval(values[day]) for day in sorted(values)}
    if len(days) < 3:
        return Trend(figure, known, days, None, None)
    weeks = np.array([date.fromisoformat(day).toordinal() for day in days]) / _WEEK
    line = stats.linregress(weeks, [value.mean for value in days.values()])
    half = float(stats.t.ppf(0.5 + 0.5 * CONFIDENCE, len(days) - 2) * line.stderr)
    slope = float(line.slope)
    return Trend(figure, known, days, Interval(slope, slope - half, slope + half, len(days)),
                 float(line.pvalue))
