# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools refine and predict, and the model that they write and read.

Of recordings and of tables of means, on simulated and on measured drives.
"""

from argparse import Namespace
from contextlib import redirect_stdout
from dataclasses import replace
import json
import re
import sys

from helpers import note_model, ROOT, swings, write
import numpy as np
import pandas
import pytest
from recording_maker import DATA, needs_data, record_with_diagnostics
from scipy.signal import butter, sosfiltfilt

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.identification.curves import fit_steady_states
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import Breakaway
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings.reader import read_recording, read_recording_with_info
from friction_comp.recordings.writer import write_samples
from friction_comp.refinement import refine
from friction_comp.refinement.judge import Finding, verdict_of
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms
from friction_comp.tools.predict import predict as run_predict
from friction_comp.tools.refine import refine as run_refine, showing_friction, with_current_limit
from simulated_recordings import excitation_for, random_drive, record

RATE = 125.0  # Hz


@pytest.fixture(scope='module')
def drive():
    return random_drive(seed=11, cases=('cogging',))


@pytest.fixture(scope='module')
def folder(drive, tmp_path_factory):
    """Return a folder with a recording to fit, one to score, and what refine made of the first."""
    room = tmp_path_factory.mktemp('refine')
    excitation = excitation_for(('cogging',), duration=40.0, rate=RATE)
    for name, seed in (('fit', 5), ('score', 6)):
        samples = record(drive, seed, excitation)[0].with_(joint='elbow')
        write_samples(room / name, samples,
                      drive.model.drive.torque_constant, drive.model.drive.gear_ratio)
    with open(room / 'said.txt', 'w', encoding='utf-8') as said, redirect_stdout(said):
        assert run_refine([
            str(room / 'fit'), '--output', str(room / 'out'),
            '--torque-constant', str(drive.model.drive.torque_constant),
            '--gear-ratio', str(drive.model.drive.gear_ratio)]) == 0
    return room


def report_on(path, output, *more):
    """Return the report that `refine` writes of a file."""
    assert run_refine([str(path), '--output', str(output), *more]) == 0
    return json.loads((output / 'report.json').read_text())


def predicted(recording, model, path):
    """Return the table that `predict` writes."""
    assert run_predict([str(recording), '--model', str(model), '--output', str(path)]) == 0
    return pandas.read_csv(path)


@pytest.mark.slow
def test_report_has_what_is_promised(folder, drive):
    report = json.loads((folder / 'out' / 'report.json').read_text())
    assert report['unit'] == 'A'
    assert report['joint'] == 'elbow'
    assert report['samples'] == 40.0 * RATE
    assert report['held_out']
    for side in ('before', 'after'):
        assert set(report[side]) == {
            'model', 'fit_rmse', 'held_out_rmse', 'held_out_max', 'held_out_r2',
            'worst_part_rmse', 'standstill_rmse', 'elsewhere_rmse', 'elsewhere_motion_rmse'}
    assert [effect['variable'] for effect in report['effects']] == ['position']
    assert report['effects'][0]['held_out_rmse'] < 0.8 * report['before']['held_out_rmse']
    assert report['after']['held_out_rmse'] < 1.3 * drive.noise_floor
    assert report['noise_floor'] == pytest.approx(drive.noise, rel=0.15)
    assert report['unexplained'] == []
    again = verdict_of([Finding(**finding) for finding in report['findings']])
    assert again.verdict == report['verdict']
    page = (folder / 'out' / 'report.html').read_text()
    assert 'A·s/rad' in page
    assert 'coefficient 1' not in page
    # Three seconds at most to open: a page is no larger than three million characters.
    assert len(page) < 3_000_000


@pytest.mark.slow
def test_predict_writes_a_row_for_every_joint_state(folder, drive, tmp_path):
    columns = predicted(folder / 'score', folder / 'out' / 'model.yaml', tmp_path / 'out.csv')
    assert list(columns) == ['time', 'measured', 'predicted']
    assert len(columns['time']) == 40.0 * RATE
    assert np.all(np.diff(columns['time']) > 0)
    assert rms(columns['measured'] - columns['predicted']) < 1.3 * drive.noise_floor


def test_the_measured_torque_of_a_person_is_added_to_the_motors(drive, tmp_path, capsys):
    """The person carries a third of the friction: the model is not wrong by that third."""
    model = FrictionModel(drive.model.drive, drive.model.sigmoid)
    time = np.arange(0.0, 8.0, 0.004)
    velocity = np.cos(time)
    friction, gain = model.sigmoid(velocity), model.drive.torque_per_current
    samples = Samples(time=time, position=np.sin(time), velocity=velocity, joint='elbow',
                      current=friction * 2.0 / 3.0, load=gain * friction / 3.0)
    # A model that says itself what a load does is compared with the motor's current alone.
    own = replace(model, effects=[EFFECTS['load_torque']({'coefficients': [-1.0 / gain]})])
    assert own.measured(samples) is samples.current
    write_samples(tmp_path / 'r', samples, model.drive.torque_constant, model.drive.gear_ratio)
    # Without a drive, `refine` fits the effort, and its model says so.
    for unit in ('A', 'N·m'):
        replace(model, notes={'unit': unit}).save(tmp_path / 'model.yaml')
        columns = predicted(tmp_path / 'r', tmp_path / 'model.yaml', tmp_path / 'out.csv')
        out = capsys.readouterr().out
        assert f'{unit} where the joint moves' in out
        if unit == 'A':
            error = columns['measured'] - columns['predicted']
            assert rms(error) < 0.05 * np.abs(friction).max()
            assert 'a load was recorded' in out


@pytest.mark.slow
@pytest.mark.parametrize('noise', [0.0, 1e-3])
def test_a_person_who_guides_a_motor_that_is_off_shows_friction_but_no_limit(
        tmp_path, capsys, noise):
    samples = swings(3)
    path = write(
        tmp_path / 'run.csv', time=samples.time, position=samples.position,
        velocity=samples.velocity, load=10.0 * samples.current,
        effort=noise * np.random.default_rng(3).standard_normal(len(samples)))
    report = report_on(path, tmp_path / 'out')
    said = capsys.readouterr().out
    assert noise or 'the motor was idle' in said
    assert report['unit'] == 'N·m'
    assert report['friction']['coulomb'] == pytest.approx(5.0, rel=0.03)
    assert report['friction']['viscous'] == pytest.approx(2.0, rel=0.05)
    if noise:
        assert re.search(r'compensate +not with this file: .* is more than drive.current_limit of '
                         r'\S+ N·m', said)
    # A constant torque of the motor, which is zero, is no model of friction.
    predicted(path, tmp_path / 'out' / 'model.yaml', tmp_path / 'out.csv')
    assert 'does not hold' not in capsys.readouterr().out


@pytest.mark.slow
def test_bad_input_is_named_and_nothing_is_left(folder, tmp_path):
    output = ['--output', str(tmp_path / 'out')]
    for tool, arguments, words in (
            (run_refine, [tmp_path / 'nowhere'], 'nowhere'),
            (run_refine, [folder / 'fit', '--joint', 'knee'], 'elbow'),
            (run_predict, [folder / 'score', '--model', tmp_path / 'none.yaml'], r'none\.yaml')):
        with pytest.raises(InputError, match=words):
            tool([*map(str, arguments), *output])
        assert not (tmp_path / 'out').exists()
    samples = swings(1)
    position = samples.position.copy()
    position[123] = np.nan
    with pytest.raises(InputError, match='position at 1.23 s is not finite'):
        note_model(1).predict(samples.with_(position=position))


@pytest.mark.parametrize(('name', 'constants', 'needed'), [
    ('temperature', {'coefficients': [0.01, 0.0], 'reference_temperature': 25.0,
                     'transition': 0.01}, 'temperature'),
    ('load_friction', {'coefficients': [0.02], 'exponent': 1.0, 'transition': 0.01}, 'load')])
def test_an_initial_effect_whose_signal_is_missing_is_named(name, constants, needed):
    model = FrictionModel(Drive(0.119, 100.0), Sigmoid(0.12, -0.12, 200.0, viscous=0.05),
                          effects=[EFFECTS[name](constants)])
    with pytest.raises(InputError, match=f"'{name}' needs {needed}, which"):
        refine([swings(1)], model)


def test_the_effects_hidden_in_an_example_alone_are_found():
    # No effect alone explains much: the weight shows only once the ripple is known.
    model = note_model(1)
    samples = read_recording(
        ROOT / 'examples' / 'elbow' / 'without_direction.mcap.zstd', None,
        model.drive.torque_constant, model.drive.gear_ratio)
    report = refine(samples, model).report
    found = {effect.name: effect for effect in report.effects}
    assert found.keys() >= {'friction_ripple', 'inertia'}
    assert found.keys() & {'gravity', 'spring'}
    waves = [effect.parameters['frequency'] for effect in report.effects
             if effect.name == 'friction_ripple']
    assert min(abs(wave - 24.0) for wave in waves) < 0.2
    assert report.after.held_out_rmse < 1.2 * report.noise_floor


@pytest.mark.parametrize('load', [None, 0.5])
def test_without_the_load_only_what_no_law_drove_shows_friction(drive, tmp_path, load):
    samples = record(drive, 3, excitation_for((), duration=10.0, rate=RATE))[0]
    samples = samples.with_(joint='elbow', time=samples.time - samples.time[0] + 1.0,
                            load=load and np.full(len(samples.time), load))
    for name, changes in (('half', [(0, ('none', '')), (5, ('continuous', 'elbow.yaml'))]),
                          ('whole', [(0, ('continuous', 'elbow.yaml'))])):
        record_with_diagnostics(tmp_path / name, samples, changes)
    half, whole = (read_recording_with_info(tmp_path / name) for name in ('half', 'whole'))
    if load:
        assert showing_friction({'elbow': whole})['elbow'] == whole
        return
    (kept, info), = showing_friction({'elbow': half + whole})['elbow']
    assert 3.0 < kept.time[-1] < 6.0
    assert 'does not show the friction' in info.notes[-1]
    with pytest.raises(InputError, match='whole: .*Record the load'):
        showing_friction({'elbow': whole})
    # Joints of an arm keep the same recordings, also where only one lacks its load.
    loaded = [(part.with_(load=np.zeros(len(part))), info) for part, info in half + whole]
    arm = showing_friction({'shoulder': loaded, 'elbow': half + whole})
    assert [len(part) for part, _ in arm['shoulder']] == [len(part) for part, _ in arm['elbow']]


def test_one_recording_needs_no_list_and_a_prompt_shows_the_numbers_and_not_the_samples():
    samples = swings(1)
    shown = repr(refine(samples))
    assert shown == repr(refine([samples]))
    assert len(shown) < 400
    assert 'N·m RMS on data not fitted' in shown


@needs_data
@pytest.mark.slow
@pytest.mark.parametrize(('name', 'every', 'least'), [
    ('ur10e_joint1', 1, 0.206),
    # Plain least squares with inertia and offset have 3.3 N.
    ('emps', 4, 3.3)])
def test_harmonic_drive_of_a_ur10e_and_ball_screw_of_the_emps_benchmark(name, every, least):
    fit, score = (read_recording(DATA / name / which, None, 1.0, 1.0)[0]
                  for which in ('fit', 'score'))
    error = score.current - refine(
        [fit.take(slice(None, None, every))], drive=Drive(1.0, 1.0)).model.predict(score)
    if name == 'emps':
        error = sosfiltfilt(butter(2, 40.0, fs=1000.0, output='sos'), error)
    assert rms(error) < least


def test_the_current_limit_is_the_largest_that_lasted():
    time = np.arange(300) * 0.01
    recorded = Samples(time=time, position=np.sin(time), current=7.25 * np.cos(time))
    recorded.current[[150, 299]] = 200.0, np.nan
    drive, note = with_current_limit(Namespace(model=None), Drive(1.0, 1.0), [recorded])
    assert drive.current_limit == pytest.approx(7.25, rel=1e-3)
    assert 'current_limit' in note


# The written model.

def with_ripple(seed, lag=0):
    """Return samples whose current holds cogging and comes some samples late."""
    samples = swings(seed)
    current = samples.current + 0.1 * np.cos(14.0 * samples.position)
    samples = samples.with_(current=np.roll(current, lag), acceleration=None)
    return samples.take(slice(20, -20))


@pytest.mark.parametrize('case', ['plain', 'late', 'given', 'carried'])
def test_the_model_written_is_the_model_judged(case, tmp_path):
    """By the file, on the raw recording: its error is the one that the report gives."""
    samples, model, drive = with_ripple(1), None, None
    if case == 'late':
        samples = with_ripple(1, lag=-6)
    if case == 'given':
        model = FrictionModel(Drive(0.1, 100.0), Sigmoid(0.4, -0.45, 150.0, 0.0, 0.1),
                              effects=[EFFECTS['gravity']({'coefficients': [0.1, 0.0]})])
    if case == 'carried':
        drive = Drive(0.1, 100.0)
        samples = samples.with_(current=0.6 * samples.current,
                                load=0.4 * samples.current * drive.torque_per_current)
    result = refine([samples], model, drive)
    result.model.save(tmp_path / 'model.yaml')
    written = FrictionModel.load(tmp_path / 'model.yaml')
    error = samples.current - written.predict(samples, same_recording=True)
    after = result.report.after
    assert rms(error[result.usable]) == pytest.approx(after.fit_rmse, rel=1e-6)
    assert after.fit_rmse < 0.025
    assert after.fit_rmse == pytest.approx(after.held_out_rmse, rel=0.1)
    assert (written.differentiation.get('lag') is not None) == (case == 'late')


@pytest.mark.parametrize('scale', [0.0, 1.0])
def test_a_weight_that_the_urdf_lacks_stays_beside_friction_by_the_links_load(scale):
    """A name must not change what the model predicts; `scale` is that of the URDF's torque."""
    samples = swings(2)
    links = 0.3 * np.cos(samples.position - 1.2) + 1e-3
    weight = 0.6 * np.cos(samples.position)
    current = samples.current + weight + scale * links + (
        0.15 * np.abs(links) * np.sign(samples.velocity))
    report = refine([samples.with_(current=current, rigid_body=links)]).report
    assert report.after.held_out_rmse < 1.2 * 0.02
    assert 'gravity' in {effect.name for effect in report.effects}


