# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The sign of friction, which every effect that resists is multiplied by."""

from __future__ import annotations

from typing import Any

import numpy as np


def sign(velocity: Any, transition: float) -> Any:
    """Return the sign of friction, which passes through zero smoothly as Eq. 6 does."""
    return np.tanh(velocity / transition)


class _LastSign:
    """The sign of friction at samples, kept until other samples are asked for.

    A search asks for it hundreds of times with the same velocities and transition, and the
    hyperbolic tangent costs more than most effects.
    """

    def __init__(self) -> None:
        self._held: tuple[Any, float, Any] = (None, 0.0, None)

    def __call__(self, velocity: np.ndarray, transition: float) -> np.ndarray:
        held = self._held
        if held[0] is not velocity or held[1] != transition:
            result = np.asarray(sign(velocity, transition))
            result.flags.writeable = False
            self._held = held = (velocity, transition, result)
        return np.asarray(held[2])


sign_at = _LastSign()
"""Return the same for an array of velocities that does not change."""
