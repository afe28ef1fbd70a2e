# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Selects effects forward, backward and by exchange, on block sums alone.

One criterion decides: the error of blocks that were not fitted. An effect is borne out where it
lowers that error by a share worth naming, and by two standard errors over the blocks.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

import numpy as np

from friction_comp.refinement.effect_columns import Key, Table
from friction_comp.refinement.joint_groups import plain_name
from friction_comp.refinement.thresholds import LEAST_SHARE, MOST_EFFECTS, OWN, STANDARD_ERRORS

# An effect stays in a fit where half of what it takes to come in speaks for it.
_STAYS = 0.5
# Kinds that are compared on blocks not fitted, those that explain most where they are fitted.
SHORT_LIST = 6


class Split:
    """How fits are judged by what they were not fitted to.

    Each block is predicted by the fit to all others. Where several joints moved, so is each
    region of posture: most excitations come by the same postures again and again, and a wrong
    term that fits these would pass.

    Parameters
    ----------
    table : Table
    weights : ndarray of int, shape (B,), optional
        How often each block is drawn; those that are not are the ones that judge. All blocks
        count once, and each is left out in turn, when omitted.
    """

    def __init__(self, table: Table, weights: np.ndarray | None = None) -> None:
        self._table, self._drawn = table, weights is not None
        self._weights = np.ones(table.sums.blocks) if weights is None else weights[table.block]
        self._regions = len(np.unique(table.region)) > 1
        # Few blocks judge a draw: too few for a test of their mean.
        self._errors = 1.0 if self._drawn else float(STANDARD_ERRORS)

    @classmethod
    def drawn(cls, table: Table, rng: np.random.Generator) -> Split:
        """Return a split that draws blocks with replacement and is judged by the others."""
        blocks = int(table.block.max()) + 1
        while True:
            weights = np.bincount(rng.integers(0, blocks, blocks), minlength=blocks)
            if np.sum(weights == 0) > 2:
                return cls(table, weights)

    @property
    def total(self) -> np.ndarray:
        """The sums over all blocks that are fitted, shape (P + 1, P + 1)."""
        return np.tensordot(self._weights, self._table.sums.gram, 1)

    def errors(self, columns: Sequence[int]) -> list[np.ndarray]:
        """Return the squared errors of what was not fitted: of blocks, and of regions in them."""
        sums, table = self._table.sums, self._table
        if self._drawn:
            coefficients = sums.fits(columns, self._weights[None])
            errors = sums.squares(columns, np.repeat(coefficients, sums.blocks, axis=0))
            return [errors[self._weights == 0.0]]
        blocks = np.bincount(table.block, sums.left_out(columns, table.block))
        if not self._regions:
            return [blocks]
        return [blocks, sums.left_out(columns, table.region)]

    def borne_out(self, before: Sequence[np.ndarray], after: Sequence[np.ndarray],
                  share: float = 1.0) -> bool:
        """Return whether errors are lower by more than chance makes them.

        Where several joints moved, a term has to help in regions of posture that were not
        fitted, too.

        Parameters
        ----------
        before, after : sequence of ndarray
            As of `errors`.
        share : float
            Of what is usually asked.
        """
        for old, new in zip(before, after):
            gain = old - new
            # By its own size in each block: a block in which all is larger would decide alone.
            ratio = gain / np.maximum(old + new, 1e-300)
            error = float(np.std(ratio, ddof=1)) / math.sqrt(len(gain))
            if not (gain.sum() > share * LEAST_SHARE * old.sum()
                    and ratio.mean() > share * self._errors * error):
                return False
        return True


def total(errors: Sequence[np.ndarray]) -> float:
    """Return the sum of all errors."""
    return float(sum(own.sum() for own in errors))


def gains(sums: np.ndarray, chosen: Sequence[int], places: Sequence[Sequence[int]],
          signs: np.ndarray) -> np.ndarray:
    """Return by how much each candidate lowers the sum of squares of what is fitted.

    Parameters
    ----------
    sums : ndarray, shape (P + 1, P + 1)
        Of products, the target last.
    chosen : sequence of int
        Columns of the fit.
    places : sequence of sequence of int
        Columns of each candidate.
    signs : ndarray of int, shape (P,)
    """
    norm = np.sqrt(np.maximum(np.diag(sums), 1e-300))
    scaled = sums / norm / norm[:, None]
    inner = np.asarray(chosen)
    had = np.linalg.solve(scaled[np.ix_(inner, inner)] + 1e-8 * np.eye(len(inner)), scaled[inner])
    reductions = np.zeros(len(places))
    sizes = np.array([len(own) for own in places])
    for size in np.unique(sizes[sizes > 0]):
        which = np.nonzero(sizes == size)[0]
        own = np.array([places[int(k)] for k in which])
        left = scaled[own[:, :, None], own[:, None, :]] - np.einsum(
            'snm,snk->nmk', scaled[inner][:, own], had[:, own])
        goal = scaled[own, -1] - np.einsum('snm,s->nm', scaled[inner][:, own], had[:, -1])
        left[:, np.arange(size), np.arange(size)] += 1e-6
        step = np.linalg.solve(left, goal[:, :, None])[:, :, 0]
        gain = np.einsum('nm,nm->n', goal, step)
        if size == 1:
            gain = np.where((signs[own[:, 0]] > 0) & (step[:, 0] < 0.0), 0.0, gain)
        reductions[which] = gain
    return reductions * norm[-1] ** 2


