# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Averages of a drive's recordings are stored beside its model, and shown over months."""

from dataclasses import replace
import json
from pathlib import Path

from hypothesis import given, strategies as st
import numpy as np
import pytest
from report_pages import assert_documented
from table_maker import write

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.evaluation.drive_history import recorded_friction
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import Recorded
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings import RecordingInfo
from friction_comp.recordings.history import History, KEPT
from friction_comp.samples import Samples

MODEL = FrictionModel(drive=Drive(0.1, 100.0, 4000), joint='elbow',
                      sigmoid=Sigmoid(0.2, -0.2, 400.0, viscous=0.05))
JANUARY, MARCH = 1.7685e9, 1.7736e9


def recording(level, seed=0, seconds=30.0, rate=200.0):
    """A joint that swings, with so many times the model's friction."""
    time = np.arange(round(seconds * rate)) / rate
    position = 0.4 * np.sin(1.7 * time) + 0.3 * np.sin(0.61 * time + 1.0)
    samples = Samples(time=time, position=position, current=np.zeros(len(time)), joint='elbow')
    noise = np.random.default_rng(seed).normal(0.0, 0.01, len(time))
    return samples.with_(current=level * MODEL.predict(samples) + noise)


def info(name, start):
    return RecordingInfo(Path(name), joint='elbow', start=start)


def test_what_is_kept_comes_back_and_no_recording_comes_twice(tmp_path):
    history = History.beside(tmp_path / 'model.yaml', MODEL.drive)
    assert history.add(recording(1.0, rate=1000.0), info('a', MARCH))
    assert history.add(recording(1.2), info('b', JANUARY))
    assert not history.add(recording(1.0), info('a', MARCH))
    history.note('new grease')
    history.save(tmp_path / 'model.yaml')
    back = History.beside(tmp_path / 'model.yaml', MODEL.drive)
    assert [(one.name, one.start, one.samples.joint) for one in back.recordings] == [
        ('b', JANUARY, 'elbow'), ('a', MARCH, 'elbow')]
    assert back.notes == history.notes
    for before, after in zip(history.samples(), back.samples()):
        np.testing.assert_array_equal(before.position, after.position)
        np.testing.assert_array_equal(before.recording, after.recording)
        assert after.sample_time == pytest.approx(0.01)


def test_without_a_date_the_content_tells_recordings_of_one_name_apart():
    history, again, other = History(10.0), info('log.csv', 0.0), info('log.csv', 0.0)
    assert history.add(recording(1.0), info('log.csv', 0.0))
    assert not history.add(recording(1.0), again)
    assert again.notes == ['already in the history: not added again']
    assert history.add(recording(1.1), other)
    assert not other.notes


def test_an_hour_takes_no_more_room_than_minutes():
    history = History(10.0)
    history.add(recording(1.0, seconds=3600.0), info('long', 0.0))
    assert len(history.recordings[0].samples) < 1.2 * KEPT
    # The pieces are spread over the whole hour.
    assert np.ptp(history.recordings[0].samples.time) > 3400.0


def test_friction_that_changed_is_seen_beside_the_model():
    history = History(10.0)
    for level, start in ((1.0, JANUARY), (0.8, MARCH)):
        history.add(recording(level), info(str(level), start))
    first, last = recorded_friction(history, MODEL)
    assert (first.day[:7], last.day[:7]) == ('2026-01', '2026-03')
    for one, level in ((first, 1.0), (last, 0.8)):
        assert one.level == pytest.approx(level, abs=max(0.01, 4.0 * one.level_error))
        assert one.level_error < 0.02


@given(st.floats(0.5, 1.6), st.floats(-0.3, 0.3), st.floats(0.0, 0.5), st.floats(-3.0, 3.0),
       st.integers(0, 99))
def test_neither_an_offset_nor_a_weight_is_friction(level, offset, weight, angle, seed):
    drive = recording(level, seed)
    history = History(10.0)
    history.add(drive.with_(current=drive.current + offset + weight * np.cos(
        drive.position - angle)), info('a', MARCH))
    one, = recorded_friction(history, MODEL)
    assert one.level == pytest.approx(level, abs=max(0.01, 4.0 * one.level_error))
    assert one.level_error < 0.02
    assert not one.one_way


def test_friction_that_an_effect_holds_counts_as_well():
    # Half of the friction is an effect's, as of gears whose teeth are loaded by a weight.
    half = replace(MODEL, sigmoid=Sigmoid(0.1, -0.1, 400.0, viscous=0.05), effects=[
        EFFECTS['hysteresis']({'distance': 0.001, 'exponent': 1.0, 'transition': 0.01,
                               'coefficients': [0.1, 0.0]})])
    history = History(10.0)
    history.add(recording(1.4), info('a', MARCH))
    one, = recorded_friction(history, half)
    assert one.level == pytest.approx(1.4, abs=0.03)


def test_a_model_that_is_uncertain_makes_the_level_uncertain():
    history = History(10.0)
    history.add(recording(1.1), info('a', MARCH))
    models = [replace(MODEL, recorded=known) for known in (
        Recorded(), Recorded(error=0.03), Recorded(
            speeds=(0.1, 0.2), error=0.0, intervals={'viscous': (-0.1, 0.2)}))]
    errors = [recorded_friction(history, model)[0].level_error for model in models]
    assert errors[0] < 0.01
    # Twice the standard error is what such an error may look like, of friction of 0.23 A.
    assert 2.0 * errors[1] == pytest.approx(0.03 / 0.23, rel=0.2)
    assert errors[2] > 0.03


@pytest.mark.parametrize(('content', 'word'), [
    (b'', 'not the history'), (b'PK\x03\x04 and then nothing', 'not the history'), (None, 'N·m/A')])
