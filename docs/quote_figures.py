# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the figures that README and docs/results.md quote: they come from what a command wrote.

    make demo && python3 docs/quote_figures.py demo friction_comp_demo/report.json
    python3 -m friction_comp reproduce --output reproduction --cycles 200
    python3 docs/quote_figures.py reproduce reproduction/results.json

stores the few numbers in docs/figures/, writes the page's table anew, and draws the demo's picture
from the recordings beside its report. Tests compare the pages with what is stored, and what is
stored with the experiments themselves.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import re
from typing import Any

from friction_comp.model.friction_model import FrictionModel
from friction_comp.note.note_report import compared
from friction_comp.recordings import read_recording
from friction_comp.reports.demo_report import EvaluatedTrial, torque_figure
from friction_comp.reports.evaluation_words import peak_text
from friction_comp.reports.figures import thin, to_file
from friction_comp.reports.html import number
from friction_comp.tools.demo_loop import TRIALS

ROOT = Path(__file__).resolve().parent.parent
STORED = ROOT / 'docs' / 'figures'
PICTURE = ROOT / 'docs' / 'demo.svg'
_TITLES = {name: title for name, title, *_ in TRIALS}
# Neither page colour nor text colour is known where a page shows the picture: both are its own.


def demo_numbers(report: dict[str, Any]) -> dict[str, Any]:
    """Return what is quoted of a demo's report.json."""
    return {'command': 'make demo', 'trials': {
        trial['name']: [trial['peak_torque'], trial['rms_torque'], trial['stuck']]
        for trial in report['trials']},
        'residual': [report['residual']['before'], report['residual']['after']]}


def demo_table(numbers: dict[str, Any]) -> list[str]:
    """Return the table of the demo."""
    errors = dict(zip(('compensated', 'refined'), numbers['residual']))
    return _markdown(['', 'peak, N·m', 'RMS, N·m', 'current error, mA'], [
        [_TITLES[name], peak_text(peak, stuck), number(rms),
         number(1e3 * errors[name]) if name in errors else '']
        for name, (peak, rms, stuck) in numbers['trials'].items()])


def _markdown(head: list[str], rows: list[list[str]]) -> list[str]:
    first, *others = (f'| {" | ".join(row)} |'.replace('|  |', '| |') for row in (head, *rows))
    return [first, '|---' * len(head) + '|', *others]


def reproduce_numbers(results: dict[str, Any]) -> dict[str, Any]:
    """Return what is quoted of the tool reproduce's results.json."""
    kept = ('breakaway', 'peak_torque', 'peak_reduction', 'false_starts')
    return {'command': 'python3 -m friction_comp reproduce --output reproduction --cycles 200',
            'configurations': {name: {entry: result[entry] for entry in kept}
                               for name, result in results['configurations'].items()}}


def reproduce_table(numbers: dict[str, Any]) -> list[str]:
    """Return the table of the note's experiments."""
    configurations = numbers['configurations']
    return _markdown(['', *(f'configuration {name}' for name in configurations)],
                     compared(configurations))


def demo_words(numbers: dict[str, Any]) -> str:
    """Return what the demo's picture shows, for those who do not see it."""
    peaks = ', '.join(f'{_TITLES[name]} {peak_text(peak, stuck)}'.replace('> ', 'more than ')
                      for name, (peak, _, stuck) in numbers['trials'].items())
    return f'Torque in N·m that a person needs to move the joint, over time. Peaks: {peaks}.'


def demo_picture(numbers: dict[str, Any], folder: Path) -> str:
    """Return the picture of the demo's trials as SVG, drawn from their recordings."""
    drive = FrictionModel.load(folder / 'models' / 'armin_1.yaml').drive
    trials = [EvaluatedTrial(name, title, read_recording(
        folder / 'recordings' / name, 'armin_1', drive.torque_constant, drive.gear_ratio)[0])
        for name, title in _TITLES.items()]
    for condition in (one for trial in trials for one in trial.evaluation.conditions):
        condition.time, condition.torque, condition.torque_std = thin(
            condition.time, condition.torque, condition.torque_std, points=200)
    return to_file(torque_figure(trials), 'Back-driving torque in the demo', demo_words(numbers))


PAGES = {'demo': ROOT / 'README.md', 'reproduce': ROOT / 'docs' / 'results.md'}
KINDS = {'demo': (demo_numbers, demo_table), 'reproduce': (reproduce_numbers, reproduce_table)}


def quoted(text: str, name: str) -> list[str]:
    """Return the table of that name in a page's text.

    Raises
    ------
    SystemExit
        If it is not there.
    """
    found = re.search(_pattern(name), text, re.DOTALL)
    if not found:
        raise SystemExit(f'no table between <!-- {name} --> and <!-- end -->')
    return found[1].splitlines()


def _pattern(name: str) -> str:
    return rf'(?<=<!-- {name} -->\n)(.*?)(?=\n<!-- end -->)'


def main() -> None:
    """Store the figures and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('name', choices=KINDS)
    parser.add_argument('result', type=Path, help='the JSON file that the command wrote')
    arguments = parser.parse_args()
    numbers_of, table_of = KINDS[arguments.name]
    numbers = numbers_of(json.loads(arguments.result.read_text(encoding='utf-8')))
    page = PAGES[arguments.name]
    text = page.read_text(encoding='utf-8')
    quoted(text, arguments.name)
    STORED.mkdir(exist_ok=True)
    (STORED / f'{arguments.name}.json').write_text(
        json.dumps(numbers, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
    table = '\n'.join(table_of(numbers))
    page.write_text(re.sub(_pattern(arguments.name), lambda _: table, text, flags=re.DOTALL),
                    encoding='utf-8')
    if arguments.name == 'demo':
        PICTURE.write_text(demo_picture(numbers, arguments.result.parent), encoding='utf-8')


if __name__ == '__main__':
    main()