@pytest.mark.parametrize('level, factor', [(0.4, 1.25), (0.49, 1.0)])
def test_breakaway_of_another_day_changes_with_friction(level, factor):
    """Friction is 0.5 A today: what was 0.4 A then has grown by a quarter, at rest too."""
    then = FrictionModel(Drive(0.1, 100.0), Sigmoid(level, -level, 150.0, 0.0, 0.2),
                         breakaway=Breakaway(0.6, -0.56, 0.03, 0.03))
    result = refine([swings(1)], then)
    both = result.model.breakaway
    assert (both.positive_mean, both.negative_mean, both.positive_std) == pytest.approx(
        (0.6 * factor, -0.56 * factor, 0.03 * factor), rel=0.02)
    said = [one.text for one in result.report.findings if 'Breakaway friction' in one.text]
    assert len(said) == (factor != 1.0)
    assert result.report.friction.breakaway['positive']['mean'] == both.positive_mean


def test_a_linear_axis_has_no_weight_once_a_turn():
    samples = swings(6)
    samples = samples.with_(current=samples.current + 0.4 * np.sin(samples.position))
    for unit, found in (('N·m', True), ('N', False)):
        report = refine([samples], unit=unit).report
        assert ('gravity' in {effect.name for effect in report.effects}) == found


