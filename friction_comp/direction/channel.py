# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The values of a cheap sensor: whether they can be believed, and have left their rest.

A sensor is doubted before it is used: what is silent, saturated, flat, hums or jumps says nothing
about a person, and the reason is told.
"""

from __future__ import annotations

from collections import deque
import math

import numpy as np

from friction_comp.direction.onset_test import OnsetTest, Rest
from friction_comp.errors import InputError

# Share of the range at either end within which a value counts as saturated.
_RAIL = 0.005
# Samples without a new one after which a channel is silent, and the least such time, s.
_MISSED, _SILENCE = 5.0, 0.1
# Equal values in a row: so many times the longest run of the calibration, and at least so long, s.
_FLAT, _FLAT_TIME = 4.0, 0.3
# Second differences: so many times those of the calibration, over as long, s; and as a multiple of
# the values' own scatter, which is 2.4 for white noise, and below 1 for what a person does.
_ROUGH, _ROUGH_TIME, _ROUGH_SHARE = 8.0, 0.2, 1.6
# Share of a rise that is made in one sample from which on it is a jump: the fastest contractions
# take 60 ms (Aagaard et al. 2002).
_JUMP = 0.8
# Standard deviations of a step that is not noise.
_CLEAR = 6.0


class Channel:
    """Watches the values of a sensor; `test` is that for an onset, once it is calibrated.

    Its converter saturates at `low` and `high`. A person changes a force smoothly: what is rough is
    hum.
    """

    test: OnsetTest

    def __init__(self, low: float, high: float) -> None:
        self._low, self._high = low, high
        margin = _RAIL * (high - low)
        self._inside = low + margin, high - margin
        self._last_time = -math.inf
        self._recent: deque[float] = deque(maxlen=4)
        self._run = 0
        self._saturated = self._finite = True
        self._rougher = 0.0
        # Of the calibration: samples per second, longest run of equal values, second differences.
        self._rate, self._longest, self._rough = 0.0, 0, 0.0

    def calibrate(self, values: np.ndarray, rate: float) -> None:
        """Learn from values at rest, shape (N,); raises InputError if they cannot be believed."""
        self._saturated, self._finite = False, bool(np.isfinite(values).all())
        if not self._finite:
            raise InputError('values that are not finite')
        if not np.all((values > self._inside[0]) & (values < self._inside[1])):
            raise InputError(f'saturated: values from {values.min():g} to '
                             f'{values.max():g} of {self._low:g} to {self._high:g}')
        changes = np.flatnonzero(np.diff(values) != 0.0)
        if len(changes) < 3:
            raise InputError(f'flat: {values[0]:g} does not change within '
                             f'{len(values) / rate:.1f} s; is it connected?')
        self._longest = int(np.diff(np.concatenate([[-1], changes, [len(values) - 1]])).max())
        rough = np.diff(values, 2)
        self._rough = float(np.sqrt(np.mean(rough**2)))
        if self._rate == 0.0 or len(self._recent) != self._recent.maxlen:
            self._recent = deque(values[-4:], maxlen=max(8, round(_ROUGH_TIME * rate)))
        self._rate, self._run = rate, 0
        self.test = OnsetTest(Rest.of(values, rate))

    def add(self, time: float, values: np.ndarray) -> None:
        """Add samples, shape (N,), until a time in s."""
        for value in values.tolist():
            self._add(time, value)

    def _add(self, time: float, value: float) -> None:
        self._last_time = time
        self._finite = math.isfinite(value)
        if not self._finite:
            return
        self._saturated = not self._inside[0] < value < self._inside[1]
        recent = self._recent
        self._run = self._run + 1 if recent and value == recent[-1] else 0
        if len(recent) > 1:
            # The largest second difference of late.
            self._rougher = max(abs(value - 2.0 * recent[-1] + recent[-2]), 0.9 * self._rougher)
        recent.append(value)

    def silent(self, time: float) -> bool:
        """Return whether samples are missing at a time in s."""
        return time - self._last_time > max(_SILENCE, _MISSED / max(self._rate, 1e-9))

    def fault(self, time: float) -> str:
        """Return what is wrong with the channel at a time in s; '' if nothing is."""
        if self.silent(time):
            return 'silent'
        if not self._finite:
            return 'not finite'
        if self._saturated:
            return f'saturated at {self._recent[-1]:g}'
        if self._run > max(_FLAT * self._longest, _FLAT_TIME * self._rate):
            return f'flat at {self._recent[-1]:g}'
        return 'hums' if self.hums() else ''

    def hums(self) -> bool:
        """Return whether the values are as rough as hum."""
        values = self._recent
        if len(values) < (values.maxlen or 0) or self._rougher < _ROUGH * self._rough:
            return False
        # Only what is rough now is worth the time.
        rough = float(np.mean(np.square(np.diff(values, 2))))
        return rough > (_ROUGH * self._rough)**2 and rough > _ROUGH_SHARE**2 * float(np.var(values))

    def jumped(self) -> bool | None:
        """Return whether the last samples left their rest in a single step, or stand still.

        A step within the scatter of a push that grows is none; None while only the next sample can
        tell a step from the beginning of a push.
        """
        values = [self.test.level, *list(self._recent)[-4:]]
        rise = values[-1] - values[0]
        steps = [(after - before) * math.copysign(1.0, rise)
                 for before, after in zip(values, values[1:])]
        if max(steps[1:]) > max(_JUMP * abs(rise), _CLEAR * self.test.scatter):
            return None if steps[-1] == max(steps[1:]) else True
        return len(set(values[-3:])) == 1
