# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The written model, its report, and when it is not to be trusted."""


from dataclasses import FrozenInstanceError
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from test_prepare import swings

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Breakaway
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.refinement import judge, Origin, refine
from friction_comp.refinement.dependence import remaining_dependences
from friction_comp.refinement.findings import (
    AGAIN,
    experiment,
    Finding,
    IN_PART,
    in_unit,
    TRUST,
    verdict_of,
)
from friction_comp.refinement.judge import noise_floor
from friction_comp.refinement.prepare import prepare
from friction_comp.samples import JointStates, Samples
from friction_comp.statistics import rms

RAW = {'method': 'zero-phase Butterworth', 'source': 'velocity', 'bandwidth': None}


def with_ripple(seed, lag=0):
    """Return samples whose current holds cogging and comes some samples late."""
    samples = swings(seed)
    current = samples.current + 0.1 * np.cos(14.0 * samples.position)
    samples = samples.with_(current=np.roll(current, lag), acceleration=None)
    return samples.take(slice(20, -20))


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


@pytest.mark.parametrize('level, factor', [(0.4, 1.25), (0.49, 1.0)])
def test_breakaway_of_another_day_changes_with_friction(level, factor):
    """Friction is 0.5 A today: what was 0.4 A then has grown by a quarter, at rest too."""
    then = FrictionModel(Drive(0.1, 100.0), Sigmoid(level, -level, 150.0, 0.0, 0.2),
                         breakaway=Breakaway(0.6, -0.56, 0.03, 0.03))
    result = refine([swings(1)], then)
    both = result.model.breakaway
    assert both.positive_mean == pytest.approx(0.6 * factor, rel=0.02)
    assert both.negative_mean == pytest.approx(-0.56 * factor, rel=0.02)
    assert both.positive_std == pytest.approx(0.03 * factor, rel=0.02)
    said = [one.text for one in result.report.findings if one.code == 'breakaway_taken_along']
    assert len(said) == (factor != 1.0)
    assert result.report.friction.breakaway['positive']['mean'] == both.positive_mean


@pytest.mark.slow
def test_the_model_written_is_the_model_judged_where_other_joints_take_part_late(tmp_path):
    rng = np.random.default_rng(7)
    first, second = swings(8), swings(9)
    q, v = (np.column_stack((getattr(first, name), getattr(second, name)))
            for name in ('position', 'velocity'))
    current = first.current + np.cos(q[:, 0] + q[:, 1]) + 0.01 * rng.standard_normal(len(q))
    samples = first.with_(current=np.roll(current, -8), joint='a', arm=JointStates(
        ('a', 'b'), q, v), acceleration=None).take(slice(20, -20))
    result = refine([samples])
    assert 'other_joints' in {effect.name for effect in result.model.effects}
    assert result.model.differentiation['lag'] == pytest.approx(0.08, abs=0.01)
    result.model.save(tmp_path / 'model.yaml')
    error = samples.current - FrictionModel.load(tmp_path / 'model.yaml').predict(samples)
    assert rms(error[result.usable]) == pytest.approx(
        result.report.after.fit_rmse, rel=1e-6)
    assert rms(error[result.usable]) < 1.3 * result.report.after.held_out_rmse < 0.05


def test_the_error_to_expect_elsewhere_is_not_below_that_of_another_recording():
    result = refine([with_ripple(2)])
    after = result.report.after
    for seed in (3, 4):
        other = with_ripple(seed)
        assert rms(other.current - result.model.predict(other)) < 1.3 * after.elsewhere_rmse
    assert after.elsewhere_rmse < 0.04
    assert max(after.part_rmse) == after.worst_part_rmse >= after.held_out_rmse


def test_a_result_is_complete_when_it_is_made_and_leaves_the_given_model_as_it_is():
    rng = np.random.default_rng(6)
    slow = np.convolve(rng.standard_normal(4100), np.exp(-np.arange(101) / 20.0), 'valid')
    model = FrictionModel(Drive(0.1, 100.0), sigmoid=Sigmoid(0.5, -0.5, 200.0, 0.0, 0.1))
    before = model.to_dict()
    result = refine([swings(6).with_(current=slow[:4000])], model, Drive(0.1, 100.0, 3.0),
                    origin=Origin(warnings=['late'], notes={'refined_from': ['log']}))
    assert model.to_dict() == before
    assert result.model.drive.current_limit == 3.0
    assert result.model.notes == {
        'refined_from': ['log'], 'unit': 'A', 'verdict': result.report.verdict,
        'reasons': result.report.reasons, 'assumed': []}
    assert result.report.warnings[-1] == 'late'
    with pytest.raises(FrozenInstanceError):
        result.report.verdict = 'trust'
    # It goes through a pipe from the process that made it.
    report, refined = pickle.loads(pickle.dumps((result.report, result.model)))
    assert report == result.report
    # It reads like report.json, too.
    assert dict(report) == report.content()
    assert report['after']['held_out_rmse'] == report.after.held_out_rmse
    assert refined.to_dict() == result.model.to_dict()


def test_refinement_of_a_drive_that_nothing_has_measured_starts_from_the_recording():
    samples = swings(6)
    samples = samples.with_(current=0.5 * np.tanh(samples.velocity / 0.01)
                            + 0.01 * np.sin(np.arange(len(samples))))
    drive = FrictionModel(Drive(0.1, 100.0), Sigmoid(0.0, 0.0, 1.0), position_limits=(-1.0, 1.0))
    result = refine([samples], drive)
    plain = refine([samples], drive=Drive(0.1, 100.0))
    assert result.report == plain.report
    assert result.start.to_dict() == plain.start.to_dict()
    assert result.model.position_limits == (-1.0, 1.0)


