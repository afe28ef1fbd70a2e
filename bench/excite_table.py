# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Plans of random joints: how many leave their limits, and how well they tell effects apart.

Seeds are split in two halves, which are reported each. What is compared is the separation that
`friction_comp excite` plans for, of one pair of effects at a time; not the seconds until `refine`
names them.
"""

import argparse
import time

import numpy as np

from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.plan import (
    fourier_series,
    moves_of_shape,
    plan_joint,
    samples_of,
    SHAPE,
    staircase,
)
from friction_comp.excitation.separation import coverage_within, DEFAULT, pairs_of, separations

PAIRS = (('gravity', 'spring'), ('stribeck', 'viscous_shape'), ('gravity', 'inner_load_friction'),
         ('viscous_shape', 'warm_up'), ('hysteresis', 'rest_time'))


def random_limits(rng):
    low, span = rng.uniform(-2.0, 0.0), rng.uniform(0.5, 4.0)
    return JointLimits('j', low, low + span, rng.uniform(0.3, 3.0), rng.uniform(1.0, 20.0))


def leaves(limits, rng):
    """Tell whether a random plan leaves its limits, by finite differences at 1 kHz as well."""
    shape = [rng.uniform(low, high) for low, high in SHAPE]
    start, moves = moves_of_shape(shape, limits, 60.0, rng.uniform(size=(512, 3)))
    motion = samples_of(moves, start, 60.0, 1000.0, 'j')
    q, v, a = motion.position, motion.velocity, motion.acceleration
    return bool(q.min() < limits.lowest or q.max() > limits.highest
                or max(np.abs(v).max(), 1e3 * np.abs(np.diff(q)).max()) > limits.velocity
                or max(np.abs(a).max(), 1e6 * np.abs(np.diff(q, 2)).max()) > limits.acceleration)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--plans', type=int, default=1000)
    parser.add_argument('--seeds', type=int, default=10)
    arguments = parser.parse_args()
    rng = np.random.default_rng(11)
    out = sum(leaves(random_limits(rng), rng) for _ in range(arguments.plans))
    print(f'{out} of {arguments.plans} random plans leave their limits', flush=True)
    begun = time.process_time()
    for seed in range(6):
        plan_joint(random_limits(rng), pairs_of(DEFAULT), 60.0, seed)
    spent = time.process_time() - begun
    print(f'six joints, all default pairs: {spent:.1f} s of one core', flush=True)
    print('pair, half: median separation of plan, staircase, Fourier; plan is best in')
    for pair in PAIRS:
        for half in (0, 1):
            rows = []
            for seed in range(half, arguments.seeds, 2):
                limits = random_limits(np.random.default_rng(1000 + seed))
                coverage = coverage_within(limits, 60.0)
                others = (staircase(limits, 60.0, 50.0), fourier_series(limits, 60.0, 50.0, seed))
                rows.append([plan_joint(limits, [pair], 60.0, seed).separation[pair], *(
                    separations(one, [pair], coverage)[pair] for one in others)])
            values = np.array(rows)
            best = int(np.sum(values[:, 0] >= values[:, 1:].max(axis=1)))
            print(f'{pair[0]} / {pair[1]}, {half}:', *np.round(np.median(values, axis=0), 4),
                  f'; {best} of {len(values)}', flush=True)


if __name__ == '__main__':
    main()
