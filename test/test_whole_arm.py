# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm from recording to compensator: refine with a URDF, predict and compensate without it.

Torques of the links come from Pinocchio; what acts beside them is written out here.
"""

from dataclasses import replace
import json

import numpy as np
import pandas
import pytest
from recording_maker import DATA, needs_data
from simulated_arms import FRICTION, MASSES, PLANE, recorded, SCALES, small_arm, waves

from friction_comp.arm.fit import refine_arm
from friction_comp.compensation.law import CompensationLaw
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import write_arm
from friction_comp.recordings.reader import read_arm
from friction_comp.recordings.writer import write_samples
from friction_comp.statistics import rms
from friction_comp.tools.predict import predict
from friction_comp.tools.refine import refine as refine_tool

pytestmark = pytest.mark.slow
LIFT, BEND = 1, 2


def trial(seed, size=1200):
    rng = np.random.default_rng(seed)
    return recorded(small_arm(MASSES), PLANE, waves(rng, size, 3, 0.01), SCALES, FRICTION, rng)


def true_weights(q, scales=(1.0, 1.0)):
    """Return what lift and bend carry: 2.2 and 2.6 kg at the middle of 0.4 and 0.3 m.

    Their axes are along y: a positive angle goes down.
    """
    bend = -9.81 * 2.6 * 0.15 * np.cos(q[1] + q[2])
    lift = bend - 9.81 * (2.2 * 0.2 + 2.6 * 0.4) * np.cos(q[1])
    return [scales[0] * lift, scales[1] * bend]


@pytest.fixture(scope='module')
def refined(tmp_path_factory):
    """Return the folder of an arm's recordings, URDF, and what refine made of them."""
    pytest.importorskip('pinocchio', reason='Pinocchio is not installed')
    folder = tmp_path_factory.mktemp('arm')
    (folder / 'arm.urdf').write_text(small_arm(), encoding='utf-8')
    write_samples(folder / 'fit', trial(1))
    write_samples(folder / 'score', trial(2))
    refined_to(folder / 'out', folder / 'fit', '--urdf', folder / 'arm.urdf', '--unit', 'A')
    return folder


def refined_to(output, *arguments):
    """Run refine; return its report."""
    assert refine_tool([*map(str, arguments), '--output', str(output)]) == 0
    return json.loads((output / 'report.json').read_text(encoding='utf-8'))


def errors_of(table):
    rows = pandas.read_csv(table)
    return (rows['measured'] - rows['predicted']).to_numpy()


def test_every_joint_has_its_report_and_the_arm_has_one(refined):
    whole = json.loads((refined / 'out' / 'report.json').read_text(encoding='utf-8'))
    assert list(whole['joints']) == list(PLANE)
    for name in PLANE:
        own = json.loads((refined / 'out' / name / 'report.json').read_text(encoding='utf-8'))
        assert own == {'version': 1, **whole['joints'][name]}
        assert own['after']['held_out_rmse'] < 0.5 * own['before']['held_out_rmse']
        assert (refined / 'out' / name / 'report.html').is_file()
    for name in PLANE[1:]:
        assert whole['joints'][name]['effects'][0]['name'] == 'rigid_body'
    assert [row['joint'] for row in whole['arm']['rigid_bodies']] == list(PLANE)


@pytest.mark.parametrize('joint', PLANE)
def test_predict_needs_no_urdf_and_is_right_on_another_recording(refined, joint, tmp_path,
                                                                monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'pinocchio', None)
    tables = [tmp_path / name for name in ('whole.csv', 'own.csv')]
    for table, model in zip(tables, (['model.yaml', '--joint', joint], [f'{joint}/model.yaml'])):
        assert predict([str(refined / 'score'), '--model', str(refined / 'out' / model[0]),
                             *model[1:], '--output', str(table)]) == 0
    error, own = map(errors_of, tables)
    # Noise is 0.02 A; the sign of friction at reversals is sharper than 100 Hz shows.
    assert rms(error) < 0.035
    assert own == pytest.approx(error, abs=1e-6)


def test_the_weight_of_the_arm_is_fed_forward_or_left_to_the_robot(refined):
    q = np.array([0.3, 0.5, -0.4])
    # The limit that refinement writes is that of the currents recorded.
    models = [FrictionModel.load(refined / 'out' / 'model.yaml', name) for name in PLANE]
    models = [replace(one, drive=replace(one.drive, current_limit=10.0)) for one in models]
    carried, left = CompensationLaw(models), CompensationLaw(models, gravity='left_to_robot')
    for k in range(1000):
        for law in (carried, left):
            law.update(0.001 * k, q, np.zeros(3), np.zeros(3))
    assert carried.terms['effects'][1:] == pytest.approx(
        true_weights(q, SCALES[1:]), rel=0.05, abs=0.05)
    assert left.terms['effects'] == pytest.approx(np.zeros(3), abs=1e-9)
    assert not any(name == 'rigid_body' for _, name, _ in carried.never_applied + carried.missing)
    assert any(effect == 'rigid_body' for _, effect, _ in left.never_applied + left.missing)
    # A joint alone does not guess.
    alone = CompensationLaw(models[1:2])
    alone.update(0.0, [0.4], [0.0], [0])
    assert alone.terms['effects'] == pytest.approx([0.0])
    assert 'rigid_body' in [effect for _, effect, _ in alone.never_applied + alone.missing]