def test_friction_of_more_than_the_largest_current_is_not_that_of_the_drive():
    numbers = SimpleNamespace(coulomb=2.7, viscous=-280.0, inertia=None, intervals={})
    for largest, found in ((0.012, True), (3.0, False)):
        said = {one.code: one.grade for one in judge.findings_on_numbers(numbers, 0.01, largest)}
        assert said.get('impossible_friction') == (AGAIN if found else None)


def test_a_joint_that_bent_over_a_few_steps_has_not_slid_however_fast_its_steps_come():
    # Seven steps of 0.6 mrad in a tenth of a second each way, as of a torque that bends a gear.
    time = np.arange(0.0, 20.0, 0.001)
    bent = 0.0019 * np.sin(10.0 * time)
    steps = 6.3e-4 * np.round(bent / 6.3e-4)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    report = refine(Samples(time=time, position=steps, current=6.0 * bent + noise)).report
    assert report.verdict == AGAIN
    assert 'hardly_moved' in {one.code for one in report.findings}


def test_a_linear_axis_has_no_weight_once_a_turn():
    samples = swings(6)
    samples = samples.with_(current=samples.current + 0.4 * np.sin(samples.position))
    for unit, found in (('N·m', True), ('N', False)):
        report = refine([samples], unit=unit).report
        assert ('gravity' in {effect.name for effect in report.effects}) == found


def test_a_recording_of_few_rows_is_called_short_and_not_at_rest():
    samples = swings(6)
    moving = np.flatnonzero(np.abs(samples.velocity) > 0.1)
    with pytest.raises(InputError, match='the recordings are short: '):
        refine([samples.take(slice(moving[0], moving[0] + 205))])


@pytest.mark.parametrize('late, said', [
    (5, 'ms later than the position, as after a filter'),
    (20, 'velocity is not the slope of the position')])
def test_a_velocity_that_no_filter_would_delay_so_is_not_called_late(late, said):
    samples = swings(6)
    warnings = refine([samples.with_(velocity=np.roll(samples.velocity, late))]).report.warnings
    assert [said in one for one in warnings if 'it is not used' in one] == [True]


def test_a_current_unrelated_to_the_motion_is_not_trusted():
    samples = swings(6)
    rng = np.random.default_rng(6)
    slow = np.convolve(rng.standard_normal(4100), np.exp(-np.arange(101) / 20.0), 'valid')
    result = refine([samples.with_(current=slow[:4000])])
    report = result.report
    assert report.after.held_out_rmse <= report.before.held_out_rmse
    assert report.verdict == 'record again'
    assert report.record_again
    sigmoid = result.model.sigmoid
    assert sigmoid.upper >= sigmoid.lower
    assert sigmoid.viscous >= 0.0


@pytest.mark.slow
def test_what_is_found_is_the_same_whatever_the_unit_and_the_order():
    parts = with_ripple(10), with_ripple(11)
    first = refine(parts)
    large = refine([part.with_(current=1e3 * part.current) for part in parts[::-1]],
                   origin=Origin('mV'))
    names = [[effect.name for effect in found.report.effects] for found in (first, large)]
    assert names[0] == names[1]
    assert large.report.after.held_out_rmse == pytest.approx(
        1e3 * first.report.after.held_out_rmse, rel=1e-3)
    assert large.report.effects[0].in_words.startswith('Cogging: 100 mV') or (
        ' mV' in large.report.effects[0].in_words)


def test_noise_is_what_changes_from_sample_to_sample():
    rows, _ = prepare(swings(12), Drive(1.0, 1.0), RAW)
    rng = np.random.default_rng(0)
    slow = np.sin(rows.samples.time)
    noise = 0.02 * rng.standard_normal(len(slow))
    assert noise_floor(rows, slow + noise) == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize(('shape', 'expected'), [
    (lambda s: np.sign(np.sin(9.0 * s.position)), 'position'),
    (lambda s: np.where(s.time > 20.0, 1.0, -1.0), 'time'),
    (lambda s: np.abs(s.acceleration), 'acceleration'),
    (lambda s: 0.0 * s.time, None)])
def test_the_residual_is_traced_to_its_variable(shape, expected):
    samples = swings(13)
    moving = samples.take(np.abs(samples.velocity) > 0.02)
    rng = np.random.default_rng(1)
    residual = 0.1 * shape(moving) + 0.02 * rng.standard_normal(len(moving))
    found = [entry.variable for entry in remaining_dependences(moving, residual, 0.02)]
    assert found[:1] == ([expected] if expected else [])


def test_the_worst_finding_gives_the_verdict_and_notes_do_not_lower_it():
    note = Finding('short', 'It is short.')
    part = Finding('coarse', 'It is coarse.', IN_PART, 'use a finer encoder')
    again = Finding('pushes', 'It pushes.', AGAIN, 'check the signs')
    assert verdict_of([]).verdict == verdict_of([note]).verdict == TRUST
    assert verdict_of([note, part]).verdict == IN_PART
    told = verdict_of([note, part, again])
    assert told.verdict == AGAIN
    assert told.reasons == ['It pushes.', 'It is coarse.']
    assert told.record_again == ['check the signs', 'use a finer encoder']
    assert told.warnings == ['It is short.']
    assert [finding.code for finding in told.findings] == ['short', 'coarse', 'pushes']


def test_an_experiment_is_proposed_for_any_two_variables():
    assert 'warm' in experiment('temperature', 'time')
    assert experiment('load', 'history').startswith('record motion in which load changes')


@pytest.mark.parametrize('unit', ['N·m', 'V'])
def test_sentences_have_the_unit_of_the_recording(unit):
    said = in_unit('Spring-like: +3.5 A per rad', unit)
    assert said == f'Spring-like: +3.5 {unit} per rad'
    assert in_unit('A spring of 2 A', 'A') == 'A spring of 2 A'
