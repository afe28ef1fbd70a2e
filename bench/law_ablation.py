# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each rule of the compensation law earns: the law without it, on two worlds.

    python3 bench/law_ablation.py [--rules NAME ...] [--seed S] [--workers N]
                                  [--output ablation.json]
    python3 docs/generate.py ablation ablation.json

The law without a rule goes through a part of the experiments of `law_table`, with the same gears,
persons and noise as the law as it is, whose row has 0.9·tanh and the printed kinetic law beside it.
Printed is what changes by more than its spread: a share by two standard errors of its mean change
over joints, and a point; a number of joints by the root of how many differ, and one. A rule that
changes nothing in either world earns nothing. Two slow cores take about ten minutes.
"""

import importlib
import json
import multiprocessing
from pathlib import Path
import sys
import tempfile
import types

from bench_tools import ROOT, table_parser
import numpy as np

from law_judge import alone, hands, loop
from law_judge.bank import make_bank

# Gears of each kind, and the share of their conditions that is tried. MuJoCo is slower.
WORLDS = {'gear': (1, 0.25), 'mujoco_gear': (1, 0.12)}
FLOORS = (alone.release, alone.untouched, alone.knock, alone.quiet, hands.peak, hands.to_and_fro,
          hands.leader)
# Of compensation/, in the order of their imports.
FILES = ('law_parameters', 'safety', 'law_kernel', 'law')
# What stands in one of these files, and what stands there without the rule.
RULES = {
    'tank: the slid way fills it': ('FILL = 0.025', 'FILL = 0.0'),
    'tank: rest fills it': ('s.saved += p.distance * s.step / REST_TIME', 'pass'),
    'tank: it pays for the wish': ('if owed <= left:', 'if True:'),
    'wish before the turn': ('TURN_SHARE, SLOW = 0.10', 'TURN_SHARE, SLOW = 1e-9'),
    'wish: heading, d = 0': ('elif aim == 0.0 and s.heading != 0.0', 'elif False'),
    'no motion within 0.05 R': ('STILL = 0.05', 'STILL = 0.0'),
    'preload takes 0.1 s': ('LEAD_TIME = 0.1', 'LEAD_TIME = 1e-3'),
    'preload begins at the help of motion': (
        's.z = math.copysign(min(abs(s.z), abs(s.friction) / (at_rest + 1e-9)), s.z)', 'pass'),
    'a joint within the slip distance still rests': (
        '        if abs(s.position - s.rest_position) > p.slip:', '        if True:'),
    'pushed against the preload': (
        'elif aim * s.heading < 0.0 and s.z * s.heading < 0.0:', 'elif False:'),
    'help given back is not given again': ('s.is_fresh = 0', 'pass'),
    'another announcement must last': ('or s.lasted > 2.0 * REST_TIME', 'or True'),
    'trust: early slip': ('EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 1.0, 0.94'),
    'trust: later slip': ('EARLY, LATER = 0.7, 0.94', 'EARLY, LATER = 0.7, 1.0'),
    'trust is kept from rest to rest': ('min(1.0, max(s.trust, s.trusted) + 1.0 - LATER)', '1.0'),
    'trust beyond the identified speeds': (
        'HURRIED = math.radians(60.0), 0.7', 'HURRIED = math.radians(60.0), 1.0'),
    'breakaway friction at rest': ('    if s.mode != FREE:\n        return mean\n', ''),
    'breakaway friction near rest': ('STARTS = 3.0', 'STARTS = 1e-6'),
    'a long way is helped less': ('LATE, LATE_TIME = 0.04', 'LATE, LATE_TIME = 0.0'),
    'speed is filtered': ('SPEED_TIME = 0.0025', 'SPEED_TIME = 1e-6'),
    'slope limit': ('TURN_TIME = 0.02', 'TURN_TIME = 1e-9'),
    'fade': ('FADE_FROM, FADE_TO = 1.15, 1.5', 'FADE_FROM, FADE_TO = 1e6, 1e7'),
}
# Columns, and the rows of the table that they print.
COLUMNS = {
    'd = 0': 'to and fro, d = 0', 'unknown': 'to and fro, d = 0, presliding unknown',
    'announced': 'to and fro, announced', 'through 0': 'to and fro, announced through 0',
    'leader': 'leader arm, d = 0: RMS', 'start': 'leader arm, d = 0: start',
    'ahead': 'peak, 1 s ahead', 'push': 'peak, with the push',
    'fast push': 'peak, with the push, 80 deg/s', 'wrong': 'peak, wrongly announced, 1 s ahead',
    'gains': 'let go, model ≤ 1.10: gains speed',
    'moves': 'let go, model of 1.10: not at rest in 6 s',
    'fast': 'let go, model ≤ 1.43: beyond 1.25 of the identified speeds',
    'runs': 'let go, friction 0.70 of the model: still moves after 6 s',
    'pushed': 'pushed by 2 deg, model ≤ 1.10: gains speed',
    'starts': 'untouched, model ≤ 1.10: starts',
    'lost': 'untouched, friction 0.70 to 0.85 of the model: starts',
    'carried': 'carried and left at rest, 0.70 to 0.85: starts',
    'falls': 'unknown weight of 0.26 of friction, d downward: falls',
    'rings': 'rings 2 s after a knock', 'flicker': 'announcement flickers at 2 to 5 Hz: shakes',
    'holds': 'vibrates, hold and slow motion', 'stops': 'vibrates, second of start or stop'}


def main():
    parser = table_parser(__doc__, seed=93, workers=2)
    parser.add_argument('--rules', nargs='+', default=list(RULES), choices=RULES, metavar='NAME')
    parser.add_argument('--output', type=Path, help='JSON file to write')
    options = parser.parse_args()
    for rule in options.rules:
        law_texts(*RULES[rule])
    for name, (draws, part) in WORLDS.items():
        world = importlib.import_module(f'world.{name}')
        BANKS[name] = make_bank(world, world.KINDS, draws, options.seed, part=part)
    # Processes inherit worlds, gears and models; each compiles a law of its own.
    fork = multiprocessing.get_context('fork')
    with tempfile.TemporaryDirectory() as folder:
        loop.KEPT = Path(folder)
        with fork.Pool(options.workers, maxtasksperchild=1) as pool:
            whole = dict(zip(WORLDS, pool.map(as_it_is, WORLDS, 1)))
            rows = [{'rule': 'nothing', 'world': world, **{
                name: row.measured for name, row in cells.items()}}
                for world, cells in whole.items()]
            print(*rows, sep='\n', flush=True)
            for rule, found in zip(options.rules, pool.imap(without, options.rules)):
                for world, cells in found.items():
                    rows.append({'rule': rule, 'world': world, **changes(whole[world], cells)})
                    print(rows[-1], flush=True)
    if options.output:
        options.output.write_text(json.dumps(
            {'seed': options.seed, 'rows': rows}, indent=1, ensure_ascii=False) + '\n',
            encoding='utf-8')


# Of each world, before processes are forked.
BANKS = {}


def as_it_is(world):
    """Return a world's rows by column, with the yardsticks beside them."""
    return {name: row for floor in FLOORS for row in floor(BANKS[world], 'continuous')
            for name, title in COLUMNS.items() if row.floor == title}


