# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the model of a running joint still fits, by its residual.

A block is a short piece of motion in one direction. Averaging over blocks removes the noise of
single samples and leaves a few values per second.

What goes with the acceleration is no error of friction: it is taken out of the residual, by least
squares beside friction, a weight and an offset.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from friction_comp.errors import check_number, InputError
from friction_comp.facts.motion import STANDSTILL
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.effect import RESISTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.model_file import LARGER, Recorded
from friction_comp.samples import Samples
from friction_comp.statistics import rms
from friction_comp.terminal import quantity

# s before the new rows that are computed again to let filters and effect states settle, and s at
# the end that wait for later rows, because a zero-phase filter needs them.
_SETTLING, _LOOKAHEAD = 3.0, 0.3
# Blocks used for the error.
_RECENT = 60


def without_inertia(residual: np.ndarray, friction: np.ndarray, samples: Samples) -> np.ndarray:
    """Return a residual, A, (N,), of a joint that slides, without what goes with the acceleration.

    `friction` is the part of the prediction that is friction, A, (N,); `samples` have velocity and
    acceleration.
    """
    side, position = np.asarray(samples.velocity), samples.position
    load = np.column_stack((np.ones(len(side)), np.cos(position), np.sin(position)))
    # With less of either direction, an offset cannot be told from friction.
    both_ways = min(np.mean(side > 0.0), np.mean(side < 0.0)) >= 0.1
    columns = np.column_stack((np.asarray(samples.acceleration), friction, load * both_ways))
    scale = np.maximum(np.sqrt(np.mean(columns ** 2, axis=0)), 1e-12)
    # Directions of columns that hardly vary are not told.
    fit = np.linalg.pinv(columns / scale, rcond=1e-4) @ residual / scale
    return np.asarray(residual - fit[0] * columns[:, 0])


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
        return f'the model no longer fits: its error is {error}'


def _block_slices(samples: Samples, moving: np.ndarray) -> Iterator[slice]:
    """Yield the slices of samples that form blocks of 0.1 to 0.4 s."""
    step, velocity = samples.sample_time, samples.velocity
    if step <= 0.0 or velocity is None:
        return
    shortest, length = max(2, round(0.1 / step)), max(2, round(0.4 / step))
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


class LiveResidual:
    """Compares the measured current of one joint with its model.

    The motor and the person move the joint together, J·a = k_t·n·i + τ_b - F, so friction in A is
    i + τ_b/(k_t·n). Without a measured load, the current alone is compared. This is meaningless
    while a compensator feeds the same model forward and a person moves the joint; the caller then
    sets `blind`. `tolerance` is the largest error per friction, beyond what the model's file tells
    of its error.
    """

    def __init__(self, model: FrictionModel, tolerance: float = 0.25):
        self.model = model.on_another_day()
        self._resists = replace(self.model, effects=[
            effect for effect in self.model.effects if effect.role == RESISTS])
        self.tolerance = check_number(tolerance, 'tolerance', above=0.0)
        self.blind = ''
        self._start_over()

    def _start_over(self) -> None:
        self._rows, self._blocks = np.empty((0, 6)), np.empty((0, 6))
        self._done, self._origin = -np.inf, np.nan
        self._speed, self._warned = 0.0, False

    def add(self, rows: np.ndarray) -> None:
        """Add rows of measurements, shape (N, 6), NaN where there is none.

        Time in s, increasing; position; velocity; motor current in A; load in N·m; temperature, °C.
        """
        rows = np.asarray(rows, dtype=float).reshape(-1, 6)
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
            predicted = self.model.current(differentiated)
            friction = self._resists.current(differentiated) - self.model.sigmoid.line[0]
        except InputError as error:
            # For instance, a model of an arm needs the motion of other joints.
            self.blind = str(error)
            return
        residual = differentiated.current - predicted
        self._add_blocks(differentiated.take(new), residual[new], friction[new])

    def _add_blocks(self, samples: Samples, residual: np.ndarray, friction: np.ndarray) -> None:
        """Add samples with velocity and acceleration, with residual and friction in A, (N,)."""
        if len(samples) < 2 or samples.velocity is None or samples.acceleration is None:
            return
        speed = np.abs(samples.velocity)
        self._speed = max(float(np.percentile(speed, 90)), 0.99 * self._speed)
        # Below a tenth of its usual speed, a joint stands still, too.
        moving = speed > max(STANDSTILL, 0.1 * self._speed)
        moving &= np.isfinite(residual)
        table = np.column_stack([samples.time, samples.position, samples.velocity,
                                 samples.acceleration, residual, friction])
        means = [table[part].mean(axis=0) for part in _block_slices(samples, moving)]
        if means:
            self._blocks = np.vstack((self._blocks, means))[-_RECENT:]

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
        """Return the verdict on the blocks so far."""
        blocks = self._blocks
        if len(blocks) < _RECENT // 2:
            return ModelFit()
        time, position, velocity, acceleration, residual, friction = blocks.T
        motion = Samples(time=time, position=position, current=residual, velocity=velocity,
                         acceleration=acceleration)
        error = rms(without_inertia(residual, friction, motion))
        usual = max(rms(friction), 1e-12)
        expected = (self.model.recorded or Recorded()).error_at(np.abs(velocity))
        limit = max(self.tolerance * usual, LARGER * expected)
        # With hysteresis.
        self._warned = error > limit * (0.8 if self._warned else 1.0)
        return ModelFit(True, not self._warned, error / usual, error, unit=self.model.unit,
                        as_expected=error > self.tolerance * usual)
