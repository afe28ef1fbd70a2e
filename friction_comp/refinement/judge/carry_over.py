# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Whether an effect carries over from one part of the recordings to another."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

from friction_comp.huber import huber_weights
from friction_comp.refinement.fit.robust_regression import huber_loss, robust_scale, side_by_side
from friction_comp.refinement.thresholds import CARRY_OVER, PARTS

if TYPE_CHECKING:
    from friction_comp.refinement.fit.effect_sum import Fit

# Of a column's power: keeps what one part alone shows from being solved for without it.
_RIDGE = 1e-9


def parts_of(usable: np.ndarray) -> np.ndarray:
    """Return which of `PARTS` equal parts of the recordings each usable sample is in, shape (M,).

    A part is one stretch of time, so long that the joint is elsewhere, faster or warmer in it than
    in most others: what is left out with it is not left in beside it.

    Parameters
    ----------
    usable : ndarray of bool, shape (N,)
        M of which are True.
    """
    size = int(usable.sum())
    return np.arange(size) * int(PARTS) // max(size, 1)


def residual_elsewhere(fit: Fit, part: np.ndarray) -> np.ndarray:
    """Return the residual in A of every part by coefficients fitted to all other parts, shape (M,).

    The constants are those of the fit, and so are the weights.

    Parameters
    ----------
    fit : Fit
    part : ndarray of int, shape (M,)
        Of the usable samples.
    """
    index = np.nonzero(fit.data.usable)[0]
    columns, goal = side_by_side(fit.whole, index), fit.target[index]
    weights = huber_weights(fit.residual[index], fit.scale)
    # The parts follow each other.
    edges = np.searchsorted(part, np.arange(int(part.max()) + 2))
    parts, size = [slice(*pair) for pair in pairwise(edges)], columns.shape[1]
    squares, products = np.empty((len(parts), size, size)), np.empty((len(parts), size))
    for k, own in enumerate(parts):
        weighted = columns[own] * weights[own, None]
        squares[k], products[k] = weighted.T @ columns[own], weighted.T @ goal[own]
    square, product = squares.sum(axis=0), products.sum(axis=0)
    norm = np.sqrt(np.diag(square)) + 1e-300
    residual = np.empty(len(goal))
    for k, own in enumerate(parts):
        others = (square - squares[k]) / norm[:, None] / norm
        others[np.diag_indices(size)] += _RIDGE
        found = np.linalg.solve(others, (product - products[k]) / norm) / norm
        residual[own] = goal[own] - columns[own] @ found
    fit.forget()
    return residual


def gains(poorer: list[Fit], richer: list[Fit]) -> np.ndarray:
    """Return by how much an effect lowers the loss in every part, fitted to the others alone, A².

    Parameters
    ----------
    poorer, richer : list of Fit
        Without and with the effect, fitted in either fold.

    Returns
    -------
    ndarray, shape (PARTS,)
    """
    part = parts_of(richer[0].data.usable)
    total = np.zeros(int(part.max()) + 1)
    for without, full in zip(poorer, richer):
        before, after = residual_elsewhere(without, part), residual_elsewhere(full, part)
        scale = robust_scale(before)
        total += np.bincount(part, huber_loss(before, scale) - huber_loss(after, scale))
    return total


def carries_over(poorer: list[Fit], richer: list[Fit], number: int) -> bool:
    """Tell whether an effect helps in parts of the recordings that it was not fitted to.

    Stretches that lie side by side hold the same places, speeds and other circumstances, so that
    many of them agree where one mistake is repeated. Between a dozen long parts these differ, and a
    dozen is how many independent witnesses there are. In total the effect has to help by more
    than one standard error, and by signed ranks (Wilcoxon) in more parts than chance lets it. The
    more effects a model has, the less likely chance has to be for another one.

    Parameters
    ----------
    poorer, richer : list of Fit
        Without and with the effect, fitted in either fold.
    number : int
        How many effects the richer model has.
    """
    return shows_in_parts(gains(poorer, richer), number)


def shows_in_parts(gain: np.ndarray, number: int = 1) -> bool:
    """Tell whether gains in the parts of the recordings are more than chance.

    Parameters
    ----------
    gain : ndarray, shape (PARTS,)
    number : int
        How many such questions are asked of the same data.
    """
    error = float(np.std(gain, ddof=1)) * np.sqrt(len(gain))
    if not gain.sum() > error:
        return False
    chance = float(stats.wilcoxon(gain, alternative='greater').pvalue)
    return chance < CARRY_OVER / max(number, 1)
