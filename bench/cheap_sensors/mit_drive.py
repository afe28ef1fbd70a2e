# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A drive with an MIT-mode controller, as quasi-direct drives have it, at 500 Hz.

``torque = kp·(q_d - q) + kd·(v_d - v) + feed-forward``, with position in 16 bit over ±12.5 rad,
velocity in 12 bit over ±45 rad/s and torque in 12 bit, as in the CAN frames of such drives. Silence
longer than the timeout leads to zero torque.
"""

from __future__ import annotations

import numpy as np

PERIOD = 0.002
TIMEOUT = 0.1
POSITION_RANGE, VELOCITY_RANGE = 12.5, 45.0
POSITION_STEP = 2.0 * POSITION_RANGE / 2**16


def in_bits(values: np.ndarray, largest: np.ndarray | float, bits: int) -> np.ndarray:
    """Return values as a frame holds them: clipped to ±largest, in 2**bits steps."""
    step = 2.0 * np.asarray(largest, dtype=float) / 2**bits
    return np.asarray(np.clip(np.rint(np.asarray(values) / step), -2**(bits - 1), 2**(
        bits - 1) - 1) * step)


class MitDrive:
    """The controllers of J drives: `kp`, `kd` and the torque's range in N·m, rad and s, (J,)."""

    def __init__(self, kp: np.ndarray, kd: np.ndarray, largest_torque: np.ndarray) -> None:
        self._kp, self._kd, self._largest = kp, kd, largest_torque
        self._commanded = -np.inf
        zeros = np.zeros(len(kp))
        self._command = zeros, zeros, zeros

    def command(self, time: float, position: np.ndarray, velocity: np.ndarray,
                feed_forward: np.ndarray) -> None:
        """Take a frame at a time in s: rad, rad/s, N·m, each of shape (J,)."""
        self._commanded = time
        self._command = (in_bits(position, POSITION_RANGE, 16),
                         in_bits(velocity, VELOCITY_RANGE, 12),
                         in_bits(feed_forward, self._largest, 12))

    def torque(self, time: float, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the torque for a measured position and velocity, N·m, shape (J,)."""
        if time - self._commanded > TIMEOUT:
            return np.zeros(len(self._kp))
        wanted, speed, added = self._command
        return np.asarray(np.clip(
            self._kp * (wanted - position) + self._kd * (speed - velocity) + added,
            -self._largest, self._largest))

    def reported(self, position: np.ndarray, velocity: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray]:
        """Return position and velocity as the drive's answer holds them."""
        return in_bits(position, POSITION_RANGE, 16), in_bits(velocity, VELOCITY_RANGE, 12)
