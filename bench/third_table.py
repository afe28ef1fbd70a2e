# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judge law and identification on a third kind of gear, with the models that identification finds.

    python3 bench/third_table.py [--half tuning kept] [--gears 12] [--models true identified]
                                 [--laws continuous paper] [--every 4] [--rests 3]
                                 [--floors identification release untouched person samples]

`third_gear` shares no friction model with the package's simulation nor with `law_table.py`'s gears,
and no constant of the law was chosen on it. Even seeds are for tuning on, odd ones are kept. Every
gear is identified by the package's own procedure, then the law is judged with the true model and
with the identified one. `--every 4` hands the law every fourth sample only, 250 a second. About
a quarter of an hour of processor time for both halves.
"""

import argparse
from dataclasses import replace
import math
import os
from pathlib import Path
import sys

for variable in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'NUMBA_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'bench')]

from numba import njit  # noqa: E402
import numpy as np  # noqa: E402
from scipy.signal import butter, sosfiltfilt  # noqa: E402
from third_gear.joints import (  # noqa: E402
    DEGREE,
    Gear,
    log_of,
    PERSONS,
    SPEEDS,
    with_person,
    wrong_by,
)
from third_gear.plant import advance, DRAWS, FAULTS, JOINT, KINDS, sense, STATE  # noqa: E402

from friction_comp import IdentificationGoal, IdentificationRun  # noqa: E402
from friction_comp.errors import InputError  # noqa: E402

FLOORS = ('identification', 'release', 'untouched', 'person', 'samples')
CYCLES = 8
# What shakes faster than this, Hz, is vibration.
VIBRATION = butter(2, 8.0, 'highpass', fs=1000.0, output='sos')
QUIET = 0.2         # deg/s RMS
STARTS, LASTS, RISES = (2.5, 7.0), 2.0, 0.7     # of a movement to and fro, s


def main():
    options = parse()
    for half in options.half:
        gears = [Gear(2 * k + (half == 'kept')) for k in range(options.gears)]
        print(f'{half} half: {options.gears} gears')
        found = []
        if 'identified' in options.models or 'identification' in options.floors:
            found = [identified(gear) for gear in gears]
        if 'identification' in options.floors:
            print_identification(gears, found, options.detail)
        for models in options.models:
            pairs = [(gear, gear.model) for gear in gears]
            if models == 'identified':
                pairs = [(gear, model) for gear, (model, _) in zip(gears, found) if model]
            for floor in options.floors:
                for law in options.laws if floor != 'identification' else ():
                    for line in globals()[floor](pairs, law, options):
                        print(f'{models:10s} {law:10s} {line}', flush=True)


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--half', nargs='+', choices=('tuning', 'kept'), default=['tuning', 'kept'])
    parser.add_argument('--gears', type=int, default=12, help='of each half')
    parser.add_argument('--models', nargs='+', choices=('true', 'identified'),
                        default=['true', 'identified'])
    parser.add_argument('--laws', nargs='+', default=['continuous'])
    parser.add_argument('--floors', nargs='+', choices=FLOORS, default=list(FLOORS))
    parser.add_argument('--rests', type=int, default=3,
                        help='untouched, of each gear and direction')
    parser.add_argument('--every', type=int, default=1, help='the law gets every so many samples')
    parser.add_argument('--detail', action='store_true', help='a line for each identification')
    return parser.parse_args()


@njit(cache=True)
def _step(joint, state, command):
    advance(joint[0], state[0], command, 0.0, 0.0, False)


def identified(gear):
    """Return the model that identification finds, None where it gives up, and its words."""
    level = gear.joint['level'] / gear.joint['torque']
    run = IdentificationRun(
        IdentificationGoal(SPEEDS, 1.2, 0.5 * level, 10.0, CYCLES), gear.drive)
    g = gear.joint.copy()
    g['gravity_cos'] = g['gravity_sin'] = 0.0
    joint, state, k = np.array([g], JOINT), np.zeros(1, STATE), 0
    noise = np.random.default_rng(gear.seed).normal(0.0, g['noise'], 10_000)
    try:
        while not run.finished:
            position, velocity = sense(joint[0], state[0])
            measured = float(state['current'][0]) + noise[k % len(noise)]
            _step(joint, state, run.update(1e-3 * k, position, velocity, measured))
            k += 1
        model = run.result().model(gear.drive)
    except InputError as error:
        return None, str(error)
    return replace(model, effects=gear.gravity()), '; '.join(run.warnings)


def print_identification(gears, found, detail):
    """Print by how much identified models differ from the true ones."""
    rows = []
    for gear, (model, words) in zip(gears, found):
        if model is None:
            print(f'identification refused on {KINDS[gear.kind]}, seed {gear.seed}: {words}')
            continue
        true = gear.model
        sides = [(getattr(model.breakaway, f'{side}_mean'), getattr(true.breakaway, f'{side}_mean'))
                 for side in ('positive', 'negative')]
        scatter = math.hypot(true.breakaway.positive_std, model.breakaway.positive_std)
        known = 2.0 * scatter / math.sqrt(CYCLES) / true.breakaway.positive_mean
        breakaway = max(0.0, max(abs(f / t - 1.0) for f, t in sides) - known)
        table = {name: np.array(true.lookup_table[name]) for name in ('speeds', 'currents')}
        kinetic = math.sqrt(np.mean(
            (np.asarray(model.sigmoid(table['speeds'])) / table['currents'] - 1.0) ** 2))
        way = math.nan
        if model.presliding is not None:
            off = abs(model.presliding.distance - true.presliding.distance)
            way = max(0.0, off - gear.joint['count']) / true.presliding.distance
        rows.append((breakaway, kinetic, way))
        if detail:
            print(f'  seed {gear.seed} {KINDS[gear.kind]}: breakaway {breakaway:.3f} beyond '
                  f'{known:.3f}, kinetic {kinetic:.3f}, presliding {way:.2f} {words}')
    for name, column, floor in zip(
            ('breakaway beyond two standard errors', 'kinetic', 'presliding beyond a count'),
            np.array(rows).T, (0.03, 0.03, 0.3)):
        known = column[np.isfinite(column)]
        print(f'identification: {name}: {(known > floor).sum()} of {len(known)} above {floor:.0%}, '
              f'worst {known.max():.1%}, {len(column) - len(known)} not known')


def at_rest(gear, seed, speed=0.0):
    """Return the state of a joint at a random place, with a speed in rad/s."""
    rng = np.random.default_rng([seed, 11])
    state = np.zeros(1, STATE)
    state['rotor'] = state['link'] = state['arm'] = rng.uniform(-0.5, 0.5)
    state['rotor_speed'] = state['link_speed'] = speed
    state['rests'] = rng.integers(DRAWS)
    return state


def release(pairs, law, options):
    """Yield how many joints that are let go gain speed, or do not come to rest."""
    for factor in (1.0, 1.05, 1.1, 1.5):
        gains = moving = beyond = cases = 0
        for gear, model in pairs:
            for speed in (5.0, 20.0, 40.0, 80.0):
                for direction in (0.0, 1.0):
                    log = log_of(
                        gear.joint, wrong_by(model, factor), law, 6500,
                        directions=np.full(6500, direction), every=options.every,
                        state=at_rest(gear, gear.seed, speed * DEGREE))
                    smooth = np.abs(np.convolve(
                        log['rotor_speed'], np.full(50, 0.02), 'valid')) / DEGREE
                    gains += smooth[200:].max() > 1.02 * speed + 0.3
                    moving += smooth[-100:].max() > 0.5
                    beyond += np.abs(log['rotor_speed']).max() > 125.0 * DEGREE
                    cases += 1
        yield (f'let go, model {factor:.2f}: {gains} of {cases} gain speed, {moving} not at rest '
               f'in 6 s, {beyond} beyond the fade')


def untouched(pairs, law, options):
    """Yield how many joints that nobody touches set off within 20 s."""
    for factor in (1.0, 1.1):
        starts, cases = 0, 0
        for gear, model in pairs:
            for rest in range(options.rests):
                for direction in (1.0, -1.0):
                    seed = 1000 * gear.seed + rest
                    directions = np.where(np.arange(21_500) < 1500, 0.0, direction)
                    log = log_of(gear.joint, wrong_by(model, factor), law, 21_500,
                                 directions=directions, every=options.every,
                                 state=at_rest(gear, seed, 0.1 if rest % 2 else -0.1))
                    starts += np.abs(log['rotor'][1500:] - log['rotor'][1499]).max() > DEGREE
                    cases += 1
        yield f'untouched, model {factor:.2f}: {starts} of {cases} set off'


def movement(lead, speed):
    """Return place, speed and announced direction of a movement to and fro, rad, rad/s."""
    time = np.arange(11_000) * 1e-3
    speeds, directions = np.zeros(len(time)), np.zeros(len(time))
    for side, start in zip((1.0, -1.0), STARTS):
        share = (np.clip((time - start) / RISES, 0.0, 1.0)
                 - np.clip((time - start - LASTS) / RISES, 0.0, 1.0))
        speeds += side * speed * DEGREE * np.sin(0.5 * np.pi * share) ** 2
        directions[(time >= start - lead) & (time < start + LASTS + RISES)] = side
    return np.cumsum(speeds) * 1e-3, speeds, directions


def moved(gear, model, law, who, lead, speed, every):
    """Return the first peak of the cuff's torque in N·m and vibration in deg/s.

    `law` may be 'inertia', the joint without friction, or 'blind': 85 % of friction by the plan,
    whatever the joint does, which cannot vibrate by itself.
    """
    places, speeds, directions = movement(lead, speed)
    g, state, feed = with_person(gear, who), at_rest(gear, gear.seed), None
    begin = float(state['rotor'][0])
    if law in ('inertia', 'blind', 'none'):
        if law == 'inertia':
            g['presence'] = g['cogging'] = 0.0
        if law == 'blind':
            feed = np.where(speeds != 0.0, 0.85 * np.asarray(model.sigmoid(speeds)), 0.0)
        g['gravity_cos'] = g['gravity_sin'] = 0.0       # held by the robot's own controller
        law = 'none'
    weight = g['gravity_cos'] * math.cos(begin) + g['gravity_sin'] * math.sin(begin)
    state['rotor'] += weight / g['stiffness']
    log = log_of(g, model, law, len(places), places + begin, speeds, directions, feed,
                 every=every, state=state)
    first = int(1000 * STARTS[0])
    shake = sosfiltfilt(VIBRATION, log['link_speed']) / DEGREE

    def shaken(spans):
        return max(math.sqrt(np.mean(shake[int(1000 * a):int(1000 * b)] ** 2)) for a, b in spans)

    steady = [(0.5, 1.4), (1.7, 2.45), (6.0, 6.9), (10.2, 10.9)]
    steady += [(a + 1.0, a + LASTS) for a in STARTS]
    return (max(0.0, log['cuff'][first:first + 2000].max()), shaken(steady),
            shaken([(a, a + 1.0) for a in STARTS]),
            shaken([(a + LASTS, a + LASTS + 1.0) for a in STARTS]))


def person(pairs, law, options):
    """Yield friction's part of the peak that is taken away, and what vibrates."""
    peaks, loud, worst, cases = {1.0: [], 0.0: []}, np.zeros(3, int), 0.0, 0
    for gear, model in pairs:
        shares = {1.0: [], 0.0: []}
        for who in PERSONS:
            none, inertia = (moved(gear, gear.model, name, who, 1.0, 20.0, 1)[0]
                             for name in ('none', 'inertia'))
            for speed, lead in ((20.0, 1.0), (20.0, 0.0), (6.0, 1.0)):
                forced = max(moved(gear, gear.model, 'blind', who, lead, speed, 1)[1:])
                peak, *shakes = moved(gear, model, law, who, lead, speed, options.every)
                if speed == 20.0:
                    shares[lead].append((none - peak) / (none - inertia))
                # Meshing shakes a light joint with much friction under any help.
                over = np.array(shakes) - max(QUIET, 1.25 * forced)
                loud += over > 0.0
                worst = max(worst, QUIET + over.max())
                cases += 1
        for lead, values in shares.items():
            peaks[lead].append(np.mean(values))
    for lead, name in ((1.0, '1 s ahead'), (0.0, 'with the push')):
        yield (f'peak, announced {name}: {np.median(peaks[lead]):.1%} of friction taken away, '
               f'lowest gear {min(peaks[lead]):.1%}')
    yield (f'vibration: steady {loud[0]}, start {loud[1]}, stop {loud[2]} of {cases}, '
           f'worst {worst:.2f} deg/s')


def samples(pairs, law, options):
    """Yield how many joints travel, or do not get their current back, after bad samples."""
    for fault in range(1, len(FAULTS)):
        fails = 0
        for gear, model in pairs:
            good, bad = (log_of(
                gear.joint, model, law, 4000, directions=np.ones(4000), every=options.every,
                fault=which, state=at_rest(gear, gear.seed))
                for which in (0, fault))
            travel, own = (np.abs(log['rotor'][2000:] - log['rotor'][1999]).max()
                           for log in (bad, good))
            level = 0.15 * model.breakaway.positive_mean
            back = abs(bad['current'][2500:3500].mean() - good['current'][2500:3500].mean()) < level
            # A velocity in another unit contradicts the encoder for good: zero is right then.
            fails += travel - own > DEGREE or not (back or FAULTS[fault] == 'velocity in deg/s')
        yield f'bad samples, {FAULTS[fault]}: {fails} of {len(pairs)}'


if __name__ == '__main__':
    main()
