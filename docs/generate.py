# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the parts of pages that come from code and from figures that commands wrote.

    python3 docs/generate.py                          writes all of them anew
    python3 docs/generate.py demo friction_comp_demo/report.json

The second form stores the few figures that pages quote in docs/figures/, with the `command`, as do
all of STORES. A part stands between ``<!-- NAME -->`` and ``<!-- end -->``; a test compares pages
with what would be written.
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Callable
from contextlib import suppress
import inspect
import io
import json
from pathlib import Path
import re
import sys
import tokenize
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
STORED = HERE / 'figures'
PART = re.compile(r'(<!-- ([\w ]+) -->\n)(.*?)(<!-- end -->)', re.DOTALL)


def rows(head: list[str], body: list[list[str]]) -> str:
    """Return a table in Markdown."""
    def line(cells: list[str]) -> str:
        return f'| {" | ".join(cells)} |'.replace('|  |', '| |').replace('|  |', '| |')
    return '\n'.join([line(head), '|---' * len(head) + '|', *map(line, body)]) + '\n'


# From code.

def options() -> str:
    """Return every option of the tools once, from their parsers."""
    from friction_comp.__main__ import tool, TOOLS
    from friction_comp.tools.common import Arguments

    found: dict[str, tuple[str, list[str], str]] = {}

    def keep(parser: Arguments, argv: Any = None) -> None:
        for action in parser._actions:
            names = [name for name in action.option_strings if name.startswith('--')]
            if not names or names == ['--help']:
                continue
            metavar = action.metavar or ''
            value = ' '.join(metavar) if isinstance(metavar, tuple) else metavar
            if action.choices and not value:
                value = '|'.join(map(str, action.choices))
            text = (action.help or '') % {'default': action.default}
            found.setdefault(names[0], (value, [], text))[1].append(parser._name)
        raise SystemExit(0)
    parse, Arguments.parse = Arguments.parse, keep
    try:
        for name in TOOLS:
            with suppress(SystemExit):
                tool(name)([])
    finally:
        Arguments.parse = parse
    # The tools that read recordings; `all` are those that write results.
    groups = {'recordings': found['--columns'][1], 'all': found['--output'][1]}

    def who(tools: list[str]) -> str:
        for name, group in groups.items():
            if set(group) <= set(tools):
                return ', '.join([name, *(tool for tool in tools if tool not in group)])
        return ', '.join(tools)
    return rows(['option', 'of', 'meaning'], [
        [f'`{name}{f" {value}" if value else ""}`'.replace('|', '\\|'), who(tools),
         text.replace('|', '\\|')]
        for name, (value, tools, text) in sorted(found.items())])


def fields(kind: type) -> list[list[str]]:
    """Return name and meaning of a dataclass's fields, from the comments beside or above them."""
    lines = inspect.getsource(kind)
    comments = {token.start[0]: token.string[1:].strip()
                for token in tokenize.generate_tokens(io.StringIO(lines).readline)
                if token.type == tokenize.COMMENT}
    alone = {number for number in comments
             if lines.splitlines()[number - 1].lstrip().startswith('#')}
    definition = ast.parse(lines).body[0]
    assert isinstance(definition, ast.ClassDef)
    found = []
    for node in definition.body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            above, number = [], node.lineno - 1
            while number in alone:
                above.insert(0, comments[number])
                number -= 1
            own = comments.get(node.end_lineno or 0, '')
            found.append([f'`{node.target.id}`', own or ' '.join(above)])
    return found


