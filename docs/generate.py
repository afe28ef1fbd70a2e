# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the parts of pages that come from code and from figures that commands wrote.

    python3 docs/generate.py                          writes all of them anew
    python3 docs/generate.py demo friction_comp_demo/report.json

The second form stores the few figures that pages quote in docs/figures/, and draws the pictures
beside them; so does each of KINDS, of which the stored figures name the `command`. A part stands
between ``<!-- NAME -->`` and ``<!-- end -->``; a test compares pages with what would be written.
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
from typing import Any, NamedTuple

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
    from friction_comp.__main__ import TOOLS
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
            module = __import__(f'friction_comp.tools.{name}', fromlist=['main'])
            with suppress(SystemExit):
                module.main([])
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
    from friction_comp.number_text import number

    return rows(
        ['recording', 'refine', 'Coulomb + viscous', 'by hand', 'terms', 'said', 'true',
         'true / said', 'verdict'],
        [[one['set'].replace('_', ' '), f'{number(one["error"])} {one["unit"]}',
          number(one['plain']), number(one['by_hand']), str(one['terms']),
          number(one['said']), number(one['true']), f'{one["true"] / one["said"]:.2f}',
          one['verdict']] for one in stored('said')['rows']])


def demo() -> str:
    """Return the demo's table."""
    from friction_comp.demo.scenes import TRIALS
    from friction_comp.number_text import number

    numbers, titles = stored('demo'), {name: title for name, title, *_ in TRIALS}
    errors = dict(zip(('compensated', 'refined'), numbers['residual']))
    return rows(['', 'peak, N·m', 'RMS, N·m', 'current error, mA'], [
        [titles[name], '> ' * (stuck > 0) + number(peak), number(rms),
         number(1e3 * errors[name]) if name in errors else '']
        for name, (peak, rms, stuck) in numbers['trials'].items()])


