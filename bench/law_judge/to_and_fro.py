# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movement at the tempo at which people move: what of friction the hand no longer feels.

A firm hand leads the joint to and fro, reaches for places (minimum jerk), or moves and pauses as it
likes. Removed = (bare - law) / (bare - frictionless) of the torque of the hand: RMS, or the peak
(low pass at 20 Hz) within 0.3 s of the beginning of each movement from rest. Beside the law: the
printed kinetic law, and 0.9 times Coulomb friction times tanh of the drive's velocity.
"""

import numpy as np

from law_judge.bank import Joints
from law_judge.felt import removed, smooth
from law_judge.loop import make_law, NONE, run, YARDSTICKS
from law_judge.model import SPEEDS
from law_judge.rows import beside, DEGREE, Row
from world.person import MOST_PLACES
from world.persons import firm_hands

FREQUENCIES = (0.2, 0.3, 0.6, 1.0, 1.2)
AMPLITUDES = 10.0 * DEGREE, 15.0 * DEGREE
FASTEST = 90.0 * DEGREE      # within the identified speeds
HURRIES = (1.0, 1.25, 1.5)     # times the identified speeds
START, SETTLED, END = 0.5, 2.5, 7.5
BEGINS = 0.3
# How d comes, and the floors of median and worst gear, %. It tells the coming movement a moment
# ahead; a planner that passes through 0 is silent for a while before.
D = {'d = 0': (78.0, 60.0), 'announced': (85.0, 65.0), 'announced through 0': (85.0, 65.0)}
AHEAD, SILENT = 0.05, 0.1
REACHES = {'40 deg in 1.6 s': (40.0 * DEGREE, 1.6), '60 deg in 1.4 s': (60.0 * DEGREE, 1.4)}
RATES, JUDGED = (1000, 500, 250, 100), 500     # Hz
ENCODER = 2.0 * np.pi / 2**16


def to_and_fro(bank, law):
    """Lead each joint to and fro at several frequencies, not announced and announced."""
    return [row for known in (True, False) for row in _to_and_fro(bank.telling(known), law, known)]


def swaying(bank, frequencies, fastest=None):
    """Return joints that firm hands lead to and fro, and what tells how a law does.

    They are as fast as `fastest`, rad/s; otherwise some degrees wide, and no faster than `FASTEST`.

    Returns
    -------
    joints : Joints
        With the condition ``frequency``, Hz.
    removed : callable
        ``removed(law, how)`` gives the share removed from the RMS torque of each hand, %, shape
        (J,); `how` is a key of `D`.
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

    def felt(name, how='d = 0', gears=None):
        record = _record(joints, persons, name, gears, directions[how], END)
        return _rms(record, round(1e3 * SETTLED), round(1e3 * END))
    floor, bare = felt(NONE, gears=bank.world.frictionless(joints.gears)), felt(NONE)
    return joints, lambda name, how='d = 0': removed(bare, felt(name, how), floor)


def _to_and_fro(bank, law, known):
    joints, share = swaying(bank, FREQUENCIES)
    shares = {name: share(name) for name in YARDSTICKS}
    rows = []
    for how, (median, worst) in D.items():
        shares['law'] = share(law, how)
        name = f'to and fro, {how}{"" if known else ", presliding unknown"}: removed'
        if not known:
            median = worst = None
        detail = {f'{f} Hz': _spread(shares['law'][joints['frequency'] == f])
                  for f in FREQUENCIES}
        detail['gears'] = {f'{kind} {g}': round(float(np.nanmin(shares['law'][joints.gear == g])))
                           for g, kind in enumerate(bank.kinds)}
        rows += [Row(name, float(np.nanmedian(shares['law'])), median, ' %', True,
                     detail=detail, beside=beside(shares, np.nanmedian)),
                 Row(f'{name}, worst', float(np.nanmin(shares['law'])), worst, ' %', True,
                     beside=beside(shares, np.nanmin))]
    return rows


def hurry(bank, law):
    """Lead each joint to and fro as fast as was identified, and faster; d = 0."""
    return [row for share in HURRIES for row in _hurry(bank.telling(True), law, share)]


def _hurry(bank, law, fastest):
    _, share = swaying(bank, FREQUENCIES[2:4], fastest * SPEEDS[-1])
    shares = {name: share(name) for name in YARDSTICKS}
    shares['law'] = share(law)
    name = f'to and fro at {fastest:g} of the identified speeds, d = 0: removed'
    return [Row(name, float(np.nanmedian(shares['law'])), None, ' %', True,
                beside=beside(shares, np.nanmedian)),
            Row(f'{name}, worst', float(np.nanmin(shares['law'])), None, ' %', True,
                beside=beside(shares, np.nanmin))]


