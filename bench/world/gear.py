# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in four kinds of friction, and what `law_judge` asks of a world.

Rotor:  J_m·a_m = k_t·n·i + cogging - friction - K·(q_m - q_l) - D·(v_m - v_l)
Link:   J_l·a_l = K·(q_m - q_l) + D·(v_m - v_l) - friction - gravity + person
(Spong 1987, with the damping of the gear), by semi-implicit Euler with many steps a sample.

maxwell_slip
    Generalised Maxwell slip: elements in parallel, each sticking on its own spring until its share
    of the level is reached, then relaxing to it at a limited rate (Lampaert, Al-Bender and Swevers
    2003; Al-Bender, Lampaert and Swevers 2005), with a damper across sticking elements.
lugre
    Canudas de Wit, Olsson, Åström and Lischinsky 1995, with the damping of the bristles falling
    with speed, which keeps it passive (Canudas de Wit and Lischinsky 1997; Barabanov and Ortega
    2000).
clamp
    Stiction that holds whatever is below its level (Karnopp 1985), in its time-stepping form: the
    friction impulse of a step stops the motor if it can. No presliding of its own.
dahl
    Dahl 1968.

Families of drives, with where the ranges come from; what has no source is an assumption:

armin_1, armin_2, armin_3
    The note's drives: torque constant, ratio, counts, Eq. 11, breakaway currents and scatter.
    Rotor of the RE 35 (Maxon) and wave generator of the HFUC-14, 0.101 and 1.91 kg·m² at the
    joint. Stiffness between K1 and K3 of the Harmonic Drive catalogue (ratio 100: 4,700 to 7,100;
    ratio 30: 1,900 to 3,400 N·m/rad, seen through the belt of 14.5, which is assumed to be as
    stiff as 2e4 to 1e5 N·m/rad). Link inertia is assumed: a cuff and a sensor.
ak80
    Quasi-direct drive with planetary gear of 9:1 (CubeMars AK80-9: rotor 607 g·cm², about
    0.1 N·m/A, 14 bit, backdriving about 0.5 N·m); stiffness assumed.
ur
    Harmonic drive of 101:1 in a cobot: HFUC-17 to -25 stiffness (1e4 to 3.1e4 N·m/rad), friction
    as measured on such robots, 4 to 15 N·m at the joint.
cycloidal
    Servo with RV gear, ratios 57 to 121, 20 to 49 N·m/arcmin (Nabtesco RV-6E, RV-20E).
planetary
    Small DC motor with two or three planetary stages (Maxon GP 32, GP 42); stiffness assumed.

