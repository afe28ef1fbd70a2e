# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A geared joint of two inertias: LuGre or Maxwell-slip friction, compliance, motor and delay.

Seen at the gear's output, with the rotor at φ (where encoder and friction are) and the link at θ

``J_m·φ'' = k_t·n·i - F - K·(φ - θ) - C·(φ' - θ')``
``J_l·θ'' = K·(φ - θ) + C·(φ' - θ') + τ_human``

Friction F turns round in displacement and slides at the level g(|φ'|) of `friction_level`, which
leads from the breakaway level of this rest to Eq. 6:

- Maxwell slip: parallel elements j of stiffness k_j, damping c_j and share w_j, each
  ``clamp(k_j·z_j + c_j·φ', ±w_j·g)``. Element j slips after its own distance; the farthest of
  them is the presliding distance. Sliding levels follow the speed with a lag, as in the
  generalised Maxwell-slip model (Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control
  50(11), 2005). One element is the clamp of `kernel` with a second inertia.
- LuGre (Canudas de Wit, Olsson, Åström and Lischinsky, IEEE Trans. Automatic Control 40(3),
  1995): ``z' = φ' - σ0·|φ'|·z/g``, ``F = σ0·z + σ1·e^(-(φ'/v_s)²)·z'``; the presliding distance
  is g_b/σ0.

The current follows its command through the amplifier's time constant after whole samples of
delay, and no farther than the supply's voltage less the back-EMF allows.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.simulation.joint_kernel import normal

SUBSTEPS = 16
ELEMENTS = 8
DELAYS = 4
# A joint that has not slid for so long sticks anew, s.
SETTLING = 0.005

CLAMP, LUGRE, MAXWELL_SLIP = range(3)

GEAR = np.dtype([(name, float) for name in (
    'motor_inertia', 'link_inertia', 'stiffness', 'damping', 'torque_per_current', 'resolution',
    'limit', 'current_noise', 'torque_noise', 'upper', 'lower', 'steepness', 'shift', 'viscous',
    'break_positive', 'break_negative', 'std_positive', 'std_negative', 'stribeck_velocity',
    'bristle_stiffness', 'bristle_damping', 'level_lag', 'current_lag', 'back_emf', 'resistance',
    'voltage', 'human_stiffness', 'human_damping', 'human_response', 'friction_factor')]
    + [('kind', np.int64), ('delay', np.int64), ('elements', np.int64),
       ('share', float, (ELEMENTS,)), ('distance', float, (ELEMENTS,))], align=True)
"""Parameters of one joint, all SI at the joint; `share` and `distance` of the Maxwell-slip
elements (1, rad)."""

GEAR_STATE = np.dtype([(name, float) for name in (
    'rotor', 'rotor_speed', 'link', 'link_speed', 'level', 'level_positive', 'level_negative',
    'rest', 'current', 'human', 'counted', 'samples')]
    + [('sliding', np.int64), ('bristle', float, (ELEMENTS,)), ('command', float, (DELAYS,))],
    align=True)

MEASURED = np.dtype([(name, float) for name in (
    'position', 'velocity', 'current', 'interaction_torque')], align=True)


@njit(cache=True)
def draw_levels(p, s, random):
    """Draw the breakaway levels that hold until the joint sticks anew."""
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_positive = max(0.1 * p.break_positive, p.break_positive + p.std_positive * scatter)
    scatter = min(4.0, max(-4.0, normal(random)))
    s.level_negative = max(0.1 * p.break_negative, p.break_negative + p.std_negative * scatter)


@njit(cache=True)
def friction_level(p, s, speed, positive):
    """Return g in N·m at a speed (rad/s, not negative) for one direction of sliding."""
    fade = math.exp(-speed / p.stribeck_velocity)
    if positive:
        plateau, level, side = p.upper, s.level_positive, 1.0
    else:
        plateau, level, side = -p.lower, s.level_negative, -1.0
    fitted = p.viscous * speed + side * (p.lower + (p.upper - p.lower) / (
        1.0 + math.exp(-p.steepness * (side * speed - p.shift))))
    floor = min(level, plateau)
    base = max(fitted, plateau - (plateau - floor) * fade) + (level - floor) * fade
    return p.friction_factor * base


