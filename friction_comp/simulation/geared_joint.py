# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint of two inertias: LuGre or Maxwell-slip friction, gear compliance, motor and supply.

At the gear's output, with the rotor at φ, where encoder and friction act, and the link at θ,

``J_m·φ'' = k_t·n·i - F - K·(φ - θ) - C·(φ' - θ')``
``J_l·θ'' = K·(φ - θ) + C·(φ' - θ') + τ_human``

In presliding, friction F depends on displacement; in sliding, it is the level g(|φ'|) of
`friction_level`:

- Maxwell slip: parallel elements j of stiffness k_j, damping c_j and share w_j, each
  ``clamp(k_j·z_j + c_j·φ', ±w_j·g)``. Element j slips after its own distance; the largest of
  these is the presliding distance. Sliding levels follow the speed with a lag, as in the
  generalised Maxwell-slip model (Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control
  50(11), 2005). A single element is the clamp of `rigid_joint`, but with a second inertia.
- LuGre (Canudas de Wit, Olsson, Åström and Lischinsky, IEEE Trans. Automatic Control 40(3),
  1995): ``z' = φ' - σ0·|φ'|·z/g``, ``F = σ0·z + σ1·e^(-(φ'/v_s)²)·z'``; the presliding distance
  is g_b/σ0.

The current follows its command with the amplifier's time constant, within the limits set by the
supply voltage and the back-EMF.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.low_pass import low_pass_weight
from friction_comp.simulation.friction_level import draw_levels, friction_level, LEAST_LEVEL
from friction_comp.simulation.joint_parameters import LUGRE, Record
from friction_comp.simulation.person import follow_reference
from friction_comp.simulation.undeclared import undeclared_torque

SUBSTEPS = 16
SETTLING = 0.005
"""Time without sliding after which a joint sticks again, s."""


@njit(cache=True)
def _lugre_force(p: Record, s: Record, v: float, level: float, h: float) -> float:
    """Advance the LuGre bristle (exact for constant speed) and return its torque in N·m."""
    limit = level / p.bristle_stiffness
    steady = limit if v > 0.0 else -limit
    before = s.bristle[0]
    share = -math.expm1(-abs(v) * h / limit)
    s.bristle[0] += (steady - before) * share
    rate = (s.bristle[0] - before) / h
    damping = p.bristle_damping * math.exp(-(v / p.stribeck_velocity) ** 2)
    s.sliding = 1 if abs(s.bristle[0]) > 0.98 * limit and s.bristle[0] * v > 0.0 else 0
    return p.bristle_stiffness * s.bristle[0] + damping * rate


@njit(cache=True)
def _maxwell_force(p: Record, s: Record, v: float, level: float, h: float) -> float:
    """Advance the Maxwell-slip elements and return their torque in N·m."""
    total, slipping = 0.0, 0
    for j in range(p.elements):
        stiffness = p.share[j] * 0.5 * (p.break_positive + p.break_negative) / p.distance[j]
        damping = p.bristle_damping * p.share[j]
        most = p.share[j] * level
        s.bristle[j] += v * h
        force = stiffness * s.bristle[j] + damping * v
        if abs(force) > most:
            force = math.copysign(most, force)
            reach = most / stiffness
            s.bristle[j] = min(reach, max(-reach, s.bristle[j]))
            slipping += 1
        total += force
    s.sliding = 1 if slipping == p.elements else 0
    return total


@njit(cache=True)
def move_geared(p: Record, s: Record, random: np.ndarray, table: np.ndarray, memory: np.ndarray,
                sample_time: float, command: float, reference_position: float,
                reference_velocity: float, active: bool) -> None:
    """Simulate the joint over one sample; the person holds the link, see `joint.joint_sample`."""
    h = sample_time / SUBSTEPS
    amplify = low_pass_weight(h, p.current_lag)
    follow = low_pass_weight(h, p.actuation_lag)
    adapt = low_pass_weight(h, p.level_lag)
    reaction_weight = low_pass_weight(h, p.human_response)
    start = s.samples * sample_time
    for k in range(SUBSTEPS):
        v = s.rotor_speed
        wanted = command
        if p.resistance > 0.0:
            highest = (p.voltage - p.back_emf * v) / p.resistance
            lowest = (-p.voltage - p.back_emf * v) / p.resistance
            wanted = min(highest, max(lowest, command))
        s.current += (wanted - s.current) * amplify
        s.late_current += (s.current - s.late_current) * follow
        follow_reference(p, s, h, reaction_weight, active,
                         reference_position + reference_velocity * k * h, reference_velocity,
                         s.link, s.link_speed)
        # The level depends on the direction in which the joint slides or would slide.
        direction = v if v != 0.0 else s.late_current
        level, load = friction_level(p, s, abs(v), direction > 0.0), 0.0
        if table.shape[0] > 0 and table[0, 0] >= 0.0:
            load, extra = undeclared_torque(table, memory, start + k * h, s.rotor, v, s.human,
                                            s.temperature, s.rest, level)
            level = max(level + extra, LEAST_LEVEL * level)
        s.level += (level - s.level) * adapt
        if p.kind == LUGRE:
            friction = _lugre_force(p, s, v, s.level, h)
        else:
            friction = _maxwell_force(p, s, v, s.level, h)
        spring = p.gear_stiffness * (s.rotor - s.link) + p.gear_damping * (v - s.link_speed)
        s.rotor_speed += h * (
            p.torque_per_current * s.late_current + load - friction - spring) / p.motor_inertia
        s.link_speed += h * (spring + s.human) / p.link_inertia
        s.rotor += h * s.rotor_speed
        s.link += h * s.link_speed
        if s.sliding > 0:
            s.rest = 0.0
        else:
            before = s.rest
            s.rest += h
            if before <= SETTLING < s.rest:
                draw_levels(p, s, random)
