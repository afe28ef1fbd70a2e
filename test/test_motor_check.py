# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Model files with typing errors are refused with the reason; valid ones are accepted."""

import os
from pathlib import Path

from helpers import note_model
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
import yaml

from friction_comp.errors import InputError
from friction_comp.files import read_yaml
from friction_comp.model.differentiation import DEFAULT_SETTINGS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.motor_check import check_for_motor
from friction_comp.package_files import package_file

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
    (replaced(', 0.0008]', ']'), r'six'),
    (replaced('effects: []', 'efects: []'), r'efects'),
    (replaced('current_limit: 3.0', 'current_limit: 3:00'), r"'3:00'"),
    (TEXT + 'notes: {unit: LSB}\n', r"in 'LSB', not in A or N·m"),
    (TEXT + 'notes: {unit: counts}\n', r"in 'counts'"),
    (TEXT + 'notes: {unit: V}\n', r"in 'V'"),
    (replaced('current_limit: 3.0', 'current_limit: 3_000'), r"'3_000'"),
    (replaced('current_limit: 3.0', 'curent_limit: 3.0'), r'curent_limit'),
    (replaced('gear_ratio: 100.0', 'gear_ratio: 100.0\n  gear_ratio: 50.0'), r'occurs twice'),
    (replaced('mean: 0.0995,', 'mean: 0.0995, maen: 1.0,'), r'maen'),
    (replaced('version: 1', 'version: 1\njoint: wrist'), r"'wrist'"),
    (replaced('version: 1', 'version: 1\njoint: &a elbow\nnotes: {x: *a}'), r'not allowed'),
    (with_effect('gravity', coefficients=[1e9, 0.0]), r"'gravity': 1e\+09 A are more than"),
    (with_effect('gravity', coefficients=[0.1]), r'2 coefficients'),
    (with_effect('gravity', coefficients=[0.1, 0.0, 0.1]), r'2 coefficients'),
    (with_effect('stribeck', coefficients=[0.02], velocity=0.1, exponent=1e6, transition=0.01),
     r'exponent'),
    (with_effect('stribeck', coefficients=[20.0], velocity=0.1, exponent=1.0, transition=0.01),
     r'beside sliding friction'),
    (with_effect('ghost', coefficients=[0.02]), r'ghost'),
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
    except (InputError, OverflowError):
        return
    assert np.isfinite(model.sigmoid(np.linspace(-5.0, 5.0, 11))).all()
