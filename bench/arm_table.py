# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How refinement without a URDF does on simulated arms, by types of motion.

    python bench/arm_table.py [--seeds 0 24] [--other CHECKOUT]

Errors are multiples of the noise on the torque: on recordings not fitted, of the same amplitude
and of another, and `held-out` what refinement itself says. --seeds is a half-open range. Each seed
is a process of its own; with --other, the same is done with the package of another checkout, by
turns. Seeds 0 to 23 were used to tune, those from 24 on are kept: change nothing by what they say.
24 to 59 were looked at once. Needs Pinocchio.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
import subprocess
import sys

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
THREADS = dict.fromkeys(('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'), '1')
MARGIN = 0.05  # by which one error has to be below another to be better
TOO_FAR = 3.0  # times the held-out error, of an error on score


def run(seed, root):
    """Judge a seed with the package of a checkout; return what `arm_world.judging.judge` does.

    Where the world has no case for a seed, `none` says why.
    """
    done = subprocess.run(
        [sys.executable, __file__, '--one', str(seed)], cwd=root, stdout=subprocess.PIPE,
        text=True, env={**os.environ, **THREADS, 'PYTHONPATH': str(root)})
    if done.returncode:
        raise SystemExit(f'seed {seed} ended with code {done.returncode}')
    result = json.loads(done.stdout.splitlines()[-1])
    if 'none' in result:
        return result
    if not Path(result['package']).resolve().is_relative_to(root):
        raise SystemExit(f'{result["package"]} was used, which is not in {root}')
    return result


def line(result):
    """Return one seed as a line."""
    text = (f"{result['seed']:4d} {result['kind']:15s}{result['joint']}/{result['joints']} "
            f"{result['noise']:9.2g} {result['least_squares']:8.2f} ")
    if 'failed' in result:
        return text + f"{result['seconds']:.1f} s  FAILED {result['failed']}"
    return text + (f"{result['start']:8.2f} {result['refined']:8.2f} {result['held_out']:8.2f} "
                   f"{result['seconds']:6.1f} s  {result['verdict']:14s} "
                   f"{', '.join(result['effects']) or 'none'}")


def quantiles(values):
    """Return median and 90th percentile as text."""
    if not values:
        return f'{"-":>17s}'
    return '{:8.2f} {:8.2f}'.format(*np.quantile(values, (0.5, 0.9)))


def trusted_too_far(results):
    """Return how many models are trusted, and how many of them err far beyond what they say."""
    trusted = [r for r in results if r.get('verdict') in ('trust', 'trust in part')]
    return sum(r['refined'] > TOO_FAR * r['held_out'] for r in trusted), len(trusted)


def print_summary(title, results):
    """Print medians and 90th percentiles by type of motion and in total."""
    print(f'\n{title:16s}seeds failed   least squares           refined   '
          f'trusted, yet beyond {TOO_FAR:.0f} x held-out\n'
          f'{"":29s}   median     90 %   median     90 %')
    for kind in (*dict.fromkeys(r['kind'] for r in results), 'total'):
        chosen = [r for r in results if kind in (r['kind'], 'total')]
        answered = [r for r in chosen if 'failed' not in r]
        beyond, trusted = trusted_too_far(answered)
        print(f"{kind:16s}{len(chosen):5d} {len(chosen) - len(answered):6d} "
              f"{quantiles([r['least_squares'] for r in chosen])} "
              f"{quantiles([r['refined'] for r in answered])}   {beyond} of {trusted}")


def print_comparison(here, there):
    """Print how often the package here errs less or more than the one there."""
    print(f'\nhere beside there, by more than {MARGIN:.0%}')
    for kind in (*dict.fromkeys(r['kind'] for r in here), 'total'):
        ratios = [a['refined'] / b['refined'] for a, b in zip(here, there)
                  if kind in (a['kind'], 'total') and 'failed' not in a and 'failed' not in b]
        print(f'{kind:16s}{sum(r < 1 - MARGIN for r in ratios)} better, '
              f'{sum(r > 1 + MARGIN for r in ratios)} worse, of {len(ratios)}')


def main():
    """Judge seeds one after the other and sum them up."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seeds', type=int, nargs=2, default=(0, 24), metavar=('FROM', 'TO'),
                        help='the first, and the one after the last')
    parser.add_argument('--other', type=Path, metavar='CHECKOUT', help='to compare with')
    parser.add_argument('--one', type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        from arm_world.judging import judge
        try:
            print(json.dumps(judge(arguments.one)))
        except LookupError as error:
            print(json.dumps({'none': str(error)}))
        return
    if arguments.seeds[0] >= arguments.seeds[1]:
        parser.error('--seeds: the second number must be above the first')
    roots = {'here': ROOT}
    if arguments.other:
        roots['there'] = arguments.other.resolve()
        if not (roots['there'] / 'friction_comp').is_dir():
            parser.error(f'no checkout of this package: {arguments.other}')
    indent = ' ' * 6 if arguments.other else ''
    print(f'{indent}seed motion      joint/of noise N·m  least sq    start  refined held-out   '
          'time    verdict        effects')
    results = {name: [] for name in roots}
    for seed in range(*arguments.seeds):
        for name, root in roots.items():
            result = run(seed, root)
            if 'none' in result:
                print(f"{indent}{seed:4d} {result['none']}", flush=True)
                break
            results[name].append(result)
            print((f'{name:6s}' if arguments.other else '') + line(results[name][-1]), flush=True)
    for name, found in results.items():
        print_summary(name if arguments.other else '', found)
    if arguments.other:
        print_comparison(results['here'], results['there'])


if __name__ == '__main__':
    main()
