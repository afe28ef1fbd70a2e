# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the fits of an arm share: bounded influence of outliers, and stretches held out."""

from __future__ import annotations

import numpy as np

from friction_comp.huber import huber_weights

STRETCHES = 12


def bulk_weights(residual: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
    """Return Huber's weights over the variance of the bulk, shape (N,).

    Parameters
    ----------
    residual : ndarray, shape (N,)
    rows : ndarray of bool, shape (N,), optional
        Samples that tell the scale.
    """
    size = np.abs(residual)
    scale = 1.4826 * float(np.median(size if rows is None else size[rows])) + 1e-12
    return huber_weights(residual, scale) / scale ** 2


def stretches_of(recording: np.ndarray, number: int = STRETCHES) -> np.ndarray:
    """Return which stretch each sample belongs to, shape (N,), counted from 0.

    Parameters
    ----------
    recording : ndarray of int, shape (N,)
        Recording of each sample; no stretch goes over the edge of one.
    number : int
        Of stretches, as far as recordings leave the choice.
    """
    place = np.arange(len(recording)) * number // max(len(recording), 1)
    run = np.cumsum(np.diff(recording, prepend=recording[:1]) != 0)
    return np.unique(place + (number + 1) * run, return_inverse=True)[1].reshape(-1)
