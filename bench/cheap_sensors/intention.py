# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How much of friction the law removes if only a sensor knows where the person wants to go.

The gears, persons and movements of `law_judge.peak`: a person follows a movement on a screen, and
the same law is told the direction a second ahead, not at all, or by a sensor. And how far a joint
goes when the person lets go.
"""

import numpy as np

from cheap_sensors.attempts import rest_torque, Sensors
from law_judge.bank import Joints
from law_judge.felt import removed
from law_judge.loop import make_law, NONE, run
from law_judge.peak import movements, peaks, since, START
from law_judge.rows import DEGREE

_CHUNK = 10
# Samples from one record to the next; s from the start until a person lets go, and from there.
_EVERY, HELD, _AFTER = 50, 2.0, 6.0


class Watched:
    """Announces by sensors what the persons of a plant do."""

    def __init__(self, plant, joints, seed):
        self._plant = plant
        random = np.random.default_rng([seed, 431])
        self._sensors = Sensors(joints.torque, [seed, 432])
        self._sensors.calibrate(rest_torque(random, len(joints), 4.0) * joints.torque)
        self._rows, self._directions = [], np.zeros(len(joints), dtype=np.int64)

    def __call__(self, time):
        """Return the directions for the sample at a time in s, shape (J,)."""
        states = self._plant.states
        self._rows.append(states['person'].copy())
        if len(self._rows) == _CHUNK:
            self._directions = self._sensors.play(
                np.array(self._rows), states['measured'][None])[-1]
            self._rows = []
        return self._directions

    @property
    def is_pushed(self):
        """Whether the sensors feel beyond doubt that the persons push, shape (J,)."""
        return self._sensors.is_pushed


def intention(bank, law='continuous'):
    """Return, for each gear, the share of friction's part of the peak that is removed.

    Returns arrays of shape (G,) by name, for 'announced', 'd = 0' and 'force'; NaN where friction
    has no part in the peak.
    """
    joints = Joints(bank, repetition=[0, 1], side=[1.0, -1.0])
    persons = movements(joints)
    sources = sources_of(joints)
    floor = peaks(joints, persons, NONE, bank.world.frictionless(joints.gears))
    bare = peaks(joints, persons, NONE)
    return {name: 0.01 * removed(bare, peaks(joints, persons, law, announce=announce), floor)
            for name, announce in sources.items()}


def sources_of(joints):
    """Return what announces the joints' directions, by name, as for `peaks`."""
    return {'announced': since(joints, START - 1.0), 'd = 0': since(joints, np.inf),
            'force': lambda plant: Watched(plant, joints, joints.bank.seed)}


def let_go(bank, factors, law='continuous'):
    """Return how far each joint goes when its person lets go 2 s after the start, deg, by source.

    Models have `factors` times the true friction.
    """
    joints = Joints(bank, factor=factors, side=[1.0, -1.0])
    persons = movements(joints)
    persons['release'] = START + HELD
    way = {}
    for name, announce in sources_of(joints).items():
        plant = joints.plant(persons)
        place = run(plant, make_law(law, joints), START + HELD + _AFTER, announce(plant),
                    {'x': 'link'}, _EVERY)['x']
        first = round((START + HELD) / plant.sample_time) // _EVERY
        way[name] = np.abs(place[first:] - place[first]).max(axis=0) / DEGREE
    return way
