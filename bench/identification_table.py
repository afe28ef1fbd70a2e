# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges identification on drives that share no code with the package and its other benches.

    python3 bench/identification_table.py [--rates 1000 500 250 100] [--kinds …] [--draws N]
                                           [--seed S] [--processes N]

Each kind is drawn afresh --draws times from --seed: even seeds are for tuning, odd ones are kept
for judging. Contacts are chains of Maxwell elements or LuGre's; links may be elastic or have play
and friction of their own, gravity may act, friction may fall as the drive warms up or, as in a
worm, with speed; the measured current may be filtered and the encoder coarse. The yardstick is
least squares (offset, Coulomb, viscous, inertia) on all samples of the same run that are faster
than 0.05 rad/s.

An error is that of breakaway in both directions (beyond two standard errors), of Coulomb and
viscous friction as a line through the curve at the speeds driven, of that curve (RMS), of the
acceleration per current, and of the presliding distance where there is one. *Calmly wrong* counts
errors of more than 5 % (presliding: 15 %) and three stated deviations of which no warning speaks.
"""

import math
from typing import NamedTuple

from bench_tools import processes, table_parser
from numba import njit
import numpy as np
from scipy.signal import savgol_filter

from friction_comp import Drive, IdentificationGoal, IdentificationRun

DT = 5e-5               # s
KINDS = ('maxwell', 'lugre', 'gravity', 'link', 'warm', 'filtered', 'coarse', 'worm', 'play')
SPEEDS = np.radians([4.0, 8.0, 15.0, 30.0, 55.0, 80.0, 100.0])
CYCLES, ELEMENTS = 8, 8
NAMES = ('breakaway', 'coulomb', 'viscous', 'curve', 'acceleration', 'presliding')
# Words of a warning on each of them.
SAID = {
    'breakaway': ('breakaway', 'drift', 'one direction', 'negative direction needs',
                  'positive direction needs'),
    'coulomb': ('drift', 'curve', 'rises over position', 'varies'),
    'viscous': ('drift', 'curve', 'rises over position', 'varies'),
    'curve': ('drift', 'curve', 'rises over position', 'varies'),
    'acceleration': ('inertia', 'acceleration per current'),
    'presliding': ('presliding', 'Presliding')}


class Gear(NamedTuple):
    """One joint, seen from its output; currents in A, angles in rad."""

    coulomb: float
    viscous: float          # A·s/rad
    stribeck: float         # share of Coulomb friction
    stribeck_speed: float   # rad/s
    asymmetry: float        # share by which one direction has more
    kappa: float            # rad/s² per A, rotor and link together
    lugre: bool
    reach: float            # rad, of the contact: distance of its longest element, or LuGre's
    damping: float          # of the contact, share of critical
    ripple: float           # share of friction that varies over position
    waves: float            # a turn
    gravity: float          # A
    phase: float
    link_share: float       # of the inertia; 0: rigid
    link_rate: float        # rad/s
    warm: float             # share of friction more when cold
    warm_time: float        # s
    link_friction: float    # A
    play: float             # rad
    loop: float             # s, time constant of the current controller
    late: int               # samples by which commands are late
    filter: float           # s, time constant of the measured current


def draw(kind, random):
    """Return a gear and its drive."""
    def log(low, high):
        return float(np.exp(random.uniform(math.log(low), math.log(high))))
    coulomb = log(0.05, 1.0)
    counts = int(log(40, 150) if kind == 'coarse' else log(512, 5000))
    drive = Drive(log(0.03, 0.2), float(round(log(50.0, 160.0))), counts, coulomb * log(5.0, 12.0))
    lugre = kind == 'lugre' or (kind != 'maxwell' and random.random() < 0.5)
    return drive, Gear(
        coulomb=coulomb, viscous=coulomb * log(0.05, 0.8), stribeck=(
            random.uniform(0.3, 0.7) if kind == 'worm' else random.uniform(0.0, 0.25)),
        stribeck_speed=log(0.03, 0.15), asymmetry=random.uniform(-0.15, 0.15),
        kappa=log(5.0, 40.0) / coulomb, lugre=lugre,
        reach=log(2e-4, 1.5e-3) if lugre else log(8e-4, 6e-3), damping=log(0.15, 1.0),
        ripple=random.uniform(0.0, 0.03), waves=log(8.0, 60.0),
        gravity=coulomb * random.uniform(0.1, 0.4) if kind == 'gravity' else 0.0,
        phase=random.uniform(-math.pi, math.pi),
        link_share=random.uniform(0.2, 0.6) if kind in ('link', 'play') else 0.0,
        link_rate=2.0 * math.pi * (40.0 if kind == 'play' else log(8.0, 30.0)),
        link_friction=coulomb * random.uniform(0.15, 0.5) if kind == 'play' else 0.0,
        play=log(1e-3, 5e-3) if kind == 'play' else 0.0,
        warm=random.uniform(0.05, 0.18) if kind == 'warm' else 0.0, warm_time=log(60.0, 300.0),
        loop=log(5e-4, 2e-3), late=int(random.integers(1, 3)),
        filter=log(5e-3, 0.04) if kind == 'filtered' else 0.0)


@njit
def level(gear, speed, sign, place, time):
    """Return friction at a speed without its viscous part, A, a magnitude."""
    own = gear.coulomb * (1.0 + gear.stribeck * math.exp(-(speed / gear.stribeck_speed) ** 2))
    own *= (1.0 + sign * gear.asymmetry) * (1.0 + gear.ripple * math.sin(gear.waves * place))
    return own * (1.0 + gear.warm * math.exp(-time / gear.warm_time))


@njit
def advance(gear, state, command, time, steps):
    """Advance a joint: state holds place, speed, link's place and speed, current, and contact."""
    place, speed, link, link_speed, current = state[:5]
    stiff = gear.coulomb * gear.kappa / gear.reach * (1.0 if gear.lugre else 2.0)
    damper = 2.0 * gear.damping * math.sqrt(stiff) / gear.kappa
    rotor = gear.kappa / (1.0 - gear.link_share)
    for _ in range(steps):
        current += (command - current) * DT / gear.loop
        strained = 0.0
        if gear.lugre:
            limit = 1.0 + gear.stribeck * math.exp(-(speed / gear.stribeck_speed) ** 2)
            state[5] += speed * DT / gear.reach * (1.0 - math.copysign(1.0, speed)
                                                   * state[5] / limit)
            strained = state[5] / limit
        else:
            for k in range(ELEMENTS):
                reach = gear.reach * (k + 1) / ELEMENTS
                state[5 + k] = min(max(state[5 + k] + speed * DT / reach, -1.0), 1.0)
                strained += state[5 + k] / ELEMENTS
        friction = strained * level(gear, speed, math.copysign(1.0, strained), place, time)
        friction += (gear.viscous + damper * math.exp(-(speed / 0.02) ** 2)) * speed
        weight = gear.gravity * math.sin(link + gear.phase)
        if gear.link_share == 0.0:
            speed += gear.kappa * (current - friction - weight) * DT
            place += speed * DT
            link = place
        else:
            gap = place - link
            touch = gap - min(max(gap, -0.5 * gear.play), 0.5 * gear.play)
            spring = gear.link_rate ** 2 * touch
            if touch != 0.0:
                spring += 0.3 * gear.link_rate * (speed - link_speed)
            speed += (rotor * (current - friction)
                      - spring * gear.link_share / (1.0 - gear.link_share)) * DT
            held = min(max(state[5 + ELEMENTS] + link_speed * DT / 2e-4, -1.0), 1.0)
            state[5 + ELEMENTS] = held
            link_speed += (spring - (weight + gear.link_friction * held)
                           * gear.kappa / gear.link_share) * DT
            place += speed * DT
            link += link_speed * DT
        time += DT
    state[:5] = place, speed, link, link_speed, current


