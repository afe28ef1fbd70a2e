# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""Movements and currents that excite a drive for identification (note, Eq. 3-5 and 8)."""

from __future__ import annotations

import math

from numba import njit

LARGEST_SPEED = math.radians(100.0)
"""Bound on |ω_c| in Eq. 5, rad/s."""


def cycle_velocity(time: float, speed: float, cycle_time: float) -> float:
    """Return the reference velocity of Eq. 3 in rad/s at a time in s; zero outside the cycle.

    The fifth phase begins at 0.9 T, where the note prints ``0.9 < t``.
    """
    share = time / cycle_time
    if share <= 0.0 or share >= 1.0:
        return 0.0
    if share <= 0.1:
        return 10.0 * speed * share
    if share <= 0.4:
        return speed
    if share <= 0.6:
        return speed - 10.0 * speed * (share - 0.4)
    if share <= 0.9:
        return -speed
    return -speed + 10.0 * speed * (share - 0.9)


def cycle_position(time: float, speed: float, cycle_time: float) -> float:
    """Return the integral of Eq. 3 in rad; its far end at T/2 is 0.4·ω_c·T away (Eq. 4)."""
    share = time / cycle_time
    if share <= 0.0 or share >= 1.0:
        return 0.0
    if share <= 0.1:
        integral = 5.0 * (share * share)
    elif share <= 0.4:
        integral = share - 0.05
    elif share <= 0.6:
        integral = 0.35 + (share - 0.4) - 5.0 * ((share - 0.4) * (share - 0.4))
    elif share <= 0.9:
        integral = 0.95 - share
    else:
        integral = 5.0 * ((1.0 - share) * (1.0 - share))
    return speed * cycle_time * integral


@njit(cache=True)
def ramp_current(time: float, slope: float, period: float) -> float:
    """Return the motor current of Eq. 8 in A at a time; zero outside the period.

    The note prints a derivative, but Fig. 2 shows that it is the current itself: two ramps of
    opposite sign with the gradient s, up to 0.4·s·T.
    """
    share = time / period
    if 0.0 < share <= 0.4:
        return slope * time
    if 0.5 < share <= 0.9:
        return -slope * (time - 0.5 * period)
    return 0.0


def travel_state(time: float, distance: float, duration: float) -> tuple[float, float]:
    """Return position (rad) and velocity (rad/s) of a quintic from rest to rest."""
    share = min(max(time / duration, 0.0), 1.0)
    square, left = share * share, 1.0 - share
    position = distance * (share * square) * (10.0 - 15.0 * share + 6.0 * square)
    velocity = distance / duration * 30.0 * square * (left * left)
    return position, velocity


def constant_velocity_windows(cycle_time: float, settling: float = 0.0
                              ) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return beginning and end in s of the phases of Eq. 3 at +ω_c and at -ω_c.

    The first `settling` s, but at most 60 % of each phase, are left out.
    """
    skipped = min(max(settling, 0.0), 0.18 * cycle_time)
    return ((0.1 * cycle_time + skipped, 0.4 * cycle_time),
            (0.6 * cycle_time + skipped, 0.9 * cycle_time))
