# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What refinement found, in figures: the content of report.json."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from friction_comp.refinement.fit.robust_regression import robust_scale
from friction_comp.refinement.judge.evidence import rms

if TYPE_CHECKING:
    from friction_comp.model.friction_model import FrictionModel
    from friction_comp.samples import Samples


def scores(current: np.ndarray, fit_residual: np.ndarray, held_out_residual: np.ndarray,
           usable: np.ndarray) -> dict[str, Any]:
    """Return the errors of one model over the usable samples.

    Parameters
    ----------
    current, fit_residual, held_out_residual : ndarray, shape (N,)
        A. The first residual is of the model fitted on everything, the second of every sample by
        the model that was not fitted on it.
    usable : ndarray of bool, shape (N,)

    Returns
    -------
    dict
    """
    signal, held_out = current[usable], held_out_residual[usable]
    variance = float(np.var(signal))
    return {
        'fit_rmse': rms(fit_residual[usable]),
        'held_out_rmse': rms(held_out),
        'held_out_max': float(np.max(np.abs(held_out))),
        'held_out_r2': 1.0 - float(np.mean(held_out ** 2)) / variance if variance > 0 else 0.0,
    }


def noise_floor(samples: Samples, usable: np.ndarray, residual: np.ndarray) -> float:
    """Return the standard deviation in A of what changes from one sample to the next at random.

    Second differences of the residual remove whatever is smooth over three samples; of white
    noise they have six times its variance. Slow noise is not in this figure.
    """
    whole = usable[2:] & usable[1:-1] & usable[:-2]
    whole &= (np.diff(samples.recording)[1:] == 0) & (np.diff(samples.recording)[:-1] == 0)
    second = (residual[2:] - 2.0 * residual[1:-1] + residual[:-2])[whole]
    if second.size < 50:
        return rms(residual[usable])
    return robust_scale(second) / np.sqrt(6.0)


def words_of(model: FrictionModel, start: str) -> str:
    """Return a model in one line."""
    names = [effect.name for effect in model.effects]
    return f'{start}' + ''.join(f' + {name}' for name in names)
