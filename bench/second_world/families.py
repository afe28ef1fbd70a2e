# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Random drives, one family for each kind of case, drawn by seed."""

from dataclasses import replace

import numpy as np

from second_world import single_effects as simple
from second_world.cases import generator, Hidden
from world.arm import Chain
from world.drive import Controller


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
    return simple.controller(rng, case.joint, case.joint.coulomb, pull=1.0, mass=mass)


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
    case = simple.with_(case, simple.hidden_effect(
        'product', ('position', 'velocity'), product=0.0),
        product=case.joint.coulomb * rng.uniform(0.7, 1.5)
        / case.half_range / case.top_speed)
    return replace(case, unexplained=frozenset({'position', 'velocity'}))


def wandering_spot(rng, case):
    case = simple.with_(case, Hidden('wandering_spot', frozenset({'position', 'time'}), None),
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
    case = simple.with_(case, Hidden('backlash', frozenset({'history', 'position'}), None),
        play=case.half_range * rng.uniform(0.02, 0.06),
        far_inertia=case.joint.inertia * rng.uniform(1.0, 2.0))
    return replace(case, unexplained=frozenset({'history', 'position', 'acceleration'}))


def friction_step(rng, case):
    case = simple.with_(case, Hidden('friction_step', frozenset({'time'}), None),
        sensors={'pieces': 1},
        step=case.joint.coulomb * rng.uniform(0.4, 0.8) * rng.choice([-1.0, 1.0]),
        step_time=case.seconds[0] * rng.uniform(0.35, 0.65))
    return replace(case, unexplained=frozenset({'time'}), forbidden=frozenset({'warm_up'}))


def none(rng, case):
    return case


def few_samples(rng, case):
    """Five hundred samples of a drive with one effect that is easy to see."""
    case = (simple.gravity, simple.bump, simple.asymmetry)[rng.integers(3)](rng, case)
    return replace(case, seconds=(6.0, 6.0), fit_sensors=replace(
        case.fit_sensors, step=0.012, gaps=0, pieces=1))


def coarse_encoder(rng, case):
    """Tens of distinct positions."""
    case = (simple.gravity, simple.spring, none)[rng.integers(3)](rng, case)
    return replace(case, warn=('encoder', 'resolution', 'distinct', 'coarse'),
                   fit_sensors=replace(case.fit_sensors, velocity='none',
                                       quantum=2 * case.half_range / rng.integers(28, 90)))


def hardly_varies(rng, case):
    """One speed, to and fro over one short way: little can be known, whatever is hidden."""
    case = (none, simple.stribeck, simple.temperature,
            simple.viscous_shape)[rng.integers(4)](rng, case)
    hidden = tuple(replace(h, without=None) for h in case.hidden)
    return replace(case, half_range=0.3 * case.half_range, motions=('steady', 'joystick'),
                   seconds=(min(20.0, 14000 * case.fit_sensors.step),) * 2, hidden=(), asks=False,
                   allowed=frozenset({'acceleration'}).union(*(h.variables for h in hidden)),
                   warn=('speed', 'one ', 'vari', 'rang', 'cover'))


def one_direction(rng, case):
    """Constant speeds one way only: offset and Coulomb friction are simple."""
    case = (none, simple.stribeck, simple.harmonic_family)[rng.integers(3)](rng, case)
    return replace(case, motions=('one_way', 'one_way'), warn=('direction', 'one way'))


def person_leads(rng, case):
    """A person moves the joint; the motor feeds part of friction forward; load recorded.

    An exercise of its own mixes in, or current would be the feed-forward law and nothing else.
    """
    case = simple.load(rng, simple.gravity(rng, case))
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
    case = simple.spring(rng, case)
    soft = replace_gains(rng, case, case.joint.inertia)
    return replace(case, open_loop=1.6 * case.joint.coulomb, controller=Controller(
        derivative=0.1 * soft.derivative, quantum=2e-5, gravity=0.0),
        motions=('slow_sine', 'multi_sine'))


_PAIRS = ('gravity stribeck', 'gravity viscous_shape', 'spring cogging', 'ripple asymmetry',
          'bump gravity', 'harmonic_family viscous_shape', 'load gravity', 'load bump',
          'lag gravity', 'presliding gravity', 'temperature gravity', 'rest spring',
          'stribeck temperature', 'ripple lag', 'load_friction asymmetry')


def pair(rng, case):
    for name in _PAIRS[rng.integers(len(_PAIRS))].split():
        case = simple.SINGLE[name](rng, case)
    return case


def through_files(rng, case):
    """Through rosbag2 folders, any one effect."""
    case = (simple.gravity, simple.bump, simple.load, simple.stribeck)[rng.integers(4)](rng, case)
    return replace(case, files=True)


OUTSIDE = (product, wandering_spot, sensor_ceiling, backlash, friction_step)
SPECIAL = (none, few_samples, coarse_encoder, hardly_varies, one_direction, person_leads,
           person_unseen, open_loop, controller_as_friction, other_joints, through_files)
FAMILIES = {**simple.SINGLE, **{f.__name__: f for f in (pair, *SPECIAL, *OUTSIDE)}}


def draw(family, seed):
    """Return the `Case` of a family and a seed; even seeds are for tuning, odd ones are kept."""
    rng = generator('second world', family, seed)
    case = FAMILIES[family](rng, simple.base(rng, family, seed))
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
