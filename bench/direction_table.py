# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges where directions come from: every floor of plans, leaders, sensors and ends.

    python3 bench/direction_table.py [--rows attempts rest intention let_go follow ends
                                      taught] [--seed S] [--draws N] [--hours H]

--draws are gears of each kind, --hours are of rest. Even seeds are for tuning on, odd seeds are
kept for judging. Each row has the simplest rival beside it. The whole takes
about twenty minutes of processor time.
"""

import time

from bench_tools import table_parser
from cheap_sensors.attempts import attempts, hours_at_rest
from cheap_sensors.ends import beyond_ends
from cheap_sensors.follower import follow, follower_bank, WAYS
from cheap_sensors.intention import intention, let_go
from cheap_sensors.taught import taught
import numpy as np

from law_judge.bank import make_bank
from world import gear as world


def main():
    parser = table_parser(__doc__, seed=0, draws=1, hours=3.0)
    parser.add_argument('--rows', nargs='+', default=list(ROWS), choices=ROWS)
    options = parser.parse_args()
    print(f'seed {options.seed} ({"tuning" if options.seed % 2 == 0 else "kept"} half)')
    for name in options.rows:
        began = time.time()
        for what, value, floor in ROWS[name](options):
            print(f'{what:74s} {value:>18s}  {floor}', flush=True)
        print(f'# {name}: {time.time() - began:.0f} s', flush=True)


def attempts_rows(options):
    # 1,000 attempts: half at each rate of values.
    found = [attempts(20, 25, options.seed + 2 * k) for k in range(2)]
    delays = 1e3 * np.concatenate([one[0] for one in found])
    missed, wrong = (sum(one[k] for one in found) for k in (1, 2))
    total = len(delays) + missed + wrong
    yield ('delay, median and nine of ten',
           f'{np.median(delays):.0f}, {np.percentile(delays, 90):.0f} ms', '60 ms')
    yield 'wrong direction', f'{wrong} of {total}', '1 %'
    yield 'missed', f'{missed} of {total}', ''


def rest_rows(options):
    false = hours_at_rest(options.hours, 12, options.seed)
    yield f'false onsets in {options.hours:g} h at rest', f'{false}', '1 an hour'


def intention_rows(options):
    bank = make_bank(world, world.KINDS, options.draws, options.seed)
    removed = intention(bank)
    for name, share in removed.items():
        of_announced = 100.0 * share / removed['announced']
        yield (f'{name}: of what an announcement removes of friction in the peak, median',
               f'{np.nanmedian(of_announced):.0f} %', '60 %' if name == 'force' else '')
    least = 100.0 * np.nanmin(removed['force'] - removed['d = 0'])
    yield 'force: least gain over d = 0', f'{least:.0f} %', '≥ 0'


def let_go_rows(options):
    bank = make_bank(world, world.KINDS, options.draws, options.seed)
    for what, factors in (('friction 0.70 and 0.80 of the model', (1.0 / 0.7, 1.0 / 0.8)),
                          ('model 1 and 1.1 times the truth', (1.0, 1.1))):
        for name, way in let_go(bank, factors).items():
            yield (f'{name}, {what}: > 5 deg after one lets go',
                   f'{(way > 5.0).sum()} of {len(way)}', 'that of d = 0' if name == 'force' else '')


def follow_rows(options):
    bank = follower_bank(world, options.draws, options.seed)
    found = {way: follow(bank, way) for way in WAYS}
    bare, rival = found['without'], found[WAYS[3]]
    for way in WAYS:
        one = found[way]
        yield (f'{way}: RMS error, and stairs, mrad, medians',
               f'{1e3 * np.median(one["rms"]):.1f}, {1e3 * np.median(one["stairs"]):.1f}', '')
        yield (f'{way}: of that without: RMS median and worst',
               f'{np.median(one["rms"] / bare["rms"]):.2f}, '
               f'{np.max(one["rms"] / bare["rms"]):.2f}', '0.50' if way == 'ours' else '')
        stuck = bare['stairs'] > STUCK
        yield (f'{way}: stairs where there are any without, of those',
               f'{np.median((one["stairs"] / bare["stairs"])[stuck]):.2f} '
               f'({stuck.sum()} of {stuck.size})', '0.25' if way == 'ours' else '')
        yield (f'{way}: moves by more than a count in a rest',
               f'{(one["moves"] > COUNT).sum()} of {stuck.size}', '0' if way == 'ours' else '')
    worse = found['ours']['rms'] > 1.02 * rival['rms']
    yield ('ours: RMS error larger than with 0.9·tanh of the desired speed',
           f'{worse.sum()} of {worse.size}', '0')


def ends_rows(options):
    bank = make_bank(world, world.KINDS, 2, options.seed)
    for told in ('end', 'direction', 'nothing'):
        way = beyond_ends(bank, told=told)
        yield (f'friction 0.70 of the model, {told} announced: > 5 deg beyond the end',
               f'{(way > 5.0).sum()} of {len(way)}', '0' if told == 'end' else '')
        yield '    farthest', f'{way.max():.0f} deg', ''
    way = beyond_ends(bank, 'none', 'nothing')
    yield ('    no compensation at all', f'{(way > 5.0).sum()} of {len(way)}', '')


def taught_rows(options):
    worst, missed, extra, total = taught(60, options.seed)
    yield 'taught exercise: farthest from a turning point', f'{worst:.2f} deg', '1 deg'
    yield 'taught exercise: turns missed, invented', f'{missed}, {extra} of {total}', '0'


# rad: height of stairs that count as such, and a count of the encoder.
STUCK, COUNT = 5e-3, 5e-4
ROWS = {'attempts': attempts_rows, 'rest': rest_rows,
        'intention': intention_rows, 'let_go': let_go_rows, 'follow': follow_rows,
        'ends': ends_rows, 'taught': taught_rows}


if __name__ == '__main__':
    main()
