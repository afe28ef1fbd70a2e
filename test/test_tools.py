# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools: inputs and outputs, `export` to simulators, and `predict` of plans."""

from dataclasses import replace
import json
import os
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

from helpers import ROOT, write
import numpy as np
import pandas
import pytest
import yaml

from friction_comp import __main__ as entry
from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import output_folder, to_json
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Recorded, write_arm
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings.writer import write_samples
from friction_comp.samples import Samples
from friction_comp.statistics import rms
from friction_comp.tools.common import Arguments
from friction_comp.tools.export import loss_of, simulator_joint

GAIN = 5.0
# Steep enough that its smooth sign change does not show in the sweeps.
PLAIN = FrictionModel(
    Drive(0.1, 50.0), Sigmoid(0.2, -0.2, 5000.0, viscous=0.1), joint='elbow', effects=[
        EFFECTS['inertia']({'coefficients': [0.02]}),
        EFFECTS['gravity']({'coefficients': [0.3, 0.0]})])
MODEL = replace(PLAIN, effects=[*PLAIN.effects, EFFECTS['load_torque']({'coefficients': [-0.2]})])
FILE = ROOT / 'config' / 'armin_configuration_1.yaml'
# Stands for an environment in which nothing of ROS 2 is installed.
WITHOUT_ROS = """
import importlib.abc, sys

class Absent(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        first = name.partition('.')[0]
        if first == 'rclpy' or first.endswith(('_msgs', '_srvs', '_interfaces')):
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)

sys.meta_path.insert(0, Absent())
from friction_comp.__main__ import main, run
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.slow
def test_a_closed_pipe_costs_only_printed_text(tmp_path):
    end, begin = os.pipe()
    os.close(end)
    try:
        done = subprocess.run(
            [sys.executable, '-m', 'friction_comp', 'export', FILE, '--to', 'csv', '--output',
             tmp_path / 'friction.csv'], cwd=ROOT, timeout=120, check=False, stdout=begin,
            stderr=subprocess.PIPE)
    finally:
        os.close(begin)
    # As by SIGPIPE: whoever asks may not take work for done of which nobody read the end.
    assert (done.returncode, done.stderr) == (141, b'')
    assert len((tmp_path / 'friction.csv').read_text().splitlines()) > 9


@pytest.mark.parametrize('name', [
    'predict', 'refine', 'evaluate', 'convert', 'reproduce', 'demo'])
def test_an_output_that_cannot_be_written_is_told_before_the_work(name, tmp_path):
    (tmp_path / 'file').write_text('')
    for output in (tmp_path / 'file' / 'below', '/proc/nobody_writes_here/below',
                   tmp_path / ('x' * 300) / 'below'):
        arguments = [] if name in ('reproduce', 'demo') else [str(tmp_path / 'none.mcap')]
        if name in ('predict', 'refine'):
            arguments += ['--model', str(tmp_path / 'none.yaml')]
        with pytest.raises(InputError, match='cannot be written to'):
            entry.tool(name)([*arguments, '--output', str(output)])
    assert [path.name for path in tmp_path.iterdir()] == ['file']


@pytest.mark.slow
@pytest.mark.parametrize('name', ['compensator', 'demo'])
def test_without_ros_it_says_in_a_line_what_is_missing(name):
    done = subprocess.run([sys.executable, '-c', WITHOUT_ROS, name], cwd=ROOT, timeout=60,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 1
    line, = done.stderr.splitlines()
    assert line.startswith(f'{name}: ROS 2 is missing')
    assert 'make setup' in line


@pytest.mark.parametrize(('tool', 'arguments'), [
    ('convert', ['log.csv', '--output', 'log.csv']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'log.csv']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'model.yaml']),
    ('predict', ['log.csv', '--model', 'model.yaml', '--output', 'linked.csv']),
    ('export', ['model.yaml', '--to', 'csv', '--output', './model.yaml'])])
def test_no_output_is_written_over_an_input(tmp_path, monkeypatch, capsys, tool, arguments):
    monkeypatch.chdir(tmp_path)
    time = 0.01 * np.arange(2000)
    np.savetxt('log.csv', np.column_stack([time, np.sin(time), np.cos(time)]), delimiter=',',
               header='t,q,tau', comments='')
    Path('model.yaml').write_bytes(FILE.read_bytes())
    Path('linked.csv').hardlink_to('log.csv')
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert run(tool, arguments) == 2
    assert ('already exists' if tool == 'convert' else 'is the input itself') in (
        capsys.readouterr().err)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.fixture
def swinging(tmp_path):
    """A recording of an elbow, and a model of a wrist."""
    time = np.arange(2000) * 0.01
    write_samples(tmp_path / 'elbow', Samples(
        time=time, position=np.sin(time), current=np.sign(np.cos(time)), joint='elbow'))
    replace(FrictionModel.load(FILE), joint='wrist').save(tmp_path / 'wrist.yaml')
    return tmp_path


@pytest.mark.parametrize(('tool', 'arguments'), [
    *((tool, ['elbow', '--model', 'wrist.yaml']) for tool in ('predict', 'refine')),
    ('export', ['arm.yaml', '--to', 'urdf', '--joint', 'knee']),
    ('excite', ['--model', 'arm.yaml', '--joint', 'knee', '--position', -1, 1, '--velocity', 1,
                '--acceleration', 5])])
def test_a_model_of_another_joint_is_refused(swinging, monkeypatch, refuses, tool, arguments):
    monkeypatch.chdir(swinging)
    write_arm(Path('arm.yaml'), dict.fromkeys(('elbow', 'wrist'), FrictionModel.load(FILE)))
    refuses("arm.yaml: no joint 'knee' in it, but 'elbow', 'wrist'" if 'knee' in arguments else
            "wrist.yaml: is of joint 'wrist', not 'elbow'", tool, *arguments)


def tool():
    """Does things."""


def test_output_appears_only_when_all_is_done(tmp_path):
    def write(text, ending):
        with output_folder(tmp_path / 'a' / 'b') as folder:
            (folder / 'deep').mkdir()
            for name in ('first.txt', 'one.txt')[text == 'whole':]:
                (folder / 'deep' / name).write_text(text)
            assert text != 'whole' or not (tmp_path / 'a' / 'b' / 'deep').exists()
            if ending:
                raise ending

    with pytest.raises(InputError, match='no good'):
        write('half', InputError('no good'))
    assert list(tmp_path.iterdir()) == []
    write('whole', None)
    with pytest.raises(InputError, match='no good'):
        write('half', InputError('no good'))
    one, = (path for path in tmp_path.rglob('*') if path.is_file())
    assert (one.name, one.read_text()) == ('one.txt', 'whole')
    one.unlink()
    one.mkdir()
    (one.parent / 'first.txt').write_text('kept')
    with pytest.raises(InputError, match='one.txt: exists'):
        write('half', None)
    assert (one.parent / 'first.txt').read_text() == 'kept'


def test_arguments_that_are_wrong_take_one_line(capsys):
    def parse(*argv):
        return Arguments(tool).add_recordings().add_output().parse(
            list(argv))

    for argv, words in (
            ((), 'RECORDING'), (('r',), '--output'),
            (('r', '--output', 'o', '--rate', '-3'), 'positive finite number'),
            (('r', '--output', 'o', '--rate', 'x'), 'positive finite number'),
            (('r', '--output', 'o', '--what'), '--what')):
        with pytest.raises(SystemExit) as exit_:
            parse(*argv)
        assert exit_.value.code == 2
        error = capsys.readouterr().err
        assert error.count('\n') == 1
        assert error.startswith('tool: ')
        assert words in error
    arguments = parse('r', 's', '--output', 'o', '--rate', '100', '--ros-args', '-r', 'x:=y')
    assert arguments.recordings == [Path('r'), Path('s')]
    assert arguments.rate == 100.0
    assert arguments.joint is None


def test_json_has_no_values_that_others_cannot_read():
    text = to_json({'a': np.float64('nan'), 'b': np.arange(3), 'c': [np.int8(1), np.bool_(True)],
                    'd': Path('x'), 1: float('inf'), 'τ': 0.5})
    assert json.loads(text) == {
        'version': 1, 'a': None, 'b': [0, 1, 2], 'c': [1, True], 'd': 'x', '1': None, 'τ': 0.5}
    assert 'τ' in text


# Export to simulators, with the error of the simpler model stated.

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
    assert json.loads(content)['inertia'] == pytest.approx(0.02 * GAIN)


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
    model = replace(PLAIN, effects=PLAIN.effects[:1], sigmoid=replace(
        PLAIN.sigmoid, steepness=200.0))
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
                'dynamic_friction': 0.2, 'viscous_friction': 0.1, 'armature': 0.02}
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


# The torque that a planned motion needs.

def needed(q, v, a):
    return GAIN * (0.2 * np.sign(v) + 0.1 * v + 0.02 * a + 0.3 * np.cos(q))


def motion(name='', phase=0.0):
    time = np.arange(0.0, 4.0, 0.01)
    q, v, a = (np.sin(2 * time + phase), 2 * np.cos(2 * time + phase),
               -4 * np.sin(2 * time + phase))
    return time, q, v, a


def predicted(folder, model, **columns):
    """Write a table, and return the one that `predict` makes of it."""
    write(folder / 'plan.csv', **columns)
    assert run('predict', [str(folder / 'plan.csv'), '--model', str(folder / model),
                           '--output', str(folder / 'out.csv')]) == 0
    return pandas.read_csv(folder / 'out.csv')


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
    model = replace(PLAIN, recorded=recorded)
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
    PLAIN.save(tmp_path / 'model.yaml')
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