def identify(kind, number, seed, rate):
    """Run one identification; return result or None, words, samples, gear and time in s."""
    random = np.random.default_rng([seed, KINDS.index(kind), number])
    drive, gear = draw(kind, random)
    run = IdentificationRun(IdentificationGoal(
        SPEEDS.tolist(), motion_range=1.2, breakaway_cycles=CYCLES, longest_cycle=10.0), drive)
    state, steps, filtered = np.zeros(6 + ELEMENTS), round(1.0 / (rate * DT)), 0.0
    if gear.gravity:    # the joint hangs where it rests
        state[0] = state[2] = -gear.phase + random.uniform(-0.5, 0.5)
        gear = gear._replace(gravity=min(gear.gravity, 0.8 * gear.coulomb))
    count = drive.position_resolution
    noise = gear.coulomb * math.exp(random.uniform(math.log(3e-3), math.log(2e-2)))
    pending, rows, seen, velocity = [0.0] * gear.late, [], math.floor(state[0] / count) * count, 0.0
    share = 1.0 / (1.0 + 0.006 * rate)
    while not run.finished and len(rows) < 1500 * rate:
        time = len(rows) / rate
        place = math.floor(state[0] / count) * count
        velocity += share * ((place - seen) * rate - velocity)
        seen = place
        filtered += (state[4] - filtered) / (1.0 + gear.filter * rate)
        rows.append((time, place, filtered + noise * random.normal()))
        try:
            pending.append(run.update(time, place, velocity, rows[-1][2]))
        except Exception as error:
            return None, str(error), np.array(rows), gear, time
        advance(gear, state, pending.pop(0), time, steps)
    try:
        result = run.result()
    except Exception as error:
        return None, str(error), np.array(rows), gear, time
    return result, '; '.join(result.warnings), np.array(rows), gear, time