def well() -> str:
    """Return how well the package does, in three rows of what other tables hold."""
    from friction_comp.number_text import number

    real = next(one for one in stored('said')['rows'] if one['set'] == 'ur10e_joint2')
    taken = {name: stored('laws')['laws'][name][1] for name in ('announced', 'tanh')}
    felt = {name: '{:.0f} ({:.0f}) %'.format(*(max(0.0, 100.0 - share) for share in shares))
            for name, shares in taken.items()}
    peak = {name: f'{trial[0]:.2f} N·m' for name, trial in stored('demo')['trials'].items()}
    return rows(['', 'this package', 'yardstick'], [
        ['a real UR10e, joint 2: error on a recording that was not fitted',
         f'{number(real["error"])} A',
         f'{number(real["plain"])} A with Coulomb and viscous friction'],
        ['friction that a hand feels, moving to and fro at 0.6 Hz with the direction known; eight '
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
        name, what = row['floor'].removeprefix('reach from rest, d = 0, ').rsplit(': ', 1)
        found.setdefault(name, {})[row['world'] + what] = '{:.0f} ({:.0f}); {:.0f}; {:.0f}'.format(
            *(row[key] for key in ('value', 'worst', 'tanh', 'kinetic')))
    columns = [world + what for what in ('RMS', 'start') for world in ('gear', 'mujoco')]
    return rows(['', 'RMS', 'RMS, MuJoCo', 'start', 'start, MuJoCo'], [
        [name, *(cells.get(column, '–') for column in columns)] for name, cells in found.items()])


def ablation() -> str:
    """Return what changes without each rule of the law, in both worlds."""
    whole: dict[str, dict[str, str]] = {}
    found: dict[str, list[str]] = {}
    for row in stored('ablation')['rows']:
        rule, cells = row.pop('rule'), row
        if rule == 'as it is':
            whole[row['world']] = cells
        changed = [f'{name} {whole[row["world"]][name]} → {text}' for name, text in cells.items()
                   if name != 'world' and differs(whole[row['world']][name], text)]
        found.setdefault(rule, []).append(', '.join(
            changed if rule != 'as it is' else [
                f'{name} {text}' for name, text in cells.items() if name != 'world']) or '–')
    return rows(['without', 'simulated gears', 'MuJoCo'], [
        [rule, *cells] for rule, cells in found.items()])


def differs(one: str, other: str) -> bool:
    """Return whether figures differ by more than the last joint or point that matters.

    They are a median and a worst in %, as 91 (65), or joints of all, as 3/126.
    """
    if '/' in one:
        return abs(int(one.split('/')[0]) - int(other.split('/')[0])) > 1
    both = [[float(value) for value in text.strip(')').split(' (')] for text in (one, other)]
    return abs(both[0][0] - both[1][0]) > 1.0 or abs(both[0][1] - both[1][1]) > 4.0


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

# The note, as printed: Eq. 11 row by row, and which row belongs to which configuration.
NOTE_ROWS = ((0.1101, 1.2456, 0.1359, 1.1671, 1.4959, 0.0008),
             (0.8896, 3.0735, 0.3082, 2.4381, 0.8727, 0.0032),
             (0.3629, 1.1022, 0.3000, 2.2795, 1.8775, 0.0027))
SWAPPED = (0, 2, 1)


def note_plateaus() -> str:
    """Return the plateaus of Eq. 11 beside the breakaway currents of the note."""
    from friction_comp.note.experiments import EXPERIMENTS

    plateau = [row[0] / row[3] for row in NOTE_ROWS]
    return rows(['', 'plateau as printed, A', 'swapped, A', 'breakaway, A'], [
        [f'configuration {k + 1}', f'{plateau[k]:.3f}', f'{plateau[SWAPPED[k]]:.3f}',
         f'{EXPERIMENTS[k].breakaway:.3f}'] for k in (1, 2)])


def note_peaks() -> str:
    """Return the peaks that the note measured, beside breakaway."""
    from friction_comp.note.experiments import EXPERIMENTS

    found = []
    for one in EXPERIMENTS:
        drive = one.model().drive
        torque = drive.torque_constant * drive.gear_ratio * one.breakaway
        found.append([f'configuration {one.number}', f'{torque:.2f}', f'{one.peak_kinetic:.2f}',
                      f'{one.peak_kinetic / torque:.2f}'])
    return rows(['', 'breakaway torque, N·m', 'peak with d = 0, N·m', 'share'], found)


def note_rest() -> str:
    """Return what the printed law commands at rest."""
    from friction_comp.note.experiments import EXPERIMENTS

    found = []
    for k, one in enumerate(EXPERIMENTS):
        c = NOTE_ROWS[SWAPPED[k]]
        rest = (c[0] - c[2]) / (c[3] + c[4])
        found.append([f'configuration {k + 1}' + ' (rows swapped)' * bool(k),
                      f'{1e3 * rest:.1f}'.replace('-', '\u2212'),
                      *(f'{(sign * rest + 0.9 * one.breakaway) / one.breakaway:.2f}'
                        for sign in (1, -1))])
    return rows(['', 'Eq. 6 at rest, mA', 'with d = 1', 'with d = \u22121'], found)


PARTS: dict[str, Callable[[], str]] = {
    'options': options, 'report fields': report_fields, 'findings': findings, 'effects': effects,
    'claims': claims, 'said': said, 'first': first, 'well': well, 'demo': demo,
    'reproduce': reproduce, 'laws': laws, 'conditions': conditions, 'ablation': ablation,
    'note plateaus': note_plateaus,
    'note peaks': note_peaks, 'note rest': note_rest}


def written(text: str) -> str:
    """Return a page with its generated parts anew."""
    return PART.sub(lambda part: part[1] + PARTS[part[2]]() + part[4], text)


def pages() -> list[Path]:
    """Return the pages that have generated parts."""
    return [path for path in (ROOT / 'README.md', *sorted(HERE.glob('*.md')),
                              *sorted((ROOT / 'msg_docs').glob('*.md')))
            if PART.search(path.read_text(encoding='utf-8'))]


# What is stored of a command's report, and the picture that is drawn of its recordings.

class Kind(NamedTuple):
    """How a command's report.json becomes the stored figures, and a picture with its words."""

    numbers: Callable[[dict[str, Any]], dict[str, Any]]
    words: Callable[[dict[str, Any]], str] | None = None
    draw: Callable[[Path], Any] | None = None


def _demo_numbers(report: dict[str, Any]) -> dict[str, Any]:
    return {'command': 'make demo', 'trials': {
        trial['name']: [trial['peak_torque'], trial['rms_torque'], trial['stuck']]
        for trial in report['trials']},
        'residual': [report['residual']['before'], report['residual']['after']]}


def _reproduce_numbers(results: dict[str, Any]) -> dict[str, Any]:
    kept = ('breakaway', 'peak_torque', 'peak_reduction', 'false_starts')
    return {'command': 'python3 -m friction_comp reproduce --output reproduction --cycles 200',
            'configurations': {name: {entry: result[entry] for entry in kept}
                               for name, result in results['configurations'].items()}}


def _to_and_fro_numbers(report: dict[str, Any]) -> dict[str, Any]:
    return {'command': 'python3 -m friction_comp demo --scene to_and_fro',
            'rms': {one['name']: one['rms_torque'] for one in report['to_and_fro']},
            'inertia': report['inertia_rms']}


def _to_and_fro_words(numbers: dict[str, Any]) -> str:
    from friction_comp.demo.scenes import WAYS

    return ('Torque of a hand over the angle, to and fro at 0.6 Hz. RMS: ' + ', '.join(
        f'{title} {numbers["rms"][name]:.2f}' for name, title, *_ in WAYS)
        + f', without friction {numbers["inertia"]:.2f} N·m.')


def _to_and_fro_picture(folder: Path) -> Any:
    from friction_comp.demo.pages import HandTrial, loops_figure
    from friction_comp.demo.scenes import recorded, WAYS

    return loops_figure({name: HandTrial(title, recorded(folder / 'recordings' / name))
                         for name, title, *_ in WAYS})


def _first_numbers(report: dict[str, Any]) -> dict[str, Any]:
    friction = report['friction']
    return {'command': 'python3 -m friction_comp refine examples/log.csv --output output/log', **{
        name: [friction[name], *friction['intervals'][name]]
        for name in ('coulomb', 'viscous', 'inertia')}}


KINDS = {
    'said': Kind(lambda rows_: {'command': 'python3 bench/measured_table.py', 'rows': rows_}),
    'first': Kind(_first_numbers),
    'demo': Kind(_demo_numbers),
    'reproduce': Kind(_reproduce_numbers),
    'laws': Kind(lambda result: {
        'command': f'python3 bench/law_choice.py --seed {result["seed"]}', **result}),
    'conditions': Kind(lambda result: {
        'command': f'python3 bench/law_table.py --floors conditions --seed {result["seed"]}',
        **result}),
    'ablation': Kind(lambda result: {
        'command': f'python3 bench/law_ablation.py --seed {result["seed"]}', **result}),
    'to_and_fro': Kind(_to_and_fro_numbers, _to_and_fro_words, _to_and_fro_picture)}


def main() -> None:
    """Store figures, if they are given, and write all generated parts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('name', choices=KINDS, nargs='?')
    parser.add_argument('result', type=Path, nargs='?', help='the JSON file that a command wrote')
    arguments = parser.parse_args()
    if arguments.name:
        kind = KINDS[arguments.name]
        numbers = kind.numbers(json.loads(arguments.result.read_text(encoding='utf-8')))
        (STORED / f'{arguments.name}.json').write_text(
            json.dumps(numbers, indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
        if kind.draw and kind.words:
            from pictures import to_file

            (HERE / f'{arguments.name}.svg').write_text(to_file(
                kind.draw(arguments.result.parent), 'A hand moves a joint to and fro',
                kind.words(numbers)), encoding='utf-8')
    for page in pages():
        text = page.read_text(encoding='utf-8')
        page.write_text(written(text), encoding='utf-8')


if __name__ == '__main__':
    sys.path.insert(0, str(ROOT))
    main()
