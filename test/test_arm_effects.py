# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What acts on single joints of an arm whose URDF has wrong masses: not a mass, and none too many.

Torques of the links come from Pinocchio; what acts beside them is written out here.
"""

from arm_maker import PLANE, recorded, small_arm, waves
import numpy as np
import pytest

from friction_comp.arm.whole_arm import refine_arm
from friction_comp.compensation.law import CompensationLaw
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.statistics import rms

FRICTION = ((0.02, 0.8, 0.5, 0.05), (-0.03, 1.0, 0.8, 0.04), (0.0, 0.5, 0.3, 0.02))
# The URDF says 4, 3 and 2 kg.
MASSES, NOISE, SIZE = (5.0, 2.2, 2.6), 0.1, 1500
LIFT, BEND = 1, 2
pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def urdf(tmp_path_factory):
    pytest.importorskip('pinocchio', reason='Pinocchio is not installed')
    path = tmp_path_factory.mktemp('arm') / 'arm.urdf'
    path.write_text(small_arm(), encoding='utf-8')
    return path


def trial(seed, beside):
    """Return the joints' samples; `beside` gives torques beside the links by joint, N·m."""
    rng = np.random.default_rng(seed)
    motion = waves(rng, SIZE, 3, 0.01)
    joints = recorded(small_arm(MASSES), PLANE, motion, (1.0, 1.0, 1.0), FRICTION, rng, NOISE)
    return [samples.with_(current=samples.current + beside(*motion).get(joint, 0.0))
            for joint, samples in enumerate(joints)]


def refined(urdf, beside, *joints, seed=4):
    return refine_arm({samples.joint: [samples] for samples in trial(seed, beside)}, urdf,
                      torques=True, only=[PLANE[joint] for joint in joints])


def found(result, joint):
    return {effect.name: effect.parameters
            for effect in result.results[PLANE[joint]].report.effects}


def weights(result):
    """Return what the fitted links weigh at the joints with horizontal axes, at two postures."""
    return np.concatenate([result.fit.tree.weight(np.array(q))[1:]
                           for q in ((0.0, 0.0, 0.0), (0.3, 0.5, -0.4))])


def true_weights():
    bend = [-9.81 * 2.6 * 0.15 * np.cos(angle) for angle in (0.0, 0.1)]
    lift = [-9.81 * (2.2 * 0.2 + 2.6 * 0.4) * np.cos(angle) for angle in (0.0, 0.5)]
    return np.array([lift[0] + bend[0], bend[0], lift[1] + bend[1], bend[1]])


def spring_and_ripple(q, v, a):
    return {LIFT: 8.0 * (q[:, LIFT] - 0.2) + 1.5 * np.cos(12.0 * q[:, LIFT] + 0.4)}


def test_a_spring_and_a_ripple_are_named_and_no_mass_absorbs_them(urdf):
    result = refined(urdf, spring_and_ripple, LIFT)
    effects = found(result, LIFT)
    assert effects['spring']['coefficients'] == pytest.approx([8.0], rel=0.03)
    assert np.hypot(*effects['cogging']['coefficients']) == pytest.approx(1.5, rel=0.1)
    assert effects['cogging']['frequency'] == pytest.approx(12.0, rel=0.03)
    assert effects['rigid_body']['coefficients'] == pytest.approx([1.0], rel=0.05)
    assert weights(result) == pytest.approx(true_weights(), rel=0.05)
    other = trial(5, spring_and_ripple)[LIFT]
    assert rms(other.current - result.results['lift'].model.predict(other)) < 1.5 * NOISE


def test_nothing_is_named_beside_the_links_where_nothing_is(urdf):
    result = refined(urdf, lambda *_: {}, LIFT, BEND)
    assert weights(result) == pytest.approx(true_weights(), rel=0.05)
    for joint in (LIFT, BEND):
        assert set(found(result, joint)) <= {'rigid_body', 'inertia'}


def differential(q, v, a):
    """Friction of a motor that turns with the sum of two joints acts on both."""
    rate = v[:, LIFT] + v[:, BEND]
    torque = 1.5 * np.tanh(rate / 0.01) + 0.6 * rate
    return {LIFT: torque, BEND: torque}


def test_friction_between_joints_is_named_beside_the_links_and_written(urdf, tmp_path):
    result = refined(urdf, differential, LIFT, BEND)
    assert weights(result) == pytest.approx(true_weights(), rel=0.05)
    write_arm(tmp_path / 'model.yaml', {name: one.model for name, one in result.results.items()})
    models = [FrictionModel.load(tmp_path / 'model.yaml', name) for name in ('lift', 'bend')]
    for joint, model in zip((LIFT, BEND), models):
        coulomb, viscous = found(result, joint)['friction_between']['coefficients']
        assert coulomb == pytest.approx(1.5, rel=0.05)
        assert viscous == pytest.approx(0.6, rel=0.1)
        entry = next(effect for effect in result.results[PLANE[joint]].report.effects
                     if effect.name == 'friction_between')
        assert 'lift' in entry.in_words
        assert 'bend' in entry.in_words
        other = trial(5, differential)[joint]
        assert rms(other.current - model.predict(other)) < 1.5 * NOISE
    # The weight is still fed forward, and friction between joints adds nothing at rest.
    turn = FrictionModel(models[0].drive, models[0].sigmoid, joint='turn')
    law = CompensationLaw([turn, *models])
    for k in range(1000):
        law.update(0.001 * k, np.zeros(3), np.zeros(3), np.zeros(3))
    assert law.terms['effects'][1:] == pytest.approx(true_weights()[:2], rel=0.06)
    assert not any(effect == 'rigid_body' for _, effect, _ in law.left_out)
