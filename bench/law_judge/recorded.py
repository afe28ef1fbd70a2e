# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Models of recordings: what `refine` makes of each gear without an identification.

A position controller moves each gear to and fro, as a robot does that follows a trajectory.
"""

import math

import numpy as np

from friction_comp import Drive, refine, Samples
from law_judge.bank import Bank
from world.person import nobody

# The recording: amplitude in rad, frequencies in Hz, seconds of each, and samples/s.
AMPLITUDE, FREQUENCIES, EACH, RATE = 0.25, (0.1, 0.2, 0.4, 0.3, 0.9), 12.0, 500
SECONDS = EACH * len(FREQUENCIES)
# The controller's bandwidth, rad/s, and damping.
BANDWIDTH, DAMPING = 25.0, 0.7


class RecordedBank(Bank):
    """A bank of models of recordings; see `recorded_bank`."""

    def seen_by(self, resolution):
        """Return a bank with other encoders, by which the gears are recorded again."""
        return recorded_bank(super().seen_by(resolution))[0]


def recorded_bank(bank):
    """Return the bank with the models that `refine` makes of recordings, and what they lack."""
    documents, said = [], []
    for g, (old, samples) in enumerate(zip(bank.documents, record(bank))):
        result = refine([samples], drive=Drive(**old['drive']))
        distance, _ = bank.world.presliding(bank.gears[g])
        shown = result.model.presliding
        said.append(f'{bank.kinds[g]} {g}: {result.report.verdict}, presliding ' + (
            f'{shown.distance / distance:.2f} ± {shown.std / distance:.2f}' if shown else 'unknown')
            + f' of {1e3 * distance:.2g} mrad')
        # The key without a value: `Bank.telling` keeps what is known, and what is not.
        documents.append({'presliding': None, **result.model.to_dict()})
    return RecordedBank(bank.world, bank.kinds, bank.gears, documents, bank.seed), said


def record(bank, reference=None, seconds=SECONDS, rate=RATE):
    """Return each gear's Samples of a movement under position control."""
    reference = reference or sines
    gears = bank.gears.copy()
    gears['gravity'] = 0.0      # held by the robot's own controller
    plant = bank.world.Plant(gears, nobody(len(gears)), bank.seed)
    per_torque = 1.0 / gears['torque_per_current']
    per_acceleration = (gears['motor_inertia'] + gears['link_inertia']) * per_torque
    most = 1.5 * bank.torque * per_torque
    start = plant.sample()[0].copy()
    last, speed, added = start.copy(), np.zeros(len(gears)), np.zeros(len(gears))
    kept, every = [], round(1000 / rate)
    for k in range(round(1e3 * seconds)):
        position = plant.sample()[0].copy()
        place, wanted, acceleration = reference(1e-3 * k)
        speed += 0.1 * ((position - last) / 1e-3 - speed)
        last, error = position, place - (position - start)
        gain = per_acceleration * BANDWIDTH ** 2
        added = np.clip(added + 1e-3 * BANDWIDTH * gain * error, -most, most)
        if k % every == 0:
            kept.append((1e-3 * k, position, plant.states['current'].copy()))
        plant.advance(gain * error + added + per_acceleration * (
            2.0 * DAMPING * BANDWIDTH * (wanted - speed) + acceleration))
    time = np.array([entry[0] for entry in kept])
    position, current = (np.array([entry[k] for entry in kept]).T for k in (1, 2))
    return [Samples(time=time, position=own, current=measured)
            for own, measured in zip(position, current)]


def sines(t):
    """Return position, velocity and acceleration of sines, each from rest at one end."""
    which = min(int(t / EACH), len(FREQUENCIES) - 1)
    w = 2.0 * math.pi * FREQUENCIES[which]
    # Each takes whole periods, and rests until the next.
    t = min(t - EACH * which, math.floor(EACH * FREQUENCIES[which]) / FREQUENCIES[which])
    return (AMPLITUDE * (1.0 - math.cos(w * t)), AMPLITUDE * w * math.sin(w * t),
            AMPLITUDE * w * w * math.cos(w * t))
