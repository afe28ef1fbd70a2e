# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about the current: whether it is what was commanded, how late, and its sign."""

from __future__ import annotations

from collections import deque
import math
from typing import NamedTuple

import numpy as np

from friction_comp.drive import Drive
from friction_comp.facts.motion import name_unit
from friction_comp.samples import Samples

FOLLOWS = 2.0
"""Largest ratio of measured and commanded current, or its inverse, with which one is the other;
smaller errors of a gain or a torque constant show in the error of a model."""
ALIKE = 0.9
"""Correlation above which the measured current is the commanded one, or its negative."""
LATEST = 0.3
"""Largest delay of the measured current that counts as a response, s: a busy machine takes a tenth
of a second or two to transfer a command."""
# Time constant with which currents are smoothed before they are compared, s: longer than the lag of
# any drive. Longer delays are due to the connection between drive and controller.
_SMOOTHING = 0.05
# Duration of measured current that is compared, and step between the delays that are compared, s.
_MEMORY, _GRID = 0.5, 0.005


# Measured compared with commanded current.

class Answer(NamedTuple):
    """How the measured current follows the commanded one."""

    gain: float             # ratio of measured to commanded current
    correlation: float      # of both, without subtracting the means
    error: float            # standard error of the gain
    delay: float            # s by which the measured current is late
    # RMS in A of the commanded current that has had at least `LATEST` to show a response.
    old_command: float


