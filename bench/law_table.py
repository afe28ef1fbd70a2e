# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the compensation law: every floor, on gears of two worlds that share nothing with it.

    python3 bench/law_table.py [--worlds gear mujoco refined chain]
                               [--models true identified recorded]
                               [--laws continuous none paper] [--floors release peak ...]
                               [--set SHARE=0.95 ...] [--without backlash ...]
                               [--kinds NAME ...] [--draws N] [--seed S] [--workers N] [--detail]

`gear` are gears of five friction models and the note's drives, `refined` those with one more
effect, in their models too; `mujoco` are gears in an engine that is not ours (PyPI `mujoco`);
`chain` are the note's drives behind chains of Maxwell elements, for identification only. Even
seeds are for tuning on, odd seeds are kept for judging: report both, tune on one. The law is given
the plant's own true model, times the factor that a floor names, the one that identification
finds, or the one that `refine` makes of a recording. --set shows what becomes of it
with other constants, by their names in law_parameters; --without what becomes of it on gears
without one of their properties. The whole takes about ten minutes of processor time.
"""

import argparse
from functools import partial
import importlib
import importlib.util
import sys
import time

from bench_tools import processes, table_parser

from friction_comp.compensation import law_parameters
from law_judge.bank import make_bank
from law_judge.identification import identification, identified_bank
from law_judge.peak import peak
from law_judge.quiet import flicker, knock, quiet
from law_judge.recorded import recorded_bank
from law_judge.refined import REFINED
from law_judge.release import release
from law_judge.reversal import reversal
from law_judge.to_and_fro import hurry, leader, reaches, to_and_fro
from law_judge.untouched import lost, untouched, weight

FLOORS = {f.__name__: f for f in (
    release, untouched, lost, weight, knock, flicker, quiet, peak, reversal, to_and_fro,
    hurry, reaches, leader, identification)}
# Module, kinds where not all of its own, and gears of each.
WORLDS = {'gear': ('world.gear', None, 2), 'mujoco': ('world.mujoco_gear', None, 4),
          'refined': ('world.gear', REFINED, 1), 'chain': ('world.maxwell_chain', None, 4)}


def main():
    options = parse()
    began = time.time()
    jobs = list(make_jobs(options))
    results = []
    with processes(options.workers) as pool:
        for job, (rows, refused, seconds) in zip(jobs, pool.map(partial(do, options), jobs)):
            results.append((job, rows))
            print(f'# {" ".join(job)}: {seconds:.0f} s', *refused, sep='\n#   ',
                  file=sys.stderr, flush=True)
    half = 'tuning' if options.seed % 2 == 0 else 'kept'
    print(f'seed {options.seed} ({half} half), {time.time() - began:.0f} s')
    print_table(results, options.detail)


def parse():
    parser = table_parser(__doc__, seed=0, workers=2)
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--models', nargs='+', default=['true'],
                        choices=('true', 'identified', 'recorded'))
    parser.add_argument('--laws', nargs='+', default=['continuous'],
                        help="of CompensationLaw, or 'none'")
    parser.add_argument('--floors', nargs='+', default=list(FLOORS), choices=FLOORS)
    parser.add_argument('--set', nargs='+', default=[], type=constant, metavar='NAME=VALUE',
                        help='other constants of friction_comp.compensation.law_parameters')
    parser.add_argument('--without', nargs='+', default=[], metavar='PROPERTY',
                        help="fields of the world's gears that are set to zero")
    parser.add_argument('--draws', type=int, help='gears of each kind')
    parser.add_argument('--kinds', nargs='+')
    parser.add_argument('--detail', action='store_true', help='what is behind each figure')
    options = parser.parse_args()
    if 'mujoco' in options.worlds and importlib.util.find_spec('mujoco') is None:
        parser.error('the world mujoco needs MuJoCo: pip install mujoco')
    return options


def constant(text):
    """Return name and value of a constant of the law."""
    name, _, value = text.partition('=')
    if not isinstance(getattr(law_parameters, name, None), float):
        raise argparse.ArgumentTypeError(f'{name!r} is no constant of law_parameters')
    return name, float(value)


def make_jobs(options):
    """Yield (world, models, floor, law)."""
    for world in options.worlds:
        for models in options.models:
            for floor in options.floors:
                laws = options.laws
                if floor == 'identification':
                    # It has no law, and its effects are computed joint by joint.
                    laws = laws[:1] if world != 'refined' and models == 'true' else []
                elif world == 'chain':
                    continue
                for law in laws:
                    yield world, models, floor, law


def do(options, job):
    """Return a job's rows, the gears that identification refused, and seconds."""
    world, models, floor, law = job
    for name, value in options.set:
        setattr(law_parameters, name, value)
    began = time.time()
    bank, refused = bank_of(world, models, options.seed, options.draws, options.kinds,
                            options.without)
    return FLOORS[floor](bank, law), refused, time.time() - began


_banks = {}


def bank_of(name, models, seed, draws=None, kinds=None, without=()):
    """Return a world's gears with their models, made once a process, and what was refused."""
    key = name, models
    if key not in _banks:
        module, which, few = WORLDS[name]
        world = importlib.import_module(module)
        bank = make_bank(world, kinds or which or world.KINDS, draws or few, seed, without=without)
        changed = {'identified': identified_bank, 'recorded': recorded_bank}.get(models)
        _banks[key] = changed(bank) if changed else (bank, [])
    return _banks[key]


def print_table(results, detail):
    """Print one line a floor: a column for each world, models and law."""
    columns = list(dict.fromkeys((world, models, law) for (world, models, _, law), _ in results))
    table = {}
    for (world, models, _, law), rows in results:
        for row in rows:
            table.setdefault((row.floor, row.asked), {})[world, models, law] = row
    laws = len({law for _, _, law in columns}) > 1
    names = [' '.join(column if laws else column[:2]) for column in columns]
    print(f'{"":64s} {"floor":>9s}  ' + '  '.join(f'{name:>16s}' for name in names))
    for (floor, asked), cells in table.items():
        line = f'{floor:64s} {asked:>9s}  '
        for column, name in zip(columns, names):
            row = cells.get(column)
            text = '' if row is None else row.measured + ('' if row.met else ' !')
            line += f'{text:>{max(16, len(name))}s}  '
        print(line.rstrip())
        if detail:
            for column, row in cells.items():
                if row.detail:
                    print(f'    {column[0]}: {row.detail}')


if __name__ == '__main__':
    main()
