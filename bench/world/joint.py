# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One joint with hidden effects, written from the literature, in A of motor current.

Dry friction acts through Maxwell slip (Lampaert, Swevers and Al-Bender 2002): blocks that stick
over a displacement of their own and slide beyond it. With displacements far below every encoder
step that is plain Coulomb friction with stiction; with large ones it is presliding hysteresis.
Its level follows Stribeck (Armstrong-Helouvry, Dupont and Canudas de Wit 1994), load (Hamon,
Gautier and Garrec 2010), temperature (Bittencourt and Gunnarsson 2012), and rest time (Rabinowicz).

It moves in a loop: a controller at 1 kHz, a person, current that saturates and comes late.
"""

from typing import NamedTuple

from numba import njit
import numpy as np

DT = 0.25e-3
PER_TICK = 4
BLOCKS = 4
STICTION, LAST_POSITION, STATES = BLOCKS, BLOCKS + 1, BLOCKS + 2
_NONE = np.zeros((0, 3))
_SHARES = np.array([0.4, 0.3, 0.2, 0.1])
_SPREAD = np.array([0.3, 0.7, 1.3, 2.2])


class Joint(NamedTuple):
    """Constants of one joint; currents in A, angles in rad, an effect with zeros is not there."""

    inertia: float = 0.02
    coulomb: float = 0.5
    viscous: float = 0.1
    offset: float = 0.0
    stribeck: float = 0.0  # share of Coulomb friction added at standstill
    stribeck_speed: float = 0.05
    asymmetry: float = 0.0  # share by which viscous friction is more one way and less the other
    power: float = 1.0  # exponent of viscous friction
    power_speed: float = 1.0  # the speed at which the exponent makes no difference
    gravity: float = 0.0
    gravity_phase: float = 0.0
    spring: float = 0.0
    spring_centre: float = 0.0
    cogging: np.ndarray = _NONE  # rows: waves a turn, A, phase
    ripple: np.ndarray = _NONE  # rows: waves a turn, share of Coulomb friction, phase
    bump: float = 0.0
    bump_at: float = 0.0
    bump_width: float = 0.05
    load_gain: float = 0.0  # A per N.m of torque from outside; -1 / (k_t n) where it helps
    load_friction: float = 0.0  # A per N.m
    gravity_friction: float = 0.0  # share of the absolute gravity current
    heat_coulomb: float = 0.0  # share per K
    heat_viscous: float = 0.0
    warm_up: float = 0.0  # share of dry and viscous friction more when cold
    warm_up_time: float = 60.0
    slip: float = 2e-4  # mean displacement at which blocks begin to slide
    rest: float = 0.0  # A of stiction after long rest
    rest_time: float = 2.0
    product: float = 0.0  # A per rad and rad/s
    dead_spot: float = 0.0  # A of a spot that wanders
    dead_spot_at: float = 0.0
    dead_spot_speed: float = 0.0
    step: float = 0.0  # A by which dry friction jumps
    step_time: float = 0.0
    play: float = 0.0  # rad of backlash before a second inertia
    far_inertia: float = 0.0
    delay: float = 0.0  # s from recorded current to torque
    low_pass: float = 0.0  # s, time constant from recorded current to torque


@njit(cache=True)
def new_state(position):
    """Return the memory of a joint that has rested at a position without strain."""
    state = np.zeros(STATES)
    state[LAST_POSITION] = position
    return state


@njit(cache=True)
def gravity_of(joint, q):
    """Return the pendulum's current in A at position q."""
    return joint.gravity * np.sin(q + joint.gravity_phase)


