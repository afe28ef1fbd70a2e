# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Any model predicts the same after a round trip through its file; invalid ones are refused."""

import os
from pathlib import Path
import tempfile

from effect_maker import parameters_of, samples_of
from helpers import note_model
from hypothesis import given, strategies as st
import numpy as np
import pytest
import yaml

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import package_file
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.motor_check import check_for_motor
from friction_comp.model.sigmoid import Sigmoid

SIZE, WAY = st.floats(-2.0, 2.0), st.floats(1e-5, 1.0)
MOTION = samples_of(np.sin(0.013 * np.arange(500)), 1.3 * np.cos(0.013 * np.arange(500)))


@st.composite
def effects(draw):
    name = draw(st.sampled_from(sorted(EFFECTS)))
    return EFFECTS[name](draw(parameters_of(name)))


@st.composite
def models(draw):
    breakaway = draw(st.none() | st.builds(
        Breakaway, st.floats(0.0, 2.0), st.floats(-2.0, 0.0), st.floats(0.0, 0.1),
        st.floats(0.0, 0.1), st.none() | SIZE, st.none() | SIZE))
    return FrictionModel(
        drive=draw(st.builds(
            Drive, st.floats(1e-3, 10.0), st.floats(0.1, 1000.0),
            st.none() | st.integers(1, 100_000), st.floats(0.1, 100.0))),
        sigmoid=draw(st.builds(
            Sigmoid, st.floats(0.0, 2.0), st.floats(-2.0, 0.0), st.floats(1.0, 500.0),
            st.floats(-0.01, 0.01), st.floats(-0.1, 1.0))),
        breakaway=breakaway, effects=draw(st.lists(effects(), max_size=4)),
        presliding=draw(st.none() | st.builds(
            Presliding, WAY, st.none() | WAY, st.none() | st.just(0.0) | WAY)),
        uncertainty=draw(st.none() | st.floats(0.0, 1.0)),
        simulation=draw(st.dictionaries(st.text('abc'), SIZE, max_size=2)),
        differentiation=draw(st.sampled_from([
            {}, {'source': 'position', 'bandwidth': 40.0, 'lag': 0.004}])),
        joint=draw(st.text(st.characters(codec='utf-8', exclude_categories=['C', 'Z']),
                           max_size=8)),
        notes=draw(st.dictionaries(
            st.text('abc: #-', min_size=1), st.text('ω·[{"\n '), max_size=2)))


@given(model=models())
def test_a_model_predicts_the_same_after_a_round_trip(model):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'model.yaml'
        model.save(path)
        again = FrictionModel.load(path)
        assert os.listdir(folder) == ['model.yaml']
    for name in ('drive', 'breakaway', 'presliding', 'joint', 'notes', 'simulation',
                 'differentiation', 'uncertainty'):
        assert getattr(again, name) == getattr(model, name)
    assert [one.to_dict() for one in again.effects] == [one.to_dict() for one in model.effects]
    assert again.predict(MOTION) == pytest.approx(model.predict(MOTION), rel=1e-7, abs=1e-9)


# As refine of version 0.2.0 wrote it, without rows and uncertainty.
OLDER = """
format: friction_comp_model
version: 1
joint: elbow
drive: {torque_constant: 1.0, gear_ratio: 1.0, current_limit: 4.1}
sigmoid:
  coefficients: [1.2, 140.0, 1.1, 1.0, 1.0, 1.8]
  velocity_unit: rad/s
effects:
- name: inertia
  variable: acceleration
  parameters: {coefficients: [0.1]}
- name: spring
  variable: position
  parameters: {position: 0.1, coefficients: [0.4]}
  valid_range: {position: [-0.8, 0.9]}
recorded:
  speeds: [0.1, 0.9, 1.8]
  intervals: {coulomb: [1.1, 1.2], viscous: [1.7, 1.9]}
  ranges: {speed: [0.0, 2.0], acceleration: [0.0, 9.0], position: [-0.8, 0.9]}
  error: 0.05
  sample_time: 0.01
differentiation: {method: zero-phase Butterworth, source: position, bandwidth: 20.0, lag: 0.0}
notes: {unit: N·m, verdict: trust, reasons: []}
"""


