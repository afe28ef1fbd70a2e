# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Detects backlash in current ramps: friction that rises more steeply again with displacement.

The friction of a gear's contacts rises more and more slowly with displacement: every contact that
begins to slide leaves fewer that still hold (in the Dahl, LuGre, Bouc-Wen and Maxwell-slip models
alike). Along a ramp it is therefore a concave function of displacement. Where teeth separate, only
the motor's own friction acts until they touch on the other side; then that of the link is added,
and the curve bends upwards. The distance of the curve below its concave hull indicates backlash,
and the displacement from the corner of the hull to the lowest point is its lower bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.identification.friction_peak import RampFriction

# Threshold on the share of breakaway by which a ramp stays below its hull, and share of the ramps
# in each direction that must exceed it: whether a ramp crosses backlash depends on where the
# previous slide left the link. Simulated gears without backlash stay below 0.03, except one with
# asymmetric friction (`bench/law_table.py --floors identification`, seeds 44 and 46); gears with
# visible backlash have 0.04 to 0.14.
_DEPTH, _SHARE = 0.04, 0.2
_COUNTS = 3.0    # the least that an encoder tells
_PLACES = 60     # of the curve


def depth_below_hull(ramp: RampFriction, resolution: float) -> tuple[float, float]:
    """Return how far one ramp's curve stays below its concave hull, and over which distance.

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
    width = max(resolution, float(np.max(ramp.measured)) / _PLACES)
    index = np.maximum.accumulate(np.maximum(0, np.rint(ramp.measured / width).astype(int)))
    count = np.bincount(index)
    # Where within a count the ramp began is unknown, so the first count is not used.
    visited = np.flatnonzero(count)[1:]
    if len(visited) < 4:
        return 0.0, 0.0
    # Acceleration of the rotor affects neither curve, or only one of them.
    depths, ways = zip(*(_below_hull(visited, np.bincount(index, current)[visited] / count[visited])
                         for current in (ramp.driven, ramp.current)))
    return min(depths), (ways[0] + 1.0) * width


def _below_hull(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the largest depth below the concave hull, and its distance from the hull's corner."""
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


def crossed_backlash(ramps: Sequence[RampFriction], directions: Sequence[int],
                     resolution: float) -> tuple[float, list[float]]:
    """Return the backlash of a gear, and what of it each ramp crossed, rad; 0 where none shows.

    Parameters
    ----------
    ramps : sequence of RampFriction
    directions : sequence of int
        +1 or -1, the ramps'.
    resolution : float
        rad of an encoder count.
    """
    softer = [depth_below_hull(ramp, resolution) for ramp in ramps]
    crossed = [way if depth > _DEPTH and way >= _COUNTS * resolution else 0.0
               for depth, way in softer]
    shares = [np.mean([way > 0.0 for way, other in zip(crossed, directions) if other == sign])
              for sign in set(directions)]
    # A contact that is stiffer on one side also curves upwards, but in one direction only.
    if len(shares) < 2 or min(shares) < _SHARE:
        return 0.0, [0.0] * len(softer)
    return float(np.median([way for way in crossed if way > 0.0])), crossed
