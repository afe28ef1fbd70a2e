# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joints that lost friction and are let go: how far beyond the announced end do they go?"""

from functools import partial

import numpy as np

from law_judge.bank import Joints
from law_judge.loop import announced, make_law, run
from law_judge.release import AFTER, EVERY, LOST, RELEASE, START
from law_judge.rows import DEGREE
from world.persons import drivers

# Speeds of a guided movement, deg/s, and the way from where it is let go to its end, deg.
SPEEDS, LEFT = (5.0, 10.0, 20.0, 40.0), 10.0


def beyond_ends(bank, law='continuous', told='end'):
    """Return by how much each joint goes beyond the end of its movement, deg, shape (J,).

    What is announced is the `end` too, only the `direction`, or `nothing`.
    """
    joints = Joints(bank, speed=SPEEDS, copy=[0, 1, 2, 3], factor=[LOST])
    side = joints.sides
    speed = joints['speed'] * DEGREE
    end = side * (speed * (RELEASE - START) + LEFT * DEGREE)
    plant = joints.plant(drivers(joints.gears, side * speed, START, RELEASE))
    law = make_law(law, joints)
    if told == 'end':
        law.update = partial(law.update, end=end)
    record = run(plant, law, RELEASE + AFTER, announced((told != 'nothing') * side),
                 {'x': 'link'}, EVERY)
    return ((record['x'] - end) * np.sign(end)).max(axis=0) / DEGREE
