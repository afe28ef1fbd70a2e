# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joint and person that share no friction model with the simulation or independent_gear.

Rotor and link are joined by a spring that stiffens. The rotor's friction is generalised Maxwell
slip (Lampaert, Al-Bender and Swevers 2003), an elastoplastic bristle (Dupont, Hayward, Armstrong
and Altpeter 2002) or set-valued Coulomb friction; the link's is set-valued always. Its level
depends on speed (Stribeck, a power of speed), place (meshing, a slow wave), transmitted torque,
heat and time at rest; its static part is a random field of place, and differs from rest to rest.
The encoder sits on the rotor. 25 µs a step, semi-implicit Euler.
"""

import math

from numba import njit
import numpy as np

from friction_comp.compensation.law_kernel import decide, observe

KINDS = ('gms', 'elastoplastic', 'coulomb')
GMS, ELASTOPLASTIC, COULOMB = range(3)
ELEMENTS, WAVES, DRAWS, SUBSTEPS = 6, 5, 64, 40
SAMPLE_TIME = 1e-3


def _record(floats, integers='', arrays=()):
    return np.dtype([(name, float) for name in floats.split()]
                    + [(name, np.int64) for name in integers.split()]
                    + [(name, kind, (size,)) for name, kind, size in arrays], align=True)


JOINT = _record(
    # kg·m², N·m/rad, N·m/rad³, N·m·s/rad, seen at the joint.
    'rotor link stiffness hardening damping '
    # Sliding friction in N·m, static over sliding, Stribeck's speed in rad/s and exponent.
    'level static_ratio stribeck_speed stribeck_power viscous viscous_power '
    # The link's share of friction; rotor's stiffness in N·m/rad, damping while it sticks, share
    # of the way that is elastic, s to settle.
    'link_share bristle micro_damping stuck_share relaxation '
    # What the level depends on: sizes, waves a rad, phases; shares.
    'mesh_size mesh_waves mesh_phase slow_size slow_waves slow_phase rest_std dwell load_share '
    'heat_share heat_energy presence '
    # Drive: N·m/A, s, A at standstill, rad/s without load, rad, N·m.
    'torque lag stall fastest count cogging velocity_filter noise '
    # N·m at cos and sin of the joint's angle.
    'gravity_cos gravity_sin '
    # Person: arm and cuff, hand's impedance and lag, what leans, what trembles.
    'arm cuff cuff_damping hand_stiffness hand_damping hand_lag lean tremor tremor_speed',
    'kind delay',
    [('element_stiffness', float, ELEMENTS), ('element_share', float, ELEMENTS),
     ('field_size', float, WAVES), ('field_waves', float, WAVES), ('field_phase', float, WAVES),
     ('draws', float, DRAWS)])
STATE = _record(
    'rotor rotor_speed link link_speed arm arm_speed bristle current heat still rest hand '
    'friction cuff seen_velocity seen_last time', 'rests',
    [('element', float, ELEMENTS), ('slips', np.int64, ELEMENTS), ('commands', float, 4)])
LOG = ('rotor', 'link_speed', 'cuff', 'current', 'friction', 'rotor_speed')
"""rad, rad/s, N·m, A, N·m, rad/s."""


@njit(cache=True)
def levels(g, s, load):
    """Return sliding and static friction of the whole gear here, N·m."""
    place = (1.0 + g.mesh_size * math.cos(g.mesh_waves * s.rotor + g.mesh_phase)
             + g.slow_size * math.cos(g.slow_waves * s.rotor + g.slow_phase))
    scatter = 1.0 + s.rest + g.dwell * math.log(1.0 + s.still) / math.log(11.0)
    for k in range(WAVES):
        scatter += g.field_size[k] * math.cos(g.field_waves[k] * s.rotor + g.field_phase[k])
    slide = g.level * place * (1.0 - g.heat_share * (1.0 - math.exp(-s.heat)))
    static = slide * g.static_ratio * max(0.5, scatter)
    more = g.load_share * abs(load)
    return slide + more, static + more


@njit(cache=True)
def at_speed(g, slide, static, speed):
    """Return the level at a speed: Stribeck's curve."""
    return slide + (static - slide) * math.exp(-(abs(speed) / g.stribeck_speed) ** g.stribeck_power)


@njit(cache=True)
def maxwell_slip(g, s, level, h):
    """Move the elements on by a step and return their friction, N·m."""
    v, total, stuck = s.rotor_speed, 0.0, 0.0
    for k in range(ELEMENTS):
        most, f = g.element_share[k] * level, s.element[k]
        if f * v <= 0.0:
            s.slips[k] = 0
        if s.slips[k] == 1:
            f += (math.copysign(most, v) - f) * (1.0 - math.exp(-h / g.relaxation))
        else:
            f += g.element_stiffness[k] * v * h
            stuck += g.element_share[k]
            if abs(f) > most:
                f = math.copysign(most, f)
                s.slips[k] = 1
        s.element[k] = f
        total += f
    return total + g.micro_damping * stuck * v


@njit(cache=True)
def elastoplastic(g, s, level, h):
    """Move the bristle on by a step and return its friction, N·m."""
    v, z, most, slip = s.rotor_speed, s.bristle, level / g.bristle, 0.0
    if z * v > 0.0:
        free = g.stuck_share * most
        if abs(z) >= most:
            slip = 1.0
        elif abs(z) > free:
            slip = 0.5 + 0.5 * math.sin(
                math.pi * (abs(z) - 0.5 * (most + free)) / (most - free))
    rate = v * (1.0 - slip * abs(z) / most)
    s.bristle += rate * h
    return g.bristle * s.bristle + g.micro_damping * rate


