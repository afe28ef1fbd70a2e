# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Drives with the note's friction behind chains of Maxwell elements; for identification only.

A chain is springs in parallel, each of which slips at its share of the level (Iwan 1966; Lampaert,
Al-Bender and Swevers 2003, with elements that relax at once). Its breakaway current is a number of
the gear, not the outcome of a ramp, so that nothing is measured to judge a measurement.
"""

import math

from numba import njit
import numpy as np

from world.person import floats
from world.persons import log_uniform

KINDS = ('configuration_1', 'configuration_2', 'configuration_3')
ELEMENTS = 10
DEGREE = math.pi / 180.0
REST, STILL = 0.15, 1e-3    # s, rad/s: after so much rest another level at rest is drawn
# Ratio; inertia of rotor and wave generator, kg·m²; current at rest and its standard deviation,
# current on the way to which friction rises or falls with speed, A; A per deg/s: sections 2 and 3
# of the note, Eq. 11 (rows of configurations 2 and 3 interchanged, as Fig. 4 tells).
_DRIVES = {
    'configuration_1': (100.0, 0.101, 0.0995, 0.0034, 0.0926, 0.0008),
    'configuration_2': (100.0, 0.101, 0.1377, 0.0043, 0.1595, 0.0027),
    'configuration_3': (435.0, 1.911, 0.3357, 0.0172, 0.3590, 0.0032),
}
GEAR = np.dtype([*floats(
    'inertia static coulomb link_coulomb viscous transition scatter asymmetry presliding damping '
    'torque_per_current current_limit current_time current_noise resolution gravity'),
    ('share', 'f8', (ELEMENTS,)), ('reach', 'f8', (ELEMENTS,))])
STATE = np.dtype([*floats(
    'motor motor_velocity current measured measured_velocity offset factor resting slid'),
    ('force', 'f8', (ELEMENTS,))])


def draw_gears(kind, draws, seed):
    """Return random drives of one of the note's configurations, shape (draws,)."""
    random = np.random.default_rng([seed, KINDS.index(kind), 31])
    ratio, inertia, static, std, sliding, viscous = _DRIVES[kind]
    gears = np.zeros(draws, GEAR)
    for g in gears:
        g['torque_per_current'] = torque = 0.119 * ratio
        # The link moves with the rotor.
        g['inertia'] = inertia + random.uniform(0.03, 0.3) * inertia
        g['static'], g['coulomb'] = static * torque, sliding * torque
        g['viscous'] = viscous / DEGREE * torque
        g['scatter'], g['asymmetry'] = std / static, random.uniform(-0.03, 0.03)
        # The speed on the way to which friction leaves its level at rest: 0.1 to 1 deg/s.
        g['transition'] = log_uniform(random, 0.1, 1.0) * DEGREE
        g['presliding'] = log_uniform(random, 1e-4, 1e-3)
        weight = random.uniform(0.5, 1.5, ELEMENTS)
        g['share'] = weight / weight.sum()
        g['reach'] = g['presliding'] * (
            np.arange(1, ELEMENTS + 1) / ELEMENTS) ** random.uniform(0.7, 2.0)
        stiffness = float(np.sum(g['share'] / g['reach'])) * g['static']
        g['damping'] = 2.0 * random.uniform(0.2, 1.0) * math.sqrt(g['inertia'] / stiffness)
        g['current_limit'], g['current_noise'] = 3.0, random.uniform(0.001, 0.003)
        g['current_time'] = random.uniform(2e-4, 2e-3)
        g['resolution'] = 2.0 * math.pi / (4000.0 * ratio)
    return gears