Presliding distance 0.1 to 1 mrad, in one draw of six up to 2 mrad: harmonic drives show hysteresis
of about one arcmin, 0.3 mrad (Seyfferth, Maghzal and Angeles 1995; Dhaouadi, Ghorbel and Gandhi
2003; the maker's hysteresis loss). Damping of presliding and of the gear: 0.1 to 0.7 of critical.
"""

import math

from numba import njit
import numpy as np

from world.person import floats, log_uniform, nobody, PERSON_STATE, person_torque, remember

ELEMENTS = 6
LONGEST_DELAY = 8   # samples by which a command is late, and one more
MAXWELL_SLIP, LUGRE, CLAMP, DAHL = range(4)
FRICTIONS = {'maxwell_slip': MAXWELL_SLIP, 'lugre': LUGRE, 'clamp': CLAMP, 'dahl': DAHL}
ARMIN = ('armin_1', 'armin_2', 'armin_3')
SERVOS = ('ak80', 'ur', 'cycloidal', 'planetary')
KINDS = ARMIN + tuple(FRICTIONS)
DEGREE = math.pi / 180.0
TORQUE_CONSTANT = 0.119
STILL = 2e-3    # rad/s below which a joint counts as resting
REST = 0.2      # s of rest after which a start finds other breakaway friction
RENEWED = 8.0   # ways of renewal after which nothing of it is left
SLOW = 1e-7     # rad/s: neither damping nor viscous friction takes anything
GONE = 0.95     # of the level: there a joint has left presliding

# Ratio, inertia of rotor and wave generator at the joint, level and breakaway current, A, its
# standard deviation, viscous current per deg/s, stiffness. The note prints the coefficients of
# configurations 2 and 3 in each other's place (Fig. 4, and the breakaway currents, tell).
_ARMIN = {
    'armin_1': (100.0, 0.101, 0.0926, 0.0995, 0.0034, 0.0008, (4700.0, 7100.0)),
    'armin_2': (100.0, 0.101, 0.1595, 0.1377, 0.0043, 0.0027, (4700.0, 7100.0)),
    'armin_3': (435.0, 1.911, 0.3590, 0.3357, 0.0172, 0.0032, (1.9e4, 8.4e4)),
}

# All at the joint: a motor's angle divided by the gear ratio, its torque times the ratio. SI.
GEAR = np.dtype([
    ('friction', 'i8'), ('command_delay', 'i8'),
    *floats(
        # rotor and link, and the gear between them
        'motor_inertia link_inertia stiffness damping backlash '
        # friction on the motor's side: sliding level, level at rest, how it falls between
        # them, how much larger it is in positive direction (relative, smaller in negative)
        'coulomb static stribeck_velocity stribeck_exponent viscous asymmetry '
        # breakaway scatter: relative, and the distance of sliding that renews the surface
        'scatter renewal '
        # presliding: distance (95 % of the level), damping ratio, constants of the kind
        'presliding damping_ratio bristle damping_velocity attraction '
        # friction on the link's side, and what depends on place and load
        'link_coulomb link_bristle link_viscous cogging cogging_waves cogging_phase '
        'load_friction gravity gravity_phase '
        # motor and converter, and the sensor; noise of the velocity is that of a driver's own
        'torque_per_current current_limit current_time current_noise '
        'resolution velocity_time velocity_noise'),
    ('element_share', 'f8', (ELEMENTS,)), ('element_distance', 'f8', (ELEMENTS,)),
])

STATE = np.dtype([
    ('random', 'u8'), *PERSON_STATE,
    *floats('motor motor_velocity link link_velocity bristle link_bristle current slid resting '
            'breakaway_factor measured measured_velocity offset friction friction_work'),
    ('element', 'f8', (ELEMENTS,)), ('slipping', 'i8', (ELEMENTS,)),
    ('commands', 'f8', (LONGEST_DELAY,)),
])


# Friction.

@njit(cache=True, inline='always')
def level(p, s, v, shaft):
    """Return the magnitude of friction while sliding at v, N·m: what a kind tends to."""
    value = p.coulomb
    if p.static != p.coulomb:
        x = abs(v) / p.stribeck_velocity
        if x < 30.0:
            value += (p.static - p.coulomb) * math.exp(-(x ** p.stribeck_exponent))
    if v != 0.0:
        value *= 1.0 + (p.asymmetry if v > 0.0 else -p.asymmetry)
    if s.slid < RENEWED * p.renewal:
        value *= 1.0 + s.breakaway_factor * math.exp(-s.slid / p.renewal)
    return max(0.0, value + p.load_friction * abs(shaft))


@njit(cache=True, inline='always')
def turned(z, way, distance):
    """Return Dahl's state in -1..1 after a displacement, exactly."""
    side = math.copysign(1.0, way)
    return z if way == 0.0 else side * (1.0 - (1.0 - side * z) * math.exp(-abs(way) / distance))


@njit(cache=True)
def maxwell_slip(p, s, v, top, h):
    """Return the torque of the elements and advance them by a step."""
    stiffest = 0.0
    for i in range(ELEMENTS):
        stiffest += p.element_share[i] * p.static / p.element_distance[i]
    damper = 2.0 * p.damping_ratio * math.sqrt(stiffest * p.motor_inertia) / stiffest
    relaxed = 1.0 - math.exp(-p.attraction * h)
    torque = 0.0
    for i in range(ELEMENTS):
        f = s.element[i]
        spring = p.element_share[i] * p.static / p.element_distance[i]
        most = p.element_share[i] * top
        if s.slipping[i] == 1 and v * f <= 0.0:
            s.slipping[i] = 0
        if s.slipping[i] == 1:
            f += relaxed * (math.copysign(most, v) - f)
            torque += f
        else:
            torque += f + damper * spring * v
            f += spring * v * h
            if abs(f) > most:
                s.slipping[i] = 1
        s.element[i] = f
    return torque


@njit(cache=True)
def motor_friction(p, s, v, shaft, h):
    """Return the torque that resists the motor (not for the clamp), and advance its state.

    The state of LuGre and Dahl is in units of the level at rest. Damping acts on the part of the
    motion that bends the bristles, so it is gone in sliding.
    """
    # Dahl's torque is level times state: the level of the side it is bent to, or it would jump
    # with every change of the velocity's sign.
    top = level(p, s, math.copysign(v, s.bristle) if p.friction == DAHL else v, shaft)
    if p.friction == MAXWELL_SLIP:
        return maxwell_slip(p, s, v, top, h) + p.viscous * v
    z, scale, new = s.bristle, top, s.bristle
    if p.friction == DAHL:
        new = turned(z, v * h, p.bristle)
    else:
        scale = p.static
        if v != 0.0:
            goal = math.copysign(top / p.static, v)
            new = goal + (z - goal) * math.exp(
                -abs(v) * h / p.bristle * p.static / max(top, 1e-9 * p.static))
    s.bristle = new
    x, damper = v / p.damping_velocity, 0.0
    if abs(x) < 4.0:
        damper = (2.0 * p.damping_ratio * math.sqrt(p.static / p.bristle * p.motor_inertia)
                  * math.exp(-x * x))
    return scale * z + damper * p.bristle * (new - z) / h + p.viscous * v


@njit(cache=True)
def clamped(p, s, v, shaft, push, h):
    """Return the motor's velocity after a step under the clamp, without friction `push` N·m."""
    free = v + push * h / p.motor_inertia
    # At rest friction is that of the direction in which the motor would go.
    top = level(p, s, v if v != 0.0 else math.copysign(1e-12, free), shaft)
    stopping = (top + p.viscous * abs(v)) * h / p.motor_inertia
    return 0.0 if abs(free) <= stopping else free - math.copysign(stopping, free)


# The joint.

@njit(cache=True)
def uniform(s):
    """Return a random number in 0..1 (splitmix64), different for each joint and sample."""
    s.random += np.uint64(0x9E3779B97F4A7C15)
    z = s.random
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (z >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@njit(cache=True)
def normal(s):
    """Return a random number of standard normal distribution."""
    u = max(uniform(s), 1e-300)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * uniform(s))


@njit(cache=True)
def advance(p, s, who, time, command, sample_time, steps):
    """Advance one joint by one sample."""
    h = sample_time / steps
    s.commands[s.count % LONGEST_DELAY] = command if math.isfinite(command) else 0.0
    goal = s.commands[(s.count - p.command_delay) % LONGEST_DELAY]
    goal = min(p.current_limit, max(-p.current_limit, goal)) + p.current_noise * normal(s)
    heading = 1.0 - math.exp(-h / p.current_time)
    x, v, y, w = s.motor, s.motor_velocity, s.link, s.link_velocity
    touched = who.touch <= time < who.release
    inertia = p.link_inertia + (who.arm if touched else 0.0)
    remember(who, s, time)
    work = resisting = 0.0
    for k in range(steps):
        s.current += heading * (goal - s.current)
        drive = s.current * p.torque_per_current
        if p.cogging != 0.0:
            drive += p.cogging * math.cos(p.cogging_waves * x + p.cogging_phase)
        twist = x - y
        touch = twist - min(0.5 * p.backlash, max(-0.5 * p.backlash, twist))
        shaft = p.stiffness * touch
        if touch != 0.0 or p.backlash == 0.0:
            shaft += p.damping * (v - w)
        s.person = person_torque(who, s, time + k * h, y, w) if touched else 0.0
        outer = s.person - p.link_viscous * w
        if p.gravity != 0.0:
            outer -= p.gravity * math.cos(y - p.gravity_phase)
        if p.link_coulomb != 0.0:
            s.link_bristle = turned(s.link_bristle, w * h, p.link_bristle)
            outer -= p.link_coulomb * s.link_bristle
        if p.friction == CLAMP:
            new = clamped(p, s, v, shaft, drive - shaft, h)
            resisting = drive - shaft - p.motor_inertia * (new - v) / h
        else:
            resisting = motor_friction(p, s, v, shaft, h)
            new = v + h * (drive - shaft - resisting) / p.motor_inertia
        work += resisting * h * 0.5 * (v + new)
        v = new
        w += h * (shaft + outer) / inertia
        x += h * v
        y += h * w
    s.motor, s.motor_velocity, s.link, s.link_velocity = x, v, y, w
    s.friction_work += work
    s.friction = resisting + p.link_coulomb * s.link_bristle
    if not abs(v) < 1e4:
        # Beyond all reason: hold it there, so that the run ends with finite numbers.
        s.motor_velocity = s.link_velocity = 1e4
    s.count += 1


@njit(cache=True)
def advance_all(gears, states, persons, time, commands, sample_time, steps):
    """Advance every joint by one sample; after a rest its breakaway friction is another."""
    for j in range(len(gears)):
        p, s = gears[j], states[j]
        advance(p, s, persons[j], time, commands[j], sample_time, steps)
        if abs(s.motor_velocity) > STILL:
            s.slid += abs(s.motor_velocity) * sample_time
            s.resting = 0.0
            continue
        s.resting += sample_time
        if s.resting > REST and s.slid > max(5.0 * p.presliding, 1e-3):
            s.breakaway_factor = max(-0.5, p.scatter * normal(s))
            s.slid = 0.0


@njit(cache=True)
def measure_all(gears, states, sample_time):
    """Read every joint's encoder: position to the count, velocity as the drive has it."""
    for j in range(len(gears)):
        p, s = gears[j], states[j]
        position = math.floor((s.motor + s.offset) / p.resolution) * p.resolution
        seen = (position - s.measured) / sample_time if s.count > 0 else 0.0
        s.measured = position
        if p.velocity_noise > 0.0:
            seen = s.motor_velocity + p.velocity_noise * normal(s)
        s.measured_velocity += (1.0 - math.exp(-sample_time / p.velocity_time)) * (
            seen - s.measured_velocity)


class Plant:
    """A bank of joints with their persons.

    `gears`: ndarray of GEAR, shape (J,). `persons`: ndarray of PERSON, shape (J,). `seed`: of
    noise and scatter. `sample_time`: s. `steps`: steps of integration a sample.
    """

    def __init__(self, gears, persons, seed, sample_time=1e-3, steps=20):
        self.gears, self.persons = gears.copy(), persons.copy()
        self.sample_time, self.steps, self.time = sample_time, steps, 0.0
        random = np.random.default_rng([seed, 77])
        joints = len(gears)
        self.states = np.zeros(joints, dtype=STATE)
        s = self.states
        s['random'] = random.integers(0, 2**63, joints)
        s['offset'] = random.uniform(0.0, 1.0, joints) * gears['resolution']
        s['breakaway_factor'] = np.maximum(-0.5, gears['scatter'] * random.normal(size=joints))
        measure_all(self.gears, s, sample_time)

    def sample(self):
        """Return measured position and velocity, each of shape (J,), rad and rad/s."""
        if self.states['count'][0] > 0:
            measure_all(self.gears, self.states, self.sample_time)
        return self.states['measured'].copy(), self.states['measured_velocity'].copy()

    def advance(self, current):
        """Apply currents, A, for one sample."""
        advance_all(self.gears, self.states, self.persons, self.time,
                    np.ascontiguousarray(current, dtype=float), self.sample_time, self.steps)
        self.time += self.sample_time

    def knock(self, speed):
        """Change the speed of every joint, rad/s."""
        self.states['motor_velocity'] += speed
        self.states['link_velocity'] += speed


# Random draws.

def draw_gears(kind, draws, seed):
    """Return random gears of a kind, GEAR of shape (draws,).

    `kind`: one of `KINDS`: one of the note's drives with friction of any kind, or a friction in a
    servo drive of any family.
    """
    random = np.random.default_rng([seed, KINDS.index(kind)])
    gears = np.zeros(draws, dtype=GEAR)
    for k, gear in enumerate(gears):
        if kind in ARMIN:
            gear['friction'], family = k % len(FRICTIONS), kind
        else:
            gear['friction'] = FRICTIONS[kind]
            family = (SERVOS + ARMIN[::2])[(k + seed) % (len(SERVOS) + 2)]
        _drive(gear, family, random)
        _friction(gear, random)
        _electronics(gear, random)
    return gears


def _drive(g, family, random):
    if family in ARMIN:
        ratio, g['motor_inertia'], coulomb, breakaway, std, viscous, stiffness = _ARMIN[family]
        constant, counts, limit = TORQUE_CONSTANT, 4000, 3.0
        g['stiffness'] = random.uniform(*stiffness)
        g['link_inertia'] = log_uniform(random, 0.03, 0.3) * (2.0 if ratio > 400 else 1.0)
        # Configurations 2 and 3 break away below the level Eq. 11 extrapolates from faster motion.
        g['coulomb'] = min(coulomb, 0.96 * breakaway) * constant * ratio
        g['static'] = breakaway * constant * ratio
        g['viscous'] = viscous / DEGREE * constant * ratio
        g['scatter'] = std / breakaway
        g['stribeck_velocity'] = random.uniform(0.5, 2.0) * DEGREE
    else:
        (rotor, ratio, constant, counts, limit, g['stiffness'], friction,
         g['link_inertia']) = _servo(family, random)
        g['motor_inertia'] = rotor * ratio**2
        g['coulomb'] = friction
        g['static'] = friction * random.choice([1.0, random.uniform(1.0, 1.15),
                                                random.uniform(1.15, 1.5)])
        g['viscous'] = friction * random.uniform(0.1, 0.8)
        g['scatter'] = random.uniform(0.01, 0.06)
        g['stribeck_velocity'] = log_uniform(random, 0.3, 3.0) * DEGREE
    g['torque_per_current'], g['current_limit'] = constant * ratio, limit
    g['resolution'] = 2.0 * math.pi / (counts * ratio)
    g['cogging_waves'] = 6.0 * ratio
    reduced = 1.0 / (1.0 / g['motor_inertia'] + 1.0 / g['link_inertia'])
    g['damping'] = 2.0 * random.uniform(0.1, 0.7) * math.sqrt(g['stiffness'] * reduced)


def _servo(family, random):
    """Return rotor kg·m², ratio, N·m/A, counts, limit A, stiffness, friction N·m, link kg·m²."""
    between = random.uniform
    if family == 'ak80':
        return (6.07e-5, 9.0, between(0.09, 0.11), 2**14, 15.0, log_uniform(random, 800.0, 4000.0),
                between(0.3, 0.9), log_uniform(random, 0.01, 0.1))
    if family == 'ur':
        return (between(0.8e-4, 2.2e-4), 101.0, between(0.1, 0.135), 2**random.integers(12, 18),
                between(8.0, 20.0), log_uniform(random, 1e4, 3.1e4), between(4.0, 15.0),
                log_uniform(random, 0.1, 1.0))
    if family == 'cycloidal':
        return (between(0.3e-4, 1.0e-4), random.choice([57.0, 81.0, 105.0, 121.0]),
                between(0.3, 0.6), 2**random.integers(17, 20), between(4.0, 10.0),
                log_uniform(random, 6.9e4, 1.7e5), between(5.0, 25.0),
                log_uniform(random, 0.3, 1.0))
    return (between(1e-6, 7e-6), between(20.0, 150.0), between(0.03, 0.12),
            random.choice([2000, 2048, 4000, 4096]), between(4.0, 10.0),
            log_uniform(random, 300.0, 2000.0), between(0.3, 2.0), log_uniform(random, 0.01, 0.1))


def _friction(g, random):
    g['stribeck_exponent'] = random.choice([1.0, 2.0])
    g['renewal'] = log_uniform(random, 2e-3, 2e-2)
    g['damping_ratio'] = random.uniform(0.1, 0.7)
    long = random.uniform() < 1 / 6
    g['presliding'] = random.uniform(1e-3, 2e-3) if long else log_uniform(random, 1e-4, 1e-3)
    g['load_friction'] = random.choice([0.0, random.uniform(0.0, 0.03)])
    # The note's own breakaway currents are the same both ways, Eq. 11 by up to 5 % not.
    g['asymmetry'] = random.choice([0.0, random.uniform(-0.05, 0.05)])
    # Some of the friction is on the link's side.
    share = random.uniform(0.0, 0.15)
    g['link_coulomb'], g['link_viscous'] = share * g['coulomb'], share * g['viscous']
    g['link_bristle'] = log_uniform(random, 1e-4, 1e-3) / 3.0
    for name in ('coulomb', 'viscous'):
        g[name] *= 1.0 - share
    g['static'] -= g['link_coulomb']
    g['cogging'] = random.choice([0.0, random.uniform(0.0, 0.03)]) * g['coulomb']
    g['cogging_phase'] = random.uniform(-math.pi, math.pi)
    # The constants of the kind, so that presliding is as long as asked.
    if g['friction'] == DAHL:
        g['static'] = g['coulomb']  # it has no other level at rest
    elif g['friction'] == MAXWELL_SLIP:
        reach = (np.arange(1, ELEMENTS + 1) / ELEMENTS) ** random.uniform(1.0, 2.0)
        weight = random.uniform(0.5, 1.5, ELEMENTS)
        g['element_share'] = weight / weight.sum()
        g['element_distance'] = g['presliding'] * reach
        g['attraction'] = log_uniform(random, 100.0, 2000.0)
    elif g['friction'] == CLAMP:
        g['presliding'] = 0.0
    g['damping_velocity'] = log_uniform(random, 2e-3, 2e-2)
    g['bristle'] = g['presliding'] / 3.0


def _electronics(g, random):
    g['command_delay'] = random.integers(0, 3)
    g['current_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 100.0, 1000.0))
    g['current_noise'] = random.uniform(0.001, 0.005) * (
        g['static'] + g['link_coulomb']) / g['torque_per_current']
    # A difference of counts, the same filtered, or a driver's own.
    kind = random.choice(3)
    g['velocity_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 20.0, 150.0)) if kind else 1e-5
    g['velocity_noise'] = g['resolution'] / random.uniform(0.005, 0.05) if kind == 2 else 0.0


def frictionless(gears):
    """Return the same drives without friction of any kind."""
    free = gears.copy()
    free['friction'] = CLAMP
    for name in ('coulomb', 'static', 'viscous', 'link_coulomb', 'link_viscous', 'load_friction',
                 'cogging'):
        free[name] = 0.0
    return free


# What a gear's friction is, from its own numbers and its own slow ramps.

def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current, A, that keeps a joint at constant speeds, rad/s.

    `side`: +1 or -1: the direction; 0 the mean of both.
    """
    g = gear
    x = np.asarray(speeds) / g['stribeck_velocity']
    outer = g['link_coulomb'] + g['link_viscous'] * speeds
    dry = g['coulomb'] + (g['static'] - g['coulomb']) * np.exp(-x ** g['stribeck_exponent'])
    torque = (dry * (1.0 + side * g['asymmetry']) + g['viscous'] * speeds
              + g['load_friction'] * outer + outer)
    return torque / g['torque_per_current']


def breakaway_currents(gears, seed, repetitions):
    """Return the currents at which slow ramps set each joint going, A, shape (J, repetitions).

    The even ones are of the positive direction, the odd ones of the negative (as magnitudes).
    """
    bank = np.repeat(gears, repetitions)
    bank['gravity'] = bank['current_noise'] = 0.0
    side = np.where(np.arange(len(bank)) % 2 == 0, 1.0, -1.0)
    plant = Plant(bank, nobody(len(bank)), seed)
    # At places all round, for cogging differs from one to the next.
    start = np.random.default_rng([seed, 5]).uniform(-np.pi, np.pi, len(bank))
    plant.states['motor'] = plant.states['link'] = start
    most = (bank['static'] + bank['link_coulomb']) / bank['torque_per_current']
    # Gone is who has left presliding behind: LuGre and Dahl give way a little all the time. What
    # held the joint is the most that friction took until then: by the time it is gone the ramp is
    # higher, for a rotor takes time to get going.
    far = (6.0 * np.maximum(bank['presliding'], bank['link_bristle']) + bank['backlash']
           + 2.0 * bank['resolution'])
    found, gone = np.zeros(len(bank)), np.zeros(len(bank), dtype=bool)
    while not gone.all() and plant.time < 8.0:
        # Settle at a fraction of the level, then 0.4 of it a second; the note had 0.4 to 0.5.
        share = 0.4 * min(1.0, plant.time / 0.3) + max(0.0, plant.time - 0.3) / 2.5
        plant.advance(np.where(gone, 0.0, side * share * most))
        gone |= side * (plant.states['motor'] - start) > far
        dry = plant.states['friction'] - bank['viscous'] * plant.states['motor_velocity']
        found = np.where(gone, found, np.maximum(found, side * dry))
    return (np.where(gone, found, np.nan) / bank['torque_per_current']).reshape(
        len(gears), repetitions)


def presliding(gear):
    """Return the way to 95 % of breakaway, and by how much it differs from rest to rest, rad.

    What is on the link's side counts: an encoder cannot tell whose friction it is. A clamp does
    not give way: NaN.
    """
    if gear['friction'] == CLAMP:
        return np.nan, 0.0
    way = np.linspace(0.0, 6.0 * max(gear['presliding'], 3.0 * gear['link_bristle']), 4000)
    torque = np.zeros(len(way))
    _load(gear, np.zeros(1, dtype=STATE)[0], way[1], torque)
    torque += gear['link_coulomb'] * -np.expm1(-way / gear['link_bristle'])
    return way[int(np.argmax(torque >= GONE * torque[-1]))], 0.0


@njit(cache=True)
def _load(gear, state, step, torque):
    """Write the rotor's friction along a slow way of even steps."""
    for k in range(1, len(torque)):
        torque[k] = motor_friction(gear, state, SLOW, 0.0, step / SLOW)
