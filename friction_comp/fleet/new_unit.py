# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Fits one unit more of a known type: the population is its start and its prior.

A prior is as good as further recordings: it adds to the sums of the unit's own. So little motion
already corrects what it shows, and what it does not show stays that of the population.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np
from scipy import stats

from friction_comp.drive import Drive
from friction_comp.errors import InputError
from friction_comp.fleet.common_model import CommonModel
from friction_comp.fleet.population import Population
from friction_comp.model.friction_model import FrictionModel
from friction_comp.refinement.block_sums import BlockSums
from friction_comp.samples import Samples
from friction_comp.statistics import CONFIDENCE, holm


@dataclass(frozen=True)
class NewUnit:
    """A unit's model with the population as prior, and how it compares; with P coefficients."""

    model: FrictionModel
    names: list[str]  # of the coefficients
    values: np.ndarray  # (P,), A
    errors: np.ndarray  # (P,): standard errors
    told: np.ndarray  # (P,): share of each that the recording tells; the rest is the population's
    p: np.ndarray  # (P,): probability of such a value in the population, adjusted for their number
    # RMS error on parts that were not fitted: of the population's model, of a fit to the recording
    # alone, and with the prior.
    population_error: float
    alone_error: float
    error: float

    @property
    def intervals(self) -> np.ndarray:
        """The ends of each value's 95 % interval, (P, 2)."""
        return self.values[:, None] + np.multiply.outer(1.96 * self.errors, (-1.0, 1.0))

    @property
    def out(self) -> list[str]:
        """The coefficients in which the unit is out of the population."""
        return [name for name, p in zip(self.names, self.p) if p < 1.0 - CONFIDENCE]


def fit_new_unit(recorded: Sequence[Samples], population: Population,
                 drive: Drive | None = None, declared: bool = False) -> NewUnit:
    """Fit a unit with its population as prior; the recording alone counts if it is out of that.

    The drive is the population's when omitted; `declared` tells whether its torque constant and
    gear ratio are known. Raises InputError if the recordings cannot be used.
    """
    like = replace(population.model, drive=drive or population.model.drive)
    common, prior = CommonModel.from_model(like), population.prior
    sums = common.sums(recorded, like, declared)
    mean, deviation = np.array(prior.mean), np.array(prior.deviation)
    if len(mean) != len(common.columns):
        raise InputError(f"the population's model has {len(common.columns)} coefficients, its "
                         f'prior {len(mean)}')
    no_prior = np.full(len(mean), np.inf)
    # A sensor noisier than those of the fleet counts by its own noise.
    own_error = _rms(sums, common.columns, _fitted(sums, common.columns, mean, no_prior, 1.0)[0])
    noise = max(prior.error, own_error) ** 2 * prior.inflation
    alone, scatter = _fitted(sums, common.columns, mean, no_prior, noise)
    spread = np.sqrt(np.diag(scatter) + deviation ** 2)
    p = holm(2.0 * stats.t.sf(np.abs(alone - mean) / np.maximum(spread, 1e-300),
                              max(len(population.units) - 2, 1)))
    if (p < 1.0 - CONFIDENCE).any():
        deviation = no_prior
    values, covariance = _fitted(sums, common.columns, mean, deviation, noise)
    errors = np.sqrt(np.diag(covariance))
    return NewUnit(
        model=common.model(values, like), names=_names(common), values=values, errors=errors,
        told=_told(errors, deviation), p=p, population_error=_rms(sums, common.columns, mean),
        alone_error=_left_out(sums, common.columns, mean, no_prior, noise),
        error=_left_out(sums, common.columns, mean, deviation, noise))


def _told(errors: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Return by which share the recording tells each coefficient, and not the population.

    It is one minus the variance that is left of the prior's: 0 where that has none, and 1 without
    a prior, whose deviation is infinite.
    """
    left = np.divide(errors, deviation, out=np.ones(len(errors)), where=deviation > 0.0)
    return np.asarray(1.0 - np.minimum(left, 1.0) ** 2)


def _names(common: CommonModel) -> list[str]:
    names = ['offset', 'coulomb', 'viscous']
    for one in common.compared()[len(names):]:
        names += [one.name] if len(one.columns) == 1 else [
            f'{one.name.rsplit(":", 1)[0]}: {part}' for part in ('cosine', 'sine')]
    return names


def _fitted(sums: BlockSums, columns: Sequence[int], mean: np.ndarray, deviation: np.ndarray,
            noise: float, weights: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients, shape (P,), and their covariance, with independent normal priors.

    `noise` is the variance of a row that counts as independent.
    """
    total = np.tensordot(np.ones(len(sums.rows)) if weights is None else weights,
                         sums.part(columns).gram, 1) / noise
    scale = np.where(deviation > 0.0, 1.0, 0.0)
    # Certain coefficients stay; where nothing is known in advance, a little keeps it solvable.
    least = 1e-7 * np.diag(total)[:-1]
    precision = np.where(scale > 0.0, 1.0 / np.maximum(deviation, 1e-300) ** 2, 0.0) + least
    matrix = total[:-1, :-1] * scale * scale[:, None] + np.diag(
        np.where((scale > 0.0) & (precision > 0.0), precision, 1.0))
    goal = (total[:-1, -1] - total[:-1, :-1] @ mean) * scale
    covariance = np.linalg.inv(matrix) * scale * scale[:, None]
    return mean + covariance @ goal, covariance


def _rms(sums: BlockSums, columns: Sequence[int], values: np.ndarray) -> float:
    """Return the RMS error with coefficients, those of all blocks or of each."""
    errors = sums.squared_errors(columns, np.atleast_2d(values))
    return math.sqrt(max(float(errors.sum()), 0.0) / float(sums.rows.sum()))


def _left_out(sums: BlockSums, columns: Sequence[int], mean: np.ndarray, deviation: np.ndarray,
              noise: float) -> float:
    return _rms(sums, columns, np.array([
        _fitted(sums, columns, mean, deviation, noise, 1.0 - row)[0]
        for row in np.eye(len(sums.rows))]))
