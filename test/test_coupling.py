# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Torques due to the motion of other joints, and friction between joints, without a URDF."""

from dataclasses import replace

from helpers import sines
import numpy as np
import pytest
from simulated_arms import waves

from friction_comp.model.arm import Coupling, groups_for
from friction_comp.refinement import refine
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms


def planar(rng, size):
    """Return currents and motion of two parallel joints with weight, and one that has neither."""
    motion = q, v, a = waves(rng, size, 3, 0.01)
    shoulder = 2.0 * np.cos(q[:, 0]) + 0.8 * np.cos(q[:, 0] + q[:, 1])
    elbow = 0.8 * np.cos(q[:, 0] + q[:, 1])
    currents = [part + 0.3 * np.tanh(v[:, k] / 0.01) + 0.2 * v[:, k] + 0.05 * a[:, k]
                + 0.02 * rng.standard_normal(size)
                for k, part in enumerate((shoulder, elbow, 0.0))]
    return currents, motion


def seen_by(joint, names, current, motion):
    """Return the samples of one joint of an arm whose joints all move."""
    q, v, _ = motion
    k = names.index(joint)
    return Samples(time=0.01 * np.arange(len(q)), position=q[:, k], velocity=v[:, k],
                   current=current, joint=joint, arm=JointStates(names, q, v))


@pytest.mark.slow
def test_the_weight_of_the_next_link_is_found_without_a_urdf():
    rng = np.random.default_rng(0)
    names = ('shoulder', 'elbow', 'wrist')
    currents, motion = planar(rng, 1000)
    for joint, current in (('shoulder', currents[0]), ('wrist', currents[2])):
        result = refine([seen_by(joint, names, current, motion)])
        assert result.report.after.held_out_rmse < 0.03
        if joint == 'wrist':
            assert 'other_joints' not in {effect.name for effect in result.report.effects}
            continue
        found = {effect.variable: effect.in_words for effect in result.report.effects}
        assert 'elbow' in found['other joints']
        coupling = result.model.arm.source
        weights = [group.angles for group in coupling.groups if group.kind == 'weight']
        assert (('shoulder', 1), ('elbow', 1)) in weights
        again = Coupling.from_dict(coupling.to_dict())
        assert again.current(names, *motion) == pytest.approx(coupling.current(names, *motion))


def test_kinetic_terms_agree_with_lagranges_equations():
    """By the derivatives of the energy along the motion, taken by differences."""
    rng, names, step = np.random.default_rng(5), tuple('abc'), 1e-4
    q, v, a = waves(rng, 4000, 3, step, fastest=2.0)
    groups = [group for group in groups_for(names, 'b') if group.kind == 'kinetic']
    assert len(groups) > 12
    for group in groups:
        one, two = (names.index(name) for name in group.joints[1:])
        turned = np.zeros(3)
        for name, side in group.angles:
            turned[names.index(name)] = side

        def energy(q, v, one=one, two=two, turned=turned, sine=0.0):
            return np.cos(q @ turned - sine) * v[:, one] * v[:, two]
        columns = group.columns(names, q, v, a)
        assert columns.shape == (4000, 2 if group.angles else 1)
        for number in range(columns.shape[1]):
            shift = 1e-6 * np.eye(3)[1]
            ways = {'sine': number * np.pi / 2}
            momentum = (energy(q, v + shift, **ways) - energy(q, v - shift, **ways)) / 2e-6
            slope = (energy(q + shift, v, **ways) - energy(q - shift, v, **ways)) / 2e-6
            wanted = np.gradient(momentum, step) - slope
            assert columns[5:-5, number] == pytest.approx(
                wanted[5:-5], abs=1e-3 * np.max(np.abs(wanted)) + 1e-6), group


def test_joints_that_move_together_cannot_be_told_apart():
    """What is held out of such motion is predicted as well, but other motion need not be."""
    rng = np.random.default_rng(5)
    q, v, a = (np.column_stack((x[:, 0], x[:, 0])) for x in waves(rng, 1500, 2, 0.01))
    current = (2.0 * np.cos(q[:, 0]) + 0.8 * np.cos(q[:, 0] + q[:, 1])
               + 0.3 * np.tanh(v[:, 0] / 0.01) + 0.2 * v[:, 0] + 0.05 * a[:, 0]
               + 0.02 * rng.standard_normal(len(q)))
    report = refine([seen_by('shoulder', ('shoulder', 'elbow'), current, (q, v, a))]).report
    assert report.verdict == 'record again'
    assert 'other_joints' in {one.code for one in report.findings}


NAMES = ('pitch', 'roll')
NOISE = 0.02


def wrist(seed, side, coulomb=0.5, viscous=0.2):
    """Return the roll joint: 0.3 A Coulomb and 0.1 viscous alone, the rest of v_roll ± v_pitch."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 40.0, 0.01)
    position, velocity, acceleration = np.transpose([sines(time, (
        (0.15 / frequency, 2 * np.pi * frequency * rng.uniform(0.8, 1.2), rng.uniform(0.0, 6.28))
        for frequency in np.geomspace(0.1, 1.0, 5))) for _ in NAMES], (1, 2, 0))
    own = velocity[:, 1]
    both = own + side * velocity[:, 0]
    current = (0.3 * np.tanh(own / 0.02) + 0.1 * own + 0.03 * acceleration[:, 1]
               + coulomb * np.tanh(both / 0.02) + viscous * both)
    return Samples(time=time, position=position[:, 1], velocity=own, joint='roll',
                   current=current + NOISE * rng.standard_normal(len(time)),
                   arm=JointStates(NAMES, position, velocity))


def between(result):
    """Return the effects that are friction between joints."""
    return [effect for effect in result.report.effects if effect.name == 'friction_between']


def test_friction_that_turns_with_two_joints_is_named_with_both():
    result = refine([wrist(2, -1)])
    entry, = between(result)
    coulomb, viscous = entry.parameters['coefficients']
    assert coulomb == pytest.approx(0.5, rel=0.1)
    assert viscous == pytest.approx(0.2, rel=0.1)
    assert 'roll and pitch' in entry.in_words
    assert result.report.effects[0].name == 'friction_between'
    other = wrist(5, -1)
    assert rms(other.current - result.model.predict(other)) < 2.5 * NOISE
    # The file says all of it.
    arm = result.model.arm
    again = replace(arm, source=Coupling.from_dict(arm.source.to_dict()))
    assert again.with_signal(other).coupling == pytest.approx(arm.with_signal(other).coupling)
    # It is no weight: nothing of it acts at rest.
    assert again.at_rest(np.array([0.3] * len(again.joints)), 'roll') == 0.0
    # Where there is none, none is named.
    assert not between(refine([wrist(2, 1, 0.0, 0.0)]))
