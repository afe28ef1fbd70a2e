# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How refinement without a URDF does on simulated arms, by types of motion.

    python3 bench/arm_table.py [--seeds 0 24] [--jobs N]

Errors are multiples of the noise on the torque: on recordings not fitted, of the same amplitude
and of another, and `held-out` what refinement itself says. --seeds is a half-open range. Seeds 0 to
23 were used to tune, those from 24 on are kept: change nothing by what they say. 24 to 59 were
looked at once. Needs Pinocchio.
"""


from bench_tools import processes, table_parser
import numpy as np

TOO_FAR = 3.0  # times the held-out error, of an error on score


def attempt(seed):
    """Return what `arm_world.judging.judge` does; where there is no case, `none` says why."""
    from arm_world.judging import judge

    try:
        return judge(seed)
    except LookupError as error:
        return {'seed': seed, 'none': str(error)}


def line(result):
    """Return one seed as a line."""
    if 'none' in result:
        return f"{result['seed']:4d} {result['none']}"
    text = (f"{result['seed']:4d} {result['kind']:15s}{result['joint']}/{result['joints']} "
            f"{result['noise']:9.2g} ")
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


def print_summary(results):
    """Print medians and 90th percentiles by type of motion and in total; `start` is Eq. 6 alone."""
    print(f'\n{"":16s}seeds failed             start           refined   '
          f'trusted, yet beyond {TOO_FAR:.0f} x held-out\n{"":26s}' + '   median     90 %' * 2)
    for kind in (*dict.fromkeys(r['kind'] for r in results), 'total'):
        chosen = [r for r in results if kind in (r['kind'], 'total')]
        answered = [r for r in chosen if 'failed' not in r]
        beyond, trusted = trusted_too_far(answered)
        print(f"{kind:16s}{len(chosen):5d} {len(chosen) - len(answered):6d} "
              f"{quantiles([r['start'] for r in answered])} "
              f"{quantiles([r['refined'] for r in answered])}   {beyond} of {trusted}")


def main():
    """Judge seeds and sum them up."""
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--seeds', type=int, nargs=2, default=(0, 24), metavar=('FROM', 'TO'),
                        help='the first, and the one after the last')
    arguments = parser.parse_args()
    print('seed motion      joint/of noise N·m    start  refined held-out   '
          'time    verdict        effects')
    results = []
    with processes(arguments.jobs) as pool:
        for result in pool.map(attempt, range(*arguments.seeds)):
            results.append(result)
            print(line(result), flush=True)
    print_summary([result for result in results if 'none' not in result])


if __name__ == '__main__':
    main()