def line(speeds, currents):
    """Return Coulomb and viscous friction of currents at speeds, A and A·s/rad."""
    columns = np.column_stack([np.ones_like(speeds), np.sign(speeds), speeds])
    return np.linalg.lstsq(columns, currents, rcond=None)[0][1:]


def judge(task):
    """Return what a task (kind, number, seed, rate) has of errors, words and time."""
    rate = task[3]
    result, words, rows, gear, taken = identify(*task)
    both = np.concatenate([-SPEEDS[::-1], SPEEDS])
    weight = gear.gravity * math.sin(rows[0, 1] + gear.phase)
    true = np.array([math.copysign(level(gear, abs(v), math.copysign(1.0, v), math.pi, taken)
                                   + gear.link_friction, v)
                     + gear.viscous * v for v in both])
    coulomb, viscous = line(both, true)
    # The yardstick: least squares on the whole run.
    step, place = 1.0 / rate, rows[:, 1]
    window = max(5, round(0.06 * rate) | 1)
    speed, bend = (savgol_filter(place, window, 2, deriv, step) for deriv in (1, 2))
    fast = np.abs(speed) > 0.05
    yard = np.linalg.lstsq(np.column_stack([
        np.ones(fast.sum()), np.sign(speed[fast]), speed[fast], bend[fast]]),
        rows[fast, 2], rcond=None)[0] if fast.sum() > 50 else np.full(4, np.nan)
    plain = [np.nan, abs(yard[1] / coulomb - 1.0), abs(yard[2] - viscous) / coulomb,
             np.nan, abs(yard[3] * gear.kappa - 1.0), np.nan]
    out = {'task': task, 'plain': plain, 'words': words, 'taken': taken, 'refused': result is None}
    if result is None:
        return out
    found = result.breakaway
    start = [(1.0 + sign * gear.asymmetry) * gear.coulomb * (1.0 + gear.stribeck) * (
        1.0 + gear.warm * math.exp(-0.7 * taken / gear.warm_time)) + gear.link_friction
        for sign in (1, -1)]
    deviations = [s / math.sqrt(CYCLES) for s in (found.positive_std, found.negative_std)]
    off = [abs(found.positive_mean - weight - start[0]), abs(-found.negative_mean + weight
                                                             - start[1])]
    breakaway = max(max(0.0, o - 2.0 * d) / s for o, d, s in zip(off, deviations, start))
    curve = np.array([float(result.sigmoid(v)) for v in both]) - weight
    own = line(both, curve)
    reach = gear.reach * (-math.log(0.05) * (1.0 + gear.stribeck) if gear.lugre else
                          maxwell_reach())
    distance = result.presliding.distance if result.presliding else math.nan
    errors = [breakaway, abs(own[0] / coulomb - 1.0), abs(own[1] - viscous) / coulomb,
              float(np.sqrt(np.mean((curve - true) ** 2)) / np.mean(np.abs(true))),
              abs(result.acceleration_per_current / gear.kappa - 1.0), distance / reach - 1.0]
    stated = [0.0] * 5 + [result.presliding.std / reach if result.presliding
                          and result.presliding.std else 0.0]
    limits = [0.05] * 5 + [0.15]
    out['errors'], out['std'] = errors, stated[5]
    out['calm'] = [name for name, error, std, limit in zip(NAMES, errors, stated, limits)
                   if abs(error) > max(limit, 3.0 * std)
                   and not any(word in words for word in SAID[name])]
    out['drift said'] = 'drifted' in words
    return out


