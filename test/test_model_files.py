# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Any model predicts the same after a round trip through its file; invalid ones are refused."""

import os
from pathlib import Path
import tempfile

from helpers import note_model
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from test_effect_properties import parameters_of, samples_of
import yaml

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.files import read_yaml
from friction_comp.model.differentiation import DEFAULT_SETTINGS
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import Breakaway, FrictionModel, Presliding
from friction_comp.model.motor_check import check_for_motor
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.package_files import package_file

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
    ({'drive': {'torque_constant': True, 'gear_ratio': 100.0}}, 'drive.torque_constant'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': float('nan')}}, 'drive.gear_ratio'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 1.0, 'colour': 'red'}}, 'colour'),
    ({'sigmoid': None}, 'sigmoid'),
    ({'sigmoid': {'coefficients': [1, 2, 3]}}, 'six'),
    ({'sigmoid': {'coefficients': [1, 1, 1, 1, 1, 0], 'velocity_unit': 'rpm'}}, 'rpm'),
    ({'breakaway': [1, 2]}, 'breakaway'),
    ({'breakaway': {'positive': {'mean': 0.1}}}, 'negative'),
    ({'breakaway': {'positive': {'mean': 'x'}, 'negative': {'mean': -0.1}}}, 'positive.mean'),
    ({'breakaway': {'positive': {'mean': -0.1}, 'negative': {'mean': 0.1}}}, 'sign'),
    ({'effects': {'name': 'gravity'}}, 'effects'),
    ({'effects': ['gravity']}, 'name'),
    ({'effects': [{'name': 'magic', 'parameters': {}}]}, 'magic'),
    ({'effects': [{'name': 'gravity', 'parameters': {}}]}, 'gravity'),
    ({'effects': [{'name': ['gravity']}]}, 'gravity'),
    ({'drive': {'torque_constant': 0.1, 'gear_ratio': 10 ** 400}}, 'too large'),
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


@pytest.mark.parametrize('content', [
    bytes(range(256)), b'\x00\x01\x02', b'\xff\xfe\xfd', b'', b'42\n', b'[1, 2]\n', b'a: &a [*a\n',
    b'made: 2001-99-99\n', b'[' * 5000, b'format: ' + b'9' * 5000,
], ids=['bytes', 'nul', 'latin', 'empty', 'number', 'list', 'broken', 'date', 'deep', 'digits'])
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


TEXT = package_file('config', 'armin_configuration_1.yaml').read_text(encoding='utf-8')


def for_motor(folder, text):
    path = folder / 'model.yaml'
    path.write_text(text, encoding='utf-8')
    check_for_motor(FrictionModel.load(path), 'elbow', ['elbow', 'wrist'])


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
    (replaced('std: 0.0034}\n  neg', 'std: 0.34}\n  neg'), r'standard deviation'),
    (replaced('[0.1101,', '[3.4,'), r'breakaway|lookup_table|sign|limit'),
    (replaced('0.0008]', '0.08]'), r'drive.current_limit'),
    (replaced('0.0008]', '-0.0008]'), r'falls with speed'),
    (replaced('[0.1101, 1.2456, 0.1359', '[-0.1101, 1.2456, -0.1359'), r'sign of friction'),
    (replaced('effects: []', 'efects: []'), r'efects'),
    (replaced('current_limit: 3.0', 'current_limit: 3:00'), r"'3:00'"),
    (TEXT + 'notes: {unit: LSB}\n', r"in 'LSB', not in A or N·m"),
    (replaced('current_limit: 3.0', 'current_limit: 3_000'), r"'3_000'"),
    (replaced('current_limit: 3.0', 'curent_limit: 3.0'), r'curent_limit'),
    (replaced('gear_ratio: 100.0', 'gear_ratio: 100.0\n  gear_ratio: 50.0'), r'occurs twice'),
    (replaced('mean: 0.0995,', 'mean: 0.0995, maen: 1.0,'), r'maen'),
    (replaced('version: 1', 'version: 1\njoint: wrist'), r"'wrist'"),
    (replaced('version: 1', 'version: 1\njoint: &a elbow\nnotes: {x: *a}'), r'not allowed'),
    (with_effect('gravity', coefficients=[1e9, 0.0]), r"'gravity': 1e\+09 A are more than"),
    (with_effect('gravity', coefficients=[0.1, 0.0, 0.1]), r'2 coefficients'),
    (with_effect('stribeck', coefficients=[0.02], velocity=0.1, exponent=1e6, transition=0.01),
     r'exponent'),
    (with_effect('stribeck', coefficients=[20.0], velocity=0.1, exponent=1.0, transition=0.01),
     r'beside sliding friction'),
    (replaced('effects: []', 'effects: []\ndifferentiation: {bandwidth: 0}'), r'bandwidth'),
    (replaced('effects: []', 'effects: []\ndifferentiation: {bandwith: 9}'), r'bandwith'),
    (replaced('effects: []', 'effects: []\ndifferentiation: {method: spline}'), r'method'),
])
def test_typing_errors_are_refused_with_the_reason(tmp_path, text, words):
    with pytest.raises(InputError, match=words) as caught:
        for_motor(tmp_path, text)
    assert '\n' not in str(caught.value)


