# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What joints do by themselves: let go, untouched, carried and left, knocked on, or held quietly.

Vibration is what remains of the velocity above 8 Hz (4th-order Butterworth, forwards and
backwards), the larger of rotor's and link's (both at the joint), RMS over each part of a movement,
beside the same without compensation. The simulated persons have no tremor.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from law_judge.bank import DEGREE, Joints, SPEEDS, STD
from law_judge.loop import announced, count, make_law, NONE, run
from world.person import draw_persons, drivers, FIRM, LEANING, nobody, PERSON, SOFT

EVERY = 10
# Let go.
START, RELEASE, AFTER = 0.2, 1.3, 8.0
RELEASED = (5, 40, 80)      # deg/s
# Gaining speed: over 50 ms, by more than what the flex of gear and presliding can give back.
SPAN, GAIN, GAIN_SPEED = 5, 1.03, 0.3 * DEGREE
REST_WITHIN, REST_SPEED = 6.0, 0.2 * DEGREE
LIMIT = 1.25 * SPEEDS[-1]
# Friction down to 0.7 of the model: warm, or fresh grease.
LOST = (1.0 / 0.85, 1.0 / 0.8, 1.0 / 0.75, 1.0 / 0.7)
# A start of an untouched joint: beyond what gear and presliding give way (below 0.4 deg on the
# softest gear drawn) and still going, or far away. Dahl and LuGre friction creep under any noise
# (Dupont et al. 2002), some 0.01 deg/s here under a constant current: that alone is no start.
ANNOUNCE, TURN = 0.5, 0.6    # s, and share of the time at which the direction turns round
BEYOND, GOING, FAR = 0.5 * DEGREE, 0.5 * DEGREE, 2.0 * DEGREE
WEIGHT = 0.26   # of friction
# Vibration: its limits, rad/s, and the parts of a movement, s.
BAND, VIBRATES, MORE = 8.0, 0.2 * DEGREE, 1.25
HELD, BEGIN, STOP, END = 0.8, 2.0, 5.5, 8.0
PARTS = {'hold': (HELD, BEGIN), 'start': (BEGIN, 3.0), 'motion': (3.0, STOP),
         'stop': (STOP, 6.5), 'hold again': (6.5, END - 0.3)}
SWAY, SWAY_FREQUENCY = -5.0, 0.3    # deg, to and fro instead of slow motion: nothing is announced
KNOCK, KNOCK_AT, LOOK = 0.05, 2.0, (2.0, 3.0)
FEW = (2.0, 12.0)       # counts of presliding: a coarse encoder
RINGS, RING_BAND = 0.1 * DEGREE, 4.0    # RMS of the velocity above so many Hz


def watch(joints, law, persons, seconds, direction, state='link', gears=None, span=SPAN):
    """Return times in s; each joint's position, speed over `span` records, and if it is let go."""
    plant = joints.plant(persons, gears)
    record = run(plant, make_law(law, joints), seconds, direction,
                 {'x': state, 'held': 'let_go'}, EVERY)
    step = EVERY * plant.sample_time
    x = record['x'].astype(float)
    speed = np.abs(x[span:] - x[:-span]) / (span * step)
    return (np.arange(len(speed)) + span + 1) * step, x[span:], speed, record['held'][span:] > 0


def watch_release(joints, law):
    """Bring joints to a speed and let go; return what became of each, arrays of shape (J,)."""
    persons = drivers(joints.gears, joints.sides * joints['speed'] * DEGREE, START, RELEASE)
    time, _, speed, _ = watch(joints, law, persons, RELEASE + AFTER,
                              announced(joints.sides * joints['direction']))
    at_release = speed[np.searchsorted(time, RELEASE - 0.01)]
    after, late = speed[time > RELEASE].max(axis=0), speed[time > RELEASE + REST_WITHIN]
    # A joint that the driver had not set going springs back when let go, whatever the law.
    going = at_release > 0.5 * joints['speed'] * DEGREE
    return {'gained': going & (after > GAIN * at_release + GAIN_SPEED),
            'moving': late.max(axis=0) > REST_SPEED,
            'beyond': after > np.maximum(LIMIT, GAIN * at_release)}


