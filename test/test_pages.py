# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages are readable without training, animations match the recording, and scripts are optional."""

from dataclasses import replace
import json
import re
from xml.dom import minidom

from doc_pages import script
from helpers import ROOT
import numpy as np
import pytest

from friction_comp.evaluation.compare import Trend
from friction_comp.evaluation.neighbours import mean_interval
from friction_comp.evaluation.sessions import evaluate_recordings
from friction_comp.number_text import number
from friction_comp.reports.evaluation_report import (
    evaluation_figure,
    evaluation_report,
    scenes_of,
    trend_figure,
)
from friction_comp.reports.figures import COLOURS, for_page, new_figure, thin_extremes
from friction_comp.reports.moving_joint import moving_joint, MovingScene, still_joint

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


def test_a_page_says_the_same_without_script(page):
    assert page.count('<script') == 2
    assert not re.search(r'<(script|link)[^>]*(src|href)=', page)
    body = re.sub(r'<script.*?</script>', '', page, flags=re.DOTALL)
    assert 'd = ±1' in body
    assert len(re.findall(r'<figure', body)) == 2


@pytest.mark.parametrize('scale', ['linear', 'log'])
def test_a_drawing_tells_the_script_the_values_of_its_curves(scale):
    figure, (above, below) = new_figure(rows=2, sharex=True)
    x, y = np.array([0.1, 1.0, 4.0]), np.array([-3.0, 2.0, 7.5])
    above.axhline(0.0)
    above.plot(x, y, label='one')
    below.plot(x, -y, 'o-')
    below.set(xscale=scale, xlabel='time (s)', ylabel='torque (N·m)')
    document = minidom.parseString(for_page(figure)[0])
    panels = json.loads(document.documentElement.getAttribute('data-panels'))
    assert [panel['names'] for panel in panels] == [['one'], ['']]
    assert [axis['group'] for panel in panels for axis in panel['scales']] == [0, 0, 0, 1]
    assert panels[0]['scales'][0]['label'] == 'time (s)'
    curve = next(node for node in document.getElementsByTagName('g')
                 if node.getAttribute('id') == 'curve-0-0')
    drawn = re.findall(r'[ML] (\S+) (\S+)', curve.getElementsByTagName('path')[0].getAttribute('d'))
    left, top, width, height = panels[0]['box']
    (a, b), (low, high) = (axis['limits'] for axis in panels[0]['scales'])
    for (across, down), *values in zip(np.array(drawn, dtype=float), x, y):
        share = (across - left) / width
        read = a * (b / a) ** share if scale == 'log' else a + share * (b - a)
        assert [read, high - (down - top) / height * (high - low)] == pytest.approx(
            values, abs=1e-3)


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


def test_the_joint_moves_as_it_was_recorded(evaluation):
    scenes = scenes_of(evaluation)
    assert [scene.title for scene in scenes] == ['Direction unknown', 'Direction known']
    drawings = moving_joint(scenes)
    for scene, drawing in zip(scenes, drawings):
        turning, = (node for node in minidom.parseString(drawing).getElementsByTagName(
            'animateTransform'))
        angles = [float(value.split()[0]) for value in turning.getAttribute('values').split(';')]
        # Up is negative in SVG.
        assert np.ptp(angles) == pytest.approx(np.degrees(np.ptp(scene.position)), abs=0.5)
        assert f'peak {scene.peak:.2f} N·m' in drawing


def test_headline_comparison_picture_and_tables_show_the_same_torques_and_colours(
        evaluation, page):
    pair = evaluation.pair()
    headline = evaluation.compared('peak_torque')
    compared = next(c for c in evaluation.comparisons if c.figure == 'peak_torque'
                    and (c.first, c.second) == pair)
    assert headline == pytest.approx((compared.mean_first, compared.mean_second))
    assert page.count(f'{number(headline[0])} N·m') >= 2
    scenes = scenes_of(evaluation)
    for scene, condition in zip(scenes, pair):
        assert any(scene.peak == c.mean_of('peak_torque') for c in evaluation.conditions
                   if c.compensation == condition)
    # Orange is the person's torque: no condition has it.
    assert [scene.colour for scene in scenes] == ['grey', 'blue']
    assert COLOURS['orange'] not in evaluation_figure_colours(evaluation)


def test_a_condition_has_one_colour_in_movements_trends_and_animation(evaluation):
    pair = evaluation.pair()
    days = {day: mean_interval([1.0, 2.0]) for day in ('2026-01-01', '2026-01-02')}
    drawn = trend_figure([Trend('peak_torque', one, days, None, None) for one in pair], evaluation)
    trends = [bars.lines[0].get_color() for bars in drawn.axes[0].containers]
    movements = [next(
        line.get_color() for line in evaluation_figure(evaluation).axes[0].get_lines()
        if str(line.get_label()).startswith(evaluation.label(one))) for one in pair]
    animation = [COLOURS[scene.colour] for scene in scenes_of(evaluation)]
    assert trends == movements == animation == [COLOURS['grey'], COLOURS['blue']]


def evaluation_figure_colours(evaluation):
    return {line.get_color() for axes in evaluation_figure(evaluation).axes
            for line in axes.get_lines()}


def test_a_torque_that_is_not_measured_has_no_arrow():
    drawing = still_joint(0.3, float('nan'), 1.0, 0.0)
    assert 'not measured' in drawing
    assert 'y2="120.0"' in drawing
    minidom.parseString(drawing)
    steady = MovingScene('still', np.arange(3.0), np.zeros(3), np.zeros(3))
    assert 'peak 0.00 N·m' in moving_joint([steady])[0]


def test_the_picture_of_the_readme_is_drawn_from_the_examples():
    stored = (ROOT / 'docs' / 'moving.svg').read_text(encoding='utf-8')
    numbers = [np.array(re.findall(r'-?\d+\.\d+', text), dtype=float)
               for text in (stored, script('pictures').moving())]
    np.testing.assert_allclose(numbers[1], numbers[0], atol=0.2)
