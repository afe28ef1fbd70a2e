# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random draws of plausible gears.

Families, with where the ranges come from; what has no source is an assumption and says so.

armin_1, armin_2, armin_3
    The note's drives: torque constant, ratio, counts, Eq. 11, breakaway currents and scatter.
    Rotor of the RE 35 (Maxon) and wave generator of the HFUC-14, 0.101 and 1.91 kg·m² at the
    joint. Stiffness between K1 and K3 of the Harmonic Drive catalogue (ratio 100: 4,700 to 7,100;
    ratio 30: 1,900 to 3,400 N·m/rad, seen through the belt of 14.5, which is assumed to be as
    stiff as 2e4 to 1e5 N·m/rad). Link inertia is assumed: a cuff and a sensor.
ak80
    Quasi-direct drive with planetary gear of 9:1 (CubeMars AK80-9: rotor 607 g·cm², about
    0.1 N·m/A, 14 bit, backdriving about 0.5 N·m); stiffness assumed.
ur
    Harmonic drive of 101:1 in a cobot: HFUC-17 to -25 stiffness (1e4 to 3.1e4 N·m/rad), friction
    as measured on such robots, 4 to 15 N·m at the joint.
cycloidal
    Servo with RV gear, ratios 57 to 121, 20 to 49 N·m/arcmin (Nabtesco RV-6E, RV-20E).
planetary
    Small DC motor with two or three planetary stages (Maxon GP 32, GP 42); stiffness assumed.

