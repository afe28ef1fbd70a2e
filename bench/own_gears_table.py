# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The compensation law on random gears of the package's own simulation, floor by floor.

    python3 bench/own_gears_table.py [--draws N] [--seed N] [--no-presliding] [--kinds KIND ...]

The gears are those of `simulated_recordings.random_gears`, on which the law's constants were
chosen: what it does on gears that share nothing with them, bench/law_table.py tells.
"""

import argparse
from dataclasses import replace
import math
from pathlib import Path
import sys

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from friction_comp.compensation.law import law_parameters
from friction_comp.simulation.joint_parameters import GEARS
from friction_comp.simulation.joint_records import FRICTION
from simulated_recordings.gear_batch import push, run_gears
from simulated_recordings.random_gears import random_gear

DEGREE = math.pi / 180.0
STARTED = 1.0 * DEGREE
PUSHES = ((0.1, 1.0, 20.0), (0.05, 0.5, 20.0), (0.02, 0.3, 30.0))


def law_of(gear, options, factor=1.0, law='continuous'):
    model = gear.wrong_by(factor)
    if options.no_presliding:
        model = replace(model, presliding=None)
    return law_parameters(model, law)


def smooth(values, samples):
    return np.array([np.convolve(row, np.ones(samples) / samples, 'valid') for row in values])


def pushed(gears, options, lag, reference, law='continuous', frictionless=False, repetitions=4):
    """Return the person's torque, averaged over repetitions, and the last run."""
    total = 0.0
    for seed in range(repetitions):
        parameters = [gear.held_by(lag) for gear in gears]
        if frictionless:
            for p in parameters:
                for field in FRICTION:
                    p[field] *= 1e-4
        log, _ = run_gears(parameters, [law_of(g, options, law=law) for g in gears], reference,
                           (options.seed, seed), released=10 ** 9)
        total = total + log['interaction_torque'] / repetitions
    return np.abs(total).max(axis=1), log


def peaks(gears, options):
    """Share of friction's part of the peak that is taken away, and vibration in deg/s RMS."""
    shares, vibrations = [], []
    for lag, acceleration_time, speed in PUSHES:
        reference = push(acceleration_time, speed * DEGREE, 2.0, 3.2 + acceleration_time, 1.0)
        with_law, log = pushed(gears, options, lag, reference)
        without, _ = pushed(gears, options, lag, reference, 'none')
        inertia, _ = pushed(gears, options, lag, reference, 'none', True, 1)
        shares.append((without - with_law) / (without - inertia))
        # Faster than 10 Hz, while the joint rests and while it is moved at constant speed.
        fast = log['link_speed'][:, 49:-50] - smooth(log['link_speed'], 100)
        end = reference.shape[1] - 150
        vibrations.append(np.maximum(
            fast[:, 1200:1900].std(axis=1), fast[:, end - 400:end].std(axis=1)) / DEGREE)
    return np.mean(shares, axis=0), np.max(vibrations, axis=0)


def let_go(gears, options, factor):
    """Return how many of all releases gain speed, still move after 6 s, and go beyond 125 deg/s."""
    gained = moving = beyond = total = 0
    for speed in (5.0, 20.0, 40.0, 80.0):
        for direction in (0.0, 1.0):
            reference = np.zeros((3, 6000))
            reference[2] = direction
            log, _ = run_gears([g.parameters for g in gears],
                               [law_of(g, options, factor) for g in gears], reference,
                               options.seed, speed=speed * DEGREE)
            way = smooth(log['link_speed'], 50) / DEGREE
            gained += int(np.sum(way[:, 100:].max(axis=1) > speed + 0.5))
            moving += int(np.sum(np.ptp(log['rotor'][:, -300:], axis=1) > 0.05 * DEGREE))
            beyond += int(np.sum(way.max(axis=1) > 125.0))
            total += len(gears)
    return gained, moving, beyond, total


def untouched(gears, options, factor, each):
    """Return how many joints that nobody touches go farther than a degree within 20 s."""
    chosen = [gear for gear in gears for _ in range(each)]
    starts, farthest = 0, 0.0
    for direction in (1.0, -1.0):
        reference = np.zeros((3, 20000))
        reference[2, 300:] = direction
        log, _ = run_gears([g.parameters for g in chosen],
                           [law_of(g, options, factor) for g in chosen], reference,
                           (options.seed, 7))
        way = np.abs(log['rotor']).max(axis=1)
        starts, farthest = starts + int(np.sum(way > STARTED)), max(farthest, way.max())
    return starts, 2 * len(chosen), farthest / DEGREE


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--draws', type=int, default=10, help='gears of each kind')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--each', type=int, default=10, help='untouched joints a gear and side')
    parser.add_argument('--no-presliding', action='store_true',
                        help='the model does not know the presliding distance')
    parser.add_argument('--kinds', nargs='+', choices=list(GEARS), default=list(GEARS))
    options = parser.parse_args()
    for kind in options.kinds:
        gears = [random_gear(1000 * options.seed + k, kind) for k in range(options.draws)]
        share, vibration = peaks(gears, options)
        print(f"{kind}: friction's part of the peak down by {np.median(share):.1%} (median; worst "
              f'{share.min():.1%}), vibration above 0.2 deg/s in {np.sum(vibration > 0.2)} of '
              f'{len(gears)} (worst {vibration.max():.2f})', flush=True)
        for factor in (1.0, 1.05, 1.1, 1.25, 1.5):
            gained, moving, beyond, total = let_go(gears, options, factor)
            print(f'  let go, model × {factor}: {gained} of {total} gain speed, {moving} move '
                  f'after 6 s, {beyond} go beyond 125 deg/s', flush=True)
        for factor in (1.0, 1.1):
            starts, total, farthest = untouched(gears, options, factor, options.each)
            print(f'  untouched, model × {factor}: {starts} of {total} start, farthest '
                  f'{farthest:.2f} deg', flush=True)


if __name__ == '__main__':
    main()