def test_other_joints_are_named_where_no_urdf_says_more(refined, tmp_path):
    report = refined_to(tmp_path, refined / 'fit', '--joint', 'lift')
    found = {effect['variable']: effect['in_words'] for effect in report['effects']}
    assert 'bend' in found['other joints']
    assert any('--urdf' in line for line in report['record_again'])
    model = FrictionModel.load(tmp_path / 'model.yaml')
    samples = read_arm(refined / 'score')['lift'][0][0]
    assert rms(samples.current - model.predict(samples)) < 0.2 * np.std(samples.current)


# What acts on single joints whose URDF has wrong masses: not a mass, and none too many.

LARGE = ((0.02, 0.8, 0.5, 0.05), (-0.03, 1.0, 0.8, 0.04), (0.0, 0.5, 0.3, 0.02))
NOISE = 0.1
POSTURES = np.array([(0.0, 0.0, 0.0), (0.3, 0.5, -0.4)])


def with_torques(seed, beside):
    """Return the joints' samples; `beside` gives torques beside the links by joint, N·m."""
    rng = np.random.default_rng(seed)
    motion = waves(rng, 1500, 3, 0.01)
    joints = recorded(small_arm(MASSES), PLANE, motion, (1.0, 1.0, 1.0), LARGE, rng, NOISE)
    return [samples.with_(current=samples.current + beside(*motion).get(joint, 0.0))
            for joint, samples in enumerate(joints)]


@pytest.fixture
def found_beside(refined):
    def refined_beside(beside, *joints):
        result = refine_arm({samples.joint: [samples] for samples in with_torques(4, beside)},
                            refined / 'arm.urdf', torques=True,
                            only=[PLANE[joint] for joint in joints])
        # Whatever acts beside the links, no mass absorbs it.
        for q in POSTURES:
            assert result.fit.tree.weight(q)[1:] == pytest.approx(true_weights(q), rel=0.05)
        return result, [{effect.name: effect for effect in result.results[PLANE[joint]].
                         report.effects} for joint in joints]
    return refined_beside


def test_a_spring_and_a_ripple_are_named_and_no_mass_absorbs_them(found_beside):
    def beside(q, v, a):
        return {LIFT: 8.0 * (q[:, LIFT] - 0.2) + 1.5 * np.cos(12.0 * q[:, LIFT] + 0.4)}
    result, (effects,) = found_beside(beside, LIFT)
    constants = {name: effect.parameters for name, effect in effects.items()}
    assert constants['spring']['coefficients'] == pytest.approx([8.0], rel=0.03)
    assert np.hypot(*constants['cogging']['coefficients']) == pytest.approx(1.5, rel=0.1)
    assert constants['cogging']['frequency'] == pytest.approx(12.0, rel=0.03)
    assert constants['rigid_body']['coefficients'] == pytest.approx([1.0], rel=0.05)
    other = with_torques(5, beside)[LIFT]
    assert rms(other.current - result.results['lift'].model.predict(other)) < 1.5 * NOISE


def test_nothing_is_named_beside_the_links_where_nothing_is(found_beside):
    for effects in found_beside(lambda *_: {}, LIFT, BEND)[1]:
        assert set(effects) <= {'rigid_body', 'inertia'}


def test_friction_between_joints_is_named_beside_the_links_and_written(found_beside, tmp_path):
    """Friction of a motor that turns with the sum of two joints acts on both."""
    def beside(q, v, a):
        rate = v[:, LIFT] + v[:, BEND]
        torque = 1.5 * np.tanh(rate / 0.01) + 0.6 * rate
        return {LIFT: torque, BEND: torque}
    result, effects = found_beside(beside, LIFT, BEND)
    write_arm(tmp_path / 'model.yaml', {name: one.model for name, one in result.results.items()})
    models = [FrictionModel.load(tmp_path / 'model.yaml', name) for name in ('lift', 'bend')]
    for joint, model, found in zip((LIFT, BEND), models, effects):
        between = found['friction_between']
        coulomb, viscous = between.parameters['coefficients']
        assert coulomb == pytest.approx(1.5, rel=0.05)
        assert viscous == pytest.approx(0.6, rel=0.1)
        assert 'lift' in between.in_words
        assert 'bend' in between.in_words
        other = with_torques(5, beside)[joint]
        assert rms(other.current - model.predict(other)) < 1.5 * NOISE
    # The weight is still fed forward, and friction between joints adds nothing at rest.
    turn = FrictionModel(models[0].drive, models[0].sigmoid, joint='turn')
    law = CompensationLaw([turn, *models])
    for k in range(1000):
        law.update(0.001 * k, np.zeros(3), np.zeros(3), np.zeros(3))
    assert law.terms['effects'][1:] == pytest.approx(true_weights(np.zeros(3)), rel=0.06)
    assert not any(effect == 'rigid_body' for _, effect, _ in law.never_applied + law.missing)


@needs_data
def test_ur10e_is_predicted_better_than_by_plain_least_squares():
    """UR10e, all joints moving (shamilmamedov/dynamic_calibration, Mamedov and Mikhel 2020)."""
    pytest.importorskip('pinocchio', reason='Pinocchio is not installed')
    folder = DATA / 'ur10e_all_joints'
    fit, score = (
        {name: [samples.take(slice(None, None, 8)) for samples, _ in parts]
         for name, parts in read_arm(folder / which).items()} for which in ('fit', 'score'))
    # All joints give information on the links; friction of one joint is enough.
    name, = only = ['wrist_1_joint']
    result = refine_arm(fit, folder / 'ur10e.urdf', only=only).results[name]
    part = score[name][0]
    assert rms(part.current - result.model.predict(part)) <= 0.056