def maxwell_reach():
    """Return the distance at which a chain has 95 % of its friction, a share of its reach."""
    x = np.linspace(0.0, 1.0, 10_001)
    ends = np.arange(1, ELEMENTS + 1) / ELEMENTS
    return float(np.interp(0.95, np.minimum(x[:, None] / ends, 1.0).mean(axis=1), x))


def main():
    """Print the table."""
    parser = table_parser(__doc__, seed=0, draws=4, processes=1)
    parser.add_argument('--rates', nargs='+', type=float, default=[1000.0, 500.0, 250.0, 100.0])
    parser.add_argument('--kinds', nargs='+', default=list(KINDS), choices=KINDS)
    parser.add_argument('--words', action='store_true', help='print what each result says')
    options = parser.parse_args()
    tasks = [(kind, k, options.seed, rate) for rate in options.rates
             for kind in options.kinds for k in range(options.draws)]
    with processes(options.processes) as pool:
        found = list(pool.map(judge, tasks))
    print(f'seed {options.seed} ({"tuning" if options.seed % 2 == 0 else "kept"}), '
          f'{len(options.kinds) * options.draws} drives a rate; median and worst error, %')
    for rate in options.rates:
        own = [one for one in found if one['task'][3] == rate]
        done = [one for one in own if not one['refused']]
        calm = [(one['task'][:2], one['calm']) for one in done if one['calm']]
        false = sum(one['drift said'] for one in done if one['task'][0] != 'warm')
        print(f'{rate:g} Hz: refused {len(own) - len(done)}; calmly wrong '
              f'{sum(len(names) for _, names in calm)}; drift said where none is {false}; '
              f'time {max(one["taken"] for one in own):.0f} s')
        for k, name in enumerate(NAMES):
            ours = 100.0 * np.array([one['errors'][k] for one in done])
            plain = 100.0 * np.array([one['plain'][k] for one in done])
            text = f'    {name:13s}'
            for values in (ours, plain):
                finite = np.abs(values[np.isfinite(values)])
                text += (f'{np.median(finite):7.1f} {finite.max():7.1f}' if len(finite)
                         else 15 * ' ') + '   '
            if name == 'presliding' and len(done):
                text += (f'from {np.nanmin(ours):+.0f} to {np.nanmax(ours):+.0f}, median '
                         f'{np.nanmedian(ours):+.0f}; none {int(np.isnan(ours).sum())}')
            print(text)
        for one in calm:
            print('    calmly wrong:', *one)
        for one in own:
            if one['refused'] or options.words:
                print(f'    {one["task"][:2]}: {one["words"]}')


if __name__ == '__main__':
    main()
