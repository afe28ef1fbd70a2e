# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Nobody touches the joint and the planner announces a direction: does it start?"""

import numpy as np

from independent_gear.bank import Joints
from independent_gear.loop import make_law, run
from independent_gear.plant import Plant
from independent_gear.rows import DEGREE, share_row
from independent_gear.state import nobody

ANNOUNCE, TURN = 0.5, 0.6  # s, and share of the time at which the direction turns round
EVERY = 50
# A start: beyond what gear and presliding give way (below 0.4 deg on the softest gear drawn) and
# still going, or far away. Dahl, LuGre and Bouc-Wen friction creep under any noise (Dupont et al.
# 2002), some 0.01 deg/s here under a constant current: that alone is no start.
BEYOND, GOING, FAR = 0.5 * DEGREE, 0.5 * DEGREE, 2.0 * DEGREE


def untouched(bank, law, quick=False, joints=None, seconds=None, factors=(1.0, 1.1)):
    """Announce both directions to resting joints and return a row for each kind.

    Parameters
    ----------
    bank : Bank
    law : str
    quick : bool
    joints : int, optional
        A kind: 1,000, or 100 when quick.
    seconds : float, optional
        20, or 10 when quick.
    factors : pair of float
        Model over truth: half of the joints at the larger, the others in between; the breakaway
        current likewise, apart from it.
    """
    joints = joints or (100 if quick else 1000)
    seconds = seconds or (10.0 if quick else 20.0)
    draws = len(bank.among(bank.kinds[0]))
    copies = max(1, joints // draws)
    random = np.random.default_rng([bank.seed, 31])
    # a model a copy would be costly to no purpose: five pairs of factors
    low, high = factors
    middle = random.uniform(low, high, 4).round(3)
    pairs = [(high, high), (high, high), (middle[0], high), (high, middle[1]),
             (middle[2], middle[3])]
    everyone = Joints(bank, copy=list(range(copies)))
    pair = np.array(pairs)[everyone['copy'] % len(pairs)]
    everyone.conditions['factor'], everyone.conditions['breakaway_factor'] = pair.T.copy()
    side = np.where(random.uniform(size=len(everyone)) < 0.5, 1, -1)
    turn = TURN * seconds

    def direction(time):
        return side * (0 if time < ANNOUNCE else 1 if time < turn else -1)
    plant = Plant(everyone.gears, nobody(len(everyone)), bank.seed, steps=15)
    record = run(plant, make_law(law, everyone), seconds, direction,
                 {'x': 'motor'}, EVERY)
    from_rest = record['x'][int(ANNOUNCE / plant.sample_time) // EVERY - 1]
    away = np.abs(record['x'] - from_rest)
    span = 5
    speed = np.abs(record['x'][span:] - record['x'][:-span]) / (span * EVERY * plant.sample_time)
    travel = away.max(axis=0)
    started = ~(travel <= FAR) | ((away[span:] > BEYOND) & (speed > GOING)).any(axis=0)
    floor = f'untouched with d = ±1, model ≤ {high:g}: starts'
    return [share_row(floor, kind, law, started[everyone.kinds == kind], seconds=seconds,
                      travel_median=np.median(travel[everyone.kinds == kind]) / DEGREE,
                      travel_worst=np.max(travel[everyone.kinds == kind]) / DEGREE)
            for kind in dict.fromkeys(bank.kinds)]
