# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Geared joints in MuJoCo, to judge the compensation law with an engine that is not ours.

Stick and slip are MuJoCo's own ``frictionloss``, gravity its own, springs its tendons. What it
lacks is set from outside, once a millisecond, and never gives energy: levels that depend on place,
rest and side, springs that differ by side, damping that acts only while teeth touch.

harmonic
    Strain wave gears of sizes 14 to 25: catalogue stiffness 3 to 30 kN·m/rad, ratios 50 to 160,
    no backlash, presliding 0.1 to 1 mrad.
planetary
    Small motors with planetary gears: 300 to 3000 N·m/rad, ratios 9 to 150, backlash 0.2 to 5 mrad
    (0.01 to 0.3 degrees; makers state 0.1 to 1 degree for cheap ones, of which the lower end).
cycloidal
    Stiff, backlash below an arc minute (0.05 to 0.3 mrad).
long
    Lubricated and preloaded gears whose presliding is 1 to 3 mrad long and differs by side.

Friction is two elements between rotor and housing, each stuck or sliding (``frictionloss``) behind
a spring, and one on the link's side, behind gear and backlash. Their level grows with rest by 0 to
6 % for every tenfold time (Rabinowicz's ageing) until the joint has slid for 1 to 10 mrad, and
waxes and wanes by 0 to 4 % with the turn of motor, wave generator or joint (eccentricity); the two
sides differ by up to 8 % in level and up to a factor of two in the way of presliding.
"""

from functools import cache
import math

import mujoco
from numba import njit
import numpy as np

from world.gear import DEGREE, GONE, LONGEST_DELAY, measure_all, STILL
from world.person import floats, log_uniform, nobody, PERSON_STATE, person_torque, remember

KINDS = ('harmonic', 'planetary', 'cycloidal', 'long')

# At the joint, SI.
GEAR = np.dtype([('command_delay', 'i8'), *floats(
    'motor_inertia link_inertia stiffness damping backlash '
    # sliding friction of the rotor's side and of the link's, N·m; N·m·s/rad; relative, by side
    'coulomb static link_coulomb viscous asymmetry '
    # first element's share, the elements' ways to their level, rad; second side's over the first's
    'share first_distance second_distance distance_ratio micro_damping presliding '
    'ageing renewal eccentricity eccentricity_waves eccentricity_phase '
    'cogging cogging_waves gravity gravity_phase '
    'torque_per_current current_limit current_time current_noise resolution velocity_time '
    # none: its velocity is a difference of counts
    'velocity_noise')])


def draw_gears(kind, draws, seed):
    """Return random gears of a kind, shape (draws,)."""
    random = np.random.default_rng([seed, KINDS.index(kind), 4])
    gears = np.zeros(draws, dtype=GEAR)
    for g in gears:
        ratio = _drive(g, kind, random)
        _friction(g, kind, random)
        _electronics(g, ratio, random)
    return gears


def _drive(g, kind, random):
    """Set inertias, springs and the level; return the gear ratio."""
    if kind == 'planetary':
        ratio, level = log_uniform(random, 9.0, 150.0), log_uniform(random, 0.3, 3.0)
        g['motor_inertia'] = log_uniform(random, 0.005, 0.05)
        g['link_inertia'] = log_uniform(random, 0.01, 0.1)
        g['stiffness'] = log_uniform(random, 300.0, 3000.0)
        g['backlash'] = log_uniform(random, 2e-4, 5e-3)
    elif kind == 'cycloidal':
        ratio, level = random.choice([57.0, 81.0, 105.0, 121.0]), random.uniform(5.0, 25.0)
        g['motor_inertia'] = log_uniform(random, 0.2, 1.2)
        g['link_inertia'] = log_uniform(random, 0.2, 1.0)
        g['stiffness'] = log_uniform(random, 5e4, 1.5e5)
        g['backlash'] = log_uniform(random, 5e-5, 3e-4)
    else:
        ratio, level = random.choice([50.0, 80.0, 100.0, 120.0, 160.0]), log_uniform(
            random, 0.8, 12.0)
        g['motor_inertia'] = log_uniform(random, 0.05, 0.6)
        g['link_inertia'] = log_uniform(random, 0.03, 0.5)
        g['stiffness'] = log_uniform(random, 3e3, 3e4)
    reduced = 1.0 / (1.0 / g['motor_inertia'] + 1.0 / g['link_inertia'])
    g['damping'] = 2.0 * random.uniform(0.05, 0.4) * math.sqrt(g['stiffness'] * reduced)
    share = random.uniform(0.05, 0.3)
    g['coulomb'], g['link_coulomb'] = (1.0 - share) * level, share * level
    g['viscous'] = random.uniform(0.1, 0.8) * level / (100.0 * DEGREE)
    return ratio


def _friction(g, kind, random):
    g['presliding'] = log_uniform(random, 1e-3, 3e-3) if kind == 'long' else log_uniform(
        random, 1e-4, 1e-3)
    g['share'] = random.uniform(0.3, 0.7)
    # The way to 95 % of the level is where the second element is near its own.
    g['second_distance'] = g['presliding']
    g['first_distance'] = random.uniform(0.2, 0.8) * g['presliding']
    g['distance_ratio'] = log_uniform(random, 0.5, 2.0) if kind == 'long' else 1.0
    stiffest = g['coulomb'] / g['first_distance']
    g['micro_damping'] = random.uniform(0.1, 0.5) * 2.0 * math.sqrt(
        stiffest * g['motor_inertia'])
    g['asymmetry'] = random.choice([0.0, random.uniform(-0.08, 0.08)])
    g['ageing'] = random.choice([0.0, random.uniform(0.0, 0.06)])
    g['renewal'] = log_uniform(random, 1e-3, 1e-2)
    g['static'] = g['coulomb'] * (1.0 + g['ageing'])
    g['eccentricity'] = random.choice([0.0, random.uniform(0.0, 0.04)])
    g['eccentricity_phase'] = random.uniform(-math.pi, math.pi)


def _electronics(g, ratio, random):
    level = g['coulomb'] + g['link_coulomb']
    g['eccentricity_waves'] = random.choice([1.0, 2.0, ratio, 2.0 * ratio])
    g['cogging'], g['cogging_waves'] = random.uniform(0.0, 0.015) * level, 6.0 * ratio
    g['torque_per_current'] = level / random.uniform(0.08, 0.6)
    g['current_limit'] = 5.0
    g['command_delay'] = random.integers(0, 3)
    g['current_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 150.0, 1000.0))
    g['current_noise'] = random.uniform(0.001, 0.005) * level / g['torque_per_current']
    g['resolution'] = 2.0 * math.pi / (ratio * random.choice([2000, 4000, 8192, 16384]))
    g['velocity_time'] = 1.0 / (2.0 * math.pi * log_uniform(random, 20.0, 150.0))


def frictionless(gears):
    """Return the same drives without friction of any kind, and without what carries."""
    free = gears.copy()
    for name in ('coulomb', 'static', 'link_coulomb', 'viscous', 'cogging'):
        free[name] = 0.0
    return free


STATE = np.dtype([('random', 'u8'), *PERSON_STATE, *floats(
    'motor motor_velocity link link_velocity current measured measured_velocity offset '
    'rest slid age')])
ROTOR, FIRST, SECOND, LINK = range(4)
TEETH, TO_FIRST, TO_SECOND = range(3)
LEVER = 0.02        # m from the axis to the link's mass
SLIDER = 0.02       # of the rotor's inertia
# As hard as MuJoCo's friction goes without numerical trouble: it creeps by some µrad/s.
_HARD = 'solreffriction="0.002 1" solimpfriction="0.9999 0.9999 0.001"'


def _body(name, inertia, friction, mass=1e-6, place=(0.0, 0.0), damping=0.0):
    return (f'<body><inertial pos="{place[0]} 0 {place[1]}" mass="{mass}" '
            f'diaginertia="1e-9 1e-9 1e-9"/><joint name="{name}" type="hinge" axis="0 -1 0" '
            f'armature="{inertia}" damping="{damping}" frictionloss="{friction}" {_HARD}/></body>')


def _spring(one, other, stiffness, damping, slack=0.0):
    return (f'<fixed stiffness="{stiffness}" damping="{damping}" '
            f'springlength="{-slack} {slack}"><joint joint="{one}" coef="1"/>'
            f'<joint joint="{other}" coef="-1"/></fixed>')


def _model(gears, step):
    bodies, tendons = [], []
    for j, g in enumerate(gears):
        mass = g['gravity'] / (9.81 * LEVER)
        place = LEVER * math.cos(g['gravity_phase']), -LEVER * math.sin(g['gravity_phase'])
        friction = max(1e-9, g['coulomb'])
        bodies += [
            _body(f'r{j}', g['motor_inertia'], 0.0, damping=g['viscous']),
            _body(f'a{j}', SLIDER * g['motor_inertia'], g['share'] * friction),
            _body(f'b{j}', SLIDER * g['motor_inertia'], (1.0 - g['share']) * friction),
            _body(f'l{j}', g['link_inertia'] - mass * LEVER ** 2, max(1e-9, g['link_coulomb']),
                  1e-6 + mass, place)]
        tendons += [
            _spring(f'r{j}', f'l{j}', g['stiffness'], g['damping'], 0.5 * g['backlash']),
            _spring(f'r{j}', f'a{j}', 1.0, g['share'] * g['micro_damping']),
            _spring(f'r{j}', f'b{j}', 1.0, (1.0 - g['share']) * g['micro_damping'])]
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler autolimits="false"/><option timestep="{step}" tolerance="1e-10" '
        f'integrator="implicitfast"><flag contact="disable"/></option>'
        f'<worldbody>{"".join(bodies)}</worldbody><tendon>{"".join(tendons)}</tendon></mujoco>')


class Plant:
    """A bank of joints with their persons, as `world.gear.Plant`.

    `seed`: of noise, and of where each joint rests at first. `steps`: of the engine, a sample.
    """

    def __init__(self, gears, persons, seed, sample_time=1e-3, steps=5):
        self.gears, self.persons = gears.copy(), persons.copy()
        self.sample_time, self.steps, self.time = sample_time, steps, 0.0
        self._random = np.random.default_rng([seed, 78])
        joints = len(gears)
        self.states = np.zeros(joints, STATE)
        self.model = _model(gears, sample_time / self.steps)
        self.data = mujoco.MjData(self.model)
        self.states['offset'] = self._random.uniform(0.0, 1.0, joints) * gears['resolution']
        place = self._random.uniform(-0.3, 0.3, joints)
        q = self._rows(self.data.qpos)
        # Somewhere, and at rest: nothing holds a rotor whose presliding is loaded.
        q[:] = place[:, None]
        self._commands = np.zeros((LONGEST_DELAY, joints))
        self._own_inertia = self._rows(self.model.dof_armature)[:, LINK].copy()
        self._watch()
        # Who holds the joint from the beginning takes it where it is.
        self.states['origin'] = self.states['link']
        measure_all(self.gears, self.states, self.sample_time)

    def _rows(self, values, width=4):
        """Return a view of one of the engine's arrays, shape (J, width)."""
        return values.reshape(-1, width)

    def sample(self):
        """Return measured position and velocity, each of shape (J,), rad and rad/s."""
        if self.states['count'][0] > 0:
            measure_all(self.gears, self.states, self.sample_time)
        return self.states['measured'].copy(), self.states['measured_velocity'].copy()

    def knock(self, speed):
        """Change the speed of every joint, rad/s."""
        v = self._rows(self.data.qvel)
        v[:, ROTOR] += speed
        v[:, LINK] += speed

    def advance(self, current):
        """Apply currents, A, for one sample."""
        s, g, m, d = self.states, self.gears, self.model, self.data
        h = self.sample_time / self.steps
        current = np.where(np.isfinite(current), current, 0.0)
        self._commands[s['count'][0] % LONGEST_DELAY] = np.clip(current, -g['current_limit'],
                                                    g['current_limit'])
        late = (s['count'] - g['command_delay']) % LONGEST_DELAY
        goal = self._commands[late, np.arange(len(g))] + g['current_noise'] * (
            self._random.standard_normal(len(g)))
        self._set_friction()
        touched = (self.persons['touch'] <= self.time) & (self.time < self.persons['release'])
        self._rows(m.dof_armature)[:, LINK] = self._own_inertia + np.where(
            touched, self.persons['arm'], 0.0)
        _remember(self.persons, s, self.time)
        q, v = self._rows(d.qpos), self._rows(d.qvel)
        force = self._rows(d.qfrc_applied)
        heading = 1.0 - np.exp(-h / g['current_time'])
        for k in range(self.steps):
            s['current'] += heading * (goal - s['current'])
            _persons(self.persons, s, touched, self.time + k * h, q[:, LINK], v[:, LINK])
            force[:, ROTOR] = s['current'] * g['torque_per_current'] + g['cogging'] * np.cos(
                g['cogging_waves'] * q[:, ROTOR])
            force[:, LINK] = s['person']
            mujoco.mj_step(m, d)
        self.time += self.sample_time
        self._watch()
        s['count'] += 1

    def _set_friction(self):
        """Set what the engine does not know by itself: levels and springs of this millisecond."""
        s, g = self.states, self.gears
        q = self._rows(self.data.qpos)
        place = 1.0 + g['eccentricity'] * np.cos(
            g['eccentricity_waves'] * s['motor'] + g['eccentricity_phase'])
        old = 1.0 + s['age'] * np.exp(-s['slid'] / g['renewal'])
        loss = self._rows(self.model.dof_frictionloss)
        stiffness = self._rows(self.model.tendon_stiffness, 3)
        for element, tendon, share, distance in (
                (FIRST, TO_FIRST, g['share'], g['first_distance']),
                (SECOND, TO_SECOND, 1.0 - g['share'], g['second_distance'])):
            side = np.where(q[:, ROTOR] >= q[:, element], 1.0, -1.0)
            most = np.maximum(1e-9, share * g['coulomb'] * (1.0 + side * g['asymmetry']))
            loss[:, element] = most * place * old
            way = distance * np.where(side > 0.0, 1.0, g['distance_ratio'])
            # A spring whose stiffness differs by side stores energy all the same: it changes
            # where it is relaxed.
            stiffness[:, tendon] = np.maximum(1e-6, most / way)
        damping = self._rows(self.model.tendon_damping, 3)
        touching = np.abs(q[:, ROTOR] - q[:, LINK]) >= 0.5 * g['backlash']
        damping[:, TEETH] = np.where(touching, g['damping'], 0.0)

    def _watch(self):
        s, h = self.states, self.sample_time
        q, v = self._rows(self.data.qpos), self._rows(self.data.qvel)
        s['motor'], s['link'] = q[:, ROTOR], q[:, LINK]
        s['motor_velocity'], s['link_velocity'] = v[:, ROTOR], v[:, LINK]
        going = np.abs(s['motor_velocity']) > STILL
        s['slid'] = np.where(going, s['slid'] + np.abs(s['motor_velocity']) * h, s['slid'])
        s['rest'] = np.where(going, 0.0, s['rest'] + h)
        aged = self.gears['ageing'] * np.log10(1.0 + s['rest'] / 0.1)
        rests = s['rest'] > 0.05
        more = rests & (aged > s['age'] * np.exp(-s['slid'] / self.gears['renewal']))
        s['age'] = np.where(more, aged, s['age'])
        s['slid'] = np.where(more, 0.0, s['slid'])


@njit(cache=True)
def _remember(persons, states, time):
    for j in range(len(persons)):
        remember(persons[j], states[j], time)


@njit(cache=True)
def _persons(persons, states, touched, time, position, velocity):
    for j in range(len(persons)):
        states[j].person = 0.0
        if touched[j]:
            states[j].person = person_torque(
                persons[j], states[j], time, position[j], velocity[j])


RAMPS, RAMP_TIME = 8, 1.2   # s to breakaway, as in `law_judge.identification`


def steady_friction(gear, speeds, side=0.0):
    """Return the magnitude of the current in A that keeps a joint at constant speeds, rad/s.

    `side` is the direction, +1 or -1; 0 the mean of both.
    """
    torque = (gear['coulomb'] * (1.0 + side * gear['asymmetry']) + gear['link_coulomb']
              + gear['viscous'] * np.asarray(speeds))
    return torque / gear['torque_per_current']


def breakaway_currents(gears, seed, repetitions):
    """Return the currents at which slow ramps set each joint going, A, shape (J, repetitions).

    The even ones in positive direction, the odd ones in negative, as magnitudes. It is the most
    that friction takes, rotor's and link's together.
    """
    _, taken = _ramps(gears, seed, repetitions,
                      lambda time: 0.4 * min(1.0, time / 0.3) + max(0.0, time - 0.3) / 2.5, 6.0)
    return (np.nanmax(taken, axis=0) / np.repeat(gears['torque_per_current'], repetitions)
            ).reshape(len(gears), repetitions)


def _ramps(gears, seed, repetitions, share, longest):
    """Load resting joints and return their ways in rad and what friction takes in N·m, (T, R).

    `share` is that of the level by the time in s. What friction takes is what the motor gives less
    what accelerates rotor and link, over 20 ms; NaN where a joint is gone.
    """
    bank = np.repeat(gears, repetitions)
    bank['gravity'] = bank['current_noise'] = 0.0
    side = np.where(np.arange(len(bank)) % 2 == 0, 1.0, -1.0)
    plant = Plant(bank, nobody(len(bank)), seed)
    start = plant.states['motor'].copy()
    torque = bank['torque_per_current']
    level = (bank['static'] + bank['link_coulomb']) / torque
    far = 6.0 * bank['presliding'] + bank['backlash'] + 2.0 * bank['resolution']
    gone = np.zeros(len(bank), dtype=bool)
    ways, given, momenta, kept = [], [], [], []
    while not gone.all() and plant.time < longest:
        plant.advance(np.where(gone, 0.0, side * share(plant.time) * level))
        s = plant.states
        ways.append(side * (s['motor'] - start))
        gone |= ways[-1] > far
        kept.append(~gone)
        given.append(side * (torque * s['current'] - bank['viscous'] * s['motor_velocity']))
        momenta.append(side * (bank['motor_inertia'] * s['motor_velocity']
                               + bank['link_inertia'] * s['link_velocity']))
    total, momenta = np.cumsum(given, axis=0), np.array(momenta)
    taken = (total[20:] - total[:-20]) / 20.0 - (momenta[20:] - momenta[:-20]) / 0.02
    return np.array(ways)[10:-10], np.where(np.array(kept)[20:], taken, np.nan)


def presliding(gear):
    """Return the way to 95 % of breakaway, mean of both directions, and a single rest's deviation.

    The way is that of a ramp as identification asks for, since the engine's friction creeps: its
    elements alone give way by a half less, a ramp of twenty times the length by three times more.
    Both in rad, the second a standard deviation.
    """
    return _way_of_ramps(gear.tobytes(), gear.dtype)


@cache
def _way_of_ramps(gear, dtype):
    gears = np.frombuffer(gear, dtype).copy()
    gears['backlash'] = 0.0     # its teeth touch
    ways, taken = _ramps(gears, 0, RAMPS, lambda time: time / RAMP_TIME, 3.0 * RAMP_TIME)
    reached = taken >= GONE * np.nanmax(taken, axis=0)
    given = ways[np.argmax(reached, axis=0), np.arange(ways.shape[1])]
    distance = 0.5 * float(np.median(given[0::2]) + np.median(given[1::2]))
    return distance, float(np.sqrt(np.mean((given - distance) ** 2)))
