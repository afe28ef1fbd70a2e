# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random draws of geared joints for MuJoCo.

harmonic
    Strain wave gears of sizes 14 to 25: catalogue stiffness 3 to 30 kN·m/rad, ratios 50 to 160,
    no backlash, presliding 0.1 to 1 mrad.
planetary
    Small motors with planetary gears: 300 to 3000 N·m/rad, ratios 9 to 150, backlash 0.2 to 5 mrad
    (0.01 to 0.3 degrees; makers state 0.1 to 1 degree for cheap ones, of which the lower end).
cycloidal
    Stiff, backlash below an arc minute (0.05 to 0.3 mrad).
long
    Lubricated and preloaded gears whose presliding is 1 to 3 mrad long and differs by side.

Friction is two elements between rotor and housing, each stuck or sliding (``frictionloss``) behind
a spring, and one on the link's side, behind gear and backlash. Their level grows with rest by 0 to
6 % for every tenfold time (Rabinowicz's ageing) until the joint has slid for 1 to 10 mrad, and
waxes and wanes by 0 to 4 % with the turn of motor, wave generator or joint (eccentricity); the two
sides differ by up to 8 % in level and up to a factor of two in the way of presliding.
"""

import math

import numpy as np

from world.person import floats
from world.persons import log_uniform

KINDS = ('harmonic', 'planetary', 'cycloidal', 'long')
DEGREE = math.pi / 180.0

# At the joint, SI.
GEAR = np.dtype([('command_delay', 'i8'), *floats(
    'motor_inertia link_inertia stiffness damping backlash '
    # sliding friction of the rotor's side and of the link's, N·m; N·m·s/rad; relative, by side
    'coulomb static link_coulomb viscous asymmetry '
    # first element's share, the elements' ways to their level, rad; second side's over the first's
    'share first_distance second_distance distance_ratio micro_damping presliding '
    'ageing renewal eccentricity eccentricity_waves eccentricity_phase '
    'cogging cogging_waves gravity gravity_phase heating '
    'torque_per_current current_limit current_time current_noise resolution velocity_time')])


def draw_gears(kind, draws, seed):
    """Return random gears of a kind, shape (draws,)."""
    random = np.random.default_rng([seed, KINDS.index(kind), 4])
    gears = np.zeros(draws, dtype=GEAR)
    for g in gears:
        ratio = _drive(g, kind, random)
        _friction(g, kind, random)
        _electronics(g, ratio, random)
    return gears


def _drive(g, kind, random):
    """Set inertias, springs and the level; return the gear ratio."""
    if kind == 'planetary':
        ratio, level = log_uniform(random, 9.0, 150.0), log_uniform(random, 0.3, 3.0)
        g['motor_inertia'] = log_uniform(random, 0.005, 0.05)
        g['link_inertia'] = log_uniform(random, 0.01, 0.1)
        g['stiffness'] = log_uniform(random, 300.0, 3000.0)
        g['backlash'] = log_uniform(random, 2e-4, 5e-3)
    elif kind == 'cycloidal':
        ratio, level = random.choice([57.0, 81.0, 105.0, 121.0]), random.uniform(5.0, 25.0)
        g['motor_inertia'] = log_uniform(random, 0.2, 1.2)
        g['link_inertia'] = log_uniform(random, 0.2, 1.0)
        g['stiffness'] = log_uniform(random, 5e4, 1.5e5)
        g['backlash'] = log_uniform(random, 5e-5, 3e-4)
    else:
        ratio, level = random.choice([50.0, 80.0, 100.0, 120.0, 160.0]), log_uniform(
            random, 0.8, 12.0)
        g['motor_inertia'] = log_uniform(random, 0.05, 0.6)
        g['link_inertia'] = log_uniform(random, 0.03, 0.5)
        g['stiffness'] = log_uniform(random, 3e3, 3e4)
    reduced = 1.0 / (1.0 / g['motor_inertia'] + 1.0 / g['link_inertia'])
    g['damping'] = 2.0 * random.uniform(0.05, 0.4) * math.sqrt(g['stiffness'] * reduced)
    share = random.uniform(0.05, 0.3)
    g['coulomb'], g['link_coulomb'] = (1.0 - share) * level, share * level
    g['viscous'] = random.uniform(0.1, 0.8) * level / (100.0 * DEGREE)
    return ratio


def _friction(g, kind, random):
    g['presliding'] = log_uniform(random, 1e-3, 3e-3) if kind == 'long' else log_uniform(
        random, 1e-4, 1e-3)
    g['share'] = random.uniform(0.3, 0.7)
    # The way to 95 % of the level is where the second element is near its own.
    g['second_distance'] = g['presliding']
    g['first_distance'] = random.uniform(0.2, 0.8) * g['presliding']
    g['distance_ratio'] = log_uniform(random, 0.5, 2.0) if kind == 'long' else 1.0
    stiffest = g['coulomb'] / g['first_distance']
    g['micro_damping'] = random.uniform(0.1, 0.5) * 2.0 * math.sqrt(
        stiffest * g['motor_inertia'])
    g['asymmetry'] = random.choice([0.0, random.uniform(-0.08, 0.08)])
    g['ageing'] = random.choice([0.0, random.uniform(0.0, 0.06)])
    g['renewal'] = log_uniform(random, 1e-3, 1e-2)
    g['static'] = g['coulomb'] * (1.0 + g['ageing'])
    g['eccentricity'] = random.choice([0.0, random.uniform(0.0, 0.04)])
    g['eccentricity_phase'] = random.uniform(-math.pi, math.pi)


def _electronics(g, ratio, random):
    level = g['coulomb'] + g['link_coulomb']
    g['eccentricity_waves'] = random.choice([1.0, 2.0, ratio, 2.0 * ratio])
    g['cogging'], g['cogging_waves'] = random.uniform(0.0, 0.015) * level, 6.0 * ratio
    g['torque_per_current'] = level / random.uniform(0.08, 0.6)
    g['current_limit'] = 5.0
    g['command_delay'] = random.integers(0, 3)
    g['current_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 150.0, 1000.0))
    g['current_noise'] = random.uniform(0.001, 0.005) * level / g['torque_per_current']
    g['resolution'] = 2.0 * math.pi / (ratio * random.choice([2000, 4000, 8192, 16384]))
    g['velocity_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 20.0, 150.0))


def frictionless(gears):
    """Return the same drives without friction of any kind, and without what carries."""
    free = gears.copy()
    for name in ('coulomb', 'static', 'link_coulomb', 'viscous', 'cogging'):
        free[name] = 0.0
    return free
