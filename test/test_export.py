# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Models are exported to simulators, with the error of the simpler model stated."""

from dataclasses import replace
import json
import re
from xml.etree import ElementTree

from helpers import note_model
import numpy as np
import pytest
import yaml

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_numbers import loss_of, simulator_joint
from friction_comp.model.measured import Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples
from friction_comp.statistics import rms

MODEL = note_model(2)
GAIN = MODEL.drive.torque_per_current
# Steep enough that its smooth sign change does not show in the sweeps.
PLAIN = replace(MODEL, joint='elbow', sigmoid=Sigmoid(
    upper=0.2, lower=-0.2, steepness=5000.0, viscous=0.1), simulation={}, effects=[
        EFFECTS['inertia']({'coefficients': [0.01]}), EFFECTS['gravity']({
            'coefficients': [0.3, 0.0]})])
RIPPLE = EFFECTS['friction_ripple']({
    'coefficients': [0.05, 0.0], 'frequency': 24.0, 'growth': 0.0, 'speed': 1.0,
    'transition': 1e-4})


def exported(tmp_path, model, form):
    model.save(tmp_path / 'model.yaml')
    path = tmp_path / f'out.{form}'
    assert run('export', [str(tmp_path / 'model.yaml'), '--to', form, '--output', str(path)]) == 0
    return path.read_text(encoding='utf-8')


@pytest.mark.parametrize('steepness', [20.0, 126.0, 5000.0])
def test_a_smooth_sign_change_is_not_read_as_viscous_friction(steepness):
    model = replace(PLAIN, effects=[], sigmoid=replace(PLAIN.sigmoid, steepness=steepness))
    joint = simulator_joint(model, 'tanh')
    assert joint.coulomb == pytest.approx(0.2 * GAIN, rel=1e-6)
    assert joint.viscous == pytest.approx(0.1 * GAIN, rel=1e-6)
    # What the form loses of it is said.
    lost = loss_of(model, simulator_joint(model, 'mujoco'))[1]
    assert lost > 1e-3 if steepness < 100 else lost < 1e-3
    assert loss_of(model, joint)[1] < 1e-9


def test_the_stated_export_error_is_that_of_the_missing_effect():
    model = replace(PLAIN, effects=[RIPPLE])
    joint = simulator_joint(model, 'mujoco')
    assert loss_of(model, joint)[0] == pytest.approx(
        0.05 * GAIN / np.sqrt(2.0), rel=0.02)
    assert joint.coulomb == pytest.approx(0.2 * GAIN, rel=0.02)


@pytest.mark.parametrize('form', ['mujoco', 'urdf', 'sdf'])
def test_files_hold_the_numbers_and_say_what_they_miss(tmp_path, form):
    text = exported(tmp_path, PLAIN, form)
    tree = ElementTree.fromstring(text)
    words = ElementTree.tostring(tree, encoding='unicode')
    numbers = [float(number) for number in re.findall(r'[>"]([\d.]+)["<]', words)]
    for value in (0.2 * GAIN, 0.1 * GAIN):
        assert any(number == pytest.approx(value, rel=1e-6) for number in numbers)
    assert 'misses nothing of the model' in text
    assert 'Not in it: gravity' in text
    # An offset has no place in these; in JSON it has.
    lopsided = replace(PLAIN, sigmoid=replace(PLAIN.sigmoid, upper=0.3))
    assert 'misses the model' in exported(tmp_path, lopsided, form)
    content = exported(tmp_path, lopsided, 'json')
    assert 'misses nothing' in content
    assert json.loads(content)['inertia'] == pytest.approx(0.01 * GAIN)


def test_the_table_gives_friction_over_speed_and_says_what_it_lacks(tmp_path, capsys):
    smooth = replace(PLAIN, sigmoid=replace(PLAIN.sigmoid, steepness=20.0), effects=[RIPPLE])
    exported(tmp_path, smooth, 'csv')
    assert 'Not in it: friction ripple' in capsys.readouterr().out
    speeds = np.linspace(-1.0, 1.0, 201)
    expected = GAIN * np.array([smooth.sigmoid(v) for v in speeds])
    table = np.loadtxt(tmp_path / 'out.csv', delimiter=',', skiprows=1)
    assert np.abs(np.interp(speeds, *table.T) - expected).max() < 0.02 * expected.max()


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
    assert rms((np.array(torque) - expected)[moves]) < 0.02 * rms(expected[moves])


@pytest.mark.parametrize('form, keys', [
    ('tanh', ('Fc', 'Fv', 'Fo', 'k')),
    ('isaac', ('static_friction', 'dynamic_friction', 'viscous_friction', 'armature'))])
def test_yaml_forms_hold_the_numbers_that_refine_reports(tmp_path, form, keys):
    recorded = Recorded((0.5, 1.0), {'coulomb': (0.19, 0.21), 'inertia': (0.005, 0.009)})
    text = exported(tmp_path, replace(PLAIN, recorded=recorded), form)
    numbers = yaml.safe_load(text)['elbow']
    # Static friction is never below the dynamic one, as the note's breakaway would be.
    expected = {'Fc': 0.2, 'Fv': 0.1, 'Fo': 0.0, 'static_friction': 0.2,
                'dynamic_friction': 0.2, 'viscous_friction': 0.1, 'armature': 0.01}
    for key in keys:
        if key != 'k':
            assert numbers[key] == pytest.approx(expected[key] * GAIN, rel=1e-6, abs=1e-9)
    coulomb = keys[0] if form == 'tanh' else keys[1]
    assert numbers['range'][coulomb] == pytest.approx([0.19 * GAIN, 0.21 * GAIN])
    # The interval of another inertia than the model's is not passed on.
    assert 'armature' not in numbers['range']
    assert 'misses nothing of the model' in text


@pytest.mark.parametrize('unit', ['LSB', 'V', 'A'])
def test_what_is_no_torque_is_not_called_one(tmp_path, refuses, unit):
    model = replace(PLAIN, drive=Drive(1.0, 1.0), notes={'unit': unit})
    model.save(tmp_path / 'model.yaml')
    refuses(unit, 'export', tmp_path / 'model.yaml', '--to', 'mujoco')
