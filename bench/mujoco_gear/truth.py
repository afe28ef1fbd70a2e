# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a gear's friction is, from its own numbers and from slow ramps in the engine."""

import numpy as np

from law_judge.person import nobody
from mujoco_gear.plant import Plant

GONE, EARLY = 0.95, 1.0 / 3.0


def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current in A that keeps a joint at constant speeds, rad/s.

    `side` is the direction, +1 or -1; 0 the mean of both.
    """
    torque = (gear['coulomb'] * (1.0 + side * gear['asymmetry']) + gear['link_coulomb']
              + gear['viscous'] * np.asarray(speeds))
    return torque / gear['torque_per_current']


def breakaway_currents(gears, seed, repetitions=48):
    """Return the currents at which slow ramps set each joint going, A, shape (J, repetitions).

    The even ones in positive direction, the odd ones in negative, as magnitudes. It is the most
    that friction takes, rotor's and link's together: what the motor gives less what accelerates
    them, over 20 ms.
    """
    bank = np.repeat(gears, repetitions)
    bank['gravity'] = bank['current_noise'] = 0.0
    side = np.where(np.arange(len(bank)) % 2 == 0, 1.0, -1.0)
    plant = Plant(bank, nobody(len(bank)), seed)
    start = plant.states['motor'].copy()
    torque = bank['torque_per_current']
    level = (bank['static'] + bank['link_coulomb']) / torque
    far = 6.0 * bank['presliding'] + bank['backlash'] + 2.0 * bank['resolution']
    most, gone, given, momenta = np.zeros(len(bank)), np.zeros(len(bank), dtype=bool), [], []
    while not gone.all() and plant.time < 6.0:
        share = 0.4 * min(1.0, plant.time / 0.3) + max(0.0, plant.time - 0.3) / 2.5
        plant.advance(np.where(gone, 0.0, side * share * level))
        s = plant.states
        gone |= side * (s['motor'] - start) > far
        given.append(torque * s['current'] - bank['viscous'] * s['motor_velocity'])
        momenta.append(bank['motor_inertia'] * s['motor_velocity']
                       + bank['link_inertia'] * s['link_velocity'])
        if len(given) > 20:
            taken = np.mean(given[-20:], axis=0) - (momenta[-1] - momenta[-21]) / 0.02
            most = np.where(gone, most, np.maximum(most, side * taken))
    found = np.where(gone, most, np.nan) / torque
    return found.reshape(len(gears), repetitions)


def first_curve(gear, points=4000):
    """Return ways in rad and the friction of rotor and link together at them, N·m.

    Loaded slowly for the first time, teeth touching; the mean of both sides.
    """
    way = np.linspace(0.0, 3.0 * gear['presliding'], points)
    total = np.minimum(gear['link_coulomb'], gear['stiffness'] * way)
    for ratio in (1.0, gear['distance_ratio']):
        for share, distance in ((gear['share'], gear['first_distance']),
                                (1.0 - gear['share'], gear['second_distance'])):
            total = total + 0.5 * gear['coulomb'] * share * np.minimum(
                1.0, way / (ratio * distance))
    return way, total


def presliding_and_stiffness(gear):
    """Return the way in rad to 95 % of breakaway, and the slope up to a third of it in A/rad."""
    way, torque = first_curve(gear)
    early = max(int(np.argmax(torque > EARLY * torque[-1])), 2)
    slope = (torque[early] - torque[1]) / (way[early] - way[1]) / gear['torque_per_current']
    return way[int(np.argmax(torque >= GONE * torque[-1]))], slope
