# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The lag of the least error: a delay, or a low pass, which looks like one in slow motion."""

from __future__ import annotations

from collections.abc import Callable
import math

import numpy as np
from scipy import optimize

from friction_comp.refinement import thresholds

# Number of lags that are tried on each side, from half a sample to the longest.
_LAGS = 9
# The same, of changes of a lag that is known.
_CHANGES = 3
ENOUGH = 0.5 * (1.0 - thresholds.LAG_ERROR)
"""Share of the squared error that a lag has to remove before it is tried with a whole search."""


def best_lag(error: Callable[[float], float], step: float, known: float = 0.0
             ) -> tuple[float, float]:
    """Return the lag of the least error, s, and the share of the error that it removes.

    `step` is the time of a sample; beside a `known` lag, of which it is the change, only lags of
    two samples, or half of that one, are tried.
    """
    sizes = np.geomspace(1.0, max(2.0, 0.5 * abs(known) / step), _CHANGES) if known else \
        np.geomspace(0.5, max(thresholds.LONGEST_LAG / step, 1.0), _LAGS)
    lags = np.array(sorted([0.0, *(side * size * step for size in sizes for side in (1, -1))]))
    errors = [error(lag) for lag in lags]
    index = int(np.argmin(errors))
    # Between the neighbours of the best lag on the grid.
    best = optimize.minimize_scalar(
        error, bounds=(lags[max(index - 1, 0)], lags[min(index + 1, len(lags) - 1)]),
        method='bounded', options={'xatol': 0.02 * step, 'maxiter': 12})
    least, lag = min((errors[index], float(lags[index])), (float(best.fun), float(best.x)))
    without_lag = errors[int(np.argmin(np.abs(lags)))]
    return lag, 1.0 - least / max(without_lag, 1e-300)


def best_response(error: Callable[[float, float], float], step: float,
                  now: tuple[float, float]) -> tuple[float, float]:
    """Return the delay or the time constant of the least error, s; `now` if it is hardly less.

    One of both is zero. `error` returns the squared error with both, `step` is the time of a
    sample; beside a lag in `now`, only changes of it are tried.
    """
    known = sum(now)
    change, gain = best_lag(lambda change: error(known + change, 0.0), step, known)
    whole = known + change
    if not (known or gain > ENOUGH):
        return now
    least, response = error(whole, 0.0), (whole, 0.0)
    # A shorter lag is due to sampling, and a delay.
    if abs(whole) >= step:
        longest = math.copysign(min(2.0 * abs(whole), thresholds.LONGEST_LAG), whole)
        low_pass = optimize.minimize_scalar(
            lambda size: error(0.0, size), bounds=sorted((0.0, longest)), method='bounded',
            options={'xatol': 0.02 * step, 'maxiter': 12})
        least, response = min((least, response), (float(low_pass.fun), (0.0, float(low_pass.x))))
    allowed = 1.0 - thresholds.EQUIVALENT if known else 1.0
    return response if least < allowed * error(*now) else now
