# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Keeps the figures that README and docs quote: they come from what a command wrote.

    make demo && python3 docs/quote_figures.py demo friction_comp_demo/report.json

stores the few numbers in docs/figures/, writes the pages' table anew, and draws the pictures of the
demo's scenes from the recordings beside their reports; so does each of KINDS, of which the stored
numbers name the `command`. Tests compare the pages with what is stored, and what is stored with the
experiments themselves.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from pathlib import Path
import re
from typing import Any, NamedTuple

from friction_comp.demo.loop import recorded, TRIALS
from friction_comp.demo.pages import EvaluatedTrial, HandTrial, loops_figure, torque_figure
from friction_comp.demo.to_and_fro import WAYS
from friction_comp.note.note_report import compared
from friction_comp.number_text import number
from friction_comp.reports.evaluation_words import peak_text
from friction_comp.reports.figures import thin, to_file

ROOT = Path(__file__).resolve().parent.parent
STORED = ROOT / 'docs' / 'figures'
_TITLES = {name: title for name, title, *_ in TRIALS}


def _demo_numbers(report: dict[str, Any]) -> dict[str, Any]:
    return {'command': 'make demo', 'trials': {
        trial['name']: [trial['peak_torque'], trial['rms_torque'], trial['stuck']]
        for trial in report['trials']},
        'residual': [report['residual']['before'], report['residual']['after']]}


def _demo_table(numbers: dict[str, Any]) -> list[str]:
    errors = dict(zip(('compensated', 'refined'), numbers['residual']))
    return _markdown(['', 'peak, N·m', 'RMS, N·m', 'current error, mA'], [
        [_TITLES[name], peak_text(peak, stuck), number(rms),
         number(1e3 * errors[name]) if name in errors else '']
        for name, (peak, rms, stuck) in numbers['trials'].items()])


def _markdown(head: list[str], rows: list[list[str]]) -> list[str]:
    first, *others = (f'| {" | ".join(row)} |'.replace('|  |', '| |') for row in (head, *rows))
    return [first, '|---' * len(head) + '|', *others]


def _reproduce_numbers(results: dict[str, Any]) -> dict[str, Any]:
    kept = ('breakaway', 'peak_torque', 'peak_reduction', 'false_starts')
    return {'command': 'python3 -m friction_comp reproduce --output reproduction --cycles 200',
            'configurations': {name: {entry: result[entry] for entry in kept}
                               for name, result in results['configurations'].items()}}


def _reproduce_table(numbers: dict[str, Any]) -> list[str]:
    configurations = numbers['configurations']
    return _markdown(['', *(f'configuration {name}' for name in configurations)],
                     compared(configurations))


# For whom a law is, and what happens when one lets go of the joint, beside how many move on.
LAWS = {
    'announced': ('`continuous`, announced', 'exercises whose next movement is known', ''),
    'unknown': ('`continuous`, d = 0', 'hand guiding, leader arms, exercises without a plan', ''),
    'recorded': ('the same, presliding from reversals', 'the same, with a model of recordings', ''),
    'unmeasured': ('the same, presliding unknown', 'the same, without slow reversals', ''),
    'desired': ('`desired`', 'followers: joints that another controller moves along a reference',
                '**warning**: it pushes while a direction is announced'),
    'tanh': ('0.9 · Coulomb · tanh(v / 0.03 rad/s)', 'comparing: two lines of code', ''),
    'kinetic': ('`kinetic`', 'comparing: the printed law, d = 0', '**warning**: '),
    'paper': ('`paper`', 'reproducing the note', 'as `kinetic`; at rest it pushes in direction d'),
    'none': ('`none`', 'the bare drive', 'the joint stops')}


def _laws_numbers(result: dict[str, Any]) -> dict[str, Any]:
    return {'command': f'python3 bench/law_choice.py --seed {result["seed"]}', **result}


def _laws_table(numbers: dict[str, Any]) -> list[str]:
    shares = {name: [f'{median:.0f} ({worst:.0f}) %' for median, worst in row]
              for name, row in numbers['laws'].items()}
    after = {name: f'{moving} of {all_} move on' for name, (moving, all_) in
             numbers['moving'].items()}
    return _markdown(
        ['law', 'for whom', *(f'{f:g} Hz' for f in numbers['frequencies']),
         '6 s after one lets go'],
        [[law, whom, *shares.get(name, 3 * ['0 %' if name == 'none' else '–']),
          words + after.get(name, '')] for name, (law, whom, words) in LAWS.items()])