def current_answer(command: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
    """Return gain and correlation, as of `Answer`, without delay; finite currents in A, (N,)."""
    power, product = float(command @ command), float(command @ measured)
    correlation = product / math.sqrt(max(power * float(measured @ measured), 1e-300))
    return product / max(power, 1e-300), correlation


def late_answer(time: np.ndarray, command: np.ndarray, measured: np.ndarray) -> Answer:
    """Return how the measured current follows the commanded one, with the delay that fits best.

    The last 0.8 s are used. Both currents, in A, were smoothed with the same filter; time is in s.
    """
    back = np.arange(round(_MEMORY / _GRID)) * _GRID
    recent = np.interp(time[-1] - back, time, measured, left=0.0)
    delays = np.arange(round(LATEST / _GRID) + 1) * _GRID
    # The command, delayed by each delay: one row per delay.
    delayed = np.interp(time[-1] - back - delays[:, None], time, command, left=0.0)
    power, product = np.sum(delayed ** 2, axis=1), delayed @ recent
    correlations = product / np.sqrt(np.maximum(power * (recent @ recent), 1e-300))
    size = np.abs(correlations)
    # For a constant current all delays fit equally.
    index = int(np.argmax(size)) if size.max() > size[0] + 0.005 else 0
    gain = float(product[index] / max(power[index], 1e-300))
    correlation = float(correlations[index])
    # Smoothed values are independent after twice the time constant.
    count = _MEMORY / (2.0 * _SMOOTHING)
    error = abs(gain) * math.sqrt(max(1.0 / max(correlation ** 2, 1e-12) - 1.0, 0.0) / count)
    return Answer(gain, correlation, error, float(delays[index]),
                  float(np.sqrt(power[-1] / len(back))))


def gain_fault(gain: float, drive: Drive) -> str:
    """Return why the current computed from effort is `gain` times the commanded one; '' if it is.

    It is the commanded one within a factor of `FOLLOWS`.
    """
    if abs(gain) < 1e-6:
        return 'effort is not measured'
    faults = ['effort has the wrong sign'] if gain < 0.0 else []
    if not 1.0 / FOLLOWS < abs(gain) < FOLLOWS:
        torque = drive.torque_per_current
        unit = name_unit(gain, {
            1000.0: 'N·mm', 1.0 / torque: 'the current in A', 1000.0 / torque: 'the current in mA',
            1.0 / drive.gear_ratio: "the motor's torque, without the gears",
            1000.0 / drive.gear_ratio: "the motor's torque in N·mm, without the gears"})
        faults.append(
            f'effort has another unit than N·m at the joint; it looks like {unit}' if unit else
            'effort is not measured, or is not the torque of this motor' if abs(gain) < 0.05 else
            'effort has another unit than N·m at the joint, or torque constant and gear ratio are '
            'not those of this drive')
    return ', and '.join(faults)


class CurrentCheck:
    """Compares the measured current with the commanded one, sample by sample.

    Both are smoothed with the same filter. The mean measured current while the command is zero is
    the sensor's offset. `commanded` and `measured` are the smoothed currents in A.
    """

    def __init__(self) -> None:
        self.commanded = self.measured = 0.0
        # The sensor's offset, and the number of samples in this mean.
        self._offset, self._offset_count = 0.0, 0
        # Integrals over time, with exponential forgetting: of the squared commanded current, of its
        # product with the measured current, and of 1.
        self._recent = (0.0, 0.0, 0.0)
        # Integral, with forgetting, of the squared part that smoothing removes from the command.
        self._removed = 0.0
        # Time and smoothed currents, as far back as `answer` needs them.
        self._past: deque[tuple[float, float, float]] = deque()

    def take(self, time: float, step: float, command: float, measured: float) -> None:
        """Add a sample: s, s since the last one, A, A."""
        if command == 0.0 and self.commanded == 0.0:
            self._offset_count += 1
            self._offset += (measured - self._offset) / self._offset_count
        share = -math.expm1(-step / _SMOOTHING)
        self.commanded += share * (command - self.commanded)
        self.measured += share * (measured - self._offset - self.measured)
        past = self._past
        past.append((time, self.commanded, self.measured))
        while time - past[0][0] > _MEMORY + LATEST:
            past.popleft()
        fading = math.exp(-step / _MEMORY)
        self._removed = fading * self._removed + step * (command - self.commanded) ** 2
        power, product = step * self.commanded ** 2, step * self.commanded * self.measured
        recent = self._recent
        self._recent = (
            fading * recent[0] + power, fading * recent[1] + product, fading * recent[2] + step)

    def gain(self, least: float) -> float:
        """Return the ratio of measured to commanded current of late.

        It is NaN if there is too little data, or the commanded current is below `least`, RMS in A.
        """
        power, product, duration = self._recent
        if duration < 0.3 * _MEMORY or power <= duration * least ** 2:
            return math.nan
        # An amplifier follows fast oscillations late and incompletely: no result if smoothing
        # leaves less than a fifth of the command.
        if power < 0.2 ** 2 * self._removed:
            return math.nan
        return product / power

    def answer(self) -> Answer:
        """Return how the measured current follows the commanded one, see `late_answer`."""
        if not self._past:
            return Answer(0.0, 0.0, 0.0, 0.0, 0.0)
        return late_answer(*np.array(self._past).T)


# The sign of the current.

def _by_position(position: np.ndarray, velocity: np.ndarray, current: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return mean and variance of the current in motion, (B, 2), and the weight, (B,), by position.

    The columns are motion in the negative and the positive direction; None if they overlap in less
    than five of twenty bins. Whatever the weight, at a given position friction makes the current
    larger in the positive direction.
    """
    fast = np.abs(velocity) > 0.2 * np.quantile(np.abs(velocity), 0.95)
    if not fast.any() or np.ptp(position[fast]) == 0.0:
        return None
    position, current, forward = position[fast], current[fast], velocity[fast] > 0
    if np.ptp(position) > 4.0 * np.pi:
        # Gravity is periodic.
        position = np.mod(position, 2.0 * np.pi)
    edges = np.linspace(position.min(), position.max(), 21)
    bin_index = 2 * np.clip(np.digitize(position, edges) - 1, 0, 19) + forward
    count = np.bincount(bin_index, minlength=40).astype(float)
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = np.bincount(bin_index, current, 40) / count
        spread = np.bincount(bin_index, current ** 2, 40) / count - mean ** 2
    fewer = np.minimum(count[0::2], count[1::2])
    used = fewer >= 10
    if np.count_nonzero(used) < 5:
        return None
    return (mean.reshape(-1, 2)[used], spread.reshape(-1, 2)[used],
            fewer[used] / fewer[used].sum())


def wrong_sign(samples: Samples, alone: bool = True) -> str:
    """Return what tells that a recorded effort has the wrong sign, or none; '' if nothing does.

    It is opposed to the command; or it is an amount, which comes down to zero in both directions
    and never below, and is no larger in the positive one: friction and weight that are always on
    one side leave a difference; or the motor brakes the motion. The last is told only where no
    command, no load and, by `alone`, no other joint drives the joint.
    """
    command, current = samples.command, samples.current
    if (command is not None and len(samples) >= 50 and command.any() and current.any()
            and current_answer(command, current)[1] < -ALIKE):
        return 'effort and commanded current have opposite signs: one of them has the wrong sign'
    if samples.load is not None or not len(samples):
        return ''
    velocity = samples.velocity if samples.velocity is not None else _rate(samples)
    bins = _by_position(samples.position, velocity, current)
    if bins is None:
        return ''
    mean, variance, weight = bins
    difference = mean[:, 1] - mean[:, 0]
    usual = float(np.quantile(current, 0.95))
    if current.min() >= 0.0 and np.count_nonzero(current < 0.05 * usual) >= 5 and (
            weight[difference < 0.02 * usual].sum() >= 0.2
            or np.diff(np.unique(current)).max() > 0.25 * np.ptp(current)):
        return ('effort is never negative, and no larger in one direction than in the other, or '
                'jumps between small and large values: it is an amount without a sign, or its sign '
                'is a bit of the number; record it with its sign')
    if not alone or (command is not None and command.any()):
        return ''
    # A difference within the scatter of single samples may be that of another load.
    scatter = math.sqrt(max(float(weight @ variance.mean(axis=1)), 0.0))
    if weight @ difference < -scatter and weight[difference < 0].sum() > 0.8:
        # Whether these are A or N·m is not known here.
        return ('the motor brakes the motion: effort has the wrong sign (--unit effort=-1Nm or '
                'current=-1A reverses it), or another torque drives the joint and neither '
                'current_command nor interaction_wrench is recorded')
    return ''


def _rate(samples: Samples) -> np.ndarray:
    """Return the rate of position over 20 ms, shape (N,)."""
    half = max(round(0.01 / max(samples.sample_time, 1e-6)), 1)
    index = np.arange(len(samples))
    later, earlier = np.minimum(index + half, len(index) - 1), np.maximum(index - half, 0)
    step = samples.time[later] - samples.time[earlier]
    return np.divide(samples.position[later] - samples.position[earlier], step,
                     out=np.zeros(len(index)), where=step > 0)
