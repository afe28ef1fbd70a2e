# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the model of a running joint still fits: its residual, and what that depends on.

A block is a short piece of motion in one direction. Averaging over blocks removes the noise of
single samples and leaves a few values per second.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friction_comp.checks import check_number
from friction_comp.errors import InputError
from friction_comp.facts.motion import STANDSTILL
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.measured import LARGER, Recorded
from friction_comp.monitoring.friction_change import friction_change, FrictionChange
from friction_comp.number_text import quantity
from friction_comp.samples import Samples
from friction_comp.statistics import quantile_edges, rms

# s before the new rows that are computed again to let filters and effect states settle, and s at
# the end that wait for later rows, because a zero-phase filter needs them.
_SETTLING, _LOOKAHEAD = 3.0, 0.3
# Columns of a row: time, position, velocity, current, load, temperature.
_WIDTH = 6
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
            by = self._explaining_variables(self._blocks) or self._explaining_variables(last)
        return replace(fit, level=change.level, causes=tuple(change.causes(self._unit)),
                       explained_by=by)

    def _explaining_variables(self, blocks: np.ndarray) -> tuple[tuple[str, float], ...]:
        """Return the variables that explain how friction, as a share of the model's, varies.

        Each with its share of the variance, the largest first.
        """
        change = self._change(blocks)
        residual = blocks[:, _RESIDUAL] - change.inertia
        if rms(residual - change.friction - change.load) ** 2 < _LEFT * rms(residual) ** 2:
            return ()
        friction = np.abs(blocks[:, _FRICTION])
        relative = (residual - change.load) * np.sign(blocks[:, _VELOCITY]) / np.maximum(
            friction, max(0.3 * np.median(friction), 1e-12))
        shares = {name: _explained(relative, variable) for name, variable in (
            ('temperature', blocks[:, _TEMPERATURE]), ('time', blocks[:, _TIME]),
            ('position', blocks[:, _POSITION]), ('load', blocks[:, _LOAD]),
            ('speed', np.abs(blocks[:, _VELOCITY])))}
        least = max(_NAMED_SHARE, max(shares.values()) - _NAMED_MARGIN)
        return tuple(sorted((item for item in shares.items() if item[1] >= least),
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


class LiveResidual:
    """Compares the measured current of one joint with its model.

    The motor and the person move the joint together, J·a = k_t·n·i + τ_b - F, so friction in A is
    i + τ_b/(k_t·n). Without a measured load, the current alone is compared. This is meaningless
    while a compensator feeds the same model forward and a person moves the joint; the caller then
    sets `blind`. `tolerance` is that of `ResidualMonitor`.
    """

    def __init__(self, model: FrictionModel, tolerance: float = 0.25):
        self.model, self._tolerance = model.on_another_day(), tolerance
        self.blind = ''
        self._start_over()

    def _start_over(self) -> None:
        self.monitor = ResidualMonitor(self._tolerance, self.model.recorded, self.model.unit)
        self._rows = np.empty((0, _WIDTH))
        self._done, self._origin = -np.inf, np.nan

    def add(self, rows: np.ndarray) -> None:
        """Add rows of measurements, shape (N, 6), NaN where there is none.

        Time in s, increasing; position; velocity; motor current in A; load in N·m; temperature, °C.
        """
        rows = np.asarray(rows, dtype=float).reshape(-1, _WIDTH)
        rows = rows[np.isfinite(rows[:, [0, 1, 3]]).all(axis=1)]
        if not len(rows):
            return
        if not len(self._rows) or rows[0, 0] < self._rows[-1, 0]:
            # Where time decreased, a new run began.
            self._start_over()
            self._origin = rows[0, 0]
        self._rows = np.vstack((self._rows, rows))
        self._compare()
        self._rows = self._rows[self._rows[:, 0] >= self._done - _SETTLING]

    def _compare(self) -> None:
        rows = self._rows
        ready = rows[-1, 0] - _LOOKAHEAD
        if ready - self._done < _LOOKAHEAD or len(rows) < 10:
            return
        new = (rows[:, 0] > self._done) & (rows[:, 0] <= ready)
        # Even if they cannot be compared: rows that are not done are kept.
        self._done = ready
        samples = self._samples(rows)
        settings: dict[str, Any] = dict(self.model.differentiation or DEFAULT_SETTINGS)
        if settings.get('source') == 'velocity' and samples.velocity is None:
            settings = DEFAULT_SETTINGS
        differentiated = differentiate(samples, settings)
        self.blind = self._missing(differentiated)
        if self.blind:
            return
        # Time counts from the beginning of the run, not of the rows that are kept.
        differentiated = differentiated.with_(time=rows[:, 0] - self._origin)
        try:
            predicted, friction = self.model.parts(differentiated)
        except InputError as error:
            # For instance, a model of an arm needs the motion of other joints.
            self.blind = str(error)
            return
        residual = differentiated.current - predicted
        self.monitor.add(
            differentiated.take(new), residual[new], predicted[new], friction[new])

    def _missing(self, samples: Samples) -> str:
        """Return which signals, or the torque of an arm's links, the model lacks here."""
        missing = sorted({signal for effect in self.model.effects for signal in effect.needs
                          if getattr(samples, signal, None) is None})
        return f'the model needs {" and ".join(missing)}, unknown here' if missing else ''

    def _samples(self, rows: np.ndarray) -> Samples:
        measured: dict[str, Any] = {
            name: rows[:, index]
            for name, index in (('velocity', 2), ('load', 4), ('temperature', 5))
            if np.isfinite(rows[:, index]).all()}
        samples = Samples(time=rows[:, 0], position=rows[:, 1], current=rows[:, 3], **measured)
        return samples.with_(current=self.model.measured(samples))

    def verdict(self) -> ModelFit:
        """Return the verdict of the monitor."""
        return self.monitor.verdict()
