# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An arm from recording to compensator: refine with a URDF, predict and compensate without it."""

import csv
from dataclasses import replace
import json

from arm_maker import PLANE, recorded, small_arm, waves
import numpy as np
import pytest
from recording_maker import DATA, needs_data

from friction_comp.arm.whole_arm import refine_arm
from friction_comp.compensation.law import CompensationLaw
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings import read_arm, write_samples
from friction_comp.statistics import rms
from friction_comp.tools import predict, refine as refine_tool

SCALES = (0.4, 0.25, 0.5)
FRICTION = ((0.02, 0.3, 0.2, 0.05), (-0.03, 0.4, 0.3, 0.04), (0.0, 0.2, 0.1, 0.02))
# The URDF says 4, 3 and 2 kg.
MASSES = (5.0, 2.2, 2.6)
SIZE = 1200  # samples, at 100 Hz
pytestmark = pytest.mark.slow


def trial(seed, size=SIZE):
    rng = np.random.default_rng(seed)
    motion = waves(rng, size, 3, 0.01)
    return recorded(small_arm(MASSES), PLANE, motion, SCALES, FRICTION, rng)


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
    assert refine_tool.main([*map(str, arguments), '--output', str(output)]) == 0
    return json.loads((output / 'report.json').read_text(encoding='utf-8'))


def errors_of(table):
    with open(table, encoding='utf-8', newline='') as stream:
        rows = list(csv.DictReader(stream))
    return np.array([float(row['measured']) - float(row['predicted']) for row in rows])


def test_every_joint_has_its_report_and_the_arm_has_one(refined):
    whole = json.loads((refined / 'out' / 'report.json').read_text(encoding='utf-8'))
    assert list(whole['joints']) == list(PLANE)
    for name in PLANE:
        own = json.loads((refined / 'out' / name / 'report.json').read_text(encoding='utf-8'))
        assert own == {'version': 1, **whole['joints'][name]}
        assert own['after']['held_out_rmse'] < 0.5 * own['before']['held_out_rmse']
        assert (refined / 'out' / name / 'report.html').stat().st_size > 10_000
    for name in PLANE[1:]:
        first = whole['joints'][name]['effects'][0]
        assert (first['name'], first['variable']) == ('rigid_body', 'other joints')
    assert [row['joint'] for row in whole['arm']['rigid_bodies']] == list(PLANE)
    page = (refined / 'out' / 'report.html').read_text(encoding='utf-8')
    assert 'kg' in page
    assert 'friction_comp refine' in page


@pytest.mark.parametrize('joint', PLANE)
def test_predict_needs_no_urdf_and_is_right_on_another_recording(refined, joint, tmp_path,
                                                                monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'pinocchio', None)
    table = tmp_path / 'whole.csv'
    assert predict.main([
        str(refined / 'score'), '--model', str(refined / 'out' / 'model.yaml'), '--joint', joint,
        '--output', str(table)]) == 0
    error = errors_of(table)
    assert len(error) == SIZE
    # Noise is 0.02 A; the sign of friction at reversals is sharper than 100 Hz shows.
    assert rms(error) < 0.035
    assert predict.main([
        str(refined / 'score'), '--model', str(refined / 'out' / joint / 'model.yaml'),
        '--output', str(tmp_path / 'own.csv')]) == 0
    assert errors_of(tmp_path / 'own.csv') == pytest.approx(error, abs=1e-6)


def test_loading_from_a_file_of_an_arm_requires_a_joint(refined):
    path = refined / 'out' / 'model.yaml'
    assert FrictionModel.load(path, 'bend').joint == 'bend'
    with pytest.raises(InputError, match='several joints'):
        FrictionModel.load(path)
    with pytest.raises(InputError, match="no joint 'wrist' in it, but"):
        FrictionModel.load(path, 'wrist')


def test_a_recording_without_the_other_joints_is_refused(refined, tmp_path, refuses):
    write_samples(tmp_path / 'alone', trial(3, 400)[1])
    refuses('turn', 'predict', tmp_path / 'alone', '--model',
            refined / 'out' / 'lift' / 'model.yaml')


def test_one_joint_of_an_arm_has_the_usual_files(refined, tmp_path):
    write_samples(tmp_path / 'short', trial(1, 400))
    report = refined_to(tmp_path / 'out', tmp_path / 'short', '--urdf', refined / 'arm.urdf',
                        '--unit', 'A', '--joint', 'bend')
    assert report['joint'] == 'bend'
    assert FrictionModel.load(tmp_path / 'out' / 'model.yaml').arm.joints == PLANE


def test_models_of_joints_that_are_not_recorded_are_refused(refined, tmp_path, refuses):
    FrictionModel(drive=Drive(0.1, 100.0), sigmoid=Sigmoid(0.2, -0.2, 400.0), joint='wrist').save(
        tmp_path / 'wrist.yaml')
    refuses("wrist.yaml: is of joint 'wrist', but recorded are 'turn', 'lift', 'bend'", 'refine',
            refined / 'fit', '--urdf', refined / 'arm.urdf', '--model', tmp_path / 'wrist.yaml')