@njit(cache=True)
def dry_level(joint, t, q, v, load, heat):
    """Return the current in A at which the blocks of dry friction slide."""
    level = joint.coulomb * (1.0 + joint.stribeck * np.exp(-(v / joint.stribeck_speed) ** 2))
    for k in range(joint.ripple.shape[0]):
        level += joint.coulomb * joint.ripple[k, 1] * np.sin(
            joint.ripple[k, 0] * q + joint.ripple[k, 2])
    level += joint.bump * np.exp(-0.5 * ((q - joint.bump_at) / joint.bump_width) ** 2)
    spot = joint.dead_spot_at + joint.dead_spot_speed * t
    level += joint.dead_spot * np.exp(-0.5 * ((q - spot) / joint.bump_width) ** 2)
    level *= 1.0 + joint.heat_coulomb * heat
    level *= 1.0 + joint.warm_up * np.exp(-t / joint.warm_up_time)
    level += joint.load_friction * abs(load)
    level += joint.gravity_friction * abs(gravity_of(joint, q))
    if t >= joint.step_time:
        level += joint.step
    return max(level, 0.0)


@njit(cache=True)
def sliding(joint, t, v, heat):
    """Return viscous friction in A."""
    scale = joint.power_speed
    viscous = joint.viscous * scale * np.sign(v) * (abs(v) / scale) ** joint.power
    viscous *= 1.0 + joint.asymmetry * np.sign(v)
    return viscous * (1.0 + joint.heat_viscous * heat) * (
        1.0 + joint.warm_up * np.exp(-t / joint.warm_up_time))


@njit(cache=True)
def carried(joint, q, v, load):
    """Return the currents in A that do not follow the direction of motion."""
    current = joint.offset + gravity_of(joint, q) + joint.spring * (q - joint.spring_centre)
    for k in range(joint.cogging.shape[0]):
        current += joint.cogging[k, 1] * np.sin(joint.cogging[k, 0] * q + joint.cogging[k, 2])
    return current + joint.load_gain * load + joint.product * q * v


@njit(cache=True)
def dry(joint, state, t, q, v, load, heat, dt):
    """Move the blocks to position q and return dry friction in A.

    `state` is changed in place. `load` is in N.m, `heat` in K above the reference.
    """
    moved = q - state[LAST_POSITION]
    state[LAST_POSITION] = q
    strain = 0.0
    for k in range(BLOCKS):
        limit = joint.slip * _SPREAD[k]
        block = min(max(state[k] + moved, -limit), limit)
        state[k] = block
        strain += _SHARES[k] * block / limit
    level = dry_level(joint, t, q, v, load, heat)
    if joint.rest > 0.0:
        # Junctions grow while nothing slides and are renewed over a short way.
        grown = state[STICTION] + (1.0 - state[STICTION]) * dt / joint.rest_time
        state[STICTION] = grown * np.exp(-abs(moved) / 0.004)
        level += joint.rest * state[STICTION]
    return strain * level


@njit(cache=True)
def resistance(joint, state, t, q, v, load, heat, dt):
    """Return all current in A that motion takes, inertia apart."""
    return (dry(joint, state, t, q, v, load, heat, dt) + sliding(joint, t, v, heat)
            + carried(joint, q, v, load))


@njit(cache=True)
def resistance_along(joint, times, q, v, load, heat):
    """Return `resistance` along sampled motion from rest without strain on, shape (N,)."""
    out = np.empty(len(times))
    state, last = new_state(q[0]), times[0]
    for i in range(len(times)):
        out[i] = resistance(joint, state, times[i], q[i], v[i], load[i], heat[i], times[i] - last)
        last = times[i]
    return out


class Controller(NamedTuple):
    """What makes the current. Gains act on rad, rad/s and rad s; times in s."""

    proportional: float = 0.0
    derivative: float = 0.0
    integral: float = 0.0
    inertia: float = 0.0  # feed-forward of acceleration
    friction: float = 0.0  # feed-forward of sign and speed of the reference
    viscous: float = 0.0
    from_measured: float = 0.0  # friction fed forward from measured velocity, zero-torque mode
    gravity: float = 0.0  # share of everything carried that is fed forward
    limit: float = 1e9
    latency: int = 0  # ticks of 1 ms from measurement to current
    quantum: float = 1e-5  # rad, encoder of the controller
    speed_filter: float = 4e-3
    person: float = 0.0  # N.m/rad of the person who leads the joint along the reference
    person_damping: float = 0.0