# Tables of means at constant speeds.

def sliding(speed, offset=0.0, height=0.0):
    return (offset + 0.52 * speed + np.sign(speed) * (
        0.57 + height * np.exp(-np.abs(speed) / 0.1)))


SPEEDS = np.array([0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.6])
BOTH = np.concatenate((-SPEEDS, SPEEDS))


def fit_of(currents):
    return fit_steady_states(BOTH, currents, Drive(1.0, 1.0))


def test_a_table_of_steady_states_gives_the_friction_with_intervals():
    inside = total = alarms = 0
    for seed in range(20):
        noise = 0.005 * np.random.default_rng(seed).normal(size=len(BOTH))
        fit = fit_of(sliding(BOTH, offset=0.05) + noise)
        for name, truth in (('coulomb', 0.57), ('viscous', 0.52), ('offset', 0.05)):
            total += 1
            inside += fit.intervals[name][0] <= truth <= fit.intervals[name][1]
        alarms += fit.is_curved
        # Viscous friction of a lubricant that thins with the speed is not simply trusted.
        assert fit_of(0.57 * np.sign(BOTH) + 0.3 * np.arcsinh(BOTH / 0.1) + 2.0 * noise).is_curved
    assert inside >= 0.85 * total       # 95 % less what choosing among curves costs
    assert alarms <= 2
    fit = fit_of(sliding(BOTH, height=0.3) + noise)
    assert fit.values['stribeck'] == pytest.approx(0.3, abs=0.05)
    assert fit.values['stribeck_speed'] == pytest.approx(0.1, rel=0.2)
    assert fit.left_out_rmse < 0.5 * fit.plain_rmse
    curve = fit.model.current(Samples(BOTH, BOTH, BOTH, velocity=BOTH))
    assert curve == pytest.approx(sliding(BOTH, height=0.3), abs=0.02)
    skewed = fit_of(sliding(BOTH) + 0.1 * np.abs(BOTH) + noise)
    assert skewed.values['viscous_asymmetry'] == pytest.approx(0.1, abs=0.02)


