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

# What is compared, as far as known. The first two need a torque sensor; smoothness is compared
# wherever there is motion.
COMPARED = ('peak_torque', 'rms_torque', 'residual_current', 'announcement_to_motion', 'onset',
            'smoothness')
# Below this probability a difference is not put down to chance.
SIGNIFICANT = 0.05


@dataclass
class Comparison:
    """One figure under two conditions.

    Attributes
    ----------
    figure : str
        By its name in `FIGURES`.
    first, second : Help
    pairs : int
        The n-th repetition of the one with the n-th of the other, in the same movement.
    before, after : float
        Means over the pairs.
    difference : Interval
        Second minus first.
    probability : float or None
        That differences of this kind come by chance: Wilcoxon's signed-rank test, two-sided,
        after Holm's correction for the number of comparisons of this figure; None below five
        pairs.
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
    def sure(self) -> bool:
        """Whether the difference is more than chance."""
        return self.probability is not None and self.probability < SIGNIFICANT

    def as_dict(self) -> dict[str, Any]:
        """Return what report.json holds."""
        return {
            'figure': self.figure, 'unit': FIGURES[self.figure][1],
            'first': self.first.as_dict(), 'second': self.second.as_dict(), 'pairs': self.pairs,
            'mean_first': self.before, 'mean_second': self.after,
            'difference': self.difference.as_dict(), 'p_value': self.probability}


def asked(first: Help, second: Help, plainest: Help) -> bool:
    """Return whether comparing two conditions answers a question.

    What does any help bring, against the plainest without a direction; what does the direction
    bring after kinetic compensation with the same model; what does law, model or direction bring,
    where the other two are the same. Differences in several respects at once answer none.
    """
    if first == plainest and not first.led:
        return True
    if first.law == 'kinetic' and first.model == second.model:
        return True
    return sum((first.law != second.law, first.model != second.model,
                first.announced != second.announced)) == 1


def compare(repetitions: Sequence[Repetition]) -> list[Comparison]:
    """Compare conditions that have the same movements, where the comparison is `asked`.

    Parameters
    ----------
    repetitions : sequence of Repetition
        Of one joint.

    Returns
    -------
    list of Comparison
        No help, then help without a direction, then help with one: each is the first against those
        that follow.
    """
    groups: dict[Help, dict[int, list[Repetition]]] = {}
    for repetition in repetitions:
        groups.setdefault(repetition.help, {}).setdefault(
            repetition.movement.sign, []).append(repetition)
    comparisons = []
    ordered = sorted(groups, key=lambda one: (one.led, one.law != 'none', one))
    for first, second in combinations(ordered, 2):
        if not asked(first, second, ordered[0]):
            continue
        two = [(a, b) for sign in (1, -1) for a, b in zip(
            groups[first].get(sign, []), groups[second].get(sign, []))]
        for figure in COMPARED:
            values = np.array([(a.figures[figure], b.figures[figure]) for a, b in two
                               if figure in a.figures and figure in b.figures])
            if len(values):
                comparisons.append(_compared(figure, first, second, values))
    for figure in COMPARED:
        _correct([comparison for comparison in comparisons if comparison.figure == figure])
    return comparisons


def _compared(figure: str, first: Help, second: Help, values: np.ndarray) -> Comparison:
    difference = values[:, 1] - values[:, 0]
    probability = None
    if len(values) >= 5:
        probability = float(stats.wilcoxon(difference).pvalue) if difference.any() else 1.0
    before, after = values.mean(axis=0)
    return Comparison(figure, first, second, len(values), float(before), float(after),
                      mean_interval(difference.tolist()), probability)


def _correct(comparisons: list[Comparison]) -> None:
    """Correct probabilities for their number, by Holm's step-down method."""
    tested = [one for one in comparisons if one.probability is not None]
    for one, probability in zip(tested, holm([one.probability or 0.0 for one in tested])):
        one.probability = float(probability)
