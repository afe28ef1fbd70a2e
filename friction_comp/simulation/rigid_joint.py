# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint of one inertia with clamp friction, for model files without `gear`.

At the gear's output, the joint obeys

``J·dω/dt = k_t·n·i + τ_human + τ_load - F``

Friction F is that of an elastic bristle of stiffness σ0 and damping σ1 that slips at the level g of
`friction_level`: ``F = clamp(σ0·z + σ1·ω, -g, +g)``. Below this level there is no drift, however
long or often the joint is pushed: unlike Dahl's and LuGre's models, it has true stiction
(elasto-plastic friction: Dupont, Hayward, Armstrong and Altpeter, IEEE Trans. Automatic Control
47(5), 2002, here with its plastic range shrunk to a point).
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.low_pass import low_pass_weight
from friction_comp.simulation.friction_level import draw_levels, friction_level, LEAST_LEVEL
from friction_comp.simulation.joint_parameters import Record
from friction_comp.simulation.person import follow_reference
from friction_comp.simulation.undeclared import undeclared_torque

SUBSTEPS = 8
SETTLING = 0.0005
"""Time without slip after which a joint sticks again, s."""


@njit(cache=True)
def clamped_friction(p: Record, s: Record, stuck: float, extra: float, speed: float, h: float
                     ) -> tuple[float, bool]:
    """Return friction in N·m, and whether the bristle slips; `stuck` is its speed if not.

    `speed` determines the level of friction, to which undeclared effects add `extra` N·m.
    """
    force = p.bristle_stiffness * (s.bristle[0] + h * stuck) + p.bristle_damping * stuck
    base = friction_level(p, s, speed, force > 0.0)
    level = max(base + extra, LEAST_LEVEL * base)
    if abs(force) <= level:
        return force, False
    return math.copysign(level, force), True


@njit(cache=True)
def move_bristle(p: Record, s: Record, random: np.ndarray, v: float, friction: float, slips: bool,
                 h: float) -> None:
    """Advance the bristle by a substep of h s at speed v; draw new levels when the joint sticks."""
    s.bristle[0] += h * v
    if not slips:
        s.rest += h
        if s.sliding == 1 and s.rest > SETTLING:
            s.sliding = 0
            s.slid = 0.0
            draw_levels(p, s, random)
        return
    limit = abs(friction) / p.bristle_stiffness
    s.bristle[0] = min(limit, max(-limit, s.bristle[0]))
    s.rest = 0.0
    s.sliding = 1
    s.slid += h * abs(v)
    # Far enough for new breakaway levels.
    if s.slid > 3.0 * limit:
        s.slid = 0.0
        draw_levels(p, s, random)


@njit(cache=True)
def move_rigid(p: Record, s: Record, random: np.ndarray, table: np.ndarray, memory: np.ndarray,
               sample_time: float, command: float, reference_position: float,
               reference_velocity: float, active: bool) -> None:
    """Simulate the joint over one sample; parameters as for `joint.joint_sample`."""
    h = sample_time / SUBSTEPS
    # The current follows its command at once; an undeclared lag acts between current and torque.
    s.current = command
    follow = low_pass_weight(h, p.actuation_lag)
    reaction_weight = low_pass_weight(h, p.human_response)
    start = s.samples * sample_time
    sigma0, sigma1, over_inertia = p.bristle_stiffness, p.bristle_damping, h / p.motor_inertia
    implicit = 1.0 / (1.0 + over_inertia * (sigma1 + h * sigma0))
    for k in range(SUBSTEPS):
        s.late_current += (command - s.late_current) * follow
        x, v = s.rotor, s.rotor_speed
        follow_reference(p, s, h, reaction_weight, active,
                         reference_position + reference_velocity * k * h, reference_velocity, x, v)
        torque = p.torque_per_current * s.late_current + s.human
        # Speed without slip, by an implicit step; its direction determines the level.
        stuck = (v + over_inertia * (torque - sigma0 * s.bristle[0])) * implicit
        extra = 0.0
        if table.shape[0] > 0 and table[0, 0] >= 0.0:
            base = friction_level(p, s, abs(v), sigma0 * s.bristle[0] + sigma1 * stuck > 0.0)
            load, extra = undeclared_torque(table, memory, start + k * h, x, v, s.human,
                                            s.temperature, s.rest, base)
            torque += load
            stuck = (v + over_inertia * (torque - sigma0 * s.bristle[0])) * implicit
        friction, slips = clamped_friction(p, s, stuck, extra, abs(v), h)
        v = v + over_inertia * (torque - friction) if slips else stuck
        move_bristle(p, s, random, v, friction, slips, h)
        s.rotor_speed = s.link_speed = v
        s.rotor = s.link = x + h * v
