# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How often refinement finds what a simulated drive was not declared to have.

    python3 bench/refine_table.py [--draws N] [--none N] [--seed N] [--jobs N]
                                  [--kinds single outside none] [--cases gravity ...]

--draws are drives for each effect, --none those without one.

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
from outside_effects import OUTSIDE

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


def error(model, trials):
    """Return the RMS of measured minus predicted current in A where the joint moves."""
    # All recordings of a drive begin in the same state: what drifts in one drifts in the others.
    parts = [(model.predict(part, same_recording=True) - part.current)[moving(part)]
             for part in (trial.samples for trial in trials)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def recordings(drive, seed, cases, outside, **changes):
    """Return the trials of one set of recordings; changes are those of their excitation."""
    trials = record(drive, seed, excitation_for(cases, **changes))
    if outside:
        # Both recordings of a drive share the effect.
        trials = [OUTSIDE[outside][0](trial, drive, np.random.default_rng([seed // 10, 9]))
                  for trial in trials]
    return trials


def one_draw(task):
    """Refine one drive and judge the report; returns a plain dictionary."""
    cases, outside, seed = task
    drive = random_drive(seed, cases)
    fit = recordings(drive, 10 * seed + 1, cases, outside)
    score = recordings(drive, 10 * seed + 2, cases, outside)
    started = time.perf_counter()
    result = refine([trial.samples for trial in fit], model=None, drive=drive.model.drive)
    seconds = time.perf_counter() - started
    report = result.report
    found = [effect.variable for effect in report.effects]
    unexplained = [entry.variable for entry in report.unexplained]
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
    floor = drive.noise_floor
    return {
        'cases': cases, 'outside': outside, 'seed': seed, 'wanted': wanted,
        'found': [[effect.name, effect.variable] for effect in report.effects],
        'unexplained': unexplained,
        'named': named, 'only': only, 'ratio': error(result.model, score) / floor,
        'before': report.before.held_out_rmse / floor, 'seconds': seconds,
        'elsewhere': error(result.model, score) / report.after.elsewhere_motion_rmse,
        'codes': sorted({one.code for one in report.findings if one.grade != 'trust'})}


def tasks(options):
    """Return the rows of the table: title and tasks."""
    seeds = range(options.seed, options.seed + options.draws)
    rows = {
        'single': [(name, [((name,), '', seed) for seed in seeds])
                   for name in options.cases or CASES],
        'outside': [(f'outside: {name}', [((), name, seed) for seed in seeds])
                    for name in OUTSIDE],
        'none': [('none', [((), '', seed)
                           for seed in range(options.seed, options.seed + options.none)])]}
    return [row for kind in options.kinds for row in rows[kind]]


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
    return [
        f"- {title}, seed {draw['seed']}: "
        f"found {', '.join(name for name, _ in draw['found']) or 'nothing'}; unexplained "
        f"{', '.join(draw['unexplained']) or 'nothing'}; error {draw['ratio']:.2f} times the floor"
        for title, draws in rows for draw in draws
        if not draw['only'] or (draw['ratio'] > LIMIT and not draw['outside'])]


def main():
    """Judge all draws and print the table."""
    parser = table_parser(__doc__, draws=10, none=100, seed=1000, jobs=2)
    parser.add_argument('--kinds', nargs='+', default=['single', 'outside', 'none'],
                        choices=['single', 'outside', 'none'])
    parser.add_argument('--cases', nargs='+', choices=list(CASES), help='only these effects')
    options = parser.parse_args()
    rows = tasks(options)
    with processes(options.jobs) as pool:
        draws = pool.map(one_draw, [task for _, group in rows for task in group])
        done = [(title, [next(draws) for _ in group]) for title, group in rows]
    print('\n'.join([table(done), '', 'Draws that fell short:', *misses(done)]))


if __name__ == '__main__':
    main()
