# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet: which unit is out, what varies, and what the population tells of a unit more."""

from dataclasses import replace

import numpy as np
import pytest

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.fleet.common_model import CommonModel
from friction_comp.fleet.population import ERROR, population_of, spread_of, Values
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.reports.fleet_page import each_page
from friction_comp.samples import Samples

RATE, WIDTH = 100.0, 0.02


def drawn(unit):
    """Return the factors of a unit's parameters."""
    rng = np.random.default_rng([unit, 1])
    return {name: np.exp(scatter * rng.standard_normal()) for name, scatter in (
        ('coulomb', 0.08), ('viscous', 0.12), ('inertia', 0.03))}


def recorded(unit, seconds=20.0, day=0, bump=0.0, noise=0.01, **factors):
    """Return a recording of a unit: Coulomb, viscous, inertia, and a bump if wanted."""
    value = {name: factors.get(name, 1.0) * factor for name, factor in drawn(unit).items()}
    rng = np.random.default_rng([unit, day, 2])
    t = np.arange(round(seconds * RATE)) / RATE
    q = sum(size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for size, f in (
        (0.8, 0.11), (0.3, 0.37), (0.1, 0.9)))
    v = np.gradient(q, t)
    current = (0.5 * value['coulomb'] * np.tanh(v / WIDTH) + 0.2 * value['viscous'] * v
               + 0.05 * value['inertia'] * np.gradient(v, t)
               + bump * np.tanh(v / WIDTH) * np.exp(-((q - 0.3) / 0.1) ** 2)
               + noise * rng.standard_normal(len(t)))
    return Samples(time=t, position=q, current=current, joint='elbow')


@pytest.fixture(scope='module')
def model():
    return FrictionModel(
        Drive(1.0, 1.0), Sigmoid(0.5, -0.5, 2.0 / WIDTH, 0.0, 0.2), joint='elbow',
        effects=[EFFECTS['inertia']({'coefficients': [0.05]})],
        differentiation={'method': 'zero-phase Butterworth', 'source': 'position',
                         'bandwidth': 10.0})


def fleet(model, units, odd):
    common = CommonModel.of([model] * 3)
    sums = [(f'unit_{unit:02d}', common.sums([recorded(unit, **odd.get(unit, {}))], model, False))
            for unit in range(units)]
    return population_of(sums, common, model, 'A')


@pytest.fixture(scope='module')
def population(model):
    return fleet(model, 40, {4: {'coulomb': 1.6}, 17: {'bump': 0.4}, 31: {'inertia': 1.4}})


def test_three_odd_units_of_forty_are_found_and_no_other(population):
    assert population.out == {'unit_04': ['coulomb'], 'unit_17': [ERROR], 'unit_31': ['inertia']}
    page = each_page({'recordings': [], 'failed': []}, [population]).html()
    for text in ('Look at 3 of 40 units', 'unit_17', 'error of the common model', 'fleet.json'):
        assert text in page


def test_mean_spread_and_range_are_those_of_the_population(population):
    by_name = {one.name: one for one in population.parameters}
    usual = [drawn(unit) for unit in range(40)]
    for name, nominal, odd in (('coulomb', 0.5, 4), ('viscous', 0.2, None), ('inertia', 0.05, 31)):
        true = np.log([nominal * factors[name] for unit, factors in enumerate(usual)
                       if unit != odd])
        one = by_name[name]
        low, high = one.spread_interval
        assert one.scale == 'logarithmic'
        assert low < true.std(ddof=1) < high
        assert one.spread == pytest.approx(true.std(ddof=1), rel=0.15)
        assert np.log(one.mean) == pytest.approx(true.mean(), abs=0.03)
        assert one.varies
        # 95 % of units: two spreads on either side.
        assert np.log(one.range[1] / one.mean) == pytest.approx(2.03 * one.spread, rel=0.05)
    # The same noise in all units.
    assert by_name[ERROR].mean == pytest.approx(0.01, rel=0.1)
    assert not by_name['offset'].varies


def test_odd_units_do_not_hide_each_other_and_a_clean_fleet_has_none():
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(60):
        value, error = rng.standard_normal(30), np.full(30, 0.3)
        units = Values(value + error * rng.standard_normal(30), error)
        alarms += spread_of(units).out.any()
    assert alarms <= 8
    # Three at the same place shift mean and spread so far that none of them is extreme alone.
    units.value[:3] = 7.0
    assert np.nonzero(spread_of(units, 8).out)[0].tolist() == [0, 1, 2]
    three = np.abs(units.value - units.value.mean()) > 3 * units.value.std(ddof=1)
    assert not three.any()


def test_an_effect_is_common_if_half_of_the_recordings_show_it(model):
    fading = [replace(model, effects=[*model.effects, EFFECTS['stribeck']({
        'velocity': v, 'exponent': 1.0, 'transition': 0.02, 'coefficients': [0.1]})])
        for v in (0.1, 0.2, 0.9)]
    common = CommonModel.of([*fading, model, model, model])
    assert [(term.kind.name, term.constants.get('velocity')) for term in common.terms] == [
        ('inertia', None), ('stribeck', 0.2)]
    assert [one.name for one in common.compared()][-1] == 'stribeck'
    assert len(CommonModel.of([fading[0], model, model]).terms) == 1
    with pytest.raises(InputError, match='3 units are too few'):
        fleet(model, 3, {})
