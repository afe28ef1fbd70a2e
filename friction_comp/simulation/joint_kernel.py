# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated joint itself: one compiled function that takes a joint through one sample.

The plant node, the plain loop and the thousands of parallel runs of `reproduce` all call
`joint_sample`; there is no second model of the joint.

Seen at the gear's output, the joint obeys

``J·dω/dt = k_t·n·i + τ_human + τ_load - F``

Friction F is an elastic bristle of stiffness σ0 and damping σ1 that slips at the level g:
``F = clamp(σ0·z + σ1·ω, -g, +g)``. Below the level nothing drifts, however long or often the
joint is pushed, which is what tells true stiction from Dahl's and LuGre's models (elasto-plastic
friction: Dupont, Hayward, Armstrong and Altpeter, IEEE Trans. Automatic Control 47(5), 2002,
here with its plastic range shrunk to a point). The level is

``g(ω) = max(|f̂(ω)|, g0 + (P - g0)·(1 - e)) + (g_b - g0)·e    with e = exp(-|ω|/ω_s)``

with f̂ of Eq. 6 and its plateau P, the breakaway level g_b drawn anew whenever the joint sticks
anew, and ``g0 = min(mean g_b, P)``. The printed sigmoid passes through zero near standstill, true
friction does not: it starts at the breakaway level and is Eq. 11 itself once the transition is
over.
"""

from __future__ import annotations

import math

from numba import njit
import numpy as np

from friction_comp.simulation.undeclared import heated, undeclared_torque

SUBSTEPS = 8
# A joint that has not slipped for so long sticks anew, s.
SETTLING = 0.0005
# After sliding for so many of its own deflections the bristle stands on new ground.
RENEWAL = 3.0
# Whatever is added to it, friction keeps this share of its declared level.
LEAST_LEVEL = 0.05

# Columns of the parameters, all SI at the joint.
(INERTIA, TORQUE_PER_CURRENT, RESOLUTION, LIMIT, CURRENT_NOISE, TORQUE_NOISE, STIFFNESS, DAMPING,
 UPPER, LOWER, STEEPNESS, SHIFT, VISCOUS, FLOOR_POSITIVE, FLOOR_NEGATIVE, BREAK_POSITIVE,
 BREAK_NEGATIVE, STD_POSITIVE, STD_NEGATIVE, STRIBECK_VELOCITY, LAG, HUMAN_STIFFNESS,
 HUMAN_DAMPING, HUMAN_RESPONSE, THERMAL) = range(25)
PARAMETERS = THERMAL + 4

# Columns of the state.
(POSITION, VELOCITY, BRISTLE, CURRENT, LAGGED, LEVEL_POSITIVE, LEVEL_NEGATIVE, SLIDING, REST,
 HUMAN, TEMPERATURE, COUNTED, SAMPLES, SLID) = range(14)
STATES = 14

# Columns of what is measured.
(OUT_POSITION, OUT_VELOCITY, OUT_CURRENT, OUT_TORQUE, OUT_TEMPERATURE) = range(5)
OUTPUTS = 5


@njit(cache=True)
def uniform(random):
    """Return the next number in (0, 1) of a run's own splitmix64 sequence, shape (1,) uint64."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0


@njit(cache=True)
def normal(random):
    """Return a standard normal number (Box and Muller)."""
    return math.sqrt(-2.0 * math.log(uniform(random))) * math.cos(2.0 * math.pi * uniform(random))


@njit(cache=True)
def draw_levels(p, s, random):
    """Draw the breakaway levels that hold until the joint comes to rest again."""
    for mean, std, level in ((BREAK_POSITIVE, STD_POSITIVE, LEVEL_POSITIVE),
                             (BREAK_NEGATIVE, STD_NEGATIVE, LEVEL_NEGATIVE)):
        scatter = min(4.0, max(-4.0, normal(random)))
        s[level] = max(0.1 * p[mean], p[mean] + p[std] * scatter)


@njit(cache=True)
def friction_level(p, s, speed, positive):
    """Return g in N·m at a speed (rad/s, not negative) for one direction of the force."""
    fade = math.exp(-speed / p[STRIBECK_VELOCITY])
    if positive:
        kinetic = p[VISCOUS] * speed + p[LOWER] + (p[UPPER] - p[LOWER]) / (
            1.0 + math.exp(-p[STEEPNESS] * (speed - p[SHIFT])))
        plateau, floor, level = p[UPPER], p[FLOOR_POSITIVE], s[LEVEL_POSITIVE]
    else:
        kinetic = p[VISCOUS] * speed - p[LOWER] - (p[UPPER] - p[LOWER]) / (
            1.0 + math.exp(p[STEEPNESS] * (speed + p[SHIFT])))
        plateau, floor, level = -p[LOWER], p[FLOOR_NEGATIVE], s[LEVEL_NEGATIVE]
    return max(kinetic, plateau - (plateau - floor) * fade) + (level - floor) * fade


@njit(cache=True)
def start_state(p, s, random):
    """Set the state of a joint at rest at position 0 and draw its first breakaway levels."""
    s[:] = 0.0
    s[REST] = 1.0
    s[TEMPERATURE] = p[THERMAL + 1]
    draw_levels(p, s, random)


