# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A follower under an MIT-mode controller, and a person whom sensors watch: the demo's loops."""

import numpy as np
import pytest

from friction_comp.exercise.reference_movement import ReferenceMovement
from friction_comp.simulation.mit_drive import MitDrive, POSITION_STEP, TIMEOUT
from friction_comp.tools import demo_directions


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


@pytest.mark.slow
def test_a_follower_with_the_law_has_half_of_the_error():
    bare, helped = (demo_directions._follow(way, 0.05, 1)['rms'] for way in ('without', 'the law'))
    assert helped < 0.5 * bare


@pytest.mark.slow
def test_a_person_whose_force_is_sensed_needs_less_torque_than_one_who_is_not():
    movement = ReferenceMovement(amplitude=0.4, standstill=1.0, repetitions=1)
    unknown, force = (demo_directions._trial(source, movement, 1, lambda share: None)
                      for source in ('unknown', 'force'))
    assert force['peak'] < 0.8 * unknown['peak']
    # Both ways, and never the other.
    moving = force['direction'] != 0
    assert {1.0, -1.0} <= set(force['direction'])
    assert np.mean(np.sign(force['torque'][moving]) == force['direction'][moving]) > 0.95
