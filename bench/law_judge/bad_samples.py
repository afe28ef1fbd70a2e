# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""One bad sample, or a sensor that lies: an untouched joint must stay and the current recover."""

import numpy as np

from law_judge.bank import Joints
from law_judge.loop import announced, make_law, run
from law_judge.rows import count, DEGREE
from world.person import nobody

AT, SECONDS = 2000, 6.0  # sample of the fault
STUCK = 2000  # samples
TRAVEL = 1.0 * DEGREE
RECOVER = 0.5  # s
# Normal is the current of the same joint without the fault, within a tenth of its breakaway
# current, over 50 ms.
NORMAL = 0.1
EVERY = 50
FOREVER = 10**9


# name: (what of the sample, value or function of it, when, last bad sample)
FAULTS = {
    'velocity 100 rad/s': ('velocity', 100.0, AT),
    'velocity NaN': ('velocity', np.nan, AT),
    'velocity infinite': ('velocity', np.inf, AT),
    'velocity 1e307': ('velocity', 1e307, AT),
    'position NaN': ('position', np.nan, AT),
    'position 1e307': ('position', 1e307, AT),
    'position off by a turn, once': ('position', 'turn', AT),
    'position off by a turn, for good': ('position', 'turn', FOREVER),
    'velocity stuck at 0.2 rad/s for 2 s': ('velocity', 0.2, AT + STUCK),
    'velocity in deg/s, always': ('velocity', 'degrees', FOREVER),
}
CLOCKS = ('equal times', 'time back by 10 ms', 'time NaN', 'time ahead by 10 s',
          '20 samples missing', '300 samples missing')


def bad_samples(bank, law):
    """Return how many joints travel, or do not get their current back, over all faults."""
    # One joint of each row is spared: noise and rest of a run of its own would be others.
    joints = Joints(bank, direction=[0, 1], fault=['none', *FAULTS])
    found = _run(joints, law, _spoil(joints))
    normal, rows = found['i'][:, joints['fault'] == 'none'], []
    for fault, (_, _, last) in FAULTS.items():
        here = joints['fault'] == fault
        always = fault.endswith('always')
        # a jump for good is over when it has happened
        end = None if always else AT if last == FOREVER else last
        rows.append(_fails({name: found[name][:, here] for name in ('x', 'i')},
                           normal, joints.breakaway[here], end))
    reference = Joints(bank, direction=[0, 1], fault=['none'])
    normal = _run(reference, law, None)['i']
    for fault in CLOCKS:
        spoiled = _run(reference, law, _spoil_clock(fault))
        found['raised'] += spoiled['raised']
        rows.append(_fails(spoiled, normal, reference.breakaway,
                           AT + 300 if fault.startswith('300') else AT))
    each = dict(zip([*FAULTS, *CLOCKS], (int(row.sum()) for row in rows)))
    everyone = Joints(bank, direction=[0, 1], fault=[*FAULTS, *CLOCKS])
    return [count(f'bad samples, {len(rows)} kinds: travels, or no current after', everyone,
                  np.stack(rows, axis=1).ravel(), 0.01, each=each, raised=found['raised'])]


def _run(joints, law, corrupt):
    # Every fault meets the same joint: the same gear, noise and rest.
    faults = len(dict.fromkeys(joints['fault'].tolist()))
    plant = joints.plant(nobody(len(joints)))
    plant.repeat_first(faults)
    side = np.where(np.arange(len(joints)) // faults % 4 < 2, 1, -1)
    return run(plant, make_law(law, joints), SECONDS, announced(side * joints['direction'], 0.5),
               {'x': 'motor', 'i': 'command'}, EVERY, corrupt)


def _spoil(joints):
    who = {fault: joints['fault'] == fault for fault in FAULTS}

    def corrupt(k, time, position, velocity):
        position, velocity = position.copy(), velocity.copy()
        for fault, (what, value, last) in FAULTS.items():
            first = 0 if fault.endswith('always') else AT
            if not first <= k <= last:
                continue
            signal = position if what == 'position' else velocity
            here = who[fault]
            if value == 'turn':
                signal[here] += 2.0 * np.pi
            elif value == 'degrees':
                signal[here] /= DEGREE
            else:
                signal[here] = value
        return time, position, velocity
    return corrupt


def _spoil_clock(fault):
    def corrupt(k, time, position, velocity):
        if fault.endswith('missing'):
            missing = int(fault.split()[0])
            return None if AT <= k < AT + missing else (time, position, velocity)
        if k == AT:
            time = {'equal times': time - 1e-3, 'time back by 10 ms': time - 0.01,
                    'time NaN': np.nan, 'time ahead by 10 s': time + 10.0}[fault]
        return time, position, velocity
    return corrupt


def _fails(found, normal, breakaway, end):
    before = AT // EVERY - 1
    rest = 9  # after the first half second
    start = rest if end is None else before
    travel = np.abs(found['x'] - found['x'][start]).max(axis=0)
    if end is not None:
        travel = np.abs(found['x'][before:] - found['x'][before]).max(axis=0)
    fails = ~(travel < TRAVEL)
    if end is None:
        return fails
    from_here = (end + round(RECOVER * 1000)) // EVERY + 1
    wrong = np.abs(found['i'] - normal)[from_here:]
    late = ~(np.median(wrong, axis=0) < NORMAL * breakaway) | ~np.isfinite(wrong).all(axis=0)
    return fails | late
