# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rotor and link joined by a compliant gear, with a motor, its converter and an encoder.

Rotor:  J_m·a_m = k_t·n·i + cogging - friction - K·(q_m - q_l) - D·(v_m - v_l)
Link:   J_l·a_l = K·(q_m - q_l) + D·(v_m - v_l) - friction + gravity + person
(Spong 1987, with the damping of the gear), by semi-implicit Euler with many steps a sample.
"""

import math

from numba import njit
import numpy as np

from world.gear.friction import clamped, motor_friction, turned
from world.gear.state import CLAMP, DIFFERENCE, FILTERED, LONGEST_COMMAND_DELAY, STATE
from world.person import person_torque, remember

STILL = 2e-3  # rad/s below which a joint counts as resting
REST = 0.2  # s of rest after which a start finds other breakaway friction


@njit(cache=True)
def uniform(s):
    """Return a random number in 0..1 (splitmix64), different for each joint and sample."""
    s.random += np.uint64(0x9E3779B97F4A7C15)
    z = s.random
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@njit(cache=True)
def normal(s):
    """Return a random number of standard normal distribution."""
    u = max(uniform(s), 1e-300)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * uniform(s))


@njit(cache=True)
def applied(p, s, command):
    """Return the current that the converter heads for after delay and limits, A."""
    if not math.isfinite(command):
        command = 0.0
    s.commands[s.count % LONGEST_COMMAND_DELAY] = command
    wanted = 0.0
    if s.count >= p.command_delay:
        wanted = s.commands[(s.count - p.command_delay) % LONGEST_COMMAND_DELAY]
    wanted = min(p.current_limit, max(-p.current_limit, wanted))
    # what the supply can drive through the winding against the back-EMF
    emf = p.back_emf * s.motor_velocity
    wanted = min((p.voltage - emf) / p.resistance, max((-p.voltage - emf) / p.resistance, wanted))
    return wanted + p.current_noise * normal(s)


@njit(cache=True)
def advance(p, s, who, time, command, sample_time, steps):
    """Advance one joint by one sample."""
    h = sample_time / steps
    goal = applied(p, s, command)
    heading = 1.0 - math.exp(-h / p.current_time)
    x, v, y, w = s.motor, s.motor_velocity, s.link, s.link_velocity
    if p.heating != 0.0:
        s.temperature = p.heating * (1.0 - math.exp(-time / p.heating_time))
    touched = who.touch <= time < who.release
    inertia = p.link_inertia + (who.arm if touched else 0.0)
    remember(who, s, time)
    work = resisting = 0.0
    for k in range(steps):
        s.current += heading * (goal - s.current)
        drive = s.current * p.torque_per_current
        if p.current_ripple != 0.0:
            drive *= 1.0 + p.current_ripple * math.cos(p.current_ripple_frequency * x)
        if p.cogging != 0.0:
            drive += p.cogging * math.cos(p.cogging_frequency * x + p.cogging_phase)
        shaft = p.stiffness * (x - y) + p.damping * (v - w)
        s.person = person_torque(who, s, time + k * h, y, w) if touched else 0.0
        outer = s.person - p.link_viscous * w
        if p.gravity != 0.0:
            outer -= p.gravity * math.cos(y - p.gravity_phase)
        if p.link_coulomb != 0.0:
            s.link_bristle = turned(s.link_bristle, w * h, p.link_bristle, 1.0)
            outer -= p.link_coulomb * s.link_bristle
        if p.friction == CLAMP:
            new = clamped(p, s, v, shaft, drive - shaft, h)
            resisting = drive - shaft - p.motor_inertia * (new - v) / h
        else:
            resisting = motor_friction(p, s, v, shaft, h)
            new = v + h * (drive - shaft - resisting) / p.motor_inertia
        work += resisting * h * 0.5 * (v + new)
        v = new
        w += h * (shaft + outer) / inertia
        x += h * v
        y += h * w
        s.motor = x
    s.motor_velocity, s.link, s.link_velocity = v, y, w
    s.friction_work += work
    s.friction = resisting + p.link_coulomb * s.link_bristle
    if not abs(v) < 1e4:
        # beyond all reason: hold it there, so that the run ends with finite numbers
        s.motor_velocity = s.link_velocity = 1e4
    rest_or_slide(p, s, sample_time)
    s.count += 1


@njit(cache=True)
def rest_or_slide(p, s, sample_time):
    """Keep account of sliding, and draw the next breakaway friction after a rest."""
    if abs(s.motor_velocity) > STILL:
        s.slid += abs(s.motor_velocity) * sample_time
        s.resting = 0.0
        return
    s.resting += sample_time
    if s.resting > REST and s.slid > max(5.0 * p.presliding, 1e-3):
        s.breakaway_factor = max(-0.5, p.scatter * normal(s))
        s.slid = 0.0


@njit(cache=True)
def measure(p, s, sample_time):
    """Read the encoder: position to the count, velocity as the drive has it."""
    count = math.floor((s.motor + s.offset) / p.resolution)
    position = count * p.resolution
    last = s.measured if s.count > 0 else position
    s.measured = position
    if p.velocity_kind == DIFFERENCE:
        s.measured_velocity = (position - last) / sample_time
    else:
        seen = (position - last) / sample_time
        if p.velocity_kind != FILTERED:
            seen = s.motor_velocity + p.velocity_noise * normal(s)
        s.measured_velocity += (1.0 - math.exp(-sample_time / p.velocity_time)) * (
            seen - s.measured_velocity)


@njit(cache=True)
def advance_all(gears, states, persons, time, commands, sample_time, steps):
    """Advance every joint by one sample."""
    for j in range(len(gears)):
        advance(gears[j], states[j], persons[j], time, commands[j], sample_time, steps)


@njit(cache=True)
def measure_all(gears, states, sample_time):
    """Read every joint's encoder."""
    for j in range(len(gears)):
        measure(gears[j], states[j], sample_time)


