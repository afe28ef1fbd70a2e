# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random draws of persons.

Arm inertia about the joint 0.03 to 0.3 kg·m² (forearm to whole arm; Winter 2009). Stiffness of a
relaxed arm 2 to 12 N·m/rad and of a tense one 30 to 200 (elbow and shoulder: Bennett, Hollerbach,
Xu and Hunter 1992; Perreault, Kirsch and Crago 2002), damping ratio 0.2 to 0.7, reaction after
80 to 200 ms. Where a task needs it, stiffness is chosen so that the person can move the joint. Who
leans does so with 0.2 to 0.5 of friction.
"""

import math

import numpy as np

from world.person import PERSON

SOFT, FIRM, ABLE, LEANING = range(4)
FIRMER = 30.0


def log_uniform(random, low, high):
    """Return a number whose logarithm is uniform."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def draw_persons(grips, breakaway_torque, seed):
    """Return random persons who touch from the beginning and have no wish yet.

    `grips`: sequence of int; SOFT, FIRM, LEANING (soft), or ABLE: firm enough to set the bare
    joint going with a lag of 0.1 to 0.5 rad. `breakaway_torque`: ndarray, shape (J,); N·m.
    Returns PERSON of shape (J,).
    """
    random = np.random.default_rng([seed, 555])
    persons = np.zeros(len(grips), dtype=PERSON)
    for who, grip, torque in zip(persons, grips, breakaway_torque):
        who['arm'] = log_uniform(random, 0.03, 0.3)
        between = {FIRM: (30.0, 200.0), ABLE: (torque / 0.5, torque / 0.1)}.get(grip, (2.0, 12.0))
        who['stiffness'] = log_uniform(random, *between)
        who['damping'] = 2.0 * random.uniform(0.2, 0.7) * math.sqrt(who['stiffness'] * who['arm'])
        who['voluntary'] = random.uniform(0.0, 0.4) * who['stiffness']
        who['delay'] = random.integers(80, 201)
        who['tremor_frequency'] = random.uniform(7.0, 11.0)
        who['tremor_phase'] = random.uniform(-math.pi, math.pi)
        who['release'] = who['start'] = np.inf
        who['acceleration_time'] = 1.0
        if grip == LEANING:
            who['lean'] = random.uniform(0.2, 0.5) * torque * random.choice([-1.0, 1.0])
    return persons


def firm_hands(bank, stream):
    """Return persons who lead each gear's joint along its path, and a generator for their paths.

    Thirty times as stiff as who is just able to move the bare joint: a lag of 3 to 17 mrad.
    """
    persons = draw_persons([ABLE] * len(bank.gears), bank.torque, bank.seed)
    persons['stiffness'] *= FIRMER
    persons['damping'] *= math.sqrt(FIRMER)
    return persons, np.random.default_rng([bank.seed, stream])


def drivers(gears, speed, start, release):
    """Return persons who bring each joint to a speed and let go: no arm stays on the joint."""
    persons = np.zeros(len(gears), dtype=PERSON)
    inertia = gears['motor_inertia'] + gears['link_inertia']
    persons['stiffness'] = inertia * 25.0**2
    persons['damping'] = 2.0 * 0.9 * inertia * 25.0
    persons['start'], persons['release'] = start, release
    persons['speed'], persons['acceleration_time'] = speed, 0.4
    persons['cruise_time'] = 100.0
    return persons
