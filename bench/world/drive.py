# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint in the loop: a controller at 1 kHz, a person, current that saturates and comes late."""

from typing import NamedTuple

from numba import njit
import numpy as np

from world.arm import torque
from world.joint import carried, new_state, resistance

DT = 0.25e-3
PER_TICK = 4


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
    torque_per_current: float = 10.0  # N.m/A at the joint


class Trace(NamedTuple):
    """What happened, every DT: times s, motion rad, currents A, load N.m, others (N, J)."""

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    current: np.ndarray
    load: np.ndarray
    heat: np.ndarray
    reference: np.ndarray
    reference_speed: np.ndarray
    others_q: np.ndarray
    others_v: np.ndarray
    others_a: np.ndarray


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
def run(joint, controller, chain, number, reference, open_loop, load, heat, others):
    """Simulate by semi-implicit Euler steps of DT.

    `joint`, `controller`, `chain`: constants; a chain without links is no chain. `number`: which
    joint of the chain this is; the others keep to their references. `reference`: ndarray, shape
    (N, 3); wanted position, velocity and acceleration. `open_loop`, `load`, `heat`: ndarray, shape
    (N,); current in A beside the controller's, torque in N.m from outside, K above the reference.
    `others`: ndarray, shape (3, N, J); position, velocity and acceleration of all joints of the
    chain. Returns position, velocity, acceleration, recorded
    current and load, shape (N, 5).
    """
    size = len(reference)
    out = np.empty((size, 5))
    q, v = reference[0, 0], 0.0
    far_q, far_v = q, 0.0
    state, errors = new_state(q), np.zeros(1)
    late = np.zeros(controller.latency + 1)
    line = np.zeros(int(joint.delay / DT) + 1)
    speed, last, command, pull, dynamic = 0.0, q, 0.0, 0.0, 0.0
    linked = len(chain.mass) > 0
    unit = np.zeros(len(chain.mass))
    if linked:
        unit[number] = 1.0
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
        mass = joint.inertia
        if linked:
            angles, rates = others[0, i].copy(), others[1, i].copy()
            turns = others[2, i].copy()
            angles[number], rates[number], turns[number] = q, v, 0.0
            driving -= torque(chain, number, angles, rates, turns,
                              chain.gravity) / controller.torque_per_current
            mass += torque(chain, number, angles, np.zeros(len(unit)), unit,
                           0.0) / controller.torque_per_current
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
        a = driving / mass
        v += a * DT
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = q, v, a, command, outside
        q += v * DT
    return out


def simulate(joint, controller, chain, number, reference, open_loop=None, load=None, heat=None,
             others=None):
    """Return the `Trace` of a joint that follows `reference`, shape (N,) in rad every DT."""
    size = len(reference)
    speed = np.gradient(reference, DT)
    wanted = np.column_stack([reference, speed, np.gradient(speed, DT)])
    zeros = np.zeros(size)
    load, heat = (zeros if x is None else x for x in (load, heat))
    open_loop = zeros if open_loop is None else open_loop
    if others is None:
        others = np.zeros((3, size, len(chain.mass)))
    out = run(joint, controller, chain, number, wanted, open_loop, load, heat, others)
    others = others.copy()
    if len(chain.mass):
        others[:, :, number] = out[:, :3].T
    return Trace(np.arange(size) * DT, out[:, 0], out[:, 1], out[:, 2], out[:, 3], out[:, 4],
                 heat, reference, speed, *others)
