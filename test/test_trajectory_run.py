# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A trajectory is followed within its limits, and a joint that does not follow gets no current."""

import functools
import math

from helpers import follow, note_model, short_search, SLOPES, under_weight
import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.excitation.plan import JointLimits, plan_joint
from friction_comp.identification.goal import IdentificationError, TrajectoryGoal
from friction_comp.identification.run import TrajectoryRun
from friction_comp.simulation.joint import Plant

LIMITS = JointLimits('', -0.8, 1.0, 1.2, 6.0)


@functools.cache
def motion_planned():
    with short_search(1):
        return plan_joint(LIMITS, [('gravity', 'stribeck')], 20.0, 3).samples(50.0)


def planned(number):
    motion = motion_planned()
    return TrajectoryGoal(motion.time, motion.position, np.asarray(motion.velocity),
                          ramp_slope=SLOPES[number])


def play(number, weight=0.0, is_known=True, alter=lambda run, sample: sample):
    """Follow the plan to the end; return the run, and time, position and command."""
    model = note_model(number)
    plant, carried = Plant([model], seed=5, sample_time=4e-3), lambda position: 0.0
    if weight:
        plant, _, known = under_weight(model, weight, 0.3)
        carried = known if is_known else carried
    run = TrajectoryRun(planned(number), model.drive)
    return run, follow(run, plant, alter, carried)


# Of breakaway, the weights are none, a fifth and three times.
@pytest.mark.parametrize(('number', 'weight', 'is_known'), [
    (3, 0.0, True), (1, 0.02, False), (1, 0.3, True)])
def test_a_plan_is_followed_beside_what_the_model_carries(number, weight, is_known):
    goal, (run, (time, position, command)) = planned(number), play(number, weight, is_known)
    assert run.phase == 'done'
    assert command[-1] == 0.0
    assert LIMITS.lowest < position.min()
    assert position.max() < LIMITS.highest
    # Ends where the plan ends, and has been all over its range.
    if not weight:
        assert position[-1] == pytest.approx(goal.positions[-1], abs=0.01)
    assert np.ptp(position) > 0.97 * goal.motion_range
    assert np.abs(np.gradient(position[::5], time[::5])).max() < 1.05 * LIMITS.velocity


@pytest.mark.parametrize('fault, words', [
    ('stuck', 'lags|does not move'), ('thrown', 'left its motion range'),
    ('silent', 'no sample for'), ('nan', 'encoder failure'), ('reversed', 'measured current')])
def test_every_fault_ends_in_zero_current_for_good(fault, words):
    kept, runs = [], []

    def alter(run, sample):
        runs[:] = [run]
        if fault == 'reversed':
            sample[3] *= -1.0
        if run.phase != 'trajectory':
            return sample
        kept.append(sample[:])
        if len(kept) > 500:
            sample[0] += fault == 'silent'
            sample[1:3] = {'stuck': [kept[499][1], 0.0], 'nan': [math.nan, sample[2]],
                           'thrown': [sample[1] + 2.0, sample[2]]}.get(fault, sample[1:3])
        return sample
    with pytest.raises(IdentificationError, match=words):
        play(2, alter=alter)
    assert runs[0].phase == 'failed'
    assert runs[0].update(1e3, 0.0, 0.0, 0.0) == 0.0


def test_a_run_that_was_aborted_commands_nothing_any_more():
    run = TrajectoryRun(planned(1), note_model(1).drive)
    run.update(0.0, 0.0)
    run.abort()
    assert run.phase == 'failed'
    assert not any(run.update(0.001 * k, 0.0) for k in range(1, 2000))


@pytest.mark.parametrize('changes, words', [
    ({'times': [0.0]}, 'two points'), ({'times': [0.0, 2.0, 1.0]}, 'do not ascend'),
    ({'positions': [0.0, math.nan, 0.0]}, 'not finite'),
    ({'positions': [0.1, 0.1, 0.1]}, 'does not move'),
    ({'velocities': [0.5, 0.0, 0.0]}, 'at rest'), ({'times': [0.0, 1.0, 1e6]}, '3600'),
    ({'velocities': []}, 'position and velocity'), ({'ramp_slope': 1e-300}, 'ramp_slope'),
    ({'positions': [0.0, 1e300, 0.0]}, 'motion_range'),
    ({'velocities': [0.0, 1e300, 0.0]}, 'speeds')])
def test_a_trajectory_that_cannot_be_followed_is_refused(changes, words):
    fine = {'times': [0.0, 1.0, 2.0], 'positions': [0.0, 0.5, 0.0], 'velocities': [0.0] * 3}
    TrajectoryGoal(**fine)
    with pytest.raises(InputError, match=words):
        TrajectoryGoal(**{**fine, **changes})
