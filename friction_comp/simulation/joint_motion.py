# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The motion of a joint over a sample: levels of friction, the person, one inertia or two.

**Level**: ``g(ω) = max(|f̂(ω)|, g0 + (P - g0)·(1 - e)) + (g_b - g0)·e  with  e = exp(-|ω|/ω_s)``
with f̂ of Eq. 6 and its plateau P, the breakaway level g_b, which is drawn again whenever the joint
comes to stick, and ``g0 = min(mean g_b, P)``. The note's sigmoid passes through zero near
standstill, but true friction starts at the breakaway level, and follows the sigmoid with the note's
coefficients (Eq. 11) only beyond the transition.

**The person** is a spring and a damper between reference and joint, with a reaction time. If the
joint has not arrived when the reference movement ends, the person's torque increases until it does.

**One inertia** (model files without `gear`): ``J·dω/dt = k_t·n·i + τ_human + τ_load - F`` with
friction of an elastic bristle of stiffness σ0 and damping σ1, ``F = clamp(σ0·z + σ1·ω, -g, +g)``.
Below this level there is no drift, however long or often the joint is pushed: unlike Dahl's and
LuGre's models, it has true stiction (elasto-plastic friction: Dupont, Hayward, Armstrong and
Altpeter, IEEE Trans. Automatic Control 47(5), 2002, with its plastic range shrunk to a point).

**Two inertias**: with the rotor at φ, where encoder and friction act, and the link at θ,

``J_m·φ'' = k_t·n·i - F - K·(φ - θ) - C·(φ' - θ')``
``J_l·θ'' = K·(φ - θ) + C·(φ' - θ') + τ_human``

In presliding, friction F depends on displacement; in sliding, it is the level g(|φ'|) of
the level above:

- Maxwell slip: parallel elements j of stiffness k_j, damping c_j and share w_j, each
  ``clamp(k_j·z_j + c_j·φ', ±w_j·g)``. Element j slips after its own distance; the largest of
  these is the presliding distance. Sliding levels follow the speed with a lag, as in the
  generalised Maxwell-slip model (Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control
  50(11), 2005). A single element is the clamp, but with a second inertia.
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
from friction_comp.model.sigmoid import kinetic_current
from friction_comp.simulation.joint_parameters import LUGRE, Record
from friction_comp.simulation.undeclared import undeclared_torque

compiled_kinetic_current = njit(cache=True)(kinetic_current)
LEAST_LEVEL = 0.05
"""Smallest friction that undeclared effects may leave, as a share of the declared level."""
ARRIVED = 0.1
"""Largest distance from the end of the reference at which a joint has arrived, rad. In the note,
joints with compensation end at most 0.083 rad short of it, those without it at least 0.18 rad; with
half of this the person would finish movements under the continuous law, too."""
SUBSTEPS, _GEARED_SUBSTEPS = 8, 16
SETTLING, _GEARED_SETTLING = 0.0005, 0.005
"""Time without slip after which a joint sticks again, s."""


@njit(cache=True)
def uniform(random: np.ndarray) -> float:
    """Return the next number in (0, 1) of a splitmix64 sequence, shape (1,) uint64."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0


@njit(cache=True)
def normal(random: np.ndarray) -> float:
    """Return a standard normal number (Box and Muller)."""
    return math.sqrt(-2.0 * math.log(uniform(random))) * math.cos(2.0 * math.pi * uniform(random))


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


@njit(cache=True)
def follow_reference(p: Record, s: Record, h: float, reaction_weight: float, active: bool,
                     reference_position: float, reference_velocity: float, position: float,
                     velocity: float) -> None:
    """Advance the person's torque `s.human`, N·m, by one substep of h s.

    `reaction_weight` is that of the low pass, `active` whether the person holds the joint.
    """
    if not active:
        s.human = s.integral_torque = 0.0
        return
    lag = reference_position - position
    if reference_velocity != 0.0:
        s.arrived = 0
    elif abs(lag) <= ARRIVED:
        # Remembered, so that the person does not push again if the joint recoils.
        s.arrived = 1
    if reference_velocity != 0.0 or s.arrived == 1 or p.human_integral_time <= 0.0:
        s.integral_torque = 0.0
    else:
        s.integral_torque += p.human_stiffness * lag * h / p.human_integral_time
    wanted = (p.human_stiffness * lag + p.human_damping * (reference_velocity - velocity)
              + s.integral_torque)
    s.human += (wanted - s.human) * reaction_weight


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
    h = sample_time / _GEARED_SUBSTEPS
    amplify = low_pass_weight(h, p.current_lag)
    follow = low_pass_weight(h, p.actuation_lag)
    adapt = low_pass_weight(h, p.level_lag)
    reaction_weight = low_pass_weight(h, p.human_response)
    start = s.samples * sample_time
    for k in range(_GEARED_SUBSTEPS):
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
            if before <= _GEARED_SETTLING < s.rest:
                draw_levels(p, s, random)
