# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How often refinement finds what a simulated drive was not declared to have.

    python3 bench/refine_table.py [--draws N] [--none N] [--kinds single pair outside none]

Every draw is a new random drive with undeclared effects of random strength; refinement gets one
set of recordings, and the error is taken on another that it has not seen. Columns:

named     the variable named first is the effect's (pairs: one of them first, and both)
only      and no other variable is named
≤ 1.3     error on the fresh recording at most 1.3 times the noise floor, while the joint moves
          (with --servo: while it slides, 50 ms away from standstill and reversal)
ratio     median of error over noise floor
before    the same for the note's sigmoid alone
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import json
import multiprocessing
import os
from pathlib import Path
import sys
import time

for variable in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

import numpy as np  # noqa: E402
from outside_effects import OUTSIDE  # noqa: E402
from scipy.ndimage import minimum_filter1d  # noqa: E402
from scipy.signal import butter, filtfilt  # noqa: E402

from friction_comp.refinement import refine  # noqa: E402
from simulated_recordings.cases import CASES  # noqa: E402
from simulated_recordings.drives import excitation_for, random_drive, record  # noqa: E402

LIMIT = 1.3
MOVING = 0.01


def moving(samples):
    """Return where the joint moves: faster than 0.01 rad/s over 40 ms."""
    reach = max(1, round(0.02 / samples.sample_time))
    padded = np.pad(samples.position, reach, mode='edge')
    way = padded[2 * reach:] - padded[:-2 * reach]
    return np.abs(way) > MOVING * 2 * reach * samples.sample_time


def sliding(samples):
    """Return where the joint has moved for 50 ms and goes on moving as long.

    At standstill and reversal the simulated joint sticks and gives before it slips; there its
    current is what the servo happens to ask for, not friction.
    """
    reach = max(1, round(0.05 / samples.sample_time))
    return minimum_filter1d(moving(samples).astype(int), 2 * reach + 1) > 0


