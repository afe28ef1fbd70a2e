# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the compensation law: every floor, on gears of two worlds that share nothing with it.

    python3 bench/law_table.py [--worlds gear mujoco refined] [--models true identified]
                               [--laws continuous none continuous:4] [--floors release peak ...]
                               [--set SHARE=0.95 ...] [--without backlash ...]
                               [--seed S] [--draws N] [--full]
                               [--workers N] [--output FILE.json] [--detail] [--check]

`gear` are gears of five friction models and the note's drives, `refined` those with one more
effect, in their models too; `mujoco` are gears in an engine that is not ours (PyPI `mujoco`). Even
seeds are for tuning on, odd seeds are kept for judging: report both, tune on one. The law is given
the plant's own true model, times the factor that a floor names, or the one that identification
finds. --set shows what becomes of it with other constants, by their names in law_parameters;
--without what becomes of it on gears without one of their properties. The whole takes about ten
minutes of processor time; --full, with more joints, an hour.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import dataclasses
import importlib
import importlib.util
import json
import multiprocessing
import os
from pathlib import Path
import sys
import time

for variable in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

from friction_comp.compensation import law_parameters  # noqa: E402
from law_judge.bad_samples import bad_samples  # noqa: E402
from law_judge.bank import make_bank  # noqa: E402
from law_judge.identification import identification, identified_bank  # noqa: E402
from law_judge.peak import peak  # noqa: E402
from law_judge.quiet import flicker, knock, quiet  # noqa: E402
from law_judge.release import release  # noqa: E402
from law_judge.reversal import reversal  # noqa: E402
from law_judge.untouched import lost, untouched, weight  # noqa: E402

FLOORS = {f.__name__: f for f in (
    release, untouched, lost, weight, knock, flicker, quiet, peak, reversal, bad_samples,
    identification)}
# Folder, kinds and gears of each; with --full more.
WORLDS = {'gear': ('independent_gear', 'KINDS', 2, 5), 'mujoco': ('mujoco_gear', 'KINDS', 4, 8),
          'refined': ('independent_gear', 'REFINED', 1, 3)}


def main():
    options = parse()
    began = time.time()
    jobs = list(make_jobs(options))
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
        results = []
        for job, (rows, refused, seconds) in zip(jobs, pool.map(do, jobs)):
            results.append((job, rows))
            print(f'# {" ".join(map(str, job[:4]))}: {seconds:.0f} s', *refused, sep='\n#   ',
                  file=sys.stderr, flush=True)
    half = 'tuning' if options.seed % 2 == 0 else 'kept'
    print(f'seed {options.seed} ({half} half), {time.time() - began:.0f} s')
    print_table(results, options.detail)
    if options.output:
        options.output.write_text(json.dumps(
            [{'world': world, 'models': models, **dataclasses.asdict(row), 'met': row.met}
             for (world, models, *_), rows in results for row in rows], indent=1, default=str))
    return 1 if options.check and not all(
        row.met for job, rows in results for row in rows if job[3] == options.laws[0]) else 0


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--worlds', nargs='+', default=list(WORLDS), choices=WORLDS)
    parser.add_argument('--models', nargs='+', default=['true'], choices=('true', 'identified'))
    parser.add_argument('--laws', nargs='+', default=['continuous'],
                        help="of CompensationLaw, 'none'; 'continuous:position': no velocity, "
                             "'continuous:4': every fourth sample")
    parser.add_argument('--floors', nargs='+', default=list(FLOORS), choices=FLOORS)
    parser.add_argument('--set', nargs='+', default=[], type=constant, metavar='NAME=VALUE',
                        help='other constants of friction_comp.compensation.law_parameters')
    parser.add_argument('--without', nargs='+', default=[], metavar='PROPERTY',
                        help="fields of the world's gears that are set to zero")
    parser.add_argument('--draws', type=int, help='gears of each kind')
    parser.add_argument('--kinds', nargs='+')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--full', action='store_true', help='more gears and conditions')
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--detail', action='store_true', help='what is behind each figure')
    parser.add_argument('--check', action='store_true',
                        help='exit code 1 if the law named first misses a floor')
    parser.add_argument('--output', type=Path, help='all figures as JSON')
    options = parser.parse_args()
    if 'mujoco' in options.worlds and importlib.util.find_spec('mujoco') is None:
        parser.error("the world mujoco needs PyPI's mujoco (bench/requirements.txt)")
    return options


def constant(text):
    """Return name and value of a constant of the law."""
    name, _, value = text.partition('=')
    if not isinstance(getattr(law_parameters, name, None), float):
        raise argparse.ArgumentTypeError(f'{name!r} is no constant of law_parameters')
    return name, float(value)


def make_jobs(options):
    """Yield (world, models, floor, law, kinds, draws, seed, full, constants, without)."""
    rest = options.kinds, options.draws, options.seed, options.full, tuple(options.set), \
        tuple(options.without)
    for world in options.worlds:
        for models in options.models:
            for floor in options.floors:
                laws = options.laws
                if floor == 'identification':
                    # once, and the law computes effects joint by joint
                    laws = ['identification'] * (world != 'refined' and models == 'true')
                elif floor == 'bad_samples' and (world != 'gear' or models != 'true'):
                    continue
                for law in laws:
                    yield world, models, floor, law, *rest


def do(job):
    """Run one job in a process of its own and return its rows and seconds."""
    world_name, models, floor, law, kinds, draws, seed, full, constants, without = job
    for name, value in constants:
        setattr(law_parameters, name, value)
    began = time.time()
    bank, refused = bank_of(world_name, models, kinds, draws, seed, full, without)
    rows = FLOORS[floor](bank, law, not full)
    return rows, refused, time.time() - began


_banks = {}


def bank_of(name, models, kinds, draws, seed, full, without=()):
    """Return a world's gears with their models, made once a process."""
    key = name, models
    if key not in _banks:
        folder, which, few, many = WORLDS[name]
        world = importlib.import_module(f'{folder}.world')
        bank = make_bank(world, kinds or getattr(world, which), draws or (many if full else few),
                         seed, 48 if full else 24, without)
        _banks[key] = identified_bank(bank) if models == 'identified' else (bank, [])
    return _banks[key]


def print_table(results, detail):
    """Print one line a floor: a column for each world, models and law."""
    columns = list(dict.fromkeys((world, models, law if law != 'identification' else None)
                                 for (world, models, _, law, *_), _ in results))
    columns = [c for c in columns if c[2] is not None] or columns
    table = {}
    for (world, models, _, law, *_), rows in results:
        for row in rows:
            column = (world, models, law)
            if column not in columns:
                column = next(c for c in columns if c[:2] == (world, models))
            table.setdefault((row.floor, row.asked), {})[column] = row
    laws = len({c[2] for c in columns}) > 1
    names = [' '.join((c[0], c[1], *([str(c[2])] if laws else []))) for c in columns]
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
    sys.exit(main())
