# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each threshold and part of refinement earns, and how often each finding is right.

    python3 bench/refine_ablation.py [--without LEAST_SHARE lag ...] [--worlds measured single none
                                     second] [--data FOLDER ...] [--sets emps ...] [--jobs N]
                                     [--rows rows.json] [--write]

A row for each threshold that is off, and each part that is left out, or is as in 250 lines of block
sums: of the same cases, the geometric mean of the error on recordings that were not fitted over
that with all, the largest and the least, and in how many cases the same is named. A row for each
finding: in how many cases it is given, and the median and the largest error there over the one
said. Rows of earlier runs in --rows are kept; --write puts the tables into ablation.md.
"""

from collections import defaultdict
from concurrent.futures import as_completed
import importlib
import json
from pathlib import Path
import sys

from bench_tools import processes, ROOT, table_parser
import numpy as np

DATA = ROOT.parent / 'shared' / 'data'
# The value at which each threshold that changes a model has no effect. Those of words have the
# table of findings.
OFF = {'FEWEST_SAMPLES': 0.0, 'REST': 0.0, 'PRESLIDING_SPEED': 0.0, 'ROWS': 1e9, 'REGIMES': 4.0,
       'NEAR_LIMIT': 0.0, 'EQUIVALENT': 0.0, 'ENCODER_STEPS': 1e9, 'LAG_SHARE': 1.0,
       'LONGEST_LAG': 0.01, 'LEAST_SHARE': 0.0, 'STANDARD_ERRORS': 0.0, 'OWN_SHARE': 0.0,
       'SHORTLIST': 1.0}


def parts_of_time(samples, start, length=1, others=()):
    """Return parts of time in the place of regimes of motion."""
    return np.argsort(np.argsort(start)) * 16 // len(start)


def better_in_parts(before, after):
    """Judge as the sketch does: a gain of a share, beyond its scatter, in most parts."""
    gain = (np.atleast_2d(before) - np.atleast_2d(after))[-1]
    return bool(gain.mean() > 2.0 * gain.std(ddof=1) / np.sqrt(len(gain))
                and gain.sum() > 0.02 * np.atleast_2d(before)[-1].sum()
                and np.mean(gain > 0.0) >= 0.7)


def motion_of_time(samples, unusable, joints, load):
    """Choose source and bandwidth as the sketch does: a plain drive, by parts of time."""
    from friction_comp.model.differentiation import differentiate
    from friction_comp.refinement.block_sums import held_out_error
    from friction_comp.refinement.prepare import candidate_settings, plain_columns

    best, chosen, bandwidths = np.inf, None, (3.0, 6.0, 12.0, 25.0, 50.0, 100.0)
    for choice in candidate_settings(samples, samples.velocity, bandwidths):
        moved = differentiate(samples, choice)
        speed = np.abs(moved.velocity)
        rows = np.flatnonzero((speed > 0.03 * np.percentile(speed, 98)) & ~unusable)
        error = held_out_error(plain_columns(moved.take(rows)), samples.current[rows],
                               parts_of_time(samples, rows))
        if error < 0.995 * best * len(rows):
            best, chosen = error / len(rows), choice
    return chosen


def _same(problem, fit):
    return fit


# What is put in the place of which names in `friction_comp.refinement`.
PARTS = {
    'a lag': {'search._with_best_lag': lambda fit: fit.settings},
    'filters chosen again': {'search._at_best_motion': _same},
    'effects of time and history': {'search._with_late_terms': lambda fit: fit},
    'transition by all samples': {'search._fit_transition_to_all_samples': lambda *_: None},
    'constants adjusted': {'search.adjust_constants': lambda table, terms, rounds: list(terms)},
    'signs': {'effect_columns._EQ6_SIGNS': (0,) * 5,
              'effect_columns.signs_of': lambda term, count: [0] * count},
    'filters of signals': {'search.choose_signals': lambda *_: {},
                           'prepare.choose_signals': lambda *_: {}},
    'as the sketch: motion': {'prepare.choose_differentiation': motion_of_time,
                              'search._at_best_motion': _same},
    'as the sketch: columns': {'search.starts_of': lambda table: [[]]},
    'as the sketch: bounds': {'effect_columns._EQ6_SIGNS': (0, 1, 1, 0, 0)},
    'as the sketch: criterion': {'prepare.regimes_in': parts_of_time,
                                 'search.Search.is_better': staticmethod(better_in_parts)},
}


def leave_out(name):
    """Switch a threshold or part off in this process."""
    thresholds = importlib.import_module('friction_comp.refinement.thresholds')
    if name in OFF:
        setattr(thresholds, name, thresholds.Threshold(OFF[name], '', 'off'))
    for path, value in PARTS.get(name, {}).items():
        module, *owners, attribute = path.split('.')
        owner = importlib.import_module(f'friction_comp.refinement.{module}')
        for one in owners:
            owner = getattr(owner, one)
        getattr(owner, attribute)  # raises if it is gone
        setattr(owner, attribute, value)


def measured(folder, joint, how):
    """Refine on a measured recording, and predict its `score`."""
    from measured_table import moving_error, score_error

    from friction_comp import read_recording
    from friction_comp.refinement import refine

    fit, parts = (read_recording(Path(folder) / part, joint=joint) for part in ('fit', 'score'))
    result = refine(fit)
    table = np.concatenate([np.column_stack([
        part.time, part.current, result.model.predict(part)]) for part in parts])
    report = result.report
    return {'error': score_error(how, table), 'names': [one.name for one in report.effects],
            'ratio': moving_error(result.model, parts) / report.after.elsewhere_motion_rmse,
            'codes': sorted({one.code for one in report.findings if one.grade != 'trust'})}


def simulated(case, seed):
    """Refine on a simulated drive with a hidden effect, or none."""
    from refine_table import one_draw

    draw = one_draw(((case,) if case else (), '', seed))
    return {'error': draw['ratio'], 'names': [name for name, _ in draw['found']],
            'ratio': draw['elsewhere'], 'codes': draw['codes']}


def second(family, seed):
    """Refine on a case of the second world."""
    from second_world.judging import judge

    case = judge(family, seed)
    return {'error': case['after'] / case['floor'], 'names': case['effects'],
            'ratio': case['after'] / case['said'], 'codes': case['codes']}


def cases(options):
    """Return the cases: name of the world, function and its arguments."""
    from measured_table import rows_of

    from second_world.families import FAMILIES
    from simulated_recordings.cases import CASES

    seeds = range(900, 900 + options.draws)
    found = {
        'measured': [(measured, str(folder / row.data), row.joint, row.error)
                     for folder in options.data for row in rows_of(folder)
                     if not options.sets or row.data in options.sets],
        'single': [(simulated, case, seed) for case in ('', *CASES) for seed in seeds],
        'second': [(second, family, 2 * seed) for family in FAMILIES for seed in seeds]}
    return [(world, *case) for world in options.worlds for case in found[world]]


def table(rows, names):
    """Return the table of what is left out, in Markdown."""
    base = {tuple(row['case']): row for row in rows if not row['without']}
    worlds = list(dict.fromkeys(case[0] for case in base))
    lines = ['| without | ' + ' | '.join(worlds) + ' |', '|---' * (1 + len(worlds)) + '|']
    for name in names:
        cells = []
        for world in worlds:
            pairs = [(row, base[tuple(row['case'])]) for row in rows if row['without'] == name
                     and row['case'][0] == world and tuple(row['case']) in base]
            ratios = np.array([row['error'] / other['error'] for row, other in pairs])
            same = sum(sorted(row['names']) == sorted(other['names']) for row, other in pairs)
            cells.append(f'{np.exp(np.mean(np.log(ratios))):.2f} ({ratios.min():.2f} to '
                         f'{ratios.max():.2f}), {same} of {len(pairs)}' if pairs else '')
        lines.append(f'| {name} | ' + ' | '.join(cells) + ' |')
    return lines


def findings(rows):
    """Return the table of findings, in Markdown."""
    given = defaultdict(list)
    for row in rows:
        if not row['without']:
            for code in row['codes'] or ['none: trust']:
                given[code].append(row['ratio'])
    return ['| finding | cases | median, largest error over the one said |', '|---|---|---|'] + [
        f'| {code} | {len(found)} | {np.median(found):.2f}, {max(found):.2f} |'
        for code, found in sorted(given.items())]


def main():
    """Judge all cases with all thresholds and parts, then without each of them."""
    parser = table_parser(__doc__, draws=1, jobs=1)
    parser.add_argument('--without', nargs='*', default=[*OFF, *PARTS], choices=[*OFF, *PARTS])
    parser.add_argument('--worlds', nargs='*', default=['measured', 'single', 'second'])
    parser.add_argument('--data', nargs='*', type=Path, default=[DATA])
    parser.add_argument('--sets', nargs='*', help='names of measured sets; all by default')
    parser.add_argument('--rows', type=Path, default=Path('rows.json'))
    parser.add_argument('--write', action='store_true')
    options = parser.parse_args()
    rows = json.loads(options.rows.read_text()) if options.rows.exists() else []
    known = {(row['without'], *row['case']) for row in rows}
    for name in ('', *options.without):
        work = {}
        with processes(options.jobs, initializer=leave_out, initargs=(name,)) as pool:
            for world, judge, *arguments in cases(options):
                case = [world, *map(str, arguments)]
                if (name, *case) not in known:
                    work[pool.submit(judge, *arguments)] = case
            for done in as_completed(work):
                if done.exception():
                    print(f'{name}, {work[done]}: {done.exception()}', file=sys.stderr)
                else:
                    rows.append({'without': name, 'case': work[done], **done.result()})
        options.rows.write_text(json.dumps(rows, indent=1))
    parts = [name for name in (*OFF, *PARTS) if name in {row['without'] for row in rows}]
    sketch = [name for name in parts if name.startswith('as the sketch')]
    texts = {'ablation': [*table(rows, [name for name in parts if name not in sketch]), '',
                          *findings(rows)], 'exchange': table(rows, sketch)}
    for name, lines in texts.items():
        print('\n'.join(lines), '\n')
        if options.write:
            (ROOT / 'bench' / f'{name}.md').write_text(
                f'# {__doc__.splitlines()[0]}\n\n' + '\n'.join(lines) + '\n')


if __name__ == '__main__':
    main()
