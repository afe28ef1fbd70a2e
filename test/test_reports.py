# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages are self-contained, and files that tools write are complete or absent."""

import argparse
from html.parser import HTMLParser
import json
from pathlib import Path
import re

import numpy as np
import pytest

from friction_comp.errors import InputError
from friction_comp.files import output_folder
from friction_comp.number_text import number
from friction_comp.reports.figures import band, new_figure, scatter
from friction_comp.reports.html import Report
from friction_comp.results import to_json
from friction_comp.tools.common import Arguments, positive, progress, whole_number

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
    figure, axes = new_figure(1, 2, sharey=True)
    x = np.linspace(0.0, 1.0, 50)
    band(axes[0], x, np.sin(x), 0.1 * x, 'blue', 'mean')
    scatter(axes[1], x, np.cos(x), 'orange', 'dots')
    axes[0].legend()
    axes[0].set_xlabel('time [s]')
    return figure


def page_with_everything():
    report = Report('Friction of <joint> & *drive*', 'a `subtitle`')
    report.heading('First')
    report.text('Words with **weight**, 2 * 3 = 6 and x < y.\n\n- one\n- two\n  more')
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
    assert all(target[1:] in page.ids for target in (
        a['href'] for a in page.of('a')) if target.startswith('#'))
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
    assert 'Friction of &lt;joint&gt; &amp; <em>drive</em>' in text
    assert '2 * 3' in text.replace('\u00a0', ' ')
    assert '<strong>weight</strong>' in text
    assert '<li>two\nmore</li>' in text
    assert 'plant &lt;&amp;&gt;' in text
    assert 'currentColor' in text
    assert 'prefers-color-scheme: dark' in text
    assert '@media print' in text


def test_many_dots_are_drawn_as_pixels():
    figure, axes = new_figure()
    random = np.random.default_rng(0)
    axes.plot(random.normal(size=30_000), random.normal(size=30_000), '.')
    report = Report('Large')
    report.figure(figure, 'Noise.')
    text = report.html()
    assert 'data:image/png;base64,' in text
    assert len(text) < 700_000


def test_a_verdict_breaks_no_number_from_its_unit():
    page = Report('A page')
    page.verdict('**0.3\u00a0N·m**,\nless than 1\u202fA.\n\nSecond.')
    assert '<strong>0.3\u00a0N·m</strong>,\nless than 1\u202fA.</p>\n<p>Second.' in page.html()


def test_tables_align_numbers():
    report = Report('Table')
    report.table(['what', 'torque', 'count'], [
        ['a', 1.2345, 10], ['b', -0.5, 2], ['c', None, None], ['d', float('nan'), 3]])
    page = Page(report.html())
    cells = [a.get('class') for a in page.of('td')]
    assert cells == [None, 'number', 'number'] * 4
    words = [word.strip() for word in page.words if word.strip()]
    assert [w for w in words if w in ('1.23', '−0.50', '–', '10')] == [
        '1.23', '10', '−0.50', '–', '–', '–']
    with pytest.raises(ValueError, match='shorter'):
        report.table(['one'], [['a', 'b']])


@pytest.mark.parametrize(('value', 'text'), [
    (None, '–'), (float('nan'), '–'), (0.0, '0'), (12, '12'), (1.23456, '1.23'),
    (-0.001234, '−0.00123'), (123456.0, '123456'), (1.5e-7, '1.50e−07'),
    (np.float64(9.994), '9.99'), (np.int64(3), '3'), (float('inf'), 'inf'),
])
def test_numbers_are_short(value, text):
    assert number(value) == text


def test_saving_reports(tmp_path):
    page_with_everything().save(tmp_path / 'new' / 'page.html')
    assert (tmp_path / 'new' / 'page.html').read_text(encoding='utf-8').startswith('<!DOCTYPE')
    (tmp_path / 'file').write_text('')
    with pytest.raises(InputError, match='cannot be written'):
        Report('x').save(tmp_path / 'file' / 'page.html')


def test_output_appears_only_when_all_is_done(tmp_path):
    with output_folder(tmp_path / 'a' / 'b') as folder:
        (folder / 'one.txt').write_text('1')
        (folder / 'deep').mkdir()
        (folder / 'deep' / 'two.txt').write_text('2')
        assert not (tmp_path / 'a' / 'b' / 'one.txt').exists()
    assert sorted(p.name for p in (tmp_path / 'a' / 'b').rglob('*')) == [
        'deep', 'one.txt', 'two.txt']

    def fail(path):
        with output_folder(path) as folder:
            (folder / 'one.txt').write_text('half')
            raise InputError('no good')

    with pytest.raises(InputError, match='no good'):
        fail(tmp_path / 'a' / 'b')
    assert (tmp_path / 'a' / 'b' / 'one.txt').read_text() == '1'
    with pytest.raises(InputError, match='no good'):
        fail(tmp_path / 'fresh' / 'deeper')
    assert [p.name for p in tmp_path.iterdir()] == ['a']
    (tmp_path / 'file').write_text('')
    for path in (tmp_path / 'file', tmp_path / 'file' / 'below'):
        with pytest.raises(InputError, match='file'):
            fail(path)


def test_arguments_that_are_wrong_take_one_line(capsys):
    def parse(*argv):
        return Arguments('tool', 'Does things.').add_recordings().add_drive().add_output().parse(
            list(argv))

    for argv, words in (
            ((), 'RECORDING'), (('r',), '--output'),
            (('r', '--output', 'o', '--gear-ratio', '-3'), 'positive finite number'),
            (('r', '--output', 'o', '--torque-constant', 'x'), 'positive finite number'),
            (('r', '--output', 'o', '--what'), '--what')):
        with pytest.raises(SystemExit) as exit_:
            parse(*argv)
        assert exit_.value.code == 2
        error = capsys.readouterr().err
        assert error.count('\n') == 1
        assert error.startswith('tool: ')
        assert words in error
    arguments = parse('r', 's', '--output', 'o', '--gear-ratio', '100', '--ros-args', '-r', 'x:=y')
    assert arguments.recordings == [Path('r'), Path('s')]
    assert arguments.gear_ratio == 100.0
    assert arguments.torque_constant is None


def test_number_arguments():
    assert positive('0.5') == 0.5
    assert whole_number()('3') == 3
    for read, text in ((positive, 'nan'), (positive, 'inf'), (whole_number(), '0'),
                       (whole_number(2), '1'), (whole_number(), '1.5')):
        with pytest.raises(argparse.ArgumentTypeError):
            read(text)


def test_json_has_no_values_that_others_cannot_read():
    text = to_json({'a': np.float64('nan'), 'b': np.arange(3), 'c': [np.int8(1), np.bool_(True)],
                    'd': Path('x'), 1: float('inf'), 'τ': 0.5})
    assert json.loads(text) == {
        'version': 1, 'a': None, 'b': [0, 1, 2], 'c': [1, True], 'd': 'x', '1': None, 'τ': 0.5}
    assert 'τ' in text


def test_progress_is_silent_where_nobody_watches(capsys):
    with progress('reading') as report:
        report(0.5)
        report(2.0, 'done')
    assert capsys.readouterr() == ('', '')
