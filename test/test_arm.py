# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid bodies of an arm: recursion, URDF files and the fit; and what links do without a URDF."""

from dataclasses import replace

from helpers import sines
import numpy as np
import pytest
from simulated_arms import FRICTION, MASSES, PLANE, random_urdf, recorded, SCALES, small_arm, waves

from friction_comp.arm.fit import fit_arm
from friction_comp.arm.solver import pseudo_inertia
from friction_comp.arm.urdf import Chain, match_names
from friction_comp.errors import InputError
from friction_comp.model.arm import Coupling, FREE_FALL, groups_for, Tree
from friction_comp.refinement import refine
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms

# Rigid bodies of an arm: recursion, URDF files and the fit.

# One link, as a text in which single values are replaced.
ONE_LINK = (
    '<robot name="x"><link name="base"/><joint name="turn" type="continuous">'
    '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint><link name="arm">'
    '<inertial><origin xyz="0.1 0 0"/><mass value="2"/><inertia ixx="0.02" ixy="0" ixz="0" '
    'iyy="0.02" iyz="0" izz="0.02"/></inertial></link></robot>')


@pytest.fixture
def pinocchio():
    return pytest.importorskip('pinocchio', reason='Pinocchio is not installed')


def possible(parameters):
    """Tell whether a body of positive density has these ten parameters."""
    return np.linalg.eigvalsh(pseudo_inertia(parameters))[0] > 0.0


def chain_of(tmp_path, text, joints):
    path = tmp_path / 'arm.urdf'
    path.write_text(text, encoding='utf-8')
    return Chain(path, joints)


@pytest.mark.parametrize('seed', range(4))
def test_torques_are_those_of_pinocchio(pinocchio, tmp_path, seed):
    rng = np.random.default_rng(seed)
    text, names = random_urdf(rng, 2 + seed)
    chain = chain_of(tmp_path, text, names[::-1])
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = np.array(FREE_FALL)
    data = model.createData()
    q, v, a = rng.normal(size=(3, 20, len(names)))
    own = chain.tree.torques(q, v, a)
    joints = [model.joints[model.getJointId(name)] for name in chain.tree.joints]
    for n in range(len(q)):
        full, speed, rate = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
        for k, joint in enumerate(joints):
            full[joint.idx_q:joint.idx_q + joint.nq] = (
                (np.cos(q[n, k]), np.sin(q[n, k])) if joint.nq == 2 else q[n, k])
            speed[joint.idx_v], rate[joint.idx_v] = v[n, k], a[n, k]
        other = pinocchio.rnea(model, data, full, speed, rate)
        assert own[n] == pytest.approx([other[joint.idx_v] for joint in joints], abs=1e-9)
    torque = chain.regressor(q, v, a) @ chain.tree.parameters.ravel()
    assert torque == pytest.approx(own, abs=1e-9)


def test_a_hanging_rod_weighs_what_a_hanging_rod_weighs():
    # Mass 2 kg, centre 0.3 m out, axis horizontal: 2·9.81·0.3·cos(q) against gravity.
    tree = Tree(('rod',), ('revolute',), [-1], np.eye(3)[None], np.zeros((1, 3)),
                np.array([[0.0, -1.0, 0.0]]),
                np.array([[2.0, 0.6, 0, 0, 0.01, 0, 0.2, 0, 0, 0.2]]), np.array(FREE_FALL))
    for q in (0.0, 0.7, -1.2):
        assert tree.weight([q])[0] == pytest.approx(2 * 9.81 * 0.3 * np.cos(q))


def simulated(seed, size, text=None):
    rng = np.random.default_rng(seed)
    return recorded(text or small_arm(MASSES), PLANE, waves(rng, size, 3, 0.01), SCALES,
                    FRICTION, rng)


@pytest.mark.slow
def test_with_declared_drives_the_intervals_contain_the_true_masses(pinocchio, tmp_path):
    chain = chain_of(tmp_path, small_arm(), PLANE)
    fit = fit_arm(chain, simulated(50, 800), declared=np.array(SCALES))
    assert fit.scales == pytest.approx(SCALES, rel=0.05)
    true = chain_of(tmp_path, small_arm(MASSES), PLANE).tree
    for q in ((0, 0, 0), (0.3, 0.5, -0.4)):
        assert fit.tree.weight(q) == pytest.approx(true.weight(q), rel=0.1, abs=0.3)
    found = fit.intervals
    # The first link turns about the vertical: nothing shows its mass, and all show what the last
    # one, whose weight is felt by two joints, weighs at its distance.
    assert not np.isfinite(found.parameters[0, 0]).any()
    low, high = found.parameters[2, 1]
    assert low - 0.01 <= true.parameters[2, 1] <= high + 0.01
    assert high - low < 0.2 * true.parameters[2, 1]
    assert found.scales[:, 0] == pytest.approx(SCALES, rel=0.05)


