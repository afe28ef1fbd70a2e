# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How much of friction's part of the peak torque at the start of a movement is taken away.

A person follows the note's movement (rest, acceleration, constant speed). The peak of the torque
(low pass at 20 Hz) is taken without compensation, with each law, and with a joint of the same
inertia that has no friction: the floor. Removed = (none - law) / (none - frictionless), each the
mean over repetitions and both directions.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from independent_gear.bank import Joints
from independent_gear.gears import ARMIN
from independent_gear.loop import make_law, NONE, run
from independent_gear.persons import ABLE, draw_persons
from independent_gear.plant import Plant
from independent_gear.refined import REFINED
from independent_gear.rows import DEGREE, figure_row
from independent_gear.state import CLAMP

START = 1.5
WANTED = 0.85
AHEAD, WITH = 0.5, START
BAND = 20.0
# A law that shakes the joint finds its peaks small. Loud: RMS above 8 Hz beyond this, and beyond
# 1.5 times that of the frictionless joint (these persons have tremor).
LOUD = 0.2 * DEGREE


def peak(bank, laws, quick=False):
    """Return rows for each kind and law; 'kinetic' is the law with d = 0 where there is one.

    Parameters
    ----------
    bank : Bank
    laws : sequence of str
    quick : bool
    """
    joints = Joints(bank, repetition=list(range(2 if quick else 4)), side=[1.0, -1.0])
    persons, seconds = _movements(joints)
    floor, free = _peaks(joints, persons, seconds, NONE, frictionless(joints.gears))
    bare, _ = _peaks(joints, persons, seconds, NONE, joints.gears)
    shares, loud, rows = {}, {}, []
    for law in laws:
        for when, at in (('announced 1 s ahead', AHEAD), ('announced with the push', WITH)):
            if law == 'kinetic' and at == WITH:
                continue
            with_law, shaking = _peaks(joints, persons, seconds, law, joints.gears, at)
            loud[law, when] = shaking > np.maximum(LOUD, 1.5 * free)
            shares[law, when] = (bare - with_law) / np.maximum(bare - floor, 1e-9)
            rows += _rows(bank, law, when, shares[law, when], (bare, floor, with_law))
    for (law, when), share in shares.items():
        if when == 'announced with the push' and law != 'paper' and ('paper', when) in shares:
            more = share - shares['paper', when]
            quiet = ~loud['paper', when]
            for name, which in ((f'peak {when}: more than paper', slice(None)),
                                (f'peak {when}: more than paper where that is quiet', quiet)):
                if more[which].size:
                    median = np.median(more[which])
                    rows.append(figure_row(name, 'all', law, 100 * median, median >= 0.0, '≥ 0',
                                           ' points', gears=more[which].size,
                                           loud_gears=int(loud[law, when].sum())))
    return rows


def frictionless(gears):
    """Return the same drives without friction of any kind."""
    free = gears.copy()
    free['friction'] = CLAMP
    for name in ('coulomb', 'static', 'viscous', 'link_coulomb', 'link_viscous', 'load_friction',
                 'cogging'):
        free[name] = 0.0
    return free


def _movements(joints):
    bank = joints.bank
    # each gear has one person and one movement, whatever the repetition
    torque = bank.gears['static'] + bank.gears['link_coulomb']
    persons = draw_persons([ABLE] * len(bank.gears), torque, bank.seed)
    random = np.random.default_rng([bank.seed, 91])
    number = len(bank.gears)
    persons['start'] = START
    persons['speed'] = random.uniform(8.0, 25.0, number) * DEGREE
    persons['acceleration_time'] = random.uniform(0.5, 2.0, number)
    persons['cruise_time'] = 10.0
    persons['tremor'] = random.uniform(0.0, 0.01, number) * torque
    persons = persons[joints.gear]
    persons['speed'] *= joints['side']
    return persons, START + 2.0 + 2.0


def _peaks(joints, persons, seconds, law, gears, at=np.inf):
    plant = Plant(gears, persons, joints.bank.seed)
    side = joints['side']
    record = run(plant, make_law(law, joints), seconds,
                 lambda time: side * (at <= time), {'torque': 'person', 'v': 'motor_velocity'})
    rate, first = 1.0 / plant.sample_time, round(START / plant.sample_time)
    torque = sosfiltfilt(butter(2, BAND, fs=rate, output='sos'), record['torque'] * side, axis=0)
    shaking = sosfiltfilt(butter(4, 8.0, 'high', fs=rate, output='sos'), record['v'], axis=0)
    return (_per_gear(joints, torque[first:].max(axis=0)),
            _per_gear(joints, np.sqrt(np.mean(shaking[first // 2:]**2, axis=0))))


def _per_gear(joints, values):
    return np.bincount(joints.gear, values) / np.bincount(joints.gear)


def _rows(bank, law, when, share, torques):
    rows, kinds = [], np.array(bank.kinds)
    names = list(dict.fromkeys(bank.kinds))
    for kind in [*names, 'all']:
        here = np.ones(len(kinds), dtype=bool) if kind == 'all' else kinds == kind
        median = np.median(share[here])
        # the floors: the median of all gears, each of the note's drives, each refinement
        judged = kind in ('all', *ARMIN, *REFINED) and when == 'announced 1 s ahead'
        rows.append(figure_row(
            f"friction's part of the peak removed, {when}", kind, law, 100 * median,
            median >= WANTED or not judged, '≥ 85 %' if judged else '', ' %',
            worst=100 * np.min(share[here]), gears=int(here.sum()),
            peaks_none_frictionless_law=[np.median(t[here]).item() for t in torques]))
    return rows