@njit(cache=True)
def _advance(gears, states, commands, sample_time, steps):
    h = sample_time / steps
    for j in range(len(gears)):
        g, s = gears[j], states[j]
        heading = 1.0 - math.exp(-h / g.current_time)
        for _ in range(steps):
            s.current += heading * (commands[j] - s.current)
            v = s.motor_velocity
            sliding = g.coulomb + (g.static * s.factor - g.coulomb) * math.exp(
                -abs(v) / g.transition)
            friction = g.viscous * v
            for i in range(ELEMENTS):
                f = s.force[i]
                side = 1.0 + (g.asymmetry if f > 0.0 else -g.asymmetry)
                most = g.share[i] * sliding * side
                spring = g.share[i] * g.static / g.reach[i]
                new = f + spring * v * h
                if abs(new) >= most:
                    new = math.copysign(most, new)
                    friction += new
                else:
                    # The damper is across what sticks.
                    friction += new + g.damping * spring * v
                s.force[i] = new
            v += h * (g.torque_per_current * s.current - friction) / g.inertia
            s.motor_velocity = v
            s.motor += h * v


class Plant:
    """A bank of drives; `persons` are not asked for anything."""

    def __init__(self, gears, persons, seed, sample_time=1e-3, steps=20):
        self.gears, self.sample_time, self.steps, self.time = gears, sample_time, steps, 0.0
        self._random = np.random.default_rng([seed, 32])
        joints = len(gears)
        self.states = np.zeros(joints, STATE)
        self.states['offset'] = self._random.uniform(0.0, 1.0, joints) * gears['resolution']
        self.states['factor'] = self._levels()
        self.states['measured'] = self._count()

    def _levels(self):
        return 1.0 + self.gears['scatter'] * np.clip(
            self._random.normal(size=len(self.gears)), -4.0, 4.0)

    def _count(self):
        place = (self.states['motor'] + self.states['offset']) / self.gears['resolution']
        return np.floor(place) * self.gears['resolution']

    def sample(self):
        """Return measured position and its rate, each of shape (J,), rad and rad/s."""
        return self.states['measured'].copy(), self.states['measured_velocity'].copy()

    def advance(self, current):
        """Apply currents, A, for one sample."""
        s, g = self.states, self.gears
        noise = g['current_noise'] * self._random.normal(size=len(g))
        _advance(g, s, np.clip(current, -g['current_limit'], g['current_limit']) + noise,
                 self.sample_time, self.steps)
        self.time += self.sample_time
        fast = np.abs(s['motor_velocity']) > STILL
        s['slid'] += np.where(fast, np.abs(s['motor_velocity']) * self.sample_time, 0.0)
        s['resting'] = np.where(fast, 0.0, s['resting'] + self.sample_time)
        # A joint that has slid and rests without current breaks away at another level.
        fresh = (s['resting'] > REST) & (s['slid'] > 2.0 * g['presliding']) & (current == 0.0)
        if fresh.any():
            s['factor'] = np.where(fresh, self._levels(), s['factor'])
            s['slid'][fresh] = 0.0
        counted = self._count()
        s['measured_velocity'] = (counted - s['measured']) / self.sample_time
        s['measured'] = counted


def breakaway_currents(gears, seed, repetitions):
    """Return largest currents in A that hold, shape (J, repetitions).

    The even ones are those of the positive direction, the odd ones of the negative (magnitudes).
    """
    random = np.random.default_rng([seed, 33])
    side = np.where(np.arange(repetitions) % 2 == 0, 1.0, -1.0)
    level = (gears['static'] / gears['torque_per_current'])[:, None]
    return level * (1.0 + gears['asymmetry'][:, None] * side) * (
        1.0 + gears['scatter'][:, None] * random.normal(size=(len(gears), repetitions)))


def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current in A that keeps a joint at constant speeds, rad/s."""
    dry = gear['coulomb'] + (gear['static'] - gear['coulomb']) * np.exp(
        -np.asarray(speeds) / gear['transition'])
    return (dry * (1.0 + side * gear['asymmetry']) + gear['viscous'] * speeds
            ) / gear['torque_per_current']


def presliding(gear):
    """Return the way to 95 % of breakaway in rad, and its standard deviation from rest to rest."""
    way = np.linspace(0.0, 1.1 * float(np.max(gear['reach'])), 4000)
    held = np.minimum(way[:, None] / gear['reach'], 1.0) @ gear['share']
    return float(way[int(np.argmax(held >= 0.95))]), 0.0
