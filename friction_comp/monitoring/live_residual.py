# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Computes the residual of a running joint with its model."""

from __future__ import annotations

from typing import Any

import numpy as np

from friction_comp.errors import InputError
from friction_comp.model.differentiation import DEFAULT_SETTINGS, differentiate
from friction_comp.model.friction_model import FrictionModel
from friction_comp.monitoring.residual_monitor import ModelFit, ResidualMonitor
from friction_comp.samples import Samples

# s before the new rows that are computed again to let filters and effect states settle, and s at
# the end that wait for later rows, because a zero-phase filter needs them.
_SETTLING, _LOOKAHEAD = 3.0, 0.3
# Columns of a row: time, position, velocity, current, load, temperature.
_WIDTH = 6


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
