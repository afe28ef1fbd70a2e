# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each threshold and rule of refinement earns, and each part in exchange for the sketch's.

    python3 bench/refine_ablation.py [--data FOLDER ...] [--sums FILE] [--sets emps ...]
                                     [--without LEAST_SHARE ...] [--rows FILE]

Of the measured sets of each folder, fitted on one recording and judged on another: the geometric
mean of the error over that of `refine` as it is, the least and the largest, and in how many the
same is named. First, one part of `refine` at a time is as in the sketch of block sums; then each
threshold and rule is off. A row for each finding: in how many sets it is given, and the median and
the largest error there over the one said. The tables are written to ablation.md.
"""

from collections import defaultdict
from concurrent.futures import as_completed
import importlib
import json
from pathlib import Path
import sys

from bench_tools import processes, ROOT, table_parser
import numpy as np

# The value at which each threshold that changes a model has no effect.
OFF = {'FEWEST_SAMPLES': 0.0, 'REST': 0.0, 'PRESLIDING_SPEED': 0.0, 'ROWS': 1e9, 'REGIMES': 4.0,
       'EQUIVALENT': 0.0, 'ENCODER_STEPS': 1e9, 'LAG_SHARE': 1.0,
       'LONGEST_LAG': 0.01, 'LEAST_SHARE': 0.0, 'STANDARD_ERRORS': 0.0, 'SHORTLIST': 1.0}
# Effects that the sketch has, and those whose coefficient it bounds.
SKETCH = ('inertia', 'direction_asymmetry', 'viscous_shape', 'stribeck', 'gravity', 'spring',
          'load_torque', 'load_friction', 'temperature', 'warm_up', 'offset_drift', 'hysteresis',
          'cogging', 'friction_ripple', 'inner_load_friction')
BOUNDED = ('inertia', 'load_friction', 'hysteresis', 'inner_load_friction')


def parts_of_time(samples, index, others=()):
    """Return parts of time in the place of regimes of motion."""
    return np.argsort(np.argsort(index)) * 16 // len(index)


def better_in_parts(before, after, least=None, scatters=None):
    """Judge as the sketch does: a gain of a share, beyond its scatter, in most parts."""
    before, after = np.atleast_2d(before)[-1], np.atleast_2d(after)[-1]
    gain = before - after
    return bool(gain.mean() > 2.0 * gain.std(ddof=1) / np.sqrt(len(gain))
                and gain.sum() > (least or 0.02) * before.sum() and np.mean(gain > 0.0) >= 0.7)


def filter_by_time(problem):
    """Choose source and bandwidth as the sketch does: a plain drive, by parts of time."""
    from friction_comp.refinement.block_sums import held_out_error
    from friction_comp.refinement.prepare import clipped, plain_columns

    best, chosen, raw = np.inf, None, problem.raw
    for choice in problem.choices:
        moved = problem.moved(choice)
        speed = np.abs(moved.velocity)
        rows = np.flatnonzero((speed > 0.03 * np.percentile(speed, 98)) & ~clipped(raw.current))
        error = held_out_error(plain_columns(moved.take(rows)), problem.target[rows],
                               parts_of_time(raw, rows)) / len(rows)
        if error < 0.995 * best:
            best, chosen = error, choice
    return chosen


def columns_of_sketch(table, terms):
    """Propose the effects that the sketch has."""
    from friction_comp.model.effects import EFFECTS
    from friction_comp.refinement.effect_columns import _proposed

    return _proposed(table, terms, [EFFECTS[name] for name in SKETCH])


def bounds_of_sketch(term, count):
    """Return the signs that the sketch requires."""
    return [int(term.group is None and term.kind.name in BOUNDED)] + [0] * (count - 1)


# What is put in the place of which names of `friction_comp.refinement`.
EXCHANGES = {
    'motion: source and cut-off by parts of time, once': {
        'prepare.Problem.plain_settings': property(filter_by_time)},
    'columns: its effects alone, none at the start': {
        'search.first_model': lambda table: [], 'search.proposals': columns_of_sketch},
    'bounds': {'effect_columns.signs_of': bounds_of_sketch},
    'criterion: parts of time, absolute gains': {
        'prepare.regimes_in': parts_of_time, 'search.is_better': better_in_parts}}
RULES = {
    'parts that cancel are none': {'effect_columns._CANCELLED': np.inf},
    'every term holds over time': {'search.Search.holds_over_time': lambda *_: True},
    'other joints as they were seen': {'refine.with_range': lambda effect, _: effect},
    'a lag': {'search._with_best_lag': lambda fit: fit.settings},
    'transition by all samples': {'search._fit_transition_to_all_samples': lambda *_: None},
    'constants adjusted': {'search.adjust_constants': lambda table, terms, rounds: list(terms)},
    'signs': {'effect_columns._EQ6_SIGNS': (0,) * 5,
              'effect_columns.signs_of': lambda term, count: [0] * count},
    'filters of signals': {'prepare.choose_signals': lambda *_: {}}}


def change(name):
    """Put a rule, threshold or exchange in this process's place."""
    thresholds = importlib.import_module('friction_comp.refinement.thresholds')
    if name in OFF:
        setattr(thresholds, name, thresholds.Threshold(OFF[name], '', 'off'))
    for path, value in {**EXCHANGES, **RULES}.get(name, {}).items():
        module, *owners, attribute = path.split('.')
        owner = importlib.import_module(f'friction_comp.refinement.{module}')
        for one in owners:
            owner = getattr(owner, one)
        assert hasattr(owner, attribute), f'{path} is gone'
        setattr(owner, attribute, value)


