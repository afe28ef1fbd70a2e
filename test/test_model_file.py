# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The model file: what is written is read, and what is wrong is named."""

import pytest
import yaml

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import Breakaway, FrictionModel
from friction_comp.model.sigmoid import Sigmoid


@pytest.fixture
def model():
    return FrictionModel(
        drive=Drive(0.119, 100.0, encoder_counts=4000),
        sigmoid=Sigmoid(upper=0.1, lower=-0.09, steepness=70.0, shift=0.002, viscous=0.05),
        breakaway=Breakaway(0.1, -0.11, 0.003, 0.004),
        effects=[EFFECTS['gravity']({'coefficients': [0.2, -0.1]})],
        joint='elbow',
        differentiation={'source': 'position', 'bandwidth': 40.0, 'lag': 0.004})


def test_a_written_model_is_read_back_whole(model, tmp_path):
    model.save(tmp_path / 'model.yaml')
    again = FrictionModel.load(tmp_path / 'model.yaml')
    assert again.drive == model.drive
    assert again.breakaway == model.breakaway
    assert again.joint == 'elbow'
    assert again.differentiation == model.differentiation
    assert [effect.to_dict() for effect in again.effects] == [
        effect.to_dict() for effect in model.effects]
    for speed in (-1.0, -0.01, 0.0, 0.02, 0.7):
        assert again.sigmoid(speed) == pytest.approx(model.sigmoid(speed), rel=1e-9)


@pytest.mark.parametrize(('change', 'reason'), [
    ({'differentiation': {'lag': 'long'}}, 'differentiation'),
    ({'format': 'something'}, 'format'),
    ({'version': 99}, 'version'),
    ({'drive': {'torque_constant': 0.1}}, 'gear_ratio'),
    ({'drive': {'torque_constant': -0.1, 'gear_ratio': 100.0}}, 'torque_constant'),
    ({'sigmoid': {'coefficients': [1, 2, 3]}}, 'six'),
    ({'effects': [{'name': 'magic', 'parameters': {}}]}, 'magic'),
    ({'effects': [{'name': 'gravity', 'parameters': {}}]}, 'gravity'),
    ({'effects': [{'name': 'cogging', 'parameters': {'coefficients': [1, 2]}}]}, 'missing'),
    ({'effects': 'none'}, 'effects'),
])
def test_what_is_wrong_is_named_with_the_file(model, tmp_path, change, reason):
    path = tmp_path / 'model.yaml'
    path.write_text(yaml.safe_dump({**model.to_dict(), **change}))
    with pytest.raises(InputError, match=reason) as caught:
        FrictionModel.load(path)
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)


def test_no_file_and_no_yaml_are_named(tmp_path):
    with pytest.raises(InputError, match=r'nowhere\.yaml'):
        FrictionModel.load(tmp_path / 'nowhere.yaml')
    (tmp_path / 'odd.yaml').write_text('a: [1, 2')
    with pytest.raises(InputError, match='not a YAML document'):
        FrictionModel.load(tmp_path / 'odd.yaml')
