# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Identification on gears with two inertias: breakaway and presliding distance."""

import math

import numpy as np
import pytest

from friction_comp.identification.goal import IdentificationGoal
from friction_comp.identification.run import IdentificationRun
from friction_comp.simulation.joint import joint_sample, measure, random_states, start_joint
from friction_comp.simulation.joint_parameters import JOINT_STATE, MEASURED
from friction_comp.simulation.undeclared import COLUMNS
from simulated_recordings.random_gears import random_gear


def identified(gear):
    step, breakaway = 1e-3, gear.model.breakaway.positive_mean
    goal = IdentificationGoal(
        speeds=(0.05, 0.35), motion_range=1.5, ramp_slope=0.45 * breakaway, breakaway_cycles=4)
    run = IdentificationRun(goal, gear.model.drive)
    state, out = np.zeros(1, JOINT_STATE), np.zeros(1, MEASURED)
    random = random_states(2, 1)[0]
    none, memory = np.zeros((0, COLUMNS)), np.zeros(1)
    start_joint(gear.parameters, state[0], random)
    measure(gear.parameters, state[0], random, step, out[0])
    for k in range(10 ** 6):
        current = run.update(k * step, float(out[0]['position']), None, float(out[0]['current']))
        if run.finished:
            return run.result()
        joint_sample(gear.parameters, state[0], random, none, memory, step, current, 0.0, 0.0,
                     False, out[0])
    raise AssertionError('never finished')


@pytest.mark.slow
def test_identification_finds_breakaway_and_presliding():
    """Of a contact that holds like a spring; `test_independent_gear.py` has other kinds."""
    gear = random_gear(2, 'clamp')
    result = identified(gear)
    true, found = gear.model.breakaway, result.breakaway
    scatter = 4.0 * true.positive_std / math.sqrt(4)
    assert abs(found.positive_mean - true.positive_mean) < 0.03 * true.positive_mean + scatter
    count = gear.model.drive.position_resolution
    assert abs(result.presliding.distance - gear.model.presliding.distance) < (
        0.3 * gear.model.presliding.distance + count)
    assert result.model(gear.model.drive).presliding == result.presliding
