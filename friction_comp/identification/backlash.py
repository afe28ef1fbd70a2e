# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Backlash, from current ramps: friction that rises steeper again the farther the motor has gone.

The friction of a gear's contacts rises ever less with the way: every contact that begins to slide
leaves fewer that still hold (Dahl, LuGre, Bouc-Wen and Maxwell slip alike). So along a ramp it is
a concave curve of the way. Where teeth come apart, the motor meets its own friction alone until
they touch on the other side; then the link's is added, and the curve turns up. How far it stays
below its concave hull tells of backlash, and the way from the hull's corner to the lowest place is
the least that it can be. A motor that springs back at the end of a slide crosses the backlash, or
part of it, on the ramps after slides one way, and seldom on the others: each kind is looked at by
itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.identification.friction_peak import RampFriction

# Share of breakaway by which three ramps of four stay below their hull. Of 48 simulated gears that
# have no backlash (`bench/law_table.py`, seeds 44 and 46) the most is 0.02; of those with backlash
# that show it 0.043 to 0.16.
_DEPTH = 0.04
# Backlash is the same on each ramp: the standard deviation of its size, as a share.
_SPREAD = 0.35
_COUNTS = 3.0    # the least that an encoder tells
_PLACES = 60     # of the curve


def softer_way(ramp: RampFriction, resolution: float) -> tuple[float, float]:
    """Return how far one ramp's curve stays below its concave hull, and over which way.

    Parameters
    ----------
    ramp : RampFriction
    resolution : float
        rad of an encoder count.

    Returns
    -------
    depth, way : float
        Share of the most that friction took, and rad.
    """
    place = max(resolution, float(np.max(ramp.measured)) / _PLACES)
    index = np.maximum.accumulate(np.maximum(0, np.rint(ramp.measured / place).astype(int)))
    count = np.bincount(index)
    # Within which part of a count the ramp began is not known, so the first one tells nothing.
    found = np.flatnonzero(count)[1:]
    if len(found) < 4:
        return 0.0, 0.0
    # What accelerates the rotor shows on neither curve, or on one alone.
    depths, ways = zip(*(_below_hull(found, np.bincount(index, current)[found] / count[found])
                         for current in (ramp.driven, ramp.current)))
    return min(depths), (ways[0] + 1.0) * place


def _below_hull(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return how far points stay below their concave hull, and the way from its corner to there."""
    corners = [0]
    for k in range(1, len(x)):
        while len(corners) > 1 and _rises(x, y, corners[-2], corners[-1], k):
            corners.pop()
        corners.append(k)
    gap = np.interp(x, x[corners], y[corners]) - y
    lowest = int(np.argmax(gap))
    before = corners[int(np.searchsorted(corners, lowest, side='right')) - 1]
    return float(gap[lowest] / np.max(y)), float(x[lowest] - x[before])


def _rises(x: np.ndarray, y: np.ndarray, i: int, j: int, k: int) -> bool:
    return bool((y[j] - y[i]) * (x[k] - x[j]) <= (y[k] - y[j]) * (x[j] - x[i]))


def crossed_backlash(ramps: Sequence[RampFriction], resolution: float) -> float:
    """Return the backlash in rad that ramps of one kind cross, 0 where none shows.

    Parameters
    ----------
    ramps : sequence of RampFriction
        After slides to the same side, as seen from the ramp.
    resolution : float
        rad of an encoder count.
    """
    if not ramps:
        return 0.0
    depths, ways = np.array([softer_way(ramp, resolution) for ramp in ramps]).T
    size = float(np.median(ways))
    if (np.quantile(depths, 0.25) < _DEPTH or size < _COUNTS * resolution
            or float(np.std(ways)) > _SPREAD * size):
        return 0.0
    return size