def report_fields() -> str:
    """Return the entries of report.json of `refine` and `evaluate`."""
    from friction_comp.evaluation.conditions import Comparison, Condition, Evaluation
    from friction_comp.model.friction_numbers import FrictionNumbers
    from friction_comp.refinement import result as refined

    curves = {'`time`', '`torque`', '`torque_std`', '`position`', '`position_std`', '`reference`',
              '`compensation`', '`repetitions`'}
    parts = []
    for title, kind, left_out in (
            ('`refine`', refined.RefinementReport, set()),
            ('`before`, `after`', refined.Errors, set()),
            ('an entry of `effects`', refined.FoundEffect, set()),
            ('`friction`', FrictionNumbers, set()),
            ('an entry of `findings`', refined.Finding, set()),
            ('`evaluate`', Evaluation, {'`repetitions`'}),
            ('an entry of `conditions`', Condition, curves - {'`repetitions`'}),
            ('an entry of `comparisons`', Comparison, set())):
        own = [row for row in fields(kind) if row[0] not in left_out]
        # Names that say all stand together.
        plain = ', '.join(name for name, meaning in own if not meaning)
        parts.append(rows([title, ''], [
            *([[plain, '']] if plain else []), *(row for row in own if row[1])]))
    return '\n'.join(parts)


def findings() -> str:
    """Return the codes of refinement's findings, with what each says."""
    from friction_comp.refinement.judge import CODES

    return rows(['`code`', ''], [[f'`{code}`', said] for code, said in CODES.items()])


def effects() -> str:
    """Return the effects with the first line of their docstrings."""
    from friction_comp.model.effects import EFFECTS

    found = []
    for name, kind in EFFECTS.items():
        first = (inspect.getdoc(kind) or '').split('\n\n')[0].replace('\n', ' ')
        found.append([f'`{name}`', kind.variable, first.replace('``', '`').replace('|', '\\|')])
    return rows(['effect', 'depends on', ''], found)


# From figures that commands wrote.

def stored(name: str) -> Any:
    """Return stored figures."""
    return json.loads((STORED / f'{name}.json').read_text(encoding='utf-8'))


def claims() -> str:
    """Return the claims of the page of results: claim, figure, yardstick and command."""
    return rows(['claim', 'figure', 'yardstick', 'command'], [
        [one['claim'], one['figure'], one['yardstick'],
         f'`{one["command"]}`' if one['command'] else ''] for one in stored('claims')])


def said() -> str:
    """Return the errors that refinement said and that were found, of the measured recordings."""
    from friction_comp.terminal import number

    return rows(
        ['recording', 'refine', 'Coulomb + viscous', 'by hand', 'block sums', 'b020189', 'terms',
         'said', 'true', 'true / said', 'verdict'],
        [[one['set'].replace('_', ' '), f'{number(one["error"])} {one["unit"]}',
          *(number(one[name]) for name in ('plain', 'by_hand', 'sums')),
          number(one['earlier'] and one['earlier']['error']), str(one['terms']),
          number(one['said']), number(one['true']), f'{one["true"] / one["said"]:.2f}',
          one['verdict']] for one in stored('said')['rows']])


def demo() -> str:
    """Return the demo's table."""
    from friction_comp.terminal import number

    numbers = stored('demo')
    titles = {'none': 'no compensation', 'kinetic': 'kinetic friction only, d = 0',
              'continuous': 'identified model, d = ±1', 'refined': 'refined model, d = ±1'}
    errors = dict(zip(('continuous', 'refined'), numbers['residual']))
    return rows(['', 'peak, N·m', 'RMS, N·m', 'current error, mA'], [
        [titles[name], '> ' * (stuck > 0) + number(peak), number(rms),
         number(1e3 * errors[name]) if name in errors else '']
        for name, (peak, rms, stuck) in numbers['trials'].items()])


def well() -> str:
    """Return how well the package does, in three rows of what other tables hold."""
    from friction_comp.terminal import number

    real = next(one for one in stored('said')['rows'] if one['set'] == 'ur10e_joint2')
    taken = {name: stored('laws')['laws'][name][1] for name in ('announced', 'tanh')}
    felt = {name: '{:.0f} ({:.0f}) %'.format(*(max(0.0, 100.0 - share) for share in shares))
            for name, shares in taken.items()}
    peak = {name: f'{trial[0]:.2f} N·m' for name, trial in stored('demo')['trials'].items()}
    return rows(['', 'this package', 'yardstick'], [
        ['a real UR10e, joint 2: error on a recording that was not fitted',
         f'{number(real["error"])} A',
         f'{number(real["plain"])} A with Coulomb and viscous friction'],
        ['friction that a hand feels, moving to and fro at 0.6 Hz with the direction known; seven '
         'simulated gears, median (worst)', felt['announced'],
         f'{felt["tanh"]} with 0.9 · Coulomb · tanh; 100 % without help'],
        ['the demo: torque to set the joint in motion', peak['refined'],
         f'{peak["none"]} without help']])


