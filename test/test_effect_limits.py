# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Effects know when data cannot show them, and the range in which they are valid."""

from dataclasses import replace

import numpy as np
import pytest
from test_prepare import swings

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import Coverage, EFFECTS
from friction_comp.model.effects.base import with_range
from friction_comp.model.effects.live_term import LiveTerm
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.samples import Samples

COVERAGE = Coverage(transition=0.02, speed=1.0, slowest=0.01, lowest=-1.0, highest=1.0,
                    duration=100.0, resolution=1e-5)


@pytest.mark.parametrize('name, constants', [
    ('hysteresis', {'distance': 0.9}), ('stribeck', {'velocity': 0.9}),
    ('hysteresis', {'distance': 0.05}), ('stribeck', {'velocity': 0.1})])
def test_a_constant_is_kept_where_the_effect_is_what_its_name_says(name, constants):
    kind = EFFECTS[name]
    full = {**dict.fromkeys(kind.constants, 1.0), 'transition': 0.02, **constants}
    (key, value), = constants.items()
    kept = kind.limited(key, value, full, COVERAGE)
    assert (kept == value) == (value <= 0.1)
    assert kept <= value


@pytest.mark.parametrize('name, changes', [
    ('gravity', {'lowest': 0.0, 'highest': 0.034}), ('rest_time', {'rest_duration': 0.2}),
    ('warm_up', {'duration': 27.0}), ('hysteresis', {'distinct_positions': 28.0}),
    ('hysteresis', {'reversals': 0.0}), ('backlash', {'reversals': 2.0}),
    ('stribeck', {'slow': 0.9}), ('temperature', {'temperature_span': 1.0}),
    ('direction_asymmetry', {'both_directions': False})])
def test_each_effect_says_if_the_data_cannot_show_it(name, changes):
    assert EFFECTS[name].insufficient_data(COVERAGE) == ''
    assert EFFECTS[name].insufficient_data(replace(COVERAGE, **changes)).endswith('.')


def test_a_drift_over_time_is_not_applied_on_another_day():
    drift = EFFECTS['warm_up']({'time_constant': 30.0, 'transition': 0.02,
                                'coefficients': [0.5, 0.0, 0.0]})
    model = FrictionModel(drive=Drive(1.0, 1.0), sigmoid=Sigmoid(0.1, -0.1, 100.0), effects=[drift])
    samples = swings(10, duration=10.0)
    same, other = model.predict(samples, same_recording=True), model.predict(samples)
    assert np.max(np.abs(same)) > 0.4
    assert np.max(np.abs(other)) == pytest.approx(0.1, rel=0.05)
    assert model.effects == [drift]


def a_model(name, parameters, ranges):
    """Return a model of one effect that was fitted within some ranges."""
    effect = EFFECTS[name](parameters, ranges)
    return FrictionModel(Drive(1.0, 1.0), Sigmoid(0.5, -0.5, 100.0), effects=[effect])


SPRING = {'position': 0.0, 'coefficients': [2.0]}


def test_beyond_its_fitted_range_a_spring_keeps_its_value_at_the_edge():
    model = a_model('spring', SPRING, {'position': [-0.5, 0.8]})
    position = np.array([-2.0, -0.5, 0.3, 0.8, 5.0])
    still = np.zeros(5)
    samples = Samples(time=np.arange(5.0), position=position, velocity=still, acceleration=still,
                      current=still)
    assert model.current(samples) == pytest.approx([-1.0, -1.0, 0.6, 1.6, 1.6])
    live = LiveTerm(model.effects[0])
    assert [live.update(0.0, q, 0.0) for q in position] == pytest.approx(
        [-1.0, -1.0, 0.6, 1.6, 1.6])


def test_a_temperature_that_is_not_known_stays_unknown():
    model = a_model('temperature', {
        'reference_temperature': 30.0, 'transition': 0.02, 'coefficients': [-0.01, 0.0, 0.0]},
        {'temperature': [25.0, 40.0]})
    live = LiveTerm(model.effects[0])
    assert live.update(0.0, 0.0, 1.0, temperature=90.0) == pytest.approx(-0.1)
    assert np.isnan(live.update(0.0, 0.0, 1.0, temperature=np.nan))


def test_the_range_is_kept_in_the_file_and_checked_when_read(tmp_path):
    model = a_model('spring', SPRING, {'position': [-0.5, 0.8]})
    model.save(tmp_path / 'model.yaml')
    again = FrictionModel.load(tmp_path / 'model.yaml')
    assert again.effects[0].valid_range == {'position': (-0.5, 0.8)}
    for wrong in ({'velocity': [0.0, 1.0]}, {'position': [1.0, 0.0]}, {'position': 3.0}):
        document = model.to_dict()
        document['effects'][0]['valid_range'] = wrong
        with pytest.raises(InputError, match='valid_range'):
            FrictionModel.from_dict(document)


def test_the_range_is_that_of_the_motion_without_a_stray_sample():
    samples = swings(3)
    position = samples.position.copy()
    position[100] = 50.0
    effect = with_range(EFFECTS['spring'](SPRING), samples.with_(position=position))
    low, high = effect.valid_range['position']
    quarter = 0.25 * np.ptp(samples.position)
    assert (low, high) == pytest.approx(
        (samples.position.min() - quarter, samples.position.max() + quarter), abs=0.08)
