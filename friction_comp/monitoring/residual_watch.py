# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Running statistics of a model's residual and of the variables it depends on.

A block is a short piece of motion in one direction. Averaging over it removes the noise of single
samples, so that a few numbers a second say all there is to know.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from friction_comp.checks import check_number
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges

VARIABLES = ('temperature', 'time', 'position', 'load', 'speed')
# Length of a block and the shortest that counts, s.
_BLOCK, _SHORTEST = 0.4, 0.1
# Slower than this is standstill, rad/s, and so is less than this share of the usual speed.
_STANDSTILL, _SLOW_SHARE = 0.01, 0.1
# A warning ends when the error has fallen to this share of what began it.
_ENDS = 0.8
# A variable is named if it explains this share of the residual, and beside the first of them if it
# explains nearly as much.
_WORTH_NAMING, _NEARLY = 0.3, 0.1
_BINS = 6
# Fewest blocks before or after a change in time.
_SIDE = 5
# The residual is one change of the friction level if its average is this share of its mean square.
_THROUGHOUT = 0.6
# Columns of the table of blocks.
(_TIME, _POSITION, _VELOCITY, _ACCELERATION, _LOAD, _TEMPERATURE, _RESIDUAL,
 _PREDICTED) = range(8)


@dataclass(frozen=True)
class ModelFit:
    """How well a model fits the motion so far, by its residual.

    Parameters
    ----------
    known : bool
        Whether there was enough motion to say anything.
    fits : bool
        Whether the error is within the tolerance; True while nothing is known.
    share : float
        RMS error of the last blocks as a share of the RMS current that the model gives for them.
    error : float
        The same RMS error in A.
    goes_with : tuple of (str, float)
        Variables that the residual goes with and the share of it that each explains, largest first.
    level : float
        By which share the friction is higher than the model's throughout; 0 where the residual is
        no such thing.
    """

    known: bool = False
    fits: bool = True
    share: float = 0.0
    error: float = 0.0
    goes_with: tuple[tuple[str, float], ...] = ()
    level: float = 0.0

    @property
    def words(self) -> str:
        """One line for a person."""
        if not self.known:
            return 'not enough motion yet to tell whether the model fits'
        error = f'{100 * self.share:.0f} % of the friction ({1e3 * self.error:.3g} mA)'
        if self.fits:
            return f'the model fits: its error is {error}'
        why = []
        if self.level:
            side = 'higher' if self.level > 0 else 'lower'
            why.append(f'the friction is {100 * abs(self.level):.0f} % {side} throughout')
        if self.goes_with:
            why.append('what changes in it goes with ' + ' or '.join(
                f'{name} ({100 * share:.0f} %)' for name, share in self.goes_with))
        return (f'the model no longer fits: its error is {error}; '
                + ('; '.join(why) or 'it goes with nothing that is watched'))


class ResidualWatch:
    """Watches the residual of one joint.

    Parameters
    ----------
    tolerance : float
        Share of the friction that the error may be.
    recent : int
        Blocks in motion that the error is told from.
    kept : int
        Blocks in motion that are kept to tell what it goes with.
    """

    def __init__(self, tolerance: float = 0.25, recent: int = 60, kept: int = 4000):
        self.tolerance = check_number(tolerance, 'tolerance', above=0.0)
        self._recent, self._kept = recent, kept
        self._blocks = np.empty((0, 8))
        self._speed = 0.0
        self._warned = False

    def forget(self) -> None:
        """Start over, as with another model."""
        self._blocks = np.empty((0, 8))
        self._warned = False

    def take(self, samples: Samples, residual: np.ndarray, predicted: np.ndarray) -> None:
        """Take a stretch of measured data.

        Parameters
        ----------
        samples : Samples
            With velocity and acceleration.
        residual, predicted : ndarray, shape (N,)
            A.
        """
        if len(samples) < 2 or samples.velocity is None or samples.acceleration is None:
            return
        speed = np.abs(samples.velocity)
        fast = float(np.percentile(speed, 90))
        self._speed = max(fast, 0.99 * self._speed)
        moving = speed > max(_STANDSTILL, _SLOW_SHARE * self._speed)
        moving &= np.isfinite(residual) & np.isfinite(predicted)
        none = np.full(len(samples), np.nan)
        table = np.column_stack([
            samples.time, samples.position, samples.velocity, samples.acceleration,
            none if samples.load is None else samples.load,
            none if samples.temperature is None else samples.temperature, residual, predicted])
        means = [table[part].mean(axis=0) for part in _pieces(samples, moving)]
        if means:
            self._blocks = np.vstack((self._blocks, means))[-self._kept:]

    @property
    def blocks(self) -> int:
        """How many blocks are kept."""
        return len(self._blocks)

    def error(self, blocks: int) -> float:
        """Return the RMS error of the last so many blocks in A, inertia apart."""
        return float(np.sqrt(np.mean(_without_inertia(self._blocks[-blocks:]) ** 2)))

    def verdict(self) -> ModelFit:
        """Return the verdict on the blocks so far."""
        if len(self._blocks) < self._recent // 2:
            return ModelFit()
        last = self._blocks[-self._recent:]
        residual = _without_inertia(last)
        error = self.error(self._recent)
        friction = float(np.sqrt(np.mean(last[:, _PREDICTED] ** 2)))
        share = error / max(friction, 1e-12)
        limit = self.tolerance * (_ENDS if self._warned else 1.0)
        self._warned = share > limit
        if not self._warned:
            return ModelFit(True, True, share, error)
        level = _level(last, residual)
        # What has only just begun shows in the last blocks alone.
        named = _goes_with(self._blocks, bool(level)) or _goes_with(last, bool(level))
        return ModelFit(True, False, share, error, named, level)


