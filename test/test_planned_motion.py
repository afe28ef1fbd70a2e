# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A plan without effort, and single planned states, give the torque that the motion needs."""

from dataclasses import replace

from helpers import note_model
import numpy as np
import pytest
from table_maker import write

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Recorded
from friction_comp.model.model_file import write_arm
from friction_comp.model.sigmoid import Sigmoid

MODEL = FrictionModel(
    Drive(0.1, 50.0), Sigmoid(0.2, -0.2, 200.0, viscous=0.1), joint='elbow', effects=[
        EFFECTS['inertia']({'coefficients': [0.02]}),
        EFFECTS['gravity']({'coefficients': [0.3, 0.0]}),
        EFFECTS['load_torque']({'coefficients': [-0.2]})])
GAIN = 5.0


def needed(q, v, a):
    return GAIN * (0.2 * np.sign(v) + 0.1 * v + 0.02 * a + 0.3 * np.cos(q))


def motion(name='', phase=0.0):
    time = np.arange(0.0, 4.0, 0.01)
    q, v, a = (np.sin(2 * time + phase), 2 * np.cos(2 * time + phase),
               -4 * np.sin(2 * time + phase))
    return time, q, v, a


def predicted(folder, model, **columns):
    """Write a table, and return the columns that `predict` makes of it."""
    write(folder / 'plan.csv', **columns)
    assert run('predict', [str(folder / 'plan.csv'), '--model', str(folder / model),
                           '--output', str(folder / 'out.csv')]) == 0
    names, *rows = (folder / 'out.csv').read_text(encoding='utf-8').splitlines()
    return dict(zip(names.split(','), np.array([row.split(',') for row in rows], float).T))


def test_one_state_gives_the_torque_of_its_terms_without_what_a_plan_does_not_tell():
    assert MODEL.feed_forward(0.4, 1.0, 2.0) == pytest.approx(needed(0.4, 1.0, 2.0))
    # At rest it only carries: friction holds by itself.
    assert MODEL.feed_forward(0.4, 0.0) == pytest.approx(GAIN * 0.3 * np.cos(0.4))
    # An array is of independent samples.
    _, q, v, a = motion()
    moves = np.abs(v) > 0.1
    np.testing.assert_allclose(MODEL.feed_forward(q, v, a)[moves], needed(q, v, a)[moves])


def test_what_gives_no_torque_is_refused():
    with pytest.raises(InputError, match='LSB'):
        replace(MODEL, notes={'unit': 'LSB'}).feed_forward(0.0, 1.0)
    with pytest.raises(InputError, match='finite'):
        MODEL.feed_forward(np.nan, 1.0)


@pytest.mark.parametrize('name', ['position [deg]', 'goal_deg'])
def test_a_plan_of_time_and_position_gives_the_torque(tmp_path, capsys, name):
    time, q, v, a = motion()
    MODEL.save(tmp_path / 'model.yaml')
    rows = predicted(tmp_path, 'model.yaml', **{'time [ms]': 1e3 * time, name: np.degrees(q)})
    assert list(rows) == ['time', 'torque', 'current']
    np.testing.assert_allclose(rows['time'], time, atol=1e-8)
    inside = (np.abs(v) > 0.3) & (time > 0.3) & (time < 3.7)
    np.testing.assert_allclose(rows['torque'][inside], needed(q, v, a)[inside], atol=0.02)
    np.testing.assert_allclose(rows['torque'], GAIN * rows['current'], rtol=1e-6, atol=1e-8)
    said = capsys.readouterr().out
    assert 'load_torque' in said
    assert 'taken as a plan' in said


BEYOND = {name: f'a quarter beyond the {name} that' for name in (
    'speed', 'acceleration', 'position', 'temperature')}
LARGER, USELESS = 'that refine expected', 'does not hold for this recording'


@pytest.mark.parametrize(('change', 'said'), [
    ({}, set()), ({'speed': 3.0}, {'speed', 'acceleration'}), ({'size': 3.0}, {
        'position', 'speed', 'acceleration'}),
    # The same speeds, to and fro in a fifth of the time.
    ({'speed': 5.0, 'size': 0.2}, {'acceleration'}),
    ({'temperature': 15.0}, {'temperature'}), ({'friction': 1.2}, {LARGER}),
    ({'weight': 5.0}, {LARGER, USELESS})])
