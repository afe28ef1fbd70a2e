# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated cheap sensors of a person's intention: force at the cuff, and two muscles.

They measure what a person does with all that makes them cheap. The ranges, with their sources:

force
    A pair of force-sensing resistors or a strain gauge, 10 bit: noise 0.5 to 1.5 counts, hysteresis
    3 to 8 % (Interlink FSR 402: 5 to 10 %), gain wrong by up to 20 %, drift of up to 2 % of the
    range in ten minutes, 4 to 10 ms of low pass.
muscles
    Surface electrodes on flexor and extensor: 3 to 6 µV of noise at rest (De Luca 1997), 30 to
    80 µV at the torque that breaks the joint away, as noise of the size of the activity; cross-talk
    of 5 to 25 % (Winter, Fuglevand and Archer 1994); the antagonist is active at 5 to 15 %. They
    act 30 to 80 ms before the force (electromechanical delay: Cavanagh and Komi 1979). An envelope
    is rectified and low-passed at 6 Hz.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FAULTS = ('flat', 'saturated', 'silent', 'unplugged', 'hum')
COUNTS = 1024
# Converter of the muscle signals: 12 bit over ±2 mV, µV.
MUSCLE_RANGE = 2000.0
_MUSCLE_STEP = 2.0 * MUSCLE_RANGE / 4096
# Amplitude of hum, µV and counts, and its frequency, Hz.
_HUM, _HUM_COUNTS, _MAINS = 200.0, 60.0, 50.0
_DRIFT_TIME = 600.0
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
        share = np.exp(-1.0 / (self.rate * _DRIFT_TIME))
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
        mains = np.sin(2.0 * np.pi * _MAINS * 1.013 * time)
        return float({'flat': self._last[joint], 'saturated': COUNTS, 'silent': np.nan,
                      'unplugged': 0.0, 'hum': exact + _HUM_COUNTS * mains}[fault])


class CheapMuscles:
    """Flexor and extensor of J joints with `breakaway` torques, N·m, (J,), in µV.

    Raw signals, 1000 values per second, or with `envelope` 100 of their envelopes.
    """

    range = (-MUSCLE_RANGE, MUSCLE_RANGE)

    def __init__(self, breakaway: np.ndarray, seed: int | Sequence[int],
                 envelope: bool = False) -> None:
        # Loaded where muscles are simulated: a plant without them starts in half the time.
        from scipy.signal import butter, sosfilt

        self._filter = sosfilt
        random = self._random = np.random.default_rng(seed)
        joints = len(breakaway)
        self.delay = random.uniform(0.03, 0.08, joints)
        """Electromechanical delay, s: the muscles act so long before the torque."""
        self.rate = 100.0 if envelope else 1000.0
        self._noise = random.uniform(3.0, 6.0, (joints, 2))
        self._gain = random.uniform(30.0, 80.0, (joints, 1)) * random.uniform(
            0.8, 1.25, (joints, 2)) / breakaway[:, None]
        self._antagonist = random.uniform(0.05, 0.15, joints)
        self._cross_talk = random.uniform(0.05, 0.25, (joints, 2))
        self._wander = random.uniform(0.0, 0.2, (joints, 2))
        self._phase = random.uniform(-np.pi, np.pi, (joints, 2))
        self._band = butter(2, (30.0, 300.0), 'band', fs=1000.0, output='sos')
        self._state = np.zeros((len(self._band), 2, joints, 2))
        # White noise of variance 1 keeps this much of it in the band.
        self._kept = np.sqrt(0.54)
        self._envelope = butter(2, 6.0, fs=1000.0, output='sos') if envelope else None
        self._smooth = np.zeros((1, 2, joints, 2))
        self._steps = 0
        self._last = np.zeros((joints, 2))
        self.faults: dict[tuple[int, int], str] = {}

    def sample(self, intended: np.ndarray,
               co_contraction: np.ndarray | float = 0.0) -> np.ndarray:
        """Advance by N ms; return the values that are due, shape (M, J, 2), in µV.

        `intended` is the torque for which the muscles act now, `delay` before it, and
        `co_contraction` that of both against each other, N·m, each (N, J).
        """
        intended = np.asarray(intended, dtype=float)
        both = np.stack([np.maximum(intended, 0.0), np.maximum(-intended, 0.0)], axis=2)
        both = both + self._antagonist[:, None] * both[..., ::-1]
        both = both + np.broadcast_to(co_contraction, intended.shape)[..., None]
        noise, self._state = self._filter(
            self._band, self._random.normal(size=both.shape), axis=0, zi=self._state)
        muscle = noise / self._kept * both * self._gain
        muscle = muscle + self._cross_talk * muscle[..., ::-1]
        steps = self._steps + 1 + np.arange(len(intended))
        self._steps += len(intended)
        slow = np.sin(_STEP * self._steps / _DRIFT_TIME + self._phase)
        raw = muscle + self._noise * (1.0 + self._wander * slow) * self._random.normal(
            size=both.shape)
        for (joint, channel), fault in self.faults.items():
            raw[:, joint, channel] = self._faulty(
                fault, _STEP * steps, raw[:, joint, channel], self._last[joint, channel])
        every = round(1.0 / (_STEP * self.rate))
        if self._envelope is None:
            values = np.clip(np.rint(raw / _MUSCLE_STEP) * _MUSCLE_STEP, *self.range)
        else:
            # The converter is behind the filter, whose gain makes its steps ten times finer.
            values, self._smooth = self._filter(
                self._envelope, np.abs(np.nan_to_num(raw)), axis=0, zi=self._smooth)
            values = np.where(np.isfinite(raw), np.round(values / _MUSCLE_STEP, 1) * _MUSCLE_STEP,
                              np.nan)
        values = values[steps % every == 0]
        if len(values):
            self._last = np.where(np.isfinite(values[-1]), values[-1], self._last)
        return np.asarray(values)

    def _faulty(self, fault: str, time: np.ndarray, raw: np.ndarray, last: float) -> np.ndarray:
        mains = np.sin(2.0 * np.pi * _MAINS * time) + 0.3 * np.sin(6.0 * np.pi * _MAINS * time)
        return np.asarray({
            'flat': last + 0.0 * time, 'saturated': MUSCLE_RANGE + 0.0 * time,
            'silent': np.nan * time, 'unplugged': 1.5 * _HUM * mains,
            'hum': raw + _HUM * mains}[fault])