def test_refine_reads_a_table_of_steady_states(tmp_path, capsys):
    path = write(tmp_path / 'table.csv', velocity=1e3 * BOTH, torque=sliding(BOTH))
    output = tmp_path / 'out'
    report = report_on(path, output, '--unit', 'velocity=mm/s,effort=N')
    said = capsys.readouterr().out
    assert '0.5700 N ' in said
    assert '0.5200 N·s/m' in said
    assert 'rad' not in said
    page = (output / 'report.html').read_text()
    assert '0.5700 N<' in page
    assert 'N·m' not in page
    assert report['friction']['coulomb'] == pytest.approx(0.57, abs=1e-6)
    model = FrictionModel.load(output / 'model.yaml')
    assert model.lookup_table['currents'] == pytest.approx(sliding(np.sort(BOTH)).tolist())
    # One direction cannot tell Coulomb friction from an offset; too few rows are refused.
    report_on(write(path, velocity=SPEEDS, torque=sliding(SPEEDS)), output)
    assert 'in one direction only' in capsys.readouterr().out
    write(path, velocity=SPEEDS[:3], torque=sliding(SPEEDS[:3]))
    with pytest.raises(InputError):
        run_refine([str(path), '--output', str(output)])


@pytest.mark.parametrize(('sign', 'unit', 'words'), [
    (1.0, '', 'TRUST: '), (-1.0, '', 'RECORD AGAIN: '), (1.0, ' [%]', ' 8.000 % ')])
