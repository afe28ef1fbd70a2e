# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How refinement does on recordings of a second world, by families of hidden effects.

    python3 bench/second_table.py [--half tuning|kept|both] [--draws N] [--start N]
                                  [--families ripple ...] [--jobs N]

--draws are seeds of each half and family from number --start on.
Even seeds are the tuning half, odd ones the kept half: change nothing by what the kept half says.
"""

from collections import Counter
from concurrent.futures import as_completed
import time

from bench_tools import processes, table_parser

from second_world.families import FAMILIES
from second_world.judging import judge, summary


def attempt(family, seed):
    """Judge one case; an error is a result too."""
    try:
        return judge(family, seed)
    except Exception as error:  # every failure is counted and shown, none ends the table
        return {'family': family, 'seed': seed, 'failed': f'{type(error).__name__}: {error}'}


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


def main():
    """Judge cases side by side and print the table of each half."""
    parser = table_parser(__doc__, draws=1, start=0, jobs=1)
    parser.add_argument('--half', choices=('tuning', 'kept', 'both'), default='tuning')
    parser.add_argument('--families', nargs='+', default=list(FAMILIES), choices=FAMILIES,
                        metavar='NAME')
    arguments = parser.parse_args()
    work = [(f, s) for s in seeds_of(arguments.half, arguments.draws, arguments.start)
            for f in arguments.families]
    results, began = [], time.monotonic()
    with processes(arguments.jobs) as pool:
        waiting = [pool.submit(attempt, f, s) for f, s in work]
        for done in as_completed(waiting):
            results.append(done.result())
            print(f'[{len(results)}/{len(work)} {time.monotonic() - began:5.0f} s] '
                  + line(results[-1]), flush=True)
    for half, odd in (('tuning', 0), ('kept', 1)):
        chosen = [r for r in results if r['seed'] % 2 == odd]
        if chosen:
            print_table(chosen, f'{half} half')
            print_false_names(chosen)


if __name__ == '__main__':
    main()