def reaches(bank, law):
    """Reach there and back, with pauses, announced with the push."""
    rows = []
    for name, (way, lasts) in REACHES.items():
        joints = Joints(bank, side=[1.0, -1.0])
        persons, _ = firm_hands(bank, 94)
        times = np.cumsum([0.0, lasts, 0.8, lasts, 0.8, lasts])
        places = joints['side'][:, None] * way * np.array([0.0, 1.0, 1.0, 0.0, 0.0, 1.0])
        persons = _strokes(persons[joints.gear], times, places)
        shares = _shares(joints, persons, law, announced=True)
        rows += _both(f'reach of {name}, with the push', shares, (None, None))
    return rows


def leader(bank, law):
    """Let a hand move and pause as it likes on a leader arm: nobody knows the direction."""
    bank = bank.seen_by(ENCODER)
    return [row for rate in RATES for known in (True, False) if known or rate == JUDGED
            for row in _hand(bank.telling(known), law, rate, known)]


def _hand(bank, law, rate, known):
    joints = Joints(bank, repetition=[0])
    persons, random = firm_hands(bank, 95)
    times, places = np.zeros((2, len(persons), MOST_PLACES))
    for k in range(1, MOST_PLACES):
        pauses = random.uniform(size=len(persons)) < 0.3
        way = random.uniform(5.0, 40.0, len(persons)) * DEGREE * random.choice(
            [-1.0, 1.0], len(persons))
        # 1.875 times the mean is the fastest of minimum jerk
        lasts = np.maximum(random.uniform(0.4, 1.5, len(persons)), 1.875 * abs(way) / FASTEST)
        times[:, k] = times[:, k - 1] + np.where(pauses, random.uniform(0.4, 1.5, len(persons)),
                                                 lasts)
        places[:, k] = places[:, k - 1] + np.where(pauses, 0.0, way)
    persons = _strokes(persons, times, places)
    floors = (74.0, 47.0) if rate == JUDGED and known else (None, None)
    name = f'leader arm at {rate} Hz, d = 0{"" if known else ", presliding unknown"}'
    return _both(name, _shares(joints, persons, law, hold=1000 // rate), floors)


def _strokes(persons, times, places):
    persons['start'], persons['strokes'] = START, times.shape[-1] - 1
    persons['times'][:, :times.shape[-1]], persons['places'][:, :times.shape[-1]] = times, places
    return persons


def _shares(joints, persons, law, announced=False, hold=1):
    """Return the share removed from RMS and peaks of each joint, %, by law."""
    gears = joints.gears
    end = START + np.max(persons['times'][:, persons['strokes'][0]])
    everyone = np.arange(len(persons))

    def direction(time):
        if not announced:
            return 0.0 * everyone
        # After the last place there are only zeros.
        begun = (persons['times'][:, :-1] <= max(0.0, time - START)) & (
            np.arange(MOST_PLACES - 1) < persons['strokes'][:, None])
        k = begun.sum(axis=1) - 1
        return np.sign(persons['places'][everyone, k + 1] - persons['places'][everyone, k]) * (
            time >= START)
    felt = {}
    for name in (NONE, 'frictionless', law, *YARDSTICKS):
        plain = name == 'frictionless'
        record = _record(joints, persons, NONE if plain else name,
                         joints.bank.world.frictionless(gears) if plain else gears,
                         direction, end, hold)
        felt[name] = _rms(record, round(1e3 * START), None), _starts(record, persons)
    return {name: [removed(*trio) for trio in zip(felt[NONE], found, felt['frictionless'])]
            for name, found in felt.items()}


def _both(name, shares, floors):
    rows = []
    for k, (what, floor) in enumerate(zip(('RMS', 'start'), floors)):
        each = {who: found[k] for who, found in shares.items()}
        values = next(value for who, value in each.items()
                      if who not in (NONE, 'frictionless', *YARDSTICKS))
        rows.append(Row(f'{name}: {what} removed', float(np.nanmedian(values)), floor, ' %', True,
                        detail={'worst': float(np.nanmin(values))},
                        beside=beside(each, np.nanmedian)))
    return rows


def _record(joints, persons, name, gears, direction, seconds, hold=1):
    plant = joints.plant(persons, gears)
    record = run(plant, make_law(name, joints, hold * plant.sample_time), seconds, direction,
                 {'torque': 'person'}, hold=hold)
    return record['torque']


def _rms(torque, first, last):
    return np.sqrt(np.mean(np.square(torque[first:last], dtype=float), axis=0))


def _starts(torque, persons):
    """Return the median peak at the beginnings of movements from rest, shape (J,)."""
    felt = np.abs(smooth(torque))
    found = np.full(len(persons), np.nan)
    for j, who in enumerate(persons):
        ways = np.diff(who['places'][:who['strokes'] + 1])
        begins = [k for k in range(len(ways)) if ways[k] != 0.0 and (k == 0 or ways[k - 1] == 0.0)]
        at = [round(1e3 * (START + who['times'][k])) for k in begins]
        found[j] = np.median([felt[k:k + round(1e3 * BEGINS), j].max() for k in at])
    return found


def _spread(values):
    return f'{np.nanmedian(values):.0f} ({np.nanmin(values):.0f} to {np.nanmax(values):.0f})'
