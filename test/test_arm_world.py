# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated arms of bench/arm_table.py obey mechanics, so they can judge other models."""

import numpy as np
import pytest

from friction_comp.statistics import rms

LONGEST = 4.0  # s
SEEDS = {4: 'multisine', 21: 'swing', 6: 'point to point', 7: 'joystick'}


@pytest.fixture(scope='module')
def pinocchio():
    return pytest.importorskip('pinocchio', reason='Pinocchio is not installed')


@pytest.fixture(scope='module', params=SEEDS, ids=SEEDS.values())
def seed(request):
    return request.param


@pytest.fixture(scope='module')
def drawn(pinocchio, seed):
    from arm_world.recording import case
    if SEEDS[seed] == 'swing' and not hasattr(pinocchio.Model, 'armature'):
        pytest.skip('Pinocchio 2 knows no rotors in forward dynamics')
    found = case(seed, LONGEST)
    assert found.kind == SEEDS[seed]
    return found


def friction_of(drawn, recording):
    """Friction of the joint that is judged, written anew."""
    f, j, motion = drawn.arm.friction, drawn.joint, recording.motion
    v = motion.velocity[:, j]
    breakaway = f.stribeck[j] * np.exp(-(v / f.stribeck_speed[j]) ** 2)
    friction = (f.coulomb[j] + breakaway) * np.tanh(v / f.reversal_speed[j]) + f.viscous[j] * v
    if motion.rest_share is not None:
        standing = v == 0
        friction[standing] = f.coulomb[j] * motion.rest_share[standing, j]
    return friction


def test_measured_torque_less_inverse_dynamics_and_friction_is_noise(pinocchio, drawn):
    data = drawn.arm.model.createData()
    for recording in drawn.fit + drawn.score:
        motion = recording.motion
        states = zip(motion.position, motion.velocity, motion.acceleration)
        links = np.array([pinocchio.rnea(drawn.arm.model, data, *state)[drawn.joint]
                          for state in states])
        rotor = (drawn.arm.rotor_inertia * motion.acceleration)[:, drawn.joint]
        left = recording.measured - links - rotor - friction_of(drawn, recording)
        np.testing.assert_allclose(left, recording.noise, rtol=0, atol=1e-6 * drawn.noise)
        assert np.std(left) == pytest.approx(drawn.noise, rel=0.15)


def test_velocity_and_acceleration_are_derivatives(drawn):
    for recording in drawn.fit + drawn.score:
        step, motion = recording.time[1], recording.motion
        for value, rate in ((motion.position, motion.velocity),
                            (motion.velocity, motion.acceleration)):
            # Where friction changes its sign, the acceleration jumps within a sample
            off = np.abs(np.gradient(value, step, axis=0) - rate)
            assert np.median(off) < 0.01 * rms(rate)


def test_samples_hold_what_was_measured_of_all_joints(drawn):
    recording = drawn.fit[0]
    samples = drawn.samples(recording)
    np.testing.assert_array_equal(samples.current, recording.measured)
    np.testing.assert_array_equal(samples.arm.position, recording.encoder)
    np.testing.assert_array_equal(samples.position, recording.encoder[:, drawn.joint])
    assert samples.joint == samples.arm.joints[drawn.joint]
    assert samples.arm.joints == tuple(f'joint{k + 1}' for k in range(drawn.arm.model.nv))