class Trace(NamedTuple):
    """What happened, every DT: times s, motion rad, currents A, load N.m."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    current: np.ndarray
    load: np.ndarray
    heat: np.ndarray
    reference: np.ndarray
    reference_speed: np.ndarray


@njit(cache=True)
def _command(joint, controller, wanted, measured, speed, errors, open_loop):
    position, rate, acceleration = wanted
    lag = position - measured
    errors[0] = min(max(errors[0] + lag * DT * PER_TICK, -0.5), 0.5)
    current = open_loop + controller.proportional * lag
    current += controller.derivative * (rate - speed) + controller.integral * errors[0]
    current += controller.inertia * acceleration + controller.viscous * rate
    current += controller.friction * np.tanh(rate / 0.02)
    current += controller.from_measured * np.tanh(speed / 0.05)
    current += controller.gravity * carried(joint, measured, 0.0, 0.0)
    return min(max(current, -controller.limit), controller.limit)


@njit(cache=True)
def run(joint, controller, reference, open_loop, load, heat):
    """Simulate by semi-implicit Euler steps of DT.

    `reference`: ndarray, shape (N, 3); wanted position, velocity and acceleration. `open_loop`,
    `load`, `heat`: ndarray, shape (N,); current in A beside the controller's, torque in N.m from
    outside, K above the reference. Returns position, velocity, acceleration, recorded current and
    load, shape (N, 5).
    """
    size = len(reference)
    out = np.empty((size, 5))
    q, v = reference[0, 0], 0.0
    far_q, far_v = q, 0.0
    state, errors = new_state(q), np.zeros(1)
    late = np.zeros(controller.latency + 1)
    line = np.zeros(int(joint.delay / DT) + 1)
    speed, last, command, pull, dynamic = 0.0, q, 0.0, 0.0, 0.0
    for i in range(size):
        t = i * DT
        if i % PER_TICK == 0:
            measured = np.round(q / controller.quantum) * controller.quantum
            step = DT * PER_TICK
            speed += ((measured - last) / step - speed) * step / (controller.speed_filter + step)
            last = measured
            tick = i // PER_TICK
            late[tick % len(late)] = _command(
                joint, controller, reference[i], measured, speed, errors, open_loop[i])
            command = late[(tick + 1) % len(late)]
        line[i % len(line)] = command
        delayed = line[(i + 1) % len(line)]
        pull = delayed if joint.low_pass <= 0.0 else (
            pull + (delayed - pull) * DT / joint.low_pass)
        push = controller.person * (reference[i, 0] - q) + controller.person_damping * (
            reference[i, 1] - v)
        outside = load[i] + push
        driving = pull - resistance(joint, state, t, q, v, outside, heat[i], DT)
        if joint.far_inertia > 0.0:
            gap = q - far_q
            touch = gap - 0.5 * joint.play if gap > 0.5 * joint.play else (
                gap + 0.5 * joint.play if gap < -0.5 * joint.play else 0.0)
            dynamic = 4e4 * joint.far_inertia * touch
            if touch != 0.0:
                dynamic += 120.0 * joint.far_inertia * (v - far_v)
            far_v += dynamic / joint.far_inertia * DT
            far_q += far_v * DT
            driving -= dynamic
        a = driving / joint.inertia
        v += a * DT
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = q, v, a, command, outside
        q += v * DT
    return out


def simulate(joint, controller, reference, open_loop=None, load=None, heat=None):
    """Return the `Trace` of a joint that follows `reference`, shape (N,) in rad every DT."""
    size = len(reference)
    speed = np.gradient(reference, DT)
    wanted = np.column_stack([reference, speed, np.gradient(speed, DT)])
    open_loop, load, heat = (np.zeros(size) if x is None else x for x in (open_loop, load, heat))
    out = run(joint, controller, wanted, open_loop, load, heat)
    return Trace(np.arange(size) * DT, *out.T.copy(), heat, reference, speed)
