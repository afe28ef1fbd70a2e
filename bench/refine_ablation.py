# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What each rule of refinement earns: the same worlds with it and without it.

    python3 bench/refine_ablation.py [--rules exchange 'lag + bandwidth again' ...] [--jobs N]
                                     [--worlds second single none arms measured] [--first N]
                                     [--draws N] [--output results.json]

--first is the number of the first draw. With --output, results of earlier runs are read from the
file and not computed again.

Worlds: the second world (tuning half), drives of `refine_table` with one hidden effect and with
none, simulated arms (tuning seeds), and the measured recordings, where they are there. Columns:

found     hidden effects that are named, and drives without an effect on which nothing is
false     names that are not hidden
error     geometric mean of the error on recordings that were not fitted, over that with all rules
worse     cases whose error is more than a tenth above that with all rules; and below it
"""

from concurrent.futures import as_completed
import importlib
import json
from pathlib import Path
import sys

from bench_tools import processes, ROOT, table_parser
import numpy as np

DATA = ROOT.parent / 'shared' / 'data'
WORLDS = ('second', 'single', 'none', 'arms', 'measured')
CLEAR = 1.1


def everywhere(name, value):
    """Replace a name in all modules of refinement that hold it."""
    import friction_comp.refinement.refine  # noqa: F401

    found = [module for key, module in sys.modules.items()
             if key.startswith('friction_comp.refinement.') and name in vars(module)]
    if not found:
        raise LookupError(f'{name} is not in refinement any more')
    for module in found:
        setattr(module, name, value)


def method(module, owner, name, value):
    """Replace a method of a class of refinement."""
    found = importlib.import_module(f'friction_comp.refinement.{module}')
    setattr(getattr(found, owner), name, value)


def without_lag(before):
    """Return no other lag, but other bandwidths."""
    return lambda problem, found: [one for one in before(problem, found)
                                    if one.get('lag') == found.settings.get('lag')]


def without_bandwidth(before):
    """Return no other bandwidth, but other lags."""
    return lambda problem, found: [one for one in before(problem, found)
                                    if one['bandwidth'] == found.settings['bandwidth']]


def offer_all(attempt, terms):
    """Offer effects of time together with all others."""
    from friction_comp.refinement.effect_columns import proposals

    table = attempt.table
    wanted = proposals(table, terms)
    attempt._retained.update(terms)
    table.keep(attempt._retained.union(wanted))
    kinds = {term.kind for term in attempt.fixed if term.kind.max_count == 1}
    attempt.candidates = [term for term in table.add(wanted) if term.kind not in kinds]


def from_nothing(attempt):
    """Start without any effect."""
    return [[]]


def other_settings(without):
    """Replace what else is tried by what a function leaves of it."""
    from friction_comp.refinement import best_fit

    everywhere('_other_settings', without(best_fit._other_settings))


def constants_of_the_grid():
    """Leave constants where the grid has them."""
    from friction_comp.refinement.search import _with_current_loads

    everywhere('adjust_constants', lambda table, terms, rounds: _with_current_loads(
        table, list(terms)))


RULES = {
    'nothing': lambda: None,
    'two standard errors': lambda: everywhere('STANDARD_ERRORS', 0.0),
    'a share worth naming': lambda: everywhere('LEAST_SHARE', 0.0),
    'own share of a column': lambda: everywhere('OWN_SHARE', 0.0),
    'regions of posture': lambda: everywhere(
        'regions_of', lambda position: np.zeros(len(position), dtype=int)),
    "own term beside a group's": lambda: method(
        'search', 'Search', 'with_own_terms', lambda self, terms: list(terms)),
    'exchange': lambda: method('search', 'Search', 'exchange', lambda self, terms: list(terms)),
    'backward': lambda: method(
        'search', 'Search', 'backward', lambda self, terms: self.with_own_terms(terms)),
    'start from physics': lambda: method('best_fit', 'EffectSearch', 'starts', from_nothing),
    'lag': lambda: other_settings(without_lag),
    'bandwidth again': lambda: other_settings(without_bandwidth),
    'repeated searches': lambda: everywhere('NAMED_SHARE', 0.0),
    'interval without zero': lambda: method(
        'stability', 'Intervals', 'excludes_zero', lambda self, table, key: True),
    'constant at its limit': lambda: everywhere('at_limit', lambda term, coverage: False),
    'time last': lambda: method('best_fit', 'EffectSearch', 'update_candidates', offer_all),
    'transition of all samples': lambda: everywhere(
        '_fit_transition_to_all_samples', lambda table, terms: None),
    'constants adjusted': constants_of_the_grid,
    'beside standstill': lambda: everywhere(
        'maximum_filter1d', lambda mask, size: np.zeros_like(mask)),
    'load by mechanics': lambda: everywhere(
        'load_coefficient', lambda samples, unusable, drive: 0.0),
    'fast samples choose motion': lambda: everywhere('_FAST', 0.0),
    'six of a kind compared': lambda: everywhere('SHORTLIST', 1.0)}


def off(rule):
    """Switch a rule, or several joined by ' + ', off in this process."""
    for one_of_them in rule.split(' + '):
        RULES[one_of_them]()


def cases(worlds, draws, first=0):
    """Return the cases of worlds as (world, what names the case)."""
    found = []
    if 'second' in worlds:
        from second_world.families import FAMILIES
        found += [('second', (family, 2 * k)) for family in FAMILIES
                  for k in range(first, first + draws)]
    from simulated_recordings.cases import CASES
    if 'single' in worlds:
        found += [('single', (name, seed)) for name in CASES
                  for seed in range(first, first + draws)]
    if 'none' in worlds:
        found += [('none', ('', seed)) for seed in range(8 * first, 8 * (first + draws))]
    if 'arms' in worlds:
        found += [('arms', (seed,)) for seed in range(10 * first, 10 * (first + draws))]
    if 'measured' in worlds and DATA.exists():
        import measured_table
        found += [('measured', (row.data, row.joint, row.error)) for row in measured_table.ROWS
                  if (DATA / row.data / 'fit').exists()]
    return found


def judged(world, name):
    """Return one case's error, what was found and what was named falsely."""
    if world == 'second':
        from second_world.judging import judge
        result = judge(*name)
        counts = result['counts'] and bool(result['asked'])
        return {'error': result['after'] / result['floor'], 'asked': int(counts),
                'found': int(counts and not result['missed']), 'false': len(result['false'])}
    if world in ('single', 'none'):
        import refine_table
        kinds = (name[0],) if name[0] else ()
        result = refine_table.one_draw((kinds, '', 900 + name[1]))
        false = {variable for _, variable in result['found']} - set(result['wanted'])
        return {'error': result['ratio'], 'asked': 1, 'found': int(result['named']),
                'false': len(false)}
    if world == 'arms':
        from arm_world.judging import judge
        result = judge(*name)
        return {'error': result.get('refined', float('nan')), 'asked': 0, 'found': 0, 'false': 0}
    return measured(*name)


