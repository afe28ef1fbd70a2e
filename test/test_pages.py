# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages are self-contained; a figure has one value, and a colour one meaning."""

from html.parser import HTMLParser
from itertools import combinations
import json
import re

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.number_text import number, quantity
from friction_comp.recordings import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.evaluation_page import curves_figure, evaluation_page
from friction_comp.reports.figures import band, COLOURS, for_page, panels, scatter, WIDTH
from friction_comp.reports.html import Report, value
from friction_comp.reports.refinement_page import (
    effect_rows,
    errors,
    friction_rows,
    refinement_page,
)

LIVE_PAGES = True
VOID = {'meta', 'img', 'br', 'hr', 'link', 'input'}


class Page(HTMLParser):
    """Checks that tags match and keeps what a test asks for."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.ids, self.words = [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append((tag, attributes))
        if 'id' in attributes:
            self.ids.append(attributes['id'])
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def drawing():
    figure, axes = panels(['', ''], 'time [s]')
    x = np.linspace(0.0, 1.0, 50)
    band(axes[0], x, np.sin(x), 0.1 * x, 'predicted', 'mean')
    scatter(axes[1], x, np.cos(x), 'measured', 'dots')
    axes[0].legend()
    return figure


def page_with_everything():
    report = Report('Friction of <joint> & *drive*', 'a `subtitle`')
    report.heading('First')
    report.text('Words with **weight**, 2 * 3 = 6 and x < y.')
    report.bullets(['one', 'two'], 'Both:')
    report.numbers([('1.2 N·m', 'peak'), ('−65 %', 'change')])
    report.figure(drawing(), 'A curve that rises from **0** to 0.84.')
    report.figure(drawing(), 'The same "again".')
    report.heading('Second')
    report.table(['name', 'value'], [['a', 1.5], ['b', None], ['c', -20.25]], 'What was found')
    report.heading('Third')
    report.code('\nros2 run friction_comp plant <&>\n')
    return report


def test_page_is_whole_and_needs_nothing_else():
    text = page_with_everything().html()
    page = Page(text)
    assert page.of('html')[0]['lang'] == 'en'
    assert not page.of('script')
    assert not page.of('link')
    # Nothing is downloaded: the only addresses are names of XML namespaces.
    rest = re.sub(r'xmlns(:\w+)?="[^"]*"', '', text)
    assert 'http' not in rest
    for attributes in page.of('img'):
        assert attributes['src'].startswith('data:')
    assert len(page.ids) == len(set(page.ids))
    used = {a[k][1:] for a in page.of('use') for k in a if k.endswith('href')}
    assert used
    assert used <= set(page.ids)
    clips = set(re.findall(r'url\(#([^)]+)\)', text))
    assert clips
    assert clips <= set(page.ids)


def test_page_says_what_figures_show_and_escapes_text():
    text = page_with_everything().html()
    page = Page(text)
    drawings = [a for a in page.of('svg') if a.get('role') == 'img']
    assert [a['aria-label'] for a in drawings] == [
        'A curve that rises from 0 to 0.84.', 'The same "again".']
    assert 'Friction of &lt;joint&gt; &amp; *drive*' in text
    assert '2 * 3' in text.replace('\u00a0', ' ')
    assert '<strong>weight</strong>' in text
    assert '<li>two</li>' in text
    assert 'plant &lt;&amp;&gt;' in text
    assert 'currentColor' in text
    assert 'prefers-color-scheme: dark' in text
    assert '@media print' in text


def test_tables_align_numbers():
    report = Report('Table')
    report.table(['what', 'torque', 'count'], [
        ['a', 1.2345, 10], ['b', -0.5, 2], ['c', None, None], ['d', float('nan'), 3]])
    page = Page(report.html())
    cells = [a.get('class') for a in page.of('td')]
    assert cells == [None, 'number', 'number'] * 4
    words = [word.strip() for word in page.words if word.strip()]
    assert [w for w in words if w in ('1.23', '−0.500', '–', '10')] == [
        '1.23', '10', '−0.500', '–', '–', '–']
    with pytest.raises(ValueError, match='argument'):
        report.table(['one'], [['a', 'b']])


@pytest.mark.parametrize(('value', 'text'), [
    (None, '–'), (float('nan'), '–'), (0.0, '0'), (12, '12'), (1.23456, '1.23'),
    (-0.001234, '−0.00123'), (123456.0, '123456'), (1.5e-7, '1.50e−07'),
    (np.float64(9.994), '9.99'), (np.int64(3), '3'), (float('inf'), 'inf'),
])
def test_numbers_are_short(value, text):
    assert number(value) == text


@pytest.fixture(scope='module')
def evaluation():
    found, = evaluate_recordings([ROOT / 'examples' / 'elbow'])
    return found


@pytest.fixture(scope='module')
def refined(tmp_path_factory):
    result = refine(read_recording(ROOT / 'examples' / 'log.csv'))
    return result, refinement_page(result, ['log.csv'], tmp_path_factory.mktemp('page'))


def texts_of(page):
    """Return the texts that a page shows for each name."""
    found = {}
    for name, text in page.values:
        found.setdefault(name, set()).add(text.replace('\u00a0', ' '))
    return found


def test_a_figure_has_one_value_wherever_a_page_shows_it(evaluation, refined):
    page = Report('Two')
    page.verdict(f'It is **{value("peak", "1.2 N·m")}**.')
    page.numbers([(value('peak', '1.3 N·m'), 'peak')])
    assert texts_of(page) == {'peak': {'1.2 N·m', '1.3 N·m'}}
    for real, least in ((refined[1], 8), (evaluation_page([evaluation]), 2)):
        texts = texts_of(real)
        assert len(texts) >= least
        assert {name: own for name, own in texts.items() if len(own) > 1} == {}
        # Each of the most important stands in the first box or tiles, and in a table.
        assert max(name for name, _ in real.values)
        assert any(sum(name == other for other, _ in real.values) > 1 for name in texts)


def test_every_number_of_a_page_is_that_of_the_report(evaluation, refined):
    report, texts = refined[0].report, texts_of(refined[1])
    rows = [*friction_rows(report.friction), *effect_rows(report)]
    expected = {row.key: row.value for row in rows} | {key: text for key, _, text in errors(report)}
    assert texts == {name: {text} for name, text in expected.items()} | {
        'elsewhere': {quantity(report.after.elsewhere_motion_rmse, report.unit)}}
    assert expected['coulomb'] == f'{report.friction.coulomb:.3f} N·m'
    assert expected['error'] == quantity(report.after.held_out_rmse, report.unit)
    shown = {text for own in texts_of(evaluation_page([evaluation])).values() for text in own}
    found = evaluation.comparison('peak_torque')
    assert shown == {f'{number(mean)} N·m' for mean in (found.mean_first, found.mean_second)}


def test_nothing_is_judged_from_two_repetitions(evaluation):
    assert all(c.repetitions == 2 for c in evaluation.conditions)
    text = evaluation_page([evaluation]).html()
    assert '±\u00a0' not in text
    assert 'p\u00a0' not in text
    assert 'That is not judged' in text


def test_what_came_before_the_movement_is_shaded(evaluation):
    for axes in curves_figure(evaluation).axes:
        spans = [patch.get_extents().x1 for patch in axes.patches]
        torque = axes.get_ylabel().startswith('torque')
        assert bool(spans) == torque
        if torque:
            begin = axes.transData.transform((0.0, 0.0))[0]
            assert spans == pytest.approx([begin] * len(spans), abs=0.5)


# Colours that one figure may show together.
TOGETHER = (('measured', 'predicted'), ('no help', 'unknown', 'known', 'other'),
            ('no help', 'unknown', 'known', 'refined'), ('measured', 'out'))


@pytest.mark.parametrize('blind', [0, 1, None])
def test_colours_differ_for_people_of_any_colour_vision(blind):
    def seen(colour):
        rgb = np.array([int(COLOURS[colour][k:k + 2], 16) / 255.0 for k in (1, 3, 5)]) ** 2.2
        # Vienot, Brettel and Mollon (1999): protanopes and deuteranopes.
        lms = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714],
                        [0.0299566, 0.184309, 1.46709]]) @ rgb
        if blind == 0:
            lms[0] = 2.02344 * lms[1] - 2.52581 * lms[2]
        elif blind == 1:
            lms[1] = 0.494207 * lms[0] + 1.24827 * lms[2]
        rgb = np.linalg.solve(np.array([
            [17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714],
            [0.0299566, 0.184309, 1.46709]]), lms)
        return 255.0 * np.clip(rgb, 0.0, 1.0) ** (1 / 2.2)
    for group in TOGETHER:
        for one, other in combinations(group, 2):
            assert np.linalg.norm(seen(one) - seen(other)) > 40.0, (one, other)


def test_letters_of_figures_can_be_read_on_a_phone():
    figure, axes = panels(['a'], 'x')
    axes[0].plot([0, 1], [0, 1])
    width = 440.0 / (72.0 * WIDTH)
    sizes = {float(size) for size in re.findall(r'font-size: ([\d.]+)px', for_page(figure))}
    assert min(sizes) * width >= 8.0


def test_the_first_command_answers_in_25_lines(tmp_path, capsys):
    assert run('refine', [str(ROOT / 'examples' / 'log.csv'), '--output', str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 25
    # How the columns were read, what to do, the numbers, what next.
    assert 'log.csv: 20 s, 2000 rows; ' in lines[0]
    assert 'torque in N·m' in lines[0]
    assert lines[2].startswith('TRUST this model')
    report = json.loads((tmp_path / 'report.json').read_text(encoding='utf-8'))
    rows = {line.split()[0]: line for line in lines if line}
    assert rows['Coulomb'].split()[1] == f'{report["friction"]["coulomb"]:.3f}'
    assert ' to ' in rows['inertia']
    assert lines.index('next') > lines.index(rows['inertia'])
    assert {'look', 'simulate', 'feed', 'compensate'} <= set(rows)
