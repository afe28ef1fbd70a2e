# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Columns of effects, the search among them, their constants and the confidence in a result."""

import numpy as np
import pytest
from test_prepare import swings

from friction_comp.drive import Drive
from friction_comp.model.effects import EFFECTS
from friction_comp.refinement import refine
from friction_comp.refinement.block_sums import regimes_of, repeats
from friction_comp.refinement.effect_columns import Table, Term
from friction_comp.refinement.intervals import intervals
from friction_comp.refinement.prepare import join, prepare
from friction_comp.refinement.search import adjust_constants, find_best_fit, Fit, Problem, Search
from friction_comp.refinement.thresholds import table as thresholds

COGGING = {'frequency': 14.0, 'growth': 0.0, 'speed': 1.0, 'transition': 0.01}
RAW = {'method': 'zero-phase Butterworth', 'source': 'velocity', 'bandwidth': None}


def table_of(samples):
    rows, _ = prepare(samples, Drive(1.0, 1.0), RAW)
    return Table(rows, 200.0)


@pytest.fixture(scope='module')
def plain():
    return table_of(swings(1))


@pytest.fixture
def rippled():
    """Return the table of a drive with cogging of 0.1 A, 14 times a turn."""
    samples = swings(2)
    return table_of(samples.with_(current=samples.current + 0.1 * np.cos(14.0 * samples.position)))


def test_terms_that_take_the_place_of_others_have_their_own_sums(rippled):
    first, stays, last = (Term(EFFECTS[name], constants) for name, constants in (
        ('cogging', COGGING), ('gravity', {}), ('friction_ripple', COGGING)))
    rippled.add([first, stays])
    rippled.keep([stays])
    rippled.add([last, Term(EFFECTS['inertia'])])
    terms = [*rippled.columns_of]
    assert first not in terms
    assert len(terms) == 3
    rippled.set_transition(100.0, 0.001)
    fresh = table_of(rippled.rows.samples)
    fresh.set_transition(100.0, 0.001)
    fresh.add(terms)
    assert rippled.sums.part(rippled.indices(terms)).gram == pytest.approx(
        fresh.sums.part(fresh.indices(terms)).gram, rel=1e-9, abs=1e-9)
    part = rippled.part([last, stays])
    assert part.errors([stays, last]) == pytest.approx(fresh.errors([stays, last]))


def test_of_two_forms_of_an_effect_a_search_compares_the_better_one():
    """Else one more effect displaces another from those that are compared."""
    where = {'distance': 0.05, 'transition': 0.01}
    forms = [Term(EFFECTS['hysteresis'], {**where, 'exponent': 1.0}),
             Term(EFFECTS['backlash'], {**where, 'gap': 0.02})]
    samples = swings(2)
    friction = EFFECTS['hysteresis']({**forms[0].constants, 'coefficients': [0.2, 0.0]})
    reverses = table_of(samples.with_(current=samples.current + friction.current(samples)))
    search = Search(reverses)
    search.candidates = reverses.add(forms)
    assert search.shortlist([]) == forms[:1]
    assert search.shortlist(forms[:1]) == []


def test_the_transition_goes_where_friction_changes_its_sign():
    samples = swings(3)
    shifted = 0.5 * np.tanh((samples.velocity - 0.006) / 0.05) + 0.2 * samples.velocity
    found = table_of(samples.with_(current=shifted))
    found.fit_transition([], rounds=12)
    steepness, shift = found.transition
    assert shift == pytest.approx(0.006, abs=0.002)
    assert steepness == pytest.approx(2.0 / 0.05, rel=0.05)


def test_a_search_names_what_is_there_and_no_more(rippled):
    found = Search(rippled).forward([])
    assert [term.kind.name for term in found] == ['cogging']
    assert found[0].constants['frequency'] == pytest.approx(14.0, abs=1.0)


@pytest.mark.parametrize('seed', range(4))
def test_a_search_names_nothing_on_a_plain_drive(seed):
    plain = table_of(swings(20 + seed))
    search = Search(plain)
    assert search.forward([]) == []


