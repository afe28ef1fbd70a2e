# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits friction to a table of steady states: the mean current at each of several constant speeds.

The curve is offset, Coulomb and viscous friction. Viscous friction that differs between the
directions and Stribeck friction are added where they lower Akaike's criterion for small samples
(Hurvich and Tsai 1989). Intervals are Student's, from the scatter about the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
import itertools
import math

import numpy as np
from scipy.optimize import minimize_scalar

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.model.effects import EFFECTS
from friction_comp.model.friction_model import FrictionModel
from friction_comp.model.sigmoid import Sigmoid
from friction_comp.statistics import rms, student_quantile

# Steepness of the sign change, in units of one over the slowest speed: there it is complete.
_STEEP = 10.0
# Scatter below which residuals are rounding errors, in units of the largest current.
_ROUNDING = 1e-9
# Fewest pairs of neighbouring speeds that show the form of the errors, and errors too small to
# matter, in units of the current.
_FEWEST_PAIRS, _SMALL = 6, 0.01


@dataclass(frozen=True)
class SteadyStates:
    """Friction over speed, from a table; currents in A, speeds in rad/s."""

    speeds: np.ndarray
    currents: np.ndarray
    values: dict[str, float]    # offset (absent in one direction), coulomb, viscous, …
    intervals: dict[str, tuple[float, float]]   # 95 %
    model: FrictionModel
    fit_rmse: float
    left_out_rmse: float    # each row predicted by a fit to all others
    plain_rmse: float       # the same of Coulomb and viscous friction alone
    is_curved: bool         # whether errors of neighbouring speeds are alike


def fit_steady_states(speeds: np.ndarray, currents: np.ndarray, drive: Drive) -> SteadyStates:
    """Fit friction to mean currents in A at constant speeds in rad/s, shape (N,).

    Raises InputError if there are too few rows.
    """
    used = np.isfinite(speeds) & np.isfinite(currents) & (speeds != 0.0)
    order = np.argsort(speeds[used], kind='stable')
    speeds, currents = speeds[used][order], currents[used][order]
    both = bool((speeds > 0.0).any() and (speeds < 0.0).any())
    if len(speeds) < 5 or len(np.unique(np.abs(speeds))) < 2:
        raise InputError('a table of steady states needs at least 5 rows with two speeds, not '
                         f'{len(speeds)}')
    if not currents.any():
        raise InputError('all efforts are zero: there is no friction to fit')
    fits = [_Curve(speeds, currents, both, skewed, power)
            for skewed, power in itertools.product((False, True), (0.0, 1.0, 2.0))
            if both or not skewed]
    best = min(fits, key=lambda fit: fit.criterion)
    return SteadyStates(
        speeds=speeds, currents=currents, values=best.values, intervals=best.intervals(),
        model=best.model(drive), fit_rmse=rms(best.residual), left_out_rmse=best.left_out(),
        plain_rmse=fits[0].left_out(), is_curved=best.is_curved())


