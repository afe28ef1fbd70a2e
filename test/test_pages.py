# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages are readable without training."""

from dataclasses import replace
import re

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.reports.evaluation_report import evaluation_report
from friction_comp.reports.figures import for_page, new_figure, thin_extremes

LIVE_PAGES = True


@pytest.fixture(scope='module')
def evaluation():
    found, = evaluate_recordings([ROOT / 'examples' / 'elbow'])
    return found


@pytest.fixture(scope='module')
def page(evaluation):
    return evaluation_report([evaluation]).html()


def test_peaks_survive_thinning():
    time = 1e-3 * np.arange(600_000)
    torque = np.sin(time)
    torque[123_456] = 7.0
    torque[300_000:310_000] = np.nan
    x, y = thin_extremes(time, torque)
    assert len(x) <= 2000
    assert np.nanmax(y) == 7.0
    assert x[np.nanargmax(y)] == time[123_456]
    assert np.isnan(y).any()
    assert (np.diff(x) > 0).all()


def test_a_minute_at_a_kilohertz_is_a_drawing_of_few_points():
    figure, axes = new_figure()
    time = 1e-3 * np.arange(60_000)
    axes.plot(time, np.sin(time))
    drawing, note = for_page(figure)
    assert len(drawing) < 100_000
    assert 'the lowest and highest of each of 1000 stretches are drawn' in note


def test_the_first_screen_has_no_technical_terms(page):
    first = re.sub(r'<[^>]+>', ' ', page[page.index('<div class="verdict"'):page.index(
        '>In detail</h2>')])
    assert 'When the robot knows the direction, the person needs' in first
    assert len(re.findall(r'class="tile"', page)) == 3
    for word in ('d\u00a0=', 'continuous', '.yaml', 'RMS', 'p ='):
        assert word not in first


def test_joints_with_the_same_verdict_share_one_and_have_a_section_each(evaluation):
    page = evaluation_report([evaluation, replace(evaluation, joint='shoulder')]).html()
    assert page.count('class="verdict"') == 1
    assert '<strong>elbow, shoulder.</strong>' in page
    assert re.findall(r'href="#section-\d">([^<]*)</a>', page) == [
        'Joint elbow', 'Joint shoulder', 'Sources']
    assert len(re.findall('>In detail</h3>', page)) == 2
