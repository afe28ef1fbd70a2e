# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Conditions are distinguished and compared within recordings, between them and over weeks."""

from dataclasses import replace
from datetime import datetime
from functools import partial
import json
import time

from helpers import note_model
import numpy as np
import pytest
from recording_maker import record_with_diagnostics, STORE
from test_evaluate import PERIOD, REST, trial as made_trial

from friction_comp.__main__ import run
from friction_comp.errors import InputError
from friction_comp.evaluation.conditions import evaluate, evaluate_recordings
from friction_comp.model.model_file import write_arm
from friction_comp.recordings import read_recording_with_info, RecordingInfo, write_samples
from friction_comp.recordings.activity import Activity
from friction_comp.reports.evaluation_words import remarks, verdict

# 50 Hz is enough for tests that need no accuracy of a per mil.
STEP = 2e-2
trial = partial(made_trial, step=STEP)


def info_of(activity=()):
    return RecordingInfo('trial', 'elbow', start=1.0, activity=[
        (since, Activity(0, 'active', law, name, settings=', '.join(settings)))
        for since, law, name, *settings in activity])


LAW, KINETIC = (info_of(activity=[(0.0, law, 'a.yaml')]) for law in ('continuous', 'kinetic'))


def both(heights, seed=0):
    """Make a trial whose peaks, two a repetition, differ a little."""
    random = np.random.default_rng(seed)
    peaks = [height * (1.0 + 0.05 * random.normal()) for height in heights]
    return trial(peaks, directions=[1, -1] * (len(heights) // 2))


def test_laws_models_and_settings_are_never_averaged():
    recordings = [both([1.0] * 6), both([0.5] * 6, 1), both([0.3] * 6, 2), both([0.7] * 6, 3)]
    about = [info_of(activity=[(0.0, 'paper', 'a.yaml')]),
             info_of(activity=[(0.0, 'continuous', 'a.yaml')]),
             info_of(activity=[(0.0, 'continuous', 'b.yaml')]),
             info_of(activity=[(0.0, 'continuous', 'a.yaml', 'breakaway_gain 0.5')])]
    evaluation = evaluate(recordings, about=about)
    found = {evaluation.label(c.compensation): round(c.peak_torque, 1)
             for c in evaluation.conditions if c.movement == 'positive'}
    assert found == {
        'd = ±1 · paper · a.yaml': 1.0, 'd = ±1 · continuous · a.yaml': 0.5,
        'd = ±1 · continuous · b.yaml': 0.3,
        'd = ±1 · continuous, breakaway_gain 0.5 · a.yaml': 0.7}
    # Without a condition d = 0 there is no statement about an improvement over it.
    assert evaluation.reduction('peak_torque') is None
    differences = {(c.first.label, c.second.label): c
                   for c in evaluation.comparisons if c.figure == 'peak_torque'}
    # One difference at a time: another model, law or setting, and never two of them.
    plain, *others = (f'd = ±1 · {law}' for law in (
        'continuous · a.yaml', 'continuous, breakaway_gain 0.5 · a.yaml', 'continuous · b.yaml',
        'paper · a.yaml'))
    assert set(differences) == {(plain, other) for other in others}
    for comparison in differences.values():
        assert comparison.pairs == 6
        assert comparison.without_drift.low <= comparison.without_drift.mean


def test_what_changes_within_a_recording_is_told_apart():
    samples = both([1.0] * 4 + [0.4] * 4)
    change = 4 * PERIOD + 0.5 * REST
    about = info_of(activity=[(0.0, 'paper', 'a.yaml'), (change, 'continuous', 'a.yaml')])
    conditions = evaluate([samples], about=[about]).conditions
    assert {(c.compensation.law, c.movement, c.repetitions) for c in conditions} == {
        (law, way, 2) for law in ('paper', 'continuous') for way in ('positive', 'negative')}
    # A command of zero counts as no compensation, whatever was active.
    off = samples.with_(command=np.where(samples.time < change, 0.0, 0.1))
    conditions = evaluate([off], about=[about]).conditions
    assert {c.compensation.law for c in conditions} == {'none', 'continuous'}
    # A command while the compensator was inactive came from another node.
    other = RecordingInfo('trial', 'elbow', activity=[(0.0, Activity(0, 'inactive', '', ''))])
    assert {c.compensation.law for c in evaluate(
        [samples.with_(command=np.ones(len(samples)))], about=[other]).conditions} == {'other'}


def test_the_verdict_compares_with_the_least_help_there_is():
    plain, helped = trial([1.0] * 4), both([0.4] * 4)
    for other, samples in ((KINETIC, plain), (KINETIC, both([1.0] * 4)), (
            info_of(), plain.with_(command=np.zeros(len(plain))))):
        evaluation = evaluate([samples, helped], about=[other, LAW])
        first, second = evaluation.pair()
        assert second.law == 'continuous'
        assert first.law == ('kinetic' if other is KINETIC else 'none')
        assert evaluation.reduction('peak_torque') == pytest.approx(0.6, abs=0.05)


def test_the_verdict_says_what_was_compared_and_how_sure_it_is():
    evaluation = evaluate([both([1.0] * 10), both([0.4] * 10)], about=[KINETIC, LAW])
    words = verdict(evaluation)
    assert 'knows the direction (continuous)' in words
    assert 'does not (kinetic): **' in words
    assert 'One was recorded after the other' in words
    test, = (c for c in evaluation.comparisons if c.figure == 'peak_torque')
    assert (test.first.law, test.second.law) == ('kinetic', 'continuous')
    two = evaluate([both([1.0] * 10), both([0.4] * 10)], about=[
        info_of(activity=[(0.0, 'kinetic', 'b.yaml')]), LAW])
    assert 'b.yaml' in verdict(two)


def test_a_joint_that_stuck_took_more_than_was_given():
    stuck = both([1.0] * 10)
    stuck = stuck.with_(position=np.zeros(len(stuck)))
    evaluation = evaluate([stuck, both([0.4] * 10)], about=[KINETIC, LAW])
    assert evaluation.is_bound
    # The command to a joint at rest is zero although the law is active.
    idle = evaluate([stuck.with_(command=np.zeros(len(stuck)))], about=[KINETIC])
    assert {c.compensation.law for c in idle.conditions} == {'kinetic'}
    words = verdict(evaluation)
    assert 'and more than **' in words
    assert 'at least **' in words
    assert remarks(evaluation) == [
        'With d = ±1 · kinetic the joint did not move in 10 of 10 movements.']
    other = evaluate([both([1.0] * 10), stuck], about=[KINETIC, LAW])
    assert not other.is_bound
    # The second torque may be more than the bound.
    words = verdict(other)
    assert ('at most **' if other.reduction('peak_torque') >= 0.0 else 'at least **') in words
    neither = evaluate([stuck, stuck.with_(load=0.5 * stuck.load)], about=[KINETIC, LAW])
    words = verdict(neither)
    assert 'less**, of torques that did not always suffice' in words
    assert 'at least' not in words
    assert 'at most' not in words


def test_without_a_torque_sensor_motion_and_current_still_speak():
    # The joint follows the reference, announced 0.5 s ahead, by a tenth of a second.
    samples = trial([1.0] * 8, directions=[1, -1] * 4)
    late = np.interp(samples.time - 0.1, samples.time, samples.position)
    evaluation = evaluate([samples.with_(load=None, position=late,
                                         current=np.full(len(samples), 0.3))])
    assert not evaluation.measured
    assert any('no interaction_wrench' in note for note in evaluation.notes)
    for condition in evaluation.conditions:
        assert np.isnan(condition.peak_torque)
        assert 'peak_torque' not in condition.figures
        # It counts as started after a hundredth of the distance.
        assert condition.figures['onset'].mean == pytest.approx(0.25, abs=0.06)


def test_an_afternoon_is_one_day_in_the_laboratory_whatever_its_date_in_greenwich(monkeypatch):
    monkeypatch.setenv('TZ', 'America/Los_Angeles')
    time.tzset()
    # 15:50 and 16:10 there, around midnight in Greenwich.
    about = [replace(LAW, start=datetime.fromisoformat(f'2026-03-02T{at}-08:00').timestamp())
             for at in ('15:50', '16:10')]
    evaluation = evaluate([both([1.0] * 4), both([1.0] * 4, 1)], about=about)
    monkeypatch.undo()
    time.tzset()
    assert {r.day for r in evaluation.repetitions} == {'2026-03-02'}


def test_each_joint_is_evaluated_and_compared_with_its_own_model(tmp_path, capsys):
    joints = [trial([peak] * 4).with_(joint=joint)
              for joint, peak in (('elbow', 1.0), ('wrist', 0.5), ('grip', 1.0))]
    write_samples(tmp_path / 'r', joints)
    models = {joint: replace(note_model(number), joint=joint)
              for joint, number in (('elbow', 1), ('wrist', 2))}
    write_arm(tmp_path / 'arm.yaml', models)
    assert run('evaluate', [str(tmp_path / 'r'), '--model', str(tmp_path / 'arm.yaml'),
                            '--output', str(tmp_path / 'out')]) == 0
    assert 'left out: ' in capsys.readouterr().out
    report = json.loads((tmp_path / 'out' / 'report.json').read_text())
    assert {one['joint']: round(one['conditions'][0]['peak_torque'], 2)
            for one in report['joints']} == {'elbow': 1.0, 'wrist': 0.5}
    elbow, wrist = (one['conditions'][0]['figures']['residual_current']['mean']
                    for one in report['joints'])
    assert elbow != wrist


def test_the_compensators_diagnostics_determine_the_condition(tmp_path):
    record_with_diagnostics(tmp_path / 'r', both([1.0] * 4 + [0.4] * 4), [
        (0, ('paper', 'old.yaml')), (round(4 * PERIOD + 0.5), ('continuous', 'new.yaml'))])
    evaluation, = evaluate_recordings([tmp_path / 'r'])
    assert {(c.compensation.law, c.compensation.model, c.repetitions)
            for c in evaluation.conditions} == {
        ('paper', 'old.yaml', 2), ('continuous', 'new.yaml', 2)}


def phase(message):
    """Make of a compensator's word one of identification that moves the joint."""
    status = message.status[0]
    status.name, status.message = 'arm/identification: identification', 'identifies elbow'
    status.values = [STORE.types['diagnostic_msgs/msg/KeyValue']('phase', 'velocities')]


@pytest.mark.parametrize(('since', 'change', 'from_start'), [
    (3, lambda message: None, True), (12, lambda message: None, False), (3, phase, False)])
def test_a_compensators_first_report_also_applies_to_the_time_just_before(
        tmp_path, since, change, from_start):
    record_with_diagnostics(
        tmp_path / 'r', both([1.0] * 4), [(since, ('continuous', 'a.yaml'))], change)
    (_, info), = read_recording_with_info([tmp_path / 'r'], 'elbow')
    assert info.activity[0][0] == pytest.approx(0.0 if from_start else since, abs=0.1)


def test_what_identification_moved_is_left_out(tmp_path):
    record_with_diagnostics(tmp_path / 'moved', both([1.0] * 4), [(0, ('', ''))], phase)
    write_samples(tmp_path / 'pushed', both([0.4] * 4))
    evaluation, = evaluate_recordings([tmp_path / 'moved', tmp_path / 'pushed'])
    assert {c.compensation.law for c in evaluation.conditions} == {''}
    assert sum(c.repetitions for c in evaluation.conditions) == 4
    assert any('4 movements made by identification: left out' in note for note in evaluation.notes)
    alone, = evaluate_recordings([tmp_path / 'moved'])
    assert {c.compensation.law for c in alone.conditions} == {'identification'}


def test_one_bad_recording_alone_is_an_error(tmp_path):
    (tmp_path / 'broken.mcap').write_bytes(b'no recording')
    with pytest.raises(InputError, match=r'broken\.mcap'):
        evaluate_recordings([tmp_path / 'broken.mcap'])
