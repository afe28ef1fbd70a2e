# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Joints, each a rotor, two friction elements and a link, as one MuJoCo model."""

import math

import mujoco
from numba import njit
import numpy as np

from world.person import floats, PERSON_STATE, person_torque, remember

STATE = np.dtype([*PERSON_STATE, *floats(
    'motor motor_velocity link link_velocity current measured measured_velocity offset '
    'rest slid age temperature')])
ROTOR, FIRST, SECOND, LINK = range(4)
GEAR, TO_FIRST, TO_SECOND = range(3)
STILL = 2e-3        # rad/s below which a joint rests
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
    """A bank of joints with their persons; the same shape as `world.gear.plant.Plant`.

    `gears`: ndarray of GEAR, shape (J,). `persons`: ndarray of PERSON, shape (J,). `seed`: of
    noise, and of where each joint rests at first. `sample_time`: s. `steps`: of the engine, a
    sample.
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
        self._commands = np.zeros((4, joints))
        self._own_inertia = self._rows(self.model.dof_armature)[:, LINK].copy()
        self._watch()
        # Who holds the joint from the beginning takes it where it is.
        self.states['origin'] = self.states['link']
        self._measure(first=True)

    def _rows(self, values, width=4):
        """Return a view of one of the engine's arrays, shape (J, width)."""
        return values.reshape(-1, width)

    def sample(self):
        """Return measured position and velocity, each of shape (J,), rad and rad/s."""
        if self.states['count'][0] > 0:
            self._measure()
        return self.states['measured'].copy(), self.states['measured_velocity'].copy()

    def knock(self, speed):
        """Change the speed of every joint, rad/s."""
        v = self._rows(self.data.qvel)
        v[:, ROTOR] += speed
        v[:, LINK] += speed

    def _measure(self, first=False):
        s, g = self.states, self.gears
        position = np.floor((s['motor'] + s['offset']) / g['resolution']) * g['resolution']
        last = position if first else s['measured'].copy()
        s['measured'] = position
        seen = (position - last) / self.sample_time
        weight = 1.0 - np.exp(-self.sample_time / g['velocity_time'])
        s['measured_velocity'] += weight * (seen - s['measured_velocity'])

    def advance(self, current):
        """Apply currents, A, for one sample."""
        s, g, m, d = self.states, self.gears, self.model, self.data
        h = self.sample_time / self.steps
        current = np.where(np.isfinite(current), current, 0.0)
        self._commands[s['count'][0] % 4] = np.clip(current, -g['current_limit'],
                                                    g['current_limit'])
        late = (s['count'] - g['command_delay']) % 4
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
        damping[:, GEAR] = np.where(touching, g['damping'], 0.0)

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
