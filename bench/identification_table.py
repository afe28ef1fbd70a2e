# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges identification on gears that share no code with the package, each with a difficulty.

    python3 bench/identification_table.py [--rates 1000 500 250 100] [--kinds …] [--draws N]
                                           [--seed S] [--processes N]

Gears are those of `world.gear`, drawn afresh --draws times from --seed: even seeds are for tuning,
odd ones are kept for judging. Links may be elastic or have play and friction of their own, gravity
may act, friction may fall as the drive warms up or, as in a worm, with speed; the measured current
may be filtered and the encoder coarse. The yardstick is least squares (offset, Coulomb, viscous,
inertia) on all samples of the same run that are faster than 0.05 rad/s.

An error is that of breakaway in both directions (beyond two standard errors), of Coulomb and
viscous friction as a line through the curve at the speeds driven, of that curve (RMS), and of the
presliding distance where there is one. *Calmly wrong* counts
errors of more than 5 % (presliding: 15 %) and three stated deviations of which no warning speaks.
"""

import math

from bench_tools import processes, table_parser
import numpy as np
from scipy.signal import savgol_filter

from friction_comp import Drive, IdentificationGoal, IdentificationRun
from world import gear as world
from world.person import log_uniform, nobody

KINDS = ('maxwell_slip', 'lugre', 'gravity', 'link', 'warm', 'filtered', 'coarse', 'worm', 'play')
SPEEDS = np.radians([4.0, 8.0, 15.0, 30.0, 55.0, 80.0, 100.0])
STEP = 5e-5             # s
CYCLES, RATIO = 8, 100.0
# Words of a warning on each error.
CURVE = ('drift', 'curve', 'rises over position', 'varies')
SAID = {
    'breakaway': ('breakaway', 'drift', 'one direction', 'negative direction needs',
                  'positive direction needs'),
    'coulomb': CURVE, 'viscous': CURVE, 'curve': CURVE,
    'presliding': ('presliding', 'Presliding')}


class Case:
    """A gear of one kind, its filter, s, and how its friction falls from cold, share and s."""

    def __init__(self, kind, number, seed):
        random = self.random = np.random.default_rng([seed, KINDS.index(kind), number])
        friction = kind if kind in world.FRICTIONS else ('maxwell_slip', 'lugre')[number % 2]
        g = self.gear = world.draw_gears(friction, 1, int(random.integers(1 << 30)))[0]
        self.filter = log_uniform(random, 5e-3, 0.04) if kind == 'filtered' else 0.0
        self.warm = random.uniform(0.05, 0.18) if kind == 'warm' else 0.0
        self.warm_time = log_uniform(random, 60.0, 300.0)
        if kind == 'gravity':
            g['gravity'] = g['coulomb'] * random.uniform(0.1, 0.4)
            g['gravity_phase'] = random.uniform(-math.pi, math.pi)
        elif kind in ('link', 'play'):
            g['link_inertia'] = g['motor_inertia'] * random.uniform(0.25, 1.5)
            reduced = 1.0 / (1.0 / g['motor_inertia'] + 1.0 / g['link_inertia'])
            rate = 2.0 * math.pi * (40.0 if kind == 'play' else log_uniform(random, 8.0, 30.0))
            g['stiffness'], g['damping'] = rate**2 * reduced, 0.3 * rate * reduced
            # Its friction would wind up a soft gear, which no encoder tells from presliding.
            g['link_coulomb'] = 0.0
            if kind == 'play':
                g['backlash'] = log_uniform(random, 1e-3, 5e-3)
                g['link_coulomb'] = g['coulomb'] * random.uniform(0.15, 0.5)
        elif kind == 'coarse':
            g['resolution'] = 2.0 * math.pi / (RATIO * int(log_uniform(random, 40, 150)))
        elif kind == 'worm':
            g['static'] = g['coulomb'] * random.uniform(1.3, 1.7)
            g['stribeck_velocity'] = log_uniform(random, 0.03, 0.15)
        self.drive = Drive(
            float(g['torque_per_current'] / RATIO), RATIO,
            round(2.0 * math.pi / g['resolution'] / RATIO), float(g['current_limit']))

    def at(self, time):
        """Return the gear as it is after a time, s: it warms up."""
        gear = self.gear.copy()
        for name in ('coulomb', 'static'):
            gear[name] *= 1.0 + self.warm * math.exp(-time / self.warm_time)
        return gear


def identify(case, seed, rate):
    """Run one identification; return result or None, words, and samples (N, 3)."""
    gear, random = case.gear, case.random
    run = IdentificationRun(IdentificationGoal(
        SPEEDS.tolist(), motion_range=1.2, breakaway_cycles=CYCLES, longest_cycle=10.0), case.drive)
    plant = world.Plant(np.array([gear]), nobody(1), seed, 1.0 / rate, round(1.0 / (rate * STEP)))
    level = gear['coulomb'] / gear['torque_per_current']
    noise = level * log_uniform(random, 3e-3, 2e-2)
    rows, filtered = [], 0.0
    try:
        while not run.finished and len(rows) < 1500 * rate:
            position, velocity = plant.sample()
            filtered += (plant.states['current'][0] - filtered) / (1.0 + case.filter * rate)
            rows.append((plant.time, position[0], filtered + noise * random.normal()))
            command = run.update(plant.time, position[0], velocity[0], rows[-1][2])
            if case.warm:
                plant.gears[0] = case.at(plant.time)
            plant.advance([command])
        result = run.result()
    except Exception as error:
        return None, str(error), np.array(rows)
    return result, '; '.join(result.warnings), np.array(rows)


def line(speeds, currents):
    """Return Coulomb and viscous friction of currents at speeds, A and A·s/rad."""
    columns = np.column_stack([np.ones_like(speeds), np.sign(speeds), speeds])
    return np.linalg.lstsq(columns, currents, rcond=None)[0][1:]


def yardstick(rows, rate):
    """Return Coulomb, viscous friction and A·s²/rad of inertia by least squares on a whole run."""
    window = max(5, round(0.06 * rate) | 1)
    speed, bend = (savgol_filter(rows[:, 1], window, 2, deriv, 1.0 / rate) for deriv in (1, 2))
    fast = np.abs(speed) > 0.05
    if fast.sum() <= 50:
        return np.full(3, np.nan)
    return np.linalg.lstsq(np.column_stack([
        np.ones(fast.sum()), np.sign(speed[fast]), speed[fast], bend[fast]]),
        rows[fast, 2], rcond=None)[0][1:]


def judge(task):
    """Return what a task (kind, number, seed, rate) has of errors, words and time."""
    kind, number, seed, rate = task
    case = Case(kind, number, seed)
    result, words, rows = identify(case, seed, rate)
    taken, gear = rows[-1, 0], case.at(rows[-1, 0])
    torque_per, both = gear['torque_per_current'], np.concatenate([-SPEEDS[::-1], SPEEDS])
    weight = gear['gravity'] * math.cos(gear['gravity_phase']) / torque_per
    true = np.concatenate([-world.steady_friction(gear, SPEEDS, -1.0)[::-1],
                           world.steady_friction(gear, SPEEDS, 1.0)])
    coulomb, viscous = line(both, true)
    yard = yardstick(rows, rate)
    out = {'task': task, 'words': words, 'taken': taken, 'refused': result is None, 'plain': [
        np.nan, abs(yard[0] / coulomb - 1.0), abs(yard[1] - viscous) / coulomb, np.nan,
        np.nan]}
    if result is None:
        return out
    # Ramps come last, one after the other.
    start = world.breakaway_currents(np.array([case.at(0.7 * taken)]), seed, 64)[0]
    found = result.breakaway
    breakaway = max(
        max(0.0, abs(mean - np.mean(side)) - 2.0 * std / math.sqrt(CYCLES)) / np.mean(side)
        for mean, std, side in (
            (found.positive_mean - weight, found.positive_std, start[::2]),
            (weight - found.negative_mean, found.negative_std, start[1::2])))
    curve = np.array([float(result.sigmoid(v)) for v in both]) - weight
    own = line(both, curve)
    reach, seen = world.presliding(gear)[0], result.presliding
    errors = [breakaway, abs(own[0] / coulomb - 1.0), abs(own[1] - viscous) / coulomb,
              float(np.sqrt(np.mean((curve - true) ** 2)) / np.mean(np.abs(true))),
              seen.distance / reach - 1.0 if seen else math.nan]
    limits = [0.05] * 4 + [max(0.15, 3.0 * seen.std / reach if seen and seen.std else 0.0)]
    out['errors'] = errors
    out['calm'] = [name for name, error, limit in zip(SAID, errors, limits)
                   if abs(error) > limit and not any(word in words for word in SAID[name])]
    out['drift said'] = 'drifted' in words
    return out


def show(rate, own):
    """Print what became of all gears at one rate."""
    done = [one for one in own if not one['refused']]
    false = sum(one['drift said'] for one in done if one['task'][0] != 'warm')
    print(f'{rate:g} Hz: refused {len(own) - len(done)}; calmly wrong '
          f'{sum(len(one["calm"]) for one in done)}; drift said where none is {false}; '
          f'time {max(one["taken"] for one in own):.0f} s')
    for k, name in enumerate(SAID):
        ours, plain = (100.0 * np.array([one[key][k] for one in done])
                       for key in ('errors', 'plain'))
        text = f'    {name:13s}'
        for values in (ours, plain):
            finite = np.abs(values[np.isfinite(values)])
            text += (f'{np.median(finite):7.1f} {finite.max():7.1f}' if len(finite)
                     else 15 * ' ') + '   '
        if name == 'presliding' and len(done):
            text += (f'from {np.nanmin(ours):+.0f} to {np.nanmax(ours):+.0f}, median '
                     f'{np.nanmedian(ours):+.0f}; none {int(np.isnan(ours).sum())}')
        print(text)
    for one in own:
        if one.get('calm'):
            print('    calmly wrong:', one['task'][:2], one['calm'])
        if one['refused']:
            print(f'    {one["task"][:2]}: {one["words"]}')


def main():
    """Print the table."""
    parser = table_parser(__doc__, seed=0, draws=4, processes=1)
    parser.add_argument('--rates', nargs='+', type=float, default=[1000.0, 500.0, 250.0, 100.0])
    parser.add_argument('--kinds', nargs='+', default=list(KINDS), choices=KINDS)
    options = parser.parse_args()
    tasks = [(kind, k, options.seed, rate) for rate in options.rates
             for kind in options.kinds for k in range(options.draws)]
    with processes(options.processes) as pool:
        found = list(pool.map(judge, tasks))
    print(f'seed {options.seed} ({"tuning" if options.seed % 2 == 0 else "kept"}), '
          f'{len(options.kinds) * options.draws} drives a rate; median and worst error, %, beside '
          'those of least squares')
    for rate in options.rates:
        show(rate, [one for one in found if one['task'][3] == rate])


if __name__ == '__main__':
    main()
