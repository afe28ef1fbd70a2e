# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each threshold and part of refinement earns, and how often each finding is right.

    python3 bench/refine_ablation.py [--without LEAST_SHARE lag ...] [--worlds measured single
                                     second] [--data FOLDER ...] [--sets emps ...] [--rows FILE]

A row for each threshold that is off, and for each part that is left out, or is as in the sketch of
block sums: of the same cases, the geometric mean of the error on recordings that were not fitted
over that with all, the least and the largest, and in how many the same is named. A row for each
finding: in how many cases it is given, and the median and the largest error there over the one
said. Rows of earlier runs in --rows are kept; the tables of all are written to ablation.md.
"""

from collections import defaultdict
from concurrent.futures import as_completed
import importlib
import json
from pathlib import Path
import sys

from bench_tools import processes, ROOT, table_parser
import numpy as np

# The value at which each threshold that changes a model has no effect; those of words have the
# table of findings.
OFF = {'FEWEST_SAMPLES': 0.0, 'REST': 0.0, 'PRESLIDING_SPEED': 0.0, 'ROWS': 1e9, 'REGIMES': 4.0,
       'NEAR_LIMIT': 0.0, 'EQUIVALENT': 0.0, 'ENCODER_STEPS': 1e9, 'LAG_SHARE': 1.0,
       'LONGEST_LAG': 0.01, 'LEAST_SHARE': 0.0, 'STANDARD_ERRORS': 0.0, 'SHORTLIST': 1.0}


def parts_of_time(samples, start, length=1, others=()):
    """Return parts of time in the place of regimes of motion."""
    return np.argsort(np.argsort(start)) * 16 // len(start)


def better_in_parts(before, after, least=0.02):
    """Judge as the sketch does: a gain of a share, beyond its scatter, in most parts."""
    before, after = np.atleast_2d(before)[-1], np.atleast_2d(after)[-1]
    gain = before - after
    return bool(gain.mean() > 2.0 * gain.std(ddof=1) / np.sqrt(len(gain))
                and gain.sum() > least * before.sum() and np.mean(gain > 0.0) >= 0.7)


def filter_by_time(problem):
    """Choose source and bandwidth as the sketch does: a plain drive, by parts of time."""
    from friction_comp.refinement.block_sums import held_out_error
    from friction_comp.refinement.prepare import candidate_settings, plain_columns

    best, chosen, raw = np.inf, None, problem.raw
    for choice in candidate_settings(raw, raw.velocity, (3.0, 6.0, 12.0, 25.0, 50.0, 100.0)):
        moved = problem.moved(choice)
        speed = np.abs(moved.velocity)
        rows = np.flatnonzero((speed > 0.03 * np.percentile(speed, 98)) & ~problem.unusable)
        error = held_out_error(plain_columns(moved.take(rows)), problem.target[rows],
                               parts_of_time(raw, rows)) / len(rows)
        if error < 0.995 * best:
            best, chosen = error, choice
    return chosen


# What is put in the place of which names of `friction_comp.refinement`.
PARTS = {
    'a lag': {'search._with_best_lag': lambda fit: fit.settings},
    'filters chosen again': {'search._at_best_motion': lambda problem, fit: fit},
    'that effects of time hold': {'search.Search.holds_over_time': lambda *_: True},
    'transition by all samples': {'search._fit_transition_to_all_samples': lambda *_: None},
    'constants adjusted': {'search.adjust_constants': lambda table, terms, rounds: list(terms)},
    'signs': {'effect_columns._EQ6_SIGNS': (0,) * 5,
              'effect_columns.signs_of': lambda term, count: [0] * count},
    'filters of signals': {'search.choose_signals': lambda *_: {},
                           'prepare.choose_signals': lambda *_: {}},
    'as the sketch: motion': {'prepare.Problem.plain_settings': property(filter_by_time),
                              'search._at_best_motion': lambda problem, fit: fit},
    'as the sketch: start': {'search.first_model': lambda table: []},
    'as the sketch: criterion': {'prepare.regimes_in': parts_of_time,
                                 'search.is_better': better_in_parts},
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
        assert hasattr(owner, attribute), f'{path} is gone'
        setattr(owner, attribute, value)


def judge(world, name, joint):
    """Return the error, names, error over the one said and codes of one case."""
    from measured_table import moving_error, Row, ROWS, score_error
    from refine_table import one_draw

    from friction_comp import read_recording
    from friction_comp.refinement import refine
    from second_world import judging

    if world == 'single':
        draw = one_draw(((name,) if name else (), 900))
        return draw['ratio'], [name for name, _ in draw['found']], draw['elsewhere'], draw['codes']
    if world == 'second':
        case = judging.judge(name, 900)
        return (case['after'] / case['floor'], case['effects'], case['after'] / case['said'],
                case['codes'])
    fit, parts = (read_recording(Path(name) / part, joint=joint) for part in ('fit', 'score'))
    result = refine(fit)
    table = np.concatenate([np.column_stack([
        part.time, part.current, result.model.predict(part)]) for part in parts])
    how = next((row.error for row in ROWS if row.data == Path(name).name), Row.error)
    report = result.report
    return (score_error(how, table), [one.name for one in report.effects],
            moving_error(result.model, parts, how) / report.after.elsewhere_motion_rmse,
            sorted({one.code for one in report.findings if one.grade != 'trust'}))


def cases(options):
    """Return the cases: world, name and joint."""
    from measured_table import rows_of

    from second_world.families import FAMILIES
    from simulated_recordings import CASES

    found = {'measured': [(str(folder / row.data), row.joint) for folder in options.data
                          for row in rows_of(folder)
                          if not options.sets or row.data in options.sets],
             'single': [(case, None) for case in ('', *CASES)],
             'second': [(family, None) for family in FAMILIES]}
    return [(world, *case) for world in options.worlds for case in found[world]]


def tables(rows):
    """Return a table of what is left out, and one of findings, in Markdown."""
    base = {tuple(row['case']): row for row in rows if not row['without']}
    worlds = list(dict.fromkeys(case[0] for case in base))
    lines = ['| without | ' + ' | '.join(worlds) + ' |', '|---' * (1 + len(worlds)) + '|']
    for name in dict.fromkeys(row['without'] for row in rows if row['without']):
        cells = []
        for world in worlds:
            pairs = [(row, base[tuple(row['case'])]) for row in rows if row['without'] == name
                     and row['case'][0] == world and tuple(row['case']) in base]
            ratios = np.array([row['error'] / other['error'] for row, other in pairs])
            same = sum(sorted(row['names']) == sorted(other['names']) for row, other in pairs)
            cells.append(f'{np.exp(np.mean(np.log(ratios))):.2f} ({ratios.min():.2f} to '
                         f'{ratios.max():.2f}), {same} of {len(pairs)}' if pairs else '')
        lines.append(f'| {name} | ' + ' | '.join(cells) + ' |')
    given = defaultdict(list)
    for row in base.values():
        for code in (row['codes'] or ['none: trust']) if row['ratio'] else ():
            given[code].append(row['ratio'])
    return lines + ['', '| finding | cases | median, largest error over the one said |',
                    '|---|---|---|'] + [
        f'| {code} | {len(found)} | {np.median(found):.2f}, {max(found):.2f} |'
        for code, found in sorted(given.items())]


def main():
    """Judge all cases with all thresholds and parts, then without each of them."""
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--without', nargs='*', default=[*OFF, *PARTS], choices=[*OFF, *PARTS])
    parser.add_argument('--worlds', nargs='*', default=['measured', 'single', 'second'])
    parser.add_argument('--data', nargs='*', type=Path, default=[ROOT.parent / 'shared' / 'data'])
    parser.add_argument('--sets', nargs='*', help='names of measured sets; all by default')
    parser.add_argument('--rows', type=Path, default=Path('rows.json'))
    options = parser.parse_args()
    rows = json.loads(options.rows.read_text()) if options.rows.exists() else []
    known = {(row['without'], *row['case']) for row in rows}
    for name in ('', *options.without):
        with processes(options.jobs, initializer=leave_out, initargs=(name,)) as pool:
            work = {pool.submit(judge, *case): case for case in cases(options)
                    if (name, *case) not in known}
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
