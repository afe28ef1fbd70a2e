# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The tools refine and predict from recording to files, on simulated and on measured drives."""

from contextlib import redirect_stdout
import csv
from dataclasses import replace
import json
import re

from helpers import note_model, ROOT, swings
import numpy as np
import pytest
from recording_maker import DATA, needs_data, record_with_diagnostics
from scipy.signal import butter, sosfiltfilt
from table_maker import write

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recorded_drive.refine_recordings import showing_friction
from friction_comp.recordings import read_recording, read_recording_with_info, write_samples
from friction_comp.refinement import refine
from friction_comp.refinement.judge import Finding, verdict_of
from friction_comp.refinement.prepare import moving
from friction_comp.samples import Samples
from friction_comp.statistics import rms
from friction_comp.tools.predict import main as run_predict
from friction_comp.tools.refine import main as run_refine
from simulated_recordings.drives import excitation_for, random_drive, record

LIVE_PAGES = True
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
        samples = record(drive, seed, excitation)[0].samples.with_(joint='elbow')
        write_samples(room / name, samples,
                      drive.model.drive.torque_constant, drive.model.drive.gear_ratio)
    with open(room / 'said.txt', 'w', encoding='utf-8') as said, redirect_stdout(said):
        assert run_refine([
            str(room / 'fit'), '--output', str(room / 'out'),
            '--torque-constant', str(drive.model.drive.torque_constant),
            '--gear-ratio', str(drive.model.drive.gear_ratio)]) == 0
    return room


def table(path):
    with open(path, encoding='utf-8') as stream:
        rows = list(csv.DictReader(stream))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


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
            'worst_part_rmse', 'standstill_rmse', 'overall_rmse', 'elsewhere_rmse',
            'elsewhere_motion_rmse', 'part_rmse'}
    assert [effect['variable'] for effect in report['effects']] == ['position']
    assert report['effects'][0]['held_out_rmse'] < 0.8 * report['before']['held_out_rmse']
    assert report['after']['held_out_rmse'] < 1.3 * drive.noise_floor
    assert report['noise_floor'] == pytest.approx(drive.noise, rel=0.15)
    assert report['unexplained'] == []
    again = verdict_of([Finding(**finding) for finding in report['findings']])
    assert again.verdict == report['verdict']


@pytest.mark.slow
def test_the_page_needs_nothing_from_elsewhere_and_says_what_each_number_is(folder):
    page = (folder / 'out' / 'report.html').read_text()
    assert page.startswith('<!DOCTYPE html>')
    assert page.count('<figcaption>') >= 3
    tags = re.sub(r'(<script[^>]*>).*?</script>', r'\1', page, flags=re.DOTALL)
    assert not re.search(r'\b(src|href)=.?http', tags)

    assert 'A·s/rad' in page
    assert 'coefficient 1' not in page
    # Three seconds at most to open: a page is no larger than three million characters.
    assert len(page) < 3_000_000


@pytest.mark.slow
def test_predict_writes_a_row_for_every_joint_state(folder, drive):
    path = folder / 'predicted.csv'
    assert run_predict([str(folder / 'score'), '--model', str(folder / 'out' / 'model.yaml'),
                        '--output', str(path)]) == 0
    columns = table(path)
    assert list(columns) == ['time', 'measured', 'predicted']
    assert len(columns['time']) == 40.0 * RATE
    assert np.isfinite(columns['predicted']).all()
    assert np.all(np.diff(columns['time']) > 0)
    error = columns['measured'] - columns['predicted']
    assert rms(error) < 1.3 * drive.noise_floor