@njit(cache=True)
def measure(p, s, random, sample_time, out):
    """Write what the sensors show of the state into `out`."""
    if p[RESOLUTION] > 0.0:
        counted = math.floor(s[POSITION] / p[RESOLUTION] + 0.5) * p[RESOLUTION]
    else:
        counted = s[POSITION]
    out[OUT_POSITION] = counted
    out[OUT_VELOCITY] = (counted - s[COUNTED]) / sample_time
    s[COUNTED] = counted
    out[OUT_CURRENT] = s[CURRENT]
    if p[CURRENT_NOISE] > 0.0:
        out[OUT_CURRENT] += p[CURRENT_NOISE] * normal(random)
    out[OUT_TORQUE] = s[HUMAN]
    if p[TORQUE_NOISE] > 0.0:
        out[OUT_TORQUE] += p[TORQUE_NOISE] * normal(random)
    out[OUT_TEMPERATURE] = s[TEMPERATURE]


@njit(cache=True)
def joint_sample(p, s, random, table, memory, sample_time, command, reference_position,
                 reference_velocity, active, out):
    """Take one joint through one sample and measure it at the end.

    Parameters
    ----------
    p, s : ndarray
        Parameters and state by the columns above; the state is changed in place.
    random : ndarray of uint64, shape (1,)
        The run's own random sequence.
    table, memory : ndarray
        Undeclared effects; rows of code -1 do nothing.
    sample_time : float
        s.
    command : float
        Current in A held over the sample; clipped to the limit, 0 where it is not finite.
    reference_position, reference_velocity : float
        What the person sees at the beginning of the sample, rad and rad/s.
    active : bool
        Whether the person holds the joint at all.
    out : ndarray
        Measured values by the columns above, written in place.
    """
    h = sample_time / SUBSTEPS
    if not math.isfinite(command):
        command = 0.0
    command = min(p[LIMIT], max(-p[LIMIT], command))
    # The amplifier is fast: an undeclared lag lies between the current and the torque.
    s[CURRENT] = command
    follow = 1.0 - math.exp(-h / p[LAG]) if p[LAG] > 0.0 else 1.0
    muscle = 1.0 - math.exp(-h / p[HUMAN_RESPONSE]) if p[HUMAN_RESPONSE] > 0.0 else 1.0
    start = s[SAMPLES] * sample_time
    sigma0, sigma1, over_inertia = p[STIFFNESS], p[DAMPING], h / p[INERTIA]
    implicit = 1.0 / (1.0 + over_inertia * (sigma1 + h * sigma0))
    for k in range(SUBSTEPS):
        s[LAGGED] += (command - s[LAGGED]) * follow
        x, v = s[POSITION], s[VELOCITY]
        if active:
            wanted = (p[HUMAN_STIFFNESS] * (reference_position + reference_velocity * k * h - x)
                      + p[HUMAN_DAMPING] * (reference_velocity - v))
            s[HUMAN] += (wanted - s[HUMAN]) * muscle
        else:
            s[HUMAN] = 0.0
        torque = p[TORQUE_PER_CURRENT] * s[LAGGED] + s[HUMAN]
        # Which way the bristle would go if it held decides which level applies.
        stuck = (v + over_inertia * (torque - sigma0 * s[BRISTLE])) * implicit
        extra = 0.0
        if table.shape[0] > 0 and table[0, 0] >= 0.0:
            base = friction_level(p, s, abs(v), sigma0 * s[BRISTLE] + sigma1 * stuck > 0.0)
            load, extra = undeclared_torque(table, memory, start + k * h, x, v, s[HUMAN],
                                            s[TEMPERATURE], s[REST], base)
            torque += load
            stuck = (v + over_inertia * (torque - sigma0 * s[BRISTLE])) * implicit
        force = sigma0 * (s[BRISTLE] + h * stuck) + sigma1 * stuck
        base = friction_level(p, s, abs(v), force > 0.0)
        level = max(base + extra, LEAST_LEVEL * base)
        if abs(force) <= level:
            v = stuck
            s[BRISTLE] += h * v
            s[REST] += h
            if s[SLIDING] > 0.0 and s[REST] > SETTLING:
                s[SLIDING] = 0.0
                s[SLID] = 0.0
                draw_levels(p, s, random)
        else:
            level = math.copysign(level, force)
            v += over_inertia * (torque - level)
            limit = abs(level) / sigma0
            s[BRISTLE] = min(limit, max(-limit, s[BRISTLE] + h * v))
            s[REST] = 0.0
            s[SLIDING] = 1.0
            s[SLID] += h * abs(v)
            if s[SLID] > RENEWAL * limit:
                s[SLID] = 0.0
                draw_levels(p, s, random)
        s[VELOCITY] = v
        s[POSITION] = x + h * v
    s[TEMPERATURE] = heated(s[TEMPERATURE], s[CURRENT], sample_time, p[THERMAL:THERMAL + 4])
    s[SAMPLES] += 1.0
    measure(p, s, random, sample_time, out)


@njit(cache=True)
def bank_sample(p, s, random, tables, memories, sample_time, command, reference_position,
                reference_velocity, active, out):
    """Take every joint of a bank through one sample; rows are joints."""
    for j in range(p.shape[0]):
        joint_sample(p[j], s[j], random[j], tables[j], memories[j], sample_time, command[j],
                     reference_position[j], reference_velocity[j], active[j], out[j])