@pytest.mark.parametrize('model, known', [('model.yaml', True), ('lift/model.yaml', False)])
def test_masses_are_fitted_to_torques_where_all_drives_are_known(refined, tmp_path, monkeypatch,
                                                                 model, known):
    seen = []

    def stop(chain, samples, scales, *others):
        seen.append(scales)
        raise InputError('enough')
    monkeypatch.setattr('friction_comp.arm.whole_arm.fit_arm', stop)
    with pytest.raises(InputError, match='enough'):
        refine_tool.main([
            str(refined / 'fit'), '--urdf', str(refined / 'arm.urdf'), '--model',
            str(refined / 'out' / model), '--output', str(tmp_path / 'out')])
    assert (seen[0] is not None) == known


@pytest.mark.parametrize('arguments, words', [
    (['nowhere.urdf'], 'nowhere.urdf: cannot be read'),
    (['arm.urdf', '--joint', 'wrist'], "joint 'wrist' is not in the URDF")])
def test_unusable_input_gives_one_line_and_no_output(refined, arguments, words, refuses,
                                                     monkeypatch):
    monkeypatch.chdir(refined)
    refuses(words, 'refine', 'fit', '--urdf', *arguments)


def test_a_joint_that_stands_still_is_left_out_and_a_gripper_may_be_there(refined, tmp_path,
                                                                        capsys):
    """Only the last joint moves; two recordings; a gripper without effort beside the arm."""
    for number, name in enumerate(('one', 'two')):
        rng = np.random.default_rng(20 + number)
        motion = waves(rng, 400, 3, 0.01)
        for values, place in zip(motion, (0.3, 0.0, 0.0)):
            values[:, :2] = place
        joints = recorded(small_arm(MASSES), PLANE, motion, SCALES, FRICTION, rng)
        finger = joints[0].with_(joint='finger', current=np.zeros(400), arm=None)
        write_samples(tmp_path / name, [*joints, finger])
    whole = refined_to(
        tmp_path / 'out', tmp_path / 'one', tmp_path / 'two', '--urdf', refined / 'arm.urdf')
    assert list(whole['joints']) == ['bend']
    assert whole['joints']['bend']['after']['held_out_rmse'] < 0.04
    assert "'finger' is not in the URDF" in capsys.readouterr().out
    assert any("'turn'" in line and 'moves' in line for line in whole['arm']['notes'])


# The compensator.


def models_of(refined):
    return [FrictionModel.load(refined / 'out' / 'model.yaml', name) for name in PLANE]


def test_the_weight_of_the_arm_is_fed_forward_or_left_to_the_robot(refined):
    q = np.array([0.3, 0.5, -0.4])
    # 2.2 and 2.6 kg at the middle of 0.4 and 0.3 m, axes along y: a positive angle goes down.
    bend = -9.81 * 2.6 * 0.15 * np.cos(q[1] + q[2])
    lift = bend - 9.81 * (2.2 * 0.2 + 2.6 * 0.4) * np.cos(q[1])
    # The limit that refinement writes is that of the currents recorded.
    models = [replace(model, drive=replace(model.drive, current_limit=10.0))
              for model in models_of(refined)]
    carried = CompensationLaw(models)
    left = CompensationLaw(models, gravity='left_to_robot')
    for k in range(1000):
        currents = carried.update(0.001 * k, q, np.zeros(3), np.zeros(3))
        left.update(0.001 * k, q, np.zeros(3), np.zeros(3))
    assert currents == pytest.approx(carried.terms['effects'], abs=1e-9)
    assert carried.terms['effects'][1:] == pytest.approx(
        [SCALES[1] * lift, SCALES[2] * bend], rel=0.05, abs=0.05)
    assert left.terms['effects'] == pytest.approx(np.zeros(3), abs=1e-9)
    assert any(effect == 'rigid_body' and 'robot' in why for _, effect, why in left.left_out)
    assert not any(effect == 'rigid_body' for _, effect, _ in carried.left_out)


def test_a_load_takes_the_current_that_it_takes_where_the_drives_are_unknown(refined):
    parts = {samples.joint: samples for samples in trial(3)}
    name = PLANE[-1]
    load = 2.0 * np.sin(3.7 * parts[name].time)
    parts[name] = parts[name].with_(load=load, current=parts[name].current - SCALES[-1] * load)
    result = refine_arm({joint: [samples] for joint, samples in parts.items()},
                        refined / 'arm.urdf', {joint: Drive(1.0, 1.0) for joint in PLANE},
                        only=[name]).results[name]
    effects = {effect.name: effect.parameters for effect in result.report.effects}
    assert effects['load_torque']['coefficients'] == pytest.approx([-SCALES[-1]], rel=0.1)


def test_a_joint_alone_does_not_guess_the_weight_of_the_arm(refined):
    law = CompensationLaw(models_of(refined)[1:2])
    law.update(0.0, [0.4], [0.0], [0])
    assert law.terms['effects'] == pytest.approx([0.0])
    assert ('rigid_body', 'rigid_body unknown') in [entry[1:] for entry in law.left_out]


# Without a URDF.


def test_other_joints_are_named_where_no_urdf_says_more(refined, tmp_path):
    fresh = read_arm(refined / 'score')
    report = refined_to(tmp_path, refined / 'fit', '--joint', 'lift')
    found = {effect['variable']: effect['in_words'] for effect in report['effects']}
    assert 'bend' in found['other joints']
    assert any('--urdf' in line for line in report['record_again'])
    assert found['other joints'] in (tmp_path / 'report.html').read_text(encoding='utf-8')
    model = FrictionModel.load(tmp_path / 'model.yaml')
    samples = fresh['lift'][0][0]
    error = samples.current - model.predict(samples)
    assert rms(error) < 0.2 * np.std(samples.current)


# A real arm.


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
