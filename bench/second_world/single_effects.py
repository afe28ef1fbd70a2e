# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A plain drive drawn at random, and one function for each effect that can be hidden in it."""

from dataclasses import replace

import numpy as np

from second_world.cases import Case, Hidden
from world.drive import Controller
from world.joint import Joint
from world.sensing import Sensors

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
    motions = pick(rng, _DYNAMIC)
    return Case(family, seed, joint, controller(rng, joint, coulomb), half, top, motions,
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


def controller(rng, joint, coulomb, pull=None, mass=None):
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


def with_(case, hidden, motions=None, sensors=None, **changes):
    """Return the case with an effect more."""
    case = replace(case, joint=case.joint._replace(**changes), hidden=(*case.hidden, hidden))
    if motions:
        case = replace(case, motions=motions)
    if sensors:
        case = replace(case, fit_sensors=replace(case.fit_sensors, **sensors))
    return case


def pick(rng, kinds):
    return tuple(str(k) for k in rng.choice(kinds, 2, replace=False))


def hidden_effect(name, variable, **without):
    variables = frozenset((variable,) if isinstance(variable, str) else variable)
    return Hidden(name, variables, without)


def stribeck(rng, case):
    return with_(case, hidden_effect('stribeck', 'velocity', stribeck=0.0),
                 motions=pick(rng, ('joystick', 'staircase', 'slow_sine')),
                 stribeck=rng.uniform(0.4, 1.2), stribeck_speed=case.top_speed * _log(
                     rng, 0.04, 0.12))


def asymmetry(rng, case):
    return with_(case, hidden_effect('asymmetry', 'direction', asymmetry=0.0,
                                     asymmetry_coulomb=0.0),
                 viscous=case.joint.coulomb * rng.uniform(0.8, 1.6) / case.top_speed,
                 asymmetry=_sign(rng) * rng.uniform(0.35, 0.7))


def viscous_shape(rng, case):
    power = rng.uniform(0.5, 0.65) if rng.random() < 0.5 else rng.uniform(1.7, 2.3)
    return with_(case, hidden_effect('viscous_shape', 'velocity', power=1.0),
                 viscous=case.joint.coulomb * rng.uniform(1.5, 3.0) / case.top_speed,
                 power=power, power_speed=0.5 * case.top_speed)


def gravity(rng, case):
    case = with_(case, hidden_effect('gravity', 'position', gravity=0.0),
                 gravity=case.joint.coulomb * rng.uniform(0.7, 4.0),
                 gravity_phase=rng.uniform(-np.pi, np.pi))
    return replace(case, forbidden=case.forbidden | {'bump', 'hysteresis'})


def spring(rng, case):
    return with_(case, hidden_effect('spring', 'position', spring=0.0),
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
    return with_(case, hidden_effect('cogging', 'position', cogging=np.zeros((0, 3))),
                 cogging=waves)


def ripple(rng, case):
    waves = np.array([[_order(rng, case), rng.uniform(0.2, 0.5), rng.uniform(0, 6.28)]])
    return with_(case, hidden_effect('ripple', 'position', ripple=np.zeros((0, 3))), ripple=waves)


def harmonic_family(rng, case):
    order = min(_order(rng, case, 3.0), 30)
    strength = rng.uniform(0.25, 0.45)
    waves = np.array([[order * k, strength / k, rng.uniform(0, 6.28)] for k in (1, 2, 3)])
    field = 'cogging' if rng.random() < 0.5 else 'ripple'
    if field == 'cogging':
        waves[:, 1] *= case.joint.coulomb
    return with_(case, hidden_effect('harmonic_family', 'position', **{field: np.zeros((0, 3))}),
                 **{field: waves})


def bump(rng, case):
    return with_(case, hidden_effect('bump', 'position', bump=0.0),
                 bump=case.joint.coulomb * rng.uniform(0.6, 1.5),
                 bump_at=case.half_range * rng.uniform(-0.5, 0.5),
                 bump_width=case.half_range * rng.uniform(0.08, 0.25))


def load(rng, case):
    constant = case.nominal[0] * case.nominal[1]
    case = with_(case, hidden_effect('load', 'load', load_gain=0.0), sensors={'load': True},
                 load_gain=-1.0 / constant)
    return replace(case, load_torque=constant * case.joint.coulomb * rng.uniform(0.5, 1.5))


def torque_constant(rng, case):
    case = load(rng, case)
    return replace(case, nominal=(case.nominal[0] * rng.choice([0.8, 0.88, 1.14, 1.25]), 100.0))


def load_friction(rng, case):
    case = load(rng, case)
    return with_(case, hidden_effect('load_friction', 'load', load_friction=0.0),
                 load_friction=-case.joint.load_gain * rng.uniform(0.2, 0.5))


def load_friction_unsensed(rng, case):
    case = gravity(rng, case)
    case = with_(case, hidden_effect('gravity_friction', 'load', gravity_friction=0.0),
                 gravity=case.joint.coulomb * rng.uniform(2.0, 6.0),
                 gravity_friction=rng.uniform(0.15, 0.4))
    return replace(case, half_range=max(case.half_range, 1.0),
                   top_speed=max(case.top_speed, 1.0))


def temperature(rng, case):
    case = with_(case, hidden_effect('temperature', 'temperature', heat_coulomb=0.0,
                                     heat_viscous=0.0),
                 sensors={'heat': True, 'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 heat_coulomb=-rng.uniform(0.012, 0.025), heat_viscous=-rng.uniform(0.01, 0.03))
    return replace(case, heating=rng.uniform(12, 25), seconds=(120.0, 60.0))


def warm_up(rng, case):
    case = with_(case, hidden_effect('warm_up', 'time', warm_up=0.0),
                 sensors={'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 warm_up=rng.uniform(0.35, 0.7), warm_up_time=rng.uniform(15, 35))
    return replace(case, seconds=(120.0, 90.0))


def presliding(rng, case):
    return with_(case, hidden_effect('presliding', 'history', slip=2e-4),
                 motions=pick(rng, ('slow_sine', 'joystick', 'multi_sine')),
                 slip=case.half_range * rng.uniform(0.05, 0.12))


def lag(rng, case):
    late = rng.uniform(0.012, 0.035)
    how = {'delay': late} if rng.random() < 0.5 else {'low_pass': late}
    return with_(case, hidden_effect('lag', 'history', delay=0.0, low_pass=0.0),
                 motions=pick(rng, ('multi_sine', 'joystick')),
                 sensors={'step': min(case.fit_sensors.step, 0.008), 'stamps_jitter': False},
                 inertia=3 * case.joint.inertia, **how)


def rest(rng, case):
    return with_(case, hidden_effect('rest', 'history', rest=0.0),
                 motions=pick(rng, ('joystick', 'production')),
                 rest=case.joint.coulomb * rng.uniform(0.8, 1.6), rest_time=rng.uniform(0.3, 1.0))


SINGLE = {f.__name__: f for f in (
    stribeck, asymmetry, viscous_shape, gravity, spring, cogging, ripple, harmonic_family, bump,
    load, torque_constant, load_friction, load_friction_unsensed, temperature, warm_up, presliding,
    lag, rest)}
