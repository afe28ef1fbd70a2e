# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop: measure, ask the law, apply; and what is watched."""

import numpy as np

from friction_comp import CompensationLaw
from law_judge.model import REFERENCE_TEMPERATURE

NONE, KINETIC, TANH = 'none', 'kinetic', 'tanh'
YARDSTICKS = (KINETIC, TANH)
"""The printed kinetic law, and the two lines that everybody writes: beside every row of help."""
TANH_SPEED = 0.03   # rad/s


class Bare:
    """No compensation of friction; what carries the limb against gravity stays."""

    def __init__(self, gears):
        self._size = gears['gravity'] / gears['torque_per_current']
        self._phase = (gears['gravity_phase'] if 'gravity_phase' in gears.dtype.names
                       else np.zeros(len(gears)))

    def update(self, time, position, velocity, direction, temperature=None, load=None):
        """Return the currents, A, shape (J,)."""
        return self._size * np.cos(position - self._phase)


class Tanh(Bare):
    """Nine tenths of Coulomb friction times tanh of the velocity that the drive reports."""

    def __init__(self, joints):
        super().__init__(joints.gears)
        self._coulomb = np.array([0.5 * (model.sigmoid.upper - model.sigmoid.lower)
                                  for model in joints.models])

    def update(self, time, position, velocity, direction, temperature=None, load=None):
        """Return the currents, A, shape (J,)."""
        carried = super().update(time, position, velocity, direction)
        return 0.9 * self._coulomb * np.tanh(velocity / TANH_SPEED) + carried


def make_law(name, joints, sample_time=1e-3):
    """Return the law under test for an experiment: one of CompensationLaw's, 'none' or 'tanh'."""
    if name == NONE:
        return Bare(joints.gears)
    if name == TANH:
        return Tanh(joints)
    return CompensationLaw(joints.models, law=name, sample_time=sample_time)


def run(plant, law, seconds, direction, watch, every=1, corrupt=None, knock=None,
        hold=1):
    """Run the closed loop and return what was watched.

    `law`: object with ``update``. `direction`: ``direction(time)`` gives what the planner
    announces, shape (J,), and may have ``is_pushed``, where a sensor feels the push. `watch`: dict
    of str to str; name in the result and field of the plant's state, or 'command'. `every`: samples
    from one record to the next. `corrupt`: callable, optional; ``corrupt(k, time, position,
    velocity)`` gives what the law gets to see of sample k,
    or None where it sees nothing. `knock`: tuple of float and ndarray, optional; when, s, and by
    how much every joint's speed changes, rad/s. `hold`: samples of the plant for which each
    current of the law is applied. Returns arrays of shape (N, J) by name, and ``raised``:
    how often the law raised an exception; zero current then.
    """
    samples = round(seconds / plant.sample_time)
    joints = len(plant.gears)
    records = {name: np.empty((samples // every, joints), dtype=np.float32 if every == 1 else float)
               for name in watch}
    warm = bool(np.any(plant.gears['heating'] != 0.0))
    command, raised = np.zeros(joints), 0
    for k in range(samples):
        if knock is not None and k == round(knock[0] / plant.sample_time):
            plant.knock(knock[1])
        position, velocity = plant.sample()
        seen = plant.time, position, velocity
        if corrupt is not None:
            seen = corrupt(k, *seen)
        if seen is not None and k % hold == 0:
            extra = {'load': plant.states['person'].copy()}
            if warm:
                extra['temperature'] = REFERENCE_TEMPERATURE + plant.states['temperature']
            announced_now = direction(plant.time)
            if hasattr(direction, 'is_pushed'):
                extra['is_pushed'] = direction.is_pushed
            try:
                command = np.array(law.update(*seen, announced_now, **extra), dtype=float)
            except Exception:
                if corrupt is None:
                    raise
                raised += 1
                command = np.zeros(joints)
        plant.advance(command)
        if (k + 1) % every == 0:
            for name, field in watch.items():
                row = command if field == 'command' else plant.states[field]
                records[name][k // every] = row
    return {**records, 'raised': raised}


def announced(values, at=0.0):
    """Return a direction of joints that is 0 until a time."""
    values = np.asarray(values, dtype=np.int64)
    nothing = np.zeros_like(values)
    return lambda time: values if time >= at else nothing
