# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A joint let go: does it gain speed, come to rest, or run beyond the identified speeds?"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from law_judge.bank import Joints
from law_judge.loop import announced, make_law, run
from law_judge.model import SPEEDS
from law_judge.rows import count, DEGREE
from world.person import PERSON
from world.persons import drivers

START, RELEASE, AFTER = 0.2, 1.3, 8.0
EVERY = 10
# Gaining speed: over 50 ms, by more than what the flex of gear and presliding can give back.
GAIN, GAIN_SPEED = 1.03, 0.3 * DEGREE
REST_WITHIN, REST_SPEED = 6.0, 0.2 * DEGREE
LIMIT = 1.25 * SPEEDS[-1]
# Friction down to 0.7 of the model: warm, or fresh grease.
LOST = 1.0 / 0.7


def release(bank, law):
    """Bring each joint to a speed and let go, or push it by 2 deg and let go."""
    joints = Joints(bank, speed=[5, 40, 80], direction=[0, 1], factor=[1.0, 1.05, 1.1, LOST])
    found = watch_release(joints, law)
    factor = joints['factor']
    rows = [
        count('let go, model ≤ 1.10: gains speed', joints, found['gained'],
              which=factor <= 1.10),
        count('let go, model ≤ 1.05: not at rest in 6 s', joints, found['moving'], 0.01,
              which=factor <= 1.05),
        count('let go, model ≤ 1.5: beyond 1.25 of the identified speeds', joints,
              found['beyond'], fastest=float(found['fastest'].max() / DEGREE)),
        count('let go, friction 0.70 of the model: still moves after 6 s', joints,
              found['moving'], None, which=factor == LOST)]
    pushed = Joints(bank, factor=[1.0, 1.05, 1.1], copy=[0, 1])
    sent = watch_push(pushed, law)
    few = pushed['factor'] <= 1.05
    return [*rows,
            count('pushed by 2 deg, model ≤ 1.10: gains speed', pushed, sent['gained'], 0.02),
            count('pushed by 2 deg, model ≤ 1.05: not at rest in 6 s', pushed,
                  sent['moving'], 0.02, which=few, unmoved=int(sent['unmoved'].sum()))]


def watch_push(joints, law):
    """Return what became of joints that were pushed until they moved by 2 deg, and let go."""
    side = joints.sides
    random = np.random.default_rng([joints.bank.seed, 17])
    persons = np.zeros(len(joints), dtype=PERSON)
    persons['start'], persons['release'] = RELEASE, np.inf
    persons['push'] = 3.0 * side * joints.torque
    persons['push_rate'] = random.uniform(0.3, 2.0, len(joints)) * joints.torque
    persons['push_travel'] = 2.0 * DEGREE
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), RELEASE + 4.0 + AFTER, announced(side, 0.3),
                 {'x': 'link', 'held': 'let_go'}, EVERY)
    time = np.arange(1, len(record['x']) + 1) * EVERY * plant.sample_time
    speed = np.abs(np.diff(record['x'], axis=0, prepend=record['x'][:1])) / (
        EVERY * plant.sample_time)
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


def watch_release(joints, law):
    """Return what became of every joint: arrays of shape (J,)."""
    side = joints.sides
    persons = drivers(joints.gears, side * joints['speed'] * DEGREE, START, RELEASE)
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), RELEASE + AFTER,
                 announced(side * joints['direction']), {'x': 'link'}, EVERY)
    step = EVERY * plant.sample_time
    span = 5
    speed = np.abs(record['x'][span:] - record['x'][:-span]) / (span * step)
    time = (np.arange(len(speed)) + span + 1) * step
    at_release = speed[np.searchsorted(time, RELEASE - 0.01)]
    after = speed[time > RELEASE]
    late = speed[time > RELEASE + REST_WITHIN]
    # A joint that the driver had not set going springs back when let go, whatever the law.
    going = at_release > 0.5 * joints['speed'] * DEGREE
    return {'fastest': after.max(axis=0),
            'gained': going & (after.max(axis=0) > GAIN * at_release + GAIN_SPEED),
            'moving': late.max(axis=0) > REST_SPEED,
            'beyond': after.max(axis=0) > np.maximum(LIMIT, GAIN * at_release)}