def test_the_measured_torque_of_a_person_is_added_to_the_motors(drive, tmp_path, capsys):
    """The person carries a third of the friction: the model is not wrong by that third."""
    model = FrictionModel(drive.model.drive, drive.model.sigmoid)
    time = np.arange(0.0, 8.0, 0.004)
    velocity = np.cos(time)
    friction, gain = model.sigmoid(velocity), model.drive.torque_per_current
    samples = Samples(time=time, position=np.sin(time), velocity=velocity, joint='elbow',
                      current=friction * 2.0 / 3.0, load=gain * friction / 3.0)
    np.testing.assert_allclose(model.measured(samples), friction)
    assert model.measured(samples.with_(load=None)) is samples.current
    # A model that says itself what a load does is compared with the motor's current alone.
    own = replace(model, effects=[EFFECTS['load_torque']({'coefficients': [-1.0 / gain]})])
    assert own.measured(samples) is samples.current
    write_samples(tmp_path / 'r', samples, model.drive.torque_constant, model.drive.gear_ratio)
    model.save(tmp_path / 'model.yaml')
    assert run_predict([str(tmp_path / 'r'), '--model', str(tmp_path / 'model.yaml'),
                        '--output', str(tmp_path / 'out.csv')]) == 0
    columns = table(tmp_path / 'out.csv')
    error = columns['measured'] - columns['predicted']
    assert rms(error) < 0.05 * np.abs(friction).max()
    out = capsys.readouterr().out
    assert 'a load was recorded' in out
    assert 'A where the joint moves' in out
    # Without a drive, `refine` fits the effort, and its model says so.
    replace(model, notes={'unit': 'N·m'}).save(tmp_path / 'model.yaml')
    assert run_predict([str(tmp_path / 'r'), '--model', str(tmp_path / 'model.yaml'),
                        '--output', str(tmp_path / 'out.csv')]) == 0
    assert 'N·m where the joint moves' in capsys.readouterr().out


def test_predict_counts_motion_as_refinement_does():
    time = np.arange(0.0, 20.0, 0.005)
    # At full speed, at a thirtieth of it, and at rest.
    speed = np.select([time < 8.0, time < 16.0], [1.0, 1.0 / 30.0])
    samples = Samples(time=time, position=np.cumsum(speed) * 0.005, current=speed)
    moves = moving(samples, note_model())
    # Slow motion next to a rest is presliding.
    for begin, end, share in ((1.0, 7.0, 1.0), (9.0, 15.0, 1.0), (15.93, 15.99, 0.0),
                              (17.0, 19.0, 0.0)):
        assert np.mean(moves[(time > begin) & (time < end)]) == share
    short = Samples(time=time[:100], position=samples.position[:100], current=speed[:100])
    with pytest.raises(InputError, match='are short'):
        moving(short, note_model())


@pytest.mark.slow
def test_a_load_takes_the_current_that_it_takes_where_the_drive_is_unknown(tmp_path):
    """Of a table of current and load, without k_t and n: no coefficient is assumed."""
    samples = swings(3)
    load = 5.0 * np.sin(0.37 * samples.time) + 2.0 * np.sin(1.1 * samples.time)
    write(tmp_path / 'run.csv', time=samples.time, position=samples.position,
          velocity=samples.velocity, current=samples.current - 0.1 * load, load=load)
    assert run_refine([str(tmp_path / 'run.csv'), '--output', str(tmp_path / 'out')]) == 0
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert report['unit'] == 'A'
    assert report['after']['held_out_rmse'] < 0.025
    effect, = report['effects']
    assert effect['parameters']['coefficients'] == pytest.approx([-0.1], rel=0.05)


@pytest.mark.slow
def test_a_person_who_guides_a_motor_that_is_off_shows_friction_but_no_limit(tmp_path, capsys):
    samples = swings(3)
    effort = 1e-3 * np.random.default_rng(3).standard_normal(len(samples))
    write(tmp_path / 'run.csv', time=samples.time, position=samples.position,
          velocity=samples.velocity, effort=effort, load=10.0 * samples.current)
    model = str(tmp_path / 'out' / 'model.yaml')
    assert run_refine([str(tmp_path / 'run.csv'), '--output', str(tmp_path / 'out')]) == 0
    assert re.search(r'compensate +not with this file: .* is more than drive.current_limit of '
                     r'\S+ N·m', capsys.readouterr().out)
    # A constant torque of the motor, which is zero, is no model of friction.
    assert run_predict([str(tmp_path / 'run.csv'), '--model', model,
                        '--output', str(tmp_path / 'out.csv')]) == 0
    assert 'does not hold' not in capsys.readouterr().out


@pytest.mark.slow
def test_bad_input_is_named_and_nothing_is_left(folder, tmp_path):
    with pytest.raises(InputError, match='nowhere'):
        run_refine([str(tmp_path / 'nowhere'), '--output', str(tmp_path / 'out')])
    with pytest.raises(InputError, match='elbow'):
        run_refine([str(folder / 'fit'), '--output', str(tmp_path / 'out'), '--joint', 'knee'])
    assert not (tmp_path / 'out').exists()
    with pytest.raises(InputError, match=r'none\.yaml'):
        run_predict([str(folder / 'score'), '--model', str(tmp_path / 'none.yaml'),
                     '--output', str(tmp_path / 'x.csv')])
    assert not (tmp_path / 'x.csv').exists()


