# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A movement that turns round, announced: what the person feels, beside the bare joint."""

import numpy as np

from law_judge.bank import Joints
from law_judge.felt import per_gear, smooth
from law_judge.loop import make_law, NONE, run, YARDSTICKS
from law_judge.rows import beside, DEGREE, Row
from world.persons import firm_hands

START, CRUISE, AFTER = 1.5, 1.0, 1.0
AHEAD = (0.1, 0.3)     # s before the turn at which the other direction is announced


def reversal(bank, law):
    """Return by how much peak and RMS of the torque about the turn are lower than bare, %."""
    joints = Joints(bank, side=[1.0, -1.0], ahead=AHEAD)
    persons, random = firm_hands(bank, 92)
    persons['start'], persons['returns'] = START, 1
    persons['speed'] = random.uniform(8.0, 25.0, len(bank.gears)) * DEGREE
    ramp = random.uniform(0.4, 1.0, len(bank.gears))
    persons['acceleration_time'], persons['cruise_time'] = ramp, CRUISE
    persons = persons[joints.gear]
    persons['speed'] *= joints['side']
    turn = (START + CRUISE + 2.0 * ramp)[joints.gear]
    felt = {name: _felt(joints, persons, turn, name) for name in (NONE, law, *YARDSTICKS)}
    rows = []
    for k, (name, least) in enumerate((('peak', 20.0), ('RMS', 65.0))):
        lowered = {who: 100.0 * (1.0 - with_law[k] / felt[NONE][k])
                   for who, with_law in felt.items()}
        lower = lowered[law]
        rows.append(Row(f'reversal announced: {name} lower than bare',
                        float(np.median(lower)), least, ' %', True,
                        beside=beside(lowered, np.median),
                        detail={'worst': float(lower.min()), 'each': lower.round(1).tolist()}))
    return rows


def _felt(joints, persons, turn, law):
    """Return peak and RMS of the torque from half a second before the turn on, per gear."""
    plant = joints.plant(persons)
    side, flips = joints['side'], turn - joints['ahead']
    seconds = turn.max() + AFTER
    record = run(plant, make_law(law, joints), seconds,
                 lambda time: side * np.where(time < 0.5, 0.0, np.where(time < flips, 1.0, -1.0)),
                 {'torque': 'person'})
    rate = 1.0 / plant.sample_time
    torque = smooth(record['torque'], plant.sample_time)
    felt = np.zeros((2, len(joints)))
    for j, at in enumerate(turn):
        part = torque[round((at - 0.5) * rate):round((at + AFTER) * rate), j]
        felt[:, j] = np.abs(part).max(), np.sqrt(np.mean(part ** 2))
    return [per_gear(joints, values) for values in felt]
