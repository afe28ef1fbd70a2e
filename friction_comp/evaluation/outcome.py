# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The result of an evaluation: its conditions and their comparisons."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from friction_comp.evaluation.compare import Comparison
from friction_comp.evaluation.intervals import Interval
from friction_comp.evaluation.repetitions import FIGURES, Help, NAMES, Repetition
from friction_comp.evaluation.trend import Trend


@dataclass
class Condition:
    """Ensemble of the repetitions under one condition; torques are NaN where none was measured.

    Attributes
    ----------
    help : Help
        What was active.
    direction : int
        Announced direction d.
    movement : str
        'positive' or 'negative'.
    repetitions : int
    stuck : int
        Those in which the joint did not set out; then the peak torque is a bound, for nobody gave
        what it takes.
    peak_torque : float
        Largest magnitude of the ensemble average of τ_b in N·m, from the movement's begin until it
        slows down, or until the joint sets out where that comes later: what it takes to set the
        joint in motion and keep it there (`friction_comp.evaluation.repetitions.effort`).
    peak_torque_std : float
        Standard deviation over repetitions of each one's own peak in N·m.
    peak_time : float
        When the average peaks, s after the start of the movement.
    rms_torque : float
        Root mean square of τ_b over all repetitions, from start to end of the movement, N·m.
    mean_torque_constant_velocity : float
        Mean of τ_b along the movement in the phase of constant velocity, N·m; negative where the
        joint pulls ahead of the person.
    false_starts : int
        Repetitions in which the joint set out before the movement and nobody pushed.
    figures : dict of str to Interval
        Mean over repetitions of each one's own figures, by the names in `FIGURES`, with its
        95 % confidence interval.
    false_start_share : Interval
    time : ndarray
        s since the start of the movement, shape (N,).
    torque, torque_std, position, position_std, reference : ndarray
        Average and standard deviation over repetitions, shape (N,), in N·m and rad; reference is
        None where it was not recorded.
    """

    help: Help
    direction: int
    movement: str
    repetitions: int
    stuck: int
    peak_torque: float
    peak_torque_std: float
    peak_time: float
    rms_torque: float
    mean_torque_constant_velocity: float
    false_starts: int
    figures: dict[str, Interval]
    false_start_share: Interval
    time: np.ndarray
    torque: np.ndarray
    torque_std: np.ndarray
    position: np.ndarray
    position_std: np.ndarray
    reference: np.ndarray | None = None

    @property
    def assisted(self) -> bool:
        """True where the direction announced is that of the movement."""
        return self.direction == (1 if self.movement == 'positive' else -1)

    def as_dict(self) -> dict[str, Any]:
        """Return the figures without the curves."""
        named = {name: getattr(self, name) for name in (
            'direction', 'movement', 'repetitions', 'stuck', 'peak_torque', 'peak_torque_std',
            'peak_time', 'rms_torque', 'mean_torque_constant_velocity', 'false_starts')}
        return {
            **named, 'law': self.help.law or None, 'model': self.help.model or None,
            'figures': {name: value.as_dict() for name, value in self.figures.items()},
            'false_start_share': self.false_start_share.as_dict()}


