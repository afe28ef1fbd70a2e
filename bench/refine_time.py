# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refining a measured recording costs, as multiples of a loop of plain Python beside it.

    python3 bench/refine_time.py [--data ../shared/data] [--sets emps kinova_gen3_joint7:80000 ...]
                                 [--other CHECKOUT]

NAME:80000 is the set's `fit` and `score`, again and again until there are that many samples;
NAME:gaps is the first 18 000 samples of its `fit` with 60 gaps. Recordings that repeat make chance
look like evidence, so that more effects are fitted there than a drive of that length has: the
figure is an upper one. Each line is a process of its own, which imports all it needs; with --other,
the same is done with the package of another checkout, by turns.
"""

import argparse
import os
from pathlib import Path
import resource
import subprocess
import sys
import time

ROOT = Path(__file__).resolve().parents[1]
_STEPS = 20_000_000


def loop():
    """Return the processor time in s of a loop of plain Python."""
    began, total = time.process_time(), 0
    for number in range(_STEPS):
        total += number
    return time.process_time() - began


def recording(data, name):
    """Return the samples that a name says."""
    import numpy as np

    from friction_comp.recordings import read_recording

    name, _, kind = name.partition(':')
    parts = read_recording([data / name / 'fit'])
    if kind.isdigit():
        parts += read_recording([data / name / 'score'])
    if kind == 'gaps':
        whole = parts[0].take(slice(0, 18_000))
        keep = np.ones(len(whole), dtype=bool)
        for start in np.random.default_rng(0).integers(0, len(whole) - 60, 60):
            keep[start:start + 33] = False
        return [whole.take(keep)]
    if not kind:
        return parts
    found, left = [], int(kind)
    while left > 0:
        for part in parts:
            found.append(part.take(slice(0, left)))
            left -= len(found[-1])
    return [part for part in found if len(part)]


def measure(data, name):
    """Print one line: what refining a recording cost this process."""
    from friction_comp.refinement import refine

    samples = recording(data, name)
    before = loop()
    began = time.process_time()
    result = refine(samples)
    cost = time.process_time() - began
    unit = 0.5 * (before + loop())
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'{name:25s}{sum(map(len, samples)):7d} samples  {cost:6.1f} s, {cost / unit:5.1f} loops '
          f'of {unit:.2f} s, {memory:5.0f} MB  '
          + ', '.join(effect['name'] for effect in result.report['effects']), flush=True)


def main():
    """Measure each set in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared' / 'data')
    parser.add_argument('--sets', nargs='+', default=[
        'emps', 'emps:gaps', 'emps:80000', 'kinova_gen3_joint7:80000'])
    parser.add_argument('--other', type=Path, help='checkout to compare with')
    parser.add_argument('--one', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        measure(arguments.data, arguments.one)
        return
    single = dict.fromkeys(('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'), '1')
    for name in arguments.sets:
        for root in filter(None, (ROOT, arguments.other)):
            if arguments.other:
                print(f'{"here" if root == ROOT else "there":6s}', end='', flush=True)
            subprocess.run(
                [sys.executable, __file__, '--data', arguments.data, '--one', name], check=True,
                cwd=root, env={**os.environ, **single, 'PYTHONPATH': str(root.resolve())})


if __name__ == '__main__':
    main()