def test_friction_that_would_push_is_not_trusted_in_means_either(
        tmp_path, capsys, sign, unit, words):
    """And per cent stay so."""
    speed = 9.0 * np.concatenate((-np.linspace(0.2, 3.0, 6), np.linspace(0.2, 3.0, 6)))
    report_on(write(tmp_path / 'means.csv', **{
        'motor_speed': speed,
        f'motor_torque{unit}': sign * (8.0 * np.sign(speed) + 0.03 * speed)}), tmp_path / 'out')
    said = capsys.readouterr().out
    assert words in said
    assert ('would have to push' in said) == (sign < 0.0)


def drives_of_many_kinds():
    """Yield recordings of drives with one effect each, and of an arm of two joints."""
    plain, other = swings(1, 20.0), swings(2, 20.0, frequencies=(0.13, 0.31, 0.57))
    time, q, v = plain.time, plain.position, plain.velocity
    heat = 25.0 + 10.0 * (1.0 - np.exp(-time / 8.0))
    for more, signals in (
            (0.0, {}), (1.5 * np.sin(q), {}), (0.8 * q, {}), (0.1 * np.cos(40.0 * q), {}),
            (0.2 * np.tanh(v / 0.01) * np.exp(-np.abs(v) / 0.1), {}), (0.1 * np.abs(v), {}),
            (0.01 * (35.0 - heat) * np.tanh(v / 0.01), {'temperature': heat}),
            (0.6 * np.cos(q + other.position), {'joint': 'lift', 'arm': JointStates(
                ('lift', 'bend'), np.column_stack((q, other.position)))})):
        yield plain.with_(current=plain.current + more, acceleration=None, **signals)


@pytest.mark.parametrize('recorded', drives_of_many_kinds())
def test_names_change_nothing_in_what_a_model_predicts(recorded, monkeypatch):
    """Neither in the recorded motion nor in a wider one."""
    wider = recorded.with_(position=2.0 * recorded.position, velocity=2.0 * recorded.velocity)
    module, predicted = sys.modules['friction_comp.refinement.refine'], []
    for rivals in ([], ['other_joints', 'bump'], ['hysteresis']):
        monkeypatch.setattr(module, 'rivals_of', lambda fit, rivals=rivals: {
            term: list(rivals) for term in fit.terms})
        model = refine([recorded]).model
        predicted.append([model.predict(samples) for samples in (recorded, wider)])
    assert np.array_equal(predicted[0], predicted[1])
    assert np.array_equal(predicted[0], predicted[2])
