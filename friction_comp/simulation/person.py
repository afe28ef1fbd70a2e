# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated person sees of a reference that is shown in samples.

The person's impedance itself is part of the joint's kernel, where it is integrated.
"""

from __future__ import annotations

import numpy as np


class ReferenceHold:
    """Carries the last reference shown on at its velocity until the next one comes.

    Parameters
    ----------
    timeout : float
        s without a new reference after which there is nothing to follow any more.
    """

    def __init__(self, timeout=0.5):
        self.timeout = float(timeout)
        self.reset()

    def reset(self):
        """Forget the reference."""
        self._time = None
        self._position = None
        self._velocity = None

    def show(self, time, position, velocity):
        """Take a new reference: s, rad, rad/s; arrays of shape (J,)."""
        self._time = float(time)
        self._position = np.array(position, dtype=float)
        self._velocity = np.array(velocity, dtype=float)

    def at(self, time):
        """Return position and velocity of shape (J,) at a time in s, or None and None.

        There is none before the first reference and after the timeout.
        """
        if self._time is None or not time - self._time <= self.timeout:
            return None, None
        return self._position + self._velocity * (time - self._time), self._velocity
