# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How sure it is that one model predicts better than another on stretches not fitted."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats
from scipy.special import stdtr

from friction_comp.refinement.fit.robust_regression import huber_loss, robust_scale
from friction_comp.refinement.prepare.correlation import stretches
from friction_comp.refinement.remembered import remembered

if TYPE_CHECKING:
    from friction_comp.refinement.fit.effect_sum import Fit
    from friction_comp.refinement.prepare.fit_data import FitData

_FLIPS = 4000


@remembered
def held_out_residual(data: FitData, fits: list[Fit]) -> np.ndarray:
    """Return the residual of every sample by the model that was not fitted on it, shape (N,)."""
    residual = np.empty(len(data.fold))
    for fold, fit in enumerate(fits):
        rows = data.fold == fold
        residual[rows] = fit.residual[rows]
        fit.forget()
    residual.flags.writeable = False
    return residual


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def advantage(data: FitData, old: np.ndarray, new: np.ndarray) -> tuple[float, float, float]:
    """Compare two held-out residuals.

    The losses' difference is summed over stretches several times as long as the better model's
    residual stays correlated. If the new effect were chance, the differences would be as often
    negative as positive: Student's t over stretches, and their signs flipped at random.

    Returns
    -------
    total : float
        Mean over usable samples of old loss minus new loss, A².
    error : float
        Its standard error.
    p_value : float
        One-sided chance of such an advantage without an effect.
    """
    usable = data.usable
    scale = robust_scale(old[usable])
    difference = (huber_loss(old, scale) - huber_loss(new, scale))[usable]
    number = stretches(new, usable, data.folds.run)
    sums, count = np.bincount(number, difference), np.bincount(number)
    size, many = len(difference), len(sums)
    spread = float(np.std(sums - sums.sum() * count / size, ddof=1)) * math.sqrt(many)
    total = float(sums.sum())
    if spread <= 0:
        return total / size, 0.0, 1.0
    p_value = float(stdtr(many - 1, -total / spread))
    # An effect that shows in few stretches only (a bump, a start from rest) has a spread made by
    # itself: of the square roots of the sums it stands out, and so it does among the stretches in
    # which it predicts something. Three tests, so three times the chance.
    roots = np.sign(sums) * np.sqrt(np.abs(sums))
    if total > 0:
        energy = np.bincount(number, (old - new)[usable] ** 2)
        acting = where_it_acts(energy, count, robust_scale(new[usable]))
        p_value = min(1.0, 3.0 * min(p_value, upper_tail(roots), ranks_tail(sums[acting])))
    # Few flips cannot show a very small chance; there Student's t has to do.
    if 1e-3 < p_value < 0.2:
        p_value = max(p_value, flipped_signs(sums))
    return total / size, spread / size, p_value


def upper_tail(values: np.ndarray) -> float:
    """Return the chance by Student's t of a mean as high as that of the values, were it zero."""
    if len(values) < 6:
        return 1.0
    deviation = float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return float(stdtr(len(values) - 1, -float(np.mean(values)) / deviation)) if (
        deviation > 0) else 1.0


def ranks_tail(values: np.ndarray) -> float:
    """Return the chance by Wilcoxon's signed ranks of values as high, were their median zero.

    A few stretches may hold most of an effect (the hardest accelerations): their size says little,
    that nearly all have the same sign says much.
    """
    if len(values) < 6 or not np.any(values):
        return 1.0
    return float(stats.wilcoxon(values, alternative='greater', method='approx').pvalue)


def where_it_acts(energy: np.ndarray, count: np.ndarray, scale: float) -> np.ndarray:
    """Return the stretches in which an effect is larger than half the noise, at least six.

    Parameters
    ----------
    energy : ndarray, shape (M,)
        Of the effect in each stretch, A².
    count : ndarray of int, shape (M,)
        Samples in each.
    scale : float
        Standard deviation of the noise, A.
    """
    order = np.argsort(energy / np.maximum(count, 1))[::-1]
    number = int(np.sum(energy > (0.5 * scale) ** 2 * count))
    return order[:max(6, number)]


def flipped_signs(sums: np.ndarray) -> float:
    """Return the chance that randomly signed sums exceed the real one."""
    signs = _signs(len(sums))
    return (int(np.sum(signs @ sums >= sums.sum())) + 1) / (len(signs) + 1)


@functools.lru_cache(maxsize=2)
def _signs(number: int) -> np.ndarray:
    """Return the same random signs whenever they are asked for, shape (_FLIPS, number)."""
    rng = np.random.default_rng(0)
    return 2.0 * rng.integers(0, 2, size=(_FLIPS, number), dtype=np.int8) - 1.0
