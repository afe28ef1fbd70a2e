# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Followers under a soft MIT-mode controller on slow references: lag, stairs, and rest."""

import numpy as np

from cheap_sensors.mit_drive import MitDrive, PERIOD, POSITION_STEP
from friction_comp import CompensationLaw
from friction_comp.direction.desired_motion import DesiredMotion
from law_judge.bank import Bank, Joints
from law_judge.model import true_models
from world.person import nobody

SPEEDS = (0.01, 0.02, 0.05, 0.1, 0.2)
FIRST, RAMP, REST = 1.0, 6.0, 2.0
# Stiffness of the controllers: friction holds a bare joint about 30 mrad away; damping, s.
LAG, DAMPING = 0.03, 0.04
WAYS = ('without', 'ours', '0.9·tanh of the measured speed', '0.9·tanh of the desired speed')
STEEPNESS = 0.02  # rad/s at which the hyperbolic tangent bends


def follower_bank(world, draws, seed):
    """Return a bank of gears whose encoders have the steps of an MIT-mode drive."""
    kinds, gears = [], []
    for kind in world.KINDS:
        drawn = world.draw_gears(kind, draws, seed)
        drawn['resolution'] = POSITION_STEP
        kinds += [kind] * draws
        gears.append(drawn)
    gears = np.concatenate(gears)
    return Bank(world, kinds, gears, true_models(world, gears, seed, 12), seed)


def reference(time, speed):
    """Return desired position and speed: out, a rest, back, a rest."""
    t = time - FIRST
    if t < 0.0:
        return 0.0 * speed, 0.0 * speed
    if t < RAMP:
        return speed * t, speed
    if t < RAMP + REST:
        return speed * RAMP, 0.0 * speed
    if t < 2.0 * RAMP + REST:
        return speed * (2.0 * RAMP + REST - t), -speed
    return 0.0 * speed, 0.0 * speed


def follow(bank, way, factor=1.0):
    """Return what became of each gear at each speed.

    Returns arrays of shape (G, S) by name: ``rms``, rad, while the reference moves;
    ``stairs``, rad, from the lowest to the highest error of the second half of a ramp; ``moves``,
    rad, by which the joint moves in the last second of the rests; ``turns`` of the command's sign
    in them.
    """
    joints = Joints(bank, speed=SPEEDS, factor=[factor])
    plant = joints.plant(nobody(len(joints)))
    torque_per, speed = joints.gears['torque_per_current'], joints['speed']
    kp = joints.torque / LAG
    drive = MitDrive(kp, DAMPING * kp, 5.0 * joints.torque)
    law = CompensationLaw(joints.models, 'desired', sample_time=PERIOD)
    leaders = [DesiredMotion() for _ in speed]
    coulomb = np.array([model.sigmoid.upper for model in joints.models]) * torque_per
    every = round(PERIOD / plant.sample_time)
    samples = round((FIRST + 2.0 * (RAMP + REST)) / plant.sample_time)
    errors, added, place = [], [], []
    for k in range(samples):
        position, velocity = plant.sample()
        time = k * plant.sample_time
        wanted, pace = reference(time, speed)
        if k % every == 0:
            seen, seen_velocity = drive.reported(position, velocity)
            extra = np.zeros(len(speed))
            if way == 'ours':
                if k % (5 * every) == 0:
                    said = []
                    for leader, q, where in zip(leaders, wanted.tolist(), seen.tolist()):
                        leader.motion.add(time, where)
                        leader.take(time, q)
                        said.append(leader.at(time, where).direction)
                    direction = np.array(said)
                extra = law.update(time, seen, None, direction) * torque_per
            elif way == WAYS[2]:
                extra = 0.9 * coulomb * np.tanh(seen_velocity / STEEPNESS)
            elif way == WAYS[3]:
                extra = 0.9 * coulomb * np.tanh(pace / STEEPNESS)
            drive.command(time, wanted, pace, extra)
            current = drive.torque(time, seen, seen_velocity) / torque_per
        plant.advance(current)
        if k % (5 * every) == 0:
            errors.append(wanted - plant.states['link'])
            added.append(extra)
            place.append(plant.states['link'].copy())
    time = np.arange(len(errors)) * 5 * every * plant.sample_time - FIRST
    errors, added, place = map(np.array, (errors, added, place))
    ramps = [(time >= begin) & (time < begin + RAMP) for begin in (0.0, RAMP + REST)]
    halves = [(time >= begin + 0.5 * RAMP) & (time < begin + RAMP) for begin in (0.0, RAMP + REST)]
    rests = [(time >= end - 1.0) & (time < end) for end in (RAMP + REST, 2.0 * (RAMP + REST))]
    shape = len(bank.gears), len(SPEEDS)
    return {
        'rms': np.sqrt(np.mean(errors[ramps[0] | ramps[1]]**2, axis=0)).reshape(shape),
        'stairs': np.max([np.ptp(errors[half], axis=0) for half in halves], axis=0).reshape(shape),
        'moves': np.max([np.ptp(place[rest], axis=0) for rest in rests], axis=0).reshape(shape),
        'turns': np.sum([(np.diff(np.sign(added[rest]), axis=0) != 0).sum(axis=0)
                         for rest in rests], axis=0).reshape(shape)}
