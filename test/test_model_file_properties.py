# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Any model predicts the same after a round trip through its file; invalid files are refused."""

import os
from pathlib import Path
import tempfile

from helpers import note_model
from hypothesis import given, strategies as st
import numpy as np
import pytest
from test_effect_properties import parameters_of, samples_of
import yaml

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.sigmoid import Sigmoid

SIZE, WAY = st.floats(-2.0, 2.0), st.floats(1e-5, 1.0)


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
            Presliding, WAY, st.none() | WAY, st.none() | WAY, st.none() | st.just(0.0) | WAY)),
        simulation=draw(st.dictionaries(st.text('abc'), SIZE, max_size=2)),
        differentiation=draw(st.sampled_from([
            {}, {'source': 'position', 'bandwidth': 40.0, 'lag': 0.004}])),
        joint=draw(st.text(st.characters(codec='utf-8', exclude_categories=['C', 'Z']),
                           max_size=8)),
        notes=draw(st.dictionaries(
            st.text('abc: #-', min_size=1), st.text('ω·[{"\n '), max_size=2)))


def motion():
    position = np.sin(0.013 * np.arange(500))
    return samples_of(position, np.gradient(position, 0.01))


@given(model=models())
def test_a_model_predicts_the_same_after_a_round_trip(model):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'model.yaml'
        model.save(path)
        again = FrictionModel.load(path)
        assert os.listdir(folder) == ['model.yaml']
    for name in ('drive', 'breakaway', 'presliding', 'joint', 'notes', 'simulation',
                 'differentiation'):
        assert getattr(again, name) == getattr(model, name)
    assert [one.to_dict() for one in again.effects] == [one.to_dict() for one in model.effects]
    assert again.predict(motion()) == pytest.approx(model.predict(motion()), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize('name', ['0E0', '3:00', '1_000', '08', 'true', '~', 'no', '.5', '*a'])
def test_a_name_that_looks_like_something_else_stays_a_name(name, tmp_path):
    model = note_model()
    model.joint, model.notes = name, {'drawing': name}
    model.save(tmp_path / 'model.yaml')
    again = FrictionModel.load(tmp_path / 'model.yaml')
    assert (again.joint, again.notes) == (name, {'drawing': name})


def document(**changes):
    model = FrictionModel(
        drive=Drive(0.119, 100.0), sigmoid=Sigmoid(0.1, -0.09, 70.0),
        breakaway=Breakaway(0.1, -0.1),
        effects=[EFFECTS['gravity']({'coefficients': [0.2, -0.1]})])
    return {**model.to_dict(), **changes}


def refused(path, *words):
    with pytest.raises(InputError) as caught:
        FrictionModel.load(path)
    text = str(caught.value)
    assert text.startswith(f'{path}: ')
    assert '\n' not in text
    for word in words:
        assert word in text


@pytest.mark.parametrize(('changes', 'word'), [
    ({'format': 'something'}, 'format'),
    ({'version': 99}, 'version'),
    ({'differentiation': {'lag': 'long'}}, 'differentiation'),
    ({'drive': 7}, 'drive'),
    ({'drive': {'torque_constant': 0.1}}, 'gear_ratio'),
    ({'drive': {'torque_constant': -0.1, 'gear_ratio': 100.0}}, 'torque_constant'),
    ({'drive': {'torque_constant': 'strong', 'gear_ratio': 100.0}}, 'drive.torque_constant'),
    ({'drive': {'torque_constant': True, 'gear_ratio': 100.0}}, 'drive.torque_constant'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': float('nan')}}, 'drive.gear_ratio'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 1.0, 'colour': 'red'}}, 'colour'),
    ({'sigmoid': None}, 'sigmoid'),
    ({'sigmoid': {'coefficients': [1, 2, 3]}}, 'six'),
    ({'sigmoid': {'coefficients': 'abcdef'}}, 'sigmoid.coefficients'),
    ({'sigmoid': {'coefficients': [1, 1, 1, 1, 1, 'x']}}, 'sigmoid'),
    ({'sigmoid': {'coefficients': [1, 1, 1, 1, 1, 0], 'velocity_unit': 'rpm'}}, 'rpm'),
    ({'sigmoid': {'coefficients': [1, 1, 1, 1, 1, 0], 'velocity_unit': []}}, 'velocity unit'),
    ({'breakaway': [1, 2]}, 'breakaway'),
    ({'breakaway': {'positive': {'mean': 0.1}}}, 'negative'),
    ({'breakaway': {'positive': {'mean': 'x'}, 'negative': {'mean': -0.1}}}, 'positive.mean'),
    ({'breakaway': {'positive': {'mean': -0.1}, 'negative': {'mean': 0.1}}}, 'sign'),
    ({'effects': {'name': 'gravity'}}, 'effects'),
    ({'effects': ['gravity']}, 'name'),
    ({'effects': [{'name': 'magic', 'parameters': {}}]}, 'magic'),
    ({'effects': [{'name': 'gravity', 'parameters': {}}]}, 'gravity'),
    ({'effects': [{'name': 'cogging', 'parameters': {'coefficients': [1, 2]}}]}, 'missing'),
    ({'effects': [{'name': ['gravity']}]}, 'gravity'),
    ({'effects': [{'name': 'gravity', 'parameters': [1]}]}, 'gravity'),
    ({'effects': [{'name': 'gravity', 'parameters': {'coefficients': ['x', 1]}}]}, 'coefficients'),
    ({'effects': [{'name': 'hysteresis', 'parameters': {
        'coefficients': [0.1, 0], 'distance': 0.0, 'exponent': 1, 'transition': 0.01}}]},
     'distance'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 10 ** 400}}, 'too large'),
    ({'breakaway': {'positive': {'mean': 10 ** 400}, 'negative': {'mean': -0.1}}}, 'too large'),
    ({'effects': [{'name': 'gravity', 'parameters': {'coefficients': [10 ** 400, 1]}}]}, 'gravity'),
    ({'notes': 'none'}, 'notes'),
    ({'simulation': [1]}, 'simulation'),
], ids=lambda value: value if isinstance(value, str) else '')
def test_a_wrong_type_anywhere_is_named(changes, word, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(yaml.safe_dump(document(**changes)))
    refused(path, word)


@pytest.mark.parametrize('missing', ['format', 'version', 'drive', 'sigmoid'])
def test_a_missing_section_is_named(missing, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(yaml.safe_dump({k: v for k, v in document().items() if k != missing}))
    refused(path, missing)


@pytest.mark.parametrize('content', [
    b'!!python/object/apply:os.system ["true"]\n',
    b'format: friction_comp_model\njoint: !!python/name:os.system\n',
    bytes(range(256)), b'\x00\x01\x02', b'\xff\xfe\xfd', b'', b'42\n', b'[1, 2]\n', b'a: &a [*a\n',
    b'made: 2001-99-99\n', b'[' * 5000, b'format: ' + b'9' * 5000,
], ids=['object', 'name', 'bytes', 'nul', 'latin', 'empty', 'number', 'list', 'broken', 'date',
        'deep', 'digits'])
def test_what_is_no_model_file_is_refused(content, tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_bytes(content)
    refused(path)


def test_a_yaml_tag_runs_no_code(tmp_path):
    path, mark = tmp_path / 'model.yaml', tmp_path / 'mark'
    path.write_text(f'!!python/object/apply:pathlib.Path.touch [!!python/object/apply:'
                    f'pathlib.PosixPath ["{mark}"]]\n')
    refused(path, 'YAML')
    assert not mark.exists()


def test_a_folder_is_no_model_file_and_one_that_is_not_there_is_none(tmp_path):
    refused(tmp_path)
    refused(tmp_path / 'nowhere.yaml')


def test_the_old_file_survives_a_write_that_fails(tmp_path, monkeypatch):
    path = tmp_path / 'model.yaml'
    model = FrictionModel.from_dict(document())
    model.save(path)
    old = path.read_bytes()

    def full(*_):
        raise OSError(28, 'No space left on device')

    model.joint = 'other'
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fsync', full)
        with pytest.raises(InputError, match=r'model\.yaml.*No space left'):
            model.save(path)
    assert path.read_bytes() == old
    # Values that YAML cannot represent fail before the file is opened.
    model.notes = {'odd': object()}
    with pytest.raises(yaml.YAMLError):
        model.save(path)
    assert path.read_bytes() == old
    assert os.listdir(tmp_path) == ['model.yaml']
