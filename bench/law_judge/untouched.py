# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Nobody touches the joint and the planner announces a direction: does it start?"""

import numpy as np

from law_judge.bank import Joints
from law_judge.loop import make_law, run
from law_judge.rows import count, DEGREE
from world.person import nobody
from world.persons import drivers

ANNOUNCE, TURN = 0.5, 0.6  # s, and share of the time at which the direction turns round
EVERY = 50
# A start: beyond what gear and presliding give way (below 0.4 deg on the softest gear drawn) and
# still going, or far away. Dahl, LuGre and Bouc-Wen friction creep under any noise (Dupont et al.
# 2002), some 0.01 deg/s here under a constant current: that alone is no start.
BEYOND, GOING, FAR = 0.5 * DEGREE, 0.5 * DEGREE, 2.0 * DEGREE
LOST = (1.0 / 0.85, 1.0 / 0.8, 1.0 / 0.75, 1.0 / 0.7)
WEIGHT = 0.26


def untouched(bank, law):
    """Announce both directions to resting joints whose model is up to 1.1 times the truth."""
    random = np.random.default_rng([bank.seed, 31])
    # a model a copy would be costly to no purpose: five pairs of factors
    middle = random.uniform(1.0, 1.1, 4).round(3)
    pairs = [(1.1, 1.1), (1.1, 1.1), (middle[0], 1.1), (1.1, middle[1]), (middle[2], middle[3])]
    joints = Joints(bank, copy=list(range(12)))
    pair = np.array(pairs)[joints['copy'] % len(pairs)]
    joints.conditions['factor'], joints.conditions['breakaway_factor'] = pair.T.copy()
    side = np.where(random.uniform(size=len(joints)) < 0.5, 1, -1)
    return [_row('untouched, model ≤ 1.10: starts', joints,
                 _watch(joints, law, side, 10.0), 0.001)]


def lost(bank, law):
    """The same where the drive has lost friction since it was identified."""
    joints = Joints(bank, factor=LOST, copy=[0, 1])
    side = joints.sides.astype(int)
    # carried by some degrees with the help of the law, and left at rest
    carried = drivers(joints.gears, side * 10.0 * DEGREE, 1.0, 4.0)
    carried['cruise_time'] = 0.6
    return [
        _row('untouched, friction 0.70 to 0.85 of the model: starts', joints,
             _watch(joints, law, side, 8.0)),
        _row('carried and left at rest, 0.70 to 0.85: starts', joints,
             _watch(joints, law, side, 12.0, carried))]


def weight(bank, law):
    """A weight that the model does not know of pulls in the direction announced."""
    joints = Joints(bank, copy=[0, 1])
    side = joints.sides.astype(int)
    gears = joints.gears.copy()
    known = np.isin(np.arange(len(gears)), np.flatnonzero(gears['gravity'] == 0.0))
    gears['gravity'][known] = WEIGHT * joints.torque[known]
    gears['gravity_phase'][known] = np.where(side[known] > 0, np.pi, 0.0)
    return [_row('unknown weight of 0.26 of friction, d downward: falls', joints,
                 _watch(joints, law, side, 8.0, gears=gears))]


def _row(floor, joints, found, wanted=0.0):
    return count(floor, joints, found['started'], wanted,
                 fastest=float(found['fastest'].max() / DEGREE),
                 farthest=float(found['travel'].max() / DEGREE))


def _watch(joints, law, side, seconds, persons=None, gears=None):
    turn = TURN * seconds if persons is None else np.inf

    def direction(time):
        return side * (0 if time < ANNOUNCE else 1 if time < turn else -1)
    plant = joints.plant(nobody(len(joints)) if persons is None else persons, gears)
    record = run(plant, make_law(law, joints), seconds, direction, {'x': 'motor'}, EVERY)
    since = ANNOUNCE if persons is None else float(persons['release'][0])
    first = int(since / plant.sample_time) // EVERY - 1
    away = np.abs(record['x'] - record['x'][first])[first:]
    span = 5
    speed = np.abs(np.diff(record['x'][first:], axis=0)) / (EVERY * plant.sample_time)
    slow = np.abs(record['x'][first + span:] - record['x'][first:-span]) / (
        span * EVERY * plant.sample_time)
    travel = away.max(axis=0)
    started = ~(travel <= FAR) | ((away[span:] > BEYOND) & (slow > GOING)).any(axis=0)
    return {'started': started, 'travel': travel, 'fastest': speed.max(axis=0)}
