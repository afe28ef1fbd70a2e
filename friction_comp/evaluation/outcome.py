# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The result of an evaluation: conditions and their comparisons."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from friction_comp.evaluation.compare import Comparison, Interval, Trend
from friction_comp.evaluation.repetitions import Compensation, FIGURES, NAMES, Repetition


@dataclass
class Condition:
    """The repetitions under one condition; torques in N·m, NaN where none was measured."""

    compensation: Compensation
    direction: int  # announced direction d
    movement: str  # 'positive' or 'negative'
    repetitions: int  # their number
    # Those in which the joint did not start moving: the peak torque is then a lower bound.
    stuck: int
    peak_torque: float  # largest magnitude of the mean of τ_b while `torque_figures` counts it
    peak_torque_std: float  # standard deviation of the repetitions' peaks
    peak_time: float  # of the peak of the mean, s after the start of the movement
    rms_torque: float  # over all repetitions, from start to end of the movement
    mean_torque_constant_velocity: float  # negative where the joint pulls the person along
    false_starts: int  # number of repetitions in which it started without being pushed
    figures: dict[str, Interval]  # mean of the repetitions' figures, by the names in `FIGURES`
    false_start_share: Interval
    # Each (N,): s since the start of the movement; means and standard deviations, N·m and rad.
    time: np.ndarray
    torque: np.ndarray
    torque_std: np.ndarray
    position: np.ndarray
    position_std: np.ndarray
    reference: np.ndarray | None = None

    def mean_of(self, name: str) -> float:
        """Return the mean of one of `FIGURES` over the repetitions; NaN where it is unknown."""
        return self.figures[name].mean if name in self.figures else float('nan')

    def as_dict(self) -> dict[str, Any]:
        """Return the figures without the curves."""
        named = {name: getattr(self, name) for name in (
            'direction', 'movement', 'repetitions', 'stuck', 'peak_torque', 'peak_torque_std',
            'peak_time', 'rms_torque', 'mean_torque_constant_velocity', 'false_starts')}
        return {
            **named, 'law': self.compensation.law or None, 'model': self.compensation.model or None,
            'figures': {name: value.as_dict() for name, value in self.figures.items()},
            'false_start_share': self.false_start_share.as_dict()}


@dataclass
class Evaluation:
    """All conditions of one joint and their comparisons."""

    joint: str
    conditions: list[Condition]
    model: str | None  # model files that were active
    repetitions: list[Repetition]
    comparisons: list[Comparison]  # between conditions with the same movements
    trends: list[Trend]  # empty where all repetitions are of one day
    notes: list[str]

    @property
    def measured(self) -> bool:
        """Whether the back-driving torque was measured."""
        return any('peak_torque' in r.figures for r in self.repetitions)

    def names_of(self, condition: Compensation) -> tuple[str, ...]:
        """Return the names of a condition; the model only if there are several."""
        models = {c.compensation.model for c in self.conditions if c.compensation.model}
        parts = condition.names if len(models) > 1 else condition.names[:2]
        return tuple(filter(None, parts))

    def label(self, condition: Compensation) -> str:
        """Return the names of a condition in one line."""
        return ' · '.join(self.names_of(condition))

    def pair(self) -> tuple[Compensation, Compensation] | None:
        """Return the conditions without and with direction whose comparison is reported first.

        In this order: both with the same law and model; kinetic compensation and a law with the
        same model; no compensation and any law; the only two conditions. Of several pairs of one
        kind, that with the most repetitions; None where the choice is ambiguous.
        """
        counts: Counter[Compensation] = Counter()
        for condition in self.conditions:
            counts[condition.compensation] += condition.repetitions
        plain = [c for c in counts if c.announced >= 0 and not c.uses_direction]
        assisted = [c for c in counts if c.announced == 1 and c.uses_direction]
        pairs = list(product(plain, assisted))
        for comparable in (
                [(a, b) for a, b in pairs if (a.law, a.model) == (b.law, b.model)],
                [(a, b) for a, b in pairs if (a.law, a.model) == ('kinetic', b.model)],
                [(a, b) for a, b in pairs if a.law == 'none']):
            if comparable:
                return max(comparable, key=lambda pair: (min(counts[c] for c in pair), pair))
        return pairs[0] if len(pairs) == 1 else None

    def stuck(self, condition: Compensation) -> int:
        """Return the number of movements under a condition in which the joint did not move."""
        return sum(r.compensation == condition and not r.moved for r in self.repetitions)

    def mean_of(self, name: str, condition: Compensation) -> float:
        """Return the mean of one of `FIGURES` under a condition, averaged over both movements."""
        return float(np.mean([c.mean_of(name) for c in self.conditions
                              if c.compensation == condition]))

    def compared(self, name: str) -> tuple[float, float] | None:
        """Return 'peak_torque' or 'rms_torque' with d = 0 and with d = ±1, N·m.

        Means over the repetitions of movements that both conditions of `pair` have; None without.
        """
        conditions = self.pair()
        if conditions is None:
            return None
        values = {(c.compensation, c.movement): c.mean_of(name) for c in self.conditions}
        both = np.array([[values.get((condition, movement), np.nan) for condition in conditions]
                         for movement in NAMES.values()])
        both = both[np.isfinite(both).all(axis=1)]
        return (float(both[:, 0].mean()), float(both[:, 1].mean())) if both.size else None

    @property
    def is_bound(self) -> bool:
        """Whether the measured reduction of the peak is only a lower bound.

        If the joint did not start moving without a direction, the torque needed is unknown.
        """
        conditions, change = self.pair(), self.peak_reduction
        return (conditions is not None and change is not None and change >= 0.0
                and bool(self.stuck(conditions[0])) and not self.stuck(conditions[1]))

    def _reduction(self, name: str) -> float | None:
        pair = self.compared(name)
        return 1.0 - pair[1] / pair[0] if pair and pair[0] > 0 else None

    @property
    def peak_reduction(self) -> float | None:
        """Relative reduction of the peak torque with d = ±1."""
        return self._reduction('peak_torque')

    @property
    def rms_reduction(self) -> float | None:
        """Relative reduction of the RMS torque with d = ±1."""
        return self._reduction('rms_torque')

    def as_dict(self) -> dict[str, Any]:
        """Return the content of report.json."""
        return {
            'joint': self.joint, 'conditions': [c.as_dict() for c in self.conditions],
            'peak_reduction': self.peak_reduction, 'rms_reduction': self.rms_reduction,
            'reduction_is_bound': self.is_bound, 'model': self.model,
            'torque_measured': self.measured,
            'comparisons': [c.as_dict() for c in self.comparisons],
            'trends': [t.as_dict() for t in self.trends], 'notes': self.notes,
        }

    def table(self) -> list[list[Any]]:
        """Return a header and one row for each repetition."""
        header = ['joint', 'recording', 'day', 'begin', 'duration', 'movement', 'direction', 'law',
                  'model', *FIGURES, 'moved', 'false_start']
        return [header, *([
            self.joint, r.recording, r.day, round(r.begin, 4), round(r.duration, 4),
            NAMES[r.movement.sign], r.movement.direction, r.compensation.law, r.compensation.model,
            *(f'{r.figures[name]:.6g}' if name in r.figures else '' for name in FIGURES),
            int(r.moved), int(r.false_start)] for r in self.repetitions)]
