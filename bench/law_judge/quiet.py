# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Vibration: while a person holds, starts and moves slowly; after a knock; under a flicker.

Vibration is what remains of the velocity above 8 Hz (4th-order Butterworth, forwards and
backwards), the larger of rotor's and link's (both at the joint), RMS over each part of the
movement, beside the same without compensation. The simulated persons have no tremor.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from law_judge.bank import Joints
from law_judge.loop import make_law, NONE, run
from law_judge.model import STD
from law_judge.rows import count, DEGREE
from world.person import nobody
from world.persons import draw_persons, FIRM, LEANING, SOFT

BAND = 8.0
LIMIT, MORE = 0.2 * DEGREE, 1.25
HELD, START, STOP, END = 0.8, 2.0, 5.5, 8.0
PARTS = {'hold': (HELD, START), 'start': (START, 3.0), 'motion': (3.0, STOP),
         'stop': (STOP, 6.5), 'hold again': (6.5, END - 0.3)}
# to and fro by this, deg, instead of slow motion: no direction can be announced for it
SWAY, SWAY_FREQUENCY = -5.0, 0.3
KNOCK, KNOCK_AT, LOOK = 0.05, 2.0, (2.0, 3.0)
FEW = (2.0, 12.0)       # counts of presliding: a coarse encoder
RINGS, RING_BAND = 0.1 * DEGREE, 4.0    # RMS of the velocity above so many Hz


def quiet(bank, law):
    """Let persons hold, start and move slowly."""
    joints = Joints(bank, grip=[SOFT, FIRM, LEANING], speed=[3.0, 10.0, SWAY],
                    # announced ahead, with the push, not at all
                    announce=[1.0, START, np.inf])
    # who sways is told nothing, whenever
    found, bare = (watch_vibration(joints, name) for name in (law, NONE))
    rows = []
    for name, parts in (('hold and slow motion', ('hold', 'motion', 'hold again')),
                        ('second of start or stop', ('start', 'stop'))):
        loud = np.max([found[p] for p in parts], axis=0)
        than = np.max([bare[p] for p in parts], axis=0)
        rows.append(count(f'vibrates, {name}', joints, loud > np.maximum(LIMIT, MORE * than),
                          0.02, worst=float(loud.max() / DEGREE)))
    return rows


def watch_vibration(joints, law):
    """Return RMS vibration in rad/s, shape (J,), of each part of the movement."""
    persons = draw_persons(joints['grip'], joints.torque, joints.bank.seed)
    side = joints.sides
    persons['start'], persons['speed'] = START, side * joints['speed'] * DEGREE
    persons['acceleration_time'], persons['cruise_time'] = 0.5, STOP - START - 1.0
    sways = joints['speed'] == SWAY
    persons['sway'][sways] = 0.5 * SWAY * DEGREE
    persons['sway_frequency'] = SWAY_FREQUENCY

    def direction(time):
        return side * ((joints['announce'] <= time) & (time < STOP) & ~sways)
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), END, direction,
                 {'v': 'motor_velocity', 'w': 'link_velocity'})
    sos = butter(4, BAND, 'high', fs=1.0 / plant.sample_time, output='sos')
    parts = {name: np.zeros(len(joints)) for name in PARTS}
    for velocity in (record['v'], record['w']):
        rest = sosfiltfilt(sos, velocity, axis=0)
        for name, (first, last) in PARTS.items():
            part = rest[round(first / plant.sample_time):round(last / plant.sample_time)]
            parts[name] = np.maximum(parts[name], np.sqrt(np.mean(part**2, axis=0)))
    # who sways does not hold again, nor start or stop
    for name in ('start', 'stop', 'hold again'):
        parts[name][sways] = 0.0
    return parts


def knock(bank, law):
    """Knock on joints at rest, with and without a preload: who still rings after two seconds?"""
    return [_rings(name, gears, law) for name, gears in (
        ('rings 2 s after a knock', bank),
        ('rings 2 s after a knock, presliding of 2 to 12 counts', _few_counts(bank)))]


def _few_counts(bank):
    """Return the gears with a coarser encoder, and models that know their presliding."""
    counts = np.random.default_rng([bank.seed, 73]).uniform(*FEW, len(bank.gears))
    distance = np.array([bank.world.presliding(g)[0] for g in bank.gears])
    known = np.flatnonzero(np.isfinite(distance))
    seen = bank.seen_by(np.where(np.isfinite(distance), distance / counts,
                                 bank.gears['resolution']))
    return seen.chosen(known, [
        {**seen.documents[g], 'presliding': {
            'distance': float(distance[g]), 'std': STD * float(distance[g])}} for g in known])


def _rings(name, bank, law):
    joints = Joints(bank, direction=[0, 1], factor=[1.0, 1.1], way=[-1.0, 1.0])
    side = joints.sides * joints['direction']

    def ringing(name):
        plant = joints.plant(nobody(len(joints)))
        record = run(plant, make_law(name, joints), KNOCK_AT + LOOK[1],
                     lambda time: side * (time >= 0.3), {'v': 'motor_velocity'},
                     knock=(KNOCK_AT, KNOCK * joints['way']))
        first = round((KNOCK_AT + LOOK[0]) / plant.sample_time)
        # a heavy joint may still coast, which is no ringing
        sos = butter(4, RING_BAND, 'high', fs=1.0 / plant.sample_time, output='sos')
        return sosfiltfilt(sos, record['v'], axis=0)[first:].std(axis=0)
    found, bare = ringing(law), ringing(NONE)
    at_rest = bare < 0.5 * RINGS
    return count(name, joints, found > RINGS, which=at_rest,
                 worst=float(found[at_rest].max() / DEGREE))


def flicker(bank, law):
    """Announce a direction to and fro to joints at rest, untouched or held."""
    joints = Joints(bank, frequency=[2.0, 3.5, 5.0], low=[-1, 0], held=[0, 1])
    persons = draw_persons([SOFT] * len(joints), joints.torque, bank.seed)
    persons['touch'] = np.where(joints['held'] == 1, 0.0, np.inf)

    def direction(time):
        up = np.floor(2.0 * joints['frequency'] * time) % 2 == 0
        return np.where(up, 1, joints['low']) * (time >= 0.5)
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), 5.0, direction, {'v': 'motor_velocity'})
    shaken = np.sqrt(np.mean(record['v'][2000:] ** 2, axis=0))
    return [count('announcement flickers at 2 to 5 Hz: shakes', joints, shaken > LIMIT, 0.02,
                  worst=float(shaken.max() / DEGREE))]