def reproduce() -> str:
    """Return the table of the note's figures."""
    from friction_comp.note.experiments import compared

    configurations = stored('reproduce')['configurations']
    return rows(['', *(f'configuration {name}' for name in configurations)],
                compared(configurations))


# For whom a law is, and what happens when one lets go of the joint, beside how many move on.
LAWS = {
    'announced': ('`continuous`, announced', 'exercises whose next movement is known', ''),
    'unknown': ('`continuous`, d = 0', 'hand guiding, leader arms, exercises without a plan', ''),
    'unmeasured': ('the same, presliding unknown', 'the same, without slow reversals', ''),
    'desired': ('`desired`', 'followers: joints that another controller moves along a reference',
                '**warning**: it pushes while a direction is announced'),
    'tanh': ('0.9 · Coulomb · tanh(v / 0.03 rad/s)', 'comparing: two lines of code', ''),
    'kinetic': ('`kinetic`', 'comparing: the printed law, d = 0', '**warning**: '),
    'paper': ('`paper`', 'reproducing the note', 'as `kinetic`; at rest it pushes in direction d'),
    'none': ('`none`', 'the bare drive', 'the joint stops')}


def laws() -> str:
    """Return the table of the laws."""
    numbers = stored('laws')
    shares = {name: [f'{median:.0f} ({worst:.0f}) %' for median, worst in row]
              for name, row in numbers['laws'].items()}
    after = {name: f'{moving} of {all_} move on' for name, (moving, all_) in
             numbers['moving'].items()}
    return rows(
        ['law', 'for whom', *(f'{f:g} Hz' for f in numbers['frequencies']),
         '6 s after one lets go'],
        [[law, whom, *shares.get(name, 3 * ['0 %' if name == 'none' else '–']),
          words + after.get(name, '')] for name, (law, whom, words) in LAWS.items()])


def conditions() -> str:
    """Return the table of reaches under other sensors, gears and models, in both worlds."""
    found: dict[str, dict[str, str]] = {}
    for row in stored('conditions')['rows']:
        name, what = row['floor'].removeprefix('reach from rest, d = 0, ').replace(
            ', 2 to 5 ms late', '').rsplit(': ', 1)
        found.setdefault(name, {})[row['world'] + what] = '{:.0f} ({:.0f}); {:.0f}; {:.0f}'.format(
            *(row[key] for key in ('value', 'worst', 'tanh', 'kinetic')))
    columns = [world + what for what in ('RMS', 'start') for world in ('gear', 'mujoco')]
    return rows(['', 'RMS', 'RMS, MuJoCo', 'start', 'start, MuJoCo'], [
        [name, *(cells.get(column, '–') for column in columns)] for name, cells in found.items()])


def ablation() -> str:
    """Return what changes without each rule of the law, in both worlds."""
    found: dict[str, dict[str, str]] = {}
    for row in stored('ablation')['rows']:
        cells = dict(row)
        rule, world = cells.pop('rule'), cells.pop('world')
        found.setdefault(rule, {})[world] = ', '.join(
            f'{name} {text}'.replace(' of ', '/') for name, text in cells.items()) or '–'
    return rows(['without', 'simulated gears', 'MuJoCo'], [
        [rule, cells.get('gear', '–'), cells.get('mujoco_gear', '–')]
        for rule, cells in found.items()])


