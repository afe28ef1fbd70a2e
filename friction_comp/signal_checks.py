# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Checks whether measured signals are possible and agree with each other.

The integrated velocity is compared with the change of position, and the measured current with the
commanded one. The result of either comparison is a ratio: one if they agree, negative if a sign is
wrong, and otherwise a value that often identifies a wrong unit. The caller decides how far it may
be from one. The functions take arrays; `VelocityCheck` and `CurrentCheck` apply them to recent
samples of a running system.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
import math
import statistics
from typing import NamedTuple

import numpy as np

from friction_comp.drive import Drive

LIMITS = {
    'position': (1e5, 'rad'), 'velocity': (1e4, 'rad/s'), 'current': (1e5, 'A'),
    'command': (1e5, 'A'), 'load': (1e7, 'N·m'), 'temperature': (250.0, '°C'),
    'reference_position': (1e5, 'rad'), 'reference_velocity': (1e4, 'rad/s'),
}
"""Largest magnitude and unit of each signal, far beyond any geared drive: one turn per second for
four hours is 1e5 rad, the fastest motors turn at 1e4 rad/s, the shaft of a wind turbine carries
1e7 N·m, and the windings of a motor end above 250 °C."""
STANDSTILL = 0.01
"""rad/s; slower, friction balances the other torques of a joint instead of following a model."""
LOWEST = {'temperature': -100.0}
"""Smallest value of signals for which it is not minus the largest: colder than any place on earth,
°C."""
BLOCK = 0.1
"""Duration over which velocity is integrated and compared with the change of position, s."""
# A block is not used if the joint moved less than this, rad and encoder counts.
_SHORT, _FEW_COUNTS = 2e-3, 50.0
# A position that changes by at most so many counts while the velocity predicts more is stuck.
_STILL_COUNTS = 2.5
# Time by which a drive may delay the velocity, s: the integral then differs by the change of
# velocity times this delay; and longest time constant of a low pass, s: behind it, the integral
# differs by just the change of the filtered velocity times this time.
_VELOCITY_LAG, _LOW_PASS = 0.02, 0.1
# Fewest steps of an encoder from row to row that show whether a row is missing, and the share of
# rows from which on such a loss is more than noise.
_SURE_STEPS, _LOST = 5.0, 0.01
# Time steps above this in s, and above this multiple of the usual one, are gaps, over which nothing
# is integrated.
_GAP, _GAP_STEPS = 0.02, 3.0
# Time constant with which currents are smoothed before they are compared, s: longer than the lag of
# any drive. Longer delays are due to the connection between drive and controller.
_SMOOTHING = 0.05
LATEST = 0.3
"""Largest delay of the measured current that counts as a response, s: a busy machine takes a tenth
of a second or two to transfer a command."""
# Duration of measured current that is compared, s.
_MEMORY = 0.5
# Step between the delays that are compared, s.
_GRID = 0.005
# A delay must raise the correlation by this much: for a constant current all delays fit equally.
_CLEARLY_BETTER = 0.005
# Share of the commanded current's oscillation that must remain after smoothing, RMS.
_LEAST_REMAINING = 0.2
# Relative difference up to which a ratio is reported as that of a known unit.
_UNIT_TOLERANCE = 0.1
# Fewest blocks of motion that show whether a ratio is the same everywhere.
_STEADY_BLOCKS = 10
# Bins of position, and the fewest that motion in both directions must share.
_BINS, _FEWEST_BINS = 20, 5

_VELOCITY_UNITS = {
    math.degrees(1.0): 'velocity is in deg/s, not rad/s',
    30.0 / math.pi: 'velocity is in turns per minute, not rad/s',
    0.5 / math.pi: 'velocity is in turns per second, not rad/s',
    1000.0: 'velocity is in mrad/s, position in 1000 rad or time in ms',
    math.radians(1.0): 'position is in degrees, not rad',
    2.0 * math.pi: 'position is in turns, not rad',
    0.001: 'position is in mrad, or velocity in 1000 rad/s',
    60.0: 'position is in turns and velocity in turns per minute, not rad and rad/s',
    360.0: 'position is in turns and velocity in deg/s, not rad and rad/s',
    1.0 / 6.0: 'position is in degrees and velocity in turns per minute, not rad and rad/s',
    1.0 / 360.0: 'position is in degrees and velocity in turns per second, not rad and rad/s',
}


def beyond(signal: str, values: np.ndarray) -> np.ndarray:
    """Return whether each value of a signal is impossible by `LIMITS`, `LOWEST`; False for NaN."""
    limit = LIMITS[signal][0]
    with np.errstate(invalid='ignore'):
        return np.asarray((values > limit) | (values < LOWEST.get(signal, -limit)))


def _name_unit(ratio: float, units: Mapping[float, str]) -> str:
    """Return the text for the unit whose factor matches a ratio; '' if there is none."""
    nearest = min(units, key=lambda unit: abs(math.log(unit / max(abs(ratio), 1e-300))))
    return units[nearest] if abs(abs(ratio) / nearest - 1.0) < _UNIT_TOLERANCE else ''


