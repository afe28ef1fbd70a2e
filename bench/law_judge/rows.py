# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the table: what an experiment returns."""

from dataclasses import dataclass, field

import numpy as np

from law_judge.loop import YARDSTICKS

DEGREE = np.pi / 180.0


@dataclass
class Row:
    """One floor on one world under one law.

    `value`: what was measured; joints that fail where `joints` is set. `wanted`: float or None;
    the most, or least where `at_least`, that meets the floor; None where there is no floor.
    `joints`: of how many, for counts; `wanted` is then a share of them. `detail`: plain figures to
    keep with it. `beside`: dict of str to float; what the yardsticks reach.
    """

    floor: str
    value: float
    wanted: float | None = None
    unit: str = ''
    at_least: bool = False
    joints: int = 0
    detail: dict = field(default_factory=dict)
    beside: dict = field(default_factory=dict)

    @property
    def met(self):
        """Whether the floor is met; True where there is none."""
        if self.wanted is None:
            return True
        if self.at_least:
            return bool(self.value >= self.wanted)
        return bool(self.value <= self.wanted * max(1, self.joints))

    @property
    def measured(self):
        """The value as the table prints it."""
        if self.joints:
            return f'{self.value:.0f} of {self.joints}'
        if not np.isfinite(self.value):
            return 'not known'
        others = ''.join(f' / {value:.3g}' for value in self.beside.values())
        return f'{self.value:.3g}{others}{self.unit}'

    @property
    def asked(self):
        """The floor as the table prints it."""
        if self.wanted is None:
            return ''
        if self.joints:
            return '0' if self.wanted == 0.0 else f'≤ {100 * self.wanted:.0f} %'
        return f'{"≥" if self.at_least else "≤"} {self.wanted:g}{self.unit}'


def beside(shares, figure):
    """Return a figure of the shares that the yardsticks reach, by their names."""
    return {name: float(figure(shares[name])) for name in YARDSTICKS}


def count(floor, joints, fails, wanted=0.0, which=None, **detail):
    """Return a row that counts joints, with the gears that fail.

    `fails`: ndarray of bool, shape (J,). `wanted`: float or None; share that may fail. `which`:
    ndarray of bool, optional; those that count.
    """
    fails = np.asarray(fails, dtype=bool)
    which = np.ones(len(fails), dtype=bool) if which is None else which
    gears, times = np.unique(joints.gear[which & fails], return_counts=True)
    return Row(floor, int((fails & which).sum()), wanted, joints=int(which.sum()), detail={
        'gears': {f'{joints.bank.kinds[g]} {g}': int(n) for g, n in zip(gears, times)}, **detail})