def release(bank, law):
    """Bring each joint to a speed and let go, or push it by 2 deg and let go."""
    joints = Joints(bank, speed=RELEASED, direction=[0, 1], factor=[1.0, 1.05, 1.1, LOST[-1]])
    found, factor = watch_release(joints, law), joints['factor']
    rows = [
        count('let go, model ≤ 1.10: gains speed', joints, found['gained'], which=factor <= 1.10),
        count('let go, model ≤ 1.05: not at rest in 6 s', joints, found['moving'], 0.01,
              which=factor <= 1.05),
        count('let go, model of 1.10: not at rest in 6 s', joints, found['moving'], 0.01,
              which=factor == 1.1),
        count('let go, model ≤ 1.43: beyond 1.25 of the identified speeds', joints,
              found['beyond']),
        count('let go, friction 0.70 of the model: still moves after 6 s', joints,
              found['moving'], None, which=factor == LOST[-1])]
    joints = Joints(bank, factor=[1.0, 1.05, 1.1], copy=[0, 1])
    persons, side = np.zeros(len(joints), dtype=PERSON), joints.sides
    persons['start'], persons['release'] = RELEASE, np.inf
    persons['push'] = 3.0 * side * joints.torque
    persons['push_rate'] = np.random.default_rng([bank.seed, 17]).uniform(
        0.3, 2.0, len(joints)) * joints.torque
    persons['push_travel'] = 2.0 * DEGREE
    time, _, speed, gone = watch(joints, law, persons, RELEASE + 4.0 + AFTER,
                                 announced(side, 0.3))
    # Windows of 50 ms about the release, each at its last record.
    at = np.argmax(gone, axis=0)
    around = np.minimum(at + np.arange(-1, 4)[:, None], len(speed) - 1)
    at_release = speed[around, np.arange(len(joints))].max(axis=0)
    after = np.where(np.arange(len(speed))[:, None] > at + SPAN - 1, speed, 0.0).max(axis=0)
    late = np.where(gone & (time[:, None] > time[at] + REST_WITHIN), speed, 0.0).max(axis=0)
    return [*rows,
            count('pushed by 2 deg, model ≤ 1.10: gains speed', joints,
                  gone.any(axis=0) & (after > GAIN * at_release + GAIN_SPEED), 0.02),
            count('pushed by 2 deg, model ≤ 1.05: not at rest in 6 s', joints, late > REST_SPEED,
                  0.02, which=joints['factor'] <= 1.05)]


def _starts(joints, law, side, seconds, persons=None, gears=None):
    """Return which joints start, announced one way and then, if nobody ever comes, the other."""
    turn = TURN * seconds if persons is None else np.inf

    def direction(time):
        return side * (0 if time < ANNOUNCE else 1 if time < turn else -1)
    time, x, speed, _ = watch(joints, law, nobody(len(joints)) if persons is None else persons,
                              seconds, direction, 'motor', gears, 5 * SPAN)
    since = time >= (ANNOUNCE if persons is None else float(persons['release'][0]))
    away = np.abs(x - x[np.argmax(since)])
    return ~(away[since].max(axis=0) <= FAR) | (
        (away > BEYOND) & (speed > GOING) & since[:, None]).any(axis=0)


def untouched(bank, law):
    """Announce both directions to resting joints whose model is up to 1.1 times the truth.

    Or has more friction than the drive has left, or lacks a weight.
    """
    random = np.random.default_rng([bank.seed, 31])
    # A model a copy would be costly to no purpose: five pairs of factors.
    middle = random.uniform(1.0, 1.1, 4).round(3)
    pairs = [(1.1, 1.1), (1.1, 1.1), (middle[0], 1.1), (1.1, middle[1]), (middle[2], middle[3])]
    joints = Joints(bank, copy=list(range(12)))
    pair = np.array(pairs)[joints['copy'] % len(pairs)]
    joints.conditions['factor'], joints.conditions['breakaway_factor'] = pair.T.copy()
    side = np.where(random.uniform(size=len(joints)) < 0.5, 1, -1)
    rows = [count('untouched, model ≤ 1.10: starts', joints, _starts(joints, law, side, 10.0),
                  0.001)]
    joints = Joints(bank, factor=LOST, copy=[0, 1])
    side = joints.sides.astype(int)
    # Carried by some degrees with the help of the law, and left at rest.
    carried = drivers(joints.gears, side * 10.0 * DEGREE, 1.0, 4.0)
    carried['cruise_time'] = 0.6
    rows += [count('untouched, friction 0.70 to 0.85 of the model: starts', joints,
                   _starts(joints, law, side, 8.0)),
             count('carried and left at rest, 0.70 to 0.85: starts', joints,
                   _starts(joints, law, side, 12.0, carried))]
    joints = Joints(bank, copy=[0, 1])
    side, gears = joints.sides.astype(int), joints.gears.copy()
    gears['gravity'] = WEIGHT * joints.torque
    gears['gravity_phase'] = np.where(side > 0, np.pi, 0.0)
    return [*rows, count('unknown weight of 0.26 of friction, d downward: falls', joints,
                         _starts(joints, law, side, 8.0, gears=gears))]


