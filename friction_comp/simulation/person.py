# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated person who makes the joint follow the movement on a screen.

The person is modelled as a spring and a damper between reference and joint, with a reaction time.
If the joint has not arrived when the reference movement ends, the person's torque increases until
it does, so that every joint is eventually set in motion.
"""

from __future__ import annotations

from numba import njit
import numpy as np
from numpy.typing import ArrayLike

from friction_comp.simulation.joint_parameters import Record

ARRIVED = 0.1
"""Largest distance from the end of the reference at which a joint has arrived, rad. In the note,
joints with compensation end at most 0.083 rad short of it, those without it at least 0.18 rad; with
half of this the person would finish movements under the continuous law, too."""


@njit(cache=True)
def follow_reference(p: Record, s: Record, h: float, reaction_weight: float, active: bool,
                     reference_position: float, reference_velocity: float, position: float,
                     velocity: float) -> None:
    """Advance the person's torque `s.human`, N·m, by one substep of h s.

    `reaction_weight` is that of the low pass, `active` whether the person holds the joint.
    """
    if not active:
        s.human = s.integral_torque = 0.0
        return
    lag = reference_position - position
    if reference_velocity != 0.0:
        s.arrived = 0
    elif abs(lag) <= ARRIVED:
        # Remembered, so that the person does not push again if the joint recoils.
        s.arrived = 1
    if reference_velocity != 0.0 or s.arrived == 1 or p.human_integral_time <= 0.0:
        s.integral_torque = 0.0
    else:
        s.integral_torque += p.human_stiffness * lag * h / p.human_integral_time
    wanted = (p.human_stiffness * lag + p.human_damping * (reference_velocity - velocity)
              + s.integral_torque)
    s.human += (wanted - s.human) * reaction_weight


class ReferenceHold:
    """Extrapolates the last reference with its velocity until the next one, or a timeout in s."""

    def __init__(self, timeout: float = 0.5) -> None:
        self.timeout = float(timeout)
        self._reference: tuple[float, np.ndarray, np.ndarray] | None = None

    def update(self, time: float, position: ArrayLike, velocity: ArrayLike) -> None:
        """Set a new reference: s, rad, rad/s; arrays of shape (J,)."""
        self._reference = (float(time), np.array(position, dtype=float),
                           np.array(velocity, dtype=float))

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
        """Return position and velocity of shape (J,) at a time in s, or None and None."""
        if self._reference is None or not time - self._reference[0] <= self.timeout:
            return None, None
        since, position, velocity = self._reference
        return position + velocity * (time - since), velocity