@dataclass
class Search:
    """A search among the terms of a table.

    Parameters
    ----------
    table : Table
    split : Split
    candidates : list of Key
        Terms that may be added.
    fixed : sequence of Key
        Terms that stay.
    improve : callable, optional
        Called with the terms after one was added; returns them with better constants, and may
        change `candidates`.
    """

    table: Table
    split: Split
    candidates: list[Key]
    fixed: Sequence[Key] = ()
    improve: Callable[[list[Key]], list[Key]] | None = None

    def errors(self, keys: Sequence[Key]) -> list[np.ndarray]:
        """Return the squared errors of what was not fitted with some terms."""
        return self.split.errors(self.table.indices(keys))

    def error(self, keys: Sequence[Key]) -> float:
        """Return the sum of these errors."""
        return total(self.errors(keys))

    def complete(self, keys: Sequence[Key]) -> list[Key]:
        """Return terms with the joint's own terms that groups of other joints need.

        An inertia that other joints change, or a weight that they share, is one of the joint to
        begin with: the group alone would have to stand in for both, and fail in other postures.
        """
        own = {plain_name(key[-1]) for key in keys if key[-1] is not None}
        own -= {key[0] for key in keys if key[-1] is None}
        return [*keys, *(key for key in self.table.terms if key[-1] is None and key[0] in own)]

    def told_apart(self, keys: Sequence[Key]) -> list[Key]:
        """Return the terms without those that the others repeat, the last first.

        Over a short range a spring is a weight, and at one speed curvature is an offset: large
        coefficients that cancel would take part in every fit, and mislead wherever the joint
        has not been.
        """
        keys = list(keys)
        while True:
            places = self.table.indices(keys, derivatives=False)
            share = dict(zip(places, self.table.sums.own_share(places)))
            repeated = [key for key in keys if key not in self.fixed and max(
                share[column] for column in self.table.columns_of(key)) < OWN]
            if not repeated:
                return keys
            keys.remove(repeated[-1])

    def likeliest(self, keys: Sequence[Key], count: int = SHORT_LIST) -> list[Key]:
        """Return the best candidate of each kind by what it explains where it is fitted."""
        counts = Counter(key[0] for key in keys)
        allowed = [key for key in self.candidates if key not in keys and (
            key[-1] is not None or counts[key[0]] < self.table.terms[key].kind.most)]
        if not allowed:
            return []
        size = gains(self.split.total, self.table.indices(keys),
                     [self.table.columns_of(key) for key in allowed], self.table.sums.signs)
        best: dict[Key, tuple[float, Key]] = {}
        for gain, key in zip(size, allowed):
            kind = (key[0], key[-1])
            if gain > best.get(kind, (0.0, ()))[0]:
                best[kind] = (float(gain), key)
        order = sorted(best.values(), key=lambda entry: -entry[0])
        return [key for _, key in order[:count]]

    def forward(self, keys: Sequence[Key]) -> list[Key]:
        """Add terms as long as one is borne out, and remove those that are no longer missed."""
        keys = list(keys)
        before = self.errors(keys)
        while len(keys) < MOST_EFFECTS:
            trials = []
            for key in self.likeliest(keys):
                after = self.errors(self.complete([*keys, key]))
                if (self.split.borne_out(before, after)
                        and len(self.told_apart([*keys, key])) > len(keys)):
                    trials.append((total(after), key))
            if not trials:
                break
            grown = self.complete([*keys, min(trials, key=lambda trial: trial[0])[1]])
            transition = self.table.steepness, self.table.shift
            if self.improve:
                grown = self.improve(grown)
            grown = self.backward(grown)
            now = self.errors(grown)
            if not total(now) < total(before):
                if self.improve:
                    self.table.turned(*transition)
                break
            keys, before = grown, now
        return keys

    def backward(self, keys: Sequence[Key]) -> list[Key]:
        """Remove terms, those first that are missed least, as long as one is not borne out."""
        keys = self.complete(keys)
        while True:
            full = self.errors(keys)
            least: tuple[float, Key] | None = None
            for key in keys:
                rest = [other for other in keys if other != key]
                if key in self.fixed or key in self.complete(rest):
                    continue
                without = self.errors(rest)
                stays = 1.0 if key[-1] is not None else _STAYS
                if not self.split.borne_out(without, full, stays) and (
                        least is None or total(without) < least[0]):
                    least = (total(without), key)
            if least is None:
                return keys
            keys.remove(least[1])

    def exchange(self, keys: Sequence[Key]) -> list[Key]:
        """Exchange terms for others of another kind where that lowers the error."""
        keys = list(keys)
        for key in list(keys):
            if key in self.fixed:
                continue
            rest = [other for other in keys if other != key]
            most = self.error(keys) * (1.0 - _STAYS * LEAST_SHARE)
            trials = [(self.error([*rest, other]), other)
                      for other in self.likeliest(rest)
                      if (other[0], other[-1]) != (key[0], key[-1])
                      and len(self.told_apart([*rest, other])) > len(rest)]
            error, other = min(trials, default=(math.inf, key), key=lambda trial: trial[0])
            if error < most:
                keys[keys.index(key)] = other
        return keys