def test_only_effects_that_the_data_support_are_kept(rippled):
    terms = [Term(EFFECTS['inertia']), Term(EFFECTS['cogging'], COGGING), Term(EFFECTS['gravity'])]
    terms = rippled.add(terms)
    search = Search(rippled)
    assert search.backward(terms) == [terms[1]]
    search.fixed = terms[:1]
    assert search.backward(terms) == [terms[0], terms[1]]


def test_an_effect_is_exchanged_for_one_that_predicts_better(rippled):
    worse, better = (rippled.add([Term(EFFECTS[name], COGGING)])[0]
                     for name in ('friction_ripple', 'cogging'))
    search = Search(rippled)
    found, = search.exchange([worse])
    assert found.kind is better.kind
    assert search.exchange(rippled.add([better])) == [better]


@pytest.mark.parametrize(('name', 'constants', 'shape', 'constant', 'first'), [
    ('cogging', COGGING, lambda s: 0.1 * np.sin(14.0 * s.position), 'frequency', 13.4),
    ('stribeck', {'velocity': 0.15, 'exponent': 1.0, 'transition': 0.01},
     lambda s: 0.3 * np.exp(-np.abs(s.velocity) / 0.15) * np.tanh(s.velocity / 0.01),
     'velocity', 0.3)])
def test_a_constant_between_the_points_of_its_grid_is_found(name, constants, shape, constant,
                                                            first):
    samples = swings(5)
    found = table_of(samples.with_(current=samples.current + shape(samples)))
    terms = found.add([Term(EFFECTS[name], {**constants, constant: first})])
    before = np.sum(found.residual(terms) ** 2)
    terms = adjust_constants(found, terms, rounds=10)
    found.fit_transition(terms)
    terms = adjust_constants(found, terms, rounds=10)
    value = terms[0].constants[constant]
    assert value == pytest.approx(constants[constant], rel=0.01 if name == 'cogging' else 0.15)
    assert np.sum(found.residual(terms) ** 2) < before
    low, high = intervals(Fit(found, terms, 0, RAW)).constants[terms[0], constant]
    assert low < constants[constant] < high


def test_intervals_contain_the_truth_and_show_absent_effects(rippled):
    terms = rippled.add([Term(EFFECTS['cogging'], COGGING), Term(EFFECTS['inertia'])])
    found = intervals(Fit(rippled, terms, 0, RAW))
    (cosine, sine), (inertia,) = (rippled.columns_of[term] for term in terms)
    for place, true in ((1, 0.5), (2, 0.2), (cosine, 0.1), (sine, 0.0), (inertia, 0.0)):
        low, high = found.coefficients[place]
        assert low <= true <= high
        assert high - low < 0.06


def test_every_threshold_has_a_unit_and_a_reason():
    rows = thresholds()
    assert len(rows) > 8
    assert all(np.isfinite(value) and len(reason) > 10 for _, value, _, reason in rows)
    assert all(unit for name, _, unit, _ in rows)


def test_names_change_nothing_in_the_model_that_predicts():
    samples = swings(2)
    samples = samples.with_(acceleration=None, current=samples.current + 0.3 * np.sin(
        samples.position) + 0.1 * np.cos(14.0 * samples.position))
    fit = find_best_fit(Problem(join([samples]), Drive(1.0, 1.0), True, None))
    result = refine([samples], drive=Drive(1.0, 1.0))
    assert [term.kind.name for term in fit.terms] == [one.name for one in result.model.effects]
    assert result.report.after.held_out_rmse < 1.1 * fit.rmse_with(fit.terms)


def test_regimes_differ_in_motion_and_are_of_equal_size():
    samples = swings(4)
    regime = regimes_of([samples.position, samples.velocity], 16)
    assert np.ptp(np.bincount(regime)) <= 1
    # Of one regime, the joint is in a part of its range, or moves one way.
    for k in range(16):
        own = regime == k
        assert np.ptp(samples.position[own]) < 0.75 * np.ptp(samples.position)
    assert repeats(np.sin(samples.time), np.cos(samples.time)) > 0.9
    assert repeats(samples.position, samples.velocity) < 0.8
