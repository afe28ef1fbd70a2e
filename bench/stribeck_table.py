# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether Stribeck friction and warm-up are named at many speeds and motions.

    python3 bench/stribeck_table.py [--seed N] [--drives N] [--jobs N]

--drives are of each effect; even seeds are for tuning, odd ones for reporting.

Each drive has one of the two beside Coulomb and viscous friction and inertia, and moves in one of
five ways at a top speed of 0.3 to 3 rad/s. No thermometer is recorded. The last two columns are the
held-out errors over the noise: of the refined model, and of Coulomb and viscous friction alone.
"""

from bench_tools import processes, table_parser
import numpy as np

from friction_comp.drive import Drive
from friction_comp.refinement import refine
from friction_comp.samples import Samples

RATE, DURATION, NOISE = 200.0, 120.0, 0.003
MOTIONS = ('strokes', 'chirp', 'sum of sines', 'triangle', 'staircase')
NAMES = {'stribeck': {'stribeck'}, 'warm-up': {'warm_up'}}


def velocity_of(motion: str, top: float, time: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the velocity of a motion, shape (N,), rad/s."""
    span = rng.uniform(0.4, 1.0)
    if motion == 'strokes':
        velocity = np.empty(0)
        side = 1.0
        while len(velocity) < len(time):
            speed = top * rng.uniform(0.1, 1.0)
            share = np.arange(1, max(int(RATE * 1.875 * span / speed), 20)) * speed / (
                RATE * 1.875 * span)
            velocity = np.append(velocity, side * 16.0 * speed * (share * (1.0 - share)) ** 2)
            side = -side
        return velocity[:len(time)]
    if motion == 'chirp':
        # Of one frequency, inertia and a spring cannot be told apart.
        rate = top / span * np.geomspace(0.05, 1.0, len(time))
        return rate * span * np.cos(np.cumsum(rate) / RATE)
    if motion == 'sum of sines':
        base = top / span / 3.0
        parts = [np.cos(k * base * time + rng.uniform(0, 2 * np.pi)) for k in (1.0, 1.7, 2.9)]
        return top * sum(parts) / 3.0
    # Stairs last a span each, or 1.5 s.
    stairs = ([(share * top, max(int(RATE * span / (share * top)), 20))
               for share in (0.03, 0.1, 0.3, 1.0)] if motion == 'triangle' else
              [(share * top, int(RATE * 1.5)) for share in np.geomspace(0.02, 1.0, 10)])
    period = np.concatenate([
        np.full(count, side * speed) for speed, count in stairs for side in (1.0, -1.0)])
    velocity = np.tile(period, 1 + len(time) // len(period))[:len(time)]
    # A drive takes a tenth of a second to another speed.
    ramp = np.hanning(int(0.1 * RATE) + 2)
    return np.convolve(velocity, ramp / ramp.sum(), mode='same')


def recording(effect: str, number: int, seed: int) -> Samples:
    """Return the recording of one drive: its motion is that of a number, the rest is random."""
    rng = np.random.default_rng([seed, number, len(effect)])
    time = np.arange(int(DURATION * RATE)) / RATE
    top = float(np.geomspace(0.3, 3.0, 20)[number])
    velocity = velocity_of(MOTIONS[number % len(MOTIONS)], top, time, rng)
    position = np.cumsum(velocity) / RATE
    friction = rng.uniform(0.05, 0.2)
    current = friction * np.tanh(velocity / 0.004) + rng.uniform(0.02, 0.1) * velocity
    if effect == 'stribeck':
        speed = rng.uniform(0.05, 0.25) * top
        current += rng.uniform(0.3, 1.0) * friction * np.tanh(velocity / 0.004) * np.exp(
            -(np.abs(velocity) / speed) ** 2)
    else:
        current *= 1.0 + rng.uniform(0.2, 1.0) * np.exp(-time / rng.uniform(10.0, 60.0))
    current += rng.uniform(0.005, 0.03) * np.gradient(velocity, time)
    step = 2.0 * np.pi / 400_000
    return Samples(time=time, position=np.round(position / step) * step,
                   current=current + NOISE * rng.standard_normal(len(time)))


def judge(task: tuple[str, int, int]) -> dict[str, object]:
    """Refine one drive."""
    effect, number, seed = task
    report = refine([recording(effect, number, seed)], drive=Drive(0.1, 100.0)).report
    found = [entry.name for entry in report.effects]
    return {'effect': effect, 'motion': MOTIONS[number % len(MOTIONS)], 'number': number,
            'found': found, 'named': bool(NAMES[effect] & set(found)),
            'only': set(found) <= NAMES[effect] | {'inertia'}, 'verdict': report.verdict,
            'error': report.after.held_out_rmse / NOISE,
            'before': report.before.held_out_rmse / NOISE}


def main() -> None:
    """Print a row for each effect, and a line for each drive on which it is not named alone."""
    parser = table_parser(__doc__, seed=2, drives=20, jobs=2)
    options = parser.parse_args()
    tasks = [(effect, number, options.seed) for effect in NAMES for number in range(options.drives)]
    with processes(options.jobs) as pool:
        results = list(pool.map(judge, tasks))
    print('| hidden | drives | named | nothing else | error over noise | Coulomb + viscous |')
    print('|---|---|---|---|---|---|')
    for effect in NAMES:
        own = [one for one in results if one['effect'] == effect]
        print(f"| {effect} | {len(own)} | {sum(one['named'] for one in own)} | "
              f"{sum(one['named'] and one['only'] for one in own)} | "
              f"{np.median([one['error'] for one in own]):.2f} | "
              f"{np.median([one['before'] for one in own]):.2f} |")
    for one in results:
        if not (one['named'] and one['only']):
            print(f"- {one['effect']} {one['number']}, {one['motion']}: "
                  f"{', '.join(one['found']) or 'nothing'}; {one['error']:.2f} times the noise, "
                  f"before {one['before']:.2f}; {one['verdict']}")


if __name__ == '__main__':
    main()