def without(rule):
    """Return each world's rows with a rule switched off, by column."""
    loop.CompensationLaw, hands.YARDSTICKS, loop.YARDSTICKS = law_without(*RULES[rule]), (), ()
    return {world: as_it_is(world) for world in WORLDS}


def law_texts(old, new):
    """Return the texts of the law's modules, with another text in one place."""
    texts = {name: (ROOT / 'friction_comp' / 'compensation' / f'{name}.py').read_text(
        encoding='utf-8') for name in FILES}
    if sum(text.count(old) for text in texts.values()) != 1:
        raise LookupError(f'{old!r} is not in the law any more, or not once')
    return {name: text.replace(old, new) for name, text in texts.items()}


def law_without(old, new):
    """Return the law's class, whose modules have another text in one place."""
    package = importlib.import_module('friction_comp.compensation')
    for name, text in law_texts(old, new).items():
        module = types.ModuleType(f'{package.__name__}.{name}')
        sys.modules[module.__name__] = module
        setattr(package, name, module)
        exec(text.replace('cache=True', ''), module.__dict__)
    return package.law.CompensationLaw


def changes(whole, cells):
    """Return, by column, what it was, what it is, and the mean change with its spread."""
    found = {}
    for name, row in cells.items():
        change = np.asarray(row.each, dtype=float) - np.asarray(whole[name].each, dtype=float)
        if row.joints:
            mean, spread, least = change.sum(), np.sqrt(np.abs(change).sum()), 1.0
        else:
            change = change[np.isfinite(change)]
            mean, spread, least = change.mean(), change.std() / np.sqrt(len(change)), 1.0
            spread *= 2.0
        if abs(mean) > max(spread, least):
            found[name] = (f'{whole[name].measured.split(" / ")[0]} → {row.measured}, '
                           f'{mean:+.0f} ± {spread:.0f}')
    return found


if __name__ == '__main__':
    main()
