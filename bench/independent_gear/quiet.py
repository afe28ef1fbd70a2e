# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Vibration while a person holds the joint, starts, and moves slowly.

Vibration is what remains of the velocity above 8 Hz (4th-order Butterworth, forwards and
backwards), the larger of rotor's and link's (both at the joint), RMS over each part of the
movement. The simulated persons of this experiment have no tremor.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from independent_gear.bank import Joints
from independent_gear.loop import make_law, run
from independent_gear.persons import draw_persons, FIRM, SOFT
from independent_gear.plant import Plant
from independent_gear.rows import DEGREE, figure_row

BAND = 8.0
LIMIT = 0.2 * DEGREE
HELD, START, STOP, END = 0.8, 2.0, 5.5, 8.0
PARTS = {'hold': (HELD, START), 'start': (START, 3.0), 'motion': (3.0, STOP),
         'stop': (STOP, 6.5), 'hold again': (6.5, END - 0.3)}
# to and fro by this, deg, instead of slow motion: no direction can be announced for it
SWAY, SWAY_FREQUENCY = -5.0, 0.3
STEADY = ('hold', 'motion', 'hold again')


def quiet(bank, law, quick=False):
    """Let soft and firm persons hold, start and move slowly; return rows for each kind."""
    joints = Joints(bank, grip=[SOFT, FIRM], speed=[3.0, 10.0, SWAY],
                    # announced ahead, with the push, not at all
                    announce=[1.0, 3.0] if quick else [1.0, START, np.inf],
                    factor=[1.0] if quick else [1.0, 1.1])
    found = watch_vibration(joints, law)
    return [row for kind in dict.fromkeys(bank.kinds) for row in _rows(joints, found, kind, law)]


def watch_vibration(joints, law):
    """Return RMS vibration in rad/s, shape (J,), of each part of the movement."""
    seed = joints.bank.seed
    torque = joints.gears['static'] + joints.gears['link_coulomb']
    persons = draw_persons(joints['grip'], torque, seed)
    side = np.where(np.arange(len(joints)) % 2 == 0, 1.0, -1.0)
    persons['start'], persons['speed'] = START, side * joints['speed'] * DEGREE
    persons['acceleration_time'], persons['cruise_time'] = 0.5, STOP - START - 1.0
    sways = joints['speed'] == SWAY
    persons['sway'][sways] = 0.5 * SWAY * DEGREE
    persons['sway_frequency'] = SWAY_FREQUENCY
    plant = Plant(joints.gears, persons, seed)

    def direction(time):
        return side * ((joints['announce'] <= time) & (time < STOP) & ~sways)
    record = run(plant, make_law(law, joints), END, direction,
                 {'v': 'motor_velocity', 'w': 'link_velocity'})
    sos = butter(4, BAND, 'high', fs=1.0 / plant.sample_time, output='sos')
    parts = {name: np.zeros(len(joints)) for name in PARTS}
    for velocity in (record['v'], record['w']):
        rest = sosfiltfilt(sos, velocity, axis=0)
        for name, (first, last) in PARTS.items():
            part = rest[round(first / plant.sample_time):round(last / plant.sample_time)]
            parts[name] = np.maximum(parts[name], np.sqrt(np.mean(part**2, axis=0)))
    return parts


def _rows(joints, parts, kind, law):
    here = joints.kinds == kind
    exact = here & (joints['factor'] <= 1.0)
    steady = np.max([parts[name] for name in STEADY], axis=0)
    moving = np.max([parts['start'], parts['stop']], axis=0)
    # who sways does not hold, nor start or stop
    sways = joints['speed'] == SWAY
    moving = np.where(sways, 0.0, moving)
    steady = np.where(sways, np.maximum(parts['hold'], parts['motion']), steady)
    rows = []
    for name, values, who in (
            ('vibration, hold and slow motion', steady, exact),
            ('vibration, model 1.1 times', steady, here & (joints['factor'] > 1.0)),
            ('vibration, second of start or stop', moving, exact)):
        if not who.any():
            continue
        loud = int(np.sum(~(values[who] < LIMIT)))
        rows.append(figure_row(
            name, kind, law, np.max(values[who]) / DEGREE, loud == 0, '< 0.2', ' deg/s',
            loud=loud, joints=int(who.sum()), median=np.median(values[who]) / DEGREE,
            worst_by_part={p: np.max(v[who]).item() / DEGREE for p, v in parts.items()},
            soft=np.max(values[who & (joints['grip'] == SOFT)]) / DEGREE,
            sway=np.max(steady[here & sways]) / DEGREE,
            firm=np.max(values[who & (joints['grip'] == FIRM)]) / DEGREE))
    return rows
