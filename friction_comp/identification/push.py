# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The inertia's share in a short push: how much a current accelerates the joint."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from friction_comp.identification.script import Sample

_TRANSIENT = 2.5e-3  # s after a step of current that are left to the current controller


def acceleration_of_push(pushed: Sequence[Sample], coasted: Sequence[Sample], strength: float,
                         sign: int) -> float:
    """Estimate k_t·n/J from a push at constant current and the coasting after it.

    Friction is much the same in both, so that the difference between the two accelerations is
    k_t·n/J times the current. It sets the velocity controller's gains, for which tens of percent
    do.

    Parameters
    ----------
    pushed, coasted : list of (time, position, ...)
        Samples in s and rad: at the constant current, then at zero current until standstill.
    strength : float
        Magnitude of the current in A.
    sign : int
        Direction of the push.

    Returns
    -------
    float
        rad/s² per A; NaN where the samples do not tell.
    """
    faster, top = _acceleration(pushed, sign)
    if not math.isfinite(faster) or top <= 0.0:
        return math.nan
    moving = []
    for sample in coasted:
        moving.append(sample)
        if len(moving) > 3 and sign * (moving[-1][1] - moving[-4][1]) <= 0.0:
            break
    slower, _ = _acceleration(moving[:max(4, int(0.8 * len(moving)))], sign)
    # A joint that stops within a few samples: all that is known is how fast it was, and when it
    # stood.
    stopping = -top / max(moving[-1][0] - coasted[0][0], 1e-4)
    if not math.isfinite(slower) or slower >= 0.0:
        slower = stopping
    rate = (faster - slower) / strength
    return rate if math.isfinite(rate) and rate > 0.0 else math.nan


def _acceleration(samples: Sequence[Sample], sign: int) -> tuple[float, float]:
    """Acceleration and final speed of a parabola through the samples, in the push's direction."""
    time = np.array([sample[0] for sample in samples])
    position = sign * np.array([sample[1] for sample in samples])
    chosen = time >= time[0] + _TRANSIENT
    if np.sum(chosen) < 5:
        if time.size < 3:
            return math.nan, math.nan
        chosen[:] = True
    t, x = time[chosen] - time[-1], position[chosen]
    bend, slope, _ = np.polyfit(t, x, 2)
    return 2.0 * float(bend), float(slope)
