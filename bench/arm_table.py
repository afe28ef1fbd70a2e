# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How refinement without a URDF does on simulated arms, by types of motion.

    python3 bench/arm_table.py [--seeds 0 24] [--jobs N]

Chains of two to six joints, all of which move. One recording is fitted, two are predicted, one of
the same amplitude and one of another. Errors are multiples of the noise on the torque, where the
joint moves; `said` is the error that refinement expects. --seeds is a half-open range; even seeds
are for tuning, odd ones are kept. Needs Pinocchio.
"""

import time

from bench_tools import processes, table_parser
import numpy as np
from scipy.signal import butter, lfilter
from simulated_arms import random_urdf, recorded

from friction_comp.refinement import Origin, refine
from friction_comp.samples import JointStates
from friction_comp.statistics import rms
from world.joint import DT
from world.motion import KINDS

MOTIONS = ('multi_sine', 'joystick', 'production', 'slow_sine')
STANDING = 0.04  # of the speed that 95 % of the samples to fit are below
TOO_FAR = 3.0  # times the error said, of an error on score


def log_uniform(rng, low, high, size=None):
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


class Case:
    """An arm, how it moves, and how that is measured."""

    def __init__(self, seed):
        rng = self.rng = np.random.default_rng([seed, 7717])
        self.kind = MOTIONS[seed // 2 % len(MOTIONS)]
        joints = int(rng.integers(2, 7))
        self.urdf, self.names = random_urdf(rng, joints, ('revolute',), branches=0.0)
        self.joint = int(rng.integers(joints))
        self.centre = rng.uniform(-1.0, 1.0, joints)
        self.half_range = rng.uniform(0.4, 1.5, joints)
        self.top_speed = rng.uniform(0.5, 2.5, joints)
        # Offset N·m, Coulomb N·m, viscous N·m·s/rad, rotor kg·m².
        self.friction = np.column_stack([
            rng.normal(size=joints) * 0.1, log_uniform(rng, 0.3, 5.0, joints),
            log_uniform(rng, 0.1, 3.0, joints), log_uniform(rng, 0.02, 1.0, joints)])
        self.noise = log_uniform(rng, 0.02, 0.2)
        self.every = int(rng.choice([4, 8, 16, 20, 32, 40]))
        self.count = log_uniform(rng, 2e-6, 5e-4)
        self.velocity = rng.choice(['none', 'differentiated', 'noisy'], p=[0.45, 0.35, 0.2])

    def record(self, seconds, amplitude):
        """Return true velocities (N,) and Samples of the joint, torque in the current's place."""
        paths = np.column_stack([
            centre + KINDS[self.kind](self.rng, seconds, amplitude * reach, amplitude * speed)
            for centre, reach, speed in zip(self.centre, self.half_range, self.top_speed)])
        speeds = np.gradient(paths, DT, axis=0)
        q, v, a = (values[::self.every] for values in (
            paths, speeds, np.gradient(speeds, DT, axis=0)))
        step = self.every * DT
        samples = recorded(self.urdf, self.names, (q, v, a), np.ones(len(self.names)),
                           self.friction, self.rng, self.noise, step)[self.joint]
        seen = self.count * np.round(q / self.count)
        measured = None if self.velocity == 'none' else (
            v + 0.01 * self.rng.normal(size=v.shape) if self.velocity == 'noisy' else
            lfilter(*butter(1, 0.2), np.diff(seen, axis=0, prepend=seen[:1]) / step, axis=0))
        return v[:, self.joint], samples.with_(
            position=seen[:, self.joint].copy(), arm=JointStates(tuple(self.names), seen, measured),
            velocity=None if measured is None else measured[:, self.joint].copy())


def judge(seed):
    """Refine the case of a seed; return what it says, and how well it predicts."""
    case = Case(seed)
    seconds = log_uniform(case.rng, 10.0, 60.0)
    speed, fit = case.record(seconds, 1.0)
    score = [case.record(min(seconds, 25.0), amplitude)
             for amplitude in (1.0, case.rng.choice([0.6, 1.25]))]
    lowest = STANDING * np.quantile(np.abs(speed), 0.95)
    result = {'seed': seed, 'kind': case.kind, 'joint': case.joint + 1,
              'joints': len(case.names), 'noise': case.noise}

    def error(model):
        return rms(np.concatenate([
            (samples.current - model.predict(samples))[np.abs(true) > lowest]
            for true, samples in score])) / case.noise
    began = time.process_time()
    try:
        refined = refine([fit], origin=Origin('N·m'))
        report = refined.report
        result.update(
            seconds=time.process_time() - began, start=error(refined.start),
            refined=error(refined.model), said=report.after.elsewhere_motion_rmse / case.noise,
            verdict=report.verdict, effects=[effect.name for effect in report.effects])
    except Exception as failure:  # counted and shown, so that one seed does not end the table
        result['failed'] = f'{type(failure).__name__}: {failure}'
    return result


def line(result):
    """Return one seed as a line."""
    text = (f"{result['seed']:4d} {result['kind']:12s}{result['joint']}/{result['joints']} "
            f"{result['noise']:9.2g} ")
    if 'failed' in result:
        return f"{text}FAILED {result['failed']}"
    return text + (f"{result['start']:8.2f} {result['refined']:8.2f} {result['said']:8.2f} "
                   f"{result['seconds']:6.1f} s  {result['verdict']:14s} "
                   f"{', '.join(result['effects']) or 'none'}")


def print_summary(results):
    """Print medians and 90th percentiles by type of motion and in total; `start` is Eq. 6 alone."""
    print(f'\n{"":12s}seeds failed      start, median 90 %  refined, median 90 %   '
          f'trusted, yet beyond {TOO_FAR:.0f} x said')
    for kind in (*dict.fromkeys(r['kind'] for r in results), 'total'):
        chosen = [r for r in results if kind in (r['kind'], 'total')]
        answered = [r for r in chosen if 'failed' not in r]
        trusted = [r for r in answered if r['verdict'] in ('trust', 'trust in part')]
        beyond = sum(r['refined'] > TOO_FAR * r['said'] for r in trusted)
        start, refined = ('{:12.2f} {:8.2f}'.format(*np.quantile(
            [r[name] for r in answered] or [np.nan], (0.5, 0.9))) for name in ('start', 'refined'))
        print(f'{kind:12s}{len(chosen):5d} {len(chosen) - len(answered):6d} {start} {refined}   '
              f'{beyond} of {len(trusted)}')


def main():
    """Judge seeds and sum them up."""
    parser = table_parser(__doc__, jobs=1)
    parser.add_argument('--seeds', type=int, nargs=2, default=(0, 24), metavar=('FROM', 'TO'),
                        help='the first, and the one after the last')
    arguments = parser.parse_args()
    print('seed motion   joint/of noise N·m    start  refined     said   '
          'time    verdict        effects')
    results = []
    with processes(arguments.jobs) as pool:
        for result in pool.map(judge, range(*arguments.seeds)):
            results.append(result)
            print(line(result), flush=True)
    print_summary(results)


if __name__ == '__main__':
    main()
