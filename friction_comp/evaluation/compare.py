# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Compares conditions over their repetitions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from friction_comp.evaluation.intervals import Interval, mean_interval
from friction_comp.evaluation.repetitions import FIGURES, Help, Repetition
from friction_comp.statistics import holm

# The figures that are compared where they are known. The first two need a torque sensor;
# smoothness needs only motion.
COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'announcement_to_motion', 'onset',
            'smoothness')
# A difference with a smaller p-value is significant.
SIGNIFICANT = 0.05


@dataclass
class Comparison:
    """One figure under two conditions.

    Attributes
    ----------
    figure : str
        A name in `FIGURES`.
    first, second : Help
    pairs : int
        Number of pairs: the n-th repetition under one condition with the n-th under the other, in
        the same movement.
    before, after : float
        Means over the pairs.
    difference : Interval
        Second minus first.
    probability : float or None
        p-value of Wilcoxon's two-sided signed-rank test, with Holm's correction for the number of
        comparisons of this figure; None for fewer than five pairs.
    """

    figure: str
    first: Help
    second: Help
    pairs: int
    before: float
    after: float
    difference: Interval
    probability: float | None

    @property
    def significant(self) -> bool:
        """Whether the difference is statistically significant."""
        return self.probability is not None and self.probability < SIGNIFICANT

    def as_dict(self) -> dict[str, Any]:
        """Return the entry of report.json."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1],
            'first': self.first.as_dict(), 'second': self.second.as_dict(), 'pairs': self.pairs,
            'mean_first': self.before, 'mean_second': self.after,
            'difference': self.difference.as_dict(), 'p_value': self.probability}


def is_informative(first: Help, second: Help, baseline: Help) -> bool:
    """Return whether comparing two conditions answers a question.

    These are: what any condition changes against the baseline, if that has no direction; what any
    condition changes against kinetic compensation with the same model; and what law, model or
    direction alone changes. Other differences in several respects answer no question.
    """
    if first == baseline and not first.uses_direction:
        return True
    if first.law == 'kinetic' and first.model == second.model:
        return True
    return sum((first.law != second.law, first.model != second.model,
                first.announced != second.announced)) == 1


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions with the same movements, where the comparison `is_informative`.

    Parameters
    ----------
    repetitions : sequence of Repetition
        Of one joint.

    Returns
    -------
    list of Comparison
        Conditions are ordered from no compensation over compensation without a direction to
        compensation with one; each is `first` against those that follow.
    """
    groups: dict[Help, dict[int, list[Repetition]]] = {}
    for repetition in repetitions:
        groups.setdefault(repetition.help, {}).setdefault(
            repetition.movement.sign, []).append(repetition)
    comparisons = []
    ordered = sorted(groups, key=lambda condition: (
        condition.uses_direction, condition.law != 'none', condition))
    for first, second in combinations(ordered, 2):
        if not is_informative(first, second, ordered[0]):
            continue
        pairs = [(a, b) for sign in (1, -1) for a, b in zip(
            groups[first].get(sign, []), groups[second].get(sign, []))]
        for figure in COMPARED:
            values = np.array([(a.figures[figure], b.figures[figure]) for a, b in pairs
                               if figure in a.figures and figure in b.figures])
            if len(values):
                comparisons.append(_compare_values(figure, first, second, values))
    for figure in COMPARED:
        _correct([comparison for comparison in comparisons if comparison.figure == figure])
    return comparisons


def _compare_values(figure: str, first: Help, second: Help, values: np.ndarray) -> Comparison:
    difference = values[:, 1] - values[:, 0]
    probability = None
    if len(values) >= 5:
        probability = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
    before, after = values.mean(axis=0)
    return Comparison(figure, first, second, len(values), float(before), float(after),
                      mean_interval(difference.tolist()), probability)


def _correct(comparisons: list[Comparison]) -> None:
    """Correct p-values for their number by Holm's step-down method."""
    tested = [comparison for comparison in comparisons if comparison.probability is not None]
    corrected = holm([comparison.probability or 0.0 for comparison in tested])
    for comparison, probability in zip(tested, corrected):
        comparison.probability = float(probability)
