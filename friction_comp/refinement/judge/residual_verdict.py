# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What stays without a name: left-over dependence, clipping, and names that are only stand-ins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.judge.residual_dependence import (
    fallback,
    LEAST_STRENGTH,
    ResidualDependence,
    unexplained,
)
from friction_comp.refinement.thresholds import (
    CLEARLY_ABOVE_NOISE,
    FAR,
    LEAST_LOUD,
)
from friction_comp.series import lag1_autocorrelation, quantile_edges

if TYPE_CHECKING:
    from friction_comp.refinement.prepare.fit_data import FitData
    from friction_comp.samples import Samples



def left_over(data: FitData, residual: np.ndarray, slowest: float,
              floor: float) -> list[ResidualDependence]:
    """Return what the residual still depends on.

    Parameters
    ----------
    data : FitData
    residual : ndarray, shape (N,)
        Held-out residual of the samples of `data`.
    slowest : float
        Speed of standstill, rad/s.
    floor : float
        Noise from sample to sample of the recordings, A.

    Returns
    -------
    list of ResidualDependence
    """
    found = unexplained(data.samples, data.usable, residual, slowest, LEAST_LOUD * floor)
    values = residual[data.usable]
    # Rare but large errors next to each other are no outliers of a sensor: they hold something.
    rare = clipped_rms(values, FAR)
    lasting = rare > CLEARLY_ABOVE_NOISE * floor and lag1_autocorrelation(
        np.clip(values, -FAR * floor, FAR * floor)) > 0.3
    if not found and (lasting or clipped_rms(values) > CLEARLY_ABOVE_NOISE * floor):
        entry = fallback(residual, data.samples, data.usable, slowest)
        if entry.strength > LEAST_STRENGTH:
            found = [entry]
    return found


def with_products(left: list[ResidualDependence],
                  products: Sequence[Any]) -> list[ResidualDependence]:
    """Return what is left with the variables of products put first.

    Parameters
    ----------
    left : list of ResidualDependence
    products : list of type
        See `nameless`.

    Returns
    -------
    list of ResidualDependence
    """
    by_name = {item.variable: item for item in left}
    strongest = max((item.strength for item in left), default=LEAST_STRENGTH)
    first: list[Any] = []
    for product in products:
        for name in product.variables:
            if all(item.variable != name for item in first):
                strength = by_name[name].strength if name in by_name else strongest
                first.append(ResidualDependence(
                    name, strength, f'{product.name} explains more of the remaining error than '
                    'any effect known to the package'))
    taken = {item.variable for item in first}
    return first + [item for item in left if item.variable not in taken]


def clipped_rms(values: np.ndarray, deviations: float = 4.0) -> float:
    """Return the RMS of values, those beyond so many standard deviations taken as of that size."""
    limit = deviations * robust_scale(values)
    return float(np.sqrt(np.mean(np.clip(values, -limit, limit) ** 2)))


def clipping(samples: Samples, clipped: np.ndarray) -> ResidualDependence | None:
    """Return the entry for a current signal that ends before the current does; None if it does not.

    The variable named is the one on which it depends most whether a sample is clipped.
    """
    if not clipped.any():
        return None
    share = float(clipped.mean())
    signals = {'velocity': samples.velocity, 'acceleration': samples.acceleration,
               'position': samples.position, 'load': samples.load,
               'temperature': samples.temperature}
    best = ('velocity', 0.0)
    for name, values in signals.items():
        if values is None:
            continue
        cell = np.searchsorted(quantile_edges(values, 15), values)
        count = np.maximum(np.bincount(cell), 1)
        rate = np.bincount(cell, clipped.astype(float)) / count
        spread = float(count @ (rate - share) ** 2) / (len(cell) * share * (1.0 - share))
        # Velocity is what friction follows: another has to be clearly better to be named.
        if spread > (1.5 * best[1] if best[0] == 'velocity' else best[1]):
            best = (name, spread)
    low, high = samples.current[clipped].min(), samples.current[clipped].max()
    ends = f'{high:.4g} A' if low == high else f'{low:.4g} and {high:.4g} A'
    return ResidualDependence(
        best[0], best[1], f'the current signal ends at {ends} in {100 * share:.2g} % of the '
        f'samples, mostly by {best[0]}: the sensor saturates, and these samples are not fitted')
