# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each rule of the compensation law earns: the law without it, on two worlds.

    python3 bench/law_ablation.py [--rules NAME ...] [--worlds gear mujoco] [--seed S] [--draws N]
                                  [--workers N] [--output ablation.json]
    python3 docs/generate.py ablation ablation.json

One line a rule and world: rows of `law_table` with that rule switched off, beside the law as it is.
A rule that changes no column earns nothing. A rule is switched off in a copy of the package, which
is compiled in a process of its own.
"""

import json
from pathlib import Path
import shutil
import sys
import tempfile

from bench_tools import processes, ROOT, table_parser

WORLDS = ('gear', 'mujoco')
FLOORS = ('release', 'untouched', 'knock', 'quiet', 'peak', 'to_and_fro')
# What stands in a file of compensation/, and what stands there without the rule.
RULES = {
    'as it is': ('tank_operator', '', ''),
    'tank: the slid way fills it': ('tank_operator', 'FILL = 0.025', 'FILL = 0.0'),
    'tank: rest fills it': ('tank_operator', 's.saved += p.distance * s.step / REST_TIME', 'pass'),
    'tank: it pays for the wish': ('tank_operator', 'if owed <= left:', 'if True:'),
    'wish before the turn': ('tank_operator', 'TURN_SHARE = 0.15', 'TURN_SHARE = 1e-9'),
    'wish before the turn: once a way': (
        'tank_operator', 'weight < 1.0 and s.way != WENT_ON', 'weight < 1.0'),
    'wish: heading, d = 0': (
        'tank_operator', 'elif aim == 0.0 and (s.way == RESTED', 'elif False and (s.way == RESTED'),
    'no motion within 0.05 R': ('tank_operator', 'STILL = 0.05', 'STILL = 0.0'),
    'preload waits above 0.01 rad/s': (
        'tank_operator', 'if abs(s.speed) < LEAD_SPEED else 0.0', ''),
    'preload takes 0.1 s': (
        'tank_operator', 'LEAD_TIME, LEAD_SPEED = 0.1,', 'LEAD_TIME, LEAD_SPEED = 1e-3,'),
    'preload begins at the help of motion': (
        'tank_operator', 's.z = math.copysign(min(abs(s.z), abs(s.friction) / (at_rest + '
        '1e-9)), s.z)', 'pass'),
    'pushed against the preload': (
        'tank_operator', 'if aim * s.heading < 0.0 and s.z * s.heading < 0.0 and s.way < SLOWED:',
        'if False:'),
    'another announcement must last': ('tank_operator', 'or s.lasted > 2.0 * REST_TIME', 'or True'),
    'a rest begins anew where the gear springs back': (
        'tank_operator', 'elif (s.mode == HELD and s.way == TURNED',
        'elif (False and s.way == TURNED'),
    'a held joint within the slip distance still rests': (
        'tank_operator', '        if left:\n', '        if True:\n'),
    'turn: sooner where help was given back': (
        'tank_operator', '(0.5 if s.way == SLOWED else 1.0)', '1.0'),
    'trust: early slip': ('tank_operator', 'EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 1.0, 0.94'),
    'trust: later slip': ('tank_operator', 'EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 0.7, 1.0'),
    'trust: slip from rest to rest': (
        'tank_operator', 'if p.slip < moved < MOVED and not is_pushed:', 'if False:'),
    'trust is kept from rest to rest': (
        'tank_operator', 'min(1.0, max(s.trust, s.trusted) + 1.0 - LATER)', '1.0'),
    'trust beyond the identified speeds': (
        'safety', 'HURRIED = math.radians(60.0), 0.7', 'HURRIED = math.radians(60.0), 1.0'),
    'breakaway friction near rest': ('law_kernel', 'STARTS = 3.0', 'STARTS = 1e-6'),
    'no sliding friction within presliding': (
        'law_kernel', 'within = 0.0 if s.mode == LEADING else min(1.0, max(0.0, 2.0 - moved))',
        'within = 0.0'),
    'a long way is helped less': ('law_kernel', 'LATE, LATE_TIME = 0.04', 'LATE, LATE_TIME = 0.0'),
    'reported velocity': ('law_kernel', 'AGREE_SHARE = 0.2', 'AGREE_SHARE = -1e9'),
    'speed is filtered': ('law_kernel', 'FILTER_TIME = 0.004', 'FILTER_TIME = 1e-6'),
    'slope limit': ('safety', 'TURN_TIME = 0.02', 'TURN_TIME = 1e-9'),
    'fade': ('safety', 'FADE_FROM, FADE_TO = 1.15, 1.5', 'FADE_FROM, FADE_TO = 1e6, 1e7'),
}
# Columns, by the beginnings of the rows of the table that they print.
COLUMNS = {
    'd = 0': 'to and fro, d = 0', 'unknown': 'to and fro, d = 0, presliding unknown',
    'announced': 'to and fro, announced', 'ahead': 'peak, 1 s ahead',
    'wrong': 'peak, wrongly announced, 1 s ahead', 'gains': 'let go, model ≤ 1.10',
    'moves': 'let go, model ≤ 1.05', 'runs': 'let go, friction 0.70',
    'pushed': 'pushed by 2 deg, model ≤ 1.10',
    'starts': 'untouched, model', 'lost': 'untouched, friction', 'carried': 'carried',
    'falls': 'unknown weight', 'rings': 'rings 2 s after a knock', 'flicker': 'announcement',
    'holds': 'vibrates, hold', 'stops': 'vibrates, second'}


def main():
    parser = table_parser(__doc__, seed=0, draws=1, workers=2)
    parser.add_argument('--rules', nargs='+', default=list(RULES), choices=RULES, metavar='NAME')
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--floors', nargs='+', default=list(FLOORS), choices=FLOORS)
    parser.add_argument('--output', type=Path, help='JSON file to write')
    options = parser.parse_args()
    print(f'{"without":50s} {"world":7s}' + ''.join(f'{name:>10s}' for name in COLUMNS))
    rows = []
    for rule in options.rules:
        for world, cells in without(rule, options):
            rows.append({'rule': rule, 'world': world, **cells})
            print(f'{rule:50s} {world:7s}' + ''.join(
                f'{cells.get(name, ""):>10s}' for name in COLUMNS), flush=True)
    if options.output:
        options.output.write_text(json.dumps({'seed': options.seed, 'rows': rows}, indent=1) + '\n',
                                  encoding='utf-8')


def without(rule, options):
    """Yield each world and its figures, by column, with a rule switched off."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / 'friction_comp', Path(folder) / 'friction_comp',
                        ignore=shutil.ignore_patterns('__pycache__'))
        name, old, new = RULES[rule]
        path = Path(folder) / 'friction_comp' / 'compensation' / f'{name}.py'
        path.write_text(path.read_text(encoding='utf-8').replace(old, new), encoding='utf-8')
        with processes(options.workers, initializer=import_from, initargs=(folder,)) as pool:
            jobs = [(world, floor, options.seed, options.draws)
                    for world in options.worlds for floor in options.floors]
            found = list(pool.map(figures, jobs))
    for world in options.worlds:
        yield world, {name: text for job, cells in zip(jobs, found) if job[0] == world
                      for name, text in cells.items()}


def import_from(folder):
    """Let this process import the package from a folder."""
    sys.path.insert(0, folder)


def figures(job):
    """Return one floor's figures on one world, by column."""
    # The copy of the package that this process imports.
    from law_table import bank_of, FLOORS

    world, floor, seed, draws = job
    cells = {}
    for row in FLOORS[floor](bank_of(world, 'true', seed, draws)[0], 'continuous'):
        for name, begins in COLUMNS.items():
            if (row.floor == begins if begins in COLUMNS['unknown'] else
                    row.floor.startswith(begins)) and name not in cells:
                cells[name] = row.measured.split(' / ')[0].replace(' of ', '/')
    return cells


if __name__ == '__main__':
    main()
