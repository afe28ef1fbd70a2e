# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A person's arm on the link: mechanical impedance, a slow voluntary share, tremor, and a wish.

The arm follows a reference as a spring and damper without delay (muscle and reflex stiffness:
Dolan, Friedman and Nagurka 1993, Perreault, Kirsch and Crago 2002), and corrects by will what it
saw a reaction time ago. Or it pushes with a torque that grows, as on a joystick, and lets go when
the joint has moved.

Drawn are arm inertia about the joint of 0.03 to 0.3 kg·m² (forearm to whole arm; Winter 2009),
stiffness of a relaxed arm of 2 to 12 N·m/rad and of a tense one of 30 to 200 (elbow and shoulder:
Bennett, Hollerbach, Xu and Hunter 1992; Perreault, Kirsch and Crago 2002), damping ratio 0.2 to
0.7, reaction after 80 to 200 ms. Who leans does so with 0.2 to 0.5 of friction.
"""

import math

from numba import njit
import numpy as np

LONGEST_DELAY = 256
MOST_PLACES = 24
SOFT, FIRM, ABLE, LEANING = range(4)
FIRMER = 30.0


def floats(names):
    """Return the fields of a record that are floats."""
    return [(name, 'f8') for name in names.split()]


# A person holds the link from `touch` to `release`, and follows a reference that starts at
# `start`: a movement, which turns round at its end where `returns` is set, a sway, or strokes of
# minimum jerk (Flash and Hogan 1985) from each of `places` to the next, rad, at `times`, s, a pause
# where both are the same. Or, with
# `push`, they push with a torque that grows from `start` on, as on a joystick, and let go for good
# when the link has moved by `push_travel`. `lean` is a torque that is always there.
PERSON = np.dtype([
    ('delay', 'i8'), ('returns', 'i8'), ('strokes', 'i8'),
    ('times', 'f8', (MOST_PLACES,)), ('places', 'f8', (MOST_PLACES,)),
    *floats('touch release arm stiffness damping voluntary lean tremor tremor_frequency '
            'tremor_phase start speed acceleration_time cruise_time sway sway_frequency '
            'push push_rate push_travel')])

# What a world's state of a joint holds for its person.
PERSON_STATE = [('count', 'i8'), ('let_go', 'i8'), *floats('person origin'),
                ('errors', 'f8', (LONGEST_DELAY,))]


def nobody(joints):
    """Return persons who never touch the joint, shape (joints,)."""
    persons = np.zeros(joints, dtype=PERSON)
    persons['touch'] = np.inf
    persons['acceleration_time'] = 1.0
    return persons


@njit(cache=True)
def stroke(who, t):
    """Return position and velocity of strokes of minimum jerk."""
    k = 0
    while k < who.strokes and who.times[k + 1] <= t:
        k += 1
    if k == who.strokes:
        return who.places[k], 0.0
    lasts, way = who.times[k + 1] - who.times[k], who.places[k + 1] - who.places[k]
    x = (t - who.times[k]) / lasts
    return (who.places[k] + way * x**3 * (10.0 - 15.0 * x + 6.0 * x * x),
            way / lasts * 30.0 * (x * (1.0 - x))**2)


@njit(cache=True)
def movement(who, t):
    """Return position and velocity of acceleration, constant speed, and a stop or a return."""
    ramp, cruise, speed = who.acceleration_time, who.cruise_time, who.speed
    if t < ramp:
        return 0.5 * speed * t * t / ramp, speed * t / ramp
    if t < ramp + cruise:
        return speed * (t - 0.5 * ramp), speed
    left = 2.0 * ramp + cruise - t
    way = speed * (ramp + cruise)
    if who.returns == 1:
        # Through zero with the same acceleration, and back as fast.
        if left > -ramp:
            return way - 0.5 * speed * left * left / ramp, speed * left / ramp
        return way - 0.5 * speed * ramp + speed * (left + ramp), -speed
    if left > 0.0:
        return way - 0.5 * speed * left * left / ramp, speed * left / ramp
    return way, 0.0


@njit(cache=True)
def reference(who, time):
    """Return position and velocity of the movement shown to the person, rad from the origin."""
    t = time - who.start
    if t <= 0.0:
        return 0.0, 0.0
    if who.strokes > 0:
        return stroke(who, t)
    if who.sway != 0.0:
        phase = 2.0 * math.pi * who.sway_frequency * t
        return (who.sway * (1.0 - math.cos(phase)),
                who.sway * 2.0 * math.pi * who.sway_frequency * math.sin(phase))
    return movement(who, t)


@njit(cache=True)
def remember(who, s, time):
    """Note the error that the person sees now, once a sample."""
    if time < who.touch:
        s.origin = s.link
        return
    wanted, _ = reference(who, time)
    s.errors[s.count % LONGEST_DELAY] = s.origin + wanted - s.link


@njit(cache=True)
def person_torque(who, s, time, position, velocity):
    """Return the back-driving torque on the link, N·m."""
    torque = who.lean
    if who.tremor != 0.0:
        torque += who.tremor * math.sin(
            2.0 * math.pi * who.tremor_frequency * time + who.tremor_phase)
    if who.push != 0.0:
        t = time - who.start
        if (position - s.origin) * who.push > who.push_travel * abs(who.push):
            s.let_go = 1
        if s.let_go == 1:
            return 0.0
        if t > 0.0:
            torque += math.copysign(min(abs(who.push), who.push_rate * t), who.push)
        return torque
    wanted, speed = reference(who, time)
    torque += (who.stiffness * (s.origin + wanted - position)
               + who.damping * (speed - velocity))
    if who.voluntary != 0.0:
        torque += who.voluntary * s.errors[(s.count - who.delay) % LONGEST_DELAY]
    return torque


def log_uniform(random, low, high):
    """Return a number whose logarithm is uniform."""
    return math.exp(random.uniform(math.log(low), math.log(high)))


def draw_persons(grips, breakaway_torque, seed):
    """Return random persons who touch from the beginning and have no wish yet.

    `grips`: sequence of int; SOFT, FIRM, LEANING (soft), or ABLE: firm enough to set the bare
    joint going with a lag of 0.1 to 0.5 rad. `breakaway_torque`: ndarray, shape (J,); N·m.
    Returns PERSON of shape (J,).
    """
    random = np.random.default_rng([seed, 555])
    persons = np.zeros(len(grips), dtype=PERSON)
    for who, grip, torque in zip(persons, grips, breakaway_torque):
        who['arm'] = log_uniform(random, 0.03, 0.3)
        between = {FIRM: (30.0, 200.0), ABLE: (torque / 0.5, torque / 0.1)}.get(grip, (2.0, 12.0))
        who['stiffness'] = log_uniform(random, *between)
        who['damping'] = 2.0 * random.uniform(0.2, 0.7) * math.sqrt(who['stiffness'] * who['arm'])
        who['voluntary'] = random.uniform(0.0, 0.4) * who['stiffness']
        who['delay'] = random.integers(80, 201)
        who['tremor_frequency'] = random.uniform(7.0, 11.0)
        who['tremor_phase'] = random.uniform(-math.pi, math.pi)
        who['release'] = who['start'] = np.inf
        who['acceleration_time'] = 1.0
        if grip == LEANING:
            who['lean'] = random.uniform(0.2, 0.5) * torque * random.choice([-1.0, 1.0])
    return persons


def firm_hands(bank, stream):
    """Return persons who lead each gear's joint along its path, and a generator for their paths.

    Thirty times as stiff as who is just able to move the bare joint: a lag of 3 to 17 mrad.
    """
    persons = draw_persons([ABLE] * len(bank.gears), bank.torque, bank.seed)
    persons['stiffness'] *= FIRMER
    persons['damping'] *= math.sqrt(FIRMER)
    return persons, np.random.default_rng([bank.seed, stream])


def drivers(gears, speed, start, release):
    """Return persons who bring each joint to a speed and let go: no arm stays on the joint."""
    persons = np.zeros(len(gears), dtype=PERSON)
    inertia = gears['motor_inertia'] + gears['link_inertia']
    persons['stiffness'] = inertia * 25.0**2
    persons['damping'] = 2.0 * 0.9 * inertia * 25.0
    persons['start'], persons['release'] = start, release
    persons['speed'], persons['acceleration_time'] = speed, 0.4
    persons['cruise_time'] = 100.0
    return persons