Presliding distance 0.1 to 1 mrad, in one draw of six up to 2 mrad: harmonic drives show hysteresis
of about one arcmin, 0.3 mrad (Seyfferth, Maghzal and Angeles 1995; Dhaouadi, Ghorbel and Gandhi
2003; the maker's hysteresis loss). Damping of presliding and of the gear: 0.1 to 0.7 of critical.
"""

import math

import numpy as np

from world.gear.state import (
    BOUC_WEN,
    CLAMP,
    DAHL,
    DIFFERENCE,
    ELEMENTS,
    FRICTIONS,
    GEAR,
    LUGRE,
    MAXWELL_SLIP,
)
from world.persons import log_uniform

DEGREE = math.pi / 180.0
ARMIN = ('armin_1', 'armin_2', 'armin_3')
SERVOS = ('ak80', 'ur', 'cycloidal', 'planetary')
KINDS = ARMIN + tuple(FRICTIONS)
TORQUE_CONSTANT = 0.119

# Ratio, inertia of rotor and wave generator at the joint, level and breakaway current, A, its
# standard deviation, viscous current per deg/s, stiffness. The note prints the coefficients of
# configurations 2 and 3 in each other's place (Fig. 4, and the breakaway currents, tell).
_ARMIN = {
    'armin_1': (100.0, 0.101, 0.0926, 0.0995, 0.0034, 0.0008, (4700.0, 7100.0)),
    'armin_2': (100.0, 0.101, 0.1595, 0.1377, 0.0043, 0.0027, (4700.0, 7100.0)),
    'armin_3': (435.0, 1.911, 0.3590, 0.3357, 0.0172, 0.0032, (1.9e4, 8.4e4)),
}


def draw_gears(kind, draws, seed):
    """Return random gears of a kind.

    `kind`: one of `KINDS`: one of the note's drives with friction of any kind, or a friction in a
    servo drive of any family. Returns GEAR of shape (draws,).
    """
    random = np.random.default_rng([seed, KINDS.index(kind)])
    gears = np.zeros(draws, dtype=GEAR)
    for k, gear in enumerate(gears):
        if kind in ARMIN:
            friction = k % len(FRICTIONS)
            family = kind
        else:
            friction = FRICTIONS[kind]
            family = (SERVOS + ARMIN[::2])[(k + seed) % (len(SERVOS) + 2)]
        gear['friction'] = friction
        _drive(gear, family, random)
        _friction(gear, random)
        _electronics(gear, random)
    return gears


def _drive(gear, family, random):
    g = gear
    if family in ARMIN:
        ratio, g['motor_inertia'], level, breakaway, std, viscous, stiffness = _ARMIN[family]
        constant, counts, limit = TORQUE_CONSTANT, 4000, 3.0
        g['stiffness'] = random.uniform(*stiffness)
        g['link_inertia'] = log_uniform(random, 0.03, 0.3) * (2.0 if ratio > 400 else 1.0)
        g['torque_per_current'] = constant * ratio
        # Configurations 2 and 3 break away below the level Eq. 11 extrapolates from faster motion
        g['coulomb'] = min(level, 0.96 * breakaway) * g['torque_per_current']
        g['static'] = breakaway * g['torque_per_current']
        g['viscous'] = viscous / DEGREE * g['torque_per_current']
        g['scatter'] = std / breakaway
        g['stribeck_velocity'] = random.uniform(0.5, 2.0) * DEGREE
    else:
        rotor, ratio, constant, counts, limit, stiffness, friction, inertia = _servo(family, random)
        g['motor_inertia'] = rotor * ratio**2
        g['torque_per_current'] = constant * ratio
        g['stiffness'], g['link_inertia'] = stiffness, inertia
        g['coulomb'] = friction
        g['static'] = friction * random.choice([1.0, random.uniform(1.0, 1.15),
                                                random.uniform(1.15, 1.5)])
        g['viscous'] = friction * random.uniform(0.1, 0.8)
        g['scatter'] = random.uniform(0.01, 0.06)
        g['stribeck_velocity'] = log_uniform(random, 0.3, 3.0) * DEGREE
    g['current_limit'] = limit
    g['resolution'] = 2.0 * math.pi / (counts * ratio)
    reduced = 1.0 / (1.0 / g['motor_inertia'] + 1.0 / g['link_inertia'])
    g['damping'] = 2.0 * random.uniform(0.1, 0.7) * math.sqrt(g['stiffness'] * reduced)
    g['back_emf'] = g['torque_per_current']
    g['voltage'] = random.uniform(3.0, 10.0) * g['back_emf']
    g['resistance'] = g['voltage'] / (limit * random.uniform(1.2, 4.0))
    g['current_ripple'] = random.uniform(0.0, 0.02)
    g['current_ripple_frequency'] = ratio * random.choice([4, 6, 14, 22, 42])


def _servo(family, random):
    """Return rotor kg·m², ratio, N·m/A, counts, limit A, stiffness, friction N·m, link kg·m²."""
    between = random.uniform
    if family == 'ak80':
        return (6.07e-5, 9.0, between(0.09, 0.11), 2**14, 15.0, log_uniform(random, 800.0, 4000.0),
                between(0.3, 0.9), log_uniform(random, 0.01, 0.1))
    if family == 'ur':
        return (between(0.8e-4, 2.2e-4), 101.0, between(0.1, 0.135), 2**random.integers(12, 18),
                between(8.0, 20.0), log_uniform(random, 1e4, 3.1e4), between(4.0, 15.0),
                log_uniform(random, 0.1, 1.0))
    if family == 'cycloidal':
        return (between(0.3e-4, 1.0e-4), random.choice([57.0, 81.0, 105.0, 121.0]),
                between(0.3, 0.6), 2**random.integers(17, 20), between(4.0, 10.0),
                log_uniform(random, 6.9e4, 1.7e5), between(5.0, 25.0),
                log_uniform(random, 0.3, 1.0))
    return (between(1e-6, 7e-6), between(20.0, 150.0), between(0.03, 0.12),
            random.choice([2000, 2048, 4000, 4096]), between(4.0, 10.0),
            log_uniform(random, 300.0, 2000.0), between(0.3, 2.0), log_uniform(random, 0.01, 0.1))


def _friction(gear, random):
    g = gear
    g['stribeck_exponent'] = random.choice([1.0, 2.0])
    g['renewal'] = log_uniform(random, 2e-3, 2e-2)
    g['damping_ratio'] = random.uniform(0.1, 0.7)
    long = random.uniform() < 1 / 6
    g['presliding'] = random.uniform(1e-3, 2e-3) if long else log_uniform(random, 1e-4, 1e-3)
    g['load_friction'] = random.choice([0.0, random.uniform(0.0, 0.03)])
    # the note's own breakaway currents are the same both ways, Eq. 11 by up to 5 % not
    g['asymmetry'] = random.choice([0.0, random.uniform(-0.05, 0.05)])
    # some of the friction is on the link's side
    share = random.uniform(0.0, 0.15)
    g['link_coulomb'] = share * g['coulomb']
    g['link_viscous'] = share * g['viscous']
    g['link_bristle'] = log_uniform(random, 1e-4, 1e-3) / 3.0
    for name in ('coulomb', 'viscous'):
        g[name] *= 1.0 - share
    g['static'] -= g['link_coulomb']
    # cogging well below friction, and friction that waxes and wanes with the teeth
    ratio = g['current_ripple_frequency'] / 6.0
    if random.uniform() < 0.4:
        g['cogging'] = random.uniform(0.0, 0.03) * g['coulomb']
        g['cogging_frequency'] = ratio
    if random.uniform() < 0.4:
        g['ripple'] = random.uniform(0.0, 0.03)
        g['ripple_frequency'] = random.choice([2.0, 20.0, 60.0, 202.0])
    g['cogging_phase'], g['ripple_phase'] = random.uniform(-math.pi, math.pi, 2)
    set_presliding(g, random)


def set_presliding(gear, random):
    """Set the constants of the gear's kind of friction so that presliding is as long as asked."""
    g = gear
    if g['friction'] in (DAHL, BOUC_WEN):
        g['static'] = g['coulomb']  # these kinds have no other level at rest
    if g['friction'] == MAXWELL_SLIP:
        shape = random.uniform(1.0, 2.0)
        reach = (np.arange(1, ELEMENTS + 1) / ELEMENTS) ** shape
        weight = random.uniform(0.5, 1.5, ELEMENTS)
        g['element_share'] = weight / weight.sum()
        g['element_distance'] = g['presliding'] * reach
        g['attraction'] = log_uniform(random, 100.0, 2000.0)
        return
    if g['friction'] == CLAMP:
        g['presliding'] = 0.0
        return
    g['damping_velocity'] = log_uniform(random, 2e-3, 2e-2)
    if g['friction'] == LUGRE:
        g['exponent'], reach = 1.0, 3.0
    elif g['friction'] == DAHL:
        g['exponent'] = random.choice([0.5, 1.0, 1.0, 1.5])
        e = g['exponent']
        reach = 3.0 if e == 1.0 else (0.05 ** (1.0 - e) - 1.0) / (e - 1.0)
    else:
        g['exponent'], g['share'] = random.uniform(1.0, 3.0), random.uniform(0.5, 0.9)
        z = np.linspace(0.0, 0.95, 2001)
        slope = 1.0 / (1.0 - z ** g['exponent'])
        reach = float(np.sum((slope[1:] + slope[:-1]) * np.diff(z)) / 2.0)
    g['bristle'] = g['presliding'] / reach


def _electronics(gear, random):
    g = gear
    g['command_delay'] = random.integers(0, 3)
    g['current_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 100.0, 1000.0))
    breakaway = (g['static'] + g['link_coulomb']) / g['torque_per_current']
    g['current_noise'] = random.uniform(0.001, 0.005) * breakaway
    g['velocity_kind'] = random.choice(3)
    g['velocity_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 20.0, 150.0))
    g['velocity_noise'] = g['resolution'] / random.uniform(0.005, 0.05)
    if g['velocity_kind'] == DIFFERENCE:
        g['velocity_time'] = 1e-3


def frictionless(gears):
    """Return the same drives without friction of any kind."""
    free = gears.copy()
    free['friction'] = CLAMP
    for name in ('coulomb', 'static', 'viscous', 'link_coulomb', 'link_viscous', 'load_friction',
                 'cogging'):
        free[name] = 0.0
    return free
