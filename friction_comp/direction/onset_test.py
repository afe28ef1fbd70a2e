# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""When a signal has left its level at rest: a test with a stated rate of false alarms.

The test is a cumulative sum (CUSUM; Page 1954): deviations from the level at rest, in units of
their scatter, are summed as far as they exceed an allowance, and an alarm is given when the sum
passes a limit. The limit follows from the rate of false alarms, which is at most as stated
(Lorden 1971).

Deviations add up like this only if they are independent, which those of a low-passed or trembling
sensor are not. Values are therefore filtered with the inverse of the filter that would make those
of the calibration from independent ones (an autoregressive model). Three seconds show the scatter
only roughly: it is taken at its upper confidence limit, and as at least one step of the converter.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import math
import operator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import detrend
from scipy.stats import chi2

FALSE_ALARMS = 0.25
"""Alarms per hour and channel at rest without cause, at most. Fewer delay every onset: a tenth of
it makes the limit 0.8 standard deviations larger."""
ALLOWANCE = 1.5
"""Standard deviations by which a sample may deviate without adding to the sum: half of the smallest
change that is to be found. With 1.0, `bench/direction_table.py` (force, seed 0) has 2 instead of no
false onsets in three hours, and tells an onset after 70 instead of 50 ms."""
# Probability that the true scatter is smaller than the assumed one.
_CONFIDENCE = 0.99
# Order of the autoregressive model, two poles each for a low pass and for a trembling hand; and the
# largest sum of its weights: what is slower than a low pass of about 2 Hz is drift.
_ORDER, _SLOWEST = 4, 0.98
# Time constants of the level at rest, and of the scatter when it grows and when it shrinks, s. A
# push that grows by less than the allowance within the first is taken for drift; a hand that begins
# to tremble is known after one or two cycles, and not forgotten between two bouts.
_LEVEL_TIME, _GROWS, _SHRINKS = 1.0, 0.2, 30.0
# s by which level and scatter are behind, so that an onset does not hide itself.
_BEHIND = 0.15
# Largest sum in units of the limit: a signal that has been away for long is back soon. Without a
# cause it comes about once in a thousand years (Lorden 1971, as above).
_MOST = 2.0


def alarm_limit(samples: float) -> float:
    """Return the limit of a one-sided sum, in standard deviations.

    `samples` is the least mean number of normal samples from one false alarm to the next: the sum
    times `2·ALLOWANCE` is that of log likelihood ratios (Lorden 1971).
    """
    return math.log(samples) / (2.0 * ALLOWANCE)


@dataclass(frozen=True)
class Rest:
    """A channel at rest: what a calibration found."""

    level: float  # mean of the independent values, in the channel's unit
    scatter: float  # their standard deviation
    rate: float  # samples per second
    memory: float  # number of values whose mean is as uncertain as one independent value
    # (N,): filter that makes values independent, the newest first, with a gain of 1 for the level.
    inverse: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, rate: float) -> Rest:
        """Return level and scatter of values at rest, shape (N,)."""
        # The level follows a drift.
        deviations = detrend(values)
        before = sliding_window_view(deviations[:-1], _ORDER)[:, ::-1]
        weights = np.linalg.lstsq(before, deviations[_ORDER:], rcond=None)[0]
        weights *= min(1.0, _SLOWEST / max(float(weights.sum()), 1e-9))
        inverse = np.concatenate([[1.0], -weights]) / (1.0 - float(weights.sum()))
        own = np.convolve(deviations, inverse, 'valid')
        scatter = math.sqrt(float(own @ own) / chi2.ppf(1.0 - _CONFIDENCE, len(own) - _ORDER))
        memory = float(own @ own / (deviations @ deviations))
        steps = np.abs(np.diff(values))
        step = float(steps[steps > 0.0].min()) if (steps > 0.0).any() else 0.0
        # Rare bursts, as of a trembling hand, count in full.
        burst = float(np.abs(own).max()) / math.sqrt(2.0 * math.log(len(own)))
        return cls(float(values.mean()), max(scatter, step, burst), rate, memory, inverse)


class OnsetTest:
    """Tests a channel for a rise or a fall from its level at rest.

    `level`, that at rest, follows the signal slowly while `follow` is called. `alarm` is +1 or -1
    while the signal is above or below it, else 0, and `sure` the alarm where it is beyond doubt.
    """

    def __init__(self, rest: Rest) -> None:
        self.rest, self.level, self.alarm, self.sure = rest, rest.level, 0, 0
        # Two sides; the level and the scatter follow the signal, so that they have errors, too.
        self.limit = alarm_limit(2.0 * 3600.0 * rest.rate / FALSE_ALARMS)
        # The scatter squared: that of the test, and of the last waves.
        self._variance = self._recent_variance = rest.scatter**2
        self._last = deque([rest.level] * len(rest.inverse), maxlen=len(rest.inverse))
        self._inverse, self._value = rest.inverse.tolist(), rest.level  # the last independent value
        self._sums = [0.0, 0.0]
        self._waiting: deque[float] = deque()
        self._behind = round(_BEHIND * rest.rate)

    @property
    def scatter(self) -> float:
        """Standard deviation at rest; never below that of the calibration."""
        return math.sqrt(self._variance)

    def add(self, value: float) -> int:
        """Add a sample and return the alarm."""
        self._last.appendleft(value)
        self._value = sum(map(operator.mul, self._inverse, self._last))
        z = (self._value - self.level) / self.scatter
        most = _MOST * self.limit
        up, down = self._sums
        up = min(most, max(0.0, up + z - ALLOWANCE))
        down = min(most, max(0.0, down - z - ALLOWANCE))
        self._sums = [up, down]
        self.sure = 1 if up == most else -1 if down == most else 0
        self.alarm = 1 if up > self.limit else -1 if down > self.limit else 0
        if self.alarm:
            # What came before an alarm belongs to it.
            self._waiting.clear()
        return self.alarm

    def follow(self) -> None:
        """Let level and scatter follow a sample at rest, `_BEHIND` after it came."""
        self._waiting.append(self._value)
        if len(self._waiting) <= self._behind:
            return
        step = 1.0 / self.rest.rate
        deviation = self._waiting.popleft() - self.level
        self.level += deviation * min(1.0, step / _LEVEL_TIME)
        self._recent_variance += min(1.0, step / _GROWS) * (
            deviation**2 - self._recent_variance)
        shrunk = self._variance * (1.0 - min(1.0, step / _SHRINKS))
        self._variance = max(self.rest.scatter**2, self._recent_variance, shrunk)

    def settle(self, level: float) -> None:
        """Begin anew at another level of rest."""
        self.level, self.alarm, self.sure = level, 0, 0
        self._sums = [0.0, 0.0]
        self._waiting.clear()
