# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Facts about position and velocity: what a joint can do, whether both agree, and their units."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
import math
import statistics
from typing import NamedTuple

import numpy as np

from friction_comp.samples import beyond, LIMITS, Samples
from friction_comp.statistics import gap_length, rms, smallest_step

STANDSTILL = 0.01
"""rad/s; slower, friction balances the other torques of a joint instead of following a model."""
AGREES = 1.25
"""Largest ratio of velocity and rate of position, or its inverse, that is no contradiction: that of
many blocks of motion. That of one block scatters, and may be the cube of it."""
FEWEST_BLOCKS = 5
"""Blocks of motion from which a recorded stretch tells whether velocity and position agree."""
BLOCK = 0.1
"""Duration over which velocity is integrated and compared with the change of position, s."""
# Relative difference up to which a ratio is reported as that of a known unit.
UNIT_TOLERANCE = 0.1
# Turns of units other than rad: values wrap around at them, and encoders divide them.
_TURNS = {'turn': 1.0, 'deg': 360.0}
# A jump by about so much of a turn is a wrapped angle, if others are no larger than a share of it.
_WRAP, _SLOW = (0.9, 1.1), 0.05
# Fewest values, or steps that they cover, that tell of units and glitches.
_FEWEST = 100

_VELOCITY_UNITS = {
    math.degrees(1.0): 'velocity is in deg/s, not rad/s',
    30.0 / math.pi: 'velocity is in turns per minute, not rad/s',
    0.5 / math.pi: 'velocity is in turns per second, not rad/s',
    1000.0: 'velocity is in mrad/s, position in 1000 rad or time in ms',
    math.radians(1.0): 'position is in degrees, not rad',
    2.0 * math.pi: 'position is in turns, not rad, or velocity that before a gear of 6',
    0.001: 'position is in mrad, or velocity in 1000 rad/s',
}


# Values that no joint can have.

def impossible(samples: Samples) -> str:
    """Return which value, or jump of the position, no joint can have; '' if there is none."""
    for signal, (limit, unit) in LIMITS.items():
        values = getattr(samples, signal)
        if values is not None and (wrong := beyond(signal, values)).any():
            worst = int(np.argmax(np.where(wrong, np.abs(values), 0.0)))
            return (f'{signal.replace("_", " ")} of {values[worst]:.4g} {unit} at '
                    f'{samples.time[worst]:.3f} s is impossible ({np.count_nonzero(wrong)} '
                    f'of {len(values)} values beyond {limit:.0e} {unit})')
    step = np.diff(samples.time)
    with np.errstate(divide='ignore', invalid='ignore'):
        rate = np.abs(np.where(step > 0, np.diff(samples.position) / step, 0.0))
    if not beyond('velocity', rate).any():
        return ''
    worst = int(np.argmax(rate))
    return (f'position jumps from {samples.position[worst]:.4g} to '
            f'{samples.position[worst + 1]:.4g} rad within {step[worst]:.3g} s at '
            f'{samples.time[worst]:.3f} s, which is impossible (wrong unit of position or of '
            'the stamps?)')


def glitches(position: np.ndarray) -> np.ndarray:
    """Return which positions are far from both neighbours, which agree, bool, shape (N,).

    No joint jumps away and back. Where many do, it is no matter of single samples, and none is.
    """
    odd = np.zeros(len(position), dtype=bool)
    if len(position) < 2 * _FEWEST:
        return odd
    away = np.abs(position[1:-1] - 0.5 * (position[2:] + position[:-2]))
    usual = max(float(np.quantile(away, 0.98)), smallest_step(position))
    odd[1:-1] = (away > 20.0 * usual) & (np.abs(position[2:] - position[:-2]) < 0.5 * away)
    return odd if odd.mean() < 0.005 else np.zeros_like(odd)


# Units of the position.

def turns_of(time: np.ndarray, angle: np.ndarray, turn: float = 2.0 * np.pi) -> np.ndarray:
    """Return the whole turns to add to an angle, which may wrap around, each of shape (N,).

    Times are in s; a `turn` is in the angle's unit. Across a gap the joint may have moved.
    """
    jumps, steps = np.diff(angle), np.diff(time)
    size = np.abs(jumps) / turn
    wraps = (size > _WRAP[0]) & (size < _WRAP[1]) & (steps <= gap_length(steps))
    # Jumps are wraps only if the joint is slow otherwise.
    if not wraps.any() or np.quantile(size, 0.9) > _SLOW:
        return np.zeros(len(angle))
    return np.concatenate(([0.0], np.cumsum(np.where(wraps, -np.sign(jumps), 0.0))))


