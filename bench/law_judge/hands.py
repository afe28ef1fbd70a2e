# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What of friction a hand no longer feels, at the tempo at which people move.

Removed = (bare - law) / (bare - frictionless) of the torque of the hand: RMS, or the peak (low pass
at 20 Hz) at a start from rest. Every row has the same with 0.9 times Coulomb friction times tanh of
the drive's velocity, and with the printed kinetic law, beside it.
"""

import numpy as np

from law_judge.bank import DEGREE, Joints, make_bank, SPEEDS
from law_judge.loop import make_law, NONE, removed, run, share, smooth, YARDSTICKS
from world.person import ABLE, draw_persons, firm_hands, MOST_PLACES

FREQUENCIES = (0.2, 0.3, 0.6, 1.0, 1.2)
AMPLITUDES = 10.0 * DEGREE, 15.0 * DEGREE
FASTEST = 90.0 * DEGREE      # within the identified speeds
HURRIES = (1.0, 1.25, 1.5)   # times the identified speeds
START, SETTLED, END = 0.5, 2.5, 7.5
BEGINS = 0.3                 # s from its beginning in which a start has its peak
# How d comes, and the floor of the median, %. It tells the coming movement a moment ahead; a
# planner that passes through 0 is silent for a while before.
D = {'d = 0': 78.0, 'announced': 85.0, 'announced through 0': 85.0}
AHEAD, SILENT = 0.05, 0.1
REACHES = {'40 deg in 1.6 s': (40.0 * DEGREE, 1.6), '60 deg in 1.4 s': (60.0 * DEGREE, 1.4)}
RATE, ENCODER = 500, 2.0 * np.pi / 2**16     # of a leader arm, Hz, rad
# The note's movement starts here, s; when it is announced, and the floors of the medians, %.
NOTE_START = 1.5
WHEN = {'1 s ahead': (0.5, 88.0), 'with the push': (NOTE_START, 86.0),
        'not announced': (np.inf, None)}
# The person moves the other way: no heavier than without help.
WRONG = {'wrongly announced, 1 s ahead': (0.5, 0.0),
         'wrongly announced, with the push': (NOTE_START, 0.0)}
FAST = {'with the push, 80 deg/s': (NOTE_START, 80.0)}


def shares(joints, persons, seconds, figure, tried, hold=1):
    """Return what is removed from a figure of the hand's torque, %, by what was tried.

    `figure`: callable; gives the figure, one a joint or gear, from torques of shape (N, J).
    `tried`: dict of str to law and ``direction(time)``; the yardsticks are tried besides.
    """
    nothing = np.zeros(len(joints))

    def felt(law, direction, gears=None):
        plant = joints.plant(persons, gears)
        return figure(run(plant, make_law(law, joints, hold * plant.sample_time), seconds,
                          direction, {'torque': 'person'}, hold=hold)['torque'])
    tried = {**tried, **{name: (name, lambda time: nothing) for name in YARDSTICKS}}
    bare = felt(NONE, lambda time: nothing)
    floor = felt(NONE, lambda time: nothing, joints.bank.world.frictionless(joints.gears))
    return {name: removed(bare, felt(*way), floor) for name, way in tried.items()}


def rms(first, last=None):
    """Return what gives the RMS from one time to another, s."""
    def figure(torque):
        part = torque[round(1e3 * first):last and round(1e3 * last)]
        return np.sqrt(np.mean(np.square(part, dtype=float), axis=0))
    return figure


# To and fro.

def swaying(bank, frequencies, ways, fastest=None):
    """Let firm hands lead joints to and fro; return the joints and what each way removes, %.

    They are as fast as `fastest`, rad/s; otherwise some degrees wide, and no faster than `FASTEST`.
    `ways`: dict of str to law and key of `D`.
    """
    joints = Joints(bank, frequency=frequencies)
    persons, random = firm_hands(bank, 93)
    persons = persons[joints.gear]
    amplitude = random.uniform(*AMPLITUDES, len(bank.gears))[joints.gear]
    omega = 2.0 * np.pi * joints['frequency']
    persons['start'], persons['sway_frequency'] = START, joints['frequency']
    persons['sway'] = (np.minimum(amplitude, FASTEST / omega) if fastest is None
                       else fastest / omega)

    def coming(time):
        return np.where(time < START, 0.0, np.sign(np.sin(omega * (time + AHEAD - START))))

    def silent(time):
        return np.where(coming(time) == coming(time - SILENT), coming(time), 0.0)
    directions = dict(zip(D, (lambda time: 0.0 * omega, coming, silent)))
    return joints, shares(joints, persons, END, rms(SETTLED, END), {
        name: (law, directions[how]) for name, (law, how) in ways.items()})


def to_and_fro(bank, law):
    """Lead each joint to and fro at several frequencies, not announced and announced."""
    rows = []
    for known, word in ((True, ''), (False, ', presliding unknown')):
        _, found = swaying(bank.telling(known), FREQUENCIES, {how: (law, how) for how in D})
        rows += [share(f'to and fro, {how}{word}', found, how, floor if known else None)
                 for how, floor in D.items()]
    return rows


def hurry(bank, law):
    """Lead each joint to and fro as fast as was identified, and faster; d = 0."""
    rows = []
    for times in HURRIES:
        _, found = swaying(bank.telling(True), FREQUENCIES[2:4], {'d = 0': (law, 'd = 0')},
                           times * SPEEDS[-1])
        rows.append(share(f'to and fro at {times:g} of the identified speeds, d = 0', found,
                          'd = 0'))
    return rows


# Strokes between places.

def strokes(joints, persons, times, places, law, announced=False, hold=1):
    """Return what is removed from RMS and from starts, %, by law: two dicts.

    `times`, `places`: s from the beginning, rad; arrays of shape (J, K), or (K,) for all.
    """
    persons['start'], persons['strokes'] = START, np.shape(times)[-1] - 1
    persons['times'][:, :np.shape(times)[-1]] = times
    persons['places'][:, :np.shape(places)[-1]] = places
    everyone, last = np.arange(len(persons)), persons['strokes'][0]
    ways = np.diff(persons['places'][:, :last + 1], axis=1)
    begins = (ways != 0.0) & np.hstack([np.ones((len(ways), 1), bool), ways[:, :-1] == 0.0])

    def direction(time):
        if not announced or time < START:
            return 0.0 * everyone
        # After the last place there are only zeros.
        k = np.minimum((persons['times'][:, 1:last + 1] <= time - START).sum(axis=1), last - 1)
        return np.sign(ways[everyone, k])

    def both(torque):
        felt, starts = np.abs(smooth(torque)), np.full(len(persons), np.nan)
        for j in everyone:
            at = np.round(1e3 * (START + persons['times'][j, :last][begins[j]])).astype(int)
            starts[j] = np.median([felt[k:k + round(1e3 * BEGINS), j].max() for k in at])
        return np.array([rms(START)(torque), starts])
    found = shares(joints, persons, START + persons['times'][:, last].max(), both,
                   {law: (law, direction)}, hold)
    return [{name: each[k] for name, each in found.items()} for k in range(2)]


def reaches(bank, law):
    """Reach there and back, with pauses, announced with the push."""
    rows = []
    for name, (way, lasts) in REACHES.items():
        joints = Joints(bank, side=[1.0, -1.0])
        persons, _ = firm_hands(bank, 94)
        found = strokes(joints, persons[joints.gear],
                        np.cumsum([0.0, lasts, 0.8, lasts, 0.8, lasts]),
                        joints['side'][:, None] * way * np.array([0.0, 1.0, 1.0, 0.0, 0.0, 1.0]),
                        law, announced=True)
        rows += [share(f'reach of {name}, with the push: {what}', each, law)
                 for what, each in zip(('RMS', 'start'), found)]
    return rows


def leader(bank, law):
    """Let a hand move and pause as it likes on a leader arm: nobody knows the direction."""
    rows = []
    for known, word in ((True, ''), (False, ', presliding unknown')):
        told = bank.seen_by(ENCODER).telling(known)
        joints = Joints(told)
        persons, random = firm_hands(told, 95)
        times, places = np.zeros((2, len(persons), MOST_PLACES))
        for k in range(1, MOST_PLACES):
            pauses = random.uniform(size=len(persons)) < 0.3
            way = random.uniform(5.0, 40.0, len(persons)) * DEGREE * random.choice(
                [-1.0, 1.0], len(persons))
            # 1.875 times the mean is the fastest of minimum jerk.
            lasts = np.maximum(random.uniform(0.4, 1.5, len(persons)), 1.875 * abs(way) / FASTEST)
            times[:, k] = times[:, k - 1] + np.where(
                pauses, random.uniform(0.4, 1.5, len(persons)), lasts)
            places[:, k] = places[:, k - 1] + np.where(pauses, 0.0, way)
        found = strokes(joints, persons, times, places, law, hold=1000 // RATE)
        rows += [share(f'leader arm, d = 0{word}: {what}', each, law)
                 for what, each in zip(('RMS', 'start'), found)]
    return rows


# The note's movement: rest, acceleration, constant speed.

def peak(bank, law):
    """Return rows of the peak for announcements ahead, with the push, none, and wrong ones."""
    joints = Joints(bank, repetition=[0, 1], side=[1.0, -1.0])
    # Each gear has one person and one movement, whatever the repetition.
    number = len(bank.gears)
    persons = draw_persons([ABLE] * number, bank.torque, bank.seed)
    random = np.random.default_rng([bank.seed, 91])
    persons['start'], persons['cruise_time'] = NOTE_START, 10.0
    persons['speed'] = random.uniform(8.0, 25.0, number) * DEGREE
    persons['acceleration_time'] = random.uniform(0.5, 2.0, number)
    persons['tremor'] = random.uniform(0.0, 0.01, number) * bank.torque
    persons = persons[joints.gear]
    persons['speed'] *= joints['side']
    side, first = joints['side'], round(1e3 * NOTE_START)

    def highest(torque):
        return joints.each(smooth(torque * side)[first:].max(axis=0))
    rows = []
    for group, sign in ((WHEN, 1.0), (WRONG, -1.0), (FAST, 1.0)):
        if group is FAST:
            persons['speed'] = side * 80.0 * DEGREE
        found = shares(joints, persons, NOTE_START + 4.0, highest, {
            name: (law, lambda time, at=at, sign=sign: sign * side * (at <= time))
            for name, (at, _) in group.items()})
        rows += [share(f'peak, {name}', found, name, floor)
                 for name, (_, floor) in group.items()]
    return rows


# Other sensors, gears and models.

def seen(rate, bits):
    """Return a condition of a slow loop, an encoder of so many bits, and 2 to 5 ms of delay."""
    return {'resolution': 2.0 * np.pi / 2**bits,
            'command_delay': lambda gears: 2 + np.arange(len(gears)) % 4}, 1.0, 1000 // rate


# Name: fields of the gears, set before their models are found; factor of the models; and samples
# for which each current is held.
CONDITIONS = {
    'as drawn': ({}, 1.0, 1),
    **{f'{rate} Hz, {bits} bit, 2 to 5 ms late': seen(rate, bits)
       for rate in (1000, 250, 100) for bits in (16, 14, 12)},
    'friction grows by 0.2 of the load': ({'load_friction': 0.2}, 1.0, 1),
    'directions differ by 30 %': (
        {'asymmetry': lambda gears: 0.15 * (-1.0) ** np.arange(len(gears))}, 1.0, 1),
    'as a worm: falls by a third with speed, grows by 0.3 of the load': (
        {'static': lambda gears: 1.5 * gears['coulomb'], 'stribeck_velocity': 8.0 * DEGREE,
         'load_friction': 0.3}, 1.0, 1),
    "backlash of 3 mrad, a third of friction on the link's side": (
        {'backlash': 3e-3, 'link_coulomb': lambda gears: 0.5 * gears['coulomb']}, 1.0, 1),
    **{f'model of {factor:g} of the truth': ({}, factor, 1)
       for factor in (0.9, 1.05, 1.1, 1.15)},
}


def conditions(world, draws, seed, law, name):
    """Return rows of a reach from rest and back, d = 0, under one of `CONDITIONS`: RMS and start.

    Presliding is known. A world whose gears have no such fields has no rows.
    """
    fields, factor, hold = CONDITIONS[name]
    if not set(fields) <= set(world.GEAR.names):
        return []

    def change(gears):
        for field, value in fields.items():
            gears[field] = value(gears) if callable(value) else value
    bank = make_bank(world, world.KINDS, draws, seed, change).telling(True)
    joints = Joints(bank, side=[1.0, -1.0], factor=[factor])
    persons, _ = firm_hands(bank, 94)
    way, lasts = REACHES['40 deg in 1.6 s']
    found = strokes(joints, persons[joints.gear], np.cumsum([0.0, lasts, 0.8, lasts]),
                    joints['side'][:, None] * way * np.array([0.0, 1.0, 1.0, 0.0]), law, hold=hold)
    return [share(f'reach from rest, d = 0, {name}: {what}', each, law)
            for what, each in zip(('RMS', 'start'), found)]
