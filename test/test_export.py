# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Models are exported to simulators, with the error of the simpler model stated."""

import csv
from dataclasses import replace
import re
from xml.etree import ElementTree

from helpers import note_model
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.model.effects import EFFECTS
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.model.simulator_joint import simulator_joint
from friction_comp.samples import Samples
from friction_comp.statistics import rms

MODEL = note_model(2)
GAIN = MODEL.drive.torque_per_current
# Steep enough that the slowest sweep slides.
PLAIN = replace(MODEL, joint='elbow', sigmoid=Sigmoid(
    upper=0.2, lower=-0.2, steepness=5000.0, viscous=0.1), simulation={}, effects=[
        EFFECTS['inertia']({'coefficients': [0.01]}), EFFECTS['gravity']({
            'coefficients': [0.3, 0.0]})])


def exported(tmp_path, model, form):
    model.save(tmp_path / 'model.yaml')
    path = tmp_path / f'out.{form}'
    assert run('export', [str(tmp_path / 'model.yaml'), '--to', form, '--output', str(path)]) == 0
    return path.read_text(encoding='utf-8')


def test_friction_that_simulators_support_is_exported_exactly():
    joint = simulator_joint(PLAIN)
    assert joint.friction == pytest.approx(0.2 * GAIN, rel=1e-6)
    assert joint.damping == pytest.approx(0.1 * GAIN, rel=1e-6)
    assert joint.inertia == pytest.approx(0.01 * GAIN)
    assert joint.error < 1e-6
    assert joint.left_out == ['gravity: belongs to the links and what they touch']


def test_the_stated_export_error_is_that_of_the_missing_effect():
    ripple = EFFECTS['friction_ripple']({
        'coefficients': [0.05, 0.0], 'frequency': 24.0, 'growth': 0.0, 'speed': 1.0,
        'transition': 1e-4})
    joint = simulator_joint(replace(PLAIN, effects=[ripple]))
    assert joint.error == pytest.approx(0.05 * GAIN / np.sqrt(2.0), rel=0.02)
    assert joint.friction == pytest.approx(0.2 * GAIN, rel=0.02)


@pytest.mark.parametrize('form', ['mujoco', 'urdf', 'sdf'])
def test_files_hold_the_numbers_and_say_what_they_miss(tmp_path, form):
    text = exported(tmp_path, PLAIN, form)
    tree = ElementTree.fromstring(text)
    words = ElementTree.tostring(tree, encoding='unicode')
    numbers = [float(number) for number in re.findall(r'[>"]([\d.]+)["<]', words)]
    for value in (0.2 * GAIN, 0.1 * GAIN):
        assert any(number == pytest.approx(value, rel=1e-6) for number in numbers)
    assert 'misses the model by' in text
    assert 'Not in it: gravity' in text


def test_the_table_gives_the_models_torque(tmp_path):
    load = EFFECTS['load_friction']({'coefficients': [0.02], 'exponent': 1.0, 'transition': 1e-4})
    text = exported(tmp_path, replace(PLAIN, effects=[load]), 'csv')
    rows = np.array([[float(cell) for cell in row] for row in list(
        csv.reader(text.splitlines()))[1:]])
    speed, _, loads, torque = rows.T
    expected = GAIN * (0.2 * np.sign(speed) + 0.1 * speed + 0.02 * np.abs(loads) * np.sign(speed))
    np.testing.assert_allclose(torque, expected, rtol=1e-4)
    assert len(np.unique(loads)) == 9


def test_mujoco_gives_the_models_current_within_the_error_stated(tmp_path):
    mujoco = pytest.importorskip('mujoco', reason='MuJoCo is not here: pip install mujoco')
    model = replace(MODEL, joint='elbow', effects=[EFFECTS['inertia']({'coefficients': [0.01]})])
    (tmp_path / 'joint.xml').write_text(exported(tmp_path, model, 'mujoco'), encoding='utf-8')
    (tmp_path / 'arm.xml').write_text(
        '<mujoco><include file="joint.xml"/><option gravity="0 0 0" timestep="0.001"/><worldbody>'
        '<body><joint class="elbow" axis="0 0 1"/><geom size="0.01" mass="1e-9"/></body>'
        '</worldbody></mujoco>', encoding='utf-8')
    plant = mujoco.MjModel.from_xml_path(str(tmp_path / 'arm.xml'))
    data = mujoco.MjData(plant)
    time = np.arange(0.0, 6.0, 0.01)
    position, velocity = -np.cos(time), np.sin(time)
    acceleration, torque = np.cos(time), []
    for q, v, a in zip(position, velocity, acceleration):
        data.qpos[0], data.qvel[0], data.qacc[0] = q, v, a
        mujoco.mj_inverse(plant, data)
        torque.append(data.qfrc_inverse[0])
    expected = GAIN * model.current(Samples(
        time=time, position=position, velocity=velocity, acceleration=acceleration,
        current=np.zeros_like(time)))
    moves = np.abs(velocity) > 0.05
    assert rms((np.array(torque) - expected)[moves]) < simulator_joint(model).error


def test_bad_input_is_named(refuses):
    refuses('no.yaml', 'export', 'no.yaml', '--to', 'urdf')


@pytest.mark.parametrize('form, option, value', [
    ('csv', '--joint', 'elbow'), ('mujoco', '--load', '5')])
def test_an_option_that_the_form_does_not_use_is_refused(tmp_path, refuses, form, option, value):
    MODEL.save(tmp_path / 'model.yaml')
    refuses(option, 'export', tmp_path / 'model.yaml', '--to', form, option, value)
