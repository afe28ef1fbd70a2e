# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each rule of the compensation law earns: the law without it, on two worlds.

    python3 bench/law_ablation.py [--rules NAME ...] [--worlds gear mujoco] [--seed S] [--draws N]
                                  [--workers N] [--output ablation.json]
    python3 docs/generate.py ablation ablation.json

One line a rule and world: those rows of `law_table` that the rule is for, with it switched off,
beside the law as it is. A rule that changes none earns nothing. It is switched off in a copy of the
package, which is compiled in a process of its own.
"""

import json
from pathlib import Path
import shutil
import sys
import tempfile

from bench_tools import processes, ROOT, table_parser

# Worlds with kinds of their gears, of which all cost too much in MuJoCo; and of what the table has,
# a part without yardsticks is enough to tell whether a rule has an effect.
WORLDS = {'gear': None, 'mujoco': ('harmonic', 'planetary')}
FREQUENCIES, SPEEDS = (0.3, 1.0), (40,)
FILES = ('law_kernel.py', 'safety.py')
# The floors that a rule is for; what stands in one of these files of compensation/, and what stands
# there without the rule.
RULES = {
    'as it is': ('release untouched knock quiet peak to_and_fro leader', '', ''),
    'tank: the slid way fills it': ('to_and_fro', 'FILL = 0.025', 'FILL = 0.0'),
    'tank: rest fills it': ('peak', 's.saved += p.distance * s.step / REST_TIME', 'pass'),
    'tank: it pays for the wish': ('untouched quiet', 'if owed <= left:', 'if True:'),
    'wish before the turn': ('to_and_fro', 'TURN_SHARE = 0.15', 'TURN_SHARE = 1e-9'),
    'wish before the turn: once a way': (
        'to_and_fro', 'weight < 1.0 and s.way != WENT_ON', 'weight < 1.0'),
    'wish: heading, d = 0': (
        'leader', 'elif aim == 0.0 and (s.way == RESTED', 'elif False and (s.way == RESTED'),
    'no motion within 0.05 R': ('knock peak', 'STILL = 0.05', 'STILL = 0.0'),
    'preload waits above 0.01 rad/s': ('release peak', 'if abs(s.speed) < LEAD_SPEED else 0.0', ''),
    'preload takes 0.1 s': (
        'peak untouched', 'LEAD_TIME, LEAD_SPEED = 0.1,', 'LEAD_TIME, LEAD_SPEED = 1e-3,'),
    'preload begins at the help of motion': (
        'release untouched',
        's.z = math.copysign(min(abs(s.z), abs(s.friction) / (at_rest + 1e-9)), s.z)', 'pass'),
    'pushed against the preload': (
        'peak', 'if aim * s.heading < 0.0 and s.z * s.heading < 0.0 and s.way < SLOWED:',
        'if False:'),
    'another announcement must last': ('knock', 'or s.lasted > 2.0 * REST_TIME', 'or True'),
    'a rest begins anew where the gear springs back': (
        'knock quiet', 'elif (s.mode == HELD and s.way == TURNED',
        'elif (False and s.way == TURNED'),
    'a held joint within the slip distance still rests': (
        'peak quiet', '        if left:\n', '        if True:\n'),
    'trust: early slip': ('untouched', 'EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 1.0, 0.94'),
    'trust: later slip': (
        'untouched release', 'EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 0.7, 1.0'),
    'trust: slip from rest to rest': (
        'release untouched', 'if p.slip < moved < MOVED and not is_pushed:', 'if False:'),
    'trust is kept from rest to rest': (
        'untouched', 'min(1.0, max(s.trust, s.trusted) + 1.0 - LATER)', '1.0'),
    'trust beyond the identified speeds': (
        'release', 'HURRIED = math.radians(60.0), 0.7', 'HURRIED = math.radians(60.0), 1.0'),
    'breakaway friction near rest': ('peak', 'STARTS = 3.0', 'STARTS = 1e-6'),
    'no sliding friction within presliding': (
        'peak untouched', 'else min(1.0, max(0.0, 2.0 - left))', 'else 0.0'),
    'a long way is helped less': ('release', 'LATE, LATE_TIME = 0.04', 'LATE, LATE_TIME = 0.0'),
    'reported velocity': ('to_and_fro peak', 'AGREE_SHARE = 0.2', 'AGREE_SHARE = -1e9'),
    'speed is filtered': ('to_and_fro quiet', 'FILTER_TIME = 0.004', 'FILTER_TIME = 1e-6'),
    'slope limit': ('quiet', 'TURN_TIME = 0.02', 'TURN_TIME = 1e-9'),
    'fade': ('release', 'FADE_FROM, FADE_TO = 1.15, 1.5', 'FADE_FROM, FADE_TO = 1e6, 1e7'),
}
# Columns, by the beginnings of the rows of the table that they print.
COLUMNS = {
    'd = 0': 'to and fro, d = 0', 'unknown': 'to and fro, d = 0, presliding unknown',
    'start': 'leader arm, d = 0, presliding unknown: start',
    'announced': 'to and fro, announced', 'ahead': 'peak, 1 s ahead',
    'wrong': 'peak, wrongly announced, 1 s ahead', 'gains': 'let go, model ≤ 1.10',
    'moves': 'let go, model of 1.10', 'fast': 'let go, model ≤ 1.43',
    'runs': 'let go, friction 0.70',
    'pushed': 'pushed by 2 deg, model ≤ 1.10',
    'starts': 'untouched, model', 'lost': 'untouched, friction', 'carried': 'carried',
    'falls': 'unknown weight', 'rings': 'rings 2 s after a knock', 'flicker': 'announcement',
    'holds': 'vibrates, hold', 'stops': 'vibrates, second'}


def main():
    parser = table_parser(__doc__, seed=0, draws=1, workers=2)
    parser.add_argument('--rules', nargs='+', default=list(RULES), choices=RULES, metavar='NAME')
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--output', type=Path, help='JSON file to write')
    options = parser.parse_args()
    print(f'{"without":50s} {"world":7s}' + ''.join(f'{name:>10s}' for name in COLUMNS))
    rows = []
    for rule in options.rules:
        for world, cells in without(rule, options):
            rows.append({'rule': rule, 'world': world, 'seed': options.seed, **cells})
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
        floors, old, new = RULES[rule]
        law = {path: path.read_text(encoding='utf-8') for path in (
            Path(folder) / 'friction_comp' / 'compensation' / name for name in FILES)}
        if old and sum(text.count(old) for text in law.values()) != 1:
            raise LookupError(f'{old!r} is not in the law any more')
        for path, text in law.items():
            path.write_text(text.replace(old, new), encoding='utf-8')
        with processes(options.workers, initializer=import_from, initargs=(folder,)) as pool:
            jobs = [(world, floor, options.seed, options.draws)
                    for world in options.worlds for floor in floors.split()]
            found = list(pool.map(figures, jobs))
    for world in options.worlds:
        yield world, {name: text for job, cells in zip(jobs, found) if job[0] == world
                      for name, text in cells.items()}


def import_from(folder):
    """Let this process import the package from a folder."""
    sys.path.insert(0, folder)


def figures(job):
    """Return one floor's figures on one world, by column."""
    # They import the package, which here is the copy.
    from law_table import bank_of, FLOORS

    from law_judge import alone, hands, loop

    hands.FREQUENCIES, alone.RELEASED, hands.YARDSTICKS = FREQUENCIES, SPEEDS, ()
    loop.YARDSTICKS = ()
    world, floor, seed, draws = job
    cells = {}
    for row in FLOORS[floor](bank_of(world, 'true', seed, draws, WORLDS[world])[0], 'continuous'):
        for name, begins in COLUMNS.items():
            if (row.floor == begins if begins in COLUMNS['unknown'] else
                    row.floor.startswith(begins)) and name not in cells:
                cells[name] = row.measured.split(' / ')[0].replace(' of ', '/')
    return cells


if __name__ == '__main__':
    main()
