# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How states with memory move from one sample to the next, in plain arithmetic: see `Effect.step`.

So they run for one sample and, in `model.compiled`, for a long recording.
"""

from __future__ import annotations

import math
from typing import Any


def dahl_step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    """Return Dahl's state z after a step of position, solved exactly.

    dz/dq = (1 - z·sgn(dq))^p / distance (Dahl 1968): p < 1 reverses within a finite distance.
    """
    if dq == 0.0:
        return state
    sign = 1.0 if dq > 0.0 else -1.0
    # Remaining part of the reversal, 0..2.
    remaining = 1.0 - sign * state
    if remaining <= 0.0:
        return sign
    travel = abs(dq) / c.distance
    if abs(c.exponent - 1.0) < 1e-6:
        remaining *= math.exp(-travel)
    else:
        power = remaining ** (1.0 - c.exponent) - (1.0 - c.exponent) * travel
        remaining = power ** (1.0 / (1.0 - c.exponent)) if power > 0.0 else 0.0
    return sign * (1.0 - remaining)


def backlash_step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    """Return how far the joint is from the middle of its backlash, rad."""
    reach = 0.5 * c.gap + c.distance
    return min(reach, max(-reach, state + dq))


def rest_step(state: float, dt: float, dq: float, velocity: float, c: Any) -> float:
    """Return the share of the friction gained at rest, 0..1, one sample later.

    It grows with the time below the constant `velocity`, and fades over a distance of motion.
    """
    if abs(velocity) < c.velocity:
        return 1.0 - (1.0 - state) * math.exp(-dt / c.time_constant)
    return state * math.exp(-abs(dq) / c.distance)