def _goes_with(blocks: np.ndarray, throughout: bool) -> tuple[tuple[str, float], ...]:
    """Return the variables that explain the residual, in the clearest of three readings.

    What resists turns round with the motion, what pushes does not, and a wear or a warming
    changes friction by a share of itself, which is the only reading if it does so throughout.
    """
    residual = _without_inertia(blocks)
    columns = {'temperature': blocks[:, _TEMPERATURE], 'time': blocks[:, _TIME],
               'position': blocks[:, _POSITION], 'load': blocks[:, _LOAD],
               'speed': np.abs(blocks[:, _VELOCITY])}
    readings = [_ratio(blocks, residual)]
    if not throughout:
        readings += [residual, residual * np.sign(blocks[:, _VELOCITY])]
    found = max(
        ([(name, max(_explained(values, variable),
                     _change(values) if name == 'time' else 0.0))
          for name, variable in columns.items()] for values in readings),
        key=lambda shares: max(share for _, share in shares))
    found = sorted((item for item in found if item[1] >= _WORTH_NAMING),
                   key=lambda item: -item[1])
    return tuple(item for item in found if item[1] >= found[0][1] - _NEARLY)


def _ratio(blocks: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return the residual as a share of the friction that the model gives, with its sign."""
    friction = np.abs(blocks[:, _PREDICTED])
    floor = 0.3 * np.median(friction)
    return residual * np.sign(blocks[:, _VELOCITY]) / np.maximum(friction, max(floor, 1e-12))


def _level(blocks: np.ndarray, residual: np.ndarray) -> float:
    ratio = _ratio(blocks, residual)
    mean = float(ratio.mean())
    return mean if mean ** 2 > _THROUGHOUT * float(np.mean(ratio ** 2)) else 0.0


def _pieces(samples: Samples, moving: np.ndarray) -> Iterator[slice]:
    """Give the slices of samples that become blocks."""
    step, velocity = samples.sample_time, samples.velocity
    if step <= 0.0 or velocity is None:
        return
    shortest, length = max(2, round(_SHORTEST / step)), max(2, round(_BLOCK / step))
    side = np.where(moving, np.sign(velocity), 0.0)
    for part in samples.segments():
        turns = np.nonzero(np.diff(side[part]))[0] + 1 + part.start
        edges = [part.start, *turns, part.stop]
        for begin, end in zip(edges[:-1], edges[1:]):
            if side[begin] == 0.0 or end - begin < shortest:
                continue
            count = max(1, round((end - begin) / length))
            bounds = np.linspace(begin, end, count + 1).astype(int)
            yield from (slice(a, b) for a, b in zip(bounds[:-1], bounds[1:]))


def _without_inertia(blocks: np.ndarray) -> np.ndarray:
    """Return the residual without its dependence on acceleration: inertia is no friction."""
    residual, acceleration = blocks[:, _RESIDUAL], blocks[:, _ACCELERATION]
    columns = np.column_stack((np.ones(len(blocks)), np.sign(blocks[:, _VELOCITY]), acceleration))
    fit = np.linalg.lstsq(columns, residual, rcond=None)[0]
    return residual - fit[2] * acceleration


def _explained(values: np.ndarray, variable: np.ndarray) -> float:
    """Return the share of the variance of values that a variable explains, chance taken off.

    The variable is cut into ranges that hold equally many blocks; what the averages of the ranges
    explain is eta squared, and epsilon squared what is left of it for a variable that has
    nothing to do with the values (Kelley 1935).
    """
    known = np.isfinite(variable)
    values, variable = values[known], variable[known]
    size = len(values)
    total = float(np.sum((values - values.mean()) ** 2)) if size else 0.0
    if size < 4 * _BINS or total <= 0.0 or np.ptp(variable) <= 0.0:
        return 0.0
    index = np.searchsorted(quantile_edges(variable, _BINS), variable)
    count = np.bincount(index)
    used = count > 0
    means = np.bincount(index, values)[used] / count[used]
    within = total - float(np.sum(count[used] * (means - values.mean()) ** 2))
    groups = int(used.sum())
    if size <= groups:
        return 0.0
    return max(0.0, 1.0 - within / (size - groups) * (size - 1) / total)


def _change(values: np.ndarray) -> float:
    """Return the share of the variance of values, in order, that one change of them explains."""
    size = len(values)
    total = float(np.sum((values - values.mean()) ** 2))
    if size < 4 * _SIDE or total <= 0.0:
        return 0.0
    before = np.arange(_SIDE, size - _SIDE + 1)
    sums = np.cumsum(values - values.mean())[before - 1]
    between = sums ** 2 * (1.0 / before + 1.0 / (size - before))
    # By chance the best of all places explains this much (twice the log of the log of their number,
    # the law of the iterated logarithm, with room).
    chance = 2.0 * (1.0 + np.log(np.log(size))) * total / size
    return max(0.0, float(between.max() - chance) / total)
