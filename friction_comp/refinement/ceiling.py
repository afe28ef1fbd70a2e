# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A sensor of current that ends before the current does.

With noise it repeats no value there. What is seen is a heap of values as wide as the noise at an
end of the range, in which a fit to all other samples asks for more. A drive that is at its own
limit has such a heap too, but is asked for less as often: its current is what it is.
"""

from __future__ import annotations

import numpy as np

from friction_comp.refinement.attempt import Found
from friction_comp.refinement.columns import proposals
from friction_comp.refinement.judge import noise_floor
from friction_comp.refinement.sums import solve

# Standard deviations of noise: half the width of a heap, and by how much more the fit asks for.
_HEAP, _MORE = 4.0, 3.0
# Times as many samples as in the range beside it, and share of all samples.
_HIGH, _FEWEST = 1.5, 0.005
# Share of a heap for which more is asked, and for which less may be.
_ASKS, _LESS = 0.3, 0.1


def saturated(found: Found) -> np.ndarray:
    """Return which samples are at a limit of the sensor, shape (N,).

    Parameters
    ----------
    found : Found
        A search that took all samples as they are.
    """
    rows, table = found.rows, found.table
    noise = noise_floor(rows, found.residual())
    keys = list(dict.fromkeys([*found.keys, *table.add(
        [term for term in proposals(table, []) if term.kind.physics])]))
    indices = table.indices(keys, derivatives=False)
    columns = table.columns[indices]
    mark = np.zeros(len(rows.samples), dtype=bool)
    for side in (1.0, -1.0):
        value = side * rows.samples.current
        level = float(np.median(value[value > value.max() - 2.0 * _HEAP * noise]))
        heap = np.abs(value - level) < _HEAP * noise
        below = (value <= level - _HEAP * noise) & (value > level - 3.0 * _HEAP * noise)
        if heap.sum() < max(_HIGH * below.sum(), _FEWEST * len(value)):
            continue
        inner = heap[rows.start]
        if not inner.any() or np.sum(~inner) < 10 * len(indices):
            continue
        outside = np.vstack((columns, table.target))[:, ~inner]
        norms = np.sqrt(np.einsum('ij,ij->i', outside[:-1], outside[:-1])) + 1e-300
        gains = solve((outside @ outside.T)[None], norms, table.sums.signs[indices])[0]
        asked = side * (gains @ columns[:, inner])
        if (np.mean(asked > level + _MORE * noise) > _ASKS
                and np.mean(asked < level - _MORE * noise) < _LESS):
            mark |= value > level - 0.5 * _HEAP * noise
    return mark
