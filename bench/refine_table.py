# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How often refinement finds what a simulated drive was not declared to have.

    python3 bench/refine_table.py [--draws N] [--none N] [--seed N] [--jobs N] [--cases gravity ...]

--draws are drives for each effect, --none those without one. What no effect describes is judged in
the second world.

Every draw is a new random drive with undeclared effects of random strength; refinement gets one
set of recordings, and the error is taken on another that it has not seen. Columns:

named     the variable named first is the effect's
only      and no other variable is named
≤ 1.3     error on the fresh recording at most 1.3 times the noise floor, while the joint moves
ratio     median of error over noise floor
before    the same for the note's sigmoid alone
"""

import time

from bench_tools import processes, table_parser
import numpy as np

from friction_comp.refinement import refine
from simulated_recordings import CASES, excitation_for, random_drive, record

LIMIT = 1.3
MOVING = 0.01


def moving(samples):
    """Return where the joint moves: faster than 0.01 rad/s over 40 ms."""
    reach = max(1, round(0.02 / samples.sample_time))
    padded = np.pad(samples.position, reach, mode='edge')
    way = padded[2 * reach:] - padded[:-2 * reach]
    return np.abs(way) > MOVING * 2 * reach * samples.sample_time


def error(model, parts):
    """Return the RMS of measured minus predicted current in A where the joint moves."""
    # All recordings of a drive begin in the same state: what drifts in one drifts in the others.
    errors = [(model.predict(part, same_recording=True) - part.current)[moving(part)]
             for part in parts]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def one_draw(task):
    """Refine a drive with cases and a seed, and judge the report; returns a plain dictionary."""
    cases, seed = task
    drive = random_drive(seed, cases)
    fit, score = (record(drive, 10 * seed + k, excitation_for(cases)) for k in (1, 2))
    started = time.perf_counter()
    result = refine(fit, model=None, drive=drive.model.drive)
    seconds = time.perf_counter() - started
    report, floor, wanted = result.report, drive.noise_floor, drive.variables
    found = [effect.variable for effect in report.effects]
    named = found[:1] == wanted[:1] and set(wanted) <= set(found)
    return {
        'seed': seed, 'wanted': wanted,
        'found': [[effect.name, effect.variable] for effect in report.effects],
        'unexplained': [entry.variable for entry in report.unexplained],
        'named': named, 'only': named and set(found) == set(wanted),
        'ratio': error(result.model, score) / floor,
        'before': report.before.held_out_rmse / floor, 'seconds': seconds,
        'elsewhere': error(result.model, score) / report.after.elsewhere_motion_rmse,
        'codes': sorted({one.code for one in report.findings if one.grade != 'trust'})}


def main():
    """Judge all draws; print the table, and a line for each draw that fell short."""
    parser = table_parser(__doc__, draws=10, none=100, seed=1000, jobs=2)
    parser.add_argument('--cases', nargs='+', choices=CASES, default=list(CASES))
    options = parser.parse_args()
    first = options.seed
    rows = [(name, [((name,), seed) for seed in range(first, first + options.draws)])
            for name in options.cases]
    if options.none:
        rows.append(('none', [((), seed) for seed in range(first, first + options.none)]))
    print('| undeclared | variable | draws | named | only | ≤ 1.3 | ratio | before | s |\n'
          '|---|---|---|---|---|---|---|---|---|')
    misses = []
    with processes(options.jobs) as pool:
        done = pool.map(one_draw, [task for _, tasks in rows for task in tasks])
        for title, tasks in rows:
            draws = [next(done) for _ in tasks]
            ratios = np.array([draw['ratio'] for draw in draws])
            print(f"| {title} | {', '.join(draws[0]['wanted'])} | {len(draws)} | "
                  f"{sum(d['named'] for d in draws)} | {sum(d['only'] for d in draws)} | "
                  f"{np.sum(ratios <= LIMIT)} | {np.median(ratios):.2f} | "
                  f"{np.median([d['before'] for d in draws]):.2f} | "
                  f"{np.mean([d['seconds'] for d in draws]):.1f} |", flush=True)
            misses += [
                f"- {title}, seed {draw['seed']}: found "
                f"{', '.join(name for name, _ in draw['found']) or 'nothing'}; unexplained "
                f"{', '.join(draw['unexplained']) or 'nothing'}; error {draw['ratio']:.2f} times "
                'the floor' for draw in draws if not draw['only'] or draw['ratio'] > LIMIT]
    print('\n'.join(['', 'Draws that fell short:', *misses]))


if __name__ == '__main__':
    main()
