# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the compensation law: every floor, on gears of two worlds that share nothing with it.

    python3 bench/law_table.py [--worlds gear mujoco] [--models true identified]
                               [--laws continuous none paper] [--floors release peak ...]
                               [--kinds NAME ...] [--draws N] [--seed S] [--workers N] [--detail]
    python3 bench/law_table.py --floors conditions --seed 93 --output conditions.json
    python3 docs/generate.py conditions conditions.json

`gear` are gears of four friction models and the note's drives, `mujoco` gears in an engine that is
not ours (PyPI `mujoco`). A cell of help is the median over joints or gears, the worst, and the
medians of 0.9·tanh and of the printed kinetic law; `conditions` are those of reaches from rest with
other sensors, gears and models. Even seeds are for tuning on, odd seeds are kept for judging:
report both, tune on one. The law is given the plant's own true model, times the factor that a floor
names, or the one that identification finds.
"""

from functools import partial
import importlib
import importlib.util
import json
from pathlib import Path
import sys
import time

from bench_tools import processes, table_parser

from law_judge.alone import knock, quiet, release, untouched
from law_judge.bank import identified_bank, make_bank
from law_judge.hands import CONDITIONS, conditions, hurry, leader, peak, reaches, to_and_fro

FLOORS = {f.__name__: f for f in (
    release, untouched, knock, quiet, peak, to_and_fro, hurry, reaches, leader, conditions)}
# Module, and gears of each kind.
WORLDS = {'gear': ('world.gear', 2), 'mujoco': ('world.mujoco_gear', 4)}


def main():
    options = parse()
    began, results = time.time(), []
    jobs = [(world, models, floor, law, name)
            for world in options.worlds for models in options.models for floor in options.floors
            for law in options.laws
            for name in (CONDITIONS if floor == 'conditions' else [''])]
    with processes(options.workers) as pool:
        for job, (rows, refused, seconds) in zip(jobs, pool.map(partial(do, options), jobs)):
            results += [(job[0], job[1], job[3], row) for row in rows]
            print(f'# {" ".join(job)}: {seconds:.0f} s', *refused, sep='\n#   ',
                  file=sys.stderr, flush=True)
    half = 'tuning' if options.seed % 2 == 0 else 'kept'
    print(f'seed {options.seed} ({half} half), {time.time() - began:.0f} s')
    print_table(results, options.detail)
    if options.output:
        options.output.write_text(json.dumps({'seed': options.seed, 'rows': [
            {'world': world, 'floor': row.floor, 'value': row.value, 'worst': row.worst,
             **row.beside} for world, _, _, row in results]}, indent=1) + '\n', encoding='utf-8')


def parse():
    parser = table_parser(__doc__, seed=0, workers=2)
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--models', nargs='+', default=['true'], choices=('true', 'identified'))
    parser.add_argument('--laws', nargs='+', default=['continuous'],
                        help="of CompensationLaw, or 'none'")
    parser.add_argument('--floors', nargs='+', default=list(FLOORS), choices=FLOORS)
    parser.add_argument('--draws', type=int, help='gears of each kind')
    parser.add_argument('--kinds', nargs='+')
    parser.add_argument('--detail', action='store_true', help='what is behind each figure')
    parser.add_argument('--output', type=Path, help='JSON file to write')
    options = parser.parse_args()
    if 'mujoco' in options.worlds and importlib.util.find_spec('mujoco') is None:
        parser.error('the world mujoco needs MuJoCo: pip install mujoco')
    return options


def do(options, job):
    """Return a job's rows, the gears that identification refused, and seconds."""
    world, models, floor, law, name = job
    began, refused = time.time(), []
    module, few = WORLDS[world]
    if floor == 'conditions':
        rows = conditions(importlib.import_module(module), options.draws or 1, options.seed, law,
                          name)
    else:
        bank, refused = bank_of(world, models, options.seed, options.draws or few, options.kinds)
        rows = FLOORS[floor](bank, law)
    return rows, refused, time.time() - began


_banks = {}


def bank_of(name, models, seed, draws, kinds=None):
    """Return a world's gears with their models, made once a process, and what was refused."""
    if (name, models) not in _banks:
        world = importlib.import_module(WORLDS[name][0])
        bank = make_bank(world, kinds or world.KINDS, draws, seed)
        _banks[name, models] = identified_bank(bank) if models == 'identified' else (bank, [])
    return _banks[name, models]


def print_table(results, detail):
    """Print one line a floor: a column for each world, models and law."""
    columns = list(dict.fromkeys(result[:3] for result in results))
    print(f'{"":76s} {"floor":>8s}  ' + '  '.join(f'{" ".join(c):>22s}' for c in columns))
    table = {}
    for *column, row in results:
        table.setdefault((row.floor, row.asked), {})[tuple(column)] = row
    for (floor, asked), cells in table.items():
        texts = [cells[c].measured + ('' if cells[c].met else ' !') if c in cells else ''
                 for c in columns]
        print(f'{floor:76s} {asked:>8s}  ' + '  '.join(f'{text:>22s}' for text in texts))
        for column, row in cells.items() if detail else ():
            print(f'    {column[0]}: {row.detail}')


if __name__ == '__main__':
    main()
