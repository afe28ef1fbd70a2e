# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""An independent random sequence for each run."""

from __future__ import annotations

from collections.abc import Sequence
import math

from numba import njit
import numpy as np


def random_states(seed: int | Sequence[int], runs: int) -> np.ndarray:
    """Return initial states of `runs` independent random sequences, shape (runs, 1) uint64."""
    return np.random.SeedSequence(seed).generate_state(runs, np.uint64).reshape(runs, 1)


@njit(cache=True)
def uniform(random: np.ndarray) -> float:
    """Return the next number in (0, 1) of a splitmix64 sequence, shape (1,) uint64."""
    random[0] += np.uint64(0x9E3779B97F4A7C15)
    z = random[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return (float(z >> np.uint64(11)) + 0.5) / 9007199254740992.0


@njit(cache=True)
def normal(random: np.ndarray) -> float:
    """Return a standard normal number (Box and Muller)."""
    return math.sqrt(-2.0 * math.log(uniform(random))) * math.cos(2.0 * math.pi * uniform(random))