def at_times(times: np.ndarray, own: np.ndarray, values: np.ndarray, hole: float = 0.0,
             turn: float = 0.0) -> np.ndarray:
    """Return values, shape (N,), interpolated from their `own` times, rising, to others, s.

    They are NaN farther than a gap beyond the ends, and in gaps longer than `hole`, s; a single one
    holds for all. Those of an angle that may wrap around at a `turn` are continued over it.
    """
    if turn:
        values = values + turn * turns_of(own, values, turn)
    interpolated: np.ndarray = np.interp(times, own, values)
    if len(own) > 1:
        steps = np.diff(own)
        gap = gap_length(steps)
        beyond = np.maximum(own[0] - times, times - own[-1])
        following = np.searchsorted(own, times).clip(1, len(steps))
        within = (steps[following - 1] > max(gap, hole)) & ~np.isin(times, own)
        interpolated[(beyond > gap) | ((beyond <= 0.0) & within)] = np.nan
    return interpolated


def whole_numbers(values: np.ndarray) -> str:
    """Return that values, shape (N,), are whole numbers, as of a register; '' if they are not."""
    values = values[np.isfinite(values)]
    whole = len(values) >= _FEWEST // 2 and len(np.unique(values[:100_000])) > 3 and (
        values == np.round(values)).all()
    return 'holds whole numbers' * bool(whole)


def not_in_radians(position: np.ndarray, seconds: float = math.inf) -> str:
    """Return what tells that positions, shape (N,), are not in rad; '' if nothing does.

    They are whole numbers, as of a register, wrap around at one or 360, or move in the steps of an
    encoder of a turn or 360 degrees. Friction in a wrong unit of position fits as well. Of a joint
    with a gear, the `seconds` that they took tell, too: over two turns a second is too fast.
    """
    position = position[np.isfinite(position)]
    if fault := whole_numbers(position):
        return fault
    speed = float(np.abs(np.diff(position)).sum()) / max(seconds, 1e-9)
    if speed > 15.0:
        return (f'moves at {speed:.3g} rad/s on average: fast for a joint, as if it were in '
                'degrees or that of the motor before the gear')
    if len(position) < _FEWEST:
        return ''
    for unit, turn in _TURNS.items():
        if np.ptp(position) <= 1.001 * turn and turns_of(
                np.arange(len(position)), position, turn).any():
            return f'jumps by {turn:g}, as an angle in {unit} that wraps around'
    # Values that are not on the steps of a unit are 0.29 off them.
    if _distance(position, 2.0 * math.pi) < 0.2:
        return ''
    for unit, turn in _TURNS.items():
        if _distance(position, turn) < 0.05:
            return (f'moves in steps of {smallest_step(position):.6g}, a turn divided by a power '
                    f'of two if it is in {unit}')
    return ''


def _distance(position: np.ndarray, turn: float) -> float:
    """Return how far values are from the steps of an encoder, in steps, RMS; 0.5 without steps."""
    step = smallest_step(position)
    bits = round(math.log2(turn / step)) if step else 0
    steps = (position - position[0]) * 2.0 ** bits / turn
    # More bits are rounding errors; over few steps, sizes of steps of two units are alike.
    if not 8 <= bits <= 20 or abs(step * 2.0 ** bits / turn - 1.0) > 0.02 or (
            np.ptp(steps) <= _FEWEST):
        return 0.5
    return rms(steps - np.round(steps))


def name_unit(ratio: float, units: Mapping[float, str]) -> str:
    """Return the text for the unit whose factor matches a ratio; '' if there is none."""
    nearest = min(units, key=lambda unit: abs(math.log(unit / max(abs(ratio), 1e-300))))
    return units[nearest] if abs(abs(ratio) / nearest - 1.0) < UNIT_TOLERANCE else ''


# Velocity compared with position.

class Agreement(NamedTuple):
    """How velocity and rate of position compare."""

    ratio: float = 1.0  # median over blocks of motion; infinite, or 0, if one of the two stands
    blocks: int = 0     # blocks of `BLOCK` s in which the joint moved
    fault: str = ''     # how the velocity contradicts the position; '' if it does not
    cause: str = ''     # the unit, sign or time that is wrong, where the ratio tells it


