# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How much friction has changed since a model was made, told from what else may have changed.

Friction turns with the motion. A weight that was added or an offset of a sensor does not, and
another inertia goes with the acceleration. So a residual is a factor of the model's friction beside
these, by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from friction_comp.number_text import quantity
from friction_comp.samples import Samples
from friction_comp.statistics import rms

# Least share of either direction: of fewer, an offset cannot be told from friction.
_EITHER = 0.1
# Directions of columns that vary less than this share of the largest are not told.
_SINGULAR = 1e-4
# Longest stroke, s: later errors are counted as others.
_STROKE = 2.0
# Of the squared error, what a cause must explain to be named, and all of them leave at most; of a
# squared load, what must vary for it to depend on position.
_CAUSE, _REST, _VARIES = 0.3, 0.5, 0.05
# A factor of the whole current is named if it leaves at most so much more of the squared error than
# friction, load and inertia do, friction has changed by a factor that differs by no more than this
# share, and the model carries as much of its friction.
_AS_GOOD, _ALIKE, _CARRIED = 0.05, 0.3, 0.3


@dataclass(frozen=True)
class FrictionChange:
    """Parts of a residual, A; each array has the shape (N,) of the samples."""

    # Change of friction as a share of the model's, 0 if it is the same, and its standard error.
    factor: float
    error: float
    friction: np.ndarray    # what this factor explains
    load: np.ndarray        # what does not turn with the motion, but may vary with position
    inertia: np.ndarray
    residual: np.ndarray
    # Change of the whole current, as a share, where it explains as much; else 0.
    whole: float = 0.0
    # Whether the joint moved in one direction only, so that an offset counts as friction.
    one_way: bool = False

    @property
    def level(self) -> float:
        """The change of friction if it explains much of the error; else 0."""
        return self.factor * (not self.whole and self._explains(self.friction))

    def _explains(self, part: np.ndarray) -> bool:
        error = self.residual - self.inertia
        return (rms(part) ** 2 > _CAUSE * rms(error) ** 2
                and rms(error - self.friction - self.load) ** 2 < _REST * rms(error) ** 2)

    def causes(self, unit: str) -> list[str]:
        """Return what explains much of the residual, in words."""
        found = [f'{what} is {100 * abs(change):.0f} % {"higher" if change > 0 else "lower"}'
                 for change, what in (
                     (self.whole, 'the whole current'),
                     (self.level, 'the friction, or an offset,' if self.one_way else 'the friction')
                 ) if change]
        if not self.whole and self._explains(self.load):
            size = rms(self.load)
            varies = float(np.var(self.load)) > _VARIES * size ** 2
            found.append(f'a load of {quantity(size, unit)} is not in the model, ' + (
                'which varies with position: a weight or a spring' if varies else
                'the same everywhere: an offset of the sensor or a weight'))
        return found


def friction_change(residual: np.ndarray, predicted: np.ndarray, friction: np.ndarray,
                    samples: Samples, model_error: float) -> FrictionChange:
    """Return the parts of a residual of samples of a joint that slides.

    `residual` is the measured less the `predicted` current, of which `friction` is a part, all A,
    (N,); `samples` have velocity and acceleration. Errors of one stroke are alike: the standard
    error is that of clusters (Liang and Zeger 1986). `model_error` is the RMS error that the model
    has in any other recording, A: it may look like friction.
    """
    side, position = np.sign(np.asarray(samples.velocity)), samples.position
    load = np.column_stack((np.ones(len(side)), np.cos(position), np.sin(position)))
    one_way = bool(min(np.mean(side > 0.0), np.mean(side < 0.0)) < _EITHER)
    columns = np.column_stack(
        (friction, np.asarray(samples.acceleration), load * (not one_way)))
    scale = np.maximum(np.sqrt(np.mean(columns ** 2, axis=0)), 1e-12)
    weights = (np.linalg.pinv(columns / scale, rcond=_SINGULAR).T / scale).T
    fit = weights @ residual
    parts = columns * fit
    rest = residual - parts.sum(axis=1)
    ends = (np.diff(side) != 0.0) | (np.diff(samples.time // _STROKE) != 0.0)
    sums = np.bincount(np.append(0, np.cumsum(ends)), weights[0] * rest)
    freedom = max(len(sums) - columns.shape[1], 1)
    chance = math.sqrt(float(sums @ sums) * len(sums) / freedom)
    whole = float(predicted @ residual / max(float(predicted @ predicted), 1e-24))
    is_whole = (abs(float(fit[0]) - whole) <= _ALIKE * abs(whole)
                and rms(predicted - friction) > _CARRIED * rms(friction)
                and rms(residual - whole * predicted) ** 2
                <= rms(rest) ** 2 + _AS_GOOD * rms(residual) ** 2)
    return FrictionChange(
        float(fit[0]), math.hypot(chance, 0.5 * model_error / float(scale[0])), parts[:, 0],
        parts[:, 2:].sum(axis=1), parts[:, 1], residual, whole * is_whole, one_way)
