# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stability of the selected effects and intervals of parameters, from resampled blocks.

The search is repeated on resampled blocks, and an effect is named where most searches choose it.
Effects that other searches choose in its place are those that the recording cannot distinguish
from it. The scatter of the coefficients over resampled blocks gives their intervals.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from friction_comp.refinement.constants import free_constants, FreeConstant, slopes
from friction_comp.refinement.effect_columns import Key, Table
from friction_comp.refinement.search import Search, Split
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import NAMED_SHARE, SEARCHES
from friction_comp.statistics import robust_std

# A column of the table, or a constant of a term.
Parameter = int | tuple[Key, str]
_LEVEL = 0.95
_DRAWS = 200
# Share of the searches that choose another effect instead, from which it is reported.
_ALTERNATIVE_SHARE = 0.2


@dataclass(frozen=True)
class Stability:
    """The results of repeated searches.

    Parameters
    ----------
    chosen : dict of Key to float
        Share of the searches that choose each term.
    alternatives : dict of Key to list of (str, float)
        Effects that searches without a term choose instead, and the share of all searches.
    """

    chosen: dict[Key, float] = field(default_factory=dict)
    alternatives: dict[Key, list[tuple[str, float]]] = field(default_factory=dict)

    def renamed(self, names: dict[Key, Key]) -> Stability:
        """Return the same results under the new keys of terms whose constants have changed."""
        return Stability({names.get(key, key): value for key, value in self.chosen.items()},
                         {names.get(key, key): value for key, value in self.alternatives.items()})

    def named(self, key: Key) -> bool:
        """Return whether a term is chosen often enough to be named."""
        return self.chosen.get(key, 0.0) >= NAMED_SHARE


def repeat_search(table: Table, keys: Sequence[Key], given: int, candidates: Sequence[Key]
             ) -> Stability:
    """Repeat the whole search on resampled blocks and count how often it chooses each term.

    Parameters
    ----------
    table : Table
    keys : sequence of Key
        Terms of the fit, those of the initial model first.
    given : int
        Number of terms of the initial model.
    candidates : sequence of Key
        Terms that may be chosen.
    """
    rng = np.random.default_rng(0)
    fixed, span = list(keys[:given]), table.rows.scene.span
    single_kinds = {key[0] for key in keys if table.terms[key].kind.most == 1 and key[-1] is None}
    # With the adjusted constants: a neighbouring grid point is the same effect.
    offered = [*keys[given:], *(key for key in candidates
                                if key[0] not in single_kinds and key not in keys)]
    late = [key for key in offered if table.terms[key].kind.variable == 'time']
    early = [key for key in offered if key not in late]
    physics = [key for key in early if table.terms[key].kind.physics and key[-1] is None]
    groups = [key for key in keys[given:] if key[-1] is not None]
    searches = []
    for _ in range(int(SEARCHES)):
        search = Search(table, Split.resampled(table, rng), early, fixed)
        start = search.separable([*fixed, *dict.fromkeys([*physics, *groups])])
        better = search.forward(search.backward(start))
        search.candidates = late
        searches.append([table.terms[key] for key in search.forward(better)])

    def contains(terms: Sequence[object], key: Key) -> bool:
        return any(table.terms[key].same_effect(term, span) for term in terms)  # type: ignore
    chosen = {key: float(np.mean([contains(terms, key) for terms in searches])) for key in keys}
    alternatives: dict[Key, list[tuple[str, float]]] = {}
    for key in keys[given:]:
        counts: Counter[str] = Counter()
        for terms in searches:
            if not contains(terms, key):
                counts.update({term.kind.name for term in terms if not any(
                    table.terms[other].same_effect(term, span) for other in keys)})
        alternatives[key] = [(name, count / len(searches)) for name, count in counts.most_common()
                             if count >= _ALTERNATIVE_SHARE * len(searches)]
    return Stability(chosen, alternatives)


