# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How refinement does on recordings of a second world, by families of hidden effects.

    python bench/second_table.py [--half tuning|kept|both] [--draws 2] [--families ripple ...]
                                 [--jobs 2] [--output results.json]
    python bench/second_table.py --show results.json

Even seeds are the tuning half, odd ones the kept half: change nothing by what the kept half says.
"""

from __future__ import annotations

import argparse
from collections import Counter
from concurrent.futures import as_completed, ProcessPoolExecutor
import json
import multiprocessing
import os
from pathlib import Path
import signal
import sys
import time

# Each process works alone; threads of the linear algebra would only get into one another's way.
for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ.setdefault(name, '1')

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]


class TooLongError(Exception):
    """A case took longer than its limit."""


def attempt(family, seed, limit):
    """Judge one case; an error or the time limit is a result too."""
    from second_world.judging import judge

    def stop(*_):
        raise TooLongError(f'took more than {limit:.0f} s')

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        return judge(family, seed)
    except Exception as error:  # every failure is counted and shown, none ends the table
        return {'family': family, 'seed': seed, 'failed': f'{type(error).__name__}: {error}'}
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def seeds_of(half, draws, start):
    """Return seeds: even for tuning, odd for keeping, from draw number `start` on."""
    numbers = range(start, start + draws)
    return [2 * k + odd for k in numbers for odd in (0, 1)
            if half == 'both' or half == ('kept' if odd else 'tuning')]


def line(result):
    """Return one case as a line."""
    if 'failed' in result:
        return f"{result['family']:24s}{result['seed']:4d}  FAILED {result['failed']}"
    marks = ''.join((
        'F' if result['first'] else '.', 'x' if result['false'] else '.',
        'm' if result['missed'] else '.', '!' if result['claims'] else '.',
        'W' if result['after'] > 1.02 * result['before'] else '.'))
    return (f"{result['family']:24s}{result['seed']:4d} {marks} "
            f"{result['after'] / result['floor']:6.2f} x floor, "
            f"{result['after'] / result['before']:5.2f} x before  "
            f"{', '.join(result['effects']) or 'none'} | asked {', '.join(result['asked'])}")


def print_table(results, title):
    """Print one line per family and the total as a table."""
    from second_world.families import FAMILIES
    from second_world.judging import summary
    print(f'\n{title}')
    header = None
    for family in (*FAMILIES, None):
        chosen = [r for r in results if 'failed' not in r and family in (None, r['family'])]
        failed = sum('failed' in r and family in (None, r['family']) for r in results)
        if not chosen:
            if failed:
                print(f'| {family or "total"} | {failed} failed |')
            continue
        row = summary(chosen)
        if header is None:
            header = ['family', 'cases', *row]
            print('| ' + ' | '.join(header) + ' |\n|' + '---|' * len(header))
        cases = f'{len(chosen)}' + (f' + {failed} failed' if failed else '')
        print('| ' + ' | '.join([family or 'total', cases, *row.values()]) + ' |')


def print_false_names(results):
    """Print what was named wrongly how often, so that the commonest error is seen."""
    counts = Counter(text for r in results for text in (*r.get('false', ()), *(
        'far too large a prediction' if claim.startswith('predicts') else claim
        for claim in r.get('claims', ()))))
    print('named wrongly: ' + (', '.join(f'{n} x {text}' for text, n in counts.most_common())
                               or 'nothing'))


def print_halves(results):
    """Print the table of each half that there are results of."""
    for half, odd in (('tuning', 0), ('kept', 1)):
        chosen = [r for r in results if r['seed'] % 2 == odd]
        if chosen:
            print_table(chosen, f'{half} half')
            print_false_names(chosen)


def main():
    """Judge cases side by side and print the table of each half."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--half', choices=('tuning', 'kept', 'both'), default='tuning')
    parser.add_argument('--draws', type=int, default=1, help='seeds of each half and family')
    parser.add_argument('--start', type=int, default=0, help='number of the first draw')
    parser.add_argument('--families', nargs='*')
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--limit', type=float, default=240.0, help='seconds for one case')
    parser.add_argument('--output', type=Path, help='JSON file for the single results')
    parser.add_argument('--show', type=Path, help='print the tables of saved results and end')
    arguments = parser.parse_args()
    if arguments.show:
        print_halves(json.loads(arguments.show.read_text()))
        return
    from second_world.families import FAMILIES
    unknown = set(arguments.families or ()) - set(FAMILIES)
    if unknown:
        parser.error(f'no such family: {", ".join(sorted(unknown))}; there are '
                     f'{", ".join(FAMILIES)}')
    work = [(f, s) for s in seeds_of(arguments.half, arguments.draws, arguments.start)
            for f in arguments.families or FAMILIES]
    results, began = [], time.monotonic()
    with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context('spawn')) as pool:
        waiting = [pool.submit(attempt, f, s, arguments.limit) for f, s in work]
        for done in as_completed(waiting):
            results.append(done.result())
            print(f'[{len(results)}/{len(work)} {time.monotonic() - began:5.0f} s] '
                  + line(results[-1]), flush=True)
            if arguments.output:
                arguments.output.write_text(json.dumps(results, indent=1))
    print_halves(results)


if __name__ == '__main__':
    main()
