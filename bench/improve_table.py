# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Seconds of motion until `improve` trusts the right effects, by what motion it is given.

Simulated drives with two hidden effects each, whose joint has stiction, presliding and an encoder.
The same loop runs with planned motion, with a staircase of speeds and with random Fourier series.
Columns: drives whose effects are named rightly at the end (inertia beside them is right), verdicts
of trust among all, median seconds until a right and trusted model (a drive that never has one
counts as the whole budget), and the error on another motion, in parts of the drive's noise.
Even seeds and odd ones are reported apart.

    python bench/improve_table.py [--first 100] [--drives 10] [--seconds 30] [--jobs 1]
"""


from bench_tools import processes, table_parser
import numpy as np

from friction_comp.excitation.improve import improve, prediction_error, Schedule
from friction_comp.excitation.joint_limits import JointLimits
from friction_comp.excitation.plan import fourier_series, plan_joint, staircase
from simulated_recordings.drives import random_drive, STEP
from simulated_recordings.motion import mixed_motion
from simulated_recordings.played import PlayedDrive

BUDGET = 180.0
PAIRS = {
    'gravity, stribeck': {'gravity', 'stribeck'},
    'hysteresis, rest': {'hysteresis', 'rest_time'},
    'bump, gravity': {'bump', 'gravity'},
    'sub_linear, gravity': {'viscous_shape', 'gravity'},
    'direction, super_linear': {'direction_asymmetry', 'viscous_shape'},
    'friction_ripple, gravity': {'friction_ripple', 'gravity'}}


class Given:
    """A motion that is no plan, in a plan's place."""

    def __init__(self, samples, seconds):
        self._samples, self.seconds = samples, seconds

    def samples(self, rate):
        return self._samples


# The ways to choose a motion, by name.
MOTIONS = {
    'plan': plan_joint,
    'staircase': lambda limits, pairs, seconds, seed, model=None: Given(
        staircase(limits, seconds, 1000.0), seconds),
    'fourier': lambda limits, pairs, seconds, seed, model=None: Given(
        fourier_series(limits, seconds, 1000.0, seed), seconds)}


def judged(pair, seed, motion, seconds):
    """Return seconds, whether trusted, whether right, and the error elsewhere."""
    drive = random_drive(seed, pair.split(', '))
    limits = JointLimits('joint', -1.5, 1.5, 1.2, 6.0)
    result = improve(PlayedDrive(drive, seed), limits, drive.model.drive,
                     schedule=Schedule(seconds, BUDGET, seed), plan=MOTIONS[motion])
    elsewhere = PlayedDrive(drive, seed + 1).follow(mixed_motion(
        60.0, STEP, np.random.default_rng([seed, 7]), 3.0, 1.2, True))
    named = set(result.rounds[-1].effects) - {'inertia'}
    return (result.seconds, result.verdict == 'trust', named == PAIRS[pair],
            prediction_error(result.result.model, elsewhere) / drive.noise_floor)


def main():
    parser = table_parser(__doc__, first=100, drives=10, seconds=30.0, jobs=1)
    arguments = parser.parse_args()
    seeds = range(arguments.first, arguments.first + arguments.drives)
    print('pair, motion, half: right, trusted, of; median s; error elsewhere', flush=True)
    with processes(arguments.jobs) as pool:
        for pair in PAIRS:
            for motion in MOTIONS:
                rows = list(pool.map(judged, [pair] * len(seeds), seeds, [motion] * len(seeds),
                                     [arguments.seconds] * len(seeds)))
                for half in (0, 1):
                    own = [row for row, seed in zip(rows, seeds) if seed % 2 == half]
                    until = [row[0] if row[1] and row[2] else BUDGET for row in own]
                    right, trusted = (sum(row[k] for row in own) for k in (2, 1))
                    print(f'{pair}, {motion}, {("even", "odd")[half]}: {right}, {trusted}, '
                          f'{len(own)}; {np.median(until):.0f} s; '
                          f'{np.median([row[3] for row in own]):.2f}', flush=True)


if __name__ == '__main__':
    main()
