# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""How a gear gives when it is loaded slowly for the first time, from the plant's own friction."""

from numba import njit
import numpy as np

from independent_gear.friction import motor_friction
from independent_gear.state import CLAMP, STATE

SLOW = 1e-7  # rad/s: neither damping nor viscous friction takes anything
GONE, EARLY = 0.95, 1.0 / 3.0


def first_curve(gear, points=4000):
    """Return ways in rad and the friction of rotor and link together at them, N·m.

    Parameters
    ----------
    gear : GEAR
    points : int

    Returns
    -------
    way, torque : ndarray, shape (points,)
    """
    way = np.linspace(0.0, 6.0 * max(gear['presliding'], 3.0 * gear['link_bristle']), points)
    torque = np.zeros(points)
    state = np.zeros(1, dtype=STATE)
    if gear['friction'] == CLAMP:
        torque[:] = gear['static'] * (1.0 + gear['asymmetry'])
    else:
        _load(gear, state[0], way[1], torque)
    link = gear['link_coulomb'] * -np.expm1(-way / gear['link_bristle'])
    return way, torque + link


@njit(cache=True)
def _load(gear, state, step, torque):
    """Write the rotor's friction along a slow way of even steps."""
    for k in range(1, len(torque)):
        torque[k] = motor_friction(gear, state, SLOW, 0.0, step / SLOW)


def presliding_and_stiffness(gear):
    """Return the way in rad to 95 % of breakaway, and the slope up to a third of it in A/rad.

    What is on the link's side counts: an encoder cannot tell whose friction it is. A clamp has
    neither: NaN.
    """
    if gear['friction'] == CLAMP:
        return np.nan, np.nan
    way, torque = first_curve(gear)
    early = max(int(np.argmax(torque > EARLY * torque[-1])), 2)
    slope = (torque[early] - torque[1]) / (way[early] - way[1]) / gear['torque_per_current']
    return way[int(np.argmax(torque >= GONE * torque[-1]))], slope


__all__ = ['first_curve', 'presliding_and_stiffness']
