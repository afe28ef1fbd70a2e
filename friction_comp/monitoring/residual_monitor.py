# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Running statistics of a model's residual and of the variables it depends on.

A block is a short piece of motion in one direction. Averaging over blocks removes the noise of
single samples and leaves a few values per second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from friction_comp.checks import check_number
from friction_comp.facts.motion import STANDSTILL
from friction_comp.model.friction_change import friction_change, FrictionChange
from friction_comp.model.measured import LARGER, Recorded
from friction_comp.number_text import quantity
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges, rms

# Length of a block and of the shortest one that is used, s.
_BLOCK, _SHORTEST = 0.4, 0.1
# Blocks used for the error, and blocks kept to find the variables that explain it.
_RECENT, _KEPT = 60, 4000
# A joint stands still, too, below this share of its usual speed.
_SLOW_SHARE = 0.1
# A warning ends at this share of the error that starts it.
_HYSTERESIS = 0.8
# A variable is named if it explains this share of the residual, and at most so much less than the
# best one.
_NAMED_SHARE, _NAMED_MARGIN = 0.3, 0.1
_BINS = 6
# Fewest blocks before or after a change in time.
_FEWEST_BESIDE = 5
# Of the squared error, what friction, load and inertia must leave for a variable to be looked for.
_LEFT = 0.1
# Columns of the table of blocks.
(_TIME, _POSITION, _VELOCITY, _ACCELERATION, _LOAD, _TEMPERATURE, _RESIDUAL, _PREDICTED,
 _FRICTION) = range(9)


@dataclass(frozen=True)
class ModelFit:
    """Verdict on how well a model fits the motion so far."""

    # Whether there was enough motion for a verdict.
    known: bool = False
    # Whether the error is within the tolerance; True if not known.
    fits: bool = True
    # RMS error of the last blocks, relative to the RMS of the model's friction, and in A.
    share: float = 0.0
    error: float = 0.0
    # Variables that explain how the friction varies, and the share of that which each explains,
    # largest first.
    explained_by: tuple[tuple[str, float], ...] = ()
    # What else explains the error, in words, and the change of the friction as a share of the
    # model's, 0 where it explains too little.
    causes: tuple[str, ...] = ()
    level: float = 0.0
    # Whether it fits only because refinement expects no smaller error of it.
    as_expected: bool = False
    unit: str = 'A'

    @property
    def text(self) -> str:
        """The verdict as one line of text."""
        if not self.known:
            return 'not enough motion yet to tell whether the model fits'
        error = f'{100 * self.share:.0f} % of the friction ({quantity(self.error, self.unit)})'
        if self.fits:
            return (f'its error is {error}, which refine expected: the model was never better'
                    if self.as_expected else f'the model fits: its error is {error}')
        causes = list(self.causes)
        if self.explained_by:
            causes.append('its variation depends on ' + ' or '.join(
                f'{name} ({100 * share:.0f} %)' for name, share in self.explained_by))
        why = '; '.join(causes) or 'no monitored variable explains it'
        return f'the model no longer fits: its error is {error}; {why}'