def test_a_model_that_identification_wrote_passes(tmp_path):
    model = note_model(2)
    speeds = [-1.5, -0.5, 0.5, 1.5]
    model.lookup_table = {'speeds': speeds, 'currents': [float(model.sigmoid(v)) for v in speeds],
                          'standard_deviations': [0.01] * 4}
    model.joint = 'elbow'
    model.save(tmp_path / 'elbow.yaml')
    check_for_motor(FrictionModel.load(tmp_path / 'elbow.yaml'), 'elbow', ['elbow', 'wrist'])
    model.lookup_table['currents'][3] *= 3.0
    with pytest.raises(InputError, match='misses the lookup_table'):
        check_for_motor(model, 'elbow', ['elbow'])
    # Refinement fits another sigmoid to recordings and keeps the table of identification.
    model.differentiation = DEFAULT_SETTINGS
    check_for_motor(model, 'elbow', ['elbow'])


def test_what_is_no_file_to_read_is_refused_at_once(tmp_path):
    pipe = tmp_path / 'pipe.yaml'
    os.mkfifo(pipe)
    long = tmp_path / 'long.yaml'
    long.write_text(TEXT + 'notes:\n' + ''.join(
        f'  note_{k}: {"x" * 80}\n' for k in range(20_000)), encoding='utf-8')
    deep = tmp_path / 'deep.yaml'
    deep.write_text('a: &a [1]\n' + ''.join(
        f'{b}: &{b} [{", ".join([f"*{a}"] * 9)}]\n' for a, b in zip('abcdef', 'bcdefg')))
    for path, words in ((pipe, 'not a regular file'), (long, 'more than'), (deep, 'not allowed'),
                        (tmp_path, 'directory'), (Path('/dev/zero'), 'not a regular file')):
        with pytest.raises(InputError, match=words):
            read_yaml(path)


@pytest.mark.parametrize(('text', 'value'), [
    ('3', 3), ('-0.5', -0.5), ('1e-3', 1e-3), ('2.', 2.0), ('.5', 0.5), ('010', 10), ('true', True),
    ('~', None), ('', None), ('no', 'no'), ('3:00', '3:00'), ('1_0', '1_0'), ('0x1F', '0x1F'),
    ('2026-01-01', '2026-01-01')])
def test_yaml_scalars_are_read_as_in_yaml_1_2(tmp_path, text, value):
    path = tmp_path / 'value.yaml'
    path.write_text(f'key: {text}\n')
    assert read_yaml(path)['key'] == value
    assert type(read_yaml(path)['key']) is type(value)


NUMBERS = st.floats(allow_nan=True, allow_infinity=True) | st.integers(-10**30, 10**30)
VALUES = st.recursive(
    NUMBERS | st.booleans() | st.none() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
        st.sampled_from(['mean', 'std', 'coefficients', 'x']), inner, max_size=3), max_leaves=4)


@settings(max_examples=100)
@given(st.data())
def test_any_document_is_either_accepted_or_refused(data):
    """Never anything but InputError; and what is taken gives finite currents."""
    document = yaml.safe_load(TEXT)
    places = [(document, key) for key in document] + [
        (document[name], key) for name in ('drive', 'sigmoid', 'breakaway') for key in
        document[name]] + [(document['breakaway']['positive'], 'mean'),
                           (document['sigmoid']['coefficients'], 2)]
    for _ in range(data.draw(st.integers(1, 2))):
        holder, key = data.draw(st.sampled_from(places))
        holder[key] = data.draw(VALUES)
    try:
        model = FrictionModel.from_dict(document)
        check_for_motor(model, 'elbow', ['elbow'])
    except InputError:
        return
    assert np.isfinite(model.sigmoid(np.linspace(-5.0, 5.0, 11))).all()