@dataclass
class Evaluation:
    """All conditions of one joint and what the announced direction achieved.

    Attributes
    ----------
    joint : str
    conditions : list of Condition
    model : str or None
        Model files that were active.
    repetitions : list of Repetition
    comparisons : list of Comparison
        Paired tests between all conditions that share a movement.
    trends : list of Trend
        Where repetitions are of several days.
    notes : list of str
    """

    joint: str
    conditions: list[Condition]
    model: str | None = None
    repetitions: list[Repetition] = field(default_factory=list)
    comparisons: list[Comparison] = field(default_factory=list)
    trends: list[Trend] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def measured(self) -> bool:
        """Whether the back-driving torque was measured."""
        return any('peak_torque' in r.figures for r in self.repetitions)

    def words(self, known: Help) -> tuple[str, ...]:
        """Return direction, law and, where there are several, model of a condition."""
        models = {c.help.model for c in self.conditions if c.help.model}
        words = known.words if len(models) > 1 else known.words[:2]
        return tuple(filter(None, words))

    def label(self, known: Help) -> str:
        """Return the same in one line."""
        return ' · '.join(self.words(known))

    def pair(self) -> tuple[Help, Help] | None:
        """Return the condition that d = ±1 is compared with: d = 0 under the same law and model.

        Where that is nowhere: kinetic compensation alone with the same model, which is what any
        law is without a direction, then no compensation; else, where there is but one of either,
        these two. None where several could be meant. Of several laws or models, the one with the
        most repetitions counts.
        """
        counts: dict[Help, int] = {}
        for condition in self.conditions:
            counts[condition.help] = counts.get(condition.help, 0) + condition.repetitions
        plain = [known for known in counts if known.announced >= 0 and not known.led]
        assisted = [known for known in counts if known.announced == 1 and known.led]
        for alike in (lambda a, b: (a.law, a.model) == (b.law, b.model),
                      lambda a, b: (a.law, a.model) == ('kinetic', b.model),
                      lambda a, b: a.law == 'none'):
            two = [(a, b) for a in plain for b in assisted if alike(a, b)]
            if two:
                return max(two, key=lambda pair: (min(counts[pair[0]], counts[pair[1]]), pair))
        return (plain[0], assisted[0]) if len(plain) == len(assisted) == 1 else None

    def stuck(self, known: Help) -> int:
        """Return in how many movements under a condition the joint did not set out."""
        return sum(r.help == known and not r.moved for r in self.repetitions)

    def peak_of(self, known: Help) -> float:
        """Return the mean over both movements of a condition's peak torque, N·m."""
        return float(np.mean([c.peak_torque for c in self.conditions if c.help == known]))

    def compared(self, name: str) -> tuple[float, float] | None:
        """Return a figure with d = 0 and with d = ±1, or None where nothing can be compared.

        Parameters
        ----------
        name : str
            'peak_torque' or 'rms_torque'.

        Returns
        -------
        tuple of float, or None
            Means over the movements for which both conditions are there, N·m.
        """
        two = self.pair()
        if two is None:
            return None
        values = {(c.help, c.movement): getattr(c, name) for c in self.conditions}
        pairs = [(values[two[0], m], values[two[1], m]) for m in NAMES.values()
                 if (two[0], m) in values and (two[1], m) in values]
        pairs = [pair for pair in pairs if np.isfinite(pair).all()]
        if not pairs:
            return None
        plain_mean, assisted_mean = np.mean(pairs, axis=0)
        return float(plain_mean), float(assisted_mean)

    @property
    def is_bound(self) -> bool:
        """Whether the measured reduction of the peak is only a lower bound.

        Where the joint did not set out without a direction, nobody gave what it takes.
        """
        two, change = self.pair(), self.peak_reduction
        return (two is not None and change is not None and change >= 0.0
                and bool(self.stuck(two[0])) and not self.stuck(two[1]))

    def _reduction(self, name: str) -> float | None:
        pair = self.compared(name)
        return 1.0 - pair[1] / pair[0] if pair and pair[0] > 0 else None

    @property
    def peak_reduction(self) -> float | None:
        """Share by which the peak torque is smaller with d = ±1."""
        return self._reduction('peak_torque')

    @property
    def rms_reduction(self) -> float | None:
        """Share by which the RMS torque is smaller with d = ±1."""
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
        """Return one row per repetition, after a row of names."""
        rows: list[list[Any]] = [[
            'joint', 'recording', 'day', 'begin', 'duration', 'movement', 'direction', 'law',
            'model', *FIGURES, 'moved', 'false_start']]
        for r in self.repetitions:
            rows.append([
                self.joint, r.recording, r.day, round(r.begin, 4), round(r.duration, 4),
                NAMES[r.movement.sign], r.movement.direction, r.help.law, r.help.model,
                *(f'{r.figures[name]:.6g}' if name in r.figures else '' for name in FIGURES),
                int(r.moved), int(r.false_start)])
        return rows