def velocity_agreement(time: np.ndarray, position: np.ndarray, velocity: np.ndarray,
                       resolution: float = 0.0) -> Agreement:
    """Return how velocity and position of a recorded stretch agree, as of `velocity_ratios`.

    No fault is told of fewer than `FEWEST_BLOCKS` blocks.
    """
    ratios = velocity_ratios(time, position, velocity, resolution)
    if len(ratios) < FEWEST_BLOCKS:
        return Agreement(blocks=len(ratios))
    return agreement_of(ratios)


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
    # Neither signal is followed over gaps: a busy machine leaves some in most blocks.
    followed = (step > 0.0) & (step <= gap_length(step))
    middle = 0.5 * (velocity[1:] + velocity[:-1])[:last]
    change = np.add.reduceat(np.diff(position)[:last] * followed, begins)
    integral = np.add.reduceat(middle * step * followed, begins)
    velocity_range = np.maximum.reduceat(middle, begins) - np.minimum.reduceat(middle, begins)
    rise = velocity[edges[1:]] - velocity[begins]
    # Less motion, in rad and counts, tells nothing; less than 2.5 counts are none.
    moved = np.maximum(np.abs(change), np.abs(integral)) >= max(2e-3, 50.0 * resolution)
    change, integral, rise = change[moved], integral[moved], rise[moved]
    stuck = np.abs(change) <= 2.5 * resolution
    ratio = np.divide(integral, change, out=np.full(len(change), math.inf), where=~stuck)
    # A velocity that a drive delays by 20 ms explains a difference of up to its range times the
    # delay. A low pass, of up to 0.1 s, lags while the joint becomes faster and leads while it
    # becomes slower, which no unit does.
    missing = change - integral
    late = np.abs(missing) < 0.02 * velocity_range[moved]
    filtered = (missing * rise > 0.0) & (np.abs(missing) < 0.1 * np.abs(rise))
    return np.where(late | filtered, 1.0, ratio)


def agreement_of(ratios: np.ndarray) -> Agreement:
    """Return how velocity and position agree, by their ratios in blocks of motion, shape (K,).

    They do if the median is within `AGREES`, and what blocks scatter around it.
    """
    if not len(ratios):
        return Agreement()
    ratio, count = float(statistics.median(ratios)), len(ratios)
    most = AGREES ** (1.0 + 2.0 / math.sqrt(count))
    if 1.0 / most < ratio < most:
        return Agreement(ratio, count)
    if not math.isfinite(ratio):
        return Agreement(ratio, count, 'the position stands still while the velocity is not zero: '
                         'the encoder is stuck')
    if abs(ratio) < 1e-9:
        return Agreement(ratio, count, 'the position moves while the velocity stays zero: it is '
                         'not measured, or stuck')
    text = f'velocity is {ratio:.3g} times the rate of position: '
    if 1.0 / most < -ratio < most:
        cause = 'one of the two has the wrong sign'
        return Agreement(ratio, count, text + cause, cause)
    cause = name_unit(ratio, _VELOCITY_UNITS)
    if not cause and count >= 10 and np.mean(
            np.abs(ratios / ratio - 1.0) < UNIT_TOLERANCE) > 0.5:
        # Noise and delays scatter; a constant factor everywhere is that of a unit or of the time.
        cause = ('in all of the motion: they differ in unit, one is before a gear, or the rate is '
                 f'really {abs(ratio):.3g} times the one given')
    sign = ', and one has the wrong sign' if ratio < 0.0 else ''
    return Agreement(ratio, count, text + (
        cause or 'they differ in unit, or one of them is wrong') + sign, cause or sign)


class VelocityCheck:
    """Compares velocity with position, sample by sample or block by block.

    Judged are the latest `blocks` of motion; `resolution` is that of the encoder, rad, if known.
    With `zeros`, a velocity that has always been zero is accepted, since some drivers do not
    measure it. `fault` describes a contradiction, '' if there is none; it changes only while the
    joint moves.
    """

    def __init__(self, blocks: int = 1, resolution: float = 0.0, zeros: bool = False) -> None:
        self._resolution = resolution
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
                self.fault = agreement_of(np.array(self._ratios)).fault


def positions(position: np.ndarray) -> float:
    """Return the number of positions that an encoder resolves, infinite if hardly any repeats."""
    values = np.unique(np.round(position / max(float(np.ptp(position)), 1e-300), 9))
    return math.inf if len(values) > 0.5 * len(position) else float(len(values))
