# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What other joints ask of a joint, found in a recording without a URDF."""

from arm_maker import swinging, waves
import numpy as np
import pytest

from friction_comp.arm.find_coupling import find_coupling, groups_for, hangs_together
from friction_comp.errors import InputError
from friction_comp.model.arm.coupling import Coupling
from friction_comp.refinement import refine
from friction_comp.samples import JointStates, Samples


def planar(rng, size, noise=0.02):
    """Return currents and motion of two parallel joints with weight, and one that has neither."""
    motion = q, v, a = waves(rng, size, 3, 0.01)
    shoulder = 2.0 * np.cos(q[:, 0]) + 0.8 * np.cos(q[:, 0] + q[:, 1])
    elbow = 0.8 * np.cos(q[:, 0] + q[:, 1])
    currents = [part + 0.3 * np.tanh(v[:, k] / 0.01) + 0.2 * v[:, k] + 0.05 * a[:, k]
                + noise * rng.standard_normal(size)
                for k, part in enumerate((shoulder, elbow, 0.0))]
    return currents, motion


@pytest.mark.parametrize('seed', range(3))
def test_the_weight_of_the_next_link_is_found_without_a_urdf(seed):
    rng = np.random.default_rng(seed)
    names = ('shoulder', 'elbow', 'wrist')
    currents, motion = planar(rng, 4000)
    zeros = np.zeros(4000, dtype=int)
    moving = [np.abs(motion[1][:, k]) > 0.01 for k in range(3)]
    for k in (0, 1):
        found = find_coupling(currents[k], names, names[k], motion, zeros, moving[k])
        assert found.groups[0].angles == (('shoulder', 1), ('elbow', 1))
        assert found.errors[1] < 0.04 < 0.1 < found.errors[0]
        again = Coupling.from_dict(found.to_dict())
        assert again.current(names, *motion) == pytest.approx(found.current(names, *motion))
    assert find_coupling(currents[2], names, 'wrist', motion, zeros, moving[2]) is None


@pytest.mark.parametrize('own', 'abcd')
def test_what_mechanics_rules_out_is_not_tried(own):
    for group in groups_for('abcd', own):
        turned = {name for name, _ in group.angles}
        assert group.everyone != {own}
        if group.kind == 'weight':
            assert own in turned
        else:
            asked, *moving = group.joints
            assert asked == own
            assert not set(moving) <= turned
            assert own in {*moving, *turned}


def test_joints_that_move_independently_show_hardly_ever_a_coupling():
    """Chance finds one in about a hundred recordings, and it is small."""
    errors = []
    for seed in range(10, 30):
        rng = np.random.default_rng(seed)
        names = tuple('abcdef')
        motion = waves(rng, 3000, 6, 0.01)
        v = motion[1][:, 2]
        slow = np.convolve(rng.standard_normal(3100), np.exp(-np.arange(100) / 20))[50:3050]
        current = 0.3 * np.tanh(v / 0.02) + 0.2 * v + 0.02 * slow
        found = find_coupling(current, names, 'c', motion, np.zeros(3000, dtype=int),
                              np.abs(v) > 0.01)
        errors += [found.errors] if found else []
    assert len(errors) <= 1
    assert all(after > 0.9 * before for before, after in errors)


def test_neighbours_weight_is_no_guess_among_the_hundred_that_others_are():
    names = tuple('abcdef')
    usual = [group for group in groups_for(names, 'c') if hangs_together(group, names)]
    assert {frozenset(dict(group.angles)) for group in usual} == {
        frozenset(names[start:stop]) for start in range(3) for stop in range(3, 7)
        if stop - start > 1}
    # Slow motion, few stretches, and much else going on: what is to be believed of the weight of
    # neighbours might be chance in any of a hundred others.
    found = {}
    for one, other in ((1, 1), (0, -1)):
        rng = np.random.default_rng(3)
        motion = q, v, _ = waves(rng, 900, 6, 0.1)
        slow = np.convolve(rng.standard_normal(1000), np.exp(-np.arange(100) / 25))[50:950]
        current = np.cos(q[:, one] + other * q[:, 2]) + 0.5 * np.tanh(v[:, 2] / 0.02) + 0.07 * slow
        found[one, other] = find_coupling(current, names, 'c', motion, np.zeros(900, dtype=int),
                                          np.abs(v[:, 2]) > 0.01)
    assert found[1, 1].groups[0].angles == (('b', 1), ('c', 1))
    assert found[0, -1] is None


