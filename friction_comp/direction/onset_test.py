# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""When a signal has left its level at rest: a test with a stated rate of false alarms.

The test is a cumulative sum (CUSUM; Page 1954): deviations from the level at rest, in units of
their scatter, are summed as far as they exceed an allowance, and an alarm is given when the sum
passes a limit. The limit follows from the rate of false alarms (Siegmund 1985).

Noise of a sensor is neither white nor known: three seconds show its scatter only roughly. The
scatter is therefore that of sums, which correlated noise makes larger, at its upper confidence
limit, and at least one step of the converter.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
import functools
import math

import numpy as np
from scipy.optimize import brentq
from scipy.signal import detrend
from scipy.stats import chi2

FALSE_ALARMS = 0.25
"""Alarms per hour and channel at rest without cause. Fewer delay every onset: a tenth of it makes
the limit 1.2 standard deviations larger."""
ALLOWANCE = 1.0
"""Standard deviations by which a sample may deviate without adding to the sum: half of the smallest
change that is to be found. A trembling hand, a sine that the scatter at rest includes, exceeds it
by at most 0.4 and for a quarter of its period, so that it never accumulates."""
# Probability that the true scatter is smaller than the assumed one.
_CONFIDENCE = 0.99
# Time over which noise is correlated at most, s.
_MEMORY = 0.3
# Time constants of the level at rest, and of the scatter when it grows and when it shrinks, s. A
# push that grows by less than the allowance within the first is taken for drift; a hand that begins
# to tremble is known after one or two cycles, and not forgotten between two bouts.
_LEVEL_TIME, _GROWS, _SHRINKS = 1.0, 0.3, 30.0
# s by which level and scatter are behind, so that an onset does not hide itself.
_BEHIND = 0.15
# Largest sum in units of the limit: a signal that has been away for long is back soon.
_MOST = 2.0


@functools.cache
def alarm_limit(samples: float, memory: float = 1.0) -> float:
    """Return the limit of a one-sided sum, in standard deviations.

    Parameters
    ----------
    samples : float
        Mean number of normal samples from one false alarm to the next.
    memory : float
        Number of samples that are as good as one independent sample. A sum of independent samples
        passes the limit by 1.166 on average, one of dependent samples by less.
    """
    def excess(limit: float) -> float:
        x = 2.0 * ALLOWANCE * (limit + 1.166 / memory)
        return math.log((math.exp(x) - x - 1.0) / (2.0 * ALLOWANCE**2)) - math.log(samples)
    return float(brentq(excess, 0.0, 200.0))


@dataclass(frozen=True)
class Rest:
    """A channel at rest: what a calibration found.

    Attributes
    ----------
    level, scatter : float
        In the channel's unit; `scatter` is that of sums, divided by the root of their length.
    rate : float
        Samples per second.
    memory : float
        See `alarm_limit`.
    """

    level: float
    scatter: float
    rate: float
    memory: float

    @classmethod
    def of(cls, values: np.ndarray, rate: float) -> Rest:
        """Return level and scatter of values at rest, shape (N,)."""
        # The level follows a drift.
        deviations = detrend(values)
        variance = float(np.mean(deviations**2))
        # The variance of sums: all autocorrelations, with the weights of Bartlett.
        most = min(round(_MEMORY * rate), len(values) // 4)
        memory = 1.0 + 2.0 * sum(
            (1.0 - lag / (most + 1)) * float(np.mean(deviations[lag:] * deviations[:-lag]))
            for lag in range(1, most + 1)) / max(variance, 1e-300)
        # What alternates, as tremor does, is no reason for confidence.
        memory = max(memory, 1.0)
        # As many independent values stand behind it; fewer the more the autocorrelations count.
        count = max(len(values) / memory**3, 1.5 * len(values) / most)
        scatter = math.sqrt(variance * memory * count / chi2.ppf(1.0 - _CONFIDENCE, count - 1.0))
        steps = np.abs(np.diff(values))
        step = float(steps[steps > 0.0].min()) if (steps > 0.0).any() else 0.0
        # Rare bursts, as of a trembling hand, count in full.
        burst = float(np.abs(deviations).max()) / math.sqrt(2.0 * math.log(len(values)))
        return cls(float(values.mean()), max(scatter, step, burst), rate, memory)


class OnsetTest:
    """Tests a channel for a rise or a fall from its level at rest.

    Attributes
    ----------
    level : float
        The level at rest, which follows the signal slowly while `follow` is called.
    alarm : int
        +1 or -1 while the signal is above or below the level at rest, else 0.
    """

    def __init__(self, rest: Rest, per_hour: float = FALSE_ALARMS,
                 proportional: bool = False) -> None:
        self.rest, self.level, self.alarm = rest, rest.level, 0
        self._proportional = proportional
        # Two sides; the level and the scatter follow the signal, so that they have errors, too.
        self.limit = alarm_limit(2.0 * 3600.0 * rest.rate / per_hour, rest.memory)
        self._variance = rest.scatter**2
        self._sums = [0.0, 0.0]
        self._waiting: deque[float] = deque()
        self._behind = round(_BEHIND * rest.rate)

    @property
    def scatter(self) -> float:
        """Standard deviation at rest; never below that of the calibration."""
        return math.sqrt(self._variance) * self._gain

    @property
    def _gain(self) -> float:
        """Scatter at the present level over that at the level of the calibration."""
        return max(1.0, self.level / self.rest.level) if self._proportional else 1.0

    def add(self, value: float) -> int:
        """Add a sample and return the alarm."""
        z = (value - self.level) / self.scatter
        most = _MOST * self.limit
        up, down = self._sums
        up = min(most, max(0.0, up + z - ALLOWANCE))
        down = min(most, max(0.0, down - z - ALLOWANCE))
        self._sums = [up, down]
        self.alarm = 1 if up > self.limit else -1 if down > self.limit else 0
        if self.alarm:
            # What came before an alarm belongs to it.
            self._waiting.clear()
        return self.alarm

    def follow(self, value: float) -> None:
        """Let level and scatter follow a sample at rest, when some more have come."""
        self._waiting.append(value)
        if len(self._waiting) <= self._behind:
            return
        step = 1.0 / self.rest.rate
        deviation = self._waiting.popleft() - self.level
        self.level += deviation * min(1.0, step / _LEVEL_TIME)
        change = (deviation / self._gain)**2 - self._variance
        weight = min(1.0, step / (_GROWS if change > 0.0 else _SHRINKS))
        self._variance = max(self.rest.scatter**2, self._variance + weight * change)

    def settle(self, level: float) -> None:
        """Begin anew at another level of rest."""
        self.level, self.alarm, self._sums = level, 0, [0.0, 0.0]
        self._waiting.clear()
