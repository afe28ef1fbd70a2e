# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Judges where directions come from: force sensors, and leaders of followers.

    python3 bench/direction_table.py [--rows attempts rest follow] [--seed S] [--draws N]
                                      [--hours H]

--draws are gears of each kind, --hours are of rest. Even seeds are for tuning on, odd seeds are
kept for judging.

Sensors are those of `harness/cheap_sensors.py`, on joints that are held. Followers are under a soft
MIT-mode controller on slow references, beside a tanh of the measured and of the desired speed.
"""

import math

from bench_tools import table_parser
from cheap_sensors import CheapForce
import numpy as np

from friction_comp import CompensationLaw
from friction_comp.direction.sources import CALIBRATION_TIME, DesiredMotion, ForceDirection
from law_judge.bank import Joints, make_bank
from world import gear as world
from world.person import nobody

STEP = 1e-3     # s
# s of rest before an attempt, of the attempt, and after it.
BEFORE, ATTEMPT, PAUSE = 0.5, 0.6, 1.0
RATES = (50.0, 100.0)
SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2)
# s of a reference: rest, way out or back, and rest between them.
FIRST, RAMP, REST = 1.0, 6.0, 2.0
# Stiffness of the controllers: friction holds a bare joint about 30 mrad away; damping, s.
LAG, DAMPING = 0.03, 0.04
WAYS = ('without', 'ours', '0.9·tanh of the measured speed', '0.9·tanh of the desired speed')
STEEPNESS = 0.02    # rad/s at which the hyperbolic tangent bends
# s between frames of an MIT-mode drive, and steps of 16 and 12 bit of its numbers.
PERIOD, POSITION_STEP, VELOCITY_STEP = 0.002, 25.0 / 2**16, 90.0 / 2**12
STUCK = 5e-3    # rad: height of stairs that count as such


# Force sensors.

def rest_torque(random, joints, seconds):
    """Return torque at rest, as a share of breakaway, shape (N, J): tremor that waxes and wanes.

    Physiological to essential tremor, 5 to 11 Hz, up to 2 % of breakaway, with bursts over 1 to
    10 s.
    """
    time = np.arange(round(seconds / STEP)) * STEP
    size, frequency, slow, phase, other = (
        random.uniform(low, high, joints) for low, high in (
            (0.0, 0.02), (5.0, 11.0), (0.1, 1.0), (-math.pi, math.pi), (-math.pi, math.pi)))
    swell = 0.5 * (1.0 + np.sin(2.0 * np.pi * slow * time[:, None] + other))
    return size * swell * np.sin(2.0 * np.pi * frequency * time[:, None] + phase)


class Sensors:
    """Simulated sensors of J joints with the room's announcements for each of them."""

    def __init__(self, breakaway, seed, rate=100.0):
        self.plant = CheapForce(breakaway, seed, rate)
        self.sources = [ForceDirection(self.plant.range) for _ in breakaway]
        self.time = 0.0

    def play(self, torque):
        """Advance by N ms; return the directions every 10 ms, shape (N / 10, J)."""
        length, joints = torque.shape
        values = self.plant.sample(torque)
        every, due = 1.0 / self.plant.rate, 0
        directions = np.zeros((length // 10, joints), dtype=int)
        for k in range(length // 10):
            self.time += 10.0 * STEP
            upto = min(len(values), round((k + 1) * 10.0 * STEP / every))
            for j, source in enumerate(self.sources):
                source.motion.add(self.time, 0.0)
                fresh = values[due:upto, j]
                if len(fresh) and np.isfinite(fresh).all():
                    source.add(self.time, fresh)
                directions[k, j] = source.at(self.time).direction
            due = upto
        return directions

    def calibrate(self, torque):
        """Calibrate at rest with torques at rest, shape (N, J), N·m."""
        begin = round(0.5 / STEP)
        self.play(torque[:begin])
        for source in self.sources:
            source.begin_calibration()
        self.play(torque[begin:begin + round((CALIBRATION_TIME + 0.1) / STEP)])
        for source in self.sources:
            assert not source.failure, source.failure


def attempts(joints, each, seed):
    """Return delays, misses and wrong directions of attempts against a joint that is held.

    The torque grows at 0.5 to 5 times breakaway per second, to 0.3 to 1 times breakaway.
    """
    delays, wrong, missed = [], 0, 0
    random, breakaway, sensors = held_joints(joints, seed)
    time = np.arange(round((BEFORE + ATTEMPT + PAUSE) / STEP)) * STEP - BEFORE
    for _ in range(each):
        side = random.choice([-1.0, 1.0], joints)
        speed = np.exp(random.uniform(math.log(0.5), math.log(5.0), joints))
        most = random.uniform(0.3, 1.0, joints)
        push = np.minimum(most, speed * np.maximum(0.0, time[:, None])) * (time < ATTEMPT)[:, None]
        noise = rest_torque(random, joints, len(time) * STEP)
        found = sensors.play((noise + side * push) * breakaway)
        at = (np.arange(len(found)) + 1) * 10.0 * STEP - BEFORE
        during = found * ((at > 0.0) & (at < ATTEMPT))[:, None]
        first = np.argmax(during != 0, axis=0)
        said = during[first, np.arange(joints)]
        missed += int((said == 0).sum())
        wrong += int((said == -side).sum())
        delays += at[first[said == side]].tolist()
    return np.array(delays), missed, wrong


def held_joints(joints, seed):
    """Return a random generator, breakaway torques, N·m, and calibrated sensors of held joints."""
    random = np.random.default_rng([seed, 401])
    breakaway = np.exp(random.uniform(math.log(0.3), math.log(15.0), joints))
    sensors = Sensors(breakaway, [seed, 402], RATES[seed // 2 % 2])
    sensors.calibrate(rest_torque(random, joints, 4.0) * breakaway)
    return random, breakaway, sensors


def hours_at_rest(hours, joints, seed):
    """Return false onsets within some hours at rest, which some joints share."""
    random, breakaway, sensors = held_joints(joints, seed)
    false, before, chunk = 0, np.zeros((1, joints)), 10.0
    for _ in range(round(3600.0 * hours / joints / chunk)):
        found = sensors.play(rest_torque(random, joints, chunk) * breakaway)
        steps = np.concatenate([before, found])
        false += int(((steps[1:] != 0) & (steps[:-1] == 0)).sum())
        before = found[-1:]
    return false


# Followers.

def reference(time, speed):
    """Return desired position and speed: out, a rest, back, a rest."""
    t = time - FIRST
    out, back = (min(max(since, 0.0), RAMP) for since in (t, t - RAMP - REST))
    way = (0.0 < t < RAMP) - (0.0 < t - RAMP - REST < RAMP)
    return speed * (out - back), speed * way


def in_steps(values, step, bits):
    """Return values as a frame holds them: whole steps within so many bits."""
    return np.clip(np.rint(values / step), -2**(bits - 1), 2**(bits - 1) - 1) * step


def follow(bank, way):
    """Return what became of each gear at each speed, arrays of shape (G, S) in rad by name.

    ``rms`` is the error while the reference moves; ``stairs`` reach from the lowest to the highest
    error of the second half of a ramp.
    """
    joints = Joints(bank, speed=SPEEDS, factor=[1.0])
    plant = joints.plant(nobody(len(joints)))
    torque_per, speed = joints.gears['torque_per_current'], joints['speed']
    kp, largest = joints.torque / LAG, 5.0 * joints.torque
    law = CompensationLaw(joints.models, 'desired', sample_time=PERIOD)
    leaders = [DesiredMotion() for _ in speed]
    coulomb = np.array([model.sigmoid.upper for model in joints.models]) * torque_per
    every = round(PERIOD / plant.sample_time)
    samples = round((FIRST + 2.0 * (RAMP + REST)) / plant.sample_time)
    errors = []
    for k in range(samples):
        position, velocity = plant.sample()
        time = k * plant.sample_time
        wanted, pace = reference(time, speed)
        if k % every == 0:
            seen = in_steps(position, POSITION_STEP, 16)
            seen_velocity = in_steps(velocity, VELOCITY_STEP, 12)
            extra = np.zeros(len(speed))
            if way == 'ours':
                if k % (5 * every) == 0:
                    said = []
                    for leader, q, where in zip(leaders, wanted.tolist(), seen.tolist()):
                        leader.motion.add(time, where)
                        leader.take(time, q)
                        said.append(leader.at(time, where).direction)
                extra = law.update(time, seen, None, np.array(said)) * torque_per
            elif way != 'without':
                extra = 0.9 * coulomb * np.tanh(
                    (seen_velocity if way == WAYS[2] else pace) / STEEPNESS)
            torque = (kp * (in_steps(wanted, POSITION_STEP, 16) - seen)
                      + DAMPING * kp * (in_steps(pace, VELOCITY_STEP, 12) - seen_velocity)
                      + in_steps(extra, 2.0 * largest / 2**12, 12))
            current = np.clip(torque, -largest, largest) / torque_per
        plant.advance(current)
        if k % (5 * every) == 0:
            errors.append(wanted - plant.states['link'])
    errors, time = np.array(errors), np.arange(len(errors)) * 5 * every * plant.sample_time - FIRST
    ramps = [(time >= begin) & (time < begin + RAMP) for begin in (0.0, RAMP + REST)]
    shape = len(bank.gears), len(SPEEDS)
    return {
        'rms': np.sqrt(np.mean(errors[ramps[0] | ramps[1]]**2, axis=0)).reshape(shape),
        'stairs': np.max([np.ptp(errors[ramp][ramp.sum() // 2:], axis=0)
                          for ramp in ramps], axis=0).reshape(shape)}


# The table.

def attempts_rows(options):
    # 1,000 attempts: half at each rate of values.
    found = [attempts(20, 25, options.seed + 2 * k) for k in range(2)]
    delays = 1e3 * np.concatenate([one[0] for one in found])
    missed, wrong = (sum(one[k] for one in found) for k in (1, 2))
    total = len(delays) + missed + wrong
    yield ('delay, median and nine of ten',
           f'{np.median(delays):.0f}, {np.percentile(delays, 90):.0f} ms', '60 ms')
    yield 'wrong direction', f'{wrong} of {total}', '1 %'
    yield 'missed', f'{missed} of {total}', ''


def rest_rows(options):
    false = hours_at_rest(options.hours, 12, options.seed)
    yield f'false onsets in {options.hours:g} h at rest', f'{false}', '1 an hour'


def follow_rows(options):
    # Their encoders have the steps of an MIT-mode drive.
    bank = make_bank(world, world.KINDS, options.draws, options.seed,
                     lambda gears: gears.__setitem__('resolution', POSITION_STEP))
    found = {way: follow(bank, way) for way in WAYS}
    bare = found['without']
    stuck = bare['stairs'] > STUCK
    for way, one in found.items():
        share = one['rms'] / bare['rms']
        yield (f'{way}: RMS error, and stairs, mrad, medians',
               f'{1e3 * np.median(one["rms"]):.1f}, {1e3 * np.median(one["stairs"]):.1f}', '')
        yield (f'{way}: of that without: RMS median and worst',
               f'{np.median(share):.2f}, {np.max(share):.2f}', '0.50' if way == 'ours' else '')
        yield (f'{way}: stairs where there are any without, of those',
               f'{np.median((one["stairs"] / bare["stairs"])[stuck]):.2f} '
               f'({stuck.sum()} of {stuck.size})', '0.25' if way == 'ours' else '')


ROWS = {'attempts': attempts_rows, 'rest': rest_rows, 'follow': follow_rows}


def main():
    parser = table_parser(__doc__, seed=0, draws=1, hours=3.0)
    parser.add_argument('--rows', nargs='+', default=list(ROWS), choices=ROWS)
    options = parser.parse_args()
    print(f'seed {options.seed} ({"tuning" if options.seed % 2 == 0 else "kept"} half)')
    for name in options.rows:
        for what, value, floor in ROWS[name](options):
            print(f'{what:74s} {value:>18s}  {floor}', flush=True)


if __name__ == '__main__':
    main()
