# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How much of friction's part of the peak torque at the start of a movement is taken away.

A person follows the note's movement (rest, acceleration, constant speed). The peak of the torque
(low pass at 20 Hz) is taken without compensation, with each law, and with a joint of the same
inertia that has no friction: the floor. Removed = (none - law) / (none - frictionless), each the
mean over repetitions and both directions.
"""

import numpy as np

from law_judge.bank import Joints
from law_judge.felt import per_gear, removed as share_removed, smooth
from law_judge.loop import make_law, NONE, run, YARDSTICKS
from law_judge.rows import beside, DEGREE, Row
from world.persons import ABLE, draw_persons

START = 1.5
# When the direction is announced, s; the floors of the median and of the worst tenth, %.
WHEN = {'1 s ahead': (0.5, 88.0, 78.0), 'with the push': (START, 86.0, 78.0),
        'not announced': (np.inf, 50.0, None)}
# The person moves the other way: no heavier than without help.
WRONG = {'wrongly announced, 1 s ahead': 0.5, 'wrongly announced, with the push': START}
FAST = 'with the push, 80 deg/s'
FASTEST, FASTEST_LEAST = 80.0 * DEGREE, 80.0
COUNTS = 10.0   # of presliding, from which on an unannounced push is to be helped


def peak(bank, law):
    """Return rows for announcements ahead, with the push, and none."""
    joints = Joints(bank, repetition=[0, 1], side=[1.0, -1.0])
    persons = movements(joints)
    removed = _removed(joints, persons, law, {when: at for when, (at, _, _) in WHEN.items()})
    rows = []
    for when, (_, median, tenth) in WHEN.items():
        share = removed[when]
        name = f"friction's part of the peak removed, {when}"
        detail = {f'{kind} {g}': round(float(s), 1) for g, (kind, s) in enumerate(
            zip(bank.kinds, share))}
        if tenth is not None:
            rows += [Row(name, float(np.nanmedian(share)), median, ' %', True, detail=detail,
                         beside=beside(removed, np.nanmedian)),
                     Row(f'{name}: worst tenth', _tenth(share), tenth, ' %', True,
                         beside=beside(removed, _tenth))]
            continue
        known = np.array([bool(document.get('presliding')) and document['presliding']['distance']
                          >= COUNTS * gear['resolution']
                          for document, gear in zip(bank.documents, bank.gears)])
        for which, among, least in (('presliding known, ≥ 10 counts', known, median),
                                    ('otherwise', ~known, None)):
            if among.any():
                of_these = {who: each[among] for who, each in removed.items()}
                rows.append(Row(f'{name}, {which}', float(np.nanmedian(share[among])), least,
                                ' %', True, detail=detail, beside=beside(of_these, np.nanmedian)))
        rows.append(Row(f'{name}: worst', float(np.nanmin(share)), -2.0, ' %', True,
                        beside=beside(removed, np.nanmin)))
    removed = _removed(joints, persons, law, WRONG, -1.0)
    for when in WRONG:
        name = f"friction's part of the peak removed, {when}"
        for which, figure, least in (('', np.nanmedian, 0.0), (': worst', np.nanmin, None)):
            rows.append(Row(f'{name}{which}', float(figure(removed[when])), least, ' %', True,
                            beside=beside(removed, figure)))
    persons['speed'] = joints['side'] * FASTEST
    removed = _removed(joints, persons, law, {FAST: START})
    rows.append(Row(f"friction's part of the peak removed, {FAST}",
                    float(np.nanmedian(removed[FAST])), FASTEST_LEAST, ' %', True,
                    beside=beside(removed, np.nanmedian)))
    return rows


def _tenth(share):
    return float(np.nanpercentile(share, 10))


def _removed(joints, persons, law, when, sign=1.0):
    """Return the share removed on each gear, %, by when it is announced and by yardstick.

    `sign`: -1 where the other direction is announced.
    """
    floor = peaks(joints, persons, NONE, joints.bank.world.frictionless(joints.gears))
    bare = peaks(joints, persons, NONE)
    found = {name: peaks(joints, persons, law, announce=since(joints, at, sign))
             for name, at in when.items()}
    found.update((name, peaks(joints, persons, name)) for name in YARDSTICKS)
    return {name: share_removed(bare, each, floor) for name, each in found.items()}


def movements(joints):
    """Return persons who start to move from rest."""
    bank = joints.bank
    # each gear has one person and one movement, whatever the repetition
    persons = draw_persons([ABLE] * len(bank.gears), bank.torque, bank.seed)
    random = np.random.default_rng([bank.seed, 91])
    number = len(bank.gears)
    persons['start'] = START
    persons['speed'] = random.uniform(8.0, 25.0, number) * DEGREE
    persons['acceleration_time'] = random.uniform(0.5, 2.0, number)
    persons['cruise_time'] = 10.0
    persons['tremor'] = random.uniform(0.0, 0.01, number) * bank.torque
    persons = persons[joints.gear]
    persons['speed'] *= joints['side']
    return persons


def since(joints, at, sign=1.0):
    """Return what announces each joint's direction, or the other one, from a time on, s."""
    return lambda plant: lambda time: sign * joints['side'] * (at <= time)


def peaks(joints, persons, law, gears=None, announce=None):
    """Return each gear's mean peak; ``announce(plant)`` gives its directions by the time."""
    plant, side = joints.plant(persons, gears), joints['side']
    record = run(plant, make_law(law, joints), START + 4.0,
                 (announce or since(joints, np.inf))(plant), {'torque': 'person'})
    first = round(START / plant.sample_time)
    return per_gear(joints, smooth(record['torque'] * side, plant.sample_time)[first:].max(axis=0))