def first() -> str:
    """Return the numbers that the first command prints, with the true ones of the example."""
    numbers = stored('first')
    names = {'coulomb': ('Coulomb friction', 'N·m'), 'viscous': ('viscous friction', 'N·m·s/rad'),
             'inertia': ('inertia of the motor and all links that moved', 'kg·m²')}
    return rows(['it prints, among others', '', '95 % interval', 'truth'], [
        [title, f'{numbers[name][0]:.3f} {unit}',
         '{:.3f} to {:.3f}'.format(*numbers[name][1:]), f'{TRUTH[name]:.3f}']
        for name, (title, unit) in names.items()])


# Of the simulated joint in examples/log.csv.
TRUTH = {'coulomb': 1.898, 'viscous': 1.841, 'inertia': 0.101}

PARTS: dict[str, Callable[[], str]] = {
    'options': options, 'report fields': report_fields, 'findings': findings, 'effects': effects,
    'claims': claims, 'said': said, 'first': first, 'well': well, 'demo': demo,
    'reproduce': reproduce, 'laws': laws, 'conditions': conditions, 'ablation': ablation}


def written(text: str) -> str:
    """Return a page with its generated parts anew."""
    return PART.sub(lambda part: part[1] + PARTS[part[2]]() + part[4], text)


def pages() -> list[Path]:
    """Return the pages that have generated parts."""
    return [path for path in (ROOT / 'README.md', *sorted(HERE.glob('*.md')),
                              *sorted((ROOT / 'msg_docs').glob('*.md')))
            if PART.search(path.read_text(encoding='utf-8'))]


# What is stored of a command's report.json, beside the command.

def _demo_numbers(report: dict[str, Any]) -> dict[str, Any]:
    trials: dict[str, list[dict[str, Any]]] = {}
    for one in report['conditions']:
        refined = one['law'] == 'continuous' and 'refined' in (one['model'] or '')
        trials.setdefault('refined' if refined else one['law'], []).append(one)
    return {'trials': {name: [sum(one[key] for one in own) / len(own) for key in (
                'peak_torque', 'rms_torque')] + [sum(one['stuck'] for one in own)]
                       for name, own in trials.items()},
            'residual': [report['residual']['before'], report['residual']['after']]}


def _reproduce_numbers(results: dict[str, Any]) -> dict[str, Any]:
    kept = ('breakaway', 'peak_torque', 'peak_reduction', 'false_starts')
    return {'configurations': {name: {entry: result[entry] for entry in kept}
                               for name, result in results['configurations'].items()}}


def _first_numbers(report: dict[str, Any]) -> dict[str, Any]:
    friction = report['friction']
    return {name: [friction[name], *friction['intervals'][name]]
            for name in ('coulomb', 'viscous', 'inertia')}


TOOL = 'python3 -m friction_comp'
STORES: dict[str, tuple[str, Callable[[Any], dict[str, Any]]]] = {
    'said': ('python3 bench/measured_table.py', lambda rows_: {'rows': rows_}),
    'first': (f'{TOOL} refine examples/log.csv --output output/log', _first_numbers),
    'demo': ('make demo', _demo_numbers),
    'reproduce': (f'{TOOL} reproduce --output reproduction --cycles 200', _reproduce_numbers),
    'laws': ('python3 bench/law_choice.py --seed {seed}', dict),
    'conditions': ('python3 bench/law_table.py --floors conditions --seed {seed}', dict),
    'ablation': ('python3 bench/law_ablation.py --seed {seed}', dict)}


def main() -> None:
    """Store figures, if they are given, and write all generated parts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('name', choices=STORES, nargs='?')
    parser.add_argument('result', type=Path, nargs='?', help='the JSON file that a command wrote')
    arguments = parser.parse_args()
    if arguments.name:
        command, kept = STORES[arguments.name]
        report = json.loads(arguments.result.read_text(encoding='utf-8'))
        numbers = kept(report)
        (STORED / f'{arguments.name}.json').write_text(json.dumps(
            {'command': command.format(**numbers), **numbers}, indent=1, ensure_ascii=False)
            + '\n', encoding='utf-8')
    for page in pages():
        text = page.read_text(encoding='utf-8')
        page.write_text(written(text), encoding='utf-8')


if __name__ == '__main__':
    sys.path.insert(0, str(ROOT))
    main()
