# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges the compensation law on gears that share nothing with the package's own simulation.

    python3 bench/law_table.py [--quick] [--laws continuous paper] [--kinds armin_1 lugre ...]
                               [--floors release untouched quiet peak bad refined identification]
                               [--set SHARE=0.95 ...]
                               [--draws N] [--seed S] [--workers N] [--output FILE.json] [--check]

Even seeds are for tuning on, odd seeds are kept for judging: report both, tune on one. A draw is a
random gear of a kind, `independent_gear/gears.py` says of which ranges and why. The law is given
the plant's own true model, times the factor that each floor names. --set shows what becomes of it
with other constants, by their names in law_parameters. The whole takes about 15 minutes
of processor time a law, --quick about 2.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import json
import multiprocessing
import os
from pathlib import Path
import sys
import time

for variable in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

from friction_comp.compensation import law_parameters  # noqa: E402
from independent_gear.bad_samples import bad_samples  # noqa: E402
from independent_gear.bank import make_bank  # noqa: E402
from independent_gear.gears import KINDS  # noqa: E402
from independent_gear.identification import identification  # noqa: E402
from independent_gear.peak import peak  # noqa: E402
from independent_gear.quiet import quiet  # noqa: E402
from independent_gear.refined import REFINED  # noqa: E402
from independent_gear.release import release  # noqa: E402
from independent_gear.untouched import untouched  # noqa: E402

FLOORS = ('release', 'untouched', 'quiet', 'peak', 'bad', 'refined', 'identification')


def main():
    options = parse()
    began = time.time()
    jobs = list(make_jobs(options))
    rows = []
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
        for job, (found, seconds) in zip(jobs, pool.map(do, jobs)):
            rows += found
            print(f'# {job[0]} {job[1]}: {seconds:.0f} s', file=sys.stderr)
    half = 'tuning' if options.seed % 2 == 0 else 'kept'
    print(f'seed {options.seed} ({half} half), {draws_of(options)} draws a kind, '
          f'{time.time() - began:.0f} s')
    print_table(rows, options.laws, options.detail)
    if options.output:
        options.output.write_text(json.dumps(
            {'seed': options.seed, 'half': half, 'draws': draws_of(options),
             'quick': options.quick, 'rows': rows}, indent=1))
    judged = [row for row in rows if row['law'] in (options.laws[0], 'identification')]
    return 1 if options.check and not all(row['met'] for row in judged) else 0


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--quick', action='store_true', help='fewer draws and conditions')
    parser.add_argument('--laws', nargs='+', default=['continuous', 'paper'],
                        help="of CompensationLaw ('continuous:position': without velocity), 'none'")
    parser.add_argument('--kinds', nargs='+', default=list(KINDS), choices=KINDS)
    parser.add_argument('--floors', nargs='+', default=list(FLOORS), choices=FLOORS)
    parser.add_argument('--set', nargs='+', default=[], type=constant, metavar='NAME=VALUE',
                        help='other constants of friction_comp.compensation.law_parameters')
    parser.add_argument('--draws', type=int, help='gears of each kind; 5, or 2 when quick')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--workers', type=int, default=2)
    parser.add_argument('--detail', action='store_true', help='one line a kind, and all figures')
    parser.add_argument('--check', action='store_true',
                        help='exit code 1 if the law named first misses a floor')
    parser.add_argument('--output', type=Path, help='all figures as JSON')
    return parser.parse_args()


def constant(text):
    """Return name and value of a constant of the law."""
    name, _, value = text.partition('=')
    if not isinstance(getattr(law_parameters, name, None), float):
        raise argparse.ArgumentTypeError(f'{name!r} is no constant of law_parameters')
    return name, float(value)


def draws_of(options):
    return options.draws or (2 if options.quick else 5)


def make_jobs(options):
    """Yield (floor, law or laws, kinds, draws, seed, quick, constants)."""
    draws, seed, quick = draws_of(options), options.seed, options.quick
    common = draws, seed, quick, tuple(options.set)
    compared = [*options.laws, *({'paper', 'kinetic'} - set(options.laws))]
    for floor in options.floors:
        if floor == 'peak':
            yield 'peak', tuple(compared), tuple(options.kinds), *common
        elif floor == 'identification':
            yield floor, 'identification', tuple(options.kinds), *common
        else:
            for law in options.laws:
                if floor != 'refined':
                    yield floor, law, tuple(options.kinds), *common
                elif law not in ('paper', 'kinetic'):
                    yield floor, law, REFINED, *common


def do(job):
    """Run one job in a process of its own and return its rows and seconds."""
    floor, law, kinds, draws, seed, quick, constants = job
    for name, value in constants:
        setattr(law_parameters, name, value)
    began = time.time()
    if floor == 'untouched' and not quick:
        # 1,000 joints: of more gears than elsewhere
        draws = max(draws, 25)
    if floor == 'identification' and quick:
        draws = 1
    bank = make_bank(kinds, draws, seed, 24 if quick else 48)
    if floor == 'release':
        rows = release(bank, law, quick)
    elif floor == 'untouched':
        rows = untouched(bank, law, quick)
    elif floor == 'quiet':
        rows = quiet(bank, law, quick)
    elif floor == 'peak':
        rows = peak(bank, law, quick)
    elif floor == 'bad':
        rows = bad_samples(bank, law, quick)
    elif floor == 'refined':
        # the law computes effects joint by joint: fewer conditions than elsewhere
        rows = [
            *release(bank, law, True, speeds=[20], factors=[1.0, 1.05, 1.1]),
            *untouched(bank, law, True, joints=draws * (2 if quick else 5), seconds=6.0),
            *quiet(bank, law, True), *peak(bank, [law], True)]
    else:
        rows = identification(bank, quick)
    return rows, time.time() - began


def print_table(rows, laws, detail):
    """Print one line a floor and law with the kinds that miss it; or one a kind."""
    groups = {}
    for row in rows:
        groups.setdefault((row['floor'], row['law'], row['kind'].startswith('with_')),
                          []).append(row)
    for (floor, law, refined), group in groups.items():
        name = f'{floor}{" (refined models)" if refined else ""}'
        missed = [row for row in group if not row['met']]
        print(f'{name:66s} {law:11s} {summary(group):>20s} {"" if missed else "met":4s}'
              f'{", ".join(row["kind"] + " " + row["measured"] for row in missed)}')
        if detail:
            for row in group:
                rest = {k: v for k, v in row.items()
                        if k not in ('floor', 'kind', 'law', 'measured', 'wanted', 'met')}
                print(f'    {row["kind"]:22s} {row["measured"]:>14s}  {rest}')


def summary(group):
    """Return what a floor comes to: a sum of failures, the largest, or what all kinds gave."""
    if 'fails' in group[0]:
        return f'{sum(r["fails"] for r in group)} of {sum(r["joints"] for r in group)}'
    if 'loud' in group[0]:
        return (f'{sum(r["loud"] for r in group)} of {sum(r["joints"] for r in group)}, '
                f'{max(r["value"] for r in group):.2f}')
    whole = [row for row in group if row['kind'] == 'all']
    if whole:
        return whole[0]['measured']
    known = [row for row in group if row['value'] is not None]
    return f'worst {max(known, key=lambda r: r["value"])["measured"]}' if known else 'not known'


if __name__ == '__main__':
    sys.exit(main())
