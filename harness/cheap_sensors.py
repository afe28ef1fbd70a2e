# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated cheap sensor of a person's force at the cuff, with all that makes it cheap.

A pair of force-sensing resistors or a strain gauge, 10 bit: noise 0.5 to 1.5 counts, hysteresis 3
to 8 % (Interlink FSR 402: 5 to 10 %), gain wrong by up to 20 %, drift of up to 2 % of the range in
ten minutes, 4 to 10 ms of low pass.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FAULTS = ('flat', 'saturated', 'silent', 'unplugged', 'hum')
COUNTS = 1024
_STEP = 1e-3


class CheapForce:
    """Force sensors of J joints, in counts, `rate` values per second.

    Their range is 2 to 8 times the torque that breaks each joint away, N·m, (J,).
    """

    range = (0.0, COUNTS - 1.0)

    def __init__(self, breakaway: np.ndarray, seed: int | Sequence[int], rate: float) -> None:
        random = self._random = np.random.default_rng(seed)
        joints = len(breakaway)
        self.rate = rate
        full = breakaway * np.exp(random.uniform(np.log(2.0), np.log(8.0), joints))
        self._gain = 0.5 * COUNTS / full * random.uniform(0.8, 1.2, joints)
        self._zero = 0.5 * COUNTS + random.uniform(-0.15, 0.15, joints) * COUNTS
        self._noise = random.uniform(0.5, 1.5, joints)
        self._hysteresis = random.uniform(0.03, 0.08, joints)
        self._weight = 1.0 - np.exp(-_STEP / random.uniform(0.004, 0.010, joints))
        # An offset that wanders, within about the drift's size, with the drift's time.
        self._drift_size = random.uniform(0.0, 0.02, joints) * COUNTS
        self._drift = np.zeros(joints)
        self._force, self._play = np.zeros(joints), np.zeros(joints)
        self._last = np.rint(self._zero)
        self._steps = 0
        self.faults: dict[int, str] = {}

    def sample(self, torque: np.ndarray) -> np.ndarray:
        """Advance by N ms with a torque on the cuff, N·m, (N, J); return the counts due, (M, J).

        M is about N·rate/1000. A joint whose sensor is silent has NaN.
        """
        due = []
        for row in np.asarray(torque, dtype=float):
            self._force += self._weight * (row * self._gain - self._force)
            self._steps += 1
            # In whole steps: sums of times would drift.
            if int(self._steps * self.rate * _STEP + 1e-6) > int(
                    (self._steps - 1) * self.rate * _STEP + 1e-6):
                due.append(self._measure())
        return np.array(due).reshape(-1, len(self._gain))

    def _measure(self) -> np.ndarray:
        # Friction in the sensor: a part of the force lags behind by a share of its excursion.
        width = self._hysteresis * np.maximum(np.abs(self._force), 1.0)
        self._play = np.clip(self._play, self._force - width, self._force + width)
        share = np.exp(-1.0 / (self.rate * 600.0))
        self._drift = share * self._drift + self._drift_size * np.sqrt(
            1.0 - share**2) * self._random.normal(size=len(self._gain))
        exact = (self._zero + self._drift + 0.5 * (self._force + self._play)
                 + self._noise * self._random.normal(size=len(self._gain)))
        for joint, fault in self.faults.items():
            exact[joint] = self._faulty(fault, self._steps * _STEP, exact[joint], joint)
        values = np.clip(np.rint(exact), *self.range)
        self._last = np.where(np.isfinite(values), values, self._last)
        return np.asarray(values)

    def _faulty(self, fault: str, time: float, exact: float, joint: int) -> float:
        mains = np.sin(2.0 * np.pi * 50.0 * 1.013 * time)
        return float({'flat': self._last[joint], 'saturated': COUNTS, 'silent': np.nan,
                      'unplugged': 0.0, 'hum': exact + 60.0 * mains}[fault])
