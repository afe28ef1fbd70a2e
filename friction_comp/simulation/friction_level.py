# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The sliding friction of a simulated joint, from breakaway to Eq. 6.

``g(ω) = max(|f̂(ω)|, g0 + (P - g0)·(1 - e)) + (g_b - g0)·e    with e = exp(-|ω|/ω_s)``

with f̂ of Eq. 6 and its plateau P, the breakaway level g_b, which is drawn again whenever the joint
comes to stick, and ``g0 = min(mean g_b, P)``. The note's sigmoid passes through zero near
standstill, but true friction starts at the breakaway level, and follows the sigmoid with the note's
coefficients (Eq. 11) only beyond the transition.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.model.sigmoid import kinetic_current
from friction_comp.simulation.joint_parameters import Record
from friction_comp.simulation.random_sequence import normal

compiled_kinetic_current = njit(cache=True)(kinetic_current)
LEAST_LEVEL = 0.05
"""Smallest friction that undeclared effects may leave, as a share of the declared level."""


@njit(cache=True)
def draw_levels(p: Record, s: Record, random: np.ndarray) -> None:
    """Draw the breakaway levels that are valid until the joint sticks again."""
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_positive = max(0.1 * p.break_positive, p.break_positive + p.std_positive * scatter)
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_negative = max(0.1 * p.break_negative, p.break_negative + p.std_negative * scatter)


@njit(cache=True)
def friction_level(p: Record, s: Record, speed: float, positive: bool) -> float:
    """Return g in N·m at a speed (rad/s, not negative) for one direction of sliding."""
    fade = math.exp(-speed / p.stribeck_velocity)
    if positive:
        sign, plateau, floor, level = 1.0, p.upper, p.floor_positive, s.level_positive
    else:
        sign, plateau, floor, level = -1.0, -p.lower, p.floor_negative, s.level_negative
    kinetic = sign * compiled_kinetic_current(
        sign * speed, p.upper, p.lower, p.steepness, p.shift, p.viscous)
    return max(kinetic, plateau - (plateau - floor) * fade) + (level - floor) * fade