def test_a_file_of_an_earlier_version_is_read_and_tells_its_numbers(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(OLDER, encoding='utf-8')
    model = FrictionModel.load(path)
    assert model.current(MOTION)[0] == pytest.approx(
        0.05 + 1.15 * np.tanh(70.0 * 1.3) + 1.8 * 1.3 - 0.4 * 0.1
        + 0.1 * MOTION.acceleration[0], rel=1e-3)
    assert model.effects[1].valid_range == {'position': (-0.8, 0.9)}
    assert model.friction_uncertainty == pytest.approx(0.1 / 2.3)
    model.save(path)
    assert FrictionModel.load(path).to_dict() == model.to_dict()


def document(**changes):
    model = FrictionModel(
        drive=Drive(0.119, 100.0), sigmoid=Sigmoid(0.1, -0.09, 70.0),
        breakaway=Breakaway(0.1, -0.1),
        effects=[EFFECTS['gravity']({'coefficients': [0.2, -0.1]})])
    return {name: value for name, value in {**model.to_dict(), **changes}.items()
            if value is not MISSING}


MISSING = object()
SPRING = {'name': 'spring', 'parameters': {'position': 0.0, 'coefficients': [2.0]}}


@pytest.mark.parametrize(('changes', 'word'), [
    ({'version': 99}, 'version'), ({'version': MISSING}, 'version'),
    ({'drive': 7}, 'drive'), ({'drive': MISSING}, 'drive'),
    ({'drive': {'torque_constant': 0.1}}, 'gear_ratio'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': float('nan')}}, 'drive.gear_ratio'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 1.0, 'colour': 'red'}}, 'colour'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 10 ** 400}}, 'too large'),
    ({'sigmoid': None}, 'sigmoid'), ({'sigmoid': MISSING}, 'sigmoid'),
    ({'sigmoid': {'coefficients': [1, 2, 3]}}, 'six'),
    ({'breakaway': {'positive': {'mean': 0.1}}}, 'negative'),
    ({'breakaway': {'positive': {'mean': 'x'}, 'negative': {'mean': -0.1}}}, 'positive_mean'),
    ({'breakaway': {'positive': {'mean': -0.1}, 'negative': {'mean': 0.1}}}, 'positive_mean'),
    ({'presliding': {'distance': 0.0}}, 'presliding.distance'),
    ({'presliding': {'distance': 1e-3, 'backlash': -1.0}}, 'presliding.backlash'),
    ({'uncertainty': -0.1}, 'uncertainty'), ({'position_limits': [1.0, 0.0]}, 'position_limits'),
    ({'lookup_table': {'speeds': [1.0], 'currents': []}}, 'lookup_table'),
    ({'recorded': {'speeds': [-1.0]}}, 'recorded.speeds'),
    ({'recorded': {'intervals': {'mass': [0, 1]}}}, 'mass'),
    ({'recorded': {'intervals': {'coulomb': [2.0, 1.0]}}}, 'recorded.intervals.coulomb'),
    ({'recorded': {'rows': {'position': [1.0]}}}, 'position and velocity'),
    ({'recorded': {'rows': {'position': [1.0], 'velocity': [1.0, 2.0]}}}, 'as many values'),
    ({'effects': {'name': 'gravity'}}, 'effects'), ({'effects': ['gravity']}, 'name'),
    ({'effects': [{'name': 'magic', 'parameters': {}}]}, 'magic'),
    ({'effects': [{'name': 'gravity', 'parameters': {}}]}, 'gravity'),
    ({'effects': [{'name': 'gravity', 'parameters': {'coefficients': [10 ** 400, 1]}}]}, 'gravity'),
    ({'effects': [{**SPRING, 'valid_range': {'velocity': [0.0, 1.0]}}]}, 'valid_range'),
    ({'effects': [{**SPRING, 'valid_range': {'position': [1.0, 0.0]}}]}, 'valid_range'),
], ids=lambda value: value if isinstance(value, str) else '')
def test_what_is_wrong_in_a_file_is_named_with_it(changes, word, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(yaml.safe_dump(document(**changes)))
    with pytest.raises(InputError) as caught:
        FrictionModel.load(path)
    assert str(caught.value).startswith(f'{path}: ')
    assert word in str(caught.value)
    assert '\n' not in str(caught.value)


def test_a_drive_that_nothing_has_measured_has_no_friction_and_drives_no_motor(tmp_path):
    path = tmp_path / 'drive.yaml'
    path.write_text(yaml.safe_dump({name: value for name, value in document().items() if name in (
        'format', 'version', 'drive', 'joint')}))
    model = FrictionModel.load(path)
    assert not model.friction_known
    assert not np.any(model.sigmoid([-1.0, 0.0, 1.0]))
    with pytest.raises(InputError, match='nothing has measured the friction'):
        check_for_motor(model)
    assert not FrictionModel.from_dict(model.to_dict()).friction_known


TEXT = package_file('config', 'armin_configuration_1.yaml').read_text(encoding='utf-8')


def replaced(old, new):
    assert old in TEXT
    return TEXT.replace(old, new)


def with_effect(name, **parameters):
    entry = yaml.safe_dump([{'name': name, 'parameters': parameters}], default_flow_style=True)
    return replaced('effects: []', f'effects: {entry.strip()}')


@pytest.mark.parametrize('number', [1, 2, 3])
def test_the_drives_of_the_note_pass(number):
    model = note_model(number)
    check_for_motor(model, 'elbow', ['elbow'])
    assert model.drive.torque_constant == 0.119
    assert model.breakaway.positive_mean > 0.05 > -0.05 > model.breakaway.negative_mean
    assert model.simulation['inertia'] > 0


@pytest.mark.parametrize(('text', 'words'), [
    (replaced('mean: 0.0995', 'mean: 99.5'), r'breakaway.positive: 99.5 A is more than'),
    (replaced('mean: 0.0995', 'mean: 2.0'), r'does not match sliding friction'),
    (replaced('mean: -0.0995', 'mean: -0.001'), r'breakaway.negative'),
    (replaced('[0.1101,', '[3.4,'), r'breakaway|lookup_table|sign|limit'),
    (replaced('0.0008]', '0.08]'), r'drive.current_limit'),
    (replaced('0.0008]', '-0.0008]'), r'falls with speed'),
    (replaced('[0.1101, 1.2456, 0.1359', '[-0.1101, 1.2456, -0.1359'), r'sign of friction'),
    (TEXT + 'notes: {unit: LSB}\n', r"in 'LSB', which is neither a current nor a torque"),
    (replaced('current_limit: 3.0', 'curent_limit: 3.0'), r'curent_limit'),
    (replaced('gear_ratio: 100.0', 'gear_ratio: 100.0\n  gear_ratio: 50.0'), r'occurs twice'),
    (replaced('version: 1', 'version: 1\njoint: wrist'), r"'wrist'"),
    (with_effect('gravity', coefficients=[1e9, 0.0]), r"'gravity': 1e\+09 A are more than"),
    (with_effect('gravity', coefficients=[0.1, 0.0, 0.1]), r'2 coefficients'),
    (with_effect('stribeck', coefficients=[0.02], velocity=0.1, exponent=1e6, transition=0.01),
     r'exponent'),
    (with_effect('stribeck', coefficients=[20.0], velocity=0.1, exponent=1.0, transition=0.01),
     r'beside sliding friction'),
    (replaced('effects: []', 'effects: []\ndifferentiation: {method: spline}'), r'method')])
def test_typing_errors_never_reach_a_motor(tmp_path, text, words):
    path = tmp_path / 'model.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(InputError, match=words) as caught:
        check_for_motor(FrictionModel.load(path), 'elbow', ['elbow', 'wrist'])
    assert '\n' not in str(caught.value)
