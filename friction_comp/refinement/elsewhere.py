# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Estimates errors on other recordings, by extrapolating to parts of this one.

The next recording will differ from this one in speed, position, time or posture. So each third of
the range of each of these is predicted by a fit to the other thirds. A term that increases these
errors is not named, and the largest of them is the error expected elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
import math

import numpy as np

from friction_comp.refinement.effect_columns import Key, Table
from friction_comp.refinement.sums import BlockSums
from friction_comp.refinement.thresholds import USELESS_ERROR

PARTS = 'parts'


class Elsewhere:
    """Sums over thirds of speed, position, time, acceleration, and over regions of posture.

    Parameters
    ----------
    table : Table
    keys : sequence of Key
        Terms that may be in the fits.
    """

    def __init__(self, table: Table, keys: Sequence[Key]) -> None:
        rows, averages = table.rows, table.rows.at_rows
        columns = table.indices(keys, derivatives=False)
        self._table, self._column_index = table, {column: k for k, column in enumerate(columns)}
        variables = {'speed': np.abs(np.asarray(averages.velocity)), 'position': averages.position,
                     'time': np.arange(len(table.target)),
                     'acceleration': np.abs(np.asarray(averages.acceleration))}
        partitions = {name: np.searchsorted(np.quantile(values, (1 / 3, 2 / 3)), values,
                                            side='right')
                      for name, values in variables.items()}
        partitions[PARTS] = rows.block
        if rows.joints:
            partitions['posture'] = np.unique(rows.region, return_inverse=True)[1]
        full = np.vstack((table.columns[columns], table.target))
        self._sums = {}
        for name, part_of_row in partitions.items():
            parts = [full[:, part_of_row == k] for k in range(int(part_of_row.max()) + 1)]
            self._sums[name] = BlockSums(
                np.array([part @ part.T for part in parts]),
                np.array([part.shape[1] for part in parts]), table.sums.signs[columns])

    def squares(self, keys: Sequence[Key]) -> dict[str, float]:
        """Return the sum of squared errors of each partition, the blocks of time among them."""
        columns = [self._column_index[column] for column in self._table.indices(
            keys, derivatives=False)]
        return {name: max(float(sums.left_out(columns).sum()), 1e-300)
                for name, sums in self._sums.items()}

    def growth(self, keys: Sequence[Key]) -> dict[str, float]:
        """Return the ratio of each partition's error to that of blocks of time."""
        errors = self.squares(keys)
        least = errors.pop(PARTS)
        return {name: math.sqrt(error / least) for name, error in errors.items()}

    def helpful(self, keys: Sequence[Key], given: int) -> list[Key]:
        """Return the terms without those that increase these errors, the worst removed first.

        Parameters
        ----------
        keys : sequence of Key
        given : int
            Number of terms at the start that are kept in any case.
        """
        keys = list(keys)
        error = self._score(keys)
        while True:
            removable = keys[given:]
            # Two terms that cancel help only together, and mislead together.
            trials = [(self._score([key for key in keys if key not in removed]), removed)
                      for size in (1, 2) for removed in combinations(removable, size)]
            lowest, removed = min(trials, default=(math.inf, ()), key=lambda trial: trial[0])
            if not (lowest < error or (removable and self._useless(keys))):
                return keys
            error = lowest
            keys = [key for key in keys if key not in removed]

    def _score(self, keys: Sequence[Key]) -> float:
        """Return the mean logarithm of these errors, so that no single partition decides."""
        return float(np.mean(np.log(list(self.squares(keys).values()))))

    def _useless(self, keys: Sequence[Key]) -> bool:
        """Return whether zero would predict some part about as well."""
        target = self._table.target
        worst = max(self.squares(keys).values())
        return worst > USELESS_ERROR ** 2 * float(target @ target)