def measured(data, joint, error):
    """Refine on a measured recording and predict its `score`."""
    from measured_table import score_error

    from friction_comp import read_recording
    from friction_comp.refinement.refine import refine

    result = refine(read_recording(DATA / data / 'fit', joint=joint))
    tables = [np.column_stack([part.time, part.current, result.model.predict(part)])
              for part in read_recording(DATA / data / 'score', joint=joint)]
    return {'error': score_error(error, np.concatenate(tables)), 'asked': 0, 'found': 0,
            'false': 0}


def one(rule, world, name):
    """Judge one case in a process in which a rule is off; a failure is a result."""
    try:
        result = judged(world, name)
    except Exception as failure:  # counted and shown
        result = {'error': float('nan'), 'asked': 0, 'found': 0, 'false': 0,
                  'failed': f'{type(failure).__name__}: {failure}'}
    return {'rule': rule, 'world': world, 'name': list(name), **result}


def show(results):
    """Print a line for each rule."""
    base = {(r['world'], *map(str, r['name'])): r for r in results if r['rule'] == 'nothing'}
    worlds = [world for world in WORLDS if any(r['world'] == world for r in results)]
    print('| without | found | false | worse, better | '
          + ' | '.join(f'error, {world}' for world in worlds) + ' |')
    print('|---' * (4 + len(worlds)) + '|')
    for rule in dict.fromkeys(r['rule'] for r in results):
        own = [r for r in results if r['rule'] == rule]
        ratios = {world: [] for world in worlds}
        for r in own:
            before = base.get((r['world'], *map(str, r['name'])))
            if before and np.isfinite([r['error'], before['error']]).all():
                ratios[r['world']].append(r['error'] / before['error'])
        together = np.array([ratio for some in ratios.values() for ratio in some])
        failed = sum('failed' in r for r in own)
        print(f"| {rule}{f' ({failed} failed)' if failed else ''} "
              f"| {sum(r['found'] for r in own)} of {sum(r['asked'] for r in own)} "
              f"| {sum(r['false'] for r in own)} "
              f'| {np.sum(together > CLEAR)}, {np.sum(together < 1.0 / CLEAR)} | '
              + ' | '.join(f'{np.exp(np.mean(np.log(some))):.3f}' if some else '-'
                           for some in ratios.values()) + ' |')


def main():
    """Judge all cases with all rules, then without each of them."""
    parser = table_parser(__doc__, draws=1, first=0, jobs=1)
    parser.add_argument('--rules', nargs='*', default=list(RULES))
    parser.add_argument('--worlds', nargs='*', default=WORLDS, choices=WORLDS)
    parser.add_argument('--output', type=Path, help='JSON file for the single results')
    arguments = parser.parse_args()
    unknown = {name for rule in arguments.rules for name in rule.split(' + ')} - set(RULES)
    if unknown:
        parser.error(f'no such rule: {", ".join(sorted(unknown))}; there are {", ".join(RULES)}')
    results = []
    if arguments.output and arguments.output.exists():
        results = json.loads(arguments.output.read_text())
    have = {r['rule'] for r in results}
    for rule in dict.fromkeys(('nothing', *arguments.rules)):
        if rule in have:
            continue
        with processes(arguments.jobs, initializer=off, initargs=(rule,)) as pool:
            waiting = [pool.submit(one, rule, world, name)
                       for world, name in cases(arguments.worlds, arguments.draws, arguments.first)]
            own = [done.result() for done in as_completed(waiting)]
        results += own
        if arguments.output:
            arguments.output.write_text(json.dumps(results, indent=1))
        show([r for r in results if r['rule'] in ('nothing', rule)])
        sys.stdout.flush()
    print()
    show(results)


if __name__ == '__main__':
    main()
