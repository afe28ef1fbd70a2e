# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Attempts to move a joint that is held, and hours at rest: onsets found, missed, wrong, late."""

import math

import numpy as np

from friction_comp.direction.force_sensor import CALIBRATION_TIME, ForceDirection
from friction_comp.simulation.cheap_sensors import CheapForce

STEP = 1e-3
# s of rest before an attempt, of the attempt, and after it.
BEFORE, ATTEMPT, PAUSE = 0.5, 0.6, 1.0
RATES = (50.0, 100.0)


def rest_torque(random, joints, seconds):
    """Return torque at rest, as a share of breakaway, shape (N, J): tremor that waxes and wanes.

    Physiological to essential tremor, 5 to 11 Hz, up to 2 % of breakaway, with bursts over 1 to
    10 s.
    """
    time = np.arange(round(seconds / STEP)) * STEP
    size, frequency, slow, phase, other = (
        random.uniform(low, high, joints) for low, high in (
            (0.0, 0.02), (5.0, 11.0), (0.1, 1.0), (-math.pi, math.pi), (-math.pi, math.pi)))
    swell = 0.5 * (1.0 + np.sin(2.0 * np.pi * slow * time[:, None] + other))
    return size * swell * np.sin(2.0 * np.pi * frequency * time[:, None] + phase)


class Sensors:
    """Simulated sensors of J joints with the room's announcements for each of them."""

    def __init__(self, breakaway, seed, rate=100.0):
        self.plant = CheapForce(breakaway, seed, rate)
        self.sources = [ForceDirection(self.plant.range) for _ in breakaway]
        self.time = 0.0
        self.is_pushed = np.zeros(len(breakaway), dtype=bool)

    def play(self, torque, position=None):
        """Advance by N ms; return the directions every 10 ms, shape (N / 10, J).

        `is_pushed`, shape (J,), then says whether a push is felt beyond doubt.
        """
        length, joints = torque.shape
        values = self.plant.sample(torque)
        every, due = 1.0 / self.plant.rate, 0
        directions = np.zeros((length // 10, joints), dtype=int)
        for k in range(length // 10):
            self.time += 10.0 * STEP
            upto = min(len(values), round((k + 1) * 10.0 * STEP / every))
            for j, source in enumerate(self.sources):
                source.motion.add(self.time, 0.0 if position is None else float(position[k, j]))
                fresh = values[due:upto, j]
                if len(fresh) and np.isfinite(fresh).all():
                    source.add(self.time, fresh)
                said = source.at(self.time)
                directions[k, j], self.is_pushed[j] = said.direction, said.is_pushed
            due = upto
        return directions

    def calibrate(self, torque):
        """Calibrate at rest with torques at rest, shape (N, J), N·m."""
        begin = round(0.5 / STEP)
        self.play(torque[:begin])
        for source in self.sources:
            source.begin_calibration()
        self.play(torque[begin:begin + round((CALIBRATION_TIME + 0.1) / STEP)])
        for source in self.sources:
            assert not source.failure, source.failure


def attempts(joints, each, seed):
    """Return delays, misses and wrong directions of attempts against a joint that is held.

    The torque grows at 0.5 to 5 times breakaway per second, to 0.3 to 1 times breakaway.
    """
    delays, wrong, missed = [], 0, 0
    for sensors, side, _, torque in pushes(joints, each, seed):
        found = sensors.play(torque)
        at = (np.arange(len(found)) + 1) * 10.0 * STEP - BEFORE
        during = found * ((at > 0.0) & (at < ATTEMPT))[:, None]
        first = np.argmax(during != 0, axis=0)
        said = during[first, np.arange(joints)]
        missed += int((said == 0).sum())
        wrong += int((said == -side).sum())
        delays += at[first[said == side]].tolist()
    return np.array(delays), missed, wrong


def pushes(joints, each, seed):
    """Yield sensors, sides, pushes and what the sensors get, N·m, shape (N, J), of each attempt."""
    random, breakaway, sensors = held_joints(joints, seed)
    time = np.arange(round((BEFORE + ATTEMPT + PAUSE) / STEP)) * STEP - BEFORE
    for _ in range(each):
        side = random.choice([-1.0, 1.0], joints)
        speed = np.exp(random.uniform(math.log(0.5), math.log(5.0), joints))
        most = random.uniform(0.3, 1.0, joints)
        push = np.minimum(most, speed * np.maximum(0.0, time[:, None])) * (time < ATTEMPT)[:, None]
        noise = rest_torque(random, joints, len(time) * STEP)
        yield sensors, side, push * breakaway, (noise + side * push) * breakaway


def held_joints(joints, seed):
    """Return a random generator, breakaway torques, N·m, and calibrated sensors of held joints."""
    random = np.random.default_rng([seed, 401])
    breakaway = np.exp(random.uniform(math.log(0.3), math.log(15.0), joints))
    sensors = Sensors(breakaway, [seed, 402], RATES[seed // 2 % 2])
    sensors.calibrate(rest_torque(random, joints, 4.0) * breakaway)
    return random, breakaway, sensors


def hours_at_rest(hours, joints, seed):
    """Return false onsets within some hours at rest, which some joints share."""
    random, breakaway, sensors = held_joints(joints, seed)
    false, before, chunk = 0, np.zeros((1, joints)), 10.0
    for _ in range(round(3600.0 * hours / joints / chunk)):
        found = sensors.play(rest_torque(random, joints, chunk) * breakaway)
        steps = np.concatenate([before, found])
        false += int(((steps[1:] != 0) & (steps[:-1] == 0)).sum())
        before = found[-1:]
    return false
