# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Friction torque of the gear, in five kinds from the literature, in compiled code.

maxwell_slip
    Generalised Maxwell slip: elements in parallel, each sticking on its own spring until its share
    of the level is reached, then relaxing to it at a limited rate (Lampaert, Al-Bender and Swevers
    2003; Al-Bender, Lampaert and Swevers 2005), with a damper across sticking elements.
lugre
    Canudas de Wit, Olsson, Åström and Lischinsky 1995, with the damping of the bristles falling
    with speed, which keeps it passive (Canudas de Wit and Lischinsky 1997; Barabanov and Ortega
    2000).
clamp
    Stiction that holds whatever is below its level (Karnopp 1985), in its time-stepping form: the
    friction impulse of a step stops the motor if it can. No presliding of its own.
dahl
    Dahl 1968 with exponent.
bouc_wen
    Bouc 1967, Wen 1976, normalised (Ikhouane and Rodellar 2007), β >= |γ|.
"""

import math

from numba import njit

from world.gear.state import BOUC_WEN, DAHL, ELEMENTS, LUGRE, MAXWELL_SLIP

RENEWED = 8.0


@njit(cache=True, inline='always')
def level(p, s, v, shaft):
    """Return the magnitude of friction while sliding at v, N·m: what a kind tends to."""
    value = p.coulomb
    if p.static != p.coulomb:
        x = abs(v) / p.stribeck_velocity
        if x < 30.0:
            value += (p.static - p.coulomb) * math.exp(-(x ** p.stribeck_exponent))
    if v != 0.0:
        value *= 1.0 + (p.asymmetry if v > 0.0 else -p.asymmetry)
    if s.slid < RENEWED * p.renewal:
        value *= 1.0 + s.breakaway_factor * math.exp(-s.slid / p.renewal)
    if p.ripple != 0.0:
        value *= 1.0 + p.ripple * math.cos(p.ripple_frequency * s.motor + p.ripple_phase)
    if p.heating != 0.0:
        value *= 1.0 + p.warming * s.temperature
    return max(0.0, value + p.load_friction * abs(shaft))


@njit(cache=True, inline='always')
def turned(z, way, distance, exponent):
    """Return Dahl's state in -1..1 after a displacement, exactly."""
    if way == 0.0:
        return z
    side = 1.0 if way > 0.0 else -1.0
    left = 1.0 - side * z
    if left <= 0.0:
        return side
    far = abs(way) / distance
    if exponent == 1.0:
        left *= math.exp(-far)
    else:
        power = left ** (1.0 - exponent) - (1.0 - exponent) * far
        left = power ** (1.0 / (1.0 - exponent)) if power > 0.0 else 0.0
    return side * (1.0 - left)


@njit(cache=True)
def maxwell_slip(p, s, v, top, h):
    """Return the torque of the elements and advance them by a step."""
    stiffest = 0.0
    for i in range(ELEMENTS):
        stiffest += p.element_share[i] * p.static / p.element_distance[i]
    damper = 2.0 * p.damping_ratio * math.sqrt(stiffest * p.motor_inertia) / stiffest
    relaxed = 1.0 - math.exp(-p.attraction * h)
    torque = 0.0
    for i in range(ELEMENTS):
        f = s.element[i]
        spring = p.element_share[i] * p.static / p.element_distance[i]
        most = p.element_share[i] * top
        if s.slipping[i] == 1 and v * f <= 0.0:
            s.slipping[i] = 0
        if s.slipping[i] == 1:
            f += relaxed * (math.copysign(most, v) - f)
            torque += f
        else:
            torque += f + damper * spring * v
            f += spring * v * h
            if abs(f) > most:
                s.slipping[i] = 1
        s.element[i] = f
    return torque


@njit(cache=True)
def bristles(p, s, v, top, h):
    """Return the torque of LuGre, Dahl or Bouc-Wen friction and advance its state by a step.

    The state is in units of the level at rest. Damping acts on the part of the motion that bends
    the bristles, so it is gone in sliding.
    """
    z, way = s.bristle, v * h
    if p.friction == LUGRE:
        goal = math.copysign(top / p.static, v) if v != 0.0 else 0.0
        e = math.exp(-abs(way) / p.bristle * p.static / max(top, 1e-9 * p.static))
        new = goal + (z - goal) * e if v != 0.0 else z
        scale = p.static
    elif p.friction == DAHL:
        new = turned(z, way, p.bristle, p.exponent)
        scale = top
    else:
        # dz = (1 - |z|^n·(β + γ·sgn(v·z)))·dx/zs, β + γ = 1, share = β
        side = 1.0 if v * z > 0.0 else -1.0
        rate = 1.0 - abs(z) ** p.exponent * (p.share + (1.0 - p.share) * side)
        new = min(1.0, max(-1.0, z + rate * way / p.bristle))
        scale = top
    s.bristle = new
    bend = p.bristle * (new - z) / h
    x = v / p.damping_velocity
    damper = 0.0
    if abs(x) < 4.0:
        damper = (2.0 * p.damping_ratio * math.sqrt(p.static / p.bristle * p.motor_inertia)
                  * math.exp(-x * x))
    return scale * z + damper * bend


@njit(cache=True)
def motor_friction(p, s, v, shaft, h):
    """Return the torque that resists the motor (not for the clamp)."""
    # Dahl's and Bouc-Wen's torque is level times state: the level of the side they are bent to,
    # or it would jump with every change of the velocity's sign
    side = math.copysign(v, s.bristle) if p.friction in (DAHL, BOUC_WEN) else v
    top = level(p, s, side, shaft)
    viscous = p.viscous * v
    if p.heating != 0.0:
        viscous *= 1.0 + p.warming * s.temperature
    if p.friction == MAXWELL_SLIP:
        return maxwell_slip(p, s, v, top, h) + viscous
    return bristles(p, s, v, top, h) + viscous


@njit(cache=True)
def clamped(p, s, v, shaft, push, h):
    """Return the motor's velocity after a step under the clamp, without friction `push` N·m."""
    free = v + push * h / p.motor_inertia
    # at rest friction is that of the direction in which the motor would go
    top = level(p, s, v if v != 0.0 else math.copysign(1e-12, free), shaft)
    stopping = (top + p.viscous * abs(v)) * h / p.motor_inertia
    if abs(free) <= stopping:
        return 0.0
    return free - math.copysign(stopping, free)
