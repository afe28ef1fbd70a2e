# Copyright 2026 The friction_comp authors
# SPDX-License-Identifier: Apache-2.0
"""A planar chain of links in the vertical plane, by Newton and Euler."""

from typing import NamedTuple

from numba import njit
import numpy as np

G = 9.81


class Chain(NamedTuple):
    """Links from the base on: masses kg, lengths m, centres of mass m, inertias kg m^2."""

    mass: np.ndarray = np.zeros(0)
    length: np.ndarray = np.zeros(0)
    centre: np.ndarray = np.zeros(0)
    inertia: np.ndarray = np.zeros(0)
    gravity: float = G


@njit(cache=True)
def torque(chain, number, q, v, a, gravity):
    """Return the torque in N.m that joint `number` needs for the motion of the whole chain.

    `q`, `v`, `a`: ndarray, shape (J,); joint angles from each link to the next, rad, rad/s,
    rad/s^2; 0 is horizontal. `gravity`: m/s^2.
    """
    angle = speed = turn = 0.0
    x = y = ax = ay = 0.0
    at_x = at_y = 0.0
    total = 0.0
    for k in range(len(chain.mass)):
        angle += q[k]
        speed += v[k]
        turn += a[k]
        if k == number:
            at_x, at_y = x, y
        c, s = np.cos(angle), np.sin(angle)
        if k >= number:
            r = chain.centre[k]
            force_x = chain.mass[k] * (ax - r * (s * turn + c * speed * speed))
            force_y = chain.mass[k] * (ay + r * (c * turn - s * speed * speed) + gravity)
            total += (x + r * c - at_x) * force_y - (y + r * s - at_y) * force_x
            total += chain.inertia[k] * turn
        r = chain.length[k]
        x += r * c
        y += r * s
        ax -= r * (s * turn + c * speed * speed)
        ay += r * (c * turn - s * speed * speed)
    return total


@njit(cache=True)
def torque_along(chain, number, q, v, a):
    """Return `torque` for a motion of shape (N, J), shape (N,)."""
    out = np.zeros(len(q))
    for i in range(len(q)):
        out[i] = torque(chain, number, q[i], v[i], a[i], chain.gravity)
    return out