def quiet(bank, law):
    """Let persons hold, start and move slowly."""
    # Announced ahead, with the push, not at all; who sways is told nothing, whenever.
    joints = Joints(bank, grip=[SOFT, FIRM, LEANING], speed=[3.0, 10.0, SWAY],
                    announce=[1.0, BEGIN, np.inf])
    found, bare = (_vibration(joints, name) for name in (law, NONE))
    rows = []
    for name, parts in (('hold and slow motion', ('hold', 'motion', 'hold again')),
                        ('second of start or stop', ('start', 'stop'))):
        loud, than = (np.max([one[p] for p in parts], axis=0) for one in (found, bare))
        rows.append(count(f'vibrates, {name}', joints, loud > np.maximum(VIBRATES, MORE * than),
                          0.02, worst=float(loud.max() / DEGREE)))
    return rows


def _vibration(joints, law):
    """Return RMS vibration in rad/s, shape (J,), of each part of the movement."""
    persons = draw_persons(joints['grip'], joints.torque, joints.bank.seed)
    side, sways = joints.sides, joints['speed'] == SWAY
    persons['start'], persons['speed'] = BEGIN, side * joints['speed'] * DEGREE
    persons['acceleration_time'], persons['cruise_time'] = 0.5, STOP - BEGIN - 1.0
    persons['sway'][sways], persons['sway_frequency'] = 0.5 * SWAY * DEGREE, SWAY_FREQUENCY

    def direction(time):
        return side * ((joints['announce'] <= time) & (time < STOP) & ~sways)
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), END, direction,
                 {'v': 'motor_velocity', 'w': 'link_velocity'})
    parts = {name: np.zeros(len(joints)) for name in PARTS}
    for velocity in record.values():
        rest = _above(velocity, BAND)
        for name, (first, last) in PARTS.items():
            part = rest[round(1e3 * first):round(1e3 * last)]
            parts[name] = np.maximum(parts[name], np.sqrt(np.mean(part**2, axis=0)))
    # Who sways does not hold again, nor start or stop.
    for name in ('start', 'stop', 'hold again'):
        parts[name][sways] = 0.0
    return parts


def _above(velocity, band):
    sos = butter(4, band, 'high', fs=1e3, output='sos')
    return sosfiltfilt(sos, velocity.astype(float), axis=0)


def knock(bank, law):
    """Knock on joints at rest, with and without a preload: who still rings after two seconds?

    Also with encoders by which presliding is few counts; and announce to and fro to joints at rest,
    untouched or held.
    """
    counts = np.random.default_rng([bank.seed, 73]).uniform(*FEW, len(bank.gears))
    distance = np.array([bank.world.presliding(g)[0] for g in bank.gears])
    known = np.flatnonzero(np.isfinite(distance))
    few = bank.seen_by(np.where(np.isfinite(distance), distance / counts, bank.gears['resolution']))
    few = few.chosen(known, [
        {**few.documents[g], 'presliding': {
            'distance': float(distance[g]), 'std': STD * float(distance[g])}} for g in known])
    joints = Joints(bank, frequency=[2.0, 3.5, 5.0], low=[-1, 0], held=[0, 1])
    persons = draw_persons([SOFT] * len(joints), joints.torque, bank.seed)
    persons['touch'] = np.where(joints['held'] == 1, 0.0, np.inf)

    def direction(time):
        up = np.floor(2.0 * joints['frequency'] * time) % 2 == 0
        return np.where(up, 1, joints['low']) * (time >= 0.5)
    plant = joints.plant(persons)
    record = run(plant, make_law(law, joints), 5.0, direction, {'v': 'motor_velocity'})
    shaken = np.sqrt(np.mean(record['v'][2000:] ** 2, axis=0))
    return [_rings('rings 2 s after a knock', bank, law),
            _rings('rings 2 s after a knock, presliding of 2 to 12 counts', few, law),
            count('announcement flickers at 2 to 5 Hz: shakes', joints, shaken > VIBRATES, 0.02,
                  worst=float(shaken.max() / DEGREE))]


def _rings(name, bank, law):
    joints = Joints(bank, direction=[0, 1], factor=[1.0, 1.1], way=[-1.0, 1.0])
    side = joints.sides * joints['direction']

    def ringing(name):
        plant = joints.plant(nobody(len(joints)))
        record = run(plant, make_law(name, joints), KNOCK_AT + LOOK[1],
                     lambda time: side * (time >= 0.3), {'v': 'motor_velocity'},
                     knock=(KNOCK_AT, KNOCK * joints['way']))
        # A heavy joint may still coast, which is no ringing.
        return _above(record['v'], RING_BAND)[round(1e3 * (KNOCK_AT + LOOK[0])):].std(axis=0)
    found, bare = ringing(law), ringing(NONE)
    at_rest = bare < 0.5 * RINGS
    return count(name, joints, found > RINGS, which=at_rest,
                 worst=float(found[at_rest].max() / DEGREE))
