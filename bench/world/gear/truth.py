# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What a gear's friction is, from its own numbers and its own slow ramps."""

from numba import njit
import numpy as np

from world.gear.friction import motor_friction
from world.gear.plant import Plant
from world.gear.state import CLAMP, STATE
from world.person import nobody

SLOW = 1e-7  # rad/s: neither damping nor viscous friction takes anything
GONE = 0.95


def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current that keeps a joint at constant speeds.

    `gear`: GEAR. `speeds`: positive, rad/s. `side`: +1 or -1: the direction; 0 the mean of both.
    Returns A, of the shape of `speeds`.
    """
    g = gear
    x = np.asarray(speeds) / g['stribeck_velocity']
    outer = g['link_coulomb'] + g['link_viscous'] * speeds
    dry = g['coulomb'] + (g['static'] - g['coulomb']) * np.exp(-x ** g['stribeck_exponent'])
    torque = (dry * (1.0 + side * g['asymmetry']) + g['viscous'] * speeds
              + g['load_friction'] * outer + outer)
    return torque / g['torque_per_current']


def breakaway_currents(gears, seed, repetitions):
    """Return the currents at which slow ramps set each joint going.

    `gears`: ndarray of GEAR, shape (J,). Returns A of shape (J, repetitions); the even
    ones in positive direction, the odd ones in negative (as magnitudes).
    """
    bank = np.repeat(gears, repetitions)
    bank['gravity'] = bank['current_noise'] = 0.0
    side = np.where(np.arange(len(bank)) % 2 == 0, 1.0, -1.0)
    plant = Plant(bank, nobody(len(bank)), seed)
    # at places all round, for cogging and ripple differ from one to the next
    start = np.random.default_rng([seed, 5]).uniform(-np.pi, np.pi, len(bank))
    plant.states['motor'] = plant.states['link'] = start
    level = (bank['static'] + bank['link_coulomb']) / bank['torque_per_current']
    # Gone is who has left presliding behind: LuGre and Dahl give way a little all the time. What
    # held the joint is the most that friction took until then: by the time it is gone the ramp is
    # higher, for a rotor takes time to get going.
    far = 6.0 * np.maximum(bank['presliding'], bank['link_bristle']) + 2.0 * bank['resolution']
    most, gone = np.zeros(len(bank)), np.zeros(len(bank), dtype=bool)
    # settle at a fraction of the level, then 0.4 of it a second; the note had 0.4 to 0.5
    started, settle, rise = 0.4, 0.3, 2.5
    while not gone.all() and plant.time < 8.0:
        share = started * min(1.0, plant.time / settle) + max(0.0, plant.time - settle) / rise
        plant.advance(np.where(gone, 0.0, side * share * level))
        gone |= side * (plant.states['motor'] - start) > far
        dry = plant.states['friction'] - bank['viscous'] * plant.states['motor_velocity']
        most = np.where(gone, most, np.maximum(most, side * dry))
    found = np.where(gone, most, np.nan) / bank['torque_per_current']
    return found.reshape(len(gears), repetitions)


def presliding(gear):
    """Return the way to 95 % of breakaway, and by how much it differs from rest to rest, rad.

    What is on the link's side counts: an encoder cannot tell whose friction it is. A clamp does
    not give way: NaN.
    """
    if gear['friction'] == CLAMP:
        return np.nan, 0.0
    way, torque = _first_curve(gear)
    return way[int(np.argmax(torque >= GONE * torque[-1]))], 0.0


def _first_curve(gear):
    """Return ways in rad and the friction of rotor and link together at them, N·m."""
    way = np.linspace(0.0, 6.0 * max(gear['presliding'], 3.0 * gear['link_bristle']), 4000)
    torque = np.zeros(len(way))
    _load(gear, np.zeros(1, dtype=STATE)[0], way[1], torque)
    link = gear['link_coulomb'] * -np.expm1(-way / gear['link_bristle'])
    return way, torque + link


@njit(cache=True)
def _load(gear, state, step, torque):
    """Write the rotor's friction along a slow way of even steps."""
    for k in range(1, len(torque)):
        torque[k] = motor_friction(gear, state, SLOW, 0.0, step / SLOW)