@dataclass(frozen=True)
class Intervals:
    """95 % intervals of all fitted parameters.

    Parameters
    ----------
    coefficients : dict of int to (float, float)
        By column of the table.
    constants : dict of (Key, str) to (float, float)
    correlations : dict of (int or (Key, str), same) to float
        Rank correlations of coefficients and constants over resampled blocks, the largest first.
    """

    coefficients: dict[int, tuple[float, float]]
    constants: dict[tuple[Key, str], tuple[float, float]]
    correlations: dict[tuple[Parameter, Parameter], float] = field(default_factory=dict)

    def excludes_zero(self, columns: Sequence[int], signs: np.ndarray) -> bool:
        """Return whether the interval of any of a term's coefficients excludes zero.

        Parameters
        ----------
        columns : sequence of int
            Columns of the term.
        signs : sequence of int
            Signs that physics requires, 0 where free. If any is required, only the coefficients
            with a required sign count.
        """
        bounded = [column for column, sign in zip(columns, signs) if sign] or columns
        return any(low > 0.0 or high < 0.0 for low, high in (
            self.coefficients[column] for column in bounded))


def intervals(table: Table, keys: Sequence[Key]) -> Intervals:
    """Return intervals from fits to resampled blocks.

    Constants enter through their derivatives, so that the interval of a coefficient includes the
    uncertainty of the constants.
    """
    free: list[FreeConstant] = free_constants([table.terms[key] for key in keys])
    indices = table.indices(keys)
    matrix = np.vstack((table.columns[indices], slopes(table, keys, free)))
    blocks = int(table.block.max()) + 1
    full = np.vstack((matrix, table.target))
    gram = np.array([full[:, rows] @ full[:, rows].T for rows in (
        np.nonzero(table.rows.block == k)[0] for k in range(blocks))])
    signs = np.append(table.sums.signs[indices], np.zeros(len(free), dtype=int))
    sums = BlockSums(gram, np.bincount(table.rows.block), signs)
    rng = np.random.default_rng(1)
    weights = np.array([np.bincount(rng.integers(0, blocks, blocks), minlength=blocks)
                        for _ in range(_DRAWS)], dtype=float)
    coefficients = sums.fits(range(len(matrix)), weights)
    estimates = sums.fit(range(len(matrix)))
    quantile = float(stats.t.ppf(0.5 + 0.5 * _LEVEL, blocks - 1))
    # By the median: samples that lack a direction of motion give outlying fits.
    half = quantile * robust_std(coefficients - np.median(coefficients, axis=0), axis=0)
    middle = table.coefficients(keys)
    ends = {column: (middle.get(column, value) - h, middle.get(column, value) + h)
            for column, value, h in zip(indices, estimates, half)}
    constants = {}
    for constant, h in zip(free, half[len(indices):]):
        term = table.terms[keys[constant.term]]
        value, width = term.constants[constant.name], h * constant.unit(term, table)
        constants[term.key, constant.name] = float(value - width), float(value + width)
    names: list[Parameter] = [*indices, *(
        (keys[constant.term], constant.name) for constant in free)]
    return Intervals({k: (float(a), float(b)) for k, (a, b) in ends.items()}, constants,
                     correlations(names, coefficients))


def correlations(names: Sequence[Parameter], draws: np.ndarray
                 ) -> dict[tuple[Parameter, Parameter], float]:
    """Return the rank correlations of pairs of parameters, the largest first.

    Parameters
    ----------
    names : sequence, length P
    draws : ndarray, shape (D, P)
    """
    ranks = stats.rankdata(draws, axis=0)
    ranks -= ranks.mean(axis=0)
    size = np.sqrt(np.sum(ranks ** 2, axis=0)) + 1e-300
    matrix = (ranks / size).T @ (ranks / size)
    pairs = {(names[j], names[k]): float(matrix[j, k])
             for k in range(len(names)) for j in range(k)}
    return dict(sorted(pairs.items(), key=lambda pair: -abs(pair[1])))