@njit(cache=True)
def stopped(speed, most, inertia, h):
    """Return the speed after set-valued friction has acted for a step, and the friction, N·m."""
    impulse = min(abs(speed) * inertia, most * h)
    return speed - math.copysign(impulse / inertia, speed), math.copysign(impulse / h, speed)


@njit(cache=True)
def _person(g, s, place, speed, h):
    """Move the arm on by a step and return the torque of the cuff, N·m."""
    cuff = g.cuff * (s.arm - s.link) + g.cuff_damping * (s.arm_speed - s.link_speed)
    wanted = (g.hand_stiffness * (place - s.arm) + g.hand_damping * (speed - s.arm_speed)
              + g.lean + g.tremor * math.sin(g.tremor_speed * s.time))
    s.hand += (wanted - s.hand) * h / g.hand_lag
    s.arm_speed += (s.hand - cuff) / g.arm * h
    s.arm += s.arm_speed * h
    return cuff


@njit(cache=True)
def advance(g, s, command, place, speed, attached):
    """Move joint and person on by a sample; `place` and `speed` are where the person wants it."""
    h = SAMPLE_TIME / SUBSTEPS
    s.commands[1:] = s.commands[:-1].copy()
    s.commands[0] = command
    command = s.commands[g.delay]
    for _ in range(SUBSTEPS):
        s.time += h
        # Back-EMF leaves the less voltage the faster it turns.
        most = max(0.0, g.stall * (1.0 - s.rotor_speed * math.copysign(1.0, command) / g.fastest))
        s.current += (math.copysign(min(abs(command), most), command) - s.current) * h / g.lag
        bend = s.rotor - s.link
        spring = g.stiffness * bend + g.hardening * bend ** 3 + g.damping * (
            s.rotor_speed - s.link_speed)
        slide, static = levels(g, s, spring)
        level = g.presence * (1.0 - g.link_share) * at_speed(g, slide, static, s.rotor_speed)
        drag = g.presence * g.viscous * s.rotor_speed * (
            s.rotor_speed ** 2 + 1e-4) ** (0.5 * g.viscous_power - 0.5)
        force = (g.torque * s.current - spring - drag
                 - g.cogging * math.sin(3.0 * g.mesh_waves * s.rotor))
        if g.kind == COULOMB or level == 0.0:
            s.rotor_speed, friction = stopped(
                s.rotor_speed + force / g.rotor * h, level, g.rotor, h)
        else:
            friction = (maxwell_slip(g, s, level, h) if g.kind == GMS
                        else elastoplastic(g, s, level, h))
            s.rotor_speed += (force - friction) / g.rotor * h
        s.rotor += s.rotor_speed * h
        s.cuff = _person(g, s, place, speed, h) if attached else 0.0
        weight = g.gravity_cos * math.cos(s.link) + g.gravity_sin * math.sin(s.link)
        s.link_speed, more = stopped(
            s.link_speed + (spring + s.cuff - weight) / g.link * h,
            g.presence * g.link_share * at_speed(g, slide, static, s.link_speed), g.link, h)
        s.link += s.link_speed * h
        s.friction = friction + more + drag
        s.heat += h * (abs(s.friction * s.rotor_speed) / g.heat_energy - s.heat / 600.0)
    if abs(s.rotor_speed) < 0.003:
        s.still += SAMPLE_TIME
        return
    if s.still > 0.05:
        s.rest = g.rest_std * g.draws[s.rests % DRAWS]
        s.rests += 1
    s.still = 0.0


@njit(cache=True)
def sense(g, s):
    """Return position and velocity as a driver reports them: counts, and their filtered slope."""
    seen = math.floor(s.rotor / g.count) * g.count
    if s.time == 0.0:
        s.seen_last = seen
    s.seen_velocity += ((seen - s.seen_last) / SAMPLE_TIME - s.seen_velocity) * min(
        1.0, SAMPLE_TIME / g.velocity_filter)
    s.seen_last = seen
    return seen, s.seen_velocity


FAULTS = ('none', 'velocity of 100 rad/s', 'velocity stuck', 'jump of a turn', 'position of 1e307',
          'position not a number', 'velocity in deg/s', 'another turn from now on')


@njit(cache=True)
def spoiled(fault, k, position, velocity):
    """Return a sample with one of the faults, from 2 s on."""
    if fault == 1 and k == 2000:
        velocity = 100.0
    elif fault == 2 and 2000 <= k < 2100:
        velocity = 0.2
    elif (fault == 3 and k == 2000) or (fault == 7 and k >= 2000):
        position += 2.0 * math.pi
    elif fault == 4 and k == 2000:
        position = 1e307
    elif fault == 5 and 2000 <= k < 2005:
        position = math.nan
    elif fault == 6:
        velocity *= 57.3
    return position, velocity


@njit(cache=True)
def run(joint, state, parameters, memory, places, speeds, directions, feed, attached, every, fault,
        log):
    """Run one joint under a law, whose records are `parameters` and `memory`.

    `feed` is current in A that is added whatever the law says; the law gets every so many samples.
    """
    g, s, p, m, held = joint[0], state[0], parameters[0], memory[0], 0.0
    for k in range(places.size):
        position, velocity = sense(g, s)
        position, velocity = spoiled(fault, k, position, velocity)
        if k % every == 0:
            if observe(p, m, k * SAMPLE_TIME, position, velocity, True):
                carried = (g.gravity_cos * math.cos(m.position)
                           + g.gravity_sin * math.sin(m.position)) / g.torque
                held = decide(p, m, directions[k], 0.0, 0.0, carried)
            else:
                held = m.current = 0.0
        advance(g, s, held + feed[k], places[k], speeds[k], attached)
        log[0, k], log[1, k], log[2, k] = s.rotor, s.link_speed, s.cuff
        log[3, k], log[4, k], log[5, k] = held + feed[k], s.friction, s.rotor_speed