def _demo_words(numbers: dict[str, Any]) -> str:
    peaks = ', '.join(f'{_TITLES[name]} {peak_text(peak, stuck)}'.replace('> ', 'more than ')
                      for name, (peak, _, stuck) in numbers['trials'].items())
    return f'Torque in N·m that a person needs to move the joint, over time. Peaks: {peaks}.'


def _demo_picture(numbers: dict[str, Any], folder: Path) -> str:
    trials = [EvaluatedTrial(name, title, recorded(folder / 'recordings' / name))
              for name, title in _TITLES.items()]
    for condition in (one for trial in trials for one in trial.evaluation.conditions):
        condition.time, condition.torque, condition.torque_std = thin(
            condition.time, condition.torque, condition.torque_std, points=200)
    return to_file(torque_figure(trials), 'Back-driving torque in the demo', _demo_words(numbers))


def _to_and_fro_numbers(report: dict[str, Any]) -> dict[str, Any]:
    return {'command': 'python3 -m friction_comp demo --scene to_and_fro',
            'rms': {one['name']: one['rms_torque'] for one in report['to_and_fro']},
            'inertia': report['inertia_rms']}


def _to_and_fro_words(numbers: dict[str, Any]) -> str:
    return ('Torque of a hand over the angle, to and fro at 0.6 Hz. RMS: ' + ', '.join(
        f'{title} {numbers["rms"][name]:.2f}' for name, title, *_ in WAYS)
        + f', without friction {numbers["inertia"]:.2f} N·m.')


def _to_and_fro_picture(numbers: dict[str, Any], folder: Path) -> str:
    return to_file(loops_figure(_hands(folder, {name: title for name, title, *_ in WAYS})),
                   'A hand moves a joint to and fro', _to_and_fro_words(numbers))


def _hands(folder: Path, titles: dict[str, str]) -> dict[str, HandTrial]:
    return {name: HandTrial(title, recorded(folder / 'recordings' / name))
            for name, title in titles.items()}


class Kind(NamedTuple):
    """How a command's report.json becomes the stored numbers, and these a table or a picture."""

    numbers: Callable[[dict[str, Any]], dict[str, Any]]
    table: Callable[[dict[str, Any]], list[str]] | None = None
    pages: tuple[Path, ...] = ()
    words: Callable[[dict[str, Any]], str] | None = None
    picture: Callable[[dict[str, Any], Path], str] | None = None


README, DOCS = ROOT / 'README.md', ROOT / 'docs'
KINDS = {
    'demo': Kind(_demo_numbers, _demo_table, (README,), _demo_words, _demo_picture),
    'reproduce': Kind(_reproduce_numbers, _reproduce_table, (DOCS / 'results.md',)),
    'laws': Kind(_laws_numbers, _laws_table, (README, DOCS / 'compensation_law.md')),
    'to_and_fro': Kind(_to_and_fro_numbers, words=_to_and_fro_words, picture=_to_and_fro_picture)}


def quoted(text: str, name: str) -> list[str]:
    """Return the table of that name in a page's text; SystemExit says that there is none."""
    found = re.search(rf'<!-- {name} -->\n(.*?)\n<!-- end -->', text, re.DOTALL)
    if not found:
        raise SystemExit(f'no table between <!-- {name} --> and <!-- end -->')
    return found[1].splitlines()


def main() -> None:
    """Store the figures and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('name', choices=KINDS)
    parser.add_argument('result', type=Path, help='the JSON file that the command wrote')
    arguments = parser.parse_args()
    kind = KINDS[arguments.name]
    numbers = kind.numbers(json.loads(arguments.result.read_text(encoding='utf-8')))
    STORED.mkdir(exist_ok=True)
    (STORED / f'{arguments.name}.json').write_text(
        json.dumps(numbers, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
    for page in kind.pages:
        text = page.read_text(encoding='utf-8')
        old, new = ('\n'.join([f'<!-- {arguments.name} -->', *rows]) for rows in (
            quoted(text, arguments.name), kind.table(numbers)))
        page.write_text(text.replace(old, new), encoding='utf-8')
    if kind.picture:
        (DOCS / f'{arguments.name}.svg').write_text(
            kind.picture(numbers, arguments.result.parent), encoding='utf-8')


if __name__ == '__main__':
    main()