def judge(folder, row, sums):
    """Return the error, names, error over the one said and codes of one set; of sums, the first."""
    from measured_table import moving_error, score_error, sums_error

    from friction_comp import read_recording
    from friction_comp.refinement import refine

    if sums:
        return sums_error(row, folder / row.data, sums), [], 0.0, []
    fit, parts = (read_recording(folder / row.data / part, joint=row.joint)
                  for part in ('fit', 'score'))
    result = refine(fit)
    table = np.concatenate([np.column_stack([
        part.time, part.current, result.model.predict(part)]) for part in parts])
    report = result.report
    return (score_error(row.error, table), sorted(one.name for one in report.effects),
            moving_error(result.model, parts, row.error) / report.after.elsewhere_motion_rmse,
            sorted({one.code for one in report.findings if one.grade != 'trust'}))


def compared(title, names, rows, base):
    """Return lines of a table: error, and how many are named alike, over those of `base`."""
    folders = list(dict.fromkeys(folder for folder, _ in base))
    lines = [f'| {title} | ' + ' | '.join(folders) + ' |', '|---' * (1 + len(folders)) + '|']
    for name in names:
        cells = []
        for folder in folders:
            pairs = [(row, base[case]) for case, row in rows.get(name, {}).items()
                     if case[0] == folder and case in base]
            ratios = np.array([row['error'] / other['error'] for row, other in pairs])
            same = sum(row['names'] == other['names'] for row, other in pairs)
            cells.append(f'{np.exp(np.mean(np.log(ratios))):.2f} ({ratios.min():.2f} to '
                         f'{ratios.max():.2f})' + f', {same} of {len(pairs)}' * (name != 'all')
                         if pairs else '')
        lines.append(f'| {name} | ' + ' | '.join(cells) + ' |')
    return [*lines, '']


def tables(known):
    """Return the tables of exchanges, rules and findings, in Markdown."""
    rows = defaultdict(dict)
    for row in known:
        rows[row['without']][tuple(row['case'])] = row
    base, given = rows[''], defaultdict(list)
    for row in base.values():
        for code in row['codes'] or ['none: trust']:
            given[code].append(row['ratio'])
    return [
        *compared('as the sketch', ['all', *EXCHANGES], rows, base),
        *compared('without', [*RULES, *OFF], rows, base),
        '| finding | sets | median, largest error over the one said |', '|---|---|---|',
        *(f'| {code} | {len(found)} | {np.median(found):.2f}, {max(found):.2f} |'
          for code, found in sorted(given.items()))]


def main():
    """Judge all sets with all, then with each exchange and without each threshold and rule."""
    every = [*EXCHANGES, *RULES, *OFF]
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--without', nargs='*', default=every, choices=every)
    parser.add_argument('--data', nargs='*', type=Path, default=[ROOT.parent / 'shared' / 'data'])
    parser.add_argument('--sums', type=Path)
    parser.add_argument('--sets', nargs='*', help='names of sets; all by default')
    parser.add_argument('--rows', type=Path, default=Path('rows.json'))
    options = parser.parse_args()
    from measured_table import rows_of

    cases = [(folder, row) for folder in options.data for row in rows_of(folder)
             if not options.sets or row.data in options.sets]
    rows = json.loads(options.rows.read_text()) if options.rows.exists() else []
    known = {(row['without'], *row['case']) for row in rows}
    for name in ('', *(['all'] if options.sums else []), *options.without):
        with processes(options.jobs, initializer=change, initargs=(name,)) as pool:
            work = {pool.submit(judge, folder, row, options.sums if name == 'all' else None): (
                folder.name, row.name) for folder, row in cases
                if (name, folder.name, row.name) not in known}
            for done in as_completed(work):
                if done.exception():
                    print(f'{name}, {work[done]}: {done.exception()}', file=sys.stderr)
                else:
                    rows.append({'without': name, 'case': work[done], **dict(zip(
                        ('error', 'names', 'ratio', 'codes'), done.result()))})
        options.rows.write_text(json.dumps(rows, indent=1))
    title, _, meaning = __doc__.strip().split('\n\n')
    text = '\n'.join([f'# {title}', '', meaning, '', *tables(rows)])
    (ROOT / 'bench' / 'ablation.md').write_text(f'{text}\n')
    print(text)


if __name__ == '__main__':
    main()
