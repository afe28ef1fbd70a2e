# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each rule and constant of the compensation law earns: the law without it, on every world.

    python3 bench/law_ablation.py [--rules NAME ...] [--worlds gear mujoco refined]
                                  [--floors untouched quiet ...] [--models true|identified]
                                  [--seed S] [--draws N] [--workers N]

One line a rule and world: the floors of `law_table` with that rule switched off, beside the law as
it is. A rule that changes no column earns nothing. What compiled code contains is exchanged before
it is compiled, in a process of its own and with a cache of its own, which takes some seconds more.
"""

import importlib
import math
import os
import tempfile

from bench_tools import processes, table_parser
from law_table import bank_of, FLOORS, WORLDS

LAW = 'friction_comp.compensation.'
OPERATOR, SAFETY = LAW + 'tank_operator.', LAW + 'safety.'
# What is set to switch a rule off.
RULES = {
    'as it is': {},
    'the slid way fills the tank': {OPERATOR + 'FILL': 0.0},
    'wish before the turn': {OPERATOR + 'TURN_SHARE': 1e-9},
    'what is no motion': {OPERATOR + 'STILL': 0.0},
    'lead speed': {OPERATOR + 'LEAD_SPEED': math.inf},
    'lead time': {OPERATOR + 'LEAD_TIME': 1e-3},
    'early slip': {OPERATOR + 'EARLY': 1.0},
    'later slip': {OPERATOR + 'LATER': 1.0},
    'start at breakaway friction': {LAW + 'law_kernel.STARTS': 1e-6},
    'withheld of a long way': {LAW + 'law_kernel.LATE': 0.0},
    'reported velocity': {LAW + 'law_kernel.AGREE_SHARE': -1.0},
    'filter of the speed': {LAW + 'law_kernel.FILTER_TIME': 1e-6},
    'slope limit': {SAFETY + 'TURN_TIME': 1e-9},
    'fade': {SAFETY + 'FADE_FROM': 1e6, SAFETY + 'FADE_TO': 1e7},
    'trust beyond the identified speeds': {SAFETY + 'HURRIED': 1.0},
    'a way of somebody in a hurry': {SAFETY + 'HURRIED_WAY': 0.0},
}
# Short names of the floors' rows, by what they begin with; the others are not printed.
COLUMNS = {
    "friction's part of the peak removed, 1 s ahead": 'ahead',
    "friction's part of the peak removed, with the push": 'push',
    "friction's part of the peak removed, not announced, presliding known": 'd = 0',
    "friction's part of the peak removed, wrongly announced, 1 s ahead": 'wrong',
    'vibrates, hold': 'vibrates', 'vibrates, second': 'at stops',
    'rings 2 s after a knock': 'rings', 'untouched, model': 'starts',
    'untouched, friction': 'lost', 'carried': 'carried', 'unknown weight': 'falls',
    'announcement flickers': 'flicker', 'reversal announced: peak': 'reversal',
    'to and fro, d = 0: removed': 'to and fro', 'to and fro, announced: removed': 'announced',
    'let go, model ≤ 1.10': 'gains', 'let go, model ≤ 1.05': 'no rest',
    'let go, model ≤ 1.5': 'fast', 'let go, friction': 'runs',
    'pushed by 2 deg, model ≤ 1.10': 'pushed'}


def main():
    parser = table_parser(__doc__, seed=0, workers=2)
    parser.add_argument('--rules', nargs='+', default=list(RULES), choices=RULES, metavar='NAME')
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--floors', nargs='+', choices=FLOORS, default=[
        name for name in FLOORS if name != 'identification'])
    parser.add_argument('--models', choices=['true', 'identified'], default='true')
    parser.add_argument('--draws', type=int, help='gears of each kind')
    options = parser.parse_args()
    names = None
    for rule in options.rules:
        for world, cells in without(rule, options):
            if names is None:
                names = list(cells)
                print(f'{"without":40s} {"world":8s}' + ''.join(f'{n:>11s}' for n in names))
            print(f'{rule:40s} {world:8s}' + ''.join(
                f'{cells.get(n, ""):>11s}' for n in names), flush=True)


def without(rule, options):
    """Yield each world and its figures, by column, with a rule switched off."""
    with tempfile.TemporaryDirectory() as cache:
        os.environ['NUMBA_CACHE_DIR'] = cache
        try:
            with processes(options.workers, initializer=switch_off, initargs=(rule,)) as pool:
                jobs = [(world, floor, options.models, options.seed, options.draws)
                        for world in options.worlds for floor in options.floors]
                found = list(pool.map(figures, jobs))
        finally:
            os.environ.pop('NUMBA_CACHE_DIR', None)
    for world in options.worlds:
        yield world, {name: text for job, cells in zip(jobs, found) if job[0] == world
                      for name, text in cells.items()}


def switch_off(rule):
    """Exchange a rule's constants or function in this process, before anything is compiled."""
    for path, value in RULES[rule].items():
        module, _, name = path.rpartition('.')
        if not hasattr(importlib.import_module(module), name):
            raise LookupError(f'{path} is not in the law any more')
        setattr(importlib.import_module(module), name, value)


def figures(job):
    """Return one floor's figures on one world, by column."""
    world, floor, models, seed, draws = job
    bank, _ = bank_of(world, models, seed, draws)
    cells = {}
    for row in FLOORS[floor](bank, 'continuous'):
        short = next((s for begin, s in COLUMNS.items() if row.floor.startswith(begin)), None)
        if short is not None and short not in cells:
            cells[short] = row.measured.replace(' of ', '/')
    return cells


if __name__ == '__main__':
    main()