class Plant:
    """A bank of joints with their persons.

    `gears`: ndarray of GEAR, shape (J,). `persons`: ndarray of PERSON, shape (J,). `seed`: of
    noise and scatter. `sample_time`: s. `steps`: steps of integration a sample.
    """

    def __init__(self, gears, persons, seed, sample_time=1e-3, steps=20):
        self.gears, self.persons = gears.copy(), persons.copy()
        self.sample_time, self.steps, self.time = sample_time, steps, 0.0
        random = np.random.default_rng([seed, 77])
        joints = len(gears)
        self.states = np.zeros(joints, dtype=STATE)
        s = self.states
        s['random'] = random.integers(0, 2**63, joints)
        s['offset'] = random.uniform(0.0, 1.0, joints) * gears['resolution']
        s['breakaway_factor'] = np.maximum(-0.5, gears['scatter'] * random.normal(size=joints))
        # the gear's spring holds the link where nothing moves it
        s['link'] = 0.0
        measure_all(self.gears, s, sample_time)

    def sample(self):
        """Return measured position and velocity, each of shape (J,), rad and rad/s."""
        if self.states['count'][0] > 0:
            measure_all(self.gears, self.states, self.sample_time)
        return self.states['measured'].copy(), self.states['measured_velocity'].copy()

    def advance(self, current):
        """Apply currents, A, for one sample."""
        advance_all(self.gears, self.states, self.persons, self.time,
                    np.ascontiguousarray(current, dtype=float), self.sample_time, self.steps)
        self.time += self.sample_time

    def knock(self, speed):
        """Change the speed of every joint, rad/s."""
        self.states['motor_velocity'] += speed
        self.states['link_velocity'] += speed

    def repeat_first(self, times):
        """Let every so many joints in a row begin as the first of them: same noise, same rest."""
        self.states[:] = self.states[::times].repeat(times)