@njit(cache=True)
def start_gear(p, s, random):
    """Set the state of a joint at rest at position 0 and draw its first breakaway levels."""
    s.rotor = s.rotor_speed = s.link = s.link_speed = 0.0
    s.rest, s.current, s.human, s.counted, s.samples = 1.0, 0.0, 0.0, 0.0, 0.0
    s.sliding = 0
    for j in range(ELEMENTS):
        s.bristle[j] = 0.0
    for j in range(DELAYS):
        s.command[j] = 0.0
    draw_levels(p, s, random)
    s.level = 0.5 * (s.level_positive + s.level_negative)


@njit(cache=True)
def measure_gear(p, s, random, sample_time, out):
    """Write what the sensors show of the state into the record `out`."""
    counted = s.rotor
    if p.resolution > 0.0:
        counted = math.floor(s.rotor / p.resolution + 0.5) * p.resolution
    out.position = counted
    out.velocity = (counted - s.counted) / sample_time
    s.counted = counted
    out.current = s.current
    if p.current_noise > 0.0:
        out.current += p.current_noise * normal(random)
    out.interaction_torque = s.human
    if p.torque_noise > 0.0:
        out.interaction_torque += p.torque_noise * normal(random)


@njit(cache=True)
def _lugre_force(p, s, v, level, h):
    """Advance LuGre's bristle, exactly for a constant speed, and return its force in N·m."""
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
def _maxwell_force(p, s, v, level, h):
    """Advance the Maxwell-slip elements and return their force in N·m."""
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
def gear_sample(p, s, random, sample_time, command, reference_position, reference_velocity,
                active, out):
    """Take one joint through one sample and measure it at the end.

    Parameters
    ----------
    p, s : records of GEAR and GEAR_STATE
        The state is changed in place.
    random : ndarray of uint64, shape (1,)
    sample_time : float
        s.
    command : float
        Current in A held over the sample; clipped to the limit, 0 where it is not finite.
    reference_position, reference_velocity : float
        What the person sees at the beginning of the sample, rad and rad/s.
    active : bool
        Whether the person holds the link.
    out : record of MEASURED
        Written in place.
    """
    h = sample_time / SUBSTEPS
    if not math.isfinite(command):
        command = 0.0
    command = min(p.limit, max(-p.limit, command))
    for j in range(DELAYS - 1, 0, -1):
        s.command[j] = s.command[j - 1]
    s.command[0] = command
    wanted = s.command[p.delay]
    follow = 1.0 - math.exp(-h / p.current_lag) if p.current_lag > 0.0 else 1.0
    adapt = 1.0 - math.exp(-h / p.level_lag) if p.level_lag > 0.0 else 1.0
    muscle = 1.0 - math.exp(-h / p.human_response) if p.human_response > 0.0 else 1.0
    for k in range(SUBSTEPS):
        v = s.rotor_speed
        target = wanted
        if p.resistance > 0.0:
            highest = (p.voltage - p.back_emf * v) / p.resistance
            lowest = (-p.voltage - p.back_emf * v) / p.resistance
            target = min(highest, max(lowest, target))
        s.current += (target - s.current) * follow
        if active:
            aim = (p.human_stiffness * (reference_position + reference_velocity * k * h - s.link)
                   + p.human_damping * (reference_velocity - s.link_speed))
            s.human += (aim - s.human) * muscle
        else:
            s.human = 0.0
        # Which way the joint slides, or would, decides which level applies.
        way = v if v != 0.0 else s.current
        level = friction_level(p, s, abs(v), way > 0.0)
        s.level += (level - s.level) * adapt
        if p.kind == LUGRE:
            friction = _lugre_force(p, s, v, s.level, h)
        else:
            friction = _maxwell_force(p, s, v, s.level, h)
        spring = p.stiffness * (s.rotor - s.link) + p.damping * (v - s.link_speed)
        s.rotor_speed += h * (p.torque_per_current * s.current - friction - spring) / (
            p.motor_inertia)
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
    s.samples += 1.0
    measure_gear(p, s, random, sample_time, out)
