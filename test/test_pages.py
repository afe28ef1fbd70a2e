# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Pages are self-contained, and a figure has one value."""

import json
from pathlib import Path
import re

from helpers import ROOT
import numpy as np
import pytest

from friction_comp.__main__ import run
from friction_comp.drive import Drive
from friction_comp.evaluation.conditions import evaluate_recordings
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.recordings.reader import read_recording
from friction_comp.refinement import refine
from friction_comp.reports.evaluation_page import evaluation_page
from friction_comp.reports.figures import band, panels, scatter
from friction_comp.reports.html import Report
from friction_comp.reports.refinement_page import (
    effect_rows,
    errors,
    friction_rows,
    next_steps,
    refinement_page,
)
from friction_comp.terminal import number, quantity


def page_with_everything():
    figure, axes = panels(['', ''], 'time [s]')
    x = np.linspace(0.0, 1.0, 50)
    band(axes[0], x, np.sin(x), 0.1 * x, 'predicted', 'mean')
    scatter(axes[1], x, np.cos(x), 'measured', 'dots')
    axes[0].legend()
    report = Report('Friction of <joint> & *drive*', 'a `subtitle`')
    report.heading('First')
    report.text('Words with **weight**, 2 * 3 = 6 and x < y.')
    report.bullets(['one', 'two'], 'Both:')
    report.numbers([('1.2 N·m', 'peak'), ('−65 %', 'change')])
    report.figure(figure, 'A curve that rises from **0** to 0.84.')
    report.figure(figure, 'The same "again".')
    report.table(['name', 'value'], [['a', 1.5], ['b', None], ['c', -20.25]], 'What was found')
    report.code('\nros2 run friction_comp plant <&>\n')
    return report


def test_a_page_needs_nothing_else_and_escapes_text():
    text = page_with_everything().html()
    assert not re.search('<script|<link', text)
    # Nothing is downloaded: the only addresses are names of XML namespaces.
    assert 'http' not in re.sub(r'xmlns(:\w+)?="[^"]*"', '', text)
    assert all(source.startswith('data:') for source in re.findall(r' src="([^"]*)', text))
    ids = re.findall(r' id="([^"]*)', text)
    used = set(re.findall(r'(?:href="|url\()#([^")]+)', text))
    assert len(ids) == len(set(ids))
    assert used
    assert used <= set(ids)
    assert re.findall(r'role="img" aria-label="([^"]*)', text) == [
        'A curve that rises from 0 to 0.84.', 'The same &quot;again&quot;.']
    for words in ('Friction of &lt;joint&gt; &amp; *drive*', '2 * 3', '<strong>weight</strong>',
                  'plant &lt;&amp;&gt;', 'prefers-color-scheme: dark', '@media print'):
        assert words in text.replace('\u00a0', ' ')


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


def test_every_number_of_a_page_is_that_of_the_report_wherever_it_stands(evaluation, refined):
    report, texts = refined[0].report, texts_of(refined[1])
    rows = [*friction_rows(report.friction), *effect_rows(report)]
    expected = {row.key: row.value for row in rows} | {key: text for key, _, text in errors(report)}
    assert texts == {name: {text} for name, text in expected.items()}
    assert expected['coulomb'] == f'{report.friction.coulomb:.3f} N·m'
    assert expected['error'] == quantity(report.after.held_out_rmse, report.unit)
    assert sorted(map(sorted, texts_of(evaluation_page([evaluation])).values())) == sorted(
        [f'{number(mean)} N·m'] for found in evaluation.comparisons
        for mean in (found.mean_first, found.mean_second))


def test_nothing_is_judged_from_two_repetitions(evaluation):
    assert all(c.repetitions == 2 for c in evaluation.conditions)
    text = evaluation_page([evaluation]).html()
    assert '\u00a0±\u00a0' not in text
    assert 'That is not judged' in text


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


@pytest.mark.parametrize('gear_ratio', [1.0, 100.0])
def test_a_command_is_only_given_if_it_works(gear_ratio):
    model = FrictionModel(Drive(1.0, gear_ratio), Sigmoid(1.0, -1.0, 9.0), notes={'unit': 'A'})
    steps = dict(next_steps(model, 'trust', [], [], Path('output')))
    assert ('export' in steps['simulate']) == (model.gain is not None)
