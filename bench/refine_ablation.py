# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each threshold of refinement earns, and how often each finding is right to be there.

    python3 bench/refine_ablation.py [--thresholds LEAST_SHARE ...] [--worlds measured single none]
                                     [--draws N] [--output rows.json]

A row for each threshold: the same cases with it off. `error` is the geometric mean of the error on
recordings that were not fitted, over that with all thresholds, `worse` and `better` the cases more
than a tenth off, `found` and `false` the hidden effects that are named, and names that are not
hidden. A row for each finding: in how many cases it is given, and the median and the largest error
there over the one said. With --output, rows of earlier runs are kept.
"""

from collections import defaultdict
from concurrent.futures import as_completed
import json
from pathlib import Path
import sys

from bench_tools import processes, ROOT, table_parser
import numpy as np

DATA = ROOT.parent / 'shared' / 'data'
# The value at which each threshold has no effect.
OFF = {'FEWEST_SAMPLES': 0.0, 'REST': 0.0, 'PRESLIDING_SPEED': 0.0, 'ROWS': 1e9, 'REGIMES': 4.0,
       'NEAR_LIMIT': 0.0, 'PASSED_AGAIN': 0.0, 'ONE_MOTION': 2.0, 'EQUIVALENT': 0.0,
       'ENCODER_STEPS': 1e9, 'LAG_SHARE': 1.0, 'LONGEST_LAG': 0.01, 'LEAST_SHARE': 0.0,
       'STANDARD_ERRORS': 0.0, 'OWN_SHARE': 0.0, 'SHORTLIST': 1.0, 'REVERSALS': 2.0,
       'REVERSAL_SAMPLES': 2.0, 'REVERSAL_SPREAD': 1e9, 'BREAKAWAY_SPREAD': 1e9, 'GROWTH': 1e9,
       'LEAST_STRENGTH': 0.0, 'UNEXPLAINED': 1e9, 'USELESS_ERROR': 1e9, 'INSEPARABLE': 2.0}
CLEAR = 1.1


def switch_off(name):
    """Switch a threshold off in this process."""
    from friction_comp.refinement import refine, thresholds  # noqa: F401

    if name:
        setattr(thresholds, name, thresholds.Threshold(OFF[name], '', 'off'))


def measured(data, joint, how):
    """Refine on a measured recording, and predict its `score`."""
    from measured_table import moving_error, score_error

    from friction_comp import read_recording
    from friction_comp.refinement import refine

    result = refine(read_recording(DATA / data / 'fit', joint=joint))
    parts = read_recording(DATA / data / 'score', joint=joint)
    table = np.concatenate([np.column_stack([
        part.time, part.current, result.model.predict(part)]) for part in parts])
    report = result.report
    return {'error': score_error(how, table), 'asked': 0, 'found': 0, 'false': 0,
            'ratio': moving_error(result.model, parts, how) / report.after.elsewhere_motion_rmse,
            'codes': sorted({one.code for one in report.findings if one.grade != 'trust'})}


def simulated(case, seed):
    """Refine on a simulated drive with a hidden effect, or none."""
    from refine_table import one_draw

    draw = one_draw(((case,) if case else (), '', seed))
    false = {variable for _, variable in draw['found']} - set(draw['wanted'])
    return {'error': draw['ratio'], 'asked': 1, 'found': int(draw['named']), 'false': len(false),
            'ratio': draw['elsewhere'], 'codes': draw['codes']}


def cases(worlds, draws):
    """Return the cases of worlds: a function and its arguments."""
    from measured_table import ROWS

    from simulated_recordings import CASES

    found = []
    if 'measured' in worlds:
        found += [(measured, (row.data, row.joint, row.error)) for row in ROWS
                  if (DATA / row.data / 'fit').exists()]
    if 'single' in worlds:
        found += [(simulated, (case, seed)) for case in CASES for seed in range(900, 900 + draws)]
    if 'none' in worlds:
        found += [(simulated, ('', seed)) for seed in range(900, 900 + 4 * draws)]
    return found


def show(rows):
    """Print a row for each threshold, and one for each finding."""
    base = {tuple(row['case']): row for row in rows if not row['off']}
    print('| without | error | worse, better | found | false |\n|---|---|---|---|---|')
    for name in dict.fromkeys(row['off'] for row in rows):
        own = [row for row in rows if row['off'] == name]
        ratios = np.array([row['error'] / base[tuple(row['case'])]['error'] for row in own
                           if tuple(row['case']) in base])
        print(f"| {name or 'nothing'} | {np.exp(np.mean(np.log(ratios))):.3f} "
              f'| {np.sum(ratios > CLEAR)}, {np.sum(ratios < 1.0 / CLEAR)} '
              f"| {sum(row['found'] for row in own)} of {sum(row['asked'] for row in own)} "
              f"| {sum(row['false'] for row in own)} |")
    given = defaultdict(list)
    for row in base.values():
        for code in row['codes'] or ['none: trust']:
            given[code].append(row['ratio'])
    print('\n| finding | cases | median, largest error over the one said |\n|---|---|---|')
    for code, found in sorted(given.items()):
        print(f'| {code} | {len(found)} | {np.median(found):.2f}, {max(found):.2f} |')


def main():
    """Judge all cases with all thresholds, then without each of them."""
    parser = table_parser(__doc__, draws=1, jobs=1)
    parser.add_argument('--thresholds', nargs='*', default=list(OFF), choices=OFF)
    parser.add_argument('--worlds', nargs='*', default=['measured', 'single', 'none'])
    parser.add_argument('--output', type=Path, help='JSON file for the single results')
    options = parser.parse_args()
    rows = json.loads(options.output.read_text()) if options.output and (
        options.output.exists()) else []
    for name in ('', *options.thresholds):
        if name in {row['off'] for row in rows}:
            continue
        with processes(options.jobs, initializer=switch_off, initargs=(name,)) as pool:
            work = {pool.submit(judge, *arguments): [judge.__name__, *map(str, arguments)]
                    for judge, arguments in cases(options.worlds, options.draws)}
            for done in as_completed(work):
                if done.exception():
                    print(f'{name}, {work[done]}: {done.exception()}', file=sys.stderr)
                else:
                    rows.append({'off': name, 'case': work[done], **done.result()})
        if options.output:
            options.output.write_text(json.dumps(rows, indent=1))
    show(rows)


if __name__ == '__main__':
    main()