def with_effect(name, coefficients, **parameters):
    effect = EFFECTS[name]({'coefficients': coefficients, **parameters})
    return FrictionModel(
        Drive(0.119, 100.0), Sigmoid(0.12, -0.12, 200.0, viscous=0.05), effects=[effect])


@pytest.mark.parametrize(('model', 'words'), [
    (with_effect('temperature', [0.01, 0.0], reference_temperature=25.0, transition=0.01),
     "'temperature' needs temperature, which"),
    (with_effect('load_friction', [0.02], exponent=1.0, transition=0.01),
     "'load_friction' needs load, which")])
def test_an_initial_effect_whose_signal_is_missing_is_named(model, words):
    with pytest.raises(InputError, match=words):
        refine([swings(1)], model)


def test_load_dependent_friction_of_the_initial_model_is_kept_where_a_person_carries_the_load():
    time = np.arange(0.0, 60.0, 0.005)
    position = 0.5 * np.sin(0.9 * time) + 0.3 * np.sin(2.1 * time)
    velocity, torque = np.gradient(position, time), np.zeros_like(time)
    side, current = np.tanh(velocity / 0.01), 0.06 * np.tanh(velocity / 0.02)
    for _ in range(60):
        torque = 11.9 * ((0.12 + 0.02 * np.abs(torque)) * side + 0.05 * velocity - current)
    noise = np.random.default_rng(0).standard_normal((2, len(time)))
    samples = Samples(time=time, position=position, velocity=None,
                      current=current + 0.002 * noise[0], load=torque + 0.01 * noise[1])
    model = with_effect('load_friction', [0.02], exponent=1.0, transition=0.01)
    names = [effect.name for effect in refine([samples], model).model.effects]
    assert 'load_friction' in names


def test_a_position_that_is_no_number_is_not_predicted_as_zero():
    samples = swings(1)
    position = samples.position.copy()
    position[123] = np.nan
    with pytest.raises(InputError, match='position at 1.23 s is not finite'):
        note_model(1).predict(samples.with_(position=position))


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
    samples = record(drive, 3, excitation_for((), duration=10.0, rate=RATE))[0].samples
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
    with pytest.raises(InputError, match='Record the load'):
        run_refine([str(tmp_path / 'whole'), '--output', str(tmp_path / 'out')])
    assert not (tmp_path / 'out').exists()


def test_one_recording_needs_no_list_and_a_prompt_shows_the_numbers_and_not_the_samples():
    samples = swings(1)
    shown = repr(refine(samples))
    assert shown == repr(refine([samples]))
    assert len(shown) < 400
    assert 'torque = ' in shown
    assert 'N·m RMS on data not fitted' in shown


def scored(name, every=1):
    """Return the error on a measured recording of a model refined from samples of another."""
    fit, score = (read_recording(DATA / name / which, None, 1.0, 1.0)[0]
                  for which in ('fit', 'score'))
    return score.current - refine(
        [fit.take(slice(None, None, every))], drive=Drive(1.0, 1.0)).model.predict(score)


@needs_data
@pytest.mark.slow
def test_harmonic_drive_of_a_ur10e():
    error = scored('ur10e_joint1')
    assert rms(error) < 0.206


@needs_data
@pytest.mark.slow
def test_ball_screw_of_the_emps_benchmark():
    error = scored('emps', 4)
    error = sosfiltfilt(butter(2, 40.0, fs=1000.0, output='sos'), error)
    # Plain least squares with inertia and offset have 3.3 N.
    assert rms(error) < 3.3


def test_the_current_limit_is_the_largest_that_lasted():
    from friction_comp.recorded_drive.given import Given, with_current_limit

    time = np.arange(300) * 0.01
    recorded = Samples(time=time, position=np.sin(time), current=7.25 * np.cos(time))
    recorded.current[[150, 299]] = 200.0, np.nan
    drive, note = with_current_limit(Given(), Drive(1.0, 1.0), [recorded])
    assert drive.current_limit == pytest.approx(7.25, rel=1e-3)
    assert 'current_limit' in note
