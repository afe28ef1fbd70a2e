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


def print_summary(results, title):
    """Print how many are right, and what was named wrongly how often."""
    known = [r for r in results if 'failed' not in r]
    row = {'cases': str(len(known)), 'failed': str(len(results) - len(known)), **summary(known)}
    print(f'\n{title} half\n| ' + ' | '.join(row) + ' |\n' + '|---' * len(row) + '|')
    print('| ' + ' | '.join(row.values()) + ' |')
    counts = Counter(text for r in known for text in (*r['false'], *(
        'far too large a prediction' if claim.startswith('predicts') else claim
        for claim in r['claims'])))
    print('named wrongly: ' + (', '.join(f'{n} x {text}' for text, n in counts.most_common())
                               or 'nothing'))


def main():
    """Judge cases side by side, each a line, and print the counts of each half."""
    parser = table_parser(__doc__, draws=1, start=0, jobs=1)
    parser.add_argument('--half', choices=('tuning', 'kept', 'both'), default='tuning')
    parser.add_argument('--families', nargs='+', default=list(FAMILIES), choices=FAMILIES,
                        metavar='NAME')
    options = parser.parse_args()
    results = []
    with processes(options.jobs) as pool:
        for done in as_completed([
                pool.submit(attempt, family, seed)
                for seed in seeds_of(options.half, options.draws, options.start)
                for family in options.families]):
            results.append(done.result())
            print(line(results[-1]), flush=True)
    for half, odd in (('tuning', 0), ('kept', 1)):
        if chosen := [r for r in results if r['seed'] % 2 == odd]:
            print_summary(chosen, half)


if __name__ == '__main__':
    main()