def test_terms_of_kinetic_energy_are_what_lagrange_asks():
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


@pytest.mark.parametrize(('joint', 'effects', 'seed'), [
    ('shoulder', {'gravity', 'inertia', 'other_joints'}, 10),
    ('elbow', {'inertia', 'other_joints'}, 20)])
def test_weight_and_inertia_that_cancel_are_found_together(joint, effects, seed):
    """Of arms that swing nearly by themselves, none of them explains anything alone."""
    fit, score = ([part for part in swinging(np.random.default_rng(seed + k), 20.0)
                   if part.joint == joint] for k in range(2))
    result = refine(fit)
    assert effects <= {effect['name'] for effect in result.report['effects']}
    left, = (part.current - result.model.predict(part) for part in score)
    before, = (part.current - result.start.predict(part) for part in score)
    assert np.sqrt(np.mean(left ** 2)) < 0.5 * np.sqrt(np.mean(before ** 2))


def test_couplings_of_earlier_model_files_are_what_they_were():
    motion = q, v, a = waves(np.random.default_rng(3), 50, 2, 0.01)
    old = Coupling.from_dict({'groups': [
        {'kind': 'inertia', 'angles': [['one', 1]], 'joints': ['two'], 'coefficients': [2.0, 3.0]},
        {'kind': 'velocities', 'angles': [], 'joints': ['two', 'two'], 'coefficients': [4.0]}]})
    assert old.current(('one', 'two'), *motion) == pytest.approx(
        (2.0 * np.cos(q[:, 0]) + 3.0 * np.sin(q[:, 0])) * a[:, 1] + 4.0 * v[:, 1] ** 2)
    with pytest.raises(InputError, match='not complete'):
        Coupling.from_dict({'groups': [{'kind': 'kinetic', 'angles': [], 'joints': ['two'],
                                        'coefficients': [1.0]}]})


def test_of_joints_that_hold_still_only_their_weight_is_asked():
    names, rng = tuple('abcd'), np.random.default_rng(4)
    groups = tuple(groups_for(names, 'c'))
    coupling = Coupling(groups, tuple(
        tuple(rng.normal(size=2 if group.angles else 1)) for group in groups))
    for q in rng.normal(size=(5, 1, 4)):
        assert coupling.weight(names, q[0]) == pytest.approx(
            coupling.current(names, q, 0.0 * q, 0.0 * q)[0])


@pytest.mark.parametrize(('share', 'verdict'), [(0.0, 'trust'), (1.0, 'record again')])
def test_joints_that_move_as_one_do_not_tell_which_of_them_asks(share, verdict):
    """What is held out of such motion is predicted as well, but other motion need not be."""
    rng = np.random.default_rng(5)
    q, v, a = (np.column_stack((x[:, 0], share * x[:, 0] + (1.0 - share) * x[:, 1]))
               for x in waves(rng, 3000, 2, 0.01))
    current = (2.0 * np.cos(q[:, 0]) + 0.8 * np.cos(q[:, 0] + q[:, 1])
               + 0.3 * np.tanh(v[:, 0] / 0.01) + 0.2 * v[:, 0] + 0.05 * a[:, 0]
               + 0.02 * rng.standard_normal(len(q)))
    report = refine([Samples(
        time=0.01 * np.arange(len(q)), position=q[:, 0], velocity=v[:, 0], current=current,
        joint='shoulder', arm=JointStates(('shoulder', 'elbow'), q, v))]).report
    assert 'other_joints' in {effect['name'] for effect in report['effects']}
    assert report['after']['held_out_rmse'] < 0.022
    assert report['verdict'] == verdict
    text = ' '.join(report['reasons'])
    assert ('follow from where the other joints are' in text) is (share == 1.0)
    assert ('beyond the recorded postures' in text) is (share == 1.0)
