# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop: measure, ask the law, apply; what is watched, and the rows made of it."""

from dataclasses import dataclass, field
import hashlib

import numpy as np
from scipy.signal import butter, sosfiltfilt

from friction_comp import CompensationLaw

NONE, KINETIC, TANH = 'none', 'kinetic', 'tanh'
YARDSTICKS = (TANH, KINETIC)
"""The two lines that everybody writes, and the printed kinetic law: beside every row of help."""
TANH_SPEED = 0.03   # rad/s
BAND = 20.0         # Hz
LEAST = 0.05        # share of friction in what the hand feels, from which on there is one to remove
# Folder of runs without the package's law, if they are to be kept from one process to the next.
KEPT = None


class Tanh:
    """Nine tenths of Coulomb friction times tanh of the velocity that the drive reports.

    Or nothing, with a `share` of 0.
    """

    def __init__(self, joints, share=0.9):
        self.coulomb = share * np.array([0.5 * (model.sigmoid.upper - model.sigmoid.lower)
                                          for model in joints.models])

    def update(self, time, position, velocity, direction, is_pushed=None):
        """Return the currents, A, shape (J,)."""
        return self.coulomb * np.tanh(velocity / TANH_SPEED)


def make_law(name, joints, sample_time=1e-3):
    """Return the law under test for an experiment: one of CompensationLaw's, 'none' or 'tanh'."""
    if name in (NONE, TANH):
        return Tanh(joints, 0.9 if name == TANH else 0.0)
    return CompensationLaw(joints.models, law=name, sample_time=sample_time)


def run(plant, law, seconds, direction, watch, every=1, knock=None, hold=1):
    """Run the closed loop and return what was watched, arrays of shape (N, J) by name.

    `direction`: ``direction(time)`` gives what the planner announces, shape (J,). `watch`: dict of
    str to str; name in the result and field of the plant's state. `every`: samples from one record
    to the next. `knock`: tuple of float and ndarray, optional; when, s, and by how much every
    joint's speed changes, rad/s. `hold`: samples of the plant for which each current is applied.
    """
    kept = None
    if KEPT and isinstance(law, Tanh):
        text = repr((type(plant).__module__, seconds, watch, every, knock, hold))
        kept = KEPT / hashlib.sha256(text.encode() + b''.join(values.tobytes() for values in (
            plant.gears, plant.persons, plant.states, law.coulomb))).hexdigest()
        if kept.exists():
            with np.load(kept) as found:
                return dict(found)
    samples = round(seconds / plant.sample_time)
    records = {name: np.empty((samples // every, len(plant.gears)), np.float32) for name in watch}
    for k in range(samples):
        if knock is not None and k == round(knock[0] / plant.sample_time):
            plant.knock(knock[1])
        position, velocity = plant.sample()
        if k % hold == 0:
            command = law.update(plant.time, position, velocity, direction(plant.time))
        plant.advance(command)
        if (k + 1) % every == 0:
            for name, state in watch.items():
                records[name][k // every] = plant.states[state]
    if kept:
        with kept.open('wb') as file:
            np.savez(file, **records)
    return records


def announced(values, at=0.0):
    """Return a direction of joints that is 0 until a time."""
    values = np.asarray(values, dtype=np.int64)
    return lambda time: values if time >= at else 0 * values


def smooth(torque, sample_time=1e-3):
    """Return torques, shape (N, J), after a zero-phase low pass."""
    return sosfiltfilt(butter(2, BAND, fs=1.0 / sample_time, output='sos'), torque, axis=0)


def removed(bare, with_law, floor):
    """Return the share of friction's part that is removed, %; NaN where friction has no part."""
    return 100.0 * (bare - with_law) / np.where(bare - floor > LEAST * bare, bare - floor, np.nan)


# Rows.

@dataclass
class Row:
    """One floor on one world under one law.

    `value`: what was measured; joints that fail where `joints` is set. `wanted`: float or None;
    the most, or least where `at_least`, that meets the floor; None where there is no floor.
    `joints`: of how many, for counts; `wanted` is then a share of them. `worst`: the worst gear.
    `detail`: plain figures to keep with it. `beside`: dict of str to float; what the yardsticks
    reach. `each`: what the figure is made of: a share in % or whether it fails, for each joint.
    """

    floor: str
    value: float
    wanted: float | None = None
    at_least: bool = False
    joints: int = 0
    worst: float = np.nan
    detail: dict = field(default_factory=dict)
    beside: dict = field(default_factory=dict)
    each: np.ndarray = ()

    @property
    def met(self):
        """Whether the floor is met; True where there is none."""
        if self.wanted is None:
            return True
        return bool(self.value >= self.wanted if self.at_least
                    else self.value <= self.wanted * max(1, self.joints))

    @property
    def measured(self):
        """The value as tables print it."""
        if self.joints:
            return f'{self.value:.0f} of {self.joints}'
        worst = '' if np.isnan(self.worst) else f' ({self.worst:.0f})'
        return f'{self.value:.0f}{worst}' + ''.join(f' / {v:.0f}' for v in self.beside.values())

    @property
    def asked(self):
        """The floor as the table prints it."""
        if self.wanted is None:
            return ''
        if self.joints:
            return '0' if self.wanted == 0.0 else f'≤ {100 * self.wanted:.0f} %'
        return f'{"≥" if self.at_least else "≤"} {self.wanted:g} %'


def share(floor, shares, law, wanted=None, figure=np.nanmedian):
    """Return a row of what a law removes, with the yardsticks beside it; shares by law, %."""
    return Row(floor, float(figure(shares[law])), wanted, True,
               worst=float(np.nanmin(shares[law])),
               beside={name: float(figure(shares[name])) for name in YARDSTICKS},
               each=shares[law])


def count(floor, joints, fails, wanted=0.0, which=None, **detail):
    """Return a row that counts joints, with the gears that fail.

    `fails`: ndarray of bool, shape (J,). `wanted`: float or None; share that may fail. `which`:
    ndarray of bool, optional; those that count.
    """
    which = np.ones(len(fails), dtype=bool) if which is None else which
    gears, times = np.unique(joints.gear[which & fails], return_counts=True)
    return Row(floor, int((fails & which).sum()), wanted, joints=int(which.sum()),
               each=fails[which], detail={
        'gears': {f'{joints.bank.kinds[g]} {g}': int(n) for g, n in zip(gears, times)}, **detail})
