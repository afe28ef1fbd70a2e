# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""The movements and currents that excite a drive for identification (note, Eq. 3-5 and 8).

Each formula is written once, as a compiled scalar kernel whose name begins with ``at_``. Kernels
may be called from other compiled code; the public functions apply them to arrays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numba import njit, vectorize
import numpy as np

from friction_comp.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

LARGEST_SPEED = math.radians(100.0)
"""Bound on |ω_c| in Eq. 5, rad/s."""


@njit(cache=True)
def at_velocity(time: float, speed: float, cycle_time: float) -> float:
    """Reference velocity of Eq. 3 in rad/s at one time; zero outside the cycle."""
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


@njit(cache=True)
def at_position(time: float, speed: float, cycle_time: float) -> float:
    """Integral of Eq. 3 in rad, from the cycle's beginning; zero outside the cycle."""
    share = time / cycle_time
    if share <= 0.0 or share >= 1.0:
        return 0.0
    if share <= 0.1:
        way = 5.0 * share ** 2
    elif share <= 0.4:
        way = share - 0.05
    elif share <= 0.6:
        way = 0.35 + (share - 0.4) - 5.0 * (share - 0.4) ** 2
    elif share <= 0.9:
        way = 0.95 - share
    else:
        way = 5.0 * (1.0 - share) ** 2
    return speed * cycle_time * way


@njit(cache=True)
def at_ramp(time: float, slope: float, period: float) -> float:
    """Motor current of Eq. 8 in A at one time; zero outside the period."""
    share = time / period
    if 0.0 < share <= 0.4:
        return slope * time
    if 0.5 < share <= 0.9:
        return -slope * (time - 0.5 * period)
    return 0.0


@njit(cache=True)
def at_travel(time: float, distance: float, duration: float) -> tuple[float, float]:
    """Position in rad and velocity in rad/s of a smooth move that starts and ends at rest.

    A quintic: velocity and acceleration are zero at both ends, the largest velocity is
    1.875·distance/duration.
    """
    share = min(max(time / duration, 0.0), 1.0)
    position = distance * share ** 3 * (10.0 - 15.0 * share + 6.0 * share ** 2)
    velocity = distance / duration * 30.0 * share ** 2 * (1.0 - share) ** 2
    return position, velocity


@vectorize(cache=True)
def _velocities(time: float, speed: float, cycle_time: float) -> float:
    return at_velocity(time, speed, cycle_time)


@vectorize(cache=True)
def _positions(time: float, speed: float, cycle_time: float) -> float:
    return at_position(time, speed, cycle_time)


@vectorize(cache=True)
def _ramps(time: float, slope: float, period: float) -> float:
    return at_ramp(time, slope, period)


def velocity_reference(time: ArrayLike, speed: ArrayLike,
                       cycle_time: ArrayLike) -> float | np.ndarray:
    """Return the reference velocity ω_ref of Eq. 3.

    The fifth phase is taken to begin at 0.9 T, as the phases before it do; the note prints
    ``0.9 < t``.

    Parameters
    ----------
    time : array_like
        Time since the cycle began in s, any shape.
    speed : array_like
        ω_c in rad/s; a negative one begins in the negative direction.
    cycle_time : array_like
        T in s.

    Returns
    -------
    float or ndarray
        rad/s, the arguments' broadcast shape; zero before and after the cycle.

    Raises
    ------
    InputError
        If T is not positive and finite.
    """
    _check_positive(cycle_time, 'cycle_time')
    return _velocities(time, speed, cycle_time)


def position_reference(time: ArrayLike, speed: ArrayLike,
                       cycle_time: ArrayLike) -> float | np.ndarray:
    """Return the integral of Eq. 3 in rad, counted from where the cycle begins.

    Parameters and errors are those of `velocity_reference`. The cycle ends where it began, and
    its far end at T/2 is 0.4·ω_c·T away (Eq. 4).
    """
    _check_positive(cycle_time, 'cycle_time')
    return _positions(time, speed, cycle_time)


def cycle_time(motion_range: ArrayLike, speed: ArrayLike,
               largest_speed: float = LARGEST_SPEED) -> float | np.ndarray:
    """Return the cycle duration T in s that uses the motion range fully (Eq. 5).

    Parameters
    ----------
    motion_range : array_like
        φ_max - φ_min in rad.
    speed : array_like
        ω_c in rad/s, either sign.
    largest_speed : float
        Bound on |ω_c|; the note's is 100 deg/s. A hundredth above it is tolerated for rounding.

    Raises
    ------
    InputError
        If the range is not positive and finite, or a speed is zero, not finite or too large.
    """
    _check_positive(motion_range, 'motion_range')
    speeds = np.abs(np.asarray(speed, dtype=float))
    if not np.all(np.isfinite(speeds)) or np.any(speeds == 0.0):
        raise InputError(f'speed must be finite and not zero, not {speed!r}')
    if np.any(speeds > 1.01 * largest_speed):
        raise InputError(
            f'speed {speeds.max():g} rad/s is above the limit of {largest_speed:g} rad/s')
    duration = 2.5 * np.asarray(motion_range, dtype=float) / speeds
    return float(duration) if duration.ndim == 0 else duration


def constant_velocity_windows(cycle_time: float,
                              settling: float = 0.0) -> tuple[tuple[float, float],
                                                                      tuple[float, float]]:
    """Return begin and end in s of the two constant-velocity phases of Eq. 3.

    Parameters
    ----------
    cycle_time : float
        T in s.
    settling : float
        Time in s to leave out at the beginning of each phase; at most 60 % of the phase is.

    Returns
    -------
    tuple of (float, float)
        The phase at +ω_c, then the phase at -ω_c.
    """
    _check_positive(cycle_time, 'cycle_time')
    skipped = min(max(settling, 0.0), 0.18 * cycle_time)
    return ((0.1 * cycle_time + skipped, 0.4 * cycle_time),
            (0.6 * cycle_time + skipped, 0.9 * cycle_time))


def current_ramp(time: ArrayLike, slope: ArrayLike, period: ArrayLike) -> float | np.ndarray:
    """Return the motor current of Eq. 8.

    The note prints the left side as a derivative, but Fig. 2 shows that the right side is the
    current itself: two ramps of opposite sign with the gradient s.

    Parameters
    ----------
    time : array_like
        Time since the cycle began in s, any shape.
    slope : array_like
        s in A/s.
    period : array_like
        T in s.

    Returns
    -------
    float or ndarray
        A, the arguments' broadcast shape; zero before and after the cycle.

    Raises
    ------
    InputError
        If the period is not positive and finite.
    """
    _check_positive(period, 'period')
    return _ramps(time, slope, period)


def ramp_peak(slope: float, period: float) -> float:
    """Return the largest current in A that the ramps of Eq. 8 reach, 0.4·s·T."""
    return 0.4 * slope * period


def _check_positive(value: ArrayLike, name: str) -> None:
    values = np.asarray(value, dtype=float)
    if not np.all(np.isfinite(values)) or np.any(values <= 0.0):
        raise InputError(f'{name} must be positive and finite, not {value!r}')
