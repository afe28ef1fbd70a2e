# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a gear's friction is, from its own numbers and from slow ramps in the engine."""

from functools import cache

import numpy as np

from world.mujoco_gear.plant import Plant
from world.person import nobody

GONE = 0.95
RAMPS, RAMP_TIME = 8, 1.2   # s to breakaway, as in `law_judge.identification`


def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current in A that keeps a joint at constant speeds, rad/s.

    `side` is the direction, +1 or -1; 0 the mean of both.
    """
    torque = (gear['coulomb'] * (1.0 + side * gear['asymmetry']) + gear['link_coulomb']
              + gear['viscous'] * np.asarray(speeds))
    return torque / gear['torque_per_current']


def breakaway_currents(gears, seed, repetitions):
    """Return the currents at which slow ramps set each joint going, A, shape (J, repetitions).

    The even ones in positive direction, the odd ones in negative, as magnitudes. It is the most
    that friction takes, rotor's and link's together.
    """
    _, taken = _ramps(gears, seed, repetitions,
                      lambda time: 0.4 * min(1.0, time / 0.3) + max(0.0, time - 0.3) / 2.5, 6.0)
    return (np.nanmax(taken, axis=0) / np.repeat(gears['torque_per_current'], repetitions)
            ).reshape(len(gears), repetitions)


def _ramps(gears, seed, repetitions, share, longest):
    """Load resting joints and return their ways in rad and what friction takes in N·m, (T, R).

    `share` is that of the level by the time in s. What friction takes is what the motor gives less
    what accelerates rotor and link, over 20 ms; NaN where a joint is gone.
    """
    bank = np.repeat(gears, repetitions)
    bank['gravity'] = bank['current_noise'] = 0.0
    side = np.where(np.arange(len(bank)) % 2 == 0, 1.0, -1.0)
    plant = Plant(bank, nobody(len(bank)), seed)
    start = plant.states['motor'].copy()
    torque = bank['torque_per_current']
    level = (bank['static'] + bank['link_coulomb']) / torque
    far = 6.0 * bank['presliding'] + bank['backlash'] + 2.0 * bank['resolution']
    gone = np.zeros(len(bank), dtype=bool)
    ways, given, momenta, kept = [], [], [], []
    while not gone.all() and plant.time < longest:
        plant.advance(np.where(gone, 0.0, side * share(plant.time) * level))
        s = plant.states
        ways.append(side * (s['motor'] - start))
        gone |= ways[-1] > far
        kept.append(~gone)
        given.append(side * (torque * s['current'] - bank['viscous'] * s['motor_velocity']))
        momenta.append(side * (bank['motor_inertia'] * s['motor_velocity']
                               + bank['link_inertia'] * s['link_velocity']))
    total, momenta = np.cumsum(given, axis=0), np.array(momenta)
    taken = (total[20:] - total[:-20]) / 20.0 - (momenta[20:] - momenta[:-20]) / 0.02
    return np.array(ways)[10:-10], np.where(np.array(kept)[20:], taken, np.nan)


def presliding(gear):
    """Return the way to 95 % of breakaway, mean of both directions, and a single rest's deviation.

    The way is that of a ramp as identification asks for, since the engine's friction creeps: its
    elements alone give way by a half less, a ramp of twenty times the length by three times more.
    Both in rad, the second a standard deviation.
    """
    return _way_of_ramps(gear.tobytes(), gear.dtype)


@cache
def _way_of_ramps(gear, dtype):
    gears = np.frombuffer(gear, dtype).copy()
    gears['backlash'] = 0.0     # its teeth touch
    ways, taken = _ramps(gears, 0, RAMPS, lambda time: time / RAMP_TIME, 3.0 * RAMP_TIME)
    reached = taken >= GONE * np.nanmax(taken, axis=0)
    given = ways[np.argmax(reached, axis=0), np.arange(ways.shape[1])]
    distance = 0.5 * float(np.median(given[0::2]) + np.median(given[1::2]))
    return distance, float(np.sqrt(np.mean((given - distance) ** 2)))
