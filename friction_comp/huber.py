# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Bounded influence of outliers (Huber, *Robust estimation of a location parameter*, 1964)."""

from __future__ import annotations

import numpy as np

# Residuals beyond this many standard deviations weigh less (Huber 1964 has 1.345 for 95 %
# efficiency; the wider band keeps the short accelerations, where much of the information is).
HUBER = 2.0


def huber_weights(residual: np.ndarray, scale: float) -> np.ndarray:
    """Return Huber's weights, 1 within `HUBER` · scale and falling beyond."""
    return np.minimum(1.0, HUBER * scale / np.maximum(np.abs(residual), 1e-300))