@pytest.mark.slow
def test_an_urdf_says_how_an_arm_is_mounted(pinocchio, tmp_path):
    hanging = small_arm(MASSES).replace('<robot name="small">', (
        '<robot name="small"><link name="room"/><joint name="mount" type="fixed"><parent '
        f'link="room"/><child link="base"/><origin xyz="0 0 0" rpy="0 {np.pi} 0"/></joint>'))
    joints = simulated(9, 600, hanging)
    found = fit_arm(chain_of(tmp_path, hanging, PLANE), joints)
    assert (found.held_out < 0.05).all()
    assert not found.opposed
    assert fit_arm(chain_of(tmp_path, small_arm(), PLANE), joints).opposed == ['lift']


@pytest.mark.parametrize('spoil, words', [
    (lambda one: one.with_(current=-one.current), 'sign'),
    (lambda one: one.take(slice(0, 400)) if one.joint == 'lift' else one, 'one time base'),
    (lambda one: one.with_(current=np.where(one.time == one.time[10], np.nan, one.current))
     if one.joint == 'lift' else one, "'lift'.* must be finite")])
def test_recordings_that_cannot_be_those_of_the_arm_are_refused(pinocchio, tmp_path, spoil, words):
    joints = simulated(6, 600)
    with pytest.raises(InputError, match=words):
        fit_arm(chain_of(tmp_path, small_arm(), PLANE), [spoil(one) for one in joints])


MANY = [f'joint_{number}' for number in range(1, 12)]


@pytest.mark.parametrize('recorded, described, expected', [
    (['elbow_joint'], ['elbow_joint', 'wrist_joint'], ['elbow_joint']),
    (['elbow'], ['ur10e_elbow_joint', 'wrist_1_joint'], ['ur10e_elbow_joint']),
    (['left/joint1'], ['joint_1', 'joint_2'], ['joint_1']),
    (['gen3_joint_1'], ['Joint1', 'Joint2'], ['Joint1']),
    # Of eleven joints the last also ends in 1.
    ([f'arm_{number}' for number in range(1, 12)], MANY, MANY),
    # What only resembles a joint does not take it, in whichever order.
    (['finger_joint1', 'joint1', 'joint2'], ['joint1', 'joint2'], [None, 'joint1', 'joint2']),
    (['joint1', 'joint2', 'κλειδί'], ['joint1', 'joint2'], ['joint1', 'joint2', None])])
def test_names_that_differ_only_by_convention_are_matched(recorded, described, expected):
    pairs, unknown = match_names(recorded, described, 'arm.urdf')
    assert [pairs.get(name) for name in recorded] == expected
    assert unknown == [name for name, found in zip(recorded, expected) if found is None]


@pytest.mark.parametrize('names', [['left_joint1', 'right_joint1'], ['Joint1', 'JOINT1']])
def test_a_name_of_several_joints_is_refused(names):
    with pytest.raises(InputError, match='matches several'):
        match_names(names, ['joint1', 'joint2'], 'arm.urdf')


@pytest.mark.parametrize('text, words', [
    (ONE_LINK.replace('"turn"', '"roll"'), "joint 'turn' .* is not in"),
    (ONE_LINK.replace('value="2"', 'value="-2"'), "joint 'turn' carries has a negative mass"),
    (ONE_LINK.replace('value="2"', 'value="nan"'), 'mass value of nan'),
    (ONE_LINK.replace('value="2"', 'value="1e300"'), 'mass value of 1e300'),
    (ONE_LINK.replace('value="2"', 'value="two"'), 'mass value of two'),
    (ONE_LINK.replace('ixx="0.02"', 'ixx="-5"'), 'an inertia that is negative'),
    ('', 'not a usable XML file'), ('<robot name="x">', 'not a usable XML file'),
    ('<sdf/>', 'not a URDF'),
    ('<robot name="x"><link name="base"/></robot>', 'no joint that moves'),
    ('<robot xmlns:xacro="x"><xacro:arm/></robot>', 'xacro')])
def test_files_that_describe_no_such_arm_give_one_line(pinocchio, tmp_path, text, words):
    assert chain_of(tmp_path, ONE_LINK, ['turn']).tree.parameters[0, 0] == 2.0
    with pytest.raises(InputError, match=words) as caught:
        chain_of(tmp_path, text, ['turn'])
    assert 'arm.urdf' in str(caught.value)
    assert '\n' not in str(caught.value)


def test_joints_that_are_not_recorded_are_locked(pinocchio, tmp_path):
    chain = chain_of(tmp_path, small_arm(), PLANE[:2])
    assert chain.locked == ['bend']
    assert chain.tree.joints == PLANE[:2]
    # The weight of the locked link still counts.
    whole = chain_of(tmp_path, small_arm(), PLANE).tree.weight([0.2, 0.3, 0.0])
    assert chain.tree.weight([0.2, 0.3]) == pytest.approx(whole[:2])


# Torques due to the motion of other joints, and friction between joints, without a URDF.

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
    assert again.at_rest(dict.fromkeys(again.joints, 0.3), 'roll') == {'coupling': 0.0}
    # Where there is none, none is named.
    assert not between(refine([wrist(2, 1, 0.0, 0.0)]))
