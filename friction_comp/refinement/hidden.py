# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Inertia that something larger hides: looked for beside whatever position and time may do."""

from __future__ import annotations

import numpy as np

from friction_comp.model.effects import EFFECTS
from friction_comp.refinement.fitting import robust_scale, Term

INERTIA = EFFECTS['inertia']
_POSITIONS, _TIMES = 16, 12
# Residuals this many times the noise from sample to sample may hide an effect.
_LOUD = 1.5


def nuisance_of(samples):
    """Return a stand-in for an effect: any step function of position and of time.

    Each has its own level in either direction, so that it takes up what no effect known to the
    package describes, however coarsely. It is never part of a model.

    Parameters
    ----------
    samples : Samples

    Returns
    -------
    type
        With the class method `columns` of an effect.
    """
    def edges(values, number):
        return np.unique(np.quantile(values, np.linspace(0, 1, number + 1)[1:-1]))
    cuts = (edges(samples.position, _POSITIONS), edges(samples.time, _TIMES))

    class Nuisance:
        """Levels of cells of position and of time, in either direction."""

        name, variable, constants = 'nuisance', 'nuisance', {}

        @classmethod
        def columns(cls, samples):
            """Return one column of zeros and ones for each cell."""
            side = (samples.velocity > 0).astype(int)
            parts = []
            for cut, values in zip(cuts, (samples.position, samples.time)):
                cell = 2 * np.searchsorted(cut, values, side='right') + side
                parts.append(np.eye(2 * len(cut) + 2)[cell])
            return np.hstack(parts)
    return Nuisance


def loud(data, residual):
    """Tell whether a residual is much larger than what changes from sample to sample.

    Parameters
    ----------
    data : Data
    residual : ndarray, shape (N,)
    """
    whole = data.usable[2:] & data.usable[1:-1] & data.usable[:-2]
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[whole]
    if second.size < 50:
        return False
    return robust_scale(residual[data.usable]) > _LOUD * robust_scale(second) / np.sqrt(6.0)


def beside_nuisance(data, fits):
    """Return fits that have the freedom of `nuisance_of` as well."""
    term = Term(nuisance_of(data.samples.take(data.usable)), {})
    return [fit.with_term(term) for fit in fits]


def with_inertia(fits):
    """Return fits with inertia, None where its sign would be wrong."""
    grown = [fit.with_term(Term(INERTIA, {})) for fit in fits]
    return grown if all(fit.coefficients[-1] > 0 for fit in grown) else None
