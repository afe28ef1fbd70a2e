# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of a fit on the parts of a recording that differ most from what was fitted.

The next recording differs from this one in speed, place, time or posture. So each third of each of
these is predicted by a fit to the other thirds. A term that makes these errors larger is not named,
and the largest of them is what the model is said to have elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
import math

import numpy as np

from friction_comp.refinement.effect_columns import Key, Table
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import EXPLAINS_NOTHING

PARTS = 'parts'


class Elsewhere:
    """Sums over thirds of speed, position, time, acceleration, and over regions of posture.

    Parameters
    ----------
    table : Table
    keys : sequence of Key
        Terms that may be asked about.
    """

    def __init__(self, table: Table, keys: Sequence[Key]) -> None:
        rows, part = table.rows, table.rows.at_rows
        columns = table.indices(keys, derivatives=False)
        self._table, self._columns_of = table, {column: k for k, column in enumerate(columns)}
        ways = {'speed': np.abs(np.asarray(part.velocity)), 'position': part.position,
                'time': np.arange(len(table.target)),
                'acceleration': np.abs(np.asarray(part.acceleration))}
        cuts = {name: np.searchsorted(np.quantile(values, (1 / 3, 2 / 3)), values, side='right')
                for name, values in ways.items()}
        cuts[PARTS] = rows.block
        if rows.joints:
            cuts['posture'] = np.unique(rows.region, return_inverse=True)[1]
        full = np.vstack((table.columns[columns], table.target))
        self._sums = {}
        for name, group in cuts.items():
            members = [full[:, group == k] for k in range(int(group.max()) + 1)]
            self._sums[name] = BlockSums(
                np.array([own @ own.T for own in members]),
                np.array([own.shape[1] for own in members]), table.sums.signs[columns])

    def squares(self, keys: Sequence[Key]) -> dict[str, float]:
        """Return the sum of squared errors of each way to cut, interleaved parts among them."""
        own = [self._columns_of[column] for column in self._table.indices(keys, derivatives=False)]
        return {name: max(float(sums.left_out(own).sum()), 1e-300)
                for name, sums in self._sums.items()}

    def growth(self, keys: Sequence[Key]) -> dict[str, float]:
        """Return how many times as large errors are as those of interleaved parts, by way."""
        errors = self.squares(keys)
        least = errors.pop(PARTS)
        return {name: math.sqrt(error / least) for name, error in errors.items()}

    def helpful(self, keys: Sequence[Key], given: int) -> list[Key]:
        """Return the terms without those that make these errors larger, the worst first.

        Parameters
        ----------
        keys : sequence of Key
        given : int
            How many of the first stay whatever they do.
        """
        keys = list(keys)
        error = self._score(keys)
        while True:
            some = keys[given:]
            # Two that cancel are of use together alone, and mislead together.
            trials = [(self._score([key for key in keys if key not in out]), out)
                      for size in (1, 2) for out in combinations(some, size)]
            least, out = min(trials, default=(math.inf, ()), key=lambda trial: trial[0])
            if not (least < error or (some and self._useless(keys))):
                return keys
            error = least
            keys = [key for key in keys if key not in out]

    def _score(self, keys: Sequence[Key]) -> float:
        """Return the mean logarithm of these errors, so that no single cut decides."""
        return float(np.mean(np.log(list(self.squares(keys).values()))))

    def _useless(self, keys: Sequence[Key]) -> bool:
        """Return whether zero would predict some third about as well."""
        target = self._table.target
        worst = max(self.squares(keys).values())
        return worst > EXPLAINS_NOTHING ** 2 * float(target @ target)
