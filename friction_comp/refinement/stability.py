# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Stability of names and intervals of numbers: the search repeated on resampled blocks.

An effect is named where most of the searches choose it. What takes its place in the others is
what the recording cannot tell it from. The scatter of the coefficients over blocks drawn anew
gives their intervals.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from friction_comp.refinement.constants import Knob, knobs_of, slopes
from friction_comp.refinement.effect_columns import Key, Table
from friction_comp.refinement.search import Search, Split
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import NAMED, SEARCHES

# A column of the table, or a constant of a term.
Number = int | tuple[Key, str]
_LEVEL = 0.95
_DRAWS = 200
# Share of the searches that have something else in an effect's place, before that is said.
_INSTEAD = 0.2


@dataclass(frozen=True)
class Stability:
    """What repeated searches chose.

    Parameters
    ----------
    chosen : dict of Key to float
        Share of the searches that choose each term.
    instead : dict of Key to list of (str, float)
        Effects that searches without a term have in its place, and in what share of all searches.
    """

    chosen: dict[Key, float] = field(default_factory=dict)
    instead: dict[Key, list[tuple[str, float]]] = field(default_factory=dict)

    def renamed(self, names: dict[Key, Key]) -> Stability:
        """Return the same for terms whose constants have changed."""
        return Stability({names.get(key, key): value for key, value in self.chosen.items()},
                         {names.get(key, key): value for key, value in self.instead.items()})

    def named(self, key: Key) -> bool:
        """Return whether a term is chosen often enough to be named."""
        return self.chosen.get(key, 0.0) >= NAMED


def repeated(table: Table, keys: Sequence[Key], given: int, candidates: Sequence[Key]
             ) -> Stability:
    """Return how often whole searches choose each term of a fit.

    Parameters
    ----------
    table : Table
    keys : sequence of Key
        The fit, terms of the model before first.
    given : int
        How many these are.
    candidates : sequence of Key
        All that may be chosen.
    """
    rng = np.random.default_rng(0)
    fixed, span = list(keys[:given]), table.rows.scene.span
    own = {key[0] for key in keys if table.terms[key].kind.most == 1 and key[-1] is None}
    # With the constants that were found: a grid point beside them is the same effect.
    offered = [*keys[given:], *(key for key in candidates
                                if key[0] not in own and key not in keys)]
    late = [key for key in offered if table.terms[key].kind.variable == 'time']
    early = [key for key in offered if key not in late]
    physics = [key for key in early if table.terms[key].kind.physics and key[-1] is None]
    groups = [key for key in keys[given:] if key[-1] is not None]
    searches = []
    for _ in range(int(SEARCHES)):
        search = Search(table, Split.drawn(table, rng), early, fixed)
        start = search.told_apart([*fixed, *dict.fromkeys([*physics, *groups])])
        better = search.forward(search.backward(start))
        search.candidates = late
        searches.append([table.terms[key] for key in search.forward(better)])

    def holds(terms: Sequence[object], key: Key) -> bool:
        return any(table.terms[key].same_effect(term, span) for term in terms)  # type: ignore
    chosen = {key: float(np.mean([holds(terms, key) for terms in searches])) for key in keys}
    instead: dict[Key, list[tuple[str, float]]] = {}
    for key in keys[given:]:
        others: Counter[str] = Counter()
        for terms in searches:
            if not holds(terms, key):
                others.update({term.kind.name for term in terms if not any(
                    table.terms[other].same_effect(term, span) for other in keys)})
        instead[key] = [(name, count / len(searches)) for name, count in others.most_common()
                        if count >= _INSTEAD * len(searches)]
    return Stability(chosen, instead)


@dataclass(frozen=True)
class Intervals:
    """95 % intervals of everything that was fitted.

    Parameters
    ----------
    coefficients : dict of int to (float, float)
        By column of the table.
    constants : dict of (Key, str) to (float, float)
    correlations : dict of (int or (Key, str), same) to float
        How coefficients and constants scatter together over the blocks drawn, those that do so
        most first.
    """

    coefficients: dict[int, tuple[float, float]]
    constants: dict[tuple[Key, str], tuple[float, float]]
    correlations: dict[tuple[Number, Number], float] = field(default_factory=dict)

    def without_zero(self, places: Sequence[int], signs: np.ndarray) -> bool:
        """Return whether the interval of any of a term's coefficients leaves zero out.

        Parameters
        ----------
        places : sequence of int
            Columns of the term.
        signs : sequence of int
            Of these; where physics asks for a sign, one such coefficient has to be beyond zero.
        """
        bounded = [column for column, sign in zip(places, signs) if sign] or places
        return any(low > 0.0 or high < 0.0 for low, high in (
            self.coefficients[column] for column in bounded))


def intervals(table: Table, keys: Sequence[Key]) -> Intervals:
    """Return intervals from fits to resampled blocks.

    Constants take part by their derivatives, so that what a coefficient owes to an uncertain
    constant is in its interval.
    """
    knobs: list[Knob] = knobs_of([table.terms[key] for key in keys])
    indices = table.indices(keys)
    matrix = np.vstack((table.columns[indices], slopes(table, keys, knobs)))
    blocks = int(table.block.max()) + 1
    full = np.vstack((matrix, table.target))
    gram = np.array([full[:, rows] @ full[:, rows].T for rows in (
        np.nonzero(table.rows.block == k)[0] for k in range(blocks))])
    signs = np.append(table.sums.signs[indices], np.zeros(len(knobs), dtype=int))
    sums = BlockSums(gram, np.bincount(table.rows.block), signs)
    rng = np.random.default_rng(1)
    weights = np.array([np.bincount(rng.integers(0, blocks, blocks), minlength=blocks)
                        for _ in range(_DRAWS)], dtype=float)
    coefficients = sums.fits(range(len(matrix)), weights)
    whole = sums.fit(range(len(matrix)))
    quantile = float(stats.t.ppf(0.5 + 0.5 * _LEVEL, blocks - 1))
    # Median absolute deviation: draws that lack a direction of motion have fits far away.
    scatter = np.abs(coefficients - np.median(coefficients, axis=0))
    half = quantile * 1.4826 * np.median(scatter, axis=0)
    middle = table.coefficients(keys)
    ends = {column: (middle.get(column, value) - h, middle.get(column, value) + h)
            for column, value, h in zip(indices, whole, half)}
    constants = {}
    for knob, h in zip(knobs, half[len(indices):]):
        term = table.terms[keys[knob.term]]
        value, size = term.constants[knob.name], h * knob.unit(term, table)
        constants[keys[knob.term], knob.name] = (float(value - size), float(value + size))
    names: list[Number] = [*indices, *((keys[knob.term], knob.name) for knob in knobs)]
    return Intervals({k: (float(a), float(b)) for k, (a, b) in ends.items()}, constants,
                     correlations(names, coefficients))


def correlations(names: Sequence[Number], draws: np.ndarray) -> dict[tuple[Number, Number], float]:
    """Return how pairs of numbers scatter together, by ranks, the closest first.

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
