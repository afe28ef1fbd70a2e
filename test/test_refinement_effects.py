# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement says of simulated drives: a small part of bench/refine_table.py.

Drives, strengths and constants are random; error is taken on recordings that were not fitted.
"""

import functools

from outside_effects import OUTSIDE
import pytest
from refine_table import error, recordings

from friction_comp.refinement import refine
from simulated_recordings.cases import CASES
from simulated_recordings.drives import random_drive

pytestmark = pytest.mark.slow

SEED = 31
# As much as each of these takes to be found, s; bench/refine_table.py has twice that.
RECORDED = {'rate': 100.0, 'duration': 60.0}
# How friction grows within a rest is told from place by more samples.
MORE = {'rest': {'rate': 125.0, 'duration': 75.0}}
PAIRS = [('friction_ripple', 'inertia'), ('bump', 'sub_linear')]


@functools.cache
def refined(cases, seed, outside='', servo=False):
    """Return the report, and the error on a fresh recording in parts of the noise floor."""
    drive = random_drive(seed, cases)
    changes = {**RECORDED, **MORE.get('+'.join(cases), {}), 'servo': servo}
    fit, score = (recordings(drive, number, cases, outside, **changes)
                  for number in (10 * seed + 1, 10 * seed + 2))
    result = refine([trial.samples for trial in fit], model=None, drive=drive.model.drive)
    return result.report, error(result.model, score) / drive.noise_floor


def variables(report):
    """Return the variables of the effects found, in the order of finding."""
    return [effect.variable for effect in report.effects]


# Lags are found in test_lag.py, and inertia in test_friction_numbers.py.
@pytest.mark.parametrize('case', [
    case for case in CASES if case not in ('actuation_lag', 'inertia')])
def test_the_undeclared_effect_is_named_and_removed(case):
    report, ratio = refined((case,), SEED)
    assert set(variables(report)) == {CASES[case].variable}
    assert ratio <= 1.3


@pytest.mark.parametrize('pair', PAIRS, ids='+'.join)
def test_both_of_a_pair_are_named(pair):
    report, ratio = refined(pair, 33)
    assert set(variables(report)) == {CASES[name].variable for name in pair}
    assert ratio <= 1.3


def test_a_backlash_is_no_hysteresis_though_inertia_was_not_known_when_it_was_found():
    report, ratio = refined(('backlash', 'inertia'), 35)
    assert {effect.name for effect in report.effects} == {'backlash', 'inertia'}
    assert ratio <= 1.3


def test_nothing_is_found_where_nothing_is():
    report, ratio = refined((), 40)
    assert report.effects == []
    assert report.unexplained == []
    assert report.verdict == 'trust'
    assert report.reasons
    assert ratio <= 1.3


def test_a_joint_with_inertia_and_stiction_shows_no_more_than_these():
    report, _ = refined((), 46, servo=True)
    # True friction does not pass through zero near standstill as the sigmoid does: that gap may
    # be named as well, and it is one of velocity.
    assert variables(report)[0] == 'acceleration'
    assert set(variables(report)) <= {'acceleration', 'velocity'}


@pytest.mark.parametrize('name', OUTSIDE)
def test_what_no_effect_describes_is_traced_to_its_variable(name):
    report, _ = refined((), 50, outside=name)
    allowed = OUTSIDE[name][1]
    assert allowed & {entry.variable for entry in report.unexplained} or (
        'signals' in {one.code for one in report.findings})
    assert set(variables(report)) <= allowed or report.verdict != 'trust'
