# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint let go: does it gain speed, come to rest, or run beyond the identified speeds?"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from independent_gear.bank import Joints
from independent_gear.loop import announced, make_law, run
from independent_gear.persons import drivers
from independent_gear.plant import Plant
from independent_gear.rows import DEGREE, share_row
from independent_gear.state import PERSON
from independent_gear.truth import SPEEDS

START, RELEASE, AFTER = 0.2, 1.3, 8.0
EVERY = 10
# Gaining speed: over 50 ms, by more than what the flex of gear and presliding can give back.
GAIN, GAIN_SPEED = 1.03, 0.3 * DEGREE
REST_WITHIN, REST_SPEED = 6.0, 0.2 * DEGREE
LIMIT = 1.25 * SPEEDS[-1]


def release(bank, law, quick=False, speeds=None, factors=None):
    """Bring each joint to a speed, let go, and return rows for each kind.

    Parameters
    ----------
    bank : Bank
    law : str
    quick : bool
    speeds, factors : sequence of float, optional
        deg/s; model over truth.
    """
    speeds = speeds or ([5, 40, 80] if quick else [5, 10, 20, 40, 80])
    factors = factors or ([1.0, 1.05, 1.1, 1.5] if quick
                          else [1.0, 1.01, 1.05, 1.1, 1.2, 1.3, 1.5])
    joints = Joints(bank, speed=speeds, direction=[0, 1] if quick else [-1, 0, 1], factor=factors)
    found = watch_release(joints, law)
    pushed = Joints(bank, direction=[1], factor=[f for f in factors if f <= 1.1],
                    copy=list(range(2 if quick else 6)))
    sent = watch_push(pushed, law)
    return [row for kind in dict.fromkeys(bank.kinds)
            for row in (*_rows(joints, found, kind, law), *_push_rows(pushed, sent, kind, law))]


def watch_push(joints, law):
    """Return what became of joints that were pushed until they moved by 2 deg, and let go."""
    side = np.where(np.arange(len(joints)) % 2 == 0, 1.0, -1.0)
    random = np.random.default_rng([joints.bank.seed, 17])
    torque = joints.gears['static'] + joints.gears['link_coulomb']
    persons = np.zeros(len(joints), dtype=PERSON)
    persons['start'], persons['release'] = RELEASE, np.inf
    persons['push'] = 3.0 * side * torque
    persons['push_rate'] = random.uniform(0.3, 2.0, len(joints)) * torque
    persons['push_travel'] = 2.0 * DEGREE
    plant = Plant(joints.gears, persons, joints.bank.seed)
    record = run(plant, make_law(law, joints), RELEASE + 4.0 + AFTER,
                 announced(side * joints['direction'], 0.3),
                 {'x': 'link', 'held': 'let_go', 'person': 'person'}, EVERY)
    time = np.arange(1, len(record['x']) + 1) * EVERY * plant.sample_time
    speed = np.abs(np.diff(record['x'], axis=0, prepend=0.0)) / (EVERY * plant.sample_time)
    speed = uniform_filter1d(speed, 5, axis=0)
    gone = record['held'] > 0
    at = np.argmax(gone, axis=0)
    # the filter reaches two records to each side
    around = np.minimum(at + np.arange(-3, 2)[:, None], len(speed) - 1)
    at_release = speed[around, np.arange(len(joints))].max(axis=0)
    after = np.where(np.arange(len(speed))[:, None] > at + 2, speed, 0.0).max(axis=0)
    late = np.where(gone & (time[:, None] > time[at] + REST_WITHIN), speed, 0.0).max(axis=0)
    return {'gained': gone.any(axis=0) & (after > GAIN * at_release + GAIN_SPEED),
            'moving': late > REST_SPEED, 'unmoved': ~gone.any(axis=0)}


def _push_rows(joints, found, kind, law):
    here = joints.kinds == kind
    few = here & (joints['factor'] <= 1.05)
    return [
        share_row('pushed by 2 deg, let go, model ≤ 1.10: gains speed', kind, law,
                  found['gained'][here]),
        share_row('pushed by 2 deg, let go, model ≤ 1.05: not at rest in 6 s', kind, law,
                  found['moving'][few], unmoved=int(found['unmoved'][here].sum()))]


def watch_release(joints, law):
    """Return what became of every joint: arrays of shape (J,)."""
    # half of the joints go the other way
    side = np.where(np.arange(len(joints)) % 2 == 0, 1.0, -1.0)
    persons = drivers(joints.gears, side * joints['speed'] * DEGREE, START, RELEASE)
    plant = Plant(joints.gears, persons, joints.bank.seed)
    record = run(plant, make_law(law, joints), RELEASE + AFTER,
                 announced(side * joints['direction']), {'x': 'link', 'i': 'command'}, EVERY)
    step = EVERY * plant.sample_time
    span = 5
    speed = np.abs(record['x'][span:] - record['x'][:-span]) / (span * step)
    time = (np.arange(len(speed)) + span + 1) * step
    at_release = speed[np.searchsorted(time, RELEASE - 0.01)]
    after = speed[time > RELEASE]
    late = speed[time > RELEASE + REST_WITHIN]
    # A joint that the driver had not set going springs back when let go, whatever the law.
    going = at_release > 0.5 * joints['speed'] * DEGREE
    return {'fastest': after.max(axis=0), 'at_release': at_release,
            'gained': going & (after.max(axis=0) > GAIN * at_release + GAIN_SPEED),
            'moving': late.max(axis=0) > REST_SPEED,
            'beyond': after.max(axis=0) > np.maximum(LIMIT, GAIN * at_release)}


def _rows(joints, found, kind, law):
    here = joints.kinds == kind
    few = here & (joints['factor'] <= 1.05)
    more = here & (joints['factor'] <= 1.10)
    by_factor = {f'{f:g}': [int(found[what][here & (joints['factor'] == f)].sum())
                            for what in ('gained', 'moving', 'beyond')]
                 for f in dict.fromkeys(joints['factor'].tolist())}
    return [
        share_row('let go, model ≤ 1.05: gains speed', kind, law, found['gained'][few],
                  gained_moving_beyond_by_factor=by_factor),
        share_row('let go, model ≤ 1.05: not at rest in 6 s', kind, law, found['moving'][few]),
        share_row('let go, model ≤ 1.10: gains speed', kind, law, found['gained'][more]),
        share_row('let go, model ≤ 1.5: beyond 125 deg/s', kind, law, found['beyond'][here],
                  fastest=np.max(found['fastest'][here]) / DEGREE),
    ]