class ResidualMonitor:
    """Monitors the residual of one joint.

    `tolerance` is the largest error per friction, beyond what `recorded` tells of the model.
    """

    def __init__(self, tolerance: float, recorded: Recorded | None = None, unit: str = 'A') -> None:
        self.tolerance = check_number(tolerance, 'tolerance', above=0.0)
        self._recorded, self._unit = recorded or Recorded(), unit
        self._blocks = np.empty((0, 9))
        self._speed = 0.0
        self._warned = False

    def add(self, samples: Samples, residual: np.ndarray, predicted: np.ndarray,
            friction: np.ndarray) -> None:
        """Add samples with velocity and acceleration.

        Residual, prediction, and the part of it that is friction are in A, shape (N,).
        """
        if len(samples) < 2 or samples.velocity is None or samples.acceleration is None:
            return
        speed = np.abs(samples.velocity)
        fast = float(np.percentile(speed, 90))
        self._speed = max(fast, 0.99 * self._speed)
        moving = speed > max(STANDSTILL, _SLOW_SHARE * self._speed)
        moving &= np.isfinite(residual) & np.isfinite(predicted)
        load, temperature = (
            np.full(len(samples), np.nan) if signal is None else signal
            for signal in (samples.load, samples.temperature))
        table = np.column_stack([
            samples.time, samples.position, samples.velocity, samples.acceleration, load,
            temperature, residual, predicted, friction])
        means = [table[part].mean(axis=0) for part in _block_slices(samples, moving)]
        if means:
            self._blocks = np.vstack((self._blocks, means))[-_KEPT:]

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self._blocks)

    def error(self, blocks: int) -> float:
        """Return the RMS error of the last `blocks` blocks in A, without inertia."""
        last = self._blocks[-blocks:]
        return rms(last[:, _RESIDUAL] - self._change(last).inertia)

    def verdict(self) -> ModelFit:
        """Return the verdict on the blocks so far."""
        if self.blocks < _RECENT // 2:
            return ModelFit()
        last = self._blocks[-_RECENT:]
        error, friction = self.error(_RECENT), max(rms(last[:, _FRICTION]), 1e-12)
        expected = LARGER * self._recorded.error_at(np.abs(last[:, _VELOCITY]))
        limit = max(self.tolerance * friction, expected)
        self._warned = error > limit * (_HYSTERESIS if self._warned else 1.0)
        fit = ModelFit(True, not self._warned, error / friction, error, unit=self._unit,
                       as_expected=error > self.tolerance * friction)
        return self._explained(fit, last) if self._warned else fit

    def _change(self, blocks: np.ndarray) -> FrictionChange:
        motion = Samples(
            time=blocks[:, _TIME], position=blocks[:, _POSITION], current=blocks[:, _RESIDUAL],
            velocity=blocks[:, _VELOCITY], acceleration=blocks[:, _ACCELERATION])
        return friction_change(
            blocks[:, _RESIDUAL], blocks[:, _PREDICTED], blocks[:, _FRICTION], motion,
            self._recorded.error_at(np.abs(blocks[:, _VELOCITY])))

    def _explained(self, fit: ModelFit, last: np.ndarray) -> ModelFit:
        """Return the verdict on a model that does not fit, with the causes."""
        change = self._change(last)
        by: tuple[tuple[str, float], ...] = ()
        if not change.whole:
            # A recent change shows only in the last blocks.
            by = (self._explaining_variables(self._blocks, bool(change.level))
                  or self._explaining_variables(last, bool(change.level)))
        return replace(fit, level=change.level, causes=tuple(change.causes(self._unit)),
                       explained_by=by)

    def _explaining_variables(self, blocks: np.ndarray, throughout: bool
                              ) -> tuple[tuple[str, float], ...]:
        """Return the variables that explain the residual, each with its share, the largest first.

        Of three forms of the residual, the one that a single variable explains best is used: as it
        is (an offset), in the direction of motion (resistance), and relative to the model's
        friction (wear or warm-up). With a change of the friction level (`throughout`), only the
        last is considered.
        """
        change = self._change(blocks)
        residual = blocks[:, _RESIDUAL] - change.inertia
        if rms(residual - change.friction - change.load) ** 2 < _LEFT * rms(residual) ** 2:
            return ()
        residual, side = residual - change.load, np.sign(blocks[:, _VELOCITY])
        friction = np.abs(blocks[:, _FRICTION])
        relative = residual * side / np.maximum(friction, max(0.3 * np.median(friction), 1e-12))
        columns = {'temperature': blocks[:, _TEMPERATURE], 'time': blocks[:, _TIME],
                   'position': blocks[:, _POSITION], 'load': blocks[:, _LOAD],
                   'speed': np.abs(blocks[:, _VELOCITY])}
        forms = [relative] if throughout else [relative, residual, residual * side]

        def explained(values: np.ndarray) -> dict[str, float]:
            shares = {name: _explained(values, variable) for name, variable in columns.items()}
            return {**shares, 'time': max(shares['time'], _explained_by_step(values))}
        best = max(map(explained, forms), key=lambda shares: max(shares.values()))
        least = max(_NAMED_SHARE, max(best.values()) - _NAMED_MARGIN)
        return tuple(sorted((item for item in best.items() if item[1] >= least),
                            key=lambda item: -item[1]))


def _block_slices(samples: Samples, moving: np.ndarray) -> Iterator[slice]:
    """Yield the slices of samples that form blocks."""
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


def _explained(values: np.ndarray, variable: np.ndarray) -> float:
    """Return the share of the variance of values that a variable explains, corrected for chance.

    The variable is divided into bins of equal count. The result is epsilon squared, eta squared of
    the bin means corrected for its expectation under independence (Kelley 1935).
    """
    known = np.isfinite(variable)
    values, variable = values[known], variable[known]
    size = len(values)
    if size < 4 * _BINS or np.ptp(values) <= 0.0 or np.ptp(variable) <= 0.0:
        return 0.0
    _, index, count = np.unique(np.searchsorted(quantile_edges(variable, _BINS), variable),
                                return_inverse=True, return_counts=True)
    means = np.bincount(index, values) / count
    within = float(np.sum((values - means[index]) ** 2)) / (size - len(count))
    return max(0.0, 1.0 - within / float(np.var(values, ddof=1)))


def _explained_by_step(values: np.ndarray) -> float:
    """Return the share of the variance of values, in order, that one step change explains."""
    size, centred = len(values), values - values.mean()
    total = float(centred @ centred)
    if size < 4 * _FEWEST_BESIDE or total <= 0.0:
        return 0.0
    before = np.arange(_FEWEST_BESIDE, size - _FEWEST_BESIDE + 1)
    between = np.cumsum(centred)[before - 1] ** 2 * (1.0 / before + 1.0 / (size - before))
    # The best of all positions explains this much by chance (law of the iterated logarithm, with
    # a margin).
    chance = 2.0 * (1.0 + np.log(np.log(size))) * total / size
    return max(0.0, float(between.max() - chance) / total)
