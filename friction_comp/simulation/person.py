# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated person who makes the joint follow the shown movement.

The person is a spring and a damper between the reference and the joint, with a reaction time.
Where the movement shown is over and the joint has not arrived, the person pushes harder and harder
until it does, as anybody would: what it takes to set a joint in motion is then always given.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numba import njit
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from friction_comp.simulation.joint_parameters import Record

ARRIVED = 0.1
"""A joint no farther than this from where the movement shown has ended has arrived, rad. The joints
that a law helps end 0.083 rad short at most in the note's experiments, those that nothing helps
0.18 rad at least. With half of it the person would also finish movements under the continuous law,
which leaves a part of friction, and so a part of the way, to the person."""


@njit(cache=True)
def follow_reference(p: Record, s: Record, h: float, muscle: float, active: bool,
                     reference_position: float, reference_velocity: float, position: float,
                     velocity: float) -> None:
    """Advance the torque `s.human` in N·m that the person gives, by one substep of h s.

    `muscle` is the weight of the low pass of the person's reaction over the substep, `active`
    whether the person holds the joint; position and velocity are where, in rad and rad/s.
    """
    if not active:
        s.human = s.pushed_on = 0.0
        return
    lag = reference_position - position
    if reference_velocity != 0.0:
        s.arrived = 0
    elif abs(lag) <= ARRIVED:
        # The recoil is not pushed again.
        s.arrived = 1
    if reference_velocity != 0.0 or s.arrived == 1 or p.human_integral_time <= 0.0:
        s.pushed_on = 0.0
    else:
        s.pushed_on += p.human_stiffness * lag * h / p.human_integral_time
    wanted = (p.human_stiffness * lag + p.human_damping * (reference_velocity - velocity)
              + s.pushed_on)
    s.human += (wanted - s.human) * muscle


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