def test_what_is_no_history_of_the_drive_is_refused_by_name(tmp_path, content, word):
    path = History.path_of(tmp_path / 'model.yaml')
    if content is None:
        History(7.0, []).save(tmp_path / 'model.yaml')
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=word) as error:
        History.beside(tmp_path / 'model.yaml', MODEL.drive)
    assert path.name in str(error.value)
    assert '\n' not in str(error.value)


def test_the_history_of_another_joint_is_refused(tmp_path):
    history = History(10.0)
    history.add(recording(1.0), info('a', MARCH))
    history.save(tmp_path / 'model.yaml')
    with pytest.raises(InputError, match="history.npz: is of joint 'elbow', not 'wrist'"):
        History.beside(tmp_path / 'model.yaml', MODEL.drive, 'wrist')
    assert History.beside(tmp_path / 'model.yaml', MODEL.drive, '').recordings


@pytest.mark.slow
def test_months_of_recordings_give_one_model_and_one_page(tmp_path, capsys):
    MODEL.save(tmp_path / 'model.yaml')
    before = tmp_path / 'model.yaml'
    for k, start in enumerate((JANUARY, MARCH)):
        samples = recording(1.0 - 0.2 * k, seed=k)
        write(tmp_path / f'{k}.csv', time=samples.time + start, position=samples.position,
              effort=samples.current)
        after = tmp_path / f'next_{k}' / 'model.yaml'
        assert run('refine', [str(tmp_path / f'{k}.csv'), '--unit', 'effort=A', '--model',
                              str(before), '--history', '--output', str(after.parent)]) == 0
        before = after
    kept = History.beside(before, MODEL.drive)
    assert [one.name for one in kept.recordings] == ['0.csv', '1.csv']
    # Not in place: the model that was started from keeps its own.
    assert len(History.beside(tmp_path / 'next_0' / 'model.yaml', MODEL.drive).recordings) == 1
    # Beside the first model both are judged alike.
    kept.save(tmp_path / 'model.yaml')
    capsys.readouterr()
    assert run('history', [str(tmp_path / 'model.yaml'), '--note', 'new grease', '--output',
                           str(tmp_path / 'page')]) == 0
    assert '% of the model' in capsys.readouterr().out
    found = json.loads((tmp_path / 'page' / 'report.json').read_text(encoding='utf-8'))
    assert_documented(found, 'history')
    assert [round(one['level'], 1) for one in found['recordings']] == [1.0, 0.8]
    assert found['notes'][0]['text'] == 'new grease'
    page = (tmp_path / 'page' / 'report.html').read_text(encoding='utf-8')
    assert 'new grease' in page
    assert '<svg' in page


@pytest.mark.parametrize('error', [None, 1.0])
def test_the_ranges_of_an_export_hold_what_the_history_shows(tmp_path, error):
    replace(MODEL, recorded=Recorded(error=error)).save(tmp_path / 'model.yaml')
    history = History(10.0)
    for level, start in ((1.0, JANUARY), (0.8, MARCH)):
        history.add(recording(level), info(str(level), start))
    history.save(tmp_path / 'model.yaml')
    assert run('export', [str(tmp_path / 'model.yaml'), '--to', 'json', '--history', '--output',
                          str(tmp_path / 'joint.json')]) == 0
    joint = json.loads((tmp_path / 'joint.json').read_text(encoding='utf-8'))
    low, high = joint['range']['coulomb']
    # An uncertain model makes the range wide, but no simulator takes a friction below zero.
    assert (low == 0.0) == bool(error)
    assert low < 0.81 * joint['coulomb'] < 1.0 * joint['coulomb'] <= high
    if not error:
        assert low > 0.75 * joint['coulomb']
        assert high < 1.05 * joint['coulomb']


def test_errors_have_the_unit_of_the_model(tmp_path, capsys):
    in_torque = replace(MODEL, notes={'unit': 'N·m'})
    in_torque.save(tmp_path / 'model.yaml')
    history = History(10.0)
    history.add(recording(1.0), info('a', MARCH))
    history.save(tmp_path / 'model.yaml')
    assert run('history', [str(tmp_path / 'model.yaml'), '--output', str(tmp_path / 'page')]) == 0
    page = (tmp_path / 'page' / 'report.html').read_text(encoding='utf-8')
    for said in (capsys.readouterr().out, page):
        assert 'N·m' in said
        assert ' mA' not in said
        assert '(mA)' not in said
    assert '"unit": "N·m"' in (tmp_path / 'page' / 'report.json').read_text(encoding='utf-8')


def test_without_a_history_it_says_how_to_begin_one(tmp_path, refuses):
    MODEL.save(tmp_path / 'model.yaml')
    refuses('refine --history', 'history', tmp_path / 'model.yaml')
    refuses('--history goes with --model', 'refine', 'none.csv', '--history')


def test_a_history_that_is_not_continued_is_not_lost(tmp_path, capsys):
    for name in ('first', 'other'):
        (tmp_path / name).mkdir()
        MODEL.save(tmp_path / name / 'model.yaml')
    kept = History(10.0, notes=[('2026-01-01', 'new grease')]).save(
        tmp_path / 'first' / 'model.yaml')
    content = kept.read_bytes()
    assert run('refine', ['none.csv', '--model', str(tmp_path / 'other' / 'model.yaml'),
                          '--history', '--output', str(tmp_path / 'first')]) == 2
    assert 'would be lost: continue it with --model' in capsys.readouterr().err
    assert kept.read_bytes() == content
    # Continued in place: only the recording is missing.
    assert run('refine', ['none.csv', '--model', str(tmp_path / 'first' / 'model.yaml'),
                          '--history', '--output', str(tmp_path / 'first')]) == 2
    assert 'none.csv: no such file' in capsys.readouterr().err
