# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Cases: a joint with hidden effects, how it is moved and recorded, and what may be said.

A plain drive is drawn by seed; each family adds what is hidden in it, or makes it hard to see.
"""

from dataclasses import dataclass, replace
import zlib

import numpy as np

from world.joint import Controller, DT, Joint, simulate
from world.motion import KINDS
from world.sensing import record, Sensors

_STEPS = (0.0005, 0.001, 0.001, 0.002, 0.004, 0.005, 0.008, 0.01, 0.01, 0.013, 0.02)
_DYNAMIC = ('multi_sine', 'joystick', 'production')
# Of a plain drive: what an effect changes of these stays in the joint without the effect.
_PLAIN = {'inertia', 'coulomb', 'viscous', 'offset'}


@dataclass(frozen=True)
class Hidden:
    """An effect of the truth: which variables name it rightly, and the joint without it."""

    name: str
    variables: frozenset
    without: dict | None  # fields of `Joint`; None: never judged by how much it shows


@dataclass(frozen=True)
class Case:
    """Everything that makes recordings and judges what is said about them."""

    family: str
    seed: int
    joint: Joint
    controller: Controller
    half_range: float  # rad
    top_speed: float  # rad/s
    motions: tuple  # kinds for fit and for score
    seconds: tuple
    fit_sensors: Sensors  # of both recordings
    hidden: tuple = ()
    allowed: frozenset = frozenset({'acceleration'})  # no false names though not asked for
    # Names of effects that are wrong here though their variable might pass.
    forbidden: frozenset = frozenset()
    # Of what no library effect describes; one must be named, as effect or residual.
    unexplained: frozenset = frozenset()
    warn: tuple = ()  # one of these word stems must stand in a warning
    load_torque: float = 0.0  # N.m from outside, in both recordings
    heating: float = 0.0  # K of warming, in both recordings
    open_loop: float = 0.0
    nominal: tuple = (0.1, 100.0)  # k_t in N.m/A and n as the user believes them to be
    asks: bool = True  # False where too little can be known to ask for anything


def generator(*keys):
    """Return a random generator of its own for any words and numbers."""
    return np.random.default_rng([k if isinstance(k, int) else zlib.crc32(k.encode())
                                  for k in keys])


def slow_waves(rng, size, fastest):
    """Return a random signal of RMS 1, shape (size,), with waves up to `fastest` Hz."""
    t = np.arange(size) * DT
    out = sum(rng.normal() * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
              for f in rng.uniform(0.05, fastest, 7))
    return out / np.sqrt(np.mean(out ** 2))


def make(case, part):
    """Return the trace and what is seen of it, for part 'fit' or 'score'."""
    which = ('fit', 'score').index(part)
    rng = generator(case.family, case.seed, part)
    seconds = case.seconds[which]
    reference = KINDS[case.motions[which]](rng, seconds, case.half_range, case.top_speed)
    size = len(reference)
    load = case.load_torque * slow_waves(rng, size, 1.5) if case.load_torque else None
    heat = None
    if case.heating:
        t, start = np.arange(size) * DT, (0.0, 0.4 * case.heating)[which]
        heat = start + (case.heating - start) * (1 - np.exp(-t / (0.4 * seconds)))
    open_loop = case.open_loop * slow_waves(rng, size, 1.0) if case.open_loop else None
    trace = simulate(case.joint, case.controller, reference, open_loop, load, heat)
    return trace, record(rng, case.fit_sensors, trace)


# A plain drive, and what can be hidden in it.

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
    return Case(family, seed, joint, controller(rng, joint), half, top, motions,
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


def controller(rng, joint, limited=True):
    mass, coulomb = joint.inertia, joint.coulomb
    rate = 2 * np.pi * rng.uniform(1.5, 4.5)
    kind = rng.choice(['pd', 'cascade', 'feed forward'])
    good = {'pd': 0.0, 'cascade': 0.3, 'feed forward': 0.9}[kind]
    return Controller(
        proportional=mass * rate ** 2, derivative=1.6 * mass * rate,
        integral=0.0 if kind == 'pd' else 0.25 * mass * rate ** 3,
        inertia=good * mass * rng.uniform(0.8, 1.2), friction=good * coulomb,
        viscous=good * joint.viscous, gravity=max(good, 0.5),
        limit=float(rng.choice([1e9, 1e9, 6.0])) * coulomb if limited else 1e9,
        latency=int(rng.choice([0, 1, 3])), quantum=2e-5)


def with_(case, name, variables, motions=None, sensors=None, judged=True, **changes):
    """Return the case with an effect more: other fields of its joint.

    Where it is `judged` by how much it shows, the joint without it has these fields as they are by
    default.
    """
    without = {field: Joint._field_defaults[field] for field in changes if field not in _PLAIN}
    hidden = Hidden(name, frozenset((variables,) if isinstance(variables, str) else variables),
                    without if judged else None)
    case = replace(case, joint=case.joint._replace(**changes), hidden=(*case.hidden, hidden))
    if motions:
        case = replace(case, motions=motions)
    if sensors:
        case = replace(case, fit_sensors=replace(case.fit_sensors, **sensors))
    return case


def pick(rng, kinds):
    return tuple(str(k) for k in rng.choice(kinds, 2, replace=False))


def stribeck(rng, case):
    return with_(case, 'stribeck', 'velocity',
                 motions=pick(rng, ('joystick', 'staircase', 'slow_sine')),
                 stribeck=rng.uniform(0.4, 1.2),
                 stribeck_speed=case.top_speed * _log(rng, 0.04, 0.12))


def asymmetry(rng, case):
    return with_(case, 'asymmetry', 'direction',
                 viscous=case.joint.coulomb * rng.uniform(0.8, 1.6) / case.top_speed,
                 asymmetry=_sign(rng) * rng.uniform(0.35, 0.7))


def viscous_shape(rng, case):
    power = rng.uniform(0.5, 0.65) if rng.random() < 0.5 else rng.uniform(1.7, 2.3)
    return with_(case, 'viscous_shape', 'velocity',
                 viscous=case.joint.coulomb * rng.uniform(1.5, 3.0) / case.top_speed,
                 power=power, power_speed=0.5 * case.top_speed)


def gravity(rng, case):
    case = with_(case, 'gravity', 'position', gravity=case.joint.coulomb * rng.uniform(0.7, 4.0),
                 gravity_phase=rng.uniform(-np.pi, np.pi))
    return replace(case, forbidden=case.forbidden | {'bump', 'hysteresis'})


def spring(rng, case):
    return with_(case, 'spring', 'position',
                 spring=case.joint.coulomb * rng.uniform(0.5, 2.0) / case.half_range,
                 spring_centre=case.half_range * rng.uniform(-0.3, 0.3))


def _order(rng, case, top_factor=1.0):
    """Return waves a turn that the range holds and the sampling rate can follow."""
    low = 2.0 * np.pi / case.half_range
    high = 0.2 / case.fit_sensors.step * 2 * np.pi / case.top_speed / top_factor
    return int(max(np.ceil(min(_log(rng, low, max(min(high, 220), 1.5 * low)), high)), 3))


def cogging(rng, case):
    return with_(case, 'cogging', 'position', cogging=np.array([[
        _order(rng, case), case.joint.coulomb * rng.uniform(0.2, 0.5), rng.uniform(0, 6.28)]]))


def ripple(rng, case):
    return with_(case, 'ripple', 'position', ripple=np.array([[
        _order(rng, case), rng.uniform(0.2, 0.5), rng.uniform(0, 6.28)]]))


def bump(rng, case):
    return with_(case, 'bump', 'position', bump=case.joint.coulomb * rng.uniform(0.6, 1.5),
                 bump_at=case.half_range * rng.uniform(-0.5, 0.5),
                 bump_width=case.half_range * rng.uniform(0.08, 0.25))


def load(rng, case):
    constant = case.nominal[0] * case.nominal[1]
    case = with_(case, 'load', 'load', sensors={'load': True}, load_gain=-1.0 / constant)
    return replace(case, load_torque=constant * case.joint.coulomb * rng.uniform(0.5, 1.5))


def load_friction(rng, case):
    case = load(rng, case)
    return with_(case, 'load_friction', 'load',
                 load_friction=-case.joint.load_gain * rng.uniform(0.2, 0.5))


def load_friction_unsensed(rng, case):
    case = gravity(rng, case)
    heavy = case.joint._replace(gravity=case.joint.coulomb * rng.uniform(2.0, 6.0))
    case = with_(replace(case, joint=heavy), 'gravity_friction', 'load',
                 gravity_friction=rng.uniform(0.15, 0.4))
    return replace(case, half_range=max(case.half_range, 1.0),
                   top_speed=max(case.top_speed, 1.0))


def temperature(rng, case):
    case = with_(case, 'temperature', 'temperature',
                 sensors={'heat': True, 'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 heat_coulomb=-rng.uniform(0.012, 0.025), heat_viscous=-rng.uniform(0.01, 0.03))
    return replace(case, heating=rng.uniform(12, 25), seconds=(120.0, 60.0))


def warm_up(rng, case):
    case = with_(case, 'warm_up', 'time',
                 sensors={'pieces': 1, 'step': max(case.fit_sensors.step, 0.01)},
                 warm_up=rng.uniform(0.35, 0.7), warm_up_time=rng.uniform(15, 35))
    return replace(case, seconds=(120.0, 90.0))


def presliding(rng, case):
    return with_(case, 'presliding', 'history',
                 motions=pick(rng, ('slow_sine', 'joystick', 'multi_sine')),
                 slip=case.half_range * rng.uniform(0.05, 0.12))


def lag(rng, case):
    late = rng.uniform(0.012, 0.035)
    how = {'delay': late} if rng.random() < 0.5 else {'low_pass': late}
    return with_(case, 'lag', 'history', motions=pick(rng, ('multi_sine', 'joystick')),
                 sensors={'step': min(case.fit_sensors.step, 0.008), 'stamps_jitter': False},
                 inertia=3 * case.joint.inertia, **how)


def rest(rng, case):
    return with_(case, 'rest', 'history', motions=pick(rng, ('joystick', 'production')),
                 rest=case.joint.coulomb * rng.uniform(0.8, 1.6), rest_time=rng.uniform(0.3, 1.0))


SINGLE = {f.__name__: f for f in (
    stribeck, asymmetry, viscous_shape, gravity, spring, cogging, ripple, bump, load, load_friction,
    load_friction_unsensed, temperature, warm_up, presliding, lag, rest)}


# Other families.

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
    case = with_(case, 'product', ('position', 'velocity'), product=(
        case.joint.coulomb * rng.uniform(0.7, 1.5) / case.half_range / case.top_speed))
    return replace(case, unexplained=frozenset({'position', 'velocity'}))


def wandering_spot(rng, case):
    case = with_(
        case, 'wandering_spot', ('position', 'time'), sensors={'pieces': 1}, judged=False,
        dead_spot=case.joint.coulomb * rng.uniform(0.8, 1.5), dead_spot_at=-0.6 * case.half_range,
        dead_spot_speed=1.2 * case.half_range / case.seconds[0], bump_width=0.15 * case.half_range)
    return replace(case, unexplained=frozenset({'position', 'time'}))


def sensor_ceiling(rng, case):
    case = replace(case, warn=('clip', 'saturat', 'limit', 'ceiling'))
    return replace(case, fit_sensors=replace(
        case.fit_sensors, current_ceiling=1.15 * case.joint.coulomb))


def backlash(rng, case):
    case = with_(case, 'backlash', ('history', 'position'), judged=False,
                 play=case.half_range * rng.uniform(0.02, 0.06),
                 far_inertia=case.joint.inertia * rng.uniform(1.0, 2.0))
    return replace(case, unexplained=frozenset({'history', 'position', 'acceleration'}))


def friction_step(rng, case):
    case = with_(
        case, 'friction_step', 'time', sensors={'pieces': 1}, judged=False,
        step=case.joint.coulomb * rng.uniform(0.4, 0.8) * rng.choice([-1.0, 1.0]),
        step_time=case.seconds[0] * rng.uniform(0.35, 0.65))
    return replace(case, unexplained=frozenset({'time'}), forbidden=frozenset({'warm_up'}))


def none(rng, case):
    return case


def coarse_encoder(rng, case):
    """Tens of distinct positions."""
    case = (gravity, spring, none)[rng.integers(3)](rng, case)
    return replace(case, warn=('encoder', 'resolution', 'distinct', 'coarse'),
                   fit_sensors=replace(case.fit_sensors, velocity='none',
                                       quantum=2 * case.half_range / rng.integers(28, 90)))


def hardly_varies(rng, case):
    """One speed, to and fro over one short way: little can be known, whatever is hidden."""
    case = (none, stribeck, temperature,
            viscous_shape)[rng.integers(4)](rng, case)
    hidden = tuple(replace(h, without=None) for h in case.hidden)
    return replace(case, half_range=0.3 * case.half_range, motions=('steady', 'joystick'),
                   seconds=(min(20.0, 14000 * case.fit_sensors.step),) * 2, hidden=(), asks=False,
                   allowed=frozenset({'acceleration'}).union(*(h.variables for h in hidden)),
                   warn=('speed', 'one ', 'vari', 'rang', 'cover'))


def one_direction(rng, case):
    """Constant speeds one way only: offset and Coulomb friction are """
    case = (none, stribeck)[rng.integers(2)](rng, case)
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
        person=stiff, person_damping=0.15 * stiff * case.half_range / case.top_speed)
    return replace(case, controller=controller, load_torque=0.0,
                   open_loop=0.8 * case.joint.coulomb, motions=('joystick', 'multi_sine'))


def person_unseen(rng, case):
    """The same without a torque sensor: current is what was fed forward, nothing else."""
    case = person_leads(rng, case)
    return replace(case, hidden=(), allowed=frozenset({'position', 'load'}), open_loop=0.0,
                   forbidden=frozenset({'bump', 'hysteresis'}), asks=False,
                   warn=('load', 'controller', 'fed forward'),
                   fit_sensors=replace(case.fit_sensors, load=False))


_PAIRS = ('gravity stribeck', 'gravity viscous_shape', 'spring cogging', 'ripple asymmetry',
          'bump gravity', 'load gravity', 'load bump',
          'lag gravity', 'presliding gravity', 'temperature gravity', 'rest spring',
          'stribeck temperature', 'ripple lag', 'load_friction asymmetry')


def pair(rng, case):
    for name in _PAIRS[rng.integers(len(_PAIRS))].split():
        case = SINGLE[name](rng, case)
    return case


OUTSIDE = (product, wandering_spot, sensor_ceiling, backlash, friction_step)
SPECIAL = (none, coarse_encoder, hardly_varies, one_direction, person_leads, person_unseen,
           controller_as_friction)
FAMILIES = {**SINGLE, **{f.__name__: f for f in (pair, *SPECIAL, *OUTSIDE)}}


def draw(family, seed):
    """Return the `Case` of a family and a seed; even seeds are for tuning, odd ones are kept."""
    rng = generator('second world', family, seed)
    case = FAMILIES[family](rng, base(rng, family, seed))
    known = {h.name for h in case.hidden}
    allowed, forbidden = set(case.allowed), set(case.forbidden)
    of_memory = {'hysteresis': 'presliding', 'rest_time': 'rest', 'actuation_lag': 'lag'}
    truly = {name for name, hidden in of_memory.items() if hidden in known}
    if case.fit_sensors.velocity == 'filtered':
        truly.add('actuation_lag')  # the driver's own filter is really in the recording
    if case.fit_sensors.quantum < 2 * case.joint.slip or 'backlash' in known:
        truly.add('hysteresis')  # such an encoder sees that dry friction sets in over a way
    if truly:
        allowed.add('history')
        forbidden.update(set(of_memory) - truly)
        forbidden -= truly
    if case.joint.offset or case.joint.spring:
        # An offset is what one direction needs more than the other.
        allowed.add('direction')
    return replace(case, forbidden=frozenset(forbidden), allowed=frozenset(allowed).union(
        *(h.variables for h in case.hidden), case.unexplained))