def error(model, trials, where):
    """Return the RMS of measured minus predicted current in A where the joint moves."""
    # All recordings of a drive begin in the same state: what drifts in one drifts in the others.
    parts = [(model.predict(part, same_recording=True) - part.current)[where(part)]
             for part in (trial.samples for trial in trials)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def noise_floor(drive, trials, servo):
    """Return the error in A that a perfect model would have on the trials.

    A servo answers the steps of the encoder with current that moves the joint by less than a
    count: nothing in the recording tells of it, and it counts as noise. It is taken as the current
    above 40 Hz, by its median so that breakaway does not count.
    """
    if not servo:
        return drive.noise_floor
    dither = []
    for trial in trials:
        b, a = butter(2, 40.0, fs=1.0 / trial.samples.sample_time)
        high = trial.noise_free - filtfilt(b, a, trial.noise_free)
        dither.append(np.abs(high[moving(trial.samples)]))
    return float(np.hypot(drive.noise_floor, 1.4826 * np.median(np.concatenate(dither))))


def recordings(drive, seed, cases, outside, servo):
    """Return the trials of one set of recordings."""
    trials = record(drive, seed, excitation_for(cases, servo=servo))
    if outside:
        trials = [OUTSIDE[outside][0](trial, drive, np.random.default_rng([drive_seed(seed), 9]))
                  for trial in trials]
    return trials


def drive_seed(seed):
    """Return the drive's seed of a recording's: both recordings of a drive share the effect."""
    return seed // 10


def one_draw(task):
    """Refine one drive and judge the report; returns a plain dictionary."""
    cases, outside, seed, servo = task
    drive = random_drive(seed, cases)
    fit = recordings(drive, 10 * seed + 1, cases, outside, servo)
    score = recordings(drive, 10 * seed + 2, cases, outside, servo)
    started = time.perf_counter()
    result = refine([trial.samples for trial in fit], model=None, drive=drive.model.drive)
    seconds = time.perf_counter() - started
    report = result.report
    found = [effect['variable'] for effect in report['effects']]
    # The simulated joint under its servo has inertia, which the note's model lacks too.
    if servo and 'acceleration' not in drive.variables:
        found = [variable for variable in found if variable != 'acceleration']
    unexplained = [entry['variable'] for entry in report['unexplained']]
    wanted = list(drive.variables)
    if outside:
        allowed = OUTSIDE[outside][1]
        named = bool(set(unexplained) & allowed)
        only = named and set(found) <= allowed and set(unexplained) <= allowed
    elif wanted:
        named = bool(found) and found[0] in wanted and set(wanted) <= set(found)
        only = named and set(found) == set(wanted)
    else:
        named = only = not found
    floor = noise_floor(drive, score, servo)
    where = sliding if servo else moving
    return {
        'cases': list(cases), 'outside': outside, 'seed': seed, 'servo': servo, 'wanted': wanted,
        'found': [[effect['name'], effect['variable']] for effect in report['effects']],
        'unexplained': unexplained,
        'ambiguous': [entry['between'] for entry in report['ambiguous']],
        'named': named, 'only': only, 'ratio': error(result.model, score, where) / floor,
        'before': report['before']['held_out_rmse'] / floor,
        'floor_estimate': report['noise_floor'] / floor, 'seconds': seconds,
        'secret': drive.effects,
    }


def tasks(options):
    """Return (row title, list of tasks) of the table."""
    rows = []
    names = options.cases or list(CASES)
    seeds = range(options.seed, options.seed + options.draws)
    if 'single' in options.kinds:
        rows += [(name, [((name,), '', seed, options.servo) for seed in seeds])
                 for name in names]
    if 'pair' in options.kinds:
        rng = np.random.default_rng(options.seed)
        pairs = []
        for seed in range(options.seed, options.seed + options.pairs):
            pair = tuple(sorted(str(name) for name in rng.choice(names, 2, replace=False)))
            pairs.append((pair, '', seed, options.servo))
        rows.append(('random pairs', pairs))
    if 'outside' in options.kinds:
        rows += [(f'outside: {name}', [((), name, seed, options.servo) for seed in seeds])
                 for name in OUTSIDE]
    if 'none' in options.kinds:
        rows.append(('none', [((), '', seed, options.servo)
                              for seed in range(options.seed, options.seed + options.none)]))
    return rows


def table(rows):
    """Return the table in Markdown."""
    lines = ['| undeclared | variable | draws | named | only | ≤ 1.3 | ratio | before | s |',
             '|---|---|---|---|---|---|---|---|---|']
    for title, draws in rows:
        variable = ' or '.join(sorted(OUTSIDE[draws[0]['outside']][1])) if draws[0]['outside'] \
            else ', '.join(draws[0]['wanted']) if title in CASES else ''
        ratios = np.array([draw['ratio'] for draw in draws])
        bounded = '' if draws[0]['outside'] else f'{np.sum(ratios <= LIMIT)}'
        lines.append(
            f"| {title} | {variable} | {len(draws)} | {sum(d['named'] for d in draws)} | "
            f"{sum(d['only'] for d in draws)} | {bounded} | {np.median(ratios):.2f} | "
            f"{np.median([d['before'] for d in draws]):.2f} | "
            f"{np.mean([d['seconds'] for d in draws]):.1f} |")
    return '\n'.join(lines)


def misses(rows):
    """Return one line for each draw that fell short."""
    lines = []
    for _, draws in rows:
        for draw in draws:
            if draw['only'] and (draw['outside'] or draw['ratio'] <= LIMIT):
                continue
            lines.append(
                f"{' + '.join(draw['cases']) or draw['outside'] or 'none'}, seed {draw['seed']}: "
                f"found {', '.join(name for name, _ in draw['found']) or 'nothing'}; unexplained "
                f"{', '.join(draw['unexplained']) or 'nothing'}; ambiguous "
                f"{draw['ambiguous'] or 'nothing'}; error {draw['ratio']:.2f} times the floor")
    return lines


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--draws', type=int, default=10, help='drives for each effect')
    parser.add_argument('--pairs', type=int, default=20, help='drives with two effects')
    parser.add_argument('--none', type=int, default=100, help='drives with no effect')
    parser.add_argument('--kinds', nargs='+', default=['single', 'pair', 'outside', 'none'],
                        choices=['single', 'pair', 'outside', 'none'])
    parser.add_argument('--cases', nargs='+', choices=list(CASES), help='only these effects')
    parser.add_argument('--servo', action='store_true',
                        help='joint with inertia and stiction under a servo')
    parser.add_argument('--seed', type=int, default=1000)
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--output', type=Path, help='JSON file with every draw')
    options = parser.parse_args(argv)
    rows = tasks(options)
    flat = [task for _, group in rows for task in group]
    # Fresh processes: numba's and BLAS's threads do not survive a fork.
    with ProcessPoolExecutor(options.jobs, multiprocessing.get_context('spawn')) as pool:
        draws, started = [], time.perf_counter()
        for draw in pool.map(one_draw, flat):
            draws.append(draw)
            if sys.stderr.isatty():
                print(f'\r{len(draws)}/{len(flat)} drives, '
                      f'{time.perf_counter() - started:.0f} s', end='', file=sys.stderr)
    done, used = [], 0
    for title, group in rows:
        done.append((title, draws[used:used + len(group)]))
        used += len(group)
    print(table(done))
    lines = misses(done)
    if lines:
        print('\nDraws that fell short:')
        print('\n'.join('- ' + line for line in lines))
    if options.output:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        options.output.write_text(json.dumps(
            {'rows': [{'title': title, 'draws': group} for title, group in done]}, indent=1))
    return 0


if __name__ == '__main__':
    sys.exit(main())