# Velocity compared with position.

def velocity_ratios(time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                    resolution: float = 0.0) -> np.ndarray:
    """Return the ratio of integrated velocity to change of position in each block, shape (K,).

    Signals have shape (N,), in s, rad and rad/s; `resolution` is that of the encoder, rad. There is
    one ratio for each block of `BLOCK` s in which the joint moved: infinite if the position is
    constant, 0 if the velocity is zero, and 1 if a delay, or a low pass, explains the difference.
    """
    good = np.isfinite(time) & np.isfinite(position) & np.isfinite(velocity)
    time, position, velocity = time[good], position[good], velocity[good]
    if len(time) < 3:
        return np.empty(0)
    step = np.diff(time)
    block = np.floor((time - time[0]) / BLOCK + 1e-6)
    edges = np.concatenate(([0], np.flatnonzero(np.diff(block) > 0.0) + 1))
    if len(edges) < 2:
        return np.empty(0)
    last, begins = edges[-1], edges[:-1]
    step = step[:last]
    # Not np.median: its first call imports numpy.ma, which takes 50 ms of a control loop.
    usual = float(np.sort(step)[len(step) // 2])
    # Neither signal is followed over gaps: a busy machine leaves some in most blocks.
    followed = (step > 0.0) & (step <= max(_GAP, _GAP_STEPS * usual))
    middle = 0.5 * (velocity[1:] + velocity[:-1])[:last]
    change = np.add.reduceat(np.diff(position)[:last] * followed, begins)
    integral = np.add.reduceat(middle * step * followed, begins)
    velocity_range = np.maximum.reduceat(middle, begins) - np.minimum.reduceat(middle, begins)
    rise = velocity[edges[1:]] - velocity[begins]
    moved = np.maximum(np.abs(change), np.abs(integral)) >= max(_SHORT, _FEW_COUNTS * resolution)
    change, integral, rise = change[moved], integral[moved], rise[moved]
    stuck = np.abs(change) <= _STILL_COUNTS * resolution
    ratio = np.divide(integral, change, out=np.full(len(change), math.inf), where=~stuck)
    # A delayed velocity explains a difference of up to its range times the delay. A low pass lags
    # while the joint becomes faster and leads while it becomes slower, which no unit does.
    missing = change - integral
    late = np.abs(missing) < _VELOCITY_LAG * velocity_range[moved]
    filtered = (missing * rise > 0.0) & (np.abs(missing) < _LOW_PASS * np.abs(rise))
    return np.where(late | filtered, 1.0, ratio)


def velocity_fault(ratios: np.ndarray, factor: float) -> str:
    """Return a description of how velocity contradicts position; '' if it does not.

    It does not if the median of `velocity_ratios` is between 1 / `factor` and `factor`.
    """
    if not len(ratios):
        return ''
    ratio = float(statistics.median(ratios))
    if 1.0 / factor < ratio < factor:
        return ''
    if not math.isfinite(ratio):
        return 'the position stands still while the velocity is not zero: the encoder is stuck'
    if abs(ratio) < 1e-9:
        return 'the position moves while the velocity stays zero: it is not measured, or stuck'
    text = f'velocity is {ratio:.3g} times the rate of position: '
    if 1.0 / factor < -ratio < factor:
        return text + 'one of the two has the wrong sign'
    unit = _name_unit(ratio, _VELOCITY_UNITS)
    if not unit and len(ratios) >= _STEADY_BLOCKS and np.mean(
            np.abs(ratios / ratio - 1.0) < _UNIT_TOLERANCE) > 0.5:
        # Noise and delays scatter; a constant factor everywhere is that of a unit or of the time.
        unit = ('in all of the motion: they differ in unit, or the time is off by this factor (its '
                f'unit, or a rate that is really {abs(ratio):.3g} times the one given)')
    return text + (unit or 'they differ in unit, or one of them is wrong') + (
        ', and one has the wrong sign' if ratio < 0.0 else '')


def lost_rows(time: np.ndarray, position: np.ndarray, step: float) -> float:
    """Return the share of rows before which others are missing in spite of their times; else 0.

    Between two rates that are alike the position, in steps of `step` rad, then moves a whole number
    of times as far, and seldom one and a half times, as it does by noise.
    """
    change = np.diff(time)
    rate = np.divide(np.diff(position), change, out=np.zeros(len(change)), where=change > 0.0)
    before, own, after = rate[:-2], rate[1:-1], rate[2:]
    size = np.abs((before, after))
    steady = (before * after > 0.0) & (size.max(axis=0) < 1.5 * size.min(axis=0)) & (
        size.min(axis=0) * change[1:-1] > _SURE_STEPS * step)
    if not steady.any():
        return 0.0
    ratio = 2.0 * own[steady] / (before + after)[steady]
    far, between = np.mean(ratio > 1.8), np.mean((ratio > 1.4) & (ratio < 1.8))
    return float(far) if far > _LOST and between < 0.2 * far else 0.0


class VelocityCheck:
    """Compares velocity with position, sample by sample or block by block.

    The median ratio of the latest `blocks` of motion must be between 1 / `factor` and `factor`;
    `resolution` is that of the encoder, rad, if known. With `zeros`, a velocity that has always
    been zero is accepted, since some drivers do not measure it. `fault` describes a contradiction,
    '' if there is none; it changes only while the joint moves.
    """

    def __init__(self, factor: float, blocks: int = 1, resolution: float = 0.0,
                 zeros: bool = False) -> None:
        self._factor, self._resolution = factor, resolution
        self._ratios: deque[float] = deque(maxlen=blocks)
        self._moved = not zeros
        self._samples: list[tuple[float, float, float]] = []
        self.fault = ''

    def interrupt(self) -> None:
        """Begin a new block, for instance after a gap."""
        self._samples.clear()

    def take(self, time: float, position: float, velocity: float) -> str:
        """Add a finite sample in s, rad and rad/s; return `fault`."""
        self._samples.append((time, position, velocity))
        if time - self._samples[0][0] >= BLOCK:
            self.judge(*np.array(self._samples).T)
            self._samples[:] = self._samples[-1:]
        return self.fault

    def judge(self, time: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
        """Update `fault` with a block of samples, each of shape (N,); takes about 0.1 ms."""
        self._moved = self._moved or bool(velocity.any())
        if self._moved:
            ratios = velocity_ratios(time, position, velocity, self._resolution)
            self._ratios.extend(ratios)
            if len(ratios) and len(self._ratios) == self._ratios.maxlen:
                self.fault = velocity_fault(np.array(self._ratios), self._factor)


# Measured compared with commanded current.

class Answer(NamedTuple):
    """How the measured current follows the commanded one."""

    gain: float             # ratio of measured to commanded current
    correlation: float      # of both, without subtracting the means
    error: float            # standard error of the gain
    delay: float            # s by which the measured current is late
    # RMS in A of the commanded current that has had at least `LATEST` to show a response.
    old_command: float


def by_position(position: np.ndarray, velocity: np.ndarray, current: np.ndarray, fewest: int
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return mean and variance of the current in motion, (B, 2), and the weight, (B,), by position.

    The columns are motion in the negative and the positive direction, with `fewest` samples of each
    at least; None if they hardly overlap. Whatever the weight, at a given position friction makes
    the current larger in the positive direction.
    """
    fast = np.abs(velocity) > 0.2 * np.quantile(np.abs(velocity), 0.95)
    if not fast.any() or np.ptp(position[fast]) == 0.0:
        return None
    position, current, forward = position[fast], current[fast], velocity[fast] > 0
    if np.ptp(position) > 4.0 * np.pi:
        # Gravity is periodic.
        position = np.mod(position, 2.0 * np.pi)
    edges = np.linspace(position.min(), position.max(), _BINS + 1)
    bin_index = 2 * np.clip(np.digitize(position, edges) - 1, 0, _BINS - 1) + forward
    count = np.bincount(bin_index, minlength=2 * _BINS).astype(float)
    with np.errstate(invalid='ignore', divide='ignore'):
        mean = np.bincount(bin_index, current, 2 * _BINS) / count
        spread = np.bincount(bin_index, current ** 2, 2 * _BINS) / count - mean ** 2
    fewer = np.minimum(count[0::2], count[1::2])
    used = fewer >= fewest
    if np.count_nonzero(used) < _FEWEST_BINS:
        return None
    return (mean.reshape(-1, 2)[used], spread.reshape(-1, 2)[used],
            fewer[used] / fewer[used].sum())


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
    index = int(np.argmax(size)) if size.max() > size[0] + _CLEARLY_BETTER else 0
    gain = float(product[index] / max(power[index], 1e-300))
    correlation = float(correlations[index])
    # Smoothed values are independent after twice the time constant.
    count = _MEMORY / (2.0 * _SMOOTHING)
    error = abs(gain) * math.sqrt(max(1.0 / max(correlation ** 2, 1e-12) - 1.0, 0.0) / count)
    return Answer(gain, correlation, error, float(delays[index]),
                  float(np.sqrt(power[-1] / len(back))))


def current_fault(gain: float, drive: Drive) -> str:
    """Return why the current computed from effort may be `gain` times the commanded one."""
    if abs(gain) < 1e-6:
        return 'effort is not measured'
    faults = ['effort has the wrong sign'] if gain < 0.0 else []
    if not 0.5 < abs(gain) < 2.0:
        torque = drive.torque_per_current
        unit = _name_unit(gain, {
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
        # removes most of the command.
        if power < _LEAST_REMAINING ** 2 * self._removed:
            return math.nan
        return product / power

    def answer(self) -> Answer:
        """Return how the measured current follows the commanded one, see `late_answer`."""
        if not self._past:
            return Answer(0.0, 0.0, 0.0, 0.0, 0.0)
        return late_answer(*np.array(self._past).T)
