# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A first-order low-pass filter, for compiled and plain Python code."""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True)
def low_pass_weight(step: float, time_constant: float) -> float:
    """Return the weight of the input in one step of a first-order low pass; times in s."""
    return 1.0 - math.exp(-step / time_constant) if time_constant > 0.0 else 1.0
