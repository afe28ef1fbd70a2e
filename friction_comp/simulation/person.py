# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated person sees of a reference that is shown in samples.

The person's impedance itself is part of the joint's kernel, where it is integrated.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class ReferenceHold:
    """Carries the last reference shown on at its velocity until the next one comes.

    Parameters
    ----------
    timeout : float
        s without a new reference after which there is nothing to follow any more.
    """

    def __init__(self, timeout: float = 0.5) -> None:
        self.timeout = float(timeout)
        self.reset()

    def reset(self) -> None:
        """Forget the reference."""
        self._shown: tuple[float, np.ndarray, np.ndarray] | None = None

    def show(self, time: float, position: ArrayLike, velocity: ArrayLike) -> None:
        """Take a new reference: s, rad, rad/s; arrays of shape (J,)."""
        self._shown = (float(time), np.array(position, dtype=float),
                       np.array(velocity, dtype=float))

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return position and velocity of shape (J,) at a time in s, or None and None.

        There is none before the first reference and after the timeout.
        """
        if self._shown is None or not time - self._shown[0] <= self.timeout:
            return None, None
        since, position, velocity = self._shown
        return position + velocity * (time - since), velocity