class _Curve:
    def __init__(self, speeds: np.ndarray, currents: np.ndarray, both: bool, skewed: bool,
                 power: float) -> None:
        self._speeds, self._currents, self._power = speeds, currents, power
        columns = {'coulomb': np.sign(speeds), 'viscous': speeds}
        columns |= {'offset': np.ones_like(speeds)} if both else {}
        columns |= {'viscous_asymmetry': np.abs(speeds)} if skewed else {}
        self._base = np.column_stack(list(columns.values()))
        names, fading = [*columns, *(['stribeck'] if power else [])], 0.0
        if power:
            # As in the effect: from below the slowest to two thirds of the top speed.
            size = np.abs(speeds)
            grid = np.geomspace(0.5 * size.min(), 0.7 * size.max(), 60)
            k = int(np.clip(np.argmin([self._error(speed) for speed in grid]), 1, len(grid) - 2))
            fading = float(minimize_scalar(
                self._error, bounds=(grid[k - 1], grid[k + 1]), method='bounded').x)
        design, coefficients, self.residual = self._solve(fading)
        self.values = dict(zip(names, coefficients.tolist()))
        if power:
            self.values['stribeck_speed'] = fading
            step = 1e-4 * fading
            slope = (self._solve(fading + step)[0] - design)[:, -1] / step
            design = np.column_stack((design, coefficients[-1] * slope))
        self._jacobian = design
        count, free = design.shape
        floor = count * (_ROUNDING * float(np.max(np.abs(currents)))) ** 2
        squares = max(float(self.residual @ self.residual), floor)
        # One more parameter is the scatter.
        spare = count - free - 2
        allowed = spare > 0 and self.values.get('stribeck', 1.0) > 0.0
        self.criterion = count * math.log(squares / count) + 2.0 * (free + 1) * count / spare \
            if allowed else math.inf

    def _solve(self, fading: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return columns, coefficients and residual, with a Stribeck speed in rad/s."""
        design = self._base
        if self._power:
            shape = np.exp(-(np.abs(self._speeds) / fading) ** self._power)
            design = np.column_stack((design, np.sign(self._speeds) * shape))
        coefficients = np.linalg.lstsq(design, self._currents, rcond=None)[0]
        return design, coefficients, self._currents - design @ coefficients

    def _error(self, fading: float) -> float:
        return rms(self._solve(fading)[2])

    def intervals(self) -> dict[str, tuple[float, float]]:
        """Return the 95 % intervals of the values."""
        count, free = self._jacobian.shape
        variance = float(self.residual @ self.residual) / (count - free)
        spread = np.sqrt(variance * np.diag(np.linalg.pinv(self._jacobian.T @ self._jacobian)))
        half = float(student_quantile(count - free)) * spread
        return {name: (value - width, value + width)
                for (name, value), width in zip(self.values.items(), half.tolist())}

    def is_curved(self) -> bool:
        """Return whether the errors of neighbouring speeds are more alike than chance makes them.

        Errors of a hundredth of the current do not count.
        """
        sides = [self.residual[self._speeds > 0.0], self.residual[self._speeds < 0.0]]
        alike = np.concatenate([side[1:] * side[:-1] for side in sides])
        squares = float(np.mean(self.residual ** 2))
        return len(alike) >= _FEWEST_PAIRS and squares > (_SMALL * rms(self._currents)) ** 2 and (
            float(np.mean(alike)) > 2.0 * squares / math.sqrt(len(alike)))

    def left_out(self) -> float:
        """Return the RMS error of each row, predicted by a fit to the others."""
        leverage = np.diag(self._jacobian @ np.linalg.pinv(self._jacobian))
        return rms(self.residual / np.maximum(1.0 - leverage, 1e-6))

    def model(self, drive: Drive) -> FrictionModel:
        """Return the curve as a model with the table in it."""
        value = self.values
        steepness = _STEEP / float(np.min(np.abs(self._speeds)))
        offset, coulomb = value.get('offset', 0.0), value['coulomb']
        effects = [EFFECTS['stribeck']({
            'velocity': value['stribeck_speed'], 'exponent': self._power,
            'transition': 2.0 / steepness, 'coefficients': [value['stribeck']]})
        ] if 'stribeck' in value else []
        effects += [EFFECTS['direction_asymmetry']({
            'offset': 1.0, 'transition': 2.0 / steepness,
            'coefficients': [0.0, value['viscous_asymmetry']]})
        ] if 'viscous_asymmetry' in value else []
        means = {speed: self._currents[self._speeds == speed] for speed in np.unique(self._speeds)}
        return FrictionModel(
            drive, Sigmoid(offset + coulomb, offset - coulomb, steepness, 0.0, value['viscous']),
            effects=effects, lookup_table={
                'speeds': [float(speed) for speed in means],
                'currents': [float(np.mean(one)) for one in means.values()],
                'standard_deviations': [float(np.std(one)) for one in means.values()]})
