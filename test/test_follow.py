# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A follower under an MIT-mode controller: the drive, the law, and the demo's loop."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from friction_comp.compensation.law import CompensationLaw, LAWS
from friction_comp.simulation.mit_drive import MitDrive, POSITION_STEP, TIMEOUT
from friction_comp.tools import demo_follow
from simulated_recordings.small_model import LEVEL, small_model


def test_a_drive_controls_in_the_steps_of_its_frames_until_they_cease():
    drive = MitDrive(np.array([25.0]), np.array([1.0]), np.array([10.0]))
    assert drive.torque(0.0, np.zeros(1), np.zeros(1)) == 0.0
    drive.command(1.0, np.array([0.1]), np.array([0.0]), np.array([0.5]))
    wanted = POSITION_STEP * round(0.1 / POSITION_STEP)
    step = 20.0 / 4096
    assert drive.torque(1.0, np.zeros(1), np.zeros(1)) == pytest.approx(
        25.0 * wanted + step * round(0.5 / step))
    assert drive.torque(1.0, np.array([-3.0]), np.zeros(1)) == 10.0
    assert drive.torque(1.0 + 1.01 * TIMEOUT, np.zeros(1), np.zeros(1)) == 0.0
    # 16 bits over 25 rad, 12 bits over 90 rad/s.
    position, velocity = drive.reported(np.array([0.1]), np.array([0.03]))
    assert position == pytest.approx(0.1, abs=0.2e-3)
    assert velocity[0] in (0.0, pytest.approx(90.0 / 4096))


def test_friction_of_the_desired_motion_is_fed_forward_however_the_joint_moves():
    law = CompensationLaw([small_model()], 'desired')

    def after(count, speed, direction):
        for _ in range(count):
            after.time, after.place = after.time + 1e-3, after.place + 1e-3 * speed
            current = law.update(after.time, [after.place], None, [direction])[0]
        return current
    after.time = after.place = 0.0
    assert after(200, 0.0, 0) == 0.0
    # Within 20 ms, also where the joint stays, comes back, or was never announced to stop.
    for direction in (1, -1):
        assert after(20, 0.0, direction) == pytest.approx(0.9 * direction * LEVEL, rel=0.03)
        for speed in (0.2, -0.2):
            assert after(500, speed, direction) == pytest.approx(0.9 * direction * LEVEL, rel=0.03)
    assert after(20, -0.2, 0) == 0.0
    assert after(500, 2.7, 1) == 0.0
    assert after(500, 0.1, 1) == pytest.approx(0.9 * LEVEL, rel=0.03)


def test_the_example_of_a_follower_sets_parameters_that_the_nodes_have():
    root = Path(__file__).parents[1]
    known, example = (yaml.safe_load((root / path).read_text(encoding='utf-8')) for path in (
        'config/parameters.yaml', 'examples/mit_mode/arm_like.yaml'))
    for node, content in example.items():
        names = set(content['ros__parameters']) - {'joints', 'model_files'}
        assert names <= set(known[node]['ros__parameters']), node
    law = example['/**/compensator']['ros__parameters']['law']
    # The law of followers, and the source of its direction.
    assert LAWS[law] == LAWS['desired']
    assert example['/**/direction']['ros__parameters']['source'] == 'reference'


@pytest.mark.slow
def test_a_follower_has_a_quarter_of_the_error_and_no_more_than_with_the_desired_speed_alone():
    found = {way: demo_follow._follow(way, 0.02, 1)['rms'] for way in demo_follow.WAYS}
    assert found['the law'] < 0.25 * found['without']
    assert found['the law'] <= found['0.9·tanh of the desired speed']
