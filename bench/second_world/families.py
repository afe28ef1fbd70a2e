# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random drives, one family for each kind of hidden effect, drawn by seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from second_world.arm import Chain
from second_world.cases import Case, generator, Hidden
from second_world.drive import Controller
from second_world.joint import Joint
from second_world.sensing import Sensors

_STEPS = (0.0005, 0.001, 0.001, 0.002, 0.004, 0.005, 0.008, 0.01, 0.01, 0.013, 0.02)
_DYNAMIC = ('multi_sine', 'joystick', 'production')


def _log(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _sign(rng):
    return float(rng.choice([-1.0, 1.0]))


def base(rng, family, seed):
    """Return a plain drive: Coulomb and viscous friction and inertia under a controller."""
    half, coulomb = _log(rng, 0.4, 2.0), _log(rng, 0.08, 3.0)
    top = half * _log(rng, 0.8, 3.0)
    joint = Joint(
        inertia=coulomb * _log(rng, 0.15, 1.5) * half / top ** 2, coulomb=coulomb,
        viscous=coulomb * rng.uniform(0.15, 0.8) / top,
        offset=coulomb * rng.normal() * 0.1 * (rng.random() < 0.5))
    step = float(rng.choice(_STEPS))
    seconds = float(np.clip(_log(rng, 15, 60), 5.0, 14000 * step))
    motions = _pick(rng, _DYNAMIC)
    return Case(family, seed, joint, _controller(rng, joint, coulomb), half, top, motions,
                (seconds, 0.6 * seconds), _sensors(rng, half, coulomb, step))


def _sensors(rng, half, coulomb, step):
    fine = 2 * np.pi / 2 ** rng.integers(13, 21)
    quantum = fine if rng.random() < 0.75 else 2 * np.pi / 4096
    noise = coulomb * _log(rng, 0.01, 0.1)
    return Sensors(
        step=step, jitter=float(rng.choice([0, 0, 0.05, 0.3])),
        stamps_jitter=bool(rng.random() < 0.2), quantum=float(quantum), noise=noise,
        noise_memory=float(rng.choice([0, 0, 0.004, 0.03])),
        current_quantum=float(rng.choice([0, 0, noise, 2 * noise])),
        velocity=str(rng.choice(['none', 'filtered', 'exact'])),
        gaps=int(rng.choice([0, 0, 0, 3, 12])), pieces=int(rng.choice([1, 1, 1, 4])),
        reference=bool(rng.random() < 0.25))


def _controller(rng, joint, coulomb, pull=None, mass=None):
    mass = mass or joint.inertia
    rate = 2 * np.pi * rng.uniform(1.5, 4.5)
    kind = rng.choice(['pd', 'cascade', 'feed forward'])
    good = {'pd': 0.0, 'cascade': 0.3, 'feed forward': 0.9}[kind]
    return Controller(
        proportional=mass * rate ** 2, derivative=1.6 * mass * rate,
        integral=0.0 if kind == 'pd' else 0.25 * mass * rate ** 3,
        inertia=good * mass * rng.uniform(0.8, 1.2), friction=good * coulomb,
        viscous=good * joint.viscous, gravity=max(good, 0.5),
        limit=float(rng.choice([1e9, 1e9, 6.0])) * coulomb if pull is None else 1e9,
        latency=int(rng.choice([0, 1, 3])), quantum=2e-5)


def _with(case, hidden, motions=None, sensors=None, **changes):
    """Return the case with an effect more."""
    case = replace(case, joint=case.joint._replace(**changes), hidden=(*case.hidden, hidden))
    if motions:
        case = replace(case, motions=motions)
    if sensors:
        case = replace(case, fit_sensors=replace(case.fit_sensors, **sensors))
    return case


def _pick(rng, kinds):
    return tuple(str(k) for k in rng.choice(kinds, 2, replace=False))


def _hidden(name, variable, **without):
    variables = frozenset((variable,) if isinstance(variable, str) else variable)
    return Hidden(name, variables, without)


def stribeck(rng, case):
    return _with(case, _hidden('stribeck', 'velocity', stribeck=0.0),
                 motions=_pick(rng, ('joystick', 'staircase', 'slow_sine')),
                 stribeck=rng.uniform(0.4, 1.2), stribeck_speed=case.top_speed * _log(
                     rng, 0.04, 0.12))


def asymmetry(rng, case):
    return _with(case, _hidden('asymmetry', 'direction', asymmetry=0.0, asymmetry_coulomb=0.0),
                 viscous=case.joint.coulomb * rng.uniform(0.8, 1.6) / case.top_speed,
                 asymmetry=_sign(rng) * rng.uniform(0.35, 0.7))


def viscous_shape(rng, case):
    power = rng.uniform(0.5, 0.65) if rng.random() < 0.5 else rng.uniform(1.7, 2.3)
    return _with(case, _hidden('viscous_shape', 'velocity', power=1.0),
                 viscous=case.joint.coulomb * rng.uniform(1.5, 3.0) / case.top_speed,
                 power=power, power_speed=0.5 * case.top_speed)


def gravity(rng, case):
    case = _with(case, _hidden('gravity', 'position', gravity=0.0),
                 gravity=case.joint.coulomb * rng.uniform(0.7, 4.0),
                 gravity_phase=rng.uniform(-np.pi, np.pi))
    return replace(case, forbidden=case.forbidden | {'bump', 'hysteresis'})


def spring(rng, case):
    return _with(case, _hidden('spring', 'position', spring=0.0),
                 spring=case.joint.coulomb * rng.uniform(0.5, 2.0) / case.half_range,
                 spring_centre=case.half_range * rng.uniform(-0.3, 0.3))


def _order(rng, case, top_factor=1.0):
    """Return waves a turn that the range holds and the sampling rate can follow."""
    low = 2.0 * np.pi / case.half_range
    high = 0.2 / case.fit_sensors.step * 2 * np.pi / case.top_speed / top_factor
    return int(max(np.ceil(min(_log(rng, low, max(min(high, 220), 1.5 * low)), high)), 3))


def cogging(rng, case):
    waves = np.array([[_order(rng, case), case.joint.coulomb * rng.uniform(0.2, 0.5),
                       rng.uniform(0, 6.28)]])
    return _with(case, _hidden('cogging', 'position', cogging=np.zeros((0, 3))), cogging=waves)


def ripple(rng, case):
    waves = np.array([[_order(rng, case), rng.uniform(0.2, 0.5), rng.uniform(0, 6.28)]])
    return _with(case, _hidden('ripple', 'position', ripple=np.zeros((0, 3))), ripple=waves)


def harmonic_family(rng, case):
    order = min(_order(rng, case, 3.0), 30)
    strength = rng.uniform(0.25, 0.45)
    waves = np.array([[order * k, strength / k, rng.uniform(0, 6.28)] for k in (1, 2, 3)])
    field = 'cogging' if rng.random() < 0.5 else 'ripple'
    if field == 'cogging':
        waves[:, 1] *= case.joint.coulomb
    return _with(case, _hidden('harmonic_family', 'position', **{field: np.zeros((0, 3))}),
                 **{field: waves})


def bump(rng, case):
    return _with(case, _hidden('bump', 'position', bump=0.0),
                 bump=case.joint.coulomb * rng.uniform(0.6, 1.5),
                 bump_at=case.half_range * rng.uniform(-0.5, 0.5),
                 bump_width=case.half_range * rng.uniform(0.08, 0.25))


def load(rng, case):
    constant = case.nominal[0] * case.nominal[1]
    case = _with(case, _hidden('load', 'load', load_gain=0.0), sensors={'load': True},
                 load_gain=-1.0 / constant)
    return replace(case, load_torque=constant * case.joint.coulomb * rng.uniform(0.5, 1.5))


def torque_constant(rng, case):
    case = load(rng, case)
    return replace(case, nominal=(case.nominal[0] * rng.choice([0.8, 0.88, 1.14, 1.25]), 100.0))


def load_friction(rng, case):
    case = load(rng, case)
    return _with(case, _hidden('load_friction', 'load', load_friction=0.0),
                 load_friction=-case.joint.load_gain * rng.uniform(0.2, 0.5))


def load_friction_unsensed(rng, case):
    case = gravity(rng, case)
    case = _with(case, _hidden('gravity_friction', 'load', gravity_friction=0.0),
                 gravity=case.joint.coulomb * rng.uniform(2.0, 6.0),
                 gravity_friction=rng.uniform(0.15, 0.4))
    return replace(case, half_range=max(case.half_range, 1.0),
                   top_speed=max(case.top_speed, 1.0))


def temperature(rng, case):
    case = _with(case, _hidden('temperature', 'temperature', heat_coulomb=0.0, heat_viscous=0.0),
                 sensors={'heat': True, 'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 heat_coulomb=-rng.uniform(0.012, 0.025), heat_viscous=-rng.uniform(0.01, 0.03))
    return replace(case, heating=rng.uniform(12, 25), seconds=(120.0, 60.0))


def warm_up(rng, case):
    case = _with(case, _hidden('warm_up', 'time', warm_up=0.0),
                 sensors={'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 warm_up=rng.uniform(0.35, 0.7), warm_up_time=rng.uniform(15, 35))
    return replace(case, seconds=(120.0, 90.0))


def presliding(rng, case):
    return _with(case, _hidden('presliding', 'history', slip=2e-4),
                 motions=_pick(rng, ('slow_sine', 'joystick', 'multi_sine')),
                 slip=case.half_range * rng.uniform(0.05, 0.12))


def lag(rng, case):
    late = rng.uniform(0.012, 0.035)
    how = {'delay': late} if rng.random() < 0.5 else {'low_pass': late}
    return _with(case, _hidden('lag', 'history', delay=0.0, low_pass=0.0),
                 motions=_pick(rng, ('multi_sine', 'joystick')),
                 sensors={'step': min(case.fit_sensors.step, 0.008), 'stamps_jitter': False},
                 inertia=3 * case.joint.inertia, **how)


def rest(rng, case):
    return _with(case, _hidden('rest', 'history', rest=0.0),
                 motions=_pick(rng, ('joystick', 'production')),
                 rest=case.joint.coulomb * rng.uniform(0.8, 1.6), rest_time=rng.uniform(0.3, 1.0))


def other_joints(rng, case):
    """A planar arm with two or three joints that all move; this is one that feels the rest."""
    count = int(rng.integers(2, 4))
    number = int(rng.integers(0, count - 1))
    chain = Chain(rng.uniform(1.0, 4.0, count), rng.uniform(0.2, 0.4, count),
                  rng.uniform(0.08, 0.2, count), rng.uniform(0.005, 0.03, count),
                  float(rng.choice([9.81, 9.81, 0.0])))
    constant = 3.0 / case.joint.coulomb
    heavy = np.sum(chain.mass[number:]) * 0.12 / constant + case.joint.inertia
    controller = replace_gains(rng, case, heavy)._replace(
        torque_per_current=constant, gravity=0.0)
    return replace(case, chain=chain, number=number, controller=controller, files=True,
                   hidden=(Hidden('other_joints', frozenset({'other joints'}), None),),
                   allowed=frozenset({'acceleration', 'position', 'other joints'}),
                   forbidden=frozenset({'bump', 'hysteresis', 'spring'}))


def replace_gains(rng, case, mass):
    """Return a controller for another inertia."""
    return _controller(rng, case.joint, case.joint.coulomb, pull=1.0, mass=mass)


def controller_as_friction(rng, case):
    """Held at constant speeds by a proportional speed controller, whose law the current is."""
    gain = case.joint.coulomb / case.top_speed * rng.uniform(4, 12)
    controller = Controller(derivative=gain, latency=2, quantum=2e-5, speed_filter=1e-3)
    sensors = replace(case.fit_sensors, step=min(case.fit_sensors.step, 0.004), velocity='exact',
                      reference=bool(rng.random() < 0.5), noise=0.01 * case.joint.coulomb,
                      current_quantum=0.0)
    return replace(case, controller=controller, fit_sensors=sensors, asks=False,
                   motions=('staircase', 'staircase'),
                   warn=('controller', 'control loop', 'regulat'))


def product(rng, case):
    case = _with(case, _hidden('product', ('position', 'velocity'), product=0.0),
                 product=case.joint.coulomb * rng.uniform(0.7, 1.5)
                 / case.half_range / case.top_speed)
    return replace(case, unexplained=frozenset({'position', 'velocity'}))


def wandering_spot(rng, case):
    case = _with(case, Hidden('wandering_spot', frozenset({'position', 'time'}), None),
                 sensors={'pieces': 1}, dead_spot=case.joint.coulomb * rng.uniform(0.8, 1.5),
                 dead_spot_at=-0.6 * case.half_range,
                 dead_spot_speed=1.2 * case.half_range / case.seconds[0],
                 bump_width=0.15 * case.half_range)
    return replace(case, unexplained=frozenset({'position', 'time'}))


def sensor_ceiling(rng, case):
    case = replace(case, warn=('clip', 'saturat', 'limit', 'ceiling'))
    return replace(case, fit_sensors=replace(
        case.fit_sensors, current_ceiling=1.15 * case.joint.coulomb))


def backlash(rng, case):
    case = _with(case, Hidden('backlash', frozenset({'history', 'position'}), None),
                 play=case.half_range * rng.uniform(0.02, 0.06),
                 far_inertia=case.joint.inertia * rng.uniform(1.0, 2.0))
    return replace(case, unexplained=frozenset({'history', 'position', 'acceleration'}))


def friction_step(rng, case):
    case = _with(case, Hidden('friction_step', frozenset({'time'}), None), sensors={'pieces': 1},
                 step=case.joint.coulomb * rng.uniform(0.4, 0.8) * _sign(rng),
                 step_time=case.seconds[0] * rng.uniform(0.35, 0.65))
    return replace(case, unexplained=frozenset({'time'}), forbidden=frozenset({'warm_up'}))


def none(rng, case):
    return case


def few_samples(rng, case):
    """Five hundred samples of a drive with one effect that is easy to see."""
    case = (gravity, bump, asymmetry)[rng.integers(3)](rng, case)
    return replace(case, seconds=(6.0, 6.0), fit_sensors=replace(
        case.fit_sensors, step=0.012, gaps=0, pieces=1))


def coarse_encoder(rng, case):
    """Tens of distinct positions."""
    case = (gravity, spring, none)[rng.integers(3)](rng, case)
    return replace(case, warn=('encoder', 'resolution', 'distinct', 'coarse'),
                   fit_sensors=replace(case.fit_sensors, velocity='none',
                                       quantum=2 * case.half_range / rng.integers(28, 90)))


def hardly_varies(rng, case):
    """One speed, to and fro over one short way: little can be known, whatever is hidden."""
    case = (none, stribeck, temperature, viscous_shape)[rng.integers(4)](rng, case)
    hidden = tuple(replace(h, without=None) for h in case.hidden)
    return replace(case, half_range=0.3 * case.half_range, motions=('steady', 'joystick'),
                   seconds=(min(20.0, 14000 * case.fit_sensors.step),) * 2, hidden=(), asks=False,
                   allowed=frozenset({'acceleration'}).union(*(h.variables for h in hidden)),
                   warn=('speed', 'one ', 'vari', 'rang', 'cover'))


def one_direction(rng, case):
    """Constant speeds one way only: offset and Coulomb friction are one."""
    case = (none, stribeck, harmonic_family)[rng.integers(3)](rng, case)
    return replace(case, motions=('one_way', 'one_way'), warn=('direction', 'one way'))


def person_leads(rng, case):
    """A person moves the joint; the motor feeds part of friction forward; load recorded.

    An exercise of its own mixes in, or current would be the feed-forward law and nothing else.
    """
    case = load(rng, gravity(rng, case))
    constant = case.nominal[0] * case.nominal[1]
    stiff = 12 * case.joint.coulomb * constant / case.half_range
    controller = Controller(
        from_measured=0.6 * case.joint.coulomb, gravity=0.9, speed_filter=0.01,
        person=stiff, person_damping=0.15 * stiff * case.half_range / case.top_speed,
        torque_per_current=constant)
    return replace(case, controller=controller, load_torque=0.0,
                   open_loop=0.8 * case.joint.coulomb, motions=('joystick', 'multi_sine'))


def person_unseen(rng, case):
    """The same without a torque sensor: current is what was fed forward, nothing else."""
    case = person_leads(rng, case)
    return replace(case, hidden=(), allowed=frozenset({'position', 'load'}), open_loop=0.0,
                   forbidden=frozenset({'bump', 'hysteresis'}), asks=False,
                   warn=('load', 'controller', 'fed forward'),
                   fit_sensors=replace(case.fit_sensors, load=False))


def open_loop(rng, case):
    """Current follows a plan of its own and motion is what comes of it."""
    case = spring(rng, case)
    soft = replace_gains(rng, case, case.joint.inertia)
    return replace(case, open_loop=1.6 * case.joint.coulomb, controller=Controller(
        derivative=0.1 * soft.derivative, quantum=2e-5, gravity=0.0),
        motions=('slow_sine', 'multi_sine'))


_PAIRS = ((gravity, stribeck), (gravity, viscous_shape), (spring, cogging), (ripple, asymmetry),
          (bump, gravity), (harmonic_family, viscous_shape), (load, gravity), (load, bump),
          (lag, gravity), (presliding, gravity), (temperature, gravity), (rest, spring),
          (stribeck, temperature), (ripple, lag), (load_friction, asymmetry))


def pair(rng, case):
    for one in _PAIRS[rng.integers(len(_PAIRS))]:
        case = one(rng, case)
    return case


def through_files(rng, case):
    """Through rosbag2 folders, any one effect."""
    case = (gravity, bump, load, stribeck)[rng.integers(4)](rng, case)
    return replace(case, files=True)


OUTSIDE = (product, wandering_spot, sensor_ceiling, backlash, friction_step)
SPECIAL = (none, few_samples, coarse_encoder, hardly_varies, one_direction, person_leads,
           person_unseen, open_loop, controller_as_friction, other_joints, through_files)
SINGLE = (stribeck, asymmetry, viscous_shape, gravity, spring, cogging, ripple, harmonic_family,
          bump, load, torque_constant, load_friction, load_friction_unsensed, temperature,
          warm_up, presliding, lag, rest)
FAMILIES = {f.__name__: f for f in (*SINGLE, pair, *SPECIAL, *OUTSIDE)}


def draw(family, seed):
    """Return the `Case` of a family and a seed; even seeds are for tuning, odd ones are kept."""
    rng = generator('second world', family, seed)
    case = FAMILIES[family](rng, base(rng, family, seed))
    if case.fit_sensors.velocity == 'filtered':
        # The driver's own filter is a lag that is really in the recording.
        case = replace(case, allowed=case.allowed | {'history'})
    return replace(case, allowed=case.allowed.union(*(h.variables for h in case.hidden),
                                                    case.unexplained))


__all__ = ['Case', 'FAMILIES', 'Sensors', 'draw']