def test_predict_says_where_the_model_does_not_hold(tmp_path, capsys, change, said):
    speed, size, friction = (change.get(name, 1.0) for name in ('speed', 'size', 'friction'))
    recorded = Recorded((0.2, 1.0, 1.9), {}, {
        'position': (-1.0, 1.0), 'speed': (0.0, 2.0), 'acceleration': (0.0, 4.0),
        'temperature': (20.0, 21.0)}, error=0.02)
    model = replace(MODEL, effects=MODEL.effects[:2], recorded=recorded)
    model.save(tmp_path / 'model.yaml')
    assert FrictionModel.load(tmp_path / 'model.yaml').recorded == recorded
    time = np.arange(0.0, 4.0, 0.002)
    q, v, a = (size * speed ** k * wave for k, wave in enumerate((
        np.sin(2 * speed * time), 2 * np.cos(2 * speed * time), -4 * np.sin(2 * speed * time))))
    columns = {'t': time, 'elbow.position': q, 'elbow.temperature': 22.0 + change.get(
        'temperature', 0.0) + 0.0 * time}
    torque = (needed(q, v, a) + change.get('weight', 0.0)
              + (friction - 1.0) * GAIN * (0.2 * np.sign(v) + 0.1 * v))
    for name, effort in (('plan', {}), ('log', {'elbow.effort': torque})):
        predicted(tmp_path, 'model.yaml', **columns, **effort)
        shown = capsys.readouterr().out
        assert ('columns guessed from their names: time=t' in shown) == (name == 'log')
        expected = {BEYOND.get(one, one) for one in said
                    if name == 'log' or one not in ('temperature', LARGER, USELESS)}
        assert {one for one in (*BEYOND.values(), LARGER, USELESS) if one in shown} == expected


def test_of_several_recorded_joints_the_model_knows_its_own(tmp_path):
    time, q, v, a = motion()
    replace(MODEL, effects=MODEL.effects[:2]).save(tmp_path / 'model.yaml')
    rows = predicted(tmp_path, 'model.yaml', t=time, **{
        'wrist.position': -q, 'wrist.effort': q, 'elbow.position': q,
        'elbow.effort': needed(q, v, a)})
    inside = (np.abs(v) > 0.3) & (time > 0.3) & (time < 3.7)
    np.testing.assert_allclose(rows['predicted'][inside], rows['measured'][inside], atol=0.01)


def test_a_plan_of_an_arm_gives_the_torque_of_each_joint(tmp_path):
    other = replace(MODEL, joint='wrist', sigmoid=Sigmoid(0.05, -0.05, 200.0), effects=[])
    write_arm(tmp_path / 'arm.yaml', {model.joint: model for model in (MODEL, other)})
    time, q, *_ = motion()
    _, q2, v2, _ = motion(phase=1.0)
    rows = predicted(tmp_path, 'arm.yaml', **{
        'time': time, 'elbow.position': q, 'wrist.position': q2})
    assert {'elbow.torque', 'wrist.torque'} <= set(rows)
    moves = np.abs(v2) > 0.3
    np.testing.assert_allclose(rows['wrist.torque'][moves], 0.25 * np.sign(v2[moves]), atol=1e-4)


def test_a_table_of_another_joint_is_refused(tmp_path, refuses):
    note_model(2).save(tmp_path / 'model.yaml')
    replace(MODEL, effects=[]).save(tmp_path / 'elbow.yaml')
    (tmp_path / 'plan.csv').write_text('time,a.position,b.position\n0,0,0\n1,1,1\n2,2,2\n',
                                       encoding='utf-8')
    refuses('elbow', 'predict', tmp_path / 'plan.csv', '--model', tmp_path / 'elbow.yaml')
    refuses('--joint', 'predict', tmp_path / 'plan.csv', '--model', tmp_path / 'model.yaml')
